"""Whole recorded flights in other units, signs and places, with scales, constant errors and clocks that run wrong.

Every distortion is of one recording that is right, and lasts as long as it. It is named where a finding, or the refusal
of the reader, has the channel (or time) among those that it blames; a wrong channel is blamed where a finding has none
of the channels that were distorted. A distortion counts where two other channels contradict it: where a row of
`WITNESSES` is recorded.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from made_journeys import made_journey
from trials import sized

from bfi_cli.errors import LogError
from bfi_cli.flight.plausibility import Implausible, implausible_channels
from bfi_cli.flight.plausibility.implausible import circle_scales, scale_by_circles
from bfi_cli.flightlog import FlightLog, read_log, write_log
from bfi_cli.flightlog.record import frozen_array

pytestmark = [pytest.mark.slow, pytest.mark.realdata]

Signal = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Change = Callable[[Signal], Signal]

KNOT, FOOT, DEGREE, G = 1852.0 / 3600.0, 0.3048, np.pi / 180.0, 9.80665
FLIGHTS = (
    "citation_20180312_f1.h5",
    "citation_20190312_123416.h5",
    "px4_flight3",
    "sim_ae4320_de3211_1.h5",
    "reader_samples/g1000_c172.csv",
)
# By channel, sets of others of which one must be recorded: they say what it is in absolute terms.
WITNESSES: dict[str, tuple[set[str], ...]] = {
    "tas": (
        {"mach", "sat"},
        {"cas", "altitude", "sat"},
        {"velocity_north", "velocity_east", "ias"},
        {"ground_speed", "ias"},
    ),
    "cas": ({"mach", "altitude"}, {"velocity_north", "velocity_east", "ias"}),
    "ias": ({"tas", "altitude", "sat"},),
    "mach": ({"tas", "sat"}, {"cas", "altitude"}),
    "altitude": ({"cas", "mach"}, {"altitude_rate", "p_static"}),
    "sat": ({"tas", "mach"}, {"altitude", "tas", "ias"}),
    "tat": ({"sat", "mach"},),
    "aoa": ({"pitch", "tas", "altitude_rate"},),
    "pitch": ({"aoa", "tas", "altitude_rate"}, {"longitudinal_acc", "pitch_rate", "tas"}),
    "roll": ({"roll_rate", "yaw_rate", "tas"}, {"normal_acc", "yaw_rate", "tas"}),
    "altitude_rate": ({"altitude", "normal_acc"}, {"altitude", "pitch", "aoa"}),
    "normal_acc": ({"pitch", "roll", "altitude_rate"},),
    "longitudinal_acc": ({"tas", "pitch"},),
    "pitch_rate": ({"pitch", "roll"},),
    "roll_rate": ({"roll", "pitch"},),
    "yaw_rate": ({"roll", "tas"},),
}
UNITS: tuple[tuple[str, float], ...] = (
    *(("tas", 1.0 / KNOT), ("tas", 3.6), ("cas", 1.0 / KNOT), ("ias", 1.0 / KNOT), ("altitude", 1.0 / FOOT)),
    *(("altitude_rate", 60.0 / FOOT), ("aoa", 1.0 / DEGREE), ("pitch", 1.0 / DEGREE), ("roll", 1.0 / DEGREE)),
    *(("pitch_rate", 1.0 / DEGREE), ("roll_rate", 1.0 / DEGREE), ("yaw_rate", 1.0 / DEGREE)),
    *(("normal_acc", 1.0 / G), ("longitudinal_acc", 1.0 / G)),
)
SIGNS = (
    "aoa",
    "pitch",
    "roll",
    "pitch_rate",
    "roll_rate",
    "yaw_rate",
    "altitude_rate",
    "normal_acc",
    "longitudinal_acc",
)
SCALES = (("tas", 1.1), ("cas", 0.9), ("mach", 1.1))
SWAPS = (("tas", "cas"), ("pitch", "roll"), ("pitch_rate", "roll_rate"), ("tat", "sat"))
# Channels of which a difference of this size is beyond what instruments, winds and mountings make.
OFFSETS = (
    *(("tas", 10.0), ("cas", 5.0), ("mach", 0.03), ("altitude", 300.0), ("sat", 12.0), ("tat", 12.0)),
    *(("aoa", 4.0 * DEGREE), ("pitch", -4.0 * DEGREE), ("altitude_rate", 3.0), ("longitudinal_acc", 1.0)),
)
NEED_AIR_DATA = {"tas", "cas", "mach", "altitude", "sat"}


def distorted(log: FlightLog, **changes: Change) -> FlightLog:
    """Return the log with some channels recorded in another way; their stated unit is no help."""
    channels = dict(log.channels)
    for name, change in changes.items():
        values = frozen_array(change(channels[name].values))
        channels[name] = replace(channels[name], values=values, source_unit=None)
    return replace(log, channels=channels)


def is_told(log: FlightLog, names: tuple[str, ...]) -> bool:
    """Return whether others say in absolute terms what each of the channels is."""
    has = log.channels.keys() - {*names}
    return all(any(one - {*names} <= has for one in WITNESSES[name]) for name in names)


def distortions(log: FlightLog) -> Iterator[tuple[str, tuple[str, ...], FlightLog]]:
    """Yield what was done, to which channels, and the log."""
    has = log.channels.keys()
    for name, factor in UNITS:
        if name in has:
            yield f"unit {name} x {factor:.3g}", (name,), distorted(log, **{name: lambda x, f=factor: x * f})
    for name in ("sat", "tat"):
        if name in has:
            yield f"unit {name} in degC", (name,), distorted(log, **{name: lambda x: x - 273.15})
    for name in SIGNS:
        if name in has:
            yield f"sign {name}", (name,), distorted(log, **{name: lambda x: -x})
    for one, other in SWAPS:
        if {one, other} <= has:
            x, y = log.channels[one].values, log.channels[other].values
            yield f"swap {one}", (one, other), distorted(log, **{one: lambda _, y=y: y, other: lambda _, x=x: x})
    if has < NEED_AIR_DATA:
        return
    for name, factor in SCALES:
        if has >= NEED_AIR_DATA:
            yield f"scale {name} {factor}", (name,), distorted(log, **{name: lambda x, f=factor: x * f})
    for name, size in OFFSETS:
        if has >= NEED_AIR_DATA and name in has:
            yield f"offset {name} {size:.3g}", (name,), distorted(log, **{name: lambda x, s=size: x + s})


def clocks(log: FlightLog, path: Path) -> Iterator[tuple[str, tuple[Implausible, ...] | str]]:
    """Yield what is said of logs whose clock runs wrong: findings, or the refusal of the reader."""
    reversed_log = distorted(log, **dict.fromkeys(log.channels, lambda x: x[::-1]))
    for name, one in (
        ("time x 10", replace(log, time_s=log.time_s * 10.0)),
        ("ms as s", replace(log, time_s=log.time_s * 1000.0)),
        ("time x 0.1", replace(log, time_s=log.time_s * 0.1)),
        ("reversed", reversed_log),
    ):
        write_log(one, path)
        try:
            yield name, implausible_channels(read_log(path))
        except LogError as error:
            yield name, str(error)


def test_distorted_copies(flights: Path, tmp_path: Path):
    told = named = blamed = every = 0
    for flight in FLIGHTS if FULL else FLIGHTS[::2]:
        log = read_log(flights / flight)
        assert implausible_channels(log) == ()
        own = own_named = 0
        for what, channels, copy in distortions(log):
            findings = implausible_channels(copy)
            right = any({*channels} & {*one.channels, *one.rivals} for one in findings)
            wrong = any(not {*channels} & {*one.channels, *one.rivals} for one in findings)
            every, blamed = every + 1, blamed + wrong
            if is_told(log, channels):
                own, own_named = own + 1, own_named + right
            if wrong or (is_told(log, channels) and not right):
                print(flight, what, [one.text for one in findings], file=sys.stderr)
        for what, said in clocks(log, tmp_path / "clock.h5"):
            right = isinstance(said, str) or any(one.what == "clock" for one in said)
            wrong = not isinstance(said, str) and any(one.what != "clock" for one in said)
            own, own_named, every, blamed = own + 1, own_named + right, every + 1, blamed + (wrong and not right)
            if not right:
                print(flight, what, said, file=sys.stderr)
        print(f"{flight}: {own_named} of {own} named", file=sys.stderr)
        told, named = told + own, named + own_named
    print(f"{named} of {told} named, a wrong channel blamed in {blamed} of {every}", file=sys.stderr)
    assert named >= 0.9 * told
    assert blamed <= 0.03 * every


LEVEL = (("tas", 2.0), ("altitude", 100.0), ("aoa", 1.5 * DEGREE))
WINDOW_S, WINDOWS = 60.0, sized(60, 0.14)


def level_windows(log: FlightLog, n: int, seed: int) -> list[FlightLog]:
    """Return windows of level flight, at random: no more than 1.5 m/s of climb in the mean and 5 degrees of bank."""
    rng, found = np.random.default_rng(seed), list[FlightLog]()
    while len(found) < n:
        start = float(rng.uniform(900.0, log.time_s[-1] - 1200.0))
        window = log.window(start, start + WINDOW_S)
        climb, roll = window.channels["altitude_rate"].values, window.channels["roll"].values
        if abs(climb.mean()) < 1.5 and np.abs(roll).max() < 5.0 * DEGREE and window.channels["tas"].values.min() > 60.0:
            found.append(window)
    return found


@cache
def recorded_windows(flights: Path) -> list[FlightLog]:
    """Return windows of level flight of both Citations."""
    logs = [read_log(flights / flight) for flight in FLIGHTS[:2]]
    return [window for k, log in enumerate(logs) for window in level_windows(log, WINDOWS // 2, seed=k)]


@cache
def made_windows(_: Path) -> list[FlightLog]:
    """Return windows of the cruise of journeys that are made up, between two turns."""
    rng = np.random.default_rng(2)
    starts = rng.uniform(365.0, 405.0, WINDOWS)
    return [made_journey(seed=k).window(start, start + WINDOW_S) for k, start in enumerate(starts)]


# Of the recorded flights pitch and calibrated airspeed differ from the others by half of these sizes as they are.
@pytest.mark.parametrize(
    ("windows", "least"),
    [
        (made_windows, dict.fromkeys(("tas", "altitude", "aoa"), 0.9)),
        (recorded_windows, {"tas": 0.9, "altitude": 0.7, "aoa": 0.4}),
    ],
)
@pytest.mark.parametrize(("channel", "size"), LEVEL)
def test_constant_errors_in_level_flight(
    flights: Path,
    windows: Callable[[Path], list[FlightLog]],
    least: dict[str, float],
    channel: str,
    size: float,
):
    ratios, first, falsely = [], 0, 0
    for i, window in enumerate(windows(flights)):
        falsely += bool(implausible_channels(window))
        error = size if i % 2 else -size
        findings = implausible_channels(distorted(window, **{channel: lambda x, e=error: x + e}))
        one = next((one for one in findings if channel in (*one.channels, *one.rivals)), None)
        if one is not None:
            is_own = channel in one.channels and one.what == "offset"
            first += is_own
            ratios.append(-one.offset / error if is_own else np.nan)
    near = int(np.sum(np.abs(np.array(ratios) - 1.0) < 0.1))
    print(
        f"{windows.__name__} {channel} {size:.3g}: {len(ratios)} of {WINDOWS} declared, {first} first, size within "
        f"10 % in {near}, median ratio {np.nanmedian(ratios):.3f}, {falsely} undistorted",
        file=sys.stderr,
    )
    assert falsely == 0
    assert not_below(len(ratios) / WINDOWS, least[channel], WINDOWS)


def test_a_scale_of_a_circling_glider(flights: Path) -> None:
    log = read_log(flights / "px4_flight3")
    own = circle_scales(log).mean()
    rng = np.random.default_rng(0)
    named = covered = 0
    n = sized(40, 0.2)
    for _ in range(n):
        from_s = rng.uniform(1120.0, 1200.0)
        part = log.window(from_s, from_s + rng.uniform(120.0, 170.0))
        tas = part.channels["tas"]
        lost = replace(part, channels={**part.channels, "tas": replace(tas, values=frozen_array(0.9 * tas.values))})
        finding = scale_by_circles(lost)
        if finding is not None and finding.factor_ci95 is not None:
            named += 1
            covered += finding.factor_ci95[0] <= own / 0.9 <= finding.factor_ci95[1]
    print(f"a loss of 10 % is named in {named} of {n} windows, {covered} intervals hold it")
    assert named >= 0.9 * n
    assert covered >= 0.9 * named
