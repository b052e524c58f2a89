"""The shapes of faults: identities first, then the SPEC and the JSON object as tables."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bfi_cli.errors import DictionaryError
from bfi_cli.faults import (
    Fault,
    active_samples,
    fault_from_dict,
    fault_to_dict,
    has_channel,
    magnitude_unit,
    parse_spec,
    physical,
    tail_of,
    unit_signal,
)
from bfi_cli.faults.shapes import SHAPES

RATE_HZ = 100.0
TIME_S = np.arange(3172) / RATE_HZ
NUMBER = st.floats(-1e6, 1e6)
POSITIVE = st.floats(1e-3, 1e3)
WORD = st.text("abcdefgh_123.", min_size=1, max_size=8)
VALUES = {
    "name": WORD,
    "channel": WORD,
    "magnitude": NUMBER,
    "onset_s": st.floats(0.0, 20.0),
    "offset_s": st.floats(20.1, 40.0),
    "slope": POSITIVE,
    "frequency_hz": POSITIVE,
    "phase_rad": NUMBER,
    "phase_reference": st.sampled_from(["onset", "window"]),
    "time_constant_s": POSITIVE,
    "duration_s": POSITIVE,
    "file": WORD,
    "cabin_altitude_m": st.floats(-500.0, 4000.0),
}


@st.composite
def fault_objects(draw, shapes=tuple(SHAPES)):
    """Draw an object with the keys of a fault that are needed, and some of those that are not."""
    shape = draw(st.sampled_from(shapes))
    optional = ("name", "onset_s", "offset_s", *(key.name for key in SHAPES[shape].keys))
    optional += ("channel",) * has_channel(shape) + ("magnitude",) * SHAPES[shape].has_magnitude
    return {"shape": shape} | {k: draw(VALUES[k]) for k in optional if k in needed(shape) or draw(st.booleans())}


def needed(shape):
    return [key.name for key in SHAPES[shape].keys if key.required]


def drift_of(magnitude):
    return Fault(shape="drift", channel="altitude_rate", magnitude=pytest.approx(magnitude, rel=1e-14))


def signal(shape, time_s=TIME_S, *, window_start_s=0.0, **keys):
    return unit_signal(Fault(shape=shape, **keys), time_s, window_start_s=window_start_s)


@given(fault_objects(tuple(set(SHAPES) - {"samples"})))
def test_a_fault_is_zero_before_its_onset_and_from_its_offset_on(data):
    fault = fault_from_dict(data)
    wave = unit_signal(fault, TIME_S, window_start_s=0.0)
    stop = np.inf if fault.offset_s is None else fault.offset_s
    assert wave.shape == TIME_S.shape
    assert not wave[(fault.onset_s - 1e-7 > TIME_S) | (stop + 1e-7 <= TIME_S)].any()
    assert np.isfinite(wave).all()


SHIFTED = {
    "bias": {},
    "drift": {"slope": 0.3},
    "sine": {"frequency_hz": 0.7, "phase_reference": "window"},
    "cosine": {"frequency_hz": 0.7},
    "lagged_bias": {"time_constant_s": 2.0},
    "ramp_hold": {"duration_s": 5.0},
}


@pytest.mark.parametrize("shape", SHIFTED)
@settings(max_examples=15)
@given(st.integers(-1000, 1000))
def test_shifting_all_times_leaves_the_signal(shape, shift_s):
    axis = np.arange(0.0, 32.0, 0.25)
    here = signal(shape, axis, onset_s=3.0, offset_s=21.5, **SHIFTED[shape])
    times = {"onset_s": 3.0 + shift_s, "offset_s": 21.5 + shift_s}
    there = signal(shape, axis + shift_s, window_start_s=shift_s, **times, **SHIFTED[shape])
    np.testing.assert_allclose(there, here, atol=1e-12)


@given(st.integers(0, 3171), st.sampled_from([10.0, 50.0, 100.0]), st.sampled_from([0.0, 2400.0, 1.7e9]))
def test_an_onset_written_in_decimals_hits_its_sample(k, rate_hz, start_s):
    axis = start_s + np.arange(3172) / rate_hz
    written = float(f"{start_s + k / rate_hz:.2f}")
    assert np.flatnonzero(active_samples(Fault(shape="bias", onset_s=written), axis))[0] == k


@given(st.floats(-5.0, 40.0), st.none() | st.floats(-5.0, 45.0))
def test_a_step_is_where_its_fault_is_active(onset_s, offset_s):
    fault = Fault(shape="bias", onset_s=onset_s, offset_s=offset_s)
    np.testing.assert_array_equal(unit_signal(fault, TIME_S, window_start_s=0.0), active_samples(fault, TIME_S))


def test_onset_13_8_is_sample_1380_at_100_hz():
    assert np.flatnonzero(signal("bias", onset_s=13.8))[0] == 1380


def test_offset_is_the_first_sample_without_the_fault():
    assert np.flatnonzero(signal("bias", onset_s=1.0, offset_s=2.0))[-1] == 199


def test_an_empty_axis_and_a_single_sample():
    assert signal("bias", np.zeros(0)).shape == (0,)
    assert signal("bias", np.array([5.0]), onset_s=5.0) == [1.0]


def test_drift_is_the_running_sum_of_a_bias():
    expected = np.concatenate([[0.0], np.cumsum(signal("bias", onset_s=4.0))[:-1]]) / RATE_HZ
    np.testing.assert_allclose(signal("drift", onset_s=4.0), expected, atol=1e-12)


def test_ramp_hold_is_one_drift_less_another():
    expected = signal("drift", onset_s=4.0, slope=0.3) - signal("drift", onset_s=9.0, slope=0.3)
    np.testing.assert_allclose(signal("ramp_hold", onset_s=4.0, slope=0.3, duration_s=5.0), expected, atol=1e-12)


def test_ramp_hold_without_slope_ends_at_one_and_keeps_it():
    wave = signal("ramp_hold", onset_s=4.0, duration_s=5.0, offset_s=20.0)
    np.testing.assert_allclose(wave[900:2000], 1.0, rtol=1e-12)
    assert not wave[2000:].any()


@pytest.mark.parametrize("reference", ["onset", "window"])
def test_sine_and_cosine_lie_on_the_unit_circle_and_turn_at_their_frequency(reference):
    keys = {"onset_s": 4.0, "frequency_hz": 1.15, "phase_rad": 0.4, "phase_reference": reference}
    circle = (signal("cosine", **keys) + 1j * signal("sine", **keys))[400:]
    np.testing.assert_allclose(np.abs(circle), 1.0, rtol=1e-12)
    np.testing.assert_allclose(circle[1:] / circle[:-1], np.exp(2j * np.pi * 1.15 / RATE_HZ), rtol=1e-10)


def test_the_phase_counts_from_the_onset_or_from_the_window():
    keys = {"onset_s": 4.0, "frequency_hz": 1.15, "phase_rad": 0.4}
    assert signal("sine", **keys)[400] == pytest.approx(np.sin(0.4), abs=1e-12)
    in_window = signal("sine", **keys, phase_reference="window", window_start_s=1.0)
    assert in_window[400] == pytest.approx(np.sin(2 * np.pi * 1.15 * 3.0 + 0.4), abs=1e-12)


def test_lagged_bias_relaxes_to_one_by_the_same_factor_each_sample():
    left = 1.0 - signal("lagged_bias", onset_s=4.0, time_constant_s=2.0)[400:1400]
    np.testing.assert_allclose(left[1:] / left[:-1], np.exp(-0.01 / 2.0), rtol=1e-9)
    assert left[0] == 1.0


@pytest.mark.parametrize(
    "text", ["0,1\n2,5\n4,3\n", "time;value\n# note\n0;1\n\n2;5\n4;3\n", "\ufeffs,m/s\n0,1\n2,5\n4,3"]
)
def test_samples_pass_through_the_points_of_the_file_and_hold_the_last(tmp_path, text):
    file = tmp_path / "shape.csv"
    file.write_text(text, encoding="utf-8")
    wave = signal("samples", onset_s=10.0, offset_s=20.0, file=str(file))
    assert wave[[999, 1000, 1100, 1200, 1300, 1400, 1900, 2000]] == pytest.approx([0, 1, 3, 5, 4, 3, 3, 0], abs=1e-9)


def test_samples_are_zero_before_their_first_time(tmp_path):
    file = tmp_path / "late.csv"
    file.write_text("1,7\n2,7\n")
    assert signal("samples", file=str(file))[[0, 99, 100, 150]] == pytest.approx([0, 0, 7, 7])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("0,1\n1,x\n", "line 2: not two finite numbers"),
        ("0,1\n1\n", "line 2: not two finite numbers"),
        ("0,1\n1,nan\n", "line 2: not two finite numbers"),
        ("1,1\n0,1\n", "times do not increase"),
        ("time,value\n", "times do not increase"),
        ("", "times do not increase"),
    ],
)
def test_sample_files_that_cannot_be_used(tmp_path, text, complaint):
    file = tmp_path / "shape.csv"
    file.write_text(text)
    with pytest.raises(DictionaryError, match=complaint):
        signal("samples", file=str(file))


def test_sample_files_that_cannot_be_read(tmp_path):
    binary = tmp_path / "shape.csv"
    binary.write_bytes(b"\xff\xfe\x00")
    for path, complaint in [
        (binary, "not a text file"),
        (tmp_path / "none.csv", "no such file"),
        (tmp_path, "director"),
    ]:
        with pytest.raises(DictionaryError, match=complaint):
            signal("samples", file=str(path))


@pytest.mark.parametrize(("shape", "key"), [(shape, key) for shape in SHAPES for key in needed(shape)])
def test_a_fault_made_without_what_its_shape_needs_says_so(shape, key):
    values = {"frequency_hz": 1.0, "time_constant_s": 1.0, "duration_s": 1.0, "file": "shape.csv"}
    data = {"shape": shape} | {k: values[k] for k in needed(shape) if k != key}
    with pytest.raises(DictionaryError, match=rf"{shape}.*{key}|{key}.*{shape}"):
        fault_from_dict(data)
    with pytest.raises(DictionaryError, match=f"{shape}: {key}: missing"):
        signal(**data)


@pytest.mark.parametrize(
    ("fault", "channel_unit", "unit", "value", "physical_unit"),
    [
        (Fault(shape="bias"), "m/s", "m/s", 4.0, "m/s"),
        (Fault(shape="drift"), "m/s", "m/s^2", 4.0, "m/s^2"),
        (Fault(shape="drift", slope=0.23), "m/s", "", 0.92, "m/s^2"),
        (Fault(shape="drift"), "rad", "rad/s", 4.0, "rad/s"),
        (Fault(shape="drift"), "m/s^2", "m/s^3", 4.0, "m/s^3"),
        (Fault(shape="drift"), "", "1/s", 4.0, "1/s"),
        (Fault(shape="sine", frequency_hz=1.0), "Pa", "Pa", 4.0, "Pa"),
        (Fault(shape="lagged_bias", time_constant_s=2.0), "K", "K", 4.0, "K"),
        (Fault(shape="ramp_hold", duration_s=5.0), "m/s", "m/s", 4.0, "m/s"),
        (Fault(shape="ramp_hold", duration_s=5.0, slope=0.1), "m/s", "m/s", 2.0, "m/s"),
        (Fault(shape="samples", file="a.csv"), "m/s", "m/s", 4.0, "m/s"),
        (Fault(shape="scale"), "m/s", "", 4.0, "1"),
        (Fault(shape="pitot_icing"), "", "1/s", 4.0, "1/s"),
        (Fault(shape="pitot_water", frequency_hz=0.3), "", "", 4.0, "1"),
    ],
)
def test_what_a_magnitude_of_four_means(fault, channel_unit, unit, value, physical_unit):
    assert magnitude_unit(fault, channel_unit) == unit
    assert physical(fault, 4.0, channel_unit) == (pytest.approx(value, rel=1e-12), physical_unit)


def test_a_loss_is_stated_without_a_sign():
    with pytest.raises(DictionaryError, match=r"magnitude: a loss is positive, got -0\.002; write 0\.002"):
        parse_spec("pitot_icing,magnitude=-0.002,onset_s=3")
    assert fault_from_dict({"shape": "pitot_icing", "magnitude": -0.002}).magnitude == -0.002, "an estimate may"
    assert parse_spec("pitot_water,magnitude=-0.1,frequency_hz=0.3,onset_s=3").magnitude == -0.1


@pytest.mark.parametrize("slope", [None, 0.23])
def test_the_physical_value_is_what_the_signal_shows(slope):
    drift = 4.0 * signal("drift", onset_s=5.0, slope=slope)
    assert physical(Fault(shape="drift", slope=slope), 4.0, "m/s")[0] == pytest.approx((drift[-1] - drift[-101]) / 1.0)
    hold = Fault(shape="ramp_hold", slope=slope, duration_s=3.0, onset_s=5.0)
    plateau = 4.0 * unit_signal(hold, TIME_S, window_start_s=0.0)[-1]
    assert physical(hold, 4.0, "m/s")[0] == pytest.approx(plateau)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("bias", Fault(shape="bias")),
        (
            "bias,channel=tas,magnitude=4,onset_s=13.8",
            Fault(shape="bias", channel="tas", magnitude=4.0, onset_s=13.8),
        ),
        (" shape=drift , slope = 1e-3 ", Fault(shape="drift", slope=1e-3)),
        (
            "sine,frequency_hz=1.15,phase_reference=window",
            Fault(shape="sine", frequency_hz=1.15, phase_reference="window"),
        ),
        ("samples,file=12", Fault(shape="samples", file="12")),
        ("bias,magnitude=-36 km/h", Fault(shape="bias", magnitude=-10.0)),
        ("bias,channel=tat,magnitude=2degC", Fault(shape="bias", channel="tat", magnitude=2.0)),
        ("drift,channel=altitude_rate,magnitude=3000 ft/min/s", drift_of(3000 * 0.3048 / 60)),
        ("drift,channel=altitude_rate,magnitude=2 m/s^2", drift_of(2.0)),
        ("scale,magnitude=5%", Fault(shape="scale", magnitude=0.05)),
        ("pitot_icing,magnitude=0.01 1/s", Fault(shape="pitot_icing", channel="", magnitude=0.01)),
        ("pitot_icing,magnitude=0.01/s", Fault(shape="pitot_icing", channel="", magnitude=0.01)),
        ("pitot_icing,magnitude=1 % / s", Fault(shape="pitot_icing", channel="", magnitude=0.01)),
        ("drift,channel=altitude_rate,magnitude=2m/s2", drift_of(2.0)),
        (
            "drift,channel=normal_acc,magnitude=2 m/s^3",
            Fault(shape="drift", channel="normal_acc", magnitude=2.0),
        ),
        ("pitot_icing,magnitude=1%/s", Fault(shape="pitot_icing", channel="", magnitude=0.01)),
        ("bias,channel=my_speed,magnitude=18 km/h", Fault(shape="bias", channel="my_speed", magnitude=5.0)),
    ],
)
def test_specs(text, fault):
    assert parse_spec(text) == fault


@pytest.mark.parametrize(
    ("unit", "text", "magnitude"),
    [
        ("rad", "bias,channel=probe,magnitude=180deg", np.pi),
        ("rad", "drift,channel=probe,magnitude=180 deg/s", np.pi),
        ("1", "drift,channel=probe,magnitude=5%/s", 0.05),
        ("m/s", "bias,channel=probe,magnitude=4", 4.0),
        ("", "bias,channel=probe,magnitude=4", 4.0),
        ("", "scale,channel=probe,magnitude=5%", 0.05),
    ],
)
def test_a_magnitude_on_a_channel_without_a_standard_name_is_in_the_unit_of_the_log(unit, text, magnitude):
    assert parse_spec(text, unit_of={"probe": unit}.__getitem__).magnitude == pytest.approx(magnitude, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "size", "complaint"),
    [
        ("rad", "4kt", "is in rad, got '4kt'; give a unit of that kind, or none for SI"),
        ("rad", "4deg/s", "is in rad, got '4deg/s'; give a unit of that kind"),
        ("1", "4kt", "is a pure number, got '4kt'; leave the unit out"),
        (
            "",
            "4kt",
            "'probe' has no unit in the log, got '4kt'; state it with --unit probe=UNIT, or leave the unit out",
        ),
    ],
)
def test_a_magnitude_of_another_unit_than_that_of_the_channel_is_refused(unit, size, complaint):
    with pytest.raises(DictionaryError) as refusal:
        parse_spec(f"bias,channel=probe,magnitude={size}", unit_of={"probe": unit}.__getitem__)
    assert f": magnitude: {complaint}" in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("bais", "--fault bais: shape: unknown shape, got 'bais'; did you mean 'bias'?"),
        ("", "--fault : shape: unknown shape, got ''; known: bias"),
        ("bias,chanel=tas", "chanel: unknown key; did you mean 'channel'?"),
        ("pitot_blocked,channel=tas", "channel: not a key of this shape; known: shape, name, onset_s, offset_s"),
        (
            "static_leak,time_constant_s=2,magnitude=3",
            "magnitude: not a key of this shape; known: shape, name",
        ),
        ("pitot_icing,magnitude=0.0025,channel=cas", "channel: not a key of this shape; known: shape, name, magnitude"),
        ("pitot_water,magnitude=0.025", "frequency_hz: missing; a pitot_water needs it"),
        ("bias,slope=2", "slope: not a key of this shape; known: shape, name, channel"),
        ("bias,magnitude=four", "magnitude: must be a finite number, got 'four'"),
        ("bias,magnitude=4deg", "magnitude: is in m/s, got '4deg'; give a unit of that kind, or none for SI"),
        ("drift,magnitude=4kt", "magnitude: is in m/s^2, got '4kt'; give a unit of that kind, or none for SI"),
        ("drift,slope=2,magnitude=4kt/s", "magnitude: is a pure number, got '4kt/s'; leave the unit out"),
        ("pitot_icing,magnitude=1kt", "magnitude: is in 1/s, got '1kt'"),
        ("bias,magnitude=4 1/s", "magnitude: is in m/s, got '4 1/s'; give a unit of that kind, or none for SI"),
        ("pitot_icing,magnitude=4 m/s^2", "magnitude: is in 1/s, got '4 m/s^2'"),
        ("pitot_icing,magnitude=4 2/s", "magnitude: must be a finite number, got '4 2/s'"),
        ("pitot_icing,magnitude=4 //s", "magnitude: unknown unit '//s'"),
        ("bias,magnitude=4 knts", "magnitude: unknown unit 'knts'; did you mean 'knots'?"),
        ("bias,slop=2,magnitude=4deg", "slop: unknown key"),
        ("bias,magnitude=nan", "magnitude: must be a finite number, got nan"),
        ("bias,magnitude=", "magnitude: must be a finite number, got ''"),
        ("bias,channel=", "channel: must be text, got ''"),
        ("bias,tas", "expected key=value, got 'tas'"),
        ("bias,onset_s=1,onset_s=2", "onset_s: given twice; keep one"),
        ("bias,onset_s=5,offset_s=5", "offset_s: must be after onset_s (5 s), got 5 s"),
        ("sine", "frequency_hz: missing; a sine needs it"),
        ("sine,frequency_hz=-1", "frequency_hz: must be greater than 0, got -1"),
        ("sine,frequency_hz=1,phase_reference=log", "phase_reference: must be onset or window, got 'log'"),
        ("drift,slope=0", "slope: must not be 0, got 0"),
        ("lagged_bias,onst_s=1", "onst_s: unknown key; did you mean 'onset_s'? | time_constant_s: missing"),
    ],
)
def test_specs_that_are_refused(text, complaint):
    with pytest.raises(DictionaryError) as refusal:
        parse_spec(text)
    assert complaint in str(refusal.value)
    assert str(refusal.value).startswith("--fault")


@given(fault_objects())
def test_spec_and_json_object_say_the_same_fault(data):
    fault = fault_from_dict(data)
    assert fault_from_dict(json.loads(json.dumps(fault_to_dict(fault)))) == fault
    keys = ",".join(f"{key}={value}" for key, value in data.items() if key != "shape")
    if fault.magnitude >= 0.0 or not SHAPES[fault.shape].is_loss:
        assert parse_spec(f"{data['shape']},{keys}".rstrip(",")) == fault


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=5,
)


@pytest.mark.slow
@given(fault_objects(), st.dictionaries(st.sampled_from([*VALUES, "shape", "onset"]), ANYTHING, max_size=3))
def test_any_object_is_a_fault_or_a_dictionary_error(data, spoilt):
    try:
        fault = fault_from_dict(data | spoilt)
    except DictionaryError:
        return
    assert all(getattr(fault, key) == value for key, value in (data | spoilt).items() if value is not None)


@pytest.mark.parametrize("shape", [shape for shape in SHAPES if not has_channel(shape)])
def test_a_fault_of_a_pressure_line_names_no_channel(shape):
    """But as an entry of a dictionary, whose channel is the output that it is looked for in."""
    fault = Fault(shape=shape)
    assert fault.channel == ""
    assert Fault(shape="bias").channel == "tas"
    assert fault_to_dict(fault) == fault_to_dict(Fault(shape=shape, channel="cas"))
    assert fault_to_dict(fault)["channel"] is None
    assert (fault_to_dict(fault)["magnitude"] is None) == (not SHAPES[shape].has_magnitude)


def test_faults_need_numpy_only():
    script = (
        "import sys, bfi_cli.faults; print([m for m in ('pydantic', 'yaml', 'scipy', 'click') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "fault",
    [
        Fault(shape="bias", onset_s=2.0),
        Fault(shape="drift", onset_s=2.0, slope=-0.2),
        Fault(shape="sine", onset_s=2.0, frequency_hz=0.3, phase_rad=0.7),
        Fault(shape="cosine", onset_s=2.0, frequency_hz=0.3, phase_rad=0.7, phase_reference="window"),
        Fault(shape="lagged_bias", onset_s=2.0, time_constant_s=1.5),
        Fault(shape="ramp_hold", onset_s=2.0, duration_s=3.0, slope=0.4),
        Fault(shape="decaying_bias", onset_s=2.0, time_constant_s=1.5),
    ],
    ids=lambda fault: fault.shape,
)
def test_the_tail_of_a_shape_is_its_signal_from_there_on(fault: Fault):
    time_s = np.arange(0.0, 20.0, 0.05)
    found = tail_of(fault, window_start_s=-1.0)
    assert found is not None
    tail, since_s, from_s = found
    after = time_s >= from_s
    np.testing.assert_allclose(
        tail.at(time_s[after] - since_s), unit_signal(fault, time_s, window_start_s=-1.0)[after], atol=1e-13
    )


def test_the_tail_of_samples_is_the_last_of_them(tmp_path: Path):
    (tmp_path / "shape.csv").write_text("0,1\n2,5\n3,4\n")
    found = tail_of(Fault(shape="samples", onset_s=2.0, file=str(tmp_path / "shape.csv")), window_start_s=0.0)
    assert found is not None
    assert (found[0].level, found[2]) == (4.0, 5.0)


def test_a_fault_that_begins_later_has_its_signal_later():
    fault = Fault(shape="ramp_hold", onset_s=2.0, offset_s=9.0, duration_s=3.0)
    later = unit_signal(fault.later(4.0), TIME_S, window_start_s=0.0)
    np.testing.assert_allclose(later[400:], unit_signal(fault, TIME_S[:-400], window_start_s=0.0), atol=1e-12)
    searched = Fault(shape="bias", onset_range_s=(1.0, np.inf)).later(4.0)
    assert (searched.onset_range_s, searched.offset_s) == ((5.0, np.inf), None)
    assert (searched.called, replace(searched, name="step").called) == ("bias", "step")
