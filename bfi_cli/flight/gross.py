"""Short gross errors of the pressure lines: readings that leave the flight together, and come back.

Each second of them costs a bounded log density, so that no slow hypothesis finds them; they are counted instead. While
they last a line reads anything: its rows have a wide noise, whose density is charged like any other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..airdata import ground_speed_of
from ..kernels import BoolArray, FloatArray
from ..kernels.runs import runs
from .bench import Bench, Place, place_of, run_place
from .judge import ordinary_of
from .lines import PITOT_LEAK
from .model import second_airspeed
from .parity.record import STATIC_LEAK
from .tables import AIRSPEED_ROWS
from .weight import Ordinary, Weight, against, beside

# Standard deviations by which a height or a vertical speed, and an airspeed, leave in a gross error, and within which
# all that no pressure moves stays.
HEIGHTS, SPEEDS, STAYS = 8.0, 6.0, 5.0
# Seconds of gross errors within which part of a minute: a healthy flight of eight aircraft had at most one.
FEWEST_S, WITHIN_S = 5, 60
APART_S = 60  # between two errors of one event
SETTLED_S = 75  # after take-off and before landing, in which the model still finds its states
# Standard deviations of what a line reads while it reads anything, in multiples of the first.
WIDE = {**dict.fromkeys(AIRSPEED_ROWS, 3.0), "altitude": 5.0, "altitude_rate": 1.5}
LEFT = 0.34  # share of the largest error that may be left after it
MULTIPLES = (1.0, 3.0, 10.0)
LINE_ROWS = {PITOT_LEAK: AIRSPEED_ROWS, STATIC_LEAK: (*AIRSPEED_ROWS, "altitude", "altitude_rate")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Gross:
    """A stretch of gross errors, s on the log's axis, and how many seconds of it have one."""

    from_s: float
    to_s: float
    seconds: int


def gross_errors(bench: Bench) -> tuple[Gross, ...]:
    """Return the stretches in which pressures and airspeeds leave the flight together while all else stays."""
    model = bench.model
    size = np.nan_to_num(np.abs(bench.innovation))
    heights, speeds = (
        [model.row(name) for name in names if name in model.rows]
        for names in (("altitude", "altitude_rate"), AIRSPEED_ROWS)
    )
    others = [k for k in range(len(model.rows)) if k not in (*heights, *speeds) and model.rows[k] != "sat"]
    # Without an attitude heights and airspeeds leave together in what is a parabola.
    if not heights or not speeds or "pitch" not in model.rows:
        return ()
    leaving = (size[:, heights] > HEIGHTS).sum(axis=1) + (size[:, speeds].max(axis=1) > SPEEDS)
    errs = (leaving >= 2) & (size[:, others].max(axis=1) < STAYS) & _settled(bench)
    places = np.flatnonzero(errs)
    stretches = []
    for group in np.split(places, np.flatnonzero(np.diff(places) > APART_S) + 1):
        if group.size and max(np.searchsorted(group, group + WITHIN_S) - np.arange(group.size)) >= FEWEST_S:
            stretches.append(
                Gross(
                    from_s=float(model.time_s[group[0]]), to_s=float(model.time_s[group[-1]]) + 1.0, seconds=group.size
                )
            )
    return tuple(stretches)


def _settled(bench: Bench) -> BoolArray:
    """Return (n,) where the aircraft has flown for a while, and will."""
    settled = np.zeros(bench.model.n, dtype=bool)
    for first, end in runs(bench.model.frame.airborne):
        settled[first + SETTLED_S : max(end - SETTLED_S, first + SETTLED_S)] = True
    return settled


def swings_of(bench: Bench, gross: Gross) -> tuple[list[Weight], dict[str, float]] | None:
    """Return what lines that read anything are worth in a stretch, the best first, and the largest error by channel.

    None where they do not return to the flight.
    """
    place = place_of(bench, gross.from_s, gross.to_s)
    if place is None:
        return None
    errors = _largest_errors(bench, gross)
    if not _returns(bench, gross, errors):
        return None
    return sorted(_weights(place, ordinary_of(place)), key=lambda weight: -weight.margin), errors


def _weights(place: Place, ordinary: Ordinary) -> Iterator[Weight]:
    model, during = place.bench.model, place.during
    for fault, names in LINE_ROWS.items():
        rows = [model.row(name) for name in names if name in model.rows]
        R = np.repeat(place.R[:, None], len(MULTIPLES), axis=1)
        for h, multiple in enumerate(MULTIPLES):
            for j in rows:
                R[during, h, j] += (multiple * WIDE[model.rows[j]]) ** 2
        shocks = np.repeat(beside(place, ordinary, [model.rows[j] for j in rows])[:, None], len(MULTIPLES), axis=1)
        run = run_place(place, R=R, shocks=shocks)
        h = int(np.argmax(run.log_likelihood))
        margin, shares = against(place, ordinary, run.log_density[:, h])
        yield Weight(fault=fault, margin=margin, shares=shares, size=MULTIPLES[h])


def _largest_errors(bench: Bench, gross: Gross) -> dict[str, float]:
    """Return by channel the largest error of a stretch: from the line through the readings before and after it."""
    model = bench.model
    inside = (model.time_s >= gross.from_s - 1.0) & (model.time_s < gross.to_s + 1.0)
    errors: dict[str, float] = {}
    for name in LINE_ROWS[STATIC_LEAK]:
        if name in model.rows:
            y = model.y[:, model.row(name)]
            error = y[inside] - np.interp(model.time_s[inside], (gross.from_s, gross.to_s), _beside(bench, gross, y))
            if np.isfinite(error).any():
                channel = second_airspeed(model.seconds) if name == "cas" else name
                errors[channel] = float(error[int(np.nanargmax(np.abs(error)))])
    return errors


def _beside(bench: Bench, gross: Gross, values: FloatArray) -> tuple[float, float]:
    """Return the medians of (n,) values before and after a stretch, NaN where there are none."""
    time_s = bench.model.time_s
    before = (time_s >= gross.from_s - 25.0) & (time_s < gross.from_s - 5.0) & np.isfinite(values)
    after = (time_s >= gross.to_s + 5.0) & (time_s < gross.to_s + 25.0) & np.isfinite(values)
    first, last = (float(np.median(values[side])) if side.any() else np.nan for side in (before, after))
    return first, last


def _returns(bench: Bench, gross: Gross, errors: Mapping[str, float]) -> bool:
    """Return whether the readings come back: what is satellites' beside them is after it as it was before it."""
    model, pairs = bench.model, []
    if "gps_altitude" in model.rows and "altitude" in errors:
        pairs.append((model.y[:, model.row("altitude")] - model.y[:, model.row("gps_altitude")], errors["altitude"]))
    speed = ground_speed_of(model.seconds.channels)
    if speed is not None and "tas" in errors and "wind_north" in model.states:
        pairs.append((model.y[:, model.row("tas")] - speed, errors["tas"]))
    for values, largest in pairs:
        before, after = _beside(bench, gross, values)
        if abs(after - before) > LEFT * abs(largest):
            return False
    return True
