"""What `inspect_log` sees, and the lines `require_usable` stops with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_logs import made_log

from bfi_cli.errors import LogError
from bfi_cli.flightlog import Channel, FlightLog, inspect_log, quality, read_log, require_usable
from bfi_cli.flightlog.excitation import advice_on_windows
from bfi_cli.flightlog.quality import advice_on_the_ground, gap_starts, is_long, is_uniform, time_jitter
from bfi_cli.flightlog.record import frozen_array

T = np.arange(0.0, 60.0, 0.1)
RNG = np.random.default_rng(3)
TAS = 90.0 + 3.0 * np.sin(2 * np.pi * T / 20.0) + 0.1 * RNG.normal(size=T.size)
STEPS = sum(0.02 * way * ((a <= T) & (b > T)) for a, b, way in ((20, 23, 1), (23, 25, -1), (25, 26, 1), (26, 27, -1)))


@given(rate=st.floats(0.1, 1000.0), start=st.floats(0.0, 5000.0), single=st.booleans())
def test_a_uniform_axis_is_uniform_also_in_single_precision(rate: float, start: float, single: bool):
    time_s = start + np.arange(300) / rate
    if single:
        time_s = time_s.astype(np.float32).astype(float)
    if np.diff(time_s).min() > 0.5 / rate:
        assert is_uniform(time_s)


@given(at=st.integers(1, 298), missing=st.integers(1, 50))
def test_a_missing_sample_is_a_gap_where_it_is(at: int, missing: int):
    time_s = np.delete(np.arange(350) * 0.02, slice(at, at + missing))
    assert gap_starts(time_s).tolist() == [at - 1]
    assert not is_uniform(time_s)
    assert time_jitter(time_s) < 1e-9


@pytest.mark.parametrize("piece", [7, 100, 10_000])
@pytest.mark.parametrize("at", [0, 6, 7, 8, 500, 998])
def test_pieces_of_a_time_axis_find_the_same_uneven_step(monkeypatch: pytest.MonkeyPatch, piece: int, at: int):
    monkeypatch.setattr(quality, "PIECE", piece)
    even = 100.0 + np.arange(1000) / 10.0
    uneven = even + 0.05 * (np.arange(1000) > at)
    assert quality.is_uniform(even)
    assert not quality.is_uniform(uneven)
    assert quality.is_uniform(even.astype(np.float32).astype(np.float64))
    with pytest.raises(LogError, match=f"time step is not uniform: 0.15 s at sample {at + 1}, 0.1 s elsewhere"):
        require_usable(FlightLog(path="a", time_s=uneven, channels={}), [])


def test_a_report_of_each_channel():
    held, rough, broken = TAS[(np.arange(T.size) // 10) * 10], np.round(TAS / 0.5) * 0.5, TAS.copy()
    broken[[7, 9]] = np.nan, np.inf
    report = inspect_log(made_log(T, held=held, rough=rough, broken=broken, empty=np.full(T.size, np.nan)))
    by_name = {channel.name: channel for channel in report.channels}
    assert by_name["held"].hold_period_s == pytest.approx(1.0)
    assert by_name["held"].held_fraction == pytest.approx(0.9, abs=0.01)
    assert (by_name["rough"].hold_period_s, by_name["rough"].held_fraction) == (None, 0.0)
    assert by_name["rough"].quantum == pytest.approx(0.5)
    assert by_name["broken"].n_nan == 2
    assert by_name["broken"].quantum is None
    assert by_name["broken"].max == pytest.approx(np.delete(TAS, [7, 9]).max())
    assert (by_name["empty"].n_nan, by_name["empty"].min, by_name["empty"].max) == (T.size, None, None)
    assert (report.rate_hz, report.uniform, report.gaps) == (10.0, True, ())


def test_the_manoeuvre_is_the_suggested_window():
    report = inspect_log(made_log(T, {"elevator": "rad"}, tas=TAS, elevator=STEPS))
    (window,) = report.windows
    assert window.channel == "elevator"
    assert window.moves == 5
    assert window.start_s == pytest.approx(15.0, abs=0.5)
    assert window.stop_s == pytest.approx(42.0, abs=0.5)
    (excitation,) = report.excitation
    assert excitation.range == pytest.approx(0.04)
    assert 0.1 < (excitation.bandwidth_hz or 0.0) < 5.0


@given(frequency=st.floats(0.2, 1.0))
def test_the_bandwidth_of_a_sine_is_its_frequency_and_it_moves_twice_a_period(frequency: float):
    report = inspect_log(made_log(T, elevator=np.sin(2 * np.pi * frequency * T)))
    assert report.excitation[0].bandwidth_hz == pytest.approx(frequency, abs=0.06)
    assert report.excitation[0].moves == pytest.approx(2 * frequency * 60.0, abs=3)


def test_no_window_spans_a_gap_or_the_ground():
    keep = (T < 24.0) | (T > 28.0)
    moving = made_log(T[keep], tas=TAS[keep], elevator=np.sin(2 * np.pi * 0.5 * T[keep]))
    report = inspect_log(moving)
    assert report.gaps == ((pytest.approx(23.9), pytest.approx(28.1)),)
    assert [window.stop_s <= 24.0 or window.start_s >= 28.0 for window in report.windows] == [True, True]
    taxiing = made_log(T, tas=np.where(T < 40.0, 2.0, TAS), elevator=STEPS)
    assert inspect_log(taxiing).windows == ()


def test_an_input_at_rest_has_no_window_and_no_bandwidth():
    report = inspect_log(made_log(T, elevator=np.zeros(T.size), aileron=np.full(T.size, np.nan)))
    assert report.windows == ()
    assert [(e.range, e.moves, e.bandwidth_hz) for e in report.excitation] == [(0.0, 0, None)] * 2


def test_a_sound_log_is_usable_under_either_name():
    log = made_log(T, tas=TAS, elevator=STEPS)
    require_usable(log, ["tas", "elevator"])


def usable_line(log, names, **options) -> str:
    with pytest.raises(LogError) as caught:
        require_usable(log, names, **options)
    return str(caught.value)


def test_a_missing_channel():
    line = usable_line(made_log(T, tas=TAS, pitch=TAS), ["tas", "aoa"])
    assert line == "made.h5: no channel 'aoa'; the log has: pitch, tas; map one with --channel aoa=NAME"


@pytest.mark.parametrize("resampling", [False, True])
def test_nan(resampling: bool):
    tas = TAS.copy()
    tas[[30, 31, 50]] = np.nan
    line = usable_line(made_log(T, tas=tas), ["tas"], resampling=resampling)
    assert line.startswith("made.h5: 'tas' is not a number at sample 30 (3 s), 3 of 600 samples in all; ")


def test_nan_in_a_channel_that_is_not_asked_for_does_not_matter():
    require_usable(made_log(T, tas=TAS, other=np.full(T.size, np.nan)), ["tas"])


def test_an_uneven_time_step_unless_it_is_resampled():
    time_s = T.copy()
    time_s[300:] += 0.24
    log = made_log(time_s, tas=TAS)
    assert usable_line(log, ["tas"]) == (
        "made.h5: time step is not uniform: 0.34 s at sample 300, 0.1 s elsewhere; "
        "give --rate to resample, or cut the window with --from/--to"
    )
    require_usable(log, ["tas"], resampling=True)


def test_held_samples_unless_it_is_resampled():
    log = made_log(T, tas=TAS[(np.arange(T.size) // 10) * 10])
    assert usable_line(log, ["tas"]) == (
        "made.h5: 'tas' repeats its value 90 % of the time (held samples, about 1 Hz); give --rate 1 to decimate"
    )
    require_usable(log, ["tas"], resampling=True)


@pytest.mark.realdata
def test_recorded_flights_are_usable_and_their_manoeuvres_found(flights: Path):
    for name in ("citation_20180312_f1.h5", "citation_20190312_123416.h5", "sim_ae4320_de3211_1.h5"):
        log = read_log(flights / name)
        report = inspect_log(log)
        assert report.uniform
        assert report.gaps == ()
        assert all(channel.hold_period_s is None and channel.n_nan == 0 for channel in report.channels)
        steps = [s for s in log.segments if s.label in ("short_period_step", "de3211_1")]
        assert any(w.start_s < step.stop_s and w.stop_s > step.start_s for step in steps for w in report.windows)
        require_usable(log, ["tas", "elevator"])


def test_a_long_record_without_moves_has_no_window_to_suggest():
    time_s = np.arange(0.0, 700.0, 0.5)
    tas = 90.0 + np.sin(time_s)
    assert advice_on_windows(made_log(time_s, tas=tas, elevator=np.zeros(time_s.size))) == (
        "the record is 12 min long; windows to take: none stands out"
    )
    assert is_long(made_log(time_s, tas=tas))
    assert not is_long(made_log(time_s[:1200], tas=tas[:1200]))


def test_a_window_on_the_ground_is_called_that():
    time_s = np.arange(6000) / 10.0
    tas = np.interp(time_s, [0.0, 200.0, 230.0, 500.0, 530.0], [0.0, 0.0, 60.0, 60.0, 0.0])
    tas += 0.3 * np.random.default_rng(0).standard_normal(time_s.size)
    log = made_log(time_s, tas=tas)
    said = advice_on_the_ground(log, 20.0, 120.0)
    assert said is not None
    assert said.startswith("the aircraft is on the ground for most of the window, 20 to 120 s (in flight from 2")
    assert advice_on_the_ground(log, 250.0, 450.0) is None
    assert advice_on_the_ground(log, None, None) is None


def test_two_sensors_of_one_quantity_are_held_against_each_other():
    time_s = np.arange(200) / 10.0
    tas = 90.0 + np.sin(time_s)
    made = {"tas_1": tas, "tas_2": tas + 1.5, "pitch": 0.1 * tas}
    channels = {
        name: Channel(name=name, values=frozen_array(values), unit="rad" if name == "pitch" else "m/s", source=name)
        for name, values in made.items()
    }
    found = inspect_log(FlightLog(path="made", time_s=frozen_array(time_s), channels=channels))
    said = [note.text for note in found.notes if "two sensors" in note.text]
    assert len(said) == 1
    assert said[0].startswith("tas_1 and tas_2 are two sensors of one quantity: the second reads 1.5 m/s more")


@pytest.mark.parametrize("errs", [0.0, 1.5], ids=["all agree", "one errs"])
def test_of_three_sensors_the_odd_one_is_named(errs: float):
    time_s = np.arange(200) / 10.0
    tas = 90.0 + np.sin(time_s)
    values = {"tas": tas, "tas_2": tas + errs, "tas_3": tas + 0.1 * np.cos(time_s)}
    if not errs:
        values["tas_2"] = tas - 0.1 * np.sin(time_s)
    found = inspect_log(
        FlightLog(
            path="made",
            time_s=frozen_array(time_s),
            channels={
                name: Channel(name=name, values=frozen_array(one), unit="m/s", source=name)
                for name, one in values.items()
            },
        )
    )
    said = [note.text for note in found.notes if "neither" in note.text]
    assert [text.partition(":")[0] for text in said] == ["tas_2 agrees with neither tas nor tas_3"] * bool(errs)
