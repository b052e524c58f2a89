"""Faults of a pressure line in a dictionary: their signal from the log that has them, found, told apart, refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.airdata import channels_of, impact_pressure_of_mach, isa_temperature, mach_of_tas, pressure_at
from bfi_cli.airdata.airspeed import total_temperature
from bfi_cli.audit import audit_dictionary, audit_on_log
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import DictionaryError
from bfi_cli.faults import Fault, parse_spec
from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.injection import line_signals, without_line_fault
from bfi_cli.flightlog.record import Channel, frozen_array
from bfi_cli.kernels.low_pass import IDENTITY
from bfi_cli.kernels.variable_projection import fit_magnitudes
from bfi_cli.model import identify_faults
from bfi_cli.model.preprocessing.window import prepare_window, regression_of, with_sizes
from bfi_cli.quantities.channels import STANDARD

N, ONSET_S = 600, 25.0
TIME_S = np.arange(N) / 10.0
CONFIG = merge(Config(), {"conditioning.rate_hz": "none", "model.orders": (2,), "onset_tolerance_s": 0.0})
ENTRIES = [
    {"name": "icing", "shape": "pitot_icing", "onset_s": ONSET_S},
    {"name": "leak", "shape": "pitot_leak", "onset_s": ONSET_S, "time_constant_s": 60.0},
    {"name": "water", "shape": "pitot_water", "onset_s": ONSET_S, "frequency_hz": 0.3},
    {"name": "static", "shape": "static_leak", "onset_s": ONSET_S, "time_constant_s": 3000.0},
    {"name": "bias", "shape": "bias", "onset_s": ONSET_S},
]
SPECS = {
    "icing": ("pitot_icing,magnitude=0.006", 0.006, "1/s"),
    "leak": ("pitot_leak,time_constant_s=60", 1.0, ""),
    "water": ("pitot_water,magnitude=0.03,frequency_hz=0.3", 0.03, ""),
    "static": ("static_leak,time_constant_s=3000", 1.0, ""),
}


def flown(seed: int) -> FlightLog:
    """Return the air data of an airspeed that moves by twenty metres per second in a slow climb."""
    rng = np.random.default_rng(seed)
    elevator, speed = 0.05 * np.sign(np.sin(0.4 * TIME_S)) + 0.01 * rng.standard_normal(N), np.zeros(N)
    for k in range(1, N):
        speed[k] = 0.95 * speed[k - 1] + 10.0 * elevator[k - 1] + 0.02 * rng.standard_normal()
    altitude = 2000.0 + 3.0 * TIME_S
    p_static = pressure_at(altitude)
    tat = total_temperature(isa_temperature(altitude) + 5.0, 0.25)
    made = channels_of(p_static, impact_pressure_of_mach(mach_of_tas(80.0 + speed, tat), p_static), tat)
    values = {"elevator": elevator, "tat": tat, **{name: made[name] for name in ("altitude", "cas", "tas", "q_impact")}}
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=STANDARD[name].unit, source=name)
        for name, one in values.items()
    }
    return FlightLog(path="made.h5", time_s=frozen_array(TIME_S), channels=channels, filters=())


def fault_of(entry: str, **keys: object) -> Fault:
    return replace(parse_spec(SPECS[entry][0]), onset_s=ONSET_S, name=entry, **keys)


@pytest.mark.parametrize("offset_s", [None, 45.0])
@pytest.mark.parametrize("entry", SPECS)
def test_at_its_size_the_signal_is_all_that_the_fault_added(entry: str, offset_s: float | None) -> None:
    clean, fault = flown(0), fault_of(entry, offset_s=offset_s)
    faulty = inject(clean, [fault])
    signals = line_signals(faulty, fault, IDENTITY, size=fault.magnitude)
    assert faulty.truth is not None
    assert signals.keys() == faulty.truth.clean.keys()
    for name, signal in signals.items():
        added = faulty.channel(name).values - clean.channel(name).values
        np.testing.assert_allclose(fault.magnitude * signal.values, added, rtol=1e-7, atol=1e-7, err_msg=name)
    back = without_line_fault(faulty, fault, IDENTITY)
    for name in clean.channels:
        np.testing.assert_allclose(back.channel(name).values, clean.channel(name).values, rtol=1e-9, err_msg=name)


@pytest.mark.parametrize("entry", ["icing", "water"])
def test_the_derivative_is_the_limit_of_what_small_faults_add(entry: str) -> None:
    log, small = flown(0), 1e-6
    signals = line_signals(log, fault_of(entry), IDENTITY)
    added = inject(log, [replace(fault_of(entry), magnitude=small)])
    for name, signal in signals.items():
        change = (added.channel(name).values - log.channel(name).values) / small
        np.testing.assert_allclose(signal.values, change, atol=1e-4 * np.abs(change).max())


@pytest.mark.parametrize("entry", SPECS)
def test_through_a_recorder_nearly_all_of_it_is_taken_out(entry: str) -> None:
    log = replace(flown(0), filters=(Filter(kind="gaussian", edge_hz=0.75, rate_hz=10.0),))
    fault = fault_of(entry)
    faulty, response = inject(log, [fault]), response_of(log.filters or (), 10.0)
    signal = line_signals(faulty, fault, response, size=fault.magnitude)["tas"].values
    added = faulty.channel("tas").values - log.channel("tas").values
    assert np.abs(fault.magnitude * signal - added).max() < 0.01 * np.abs(added).max()


@pytest.mark.parametrize("entry", ["icing", "leak", "water"])
def test_the_impact_pressure_is_scaled_by_its_signal(entry: str) -> None:
    """So that by how much the signal changes with the output is their ratio, and its logarithm that of the density."""
    log = inject(flown(1), [fault_of(entry)])
    signal = line_signals(log, fault_of(entry), IDENTITY, size=fault_of(entry).magnitude)["q_impact"]
    np.testing.assert_allclose(signal.slopes, signal.values / log.channel("q_impact").values, rtol=1e-6, atol=1e-9)
    window = prepare_window(
        log, load_dictionary({"channel": "q_impact", "atoms": ENTRIES[:3]}), with_output("q_impact")
    )
    place = [one["name"] for one in ENTRIES].index(entry)
    window = with_sizes(window, {place: fault_of(entry).magnitude})
    regression = regression_of(window, with_output("q_impact"))
    problem, z = regression.problem(2), 0.7 * fault_of(entry).magnitude
    at = np.array([z / regression.magnitude_unit[place]])
    counted, plain = (
        fit_magnitudes(one, (place,), at, max_iterations=0).log_det for one in (problem, replace(problem, slopes=None))
    )
    factor = np.log(np.abs(1.0 - z * signal.slopes[-problem.n_rows :]))
    np.testing.assert_allclose(counted - plain, -2.0 * factor.mean(), rtol=1e-2)


def with_output(name: str) -> Config:
    return merge(CONFIG, {"outputs": (name,)})


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("entry", ["static", "icing", "leak", "water"])
@pytest.mark.parametrize("seed", [0, 1])
def test_it_is_found_with_its_size_in_its_own_unit(entry: str, seed: int) -> None:
    result = identify_faults(inject(flown(seed), [fault_of(entry)]), load_dictionary({"atoms": ENTRIES}), CONFIG)
    (fault,) = result.faults
    _, magnitude, unit = SPECS[entry]
    assert (fault.name, fault.unit) == (entry, unit)
    assert abs(fault.magnitude - magnitude) <= 3.0 * fault.sd
    assert fault.sd < 0.1 * magnitude
    assert result.truth is not None
    assert result.truth.isolated


@pytest.mark.slow
def test_a_bias_is_not_taken_for_one_and_without_a_fault_none_is_declared() -> None:
    """Nor two of them that cancel but for an output scaled down to nothing, whose errors would be the smallest."""
    dictionary = load_dictionary({"atoms": ENTRIES})
    log = inject(flown(4), [Fault(shape="bias", channel="tas", magnitude=2.0, onset_s=ONSET_S, name="bias")])
    assert [fault.name for fault in identify_faults(log, dictionary, CONFIG).faults] == ["bias"]
    assert not identify_faults(flown(10), dictionary, CONFIG).faults


def test_half_a_leak_is_none() -> None:
    """A line that loses its pressure over 300 s is not a third of one that loses it over 100 s."""
    slow = replace(fault_of("leak"), time_constant_s=300.0)
    entries = [{**ENTRIES[1], "time_constant_s": 100.0}]
    result = identify_faults(inject(flown(2), [slow]), load_dictionary({"atoms": entries}), CONFIG)
    (leak,) = result.candidates
    assert (leak.state, result.faults) == ("suspected", ())
    assert "times what all of it would be: another time constant, or another fault" in (leak.note or "")


def test_several_outputs_show_it_together() -> None:
    config = merge(CONFIG, {"outputs": ("tas", "altitude")})
    window = prepare_window(flown(0), load_dictionary({"atoms": ENTRIES}), config)
    moved = np.any(window.native.theta_between(slice(None)), axis=0)
    assert moved.T.tolist() == [[True, False], [True, False], [True, False], [True, True], [True, False]]


@pytest.mark.parametrize("shape", ["pitot_blocked", "static_blocked"])
def test_a_trapped_line_is_refused_with_the_analysis_that_finds_it(shape: str) -> None:
    with pytest.raises(DictionaryError, match=r"keeps no trace of the pressure outside, .*; use bfi diagnose"):
        load_dictionary({"atoms": [{"shape": shape, "onset_s": ONSET_S}]})
    with pytest.raises(DictionaryError, match=r"keeps no trace of the pressure outside; use bfi diagnose"):
        line_signals(flown(0), Fault(shape=shape, onset_s=ONSET_S), IDENTITY)


def bare(*names: str) -> FlightLog:
    log = flown(0)
    return replace(log, channels={name: log.channels[name] for name in names})


@pytest.mark.parametrize(
    ("log", "entry", "words"),
    [
        (
            bare("elevator", "tas"),
            ENTRIES[0],
            "fault 'icing': p_static needs one of p_static, altitude; the log has: elevator, tas; map one with",
        ),
        (
            flown(0),
            {**ENTRIES[1], "time_constant_s": 10.0},
            "fault 'leak': leaves less than 15 % of the line's pressure from 44 s on, which tells no airspeed",
        ),
        (
            flown(0),
            {**ENTRIES[0], "channel": "elevator"},
            "'icing' acts on 'elevator', which is no output (tas)",
        ),
    ],
)
def test_what_the_log_does_not_tell_is_said(log: FlightLog, entry: dict[str, object], words: str) -> None:
    with pytest.raises(DictionaryError) as refusal:
        identify_faults(log, load_dictionary({"atoms": [entry]}), CONFIG)
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)
    # Beside a live entry it is left out, with the reason.
    result = identify_faults(log, load_dictionary({"atoms": [entry, ENTRIES[4]]}), CONFIG)
    assert result.candidates[0].state is None
    assert words in (result.candidates[0].note or "")


def test_an_output_that_does_not_follow_is_named() -> None:
    config = merge(CONFIG, {"outputs": ("altitude",)})
    with pytest.raises(
        DictionaryError, match="'icing' does not change 'altitude'; name one of its channel: q_impact, cas, tas"
    ):
        identify_faults(flown(0), load_dictionary({"channel": "altitude", "atoms": ENTRIES[:1]}), config)


@pytest.mark.slow
def test_without_a_log_its_audit_asks_for_one() -> None:
    audit = audit_dictionary(load_dictionary({"atoms": ENTRIES}), Config())
    icing = audit.atoms[0]
    assert "follows from the pressures that the log shows; give the log" in (icing.note or "")
    on_log = audit_on_log(flown(6), load_dictionary({"atoms": ENTRIES}), CONFIG)
    assert all(one.live and one.minimal_detectable for one in on_log.atoms)
