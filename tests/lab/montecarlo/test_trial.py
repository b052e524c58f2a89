"""One trial is `bfi identify` on the same log; the shared factorisation gives the same; a failure is a row."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.flightlog import FlightLog
from bfi_cli.lab.montecarlo import Sweep, run_trial
from bfi_cli.lab.montecarlo import trial as trial_module
from bfi_cli.lab.montecarlo.flight import faults_of, faulty, largest_errors, record_of
from bfi_cli.lab.montecarlo.scenarios import Setting, Trial
from bfi_cli.lab.montecarlo.trial import Row, declared_magnitudes, shared_record
from bfi_cli.methods import METHODS
from bfi_cli.model import identify_faults
from bfi_cli.serialization import from_plain, to_plain

DATA = Path(__file__).parents[3] / "data"
HEAD = "record: {model: citation, rate_hz: 10, duration_s: 30}\ndictionary: dictionary.yaml\n"
OWN = "identify: {conditioning: {rate_hz: none}, model: {order: 4}, method: risro"
RULE = "risro: {sparsity: none}"
SHARING = {
    "simulated": f"{HEAD}active: [1, 2, 3]\ntrials: 3\n{OWN}, {RULE}}}\n",
    "letter": f"{HEAD}active: [1, 3]\ntrials: 3\n{OWN}, risro: {{as_published: true}}}}\n",
    "stage": f"{HEAD}active: [1, 3]\ntrials: 3\n{OWN}, risro: {{as_published: true, sparsity: l1}}}}\n",
    "not centred": f"{HEAD}active: 2\ntrials: 3\n{OWN.replace('none}', 'none, detrend: none}')}, {RULE}}}\n",
    "magnitudes of 1000": f"{HEAD}active: 2\nmagnitudes: [1000, -1000]\ntrials: 3\n{OWN}, {RULE}}}\n",
    "log": f"record: {{log: {DATA / 'citation_clean.h5'}, from_s: 3}}\ndictionary: dictionary.yaml\n"
    f"active: [1, 3]\ntrials: 3\n{OWN}, {RULE}}}\n",
}


def with_truth(log: FlightLog, setting: Setting, truth: dict[str, float], rng: np.random.Generator) -> FlightLog:
    return faulty(log, setting, list(faults_of(log, setting, truth, rng).values()), rng)


@pytest.mark.first_rows(3)
@pytest.mark.parametrize("name", SHARING)
def test_shared_factorisation_gives_what_each_record_alone_gives(sweep: Callable[..., Sweep], name: str):
    for trial in sweep(SHARING[name]).trials():
        setting = trial.scenario.setting
        shared = shared_record(setting)
        assert shared is not None
        truth = trial_module.draw(trial, np.random.default_rng(trial.seed))
        z = declared_magnitudes(shared, np.array([truth.get(atom, 0.0) for atom in shared.names]), setting)
        rng = np.random.default_rng(0)
        alone = identify_faults(
            with_truth(record_of(setting, rng), setting, truth, rng), setting.dictionary, setting.config
        )
        found = {fault.name: fault.magnitude for fault in alone.faults}
        assert {atom for atom, value in zip(shared.names, z, strict=True) if value} == set(found)
        expected = [found.get(atom, 0.0) for atom in shared.names]
        np.testing.assert_allclose(z, expected, atol=1e-9 * np.abs(expected).max(), rtol=0)


@pytest.mark.parametrize(
    "changed",
    [
        ("method: risro", "method: ml"),
        ("sparsity: none", "sparsity: exp-l0"),
        ("order: 4", "order: auto"),
        ("rate_hz: none", "rate_hz: 5.0"),
        ("trials: 6", "noise: {tas: 0.1}"),
        ("duration_s: 30}", "duration_s: 30, turbulence_m_s: 1}"),
        ("duration_s: 30}", "duration_s: 10}"),
    ],
)
def test_what_is_not_a_recombination_is_solved_alone(sweep: Callable[..., Sweep], written: Callable, changed: tuple):
    text = written("fast").read_text()
    assert changed[0] in text
    assert shared_record(sweep("fast").scenarios[0].setting) is not None
    assert shared_record(sweep(text.replace(*changed)).scenarios[0].setting) is None


@pytest.mark.slow
def test_a_trial_is_an_identification_of_the_faulty_log(sweep: Callable[..., Sweep]):
    for trial in sweep("noisy", trials=2).trials():
        row, setting = run_trial(trial), trial.scenario.setting
        faults, gusts, noise = np.random.default_rng(trial.seed).spawn(3)
        assert row.truth == trial_module.draw(trial, faults)
        log = with_truth(record_of(setting, gusts), setting, row.truth, noise)
        result = identify_faults(log, setting.dictionary, setting.config)
        assert row.decision == result.decision
        assert {"abrupt": row.abrupt, "oscillating": row.oscillating, "slow": row.slow} == result.verdicts
        became = {one.name: one.state for one in result.candidates}
        assert row.states == {name: became[name] for name in row.truth}
        assert row.estimate == pytest.approx({fault.name: fault.magnitude for fault in result.faults}, rel=1e-11)
        assert row.isolated == (set(row.estimate) == set(row.truth))
        right = [fault for fault in result.faults if fault.name in row.truth]
        inside = [fault.ci95[0] <= row.truth[fault.name] <= fault.ci95[1] for fault in right]
        assert (row.intervals, row.covered) == (len(right), sum(inside))
        assert row.detection_delay_s is None


@pytest.mark.slow
def test_a_trial_depends_on_nothing_but_itself(sweep: Callable[..., Sweep]):
    trials = list(sweep("noisy", trials=2).trials())
    rows = [run_trial(trial) for trial in trials]
    assert [run_trial(trial) for trial in reversed(pickle.loads(pickle.dumps(trials)))] == rows[::-1]


VERDICTS = ("abrupt", "oscillating", "slow")


def test_a_shared_factorisation_gives_the_verdicts_of_the_whole_answer(
    sweep: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch
):
    for trial in sweep("fast", trials=3).trials():
        row = run_trial(trial)
        with monkeypatch.context() as patch:
            patch.setattr(trial_module, "shared_record", lambda _: None)
            alone = run_trial(trial)
        keys = ("decision", *VERDICTS, "states", "beyond_tolerance", "wrong_no_fault")
        assert [getattr(row, key) for key in keys] == [getattr(alone, key) for key in keys]


def test_a_solver_that_did_not_converge_has_no_verdict(sweep: Callable[..., Sweep]):
    trial = next(sweep(SHARING["log"].replace("sparsity: none", "sparsity: none, max_iterations: 1")).trials())
    assert shared_record(trial.scenario.setting) is not None
    row = run_trial(trial)
    assert {row.decision, *(getattr(row, kind) for kind in VERDICTS)} == {"inconclusive"}


@pytest.mark.first_rows(6)
@pytest.mark.parametrize("method", METHODS)
def test_every_method_fills_the_row(sweep: Callable[..., Sweep], method: str):
    settings = f"identify: {{model: {{order: 4}}, method: {method}, dmae: {{model: citation}}}}\n"
    text = f"{HEAD}noise: {{tas: 0.01}}\nactive: [0, 2]\ntrials: 1\n{settings}"
    for row in map(run_trial, sweep(text).trials()):
        assert row.error is None
        assert None not in (row.decision, *(getattr(row, kind) for kind in VERDICTS))
        assert set(row.states) == set(row.truth)
        assert set(row.states.values()) <= {"declared", "suspected", "excluded", "not_seen"}
        assert set(row.wrong_no_fault) <= set(row.beyond_tolerance) <= set(row.truth)


def with_tolerance(sweep: Callable[..., Sweep], tolerance: float) -> Trial:
    """Return a trial with a step of 2 m/s and a drift of 0.2 m/s^2 from 8 s, 4.4 m/s in 22 s."""
    settings = f"identify: {{model: {{order: 4}}, tolerances: {{tas: {tolerance}}}}}\n"
    return next(sweep(f"{HEAD}noise: {{tas: 0.01}}\nactive: 2\ntrials: 1\n{settings}").trials())


@pytest.mark.parametrize(
    ("tolerance", "beyond"), [(1.9, ("bias", "drift")), (2.1, ("drift",)), (4.3, ("drift",)), (4.5, ())]
)
def test_an_error_is_beyond_the_tolerance_where_it_is_largest(
    sweep: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch, tolerance: float, beyond: tuple[str, ...]
):
    monkeypatch.setattr(trial_module, "draw", lambda *_: {"bias": -2.0, "drift": 1.0})
    row = run_trial(with_tolerance(sweep, tolerance))
    assert row.beyond_tolerance == beyond
    assert row.wrong_no_fault == ()


@pytest.mark.parametrize("name", ["bias", "sine", "drift"])
@pytest.mark.parametrize("recorder", ["none", "1.0"])
def test_the_largest_error_is_that_of_the_faulty_record(sweep: Callable[..., Sweep], name: str, recorder: str):
    settings = f"identify: {{recorder: {{edge_hz: {recorder}}}, window: {{from_s: 5, to_s: 25}}}}\n"
    setting = sweep(f"{HEAD}active: 1\n{settings}").scenarios[0].setting
    rng = np.random.default_rng(0)
    clean = record_of(setting, rng)
    (fault,) = faults_of(clean, setting, {name: -1.5}, np.random.default_rng(0)).values()
    assert fault.name == name
    wrong = faulty(clean, setting, [fault], rng)
    difference = np.abs((wrong.channel("tas").values - clean.channel("tas").values)[50:250])
    ((channel, largest),) = largest_errors(clean, setting, fault).items()
    assert channel == "tas"
    assert largest == pytest.approx(difference.max(), rel=1e-12, abs=1e-12)
    assert largest > 0.5


@pytest.mark.parametrize(("kind", "wrong"), [("abrupt", ("bias",)), ("oscillating", ()), ("slow", ("drift",))])
def test_no_fault_is_wrong_of_the_kind_that_covers_the_fault(
    sweep: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch, kind: str, wrong: tuple[str, ...]
):
    def said(*_: object) -> SimpleNamespace:
        verdicts = dict.fromkeys(VERDICTS, "inconclusive") | {kind: "no_fault"}
        states = [SimpleNamespace(name=name, state="not_seen") for name in ("bias", "sine", "drift")]
        return SimpleNamespace(decision="inconclusive", verdicts=verdicts, candidates=states, faults=())

    monkeypatch.setattr(trial_module, "draw", lambda *_: {"bias": 2.0, "drift": 1.0})
    monkeypatch.setattr(trial_module, "identify_faults", said)
    assert run_trial(with_tolerance(sweep, 1.0)).wrong_no_fault == wrong


def test_noise_and_gusts_are_what_is_asked_for(sweep: Callable[..., Sweep]):
    quiet, loud = (sweep("noisy").scenarios[n].setting for n in (0, -1))
    rng = np.random.default_rng
    clean = record_of(quiet, rng(0)).channel("tas").values
    small, large = (faulty(record_of(s, rng(0)), s, [], rng(5)).channel("tas").values - clean for s in (quiet, loud))
    np.testing.assert_allclose(large, 5.0 * small, atol=1e-12)
    assert np.std(small) == pytest.approx(0.01, rel=0.2)
    gusty = sweep(f"{HEAD.replace('30}', '30, turbulence_m_s: 1}')}active: 0\n").scenarios[0].setting
    assert not np.allclose(*(record_of(gusty, rng(seed)).channel("tas").values for seed in (0, 1)))


@pytest.mark.parametrize("failure", [MemoryError("no room"), ValueError("3 rows\nare few"), KeyError("x")])
def test_a_defect_is_a_row(sweep: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch, failure: Exception):
    def broken(*_: object) -> None:
        raise failure

    monkeypatch.setattr(trial_module, "identify_faults", broken)
    row = run_trial(next(sweep("noisy").trials()))
    assert row.error is not None
    assert row.error.startswith(f"internal error, {type(failure).__name__}(")
    assert "\n" not in row.error
    assert (row.isolated, row.estimate, row.decision) == (None, None, None)


def test_a_refusal_is_a_row(sweep: Callable[..., Sweep]):
    rows = [run_trial(trial) for trial in sweep("failing").trials()]
    assert [row.error is None for row in rows] == [True, False] * 2
    assert rows[1].error.startswith("citation: order 90 needs more than the ")


names = st.text(st.characters(exclude_categories=["C"]), min_size=1, max_size=8)
sizes = st.dictionaries(names, st.floats(allow_nan=False, allow_infinity=False), max_size=3)


@given(
    st.builds(
        Row,
        scenario=names,
        trial=st.integers(0, 10**6),
        seed=st.integers(0, 2**64 - 1),
        truth=sizes,
        estimate=st.none() | sizes,
        decision=st.sampled_from([None, "fault", "no_fault"]),
        abrupt=st.sampled_from([None, "fault", "inconclusive"]),
        oscillating=st.sampled_from([None, "no_fault"]),
        slow=st.sampled_from([None, "inconclusive"]),
        states=st.none() | st.dictionaries(names, st.sampled_from([None, "declared", "excluded"]), max_size=3),
        beyond_tolerance=st.none() | st.lists(names).map(tuple),
        wrong_no_fault=st.none() | st.lists(names).map(tuple),
        isolated=st.sampled_from([None, True, False]),
        false_alarms=st.none() | st.lists(names).map(tuple),
        missed=st.none() | st.lists(names).map(tuple),
        magnitude_error=st.none() | st.floats(0, 1e6),
        intervals=st.none() | st.integers(0, 9),
        covered=st.none() | st.integers(0, 9),
        detection_delay_s=st.none() | st.floats(0, 1e6),
        error=st.none() | names,
    )
)
def test_a_line_is_read_as_it_was_written(row: Row):
    assert from_plain(Row, to_plain(row), where="trials.jsonl") == row


def test_errors_are_relative_to_the_truth(sweep: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch):
    trial: Trial = next(sweep("fast").trials())
    monkeypatch.setattr(trial_module, "draw", lambda *_: {"bias": 3.0, "sine": 4.0})
    shared = SimpleNamespace(names=("bias", "sine", "drift"))
    monkeypatch.setattr(trial_module, "shared_record", lambda _: shared)
    monkeypatch.setattr(trial_module, "declared_magnitudes", lambda *_: np.array([3.0, 0.0, 1.0]))
    row = run_trial(trial)
    assert row.magnitude_error == pytest.approx(np.sqrt(17) / 5, rel=1e-5)
    assert (row.false_alarms, row.missed, row.isolated) == (("drift",), ("sine",), False)
