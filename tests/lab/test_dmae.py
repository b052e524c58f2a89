"""The double-model estimator on simulated Citation logs, and models from YAML."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.aircraft import MODELS, LinearModel, manoeuvre, simulate, time_axis
from bfi_cli.aircraft.model import load_model
from bfi_cli.errors import ConfigError, LogError
from bfi_cli.faults import parse_spec
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.lab.dmae import DmaeResult, DmaeSettings, dmae

CITATION = MODELS["citation"]
SHIPPED = Path(__file__).parents[2] / "configs" / "citation_model.yaml"
FAST = "sine,magnitude=5,frequency_hz=1.15,onset_s=6.35,phase_reference=window"
SLOW = "sine,magnitude=4,frequency_hz=0.35,onset_s=5.3,phase_reference=window"


def flight(duration_s: float = 31.72, *, seed: int = 0, model: LinearModel = CITATION, sd: float = 0.01) -> FlightLog:
    """Return a 3-2-1-1 of the Citation at 100 Hz, `sd` m/s of noise on the airspeed."""
    u = manoeuvre("3211", time_axis(duration_s=duration_s))
    return simulate(model, u, rng=np.random.default_rng(seed), noise_sd={"tas": sd})


def estimated(spec: str, duration_s: float = 31.72, **settings: object) -> tuple[DmaeResult, np.ndarray]:
    """Return the result on a flight with one fault, and the true fault."""
    log = inject(flight(duration_s), [parse_spec(spec)])
    assert log.truth is not None
    truth = log.channel("tas").values - log.truth.clean["tas"]
    return dmae(log, CITATION, settings=DmaeSettings(**settings)), truth


def vaf(truth: np.ndarray, estimate: np.ndarray) -> float:
    """Return the variance accounted for in % (equation 5-2 of the thesis)."""
    return float(100.0 * (1.0 - np.sum((truth - estimate) ** 2) / np.sum(truth**2)))


def test_a_flight_without_a_fault_has_none():
    log = flight(12.0)
    found = dmae(log, CITATION)
    assert found.onset_s is None
    assert np.abs(found.fault).max() < 0.01
    assert found.probability[-1] == pytest.approx(0.001, abs=1e-4)
    np.testing.assert_allclose(found.estimate[:, 0], log.channel("tas").values, rtol=0, atol=0.05)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("magnitude", [1.0, -6.0, 4.0])
def test_a_bias_of_the_airspeed_is_found_at_its_onset_with_its_magnitude(magnitude):
    found, truth = estimated(f"bias,magnitude={magnitude},onset_s=8", 15.0)
    assert found.onset_s == pytest.approx(8.0, abs=0.015)
    assert found.fault[-1] == pytest.approx(magnitude, rel=0.03)
    assert abs(found.fault[-1] - magnitude) < 2.0 * found.fault_sd[-1]
    assert vaf(truth, found.fault) > 99.0
    clean = found.measured - truth
    np.testing.assert_allclose(found.estimate[-300:, 0], clean[-300:], rtol=0, atol=0.03 * abs(magnitude) + 0.03)


@pytest.mark.slow
def test_a_fast_sinusoid_is_followed_and_a_slow_one_mistaken_for_a_bias():
    """Figures 5-5 and 5-6 of the thesis, with their Q = 1e-5 diag 0.4 and R = 0.01."""
    fast, truth = estimated(FAST)
    active = truth != 0
    assert fast.onset_s == pytest.approx(6.35, abs=0.005)
    assert vaf(truth, fast.fault) > 80.0
    assert np.corrcoef(truth[active], fast.fault[active])[0, 1] > 0.9
    crossings = np.sum(np.diff(np.sign(fast.fault_if_any[active])) != 0)
    assert crossings >= 0.9 * np.sum(np.diff(np.sign(truth[active])) != 0)

    slow, truth = estimated(SLOW)
    later = slow.time_s > 7.0
    assert slow.onset_s == pytest.approx(5.3, abs=0.005)
    assert slow.probability[later].min() > 0.99
    assert vaf(truth, slow.fault) < 0.0
    assert slow.fault[later].std() < 0.02
    assert -4.0 < slow.fault[later].mean() < -3.0


@pytest.mark.slow
def test_adaptive_noise_follows_both_sinusoids():
    for spec in (FAST, SLOW):
        found, truth = estimated(spec, 12.0, adaptive_window=20)
        assert vaf(truth, found.fault) > 90.0


def test_all_measured_states_tell_a_slow_fault_from_motion():
    log = inject(flight(15.0), [parse_spec(SLOW)])
    truth = log.channel("tas").values - log.truth.clean["tas"]
    settings = DmaeSettings(measurement_variance=(0.01, 1e-4, 1e-4, 1e-4))
    found = dmae(log, CITATION, measured=CITATION.outputs, settings=settings)
    assert found.outputs == CITATION.outputs
    assert vaf(truth, found.fault) > 80.0


def test_a_fault_of_another_channel_is_found():
    log = inject(flight(12.0), [parse_spec("bias,channel=pitch_rate,magnitude=0.05,onset_s=6")])
    settings = DmaeSettings(measurement_variance=(0.01, 1e-6), process_variance=1e-9, reset_variance=1.0)
    found = dmae(log, CITATION, channel="pitch_rate", measured=("tas", "pitch_rate"), settings=settings)
    assert found.unit == "rad/s"
    assert found.onset_s == pytest.approx(6.0, abs=0.015)
    assert found.fault[-1] == pytest.approx(0.05, rel=0.03)


def test_innovations_are_as_large_as_expected_where_the_settings_are_the_truth():
    log = flight(10.0, sd=0.1)
    found = dmae(log, CITATION, settings=DmaeSettings(process_variance=0.0, measurement_variance=0.01))
    scaled = found.innovation[:, 0, 0] / found.innovation_sd[:, 0, 0]
    n = scaled.size
    assert abs(np.mean(scaled**2) - 1.0) < 4.0 * np.sqrt(2.0 / n)
    assert abs(np.mean(scaled[1:] * scaled[:-1])) < 4.0 / np.sqrt(n)


@pytest.mark.slow
def test_another_reference_only_moves_the_trim():
    log = flight(12.0)
    raised = log.channel("tas")
    moved = replace(log, channels={**log.channels, "tas": replace(raised, values=frozen_array(raised.values + 20.0))})
    at_trim, at_start = dmae(log, CITATION), dmae(moved, CITATION, reference="start")
    assert at_start.onset_s is None
    np.testing.assert_allclose(at_start.estimate[200:] - 20.0, at_trim.estimate[200:], rtol=0, atol=0.05)


def test_results_are_read_only_and_as_long_as_the_log():
    found, truth = estimated("bias,magnitude=2,onset_s=2", 4.0)
    for name in ("fault", "fault_sd", "fault_if_any", "probability", "state", "state_sd", "estimate", "innovation"):
        values = getattr(found, name)
        assert len(values) == truth.size
        assert np.isfinite(values).all()
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


def test_the_shipped_model_is_the_citation():
    shipped = load_model(SHIPPED)
    for name in ("name", "title", "states", "inputs", "outputs", "trim", "airspeed_m_s", "source"):
        assert getattr(shipped, name) == getattr(CITATION, name)
    assert shipped.units == dict(CITATION.units)
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(shipped, name), getattr(CITATION, name))


def test_a_model_with_its_own_outputs_and_units_flies(tmp_path):
    path = tmp_path / "spring.yaml"
    path.write_text(
        "{name: spring, airspeed_m_s: 50, states: [place, tas], inputs: [push], outputs: [tas],"
        " units: {place: m, push: N}, A: [[0, 1], [-4, -1]], B: [[0], [1]], trim: {tas: 50}}"
    )
    model = load_model(path)
    np.testing.assert_array_equal(model.C, [[0.0, 1.0]])
    np.testing.assert_array_equal(model.D, [[0.0]])
    assert model.units == {"place": "m", "tas": "m/s", "push": "N"}
    push = manoeuvre("3211", time_axis(duration_s=12.0), amplitude_rad=4.0)
    log = simulate(model, push, rng=np.random.default_rng(0), noise_sd={"tas": 0.01})
    found = dmae(inject(log, [parse_spec("bias,magnitude=2,onset_s=6")]), model)
    assert found.onset_s == pytest.approx(6.0, abs=0.015)
    assert found.fault[-1] == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("trim:", "trm:", "trm: unknown key; did you mean 'trim'?"),
        ("[0.0, 0.0, 0.0, 1.0]", "[0.0, 1.0]", "A: the names ask for 4 rows of 4, got 4 of 2 or 4"),
        ("  - [-0.1186]\n", "", "B: the names ask for 4 rows of 1, got 3 of 1"),
        ("{tas: 100.0}", "{xas: 3}", "trim: 'xas' is no state, input or output"),
        ("[elevator]", "[lever]", "units: 'lever' is no standard channel; add its unit"),
        ("outputs: [tas,", "outputs: [cas,", "C: missing, and output 'cas' is no state; add C"),
        ("outputs: [tas, aoa", "outputs: [tas, tas", "outputs: a name stands twice; keep one"),
        ("-0.4525", "oops", "B[0][0]: must be a number, got 'oops'"),
        ("airspeed_m_s: 100.0", "airspeed_m_s: -1", "airspeed_m_s: must be greater than 0, got -1"),
        ("trim: {", "units: {tas: kt}\ntrim: {", "units: 'tas' is in m/s in a model, got 'kt'; convert the matrices"),
    ],
)
def test_a_wrong_model_file_is_told_what_is_wrong(tmp_path, old, new, message):
    path, text = tmp_path / "model.yaml", SHIPPED.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        load_model(path)
    assert str(caught.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"process_variance": -1.0}, "dmae: process_variance: must be finite and not negative, got -1.0; change it"),
        (
            {"measurement_variance": (0.01, 0.0)},
            "dmae: measurement_variance: must be finite and positive, got (0.01, 0.0)",
        ),
        ({"fault_variance": np.nan}, "dmae: fault_variance: must be finite and not negative, got nan"),
        ({"prior_fault": 1.0}, "dmae: prior_fault: must lie between 0 and 1, got 1.0"),
        ({"floor": 0.5}, "dmae: floor: must lie between 0 and 0.5, got 0.5"),
        ({"adaptive_window": 0}, "dmae: adaptive_window: must be at least 1 sample, got 0"),
        ({"process_variance": (1e-6, 1e-6)}, "dmae: process_variance: must be one number or 4, got 2"),
        ({"initial_variance": np.inf}, "dmae: initial_variance: must be finite and not negative, got inf"),
    ],
)
def test_wrong_settings_are_told_what_is_wrong(settings, message):
    with pytest.raises(ConfigError) as caught:
        dmae(flight(2.0), CITATION, measured=("tas",), settings=DmaeSettings(**settings))
    assert str(caught.value).startswith(message)


def test_variances_too_far_apart_for_double_precision_are_told_so():
    settings = DmaeSettings(initial_variance=1e8, measurement_variance=1e-14)
    log, twice = flight(2.0), np.array([[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    log = replace(log, channels={**log.channels, "cas": log.channel("tas")})
    model = replace(CITATION, outputs=("tas", "cas"), C=twice, D=np.zeros((2, 1)), trim={"tas": 100.0, "cas": 100.0})
    with pytest.raises(ConfigError, match="dmae: the covariance of the innovation is not positive definite; bring"):
        dmae(log, model, measured=model.outputs, settings=settings)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"channel": "pitchrate"}, "dmae: model 'citation' has no output 'pitchrate'; did you mean 'pitch_rate'?"),
        ({"measured": ("aoa",)}, "dmae: measured: must name every output once, and 'tas' among them, got aoa"),
        ({"measured": ("tas", "tas")}, "dmae: measured: must name every output once"),
    ],
)
def test_wrong_outputs_are_told_what_is_wrong(options, message):
    with pytest.raises(ConfigError) as caught:
        dmae(flight(2.0), CITATION, **options)
    assert str(caught.value).startswith(message)


def test_a_log_without_the_input_is_refused():
    log = flight(2.0)
    without = replace(log, channels={name: log.channels[name] for name in CITATION.outputs})
    with pytest.raises(LogError, match="no channel 'elevator'"):
        dmae(without, CITATION)
