"""What a time axis may be: even but for single samples, in seconds, and forwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import Channel, FlightLog, read_log
from bfi_cli.flightlog.plausible import time_scale
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.flightlog.resampling import with_single_samples

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


@settings(max_examples=40, deadline=None)
@given(missing=st.sets(st.integers(1, N - 2), max_size=12), rate_hz=st.sampled_from([1.0, 4.0]))
def test_what_is_straight_stays_so_where_single_samples_are_missing(missing: set[int], rate_hz: float) -> None:
    """Those in a row are a gap, and stay one."""
    single = {k for k in missing if not {k - 1, k + 1} & missing}
    kept = np.array([k not in missing for k in range(N)])
    time_s = 10.0 + np.arange(N) / rate_hz
    log = with_single_samples(log_of(time_s[kept], {"tas": 3.0 * time_s[kept]}))
    filled = np.array([k not in missing - single for k in range(N)])
    np.testing.assert_allclose(log.time_s, time_s[filled], atol=1e-9)
    np.testing.assert_allclose(log.channels["tas"].values, 3.0 * time_s[filled], atol=1e-6)
    assert len(texts(log.notes)) == bool(single)


def test_a_clock_at_half_its_rate_for_long_is_no_single_sample() -> None:
    time_s = np.concatenate([np.arange(300.0), 300.0 + 2.0 * np.arange(10)])
    assert with_single_samples(log_of(time_s, {"tas": time_s})).n_samples == 310


def test_what_the_file_lacks_beside_a_missing_sample_stays_missing() -> None:
    time_s = np.delete(np.arange(100.0), 50)
    values = np.where(np.isin(time_s, [20.0, 51.0]), np.nan, time_s)
    log = with_single_samples(log_of(time_s, {"tas": values}))
    assert np.flatnonzero(np.isnan(log.channels["tas"].values)).tolist() == [20, 50, 51]


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
