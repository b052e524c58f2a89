"""What a time axis may be: even but for single samples, in seconds, and forwards."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noted import texts

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import Config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import LogError
from bfi_cli.flightlog import Channel, FlightLog, read_log
from bfi_cli.flightlog.plausible import time_scale
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.flightlog.resampling import with_short_gaps
from bfi_cli.model import identify_faults

N = 400


def flown(time_s: np.ndarray, *, lacking: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """Return channels that climb and bank, with their rates."""
    signals = {
        "tas": 60.0 + 0.01 * time_s,
        "altitude": 900.0 + 50.0 * np.sin(0.05 * time_s),
        "altitude_rate": 2.5 * np.cos(0.05 * time_s),
        "roll": 0.3 * np.sin(0.2 * time_s),
        "roll_rate": 0.06 * np.cos(0.2 * time_s),
    }
    return {name: values for name, values in signals.items() if name not in lacking}


def log_of(time_s: np.ndarray, signals: dict[str, np.ndarray]) -> FlightLog:
    channels = {
        name: Channel(name=name, values=frozen_array(values), unit="", source=name) for name, values in signals.items()
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=channels)


def csv(path: Path, time_s: np.ndarray, signals: dict[str, np.ndarray]) -> Path:
    units = {"tas": "m/s", "altitude": "m", "altitude_rate": "m/s", "roll": "rad", "roll_rate": "rad/s"}
    head = ",".join(["time [s]", *(f"{name} [{units[name]}]" for name in signals)])
    np.savetxt(path, np.column_stack([time_s, *signals.values()]), delimiter=",", header=head, comments="")
    return path


def length(missing: set[int], k: int) -> int:
    """Return how many in a row are missing about one that is."""
    first = last = k
    while first - 1 in missing:
        first -= 1
    while last + 1 in missing:
        last += 1
    return last - first + 1


@given(missing=st.sets(st.integers(1, N - 2), max_size=12), rate_hz=st.sampled_from([1.0, 4.0]))
def test_what_is_straight_stays_so_where_few_samples_are_missing(missing: set[int], rate_hz: float) -> None:
    """Those in a row for more than half a second are a gap, and stay one."""
    most = max(1, int(0.5 * rate_hz))
    single = {k for k in missing if length(missing, k) <= most}
    kept = np.array([k not in missing for k in range(N)])
    time_s = 10.0 + np.arange(N) / rate_hz
    log = with_short_gaps(log_of(time_s[kept], {"tas": 3.0 * time_s[kept]}))
    filled = np.array([k not in missing - single for k in range(N)])
    np.testing.assert_allclose(log.time_s, time_s[filled], atol=1e-9)
    np.testing.assert_allclose(log.channels["tas"].values, 3.0 * time_s[filled], atol=1e-6)
    assert len(texts(log.notes)) == bool(single)


def test_a_clock_at_half_its_rate_for_long_is_no_single_sample() -> None:
    time_s = np.concatenate([np.arange(300.0), 300.0 + 2.0 * np.arange(10)])
    assert with_short_gaps(log_of(time_s, {"tas": time_s})).n_samples == 310


def test_what_the_file_lacks_beside_a_missing_sample_stays_missing() -> None:
    time_s = np.delete(np.arange(100.0), 50)
    values = np.where(np.isin(time_s, [20.0, 51.0]), np.nan, time_s)
    log = with_short_gaps(log_of(time_s, {"tas": values}))
    assert np.flatnonzero(np.isnan(log.channels["tas"].values)).tolist() == [50, 51]


@pytest.mark.parametrize("scale", [10.0, 1000.0, 1e6, 0.02, -1.0])
def test_channels_and_their_rates_tell_how_long_a_second_is(scale: float) -> None:
    time_s = np.arange(N) / 2.0
    signals = flown(time_s)
    if scale < 0.0:
        log = log_of(time_s, {name: values[::-1] for name, values in signals.items()})
    else:
        log = log_of(scale * time_s, signals)
    assert time_scale(log) == pytest.approx(1.0 / scale, rel=0.05)


@pytest.mark.parametrize("wrong", ["altitude_rate", "roll_rate", "altitude"])
@pytest.mark.parametrize("factor", [-1.0, 196.85, 0.3])
def test_one_channel_in_another_unit_is_no_matter_of_time(wrong: str, factor: float) -> None:
    signals = flown(np.arange(N) / 2.0)
    signals[wrong] = factor * signals[wrong]
    assert time_scale(log_of(np.arange(N) / 2.0, signals)) is None


@pytest.mark.parametrize(
    ("times", "backwards", "said"),
    [
        (1000.0, False, r"'time' has steps of 500 s, which no recorder of a flight has; .* --unit time=ms"),
        (10.0, False, r"a second of 'time' is 0.1\d* s: .*; multiply it by 0.1"),
        (1.0, True, r"the record runs backwards"),
    ],
)
def test_a_clock_that_is_not_in_seconds_is_refused_in_a_line(
    times: float, backwards: bool, said: str, tmp_path: Path
) -> None:
    time_s = np.arange(N) / 2.0
    signals = {name: values[::-1] if backwards else values for name, values in flown(time_s).items()}
    path = csv(tmp_path / "a.csv", times * time_s, signals)
    with pytest.raises(LogError, match=said) as refused:
        read_log(path)
    assert "\n" not in str(refused.value)


def test_the_unit_that_is_asked_for_mends_it(tmp_path: Path) -> None:
    path = csv(tmp_path / "a.csv", 500.0 * np.arange(N), flown(np.arange(N) / 2.0))
    assert read_log(path, unit_map={"time": "ms"}).rate_hz == pytest.approx(2.0)


def rows_of(clocks: list[str], header: str = "Lcl Time,TAS [kt],Pitch [deg]") -> str:
    return header + "\n" + "".join(f"{clock},{100 + k},{k % 7}\n" for k, clock in enumerate(clocks))


def clock(seconds: int) -> str:
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


MINUTE = list(range(40_000, 40_060))
ODD_CLOCKS: dict[str, tuple[list[int], list[int], str]] = {
    # Seconds as written, seconds as they were, part of the note.
    "in pairs": ([k - (k % 3 == 1) for k in MINUTE], MINUTE, "20 of its rows, which repeat or skip"),
    "set back": ([*range(40_003, 40_008), *MINUTE[5:]], MINUTE, "was set by -3 s after row 5"),
    "set back by one": ([*range(40_001, 40_006), *MINUTE[5:]], MINUTE, "re-timed"),
    "zone forwards": ([*MINUTE[:30], *(k + 3600 for k in MINUTE[30:])], MINUTE, "its zone by +1 h after row 30"),
    "zone back": ([*MINUTE[:30], *(k - 1800 for k in MINUTE[30:])], MINUTE, "its zone by -0.5 h after row 30"),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD_CLOCKS)
def test_what_a_clock_of_a_recorder_does_loses_no_row(name: str, tmp_path: Path) -> None:
    written, true, note = ODD_CLOCKS[name]
    (tmp_path / "a.csv").write_text(rows_of([clock(k) for k in written]))
    log = read_log(tmp_path / "a.csv")
    assert log.time_s.tolist() == true
    assert log.n_samples == len(written)
    assert any(note in text for text in texts(log.notes))


@pytest.mark.parametrize(
    ("change", "n", "note"),
    [
        (lambda t: np.where(np.arange(t.size) == 150, np.nan, t), 399, "rows without a time are left out: 1"),
        (lambda t: np.where(np.arange(t.size) == 150, 900.0, t), 399, "time is out of order are left out: 1"),
        (lambda t: np.where(np.arange(t.size) < 30, t + 1.2, t), 400, "was set by -1.2 s after row 30"),
        (lambda t: np.where(np.arange(t.size) < 30, t - 3e8, t), 400, "was set by +3e+08 s after row 30"),
    ],
)
def test_single_wrong_times_and_a_clock_that_is_set(change, n: int, note: str, tmp_path: Path) -> None:
    time_s = 100.0 + np.arange(N) / 4.0
    log = read_log(csv(tmp_path / "a.csv", change(time_s), {"tas": 60.0 + time_s}))
    assert any(note in text for text in texts(log.notes))
    assert log.rate_hz == pytest.approx(4.0)
    np.testing.assert_allclose(log.channels["tas"].values, 60.0 + log.time_s, atol=1e-6)
    assert log.n_samples in (n, N)  # a single missing sample is interpolated


DAY = 86_400


def stamped(seconds: np.ndarray, *, dated: bool) -> str:
    """Return a CSV log whose rows have a clock, or date and clock, and their number as airspeed."""
    stamps = (f"{clock(s % DAY)}" if not dated else f"2024-05-{1 + s // DAY:02d},{clock(s % DAY)}" for s in seconds)
    head = "date,time of day,tas [m/s]" if dated else "clock,tas [m/s]"
    return "\n".join([head, *(f"{stamp},{100 + k}" for k, stamp in enumerate(stamps))]) + "\n"


@pytest.mark.parametrize("kind", ["clock", "date and clock", "seconds", "tenths"])
@pytest.mark.parametrize("first", [43_200, DAY - 200], ids=["noon", "over midnight"])
def test_wrong_times_of_single_rows_move_no_other_row(kind: str, first: int, tmp_path: Path) -> None:
    """One to four rows of 400 have any time of the day; all others keep theirs."""
    rng, true = np.random.default_rng(first), first + np.arange(N) * (0.1 if kind == "tenths" else 1.0)
    for trial in range(6):
        wrong = 20 + 40 * rng.permutation(9)[: 1 + trial % 4]
        written = true.copy()
        written[wrong] = rng.integers(0, DAY, wrong.size)
        path = tmp_path / f"{trial}.csv"
        if kind in ("seconds", "tenths"):
            csv(path, written, {"tas": 100.0 + np.arange(N)})
        else:
            path.write_text(stamped(written.astype(int), dated=kind != "clock"))
        log = read_log(path)
        row = np.round(log.channels["tas"].values - 100.0).astype(int)  # a row between two is interpolated
        assert set(range(N)) - set(row) <= set(wrong)
        np.testing.assert_allclose(log.time_s, true[row], atol=1e-6)
        assert f"rows whose time is out of order are left out: {wrong.size}" in texts(log.notes)


@pytest.mark.parametrize("step_s", [1e-10, 2e-8])
def test_a_clock_that_no_recorder_has_is_refused_in_a_line(step_s: float, tmp_path: Path) -> None:
    path = csv(tmp_path / "a.csv", step_s * np.arange(N), {"tas": 60.0 + 0.1 * np.arange(N)})
    with pytest.raises(LogError, match=r"'time' has steps of .* s, which no recorder of a flight has; ") as refused:
        read_log(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "written",
    [
        lambda t: (70_000.0 + t).astype(np.float32).astype(np.float64),
        lambda t: np.floor(1000.0 * (12.0 + t)) / 1000.0,
        lambda t: np.round(10.0 * t) / 10.0,
    ],
    ids=["single precision at 70 000 s", "milliseconds", "tenths of a second"],
)
def test_a_drift_on_a_rounded_clock_has_its_rate(written, tmp_path: Path) -> None:
    """A drift of 1.5 m/s^2 is that to 1 %, whatever the resolution of the clock, at 99.7 Hz."""
    flight = simulate(MODELS["citation"], manoeuvre("3211", time_axis()), rng=np.random.default_rng(0), noise_sd={})
    time_s, rate_hz = np.arange(flight.n_samples) / 99.7, 99.7
    drift = 1.5 * np.maximum(0.0, time_s - time_s[600])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"] = written(time_s)
        for name, channel in flight.channels.items():
            file[name] = channel.values + (drift if name == "tas" else 0.0)
            file[name].attrs["units"] = channel.unit
    log = read_log(tmp_path / "a.h5")
    assert log.n_samples == flight.n_samples
    assert log.rate_hz == pytest.approx(rate_hz, rel=1e-4)
    entry = f"{{name: drift, shape: drift, channel: tas, onset_s: {float(log.time_s[600])!r}}}"
    (tmp_path / "d.yaml").write_text(f"atoms: [{entry}]\nrelative_to: log\n")
    found = identify_faults(log, load_dictionary(tmp_path / "d.yaml"), Config())
    (fault,) = found.faults
    assert fault.magnitude == pytest.approx(1.5, rel=0.01)
