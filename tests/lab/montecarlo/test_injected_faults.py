"""A fault that every trial has, of any shape: added as `bfi inject` does, named by its entry, in its own unit."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.errors import ConfigError
from bfi_cli.flightlog import inject
from bfi_cli.lab.montecarlo import Sweep, check_records, load_sweep, run_trial, summarise
from bfi_cli.lab.montecarlo.flight import faults_of, faulty, largest_errors, record_of
from bfi_cli.lab.montecarlo.trial import Row, draw
from bfi_cli.serialization import from_plain, to_plain

DICTIONARY = """
atoms:
  - {name: water, shape: pitot_water, onset_s: 10, offset_s: 25, frequency_hz: 0.4}
  - {name: icing, shape: pitot_icing, onset_s: 10, offset_s: 25}
  - {name: step, shape: bias, onset_s: 10, offset_s: 25}
"""
RECORD = """
record: {model: f16, manoeuvre: doublet, rate_hz: 10, duration_s: 30}
dictionary: dictionary.yaml
noise: {tas: 0.02, altitude: 0.1}
identify: {model: {order: 4}, conditioning: {rate_hz: none}, inputs: [elevator, pitch, longitudinal_acc]}
"""
SPAN = "onset_s: 10, offset_s: 25"
FAULTS = {
    "pitot_blocked": f"shape: pitot_blocked, {SPAN}",
    "pitot_leak": f"shape: pitot_leak, {SPAN}, time_constant_s: 100",
    "pitot_icing": f"shape: pitot_icing, {SPAN}, magnitude: 0.01",
    "pitot_water": f"shape: pitot_water, {SPAN}, magnitude: 0.05, frequency_hz: 0.4",
    "static_blocked": f"shape: static_blocked, {SPAN}",
    "static_leak": f"shape: static_leak, {SPAN}, time_constant_s: 1000",
    "scale": f"shape: scale, {SPAN}, magnitude: 0.03",
    "bias": f"shape: bias, {SPAN}, magnitude: 2",
    "frozen": f"shape: frozen, {SPAN}",
}


@pytest.fixture
def sweep(written: Callable[[str], Path]) -> Callable[..., Sweep]:
    """Load a sweep with such faults."""

    def load(inject: str, *, active: str = "0", **given: int) -> Sweep:
        path = written(f"{RECORD}active: {active}\ninject: {inject}\n")
        (path.parent / "dictionary.yaml").write_text(DICTIONARY)
        return load_sweep(path, **given)

    return load


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("shape", FAULTS)
def test_the_record_is_what_bfi_inject_makes_of_it(sweep: Callable[..., Sweep], shape: str) -> None:
    setting = sweep(f"{{{FAULTS[shape]}}}").scenarios[0].setting
    record = record_of(setting, np.random.default_rng(0))
    quiet = replace(setting, noise=())
    (fault,) = faults_of(record, quiet, {}, np.random.default_rng(0)).values()
    made, injected = faulty(record, quiet, [fault], np.random.default_rng(0)), inject(record, [fault])
    assert injected.truth is not None
    for name in record.channels:
        np.testing.assert_array_equal(made.channel(name).values, injected.channel(name).values)
    changed = largest_errors(record, quiet, fault)
    assert changed.keys() == injected.truth.clean.keys()
    for name, largest in changed.items():
        change = np.abs(injected.channel(name).values - record.channel(name).values).max()
        assert largest == pytest.approx(change, rel=1e-9)
        assert largest > 0.0


def rows_of(sweep: Sweep) -> list[Row]:
    return [run_trial(trial) for trial in sweep.trials()]


@pytest.mark.slow
def test_a_fault_of_the_dictionary_is_scored_by_its_entry_and_in_its_unit(sweep: Callable[..., Sweep]) -> None:
    made = sweep(f"{{{FAULTS['pitot_icing']}, onset_spread_s: 0.3}}", trials=1)
    (row,) = rows_of(made)
    assert row.error is None
    assert (row.truth, row.isolated) == ({"icing": 0.01}, True)
    assert row.estimate is not None
    assert row.estimate["icing"] == pytest.approx(0.01, rel=0.05)
    assert (row.states, row.intervals, row.covered) == ({"icing": "declared"}, 1, 1)
    assert row.onset_error_s is not None
    assert 0.0 < abs(row.onset_error_s["icing"]) <= 0.4
    assert from_plain(Row, to_plain(row), where="trials.jsonl") == row
    (summary,) = summarise(made, [(row, 1.0)]).scenarios
    assert summary.onset_error_s == abs(row.onset_error_s["icing"])
    assert summary.isolation_rate.count == 1


@pytest.mark.slow
def test_one_beyond_the_dictionary_is_missed_unless_an_entry_is_called_right(sweep: Callable[..., Sweep]) -> None:
    (row,) = rows_of(sweep(f"{{{FAULTS['pitot_leak']}, name: leak}}", trials=1))
    assert (row.truth, row.missed, row.isolated) == ({"leak": 1.0}, ("leak",), False)
    assert row.magnitude_error is None
    assert row.false_alarms
    (row,) = rows_of(sweep(f"{{{FAULTS['pitot_leak']}, name: leak, right: [step, icing]}}", trials=1))
    assert (row.missed, row.isolated, row.false_alarms) == ((), True, ())
    assert row.states == {"leak": "declared"}
    assert (row.magnitude_error, row.intervals) == (None, 0)  # of another shape, in another unit


def drawn(sweep: Sweep) -> list[dict[str, float]]:
    return [draw(trial, np.random.default_rng(trial.seed).spawn(4)[0]) for trial in sweep.trials()]


def test_each_is_a_scenario_and_draws_go_on_beside_it(sweep: Callable[..., Sweep]) -> None:
    made = sweep(f"[null, {{{FAULTS['scale']}}}, {{{FAULTS['pitot_water']}}}]", active="[0, 1]", trials=6)
    assert [one.name for one in made.scenarios][:2] == ["active=0 inject=none", "active=0 inject=scale_0.03"]
    assert [[*one.setting.right] for one in made.scenarios][:3] == [[], ["scale"], ["water"]]
    truths = drawn(made)
    assert [len(truth) for truth in truths[:6]] == [0, 0, 0, 1, 1, 1]
    assert not any("water" in truth for truth in truths[5::6])
    assert truths[3::6] == truths[4::6]


def test_the_same_draws_as_before_without_one(sweep: Callable[..., Sweep], written: Callable[[str], Path]) -> None:
    path = written(f"{RECORD}active: 1\n")
    (path.parent / "dictionary.yaml").write_text(DICTIONARY)
    plain, none = load_sweep(path, trials=3), sweep("null", active="1", trials=3)
    assert plain.digest == none.digest
    assert drawn(plain) == drawn(none)
    assert plain.scenarios[0].axes == none.scenarios[0].axes


def test_a_whole_fault_is_drawn_whole(written: Callable[[str], Path]) -> None:
    path = written(f"{RECORD}active: 1\nmagnitudes: [3]\n")
    (path.parent / "dictionary.yaml").write_text(
        "atoms: [{name: leak, shape: pitot_leak, onset_s: 10, time_constant_s: 100}]\n"
    )
    assert drawn(load_sweep(path, trials=1)) == [{"leak": 1.0}]


def onsets(made: Sweep) -> list[float]:
    """Return when the injected fault of every trial begins."""
    drawn = []
    for trial in made.trials():
        setting, (_, gusts, _, rng) = trial.scenario.setting, np.random.default_rng(trial.seed).spawn(4)
        (fault,) = faults_of(record_of(setting, gusts), setting, {}, rng).values()
        assert fault.onset_range_s is None
        drawn.append(fault.onset_s)
    return drawn


@pytest.mark.parametrize(
    ("onset", "low", "high"),
    [("onset_s: {from: 5, to: 20}, ", 5.0, 20.0), ("onset_s: {from: 5}, ", 5.0, 26.91), ("", 2.99, 26.91)],
)
def test_an_onset_that_is_not_stated_is_drawn_uniformly(
    sweep: Callable[..., Sweep], onset: str, low: float, high: float
) -> None:
    n = 200
    times = np.sort(onsets(sweep(f"{{{onset}shape: bias, magnitude: 2}}", trials=n)))
    assert low <= times[0] < times[-1] <= high
    off = np.abs((times - low) / (high - low) - (np.arange(n) + 0.5) / n).max()
    assert off + 0.5 / n < 1.63 / np.sqrt(n)  # Kolmogorov's bound at 1 %
    assert onsets(sweep(f"{{{onset}shape: bias, magnitude: 2}}", trials=3)) == onsets(
        sweep(f"{{{onset}shape: scale, magnitude: 0.1}}", trials=3)
    )


def test_a_stated_onset_moves_by_its_spread_and_by_what_it_always_did(sweep: Callable[..., Sweep]) -> None:
    made = sweep(f"{{{FAULTS['bias']}, onset_spread_s: 0.5}}", trials=5)
    spreads = [float(np.random.default_rng(one.seed).spawn(4)[3].uniform(-1.0, 1.0)) for one in made.trials()]
    assert onsets(made) == [10.0 + 0.5 * one for one in spreads]
    assert onsets(sweep(f"{{{FAULTS['bias']}}}", trials=2)) == [10.0, 10.0]


def test_kinds_of_a_dictionary_begin_at_any_time_and_are_the_right_answers(sweep: Callable[..., Sweep]) -> None:
    made = sweep("{shape: bias, magnitude: 2, onset_s: {from: 5, to: 9}}", active="1", trials=8)
    entries = "{name: kind, shape: bias}, {name: late, shape: bias, onset_s: {from: 12, to: 25}}"
    path = Path(made.path).parent / "dictionary.yaml"
    path.write_text(f"relative_to: window\natoms: [{entries}, {{name: at_6, shape: bias, onset_s: 6}}]\n")
    made = load_sweep(made.path, trials=8)
    assert made.scenarios[0].setting.right == {"kind": ("kind", "at_6")}
    for trial in made.trials():
        streams = np.random.default_rng(trial.seed).spawn(4)
        truth = draw(trial, streams[0])
        assert list(truth) == ["late"]
        setting = trial.scenario.setting
        late, fault = faults_of(record_of(setting, streams[1]), setting, truth, streams[3]).values()
        assert 5.0 <= fault.onset_s <= 9.0 < 12.0 <= late.onset_s <= 25.0
        assert late.onset_range_s is None


def test_kinds_that_cannot_be_drawn_are_refused(sweep: Callable[..., Sweep]) -> None:
    path = Path(sweep("null").path)
    (path.parent / "dictionary.yaml").write_text("atoms: [{name: lag, shape: lagged_bias}]\n")
    check_records(load_sweep(path))
    path.write_text(f"{RECORD}active: 1\n")
    with pytest.raises(ConfigError, match=r"active: a fault that is drawn needs a time_constant_s, and .* of 'lag'"):
        load_sweep(path)
    (path.parent / "dictionary.yaml").write_text("atoms: [{name: late, shape: bias, onset_s: {from: 20, to: 90}}]\n")
    with pytest.raises(ConfigError, match="dictionary: onset_s: 'late' would begin at 20 to 90 s, and the window"):
        check_records(load_sweep(path))


@pytest.mark.slow
def test_a_fault_is_scored_by_its_kind(sweep: Callable[..., Sweep], written: Callable[[str], Path]) -> None:
    path = written(
        "record: {model: citation, rate_hz: 10, duration_s: 30}\ndictionary: dictionary.yaml\nnoise: {tas: 0.05}\n"
        "active: 0\ninject: {shape: bias, magnitude: 3}\n"
        "identify: {model: {order: 4}, conditioning: {rate_hz: none}, start_time: {calibration: gaussian}}\n"
    )
    (path.parent / "dictionary.yaml").write_text("atoms: [{name: step, shape: bias}, {name: slope, shape: drift}]\n")
    (row,) = rows_of(load_sweep(path, trials=1))
    assert (row.error, row.truth, row.isolated) == (None, {"step": 3.0}, True)
    assert row.states == {"step": "declared"}
    assert (row.intervals, row.covered) == (1, 1)
    assert row.onset_error_s is not None
    assert abs(row.onset_error_s["step"]) <= 0.2


@pytest.mark.slow
def test_a_trial_whose_onset_is_drawn_depends_on_nothing_but_itself(sweep: Callable[..., Sweep]) -> None:
    made = sweep("{shape: bias, magnitude: 2}", trials=2)
    rows, sent = rows_of(made), pickle.loads(pickle.dumps(list(made.trials())))
    assert [run_trial(trial) for trial in reversed(sent)] == rows[::-1]
    assert [row.error for row in rows] == [None] * 2


@pytest.mark.parametrize(
    ("written_as", "message"),
    [
        ("{shape: bias, onset_s: {from: 20, to: 100}}", "inject: onset_s: 'bias' would begin at 20 to 100 s, and the"),
        ("{shape: bias, onset_s: {from: 28}}", "inject: onset_s: 'bias' would begin at 28 to 26.91 s, and the window"),
        ("{shape: bias, onset_s: {from: -1, to: 20}}", "inject: onset_s: 'bias' would begin at -1 to 20 s, and the"),
    ],
)
def test_an_interval_outside_of_the_record_is_refused(
    sweep: Callable[..., Sweep], written_as: str, message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        check_records(sweep(written_as))


@pytest.mark.slow
@pytest.mark.realdata
def test_icing_of_a_recorded_flight_is_named_and_its_interval_covers(
    written: Callable[[str], Path], flights: Path
) -> None:
    """At the airspeed, of which 1 % of the impact pressure a second are 0.6 m/s^2, in four windows of two minutes."""
    flight = flights / "citation_20180312_f1.h5"
    path = written(
        f"record: [{', '.join(f'{{log: {flight}, from_s: {t}, to_s: {t + 120}}}' for t in (1500, 1700, 2000, 2300))}]\n"
        "dictionary: dictionary.yaml\nactive: 0\nidentify: {inputs: [auto], outputs: [tas]}\n"
        "inject: {shape: pitot_icing, onset_s: 60, magnitude: 0.01}\n"
    )
    (path.parent / "dictionary.yaml").write_text(
        "relative_to: window\natoms: [{name: icing, shape: pitot_icing, onset_s: 60},"
        " {name: step, shape: bias, onset_s: 60}]\n"
    )
    rows = rows_of(load_sweep(path, trials=1))
    assert [row.error for row in rows] == [None] * 4
    print([(row.estimate, row.covered, row.slow) for row in rows])
    assert sum(bool(row.isolated) for row in rows) >= 3
    assert sum(row.covered or 0 for row in rows) >= 3


@pytest.mark.parametrize(
    ("written_as", "active", "message"),
    [
        (
            "{shape: pitot_bloked}",
            "0",
            "inject[0].shape: no such shape, got 'pitot_bloked'; did you mean 'pitot_blocked'?",
        ),
        ("{shape: free}", "0", "inject[0].shape: no such shape, got 'free'"),
        ("{shape: pitot_icing, channel: tas}", "0", "inject[0]: channel: not a key of this shape; known: "),
        ("{shape: pitot_leak, onset_s: 5}", "0", "inject[0]: time_constant_s: missing; a pitot_leak needs it"),
        ("{shape: pitot_blocked, magnitude: 2}", "0", "inject[0]: magnitude: not a key of this shape"),
        ("{shape: bias, onset_s: 5, offset_s: 4}", "0", "inject[0]: offset_s: must be after onset_s (5 s), got 4 s"),
        ("{shape: bias, magnitude: 0}", "0", "inject[0].magnitude: 0 is no fault; write null in its place for none"),
        ("[null, {shape: bias, right: stp}]", "0", "inject[1].right: no entry of "),
        ("{shape: scale, name: step}", "0", "inject[0].name: is another entry of "),
        (f"{{{FAULTS['bias']}}}", "3", "active: more than the 2 faults of "),
        ("[[]]", "0", "inject[0]: "),
        ("[[{shape: bias}, {shape: bais}]]", "0", "inject[0][1].shape: no such shape, got 'bais'"),
        (
            "[[{shape: bias, magnitude: 1, onset_s: 9}, {shape: bias, onset_s: 20, magnitude: 2}]]",
            "0",
            "called the same",
        ),
        ("{shape: frozen, magnitude: 2}", "0", "inject[0]: magnitude: not a key of this shape"),
        ("{shape: bias, onset_spread_s: -1}", "0", "inject[0].onset_spread_s: "),
        (
            "{shape: bias, onset_s: {from: 9, to: 5}}",
            "0",
            "inject[0].onset_s: to must be after from (9), got 5; swap them",
        ),
        ("{shape: bias, onset_s: {form: 9, to: 5}}", "0", "inject[0].onset_s.form: "),
        ("{shape: bias, onset_s: soon}", "0", "inject[0].onset_s: must be a number, got 'soon'"),
        (
            "{shape: bias, onset_s: {from: 5}, offset_s: 9}",
            "0",
            "inject[0]: offset_s: goes with an onset that is stated",
        ),
        ("{shape: bias, onset_spread_s: 1}", "0", "inject[0]: onset_spread_s: goes with an onset that is stated"),
    ],
)
def test_what_cannot_be_meant_is_said_in_a_line(
    sweep: Callable[..., Sweep], written_as: str, active: str, message: str
) -> None:
    with pytest.raises(ConfigError) as refusal:
        sweep(written_as, active=active)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert json.dumps(str(refusal.value))


def test_several_act_together_and_each_is_scored(sweep: Callable[..., Sweep]) -> None:
    both = "{shape: bias, magnitude: 3, onset_s: 20}, {shape: sine, frequency_hz: 0.5, magnitude: 2, onset_s: 8}"
    path = Path(sweep("null").path)
    entries = "{name: step, shape: bias, onset_s: 20}, {name: wave, shape: sine, frequency_hz: 0.5, onset_s: 8}"
    (path.parent / "dictionary.yaml").write_text(f"relative_to: window\natoms: [{entries}]\n")
    path.write_text(f"{RECORD}active: 0\ninject: [null, [{both}]]\n")
    made = load_sweep(path, trials=1)
    assert [one.name for one in made.scenarios] == ["inject=none", "inject=bias_3+sine_2"]
    none, row = rows_of(made)
    assert (none.truth, row.truth) == ({}, {"step": 3.0, "wave": 2.0})
    assert row.isolated
    assert row.estimate == {"step": pytest.approx(3.0, rel=0.1), "wave": pytest.approx(2.0, rel=0.1)}
    assert row.states == {"step": "declared", "wave": "declared"}


def test_a_sensor_that_freezes_holds_its_noise_too(sweep: Callable[..., Sweep]) -> None:
    made = sweep("{shape: frozen, onset_s: 10}", trials=1)
    (trial,) = made.trials()
    setting = replace(trial.scenario.setting, noise=(("tas", 0.5),))
    record = record_of(setting, np.random.default_rng(1))
    faults = list(faults_of(record, setting, {}, np.random.default_rng(2)).values())
    held = faulty(record, setting, faults, np.random.default_rng(3)).channel("tas").values[record.time_s > 10.0]
    assert np.ptp(held) < 1e-9
