"""One trial: draw faults, add them, identify, compare; and its line in `trials.csv`.

Trials that share a record share its factorisation: a fault added to the record recombines columns of the factor. This
holds for the published method on one record without added noise, at the record's own rate. The scaled problem of the
faulty record then follows from that of the clean one: centre and scale of the output alone depend on the fault.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np

from ...analysis import identify
from ...decision import KINDS, State, kind_of
from ...errors import BfiError
from ...faults import Decision, Fault, FaultEstimate
from ...faults.fault import compare_faults
from ...faults.shapes import ADDITIVE, LINE_SHAPES, Kind
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...kernels.progress import Termination
from ...methods import METHODS
from ...model import identify_faults
from ...model.preprocessing.defaults import tolerances_of
from ...model.preprocessing.regression import RegressionData, decides_by_rule, solve
from ...model.preprocessing.window import prepare_window, regression_of, with_inputs_of
from ...model.risro import declared
from ...serialization import to_json
from ..compare import Problem, outcome_of, paired
from .flight import faults_of, faulty, is_shared, largest_errors, record_of
from .scenarios import Setting, Trial, size_of

# Factors that a worker keeps, of as many settings: a sweep's trials go through its settings in turn.
KEPT_FACTORS = 16
# Significant digits of a magnitude, beyond the round-off of other machines, and of an error.
ESTIMATE_DIGITS = 12
ERROR_DIGITS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """The answer of one trial beside its truth; everything after `truth` is None where the trial failed.

    Attributes
    ----------
    scenario, trial, seed : which it is.
    truth, estimate : magnitude by name of the faults added and of those declared.
    decision : see `bfi identify`, without its scan over all onsets.
    abrupt, oscillating, slow : the verdicts on the three kinds of fault.
    states : of the faults added, by name: what became of their entries; None where the window does not show one.
    beyond_tolerance : names of the faults added whose largest error in the window exceeds the channel's tolerance.
    wrong_no_fault : those of them that `no_fault` was said of, by the verdict that covers them.
    isolated : whether the declared faults are those added.
    false_alarms, missed : names of faults declared and not added, added and not declared.
    magnitude_error : 2-norm of estimate - truth relative to that of truth; None without a true fault.
    intervals, covered : 95 % intervals of rightly declared faults, and how many of them hold the truth; None with
        method risro, which has none of its own.
    detection_delay_s : None for a dictionary, which states the onset.
    onset_error_s : by name of the rightly declared faults, by how much later than the true onset each was said to
        begin; None where the answer has no onsets of its own.
    score : of a method of `bfi compare`, see `bfi_cli.lab.compare.Statement`; its row has no verdicts and no intervals.
    error : why the trial failed.
    """

    scenario: str
    trial: int
    seed: int
    truth: Mapping[str, float]
    estimate: Mapping[str, float] | None = None
    decision: str | None = None
    abrupt: str | None = None
    oscillating: str | None = None
    slow: str | None = None
    states: Mapping[str, str | None] | None = None
    beyond_tolerance: tuple[str, ...] | None = None
    wrong_no_fault: tuple[str, ...] | None = None
    isolated: bool | None = None
    false_alarms: tuple[str, ...] | None = None
    missed: tuple[str, ...] | None = None
    magnitude_error: float | None = None
    intervals: int | None = None
    covered: int | None = None
    detection_delay_s: float | None = None
    onset_error_s: Mapping[str, float] | None = None
    score: float | None = None
    error: str | None = None

    def cells(self) -> list[str]:
        """Return the row as text, one cell per column: mappings and lists as JSON, absent ones empty."""
        values = ((getattr(self, column), column in TEXTS) for column in COLUMNS)
        return ["" if value is None else value if is_text else to_json(value, indent=None) for value, is_text in values]


COLUMNS = tuple(field.name for field in fields(Row))
TEXTS = ("scenario", "decision", *KINDS, "error")
NAMES = ("beyond_tolerance", "wrong_no_fault", "false_alarms", "missed")


def rounded(value: float, digits: int = ESTIMATE_DIGITS) -> float:
    """Return `value` at so many significant digits: what a file says is what a summary is made of."""
    return float(f"{value:.{digits}g}")


def run_trial(trial: Trial) -> Row:
    """Return the row of a trial; it depends on the trial alone. A trial that fails is a row that says why."""
    faults, gusts, noise, onsets = np.random.default_rng(trial.seed).spawn(4)
    setting = trial.scenario.setting
    truth = draw(trial, faults)
    truth |= {name: size_of(fault.fault()) for name, fault in zip(setting.right, setting.injected, strict=True)}
    row = Row(scenario=trial.scenario.name, trial=trial.number, seed=trial.seed, truth=truth)
    try:
        record = _flown(trial, truth, (gusts, noise, onsets))
        return _identified(row, trial, record) if setting.peer is None else _compared(row, trial, record)
    except BfiError as error:
        why = str(error)
    except Exception as error:
        why = f"internal error, {error!r}"
    return replace(row, error=" ".join(why.split()))


def draw(trial: Trial, rng: np.random.Generator) -> dict[str, float]:
    """Return magnitude by name of the faults of a trial, in the order of the dictionary; that of a whole one is 1."""
    taken = {name for right in trial.scenario.setting.right.values() for name in right}
    atoms = [atom for atom in trial.scenario.setting.dictionary.atoms if atom.called not in taken]
    active = np.sort(rng.choice(len(atoms), trial.scenario.n_active, replace=False))
    sizes = rng.choice(trial.scenario.sizes, trial.scenario.n_active)
    return {atoms[j].called: size_of(replace(atoms[j], magnitude=float(z))) for j, z in zip(active, sizes, strict=True)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flown:
    """The log of a trial.

    Attributes
    ----------
    record : without faults and noise; log : with them.
    added : faults by name, times on the log's axis.
    """

    record: FlightLog
    log: FlightLog
    added: Mapping[str, Fault]


def _flown(trial: Trial, truth: Mapping[str, float], streams: Sequence[np.random.Generator]) -> Flown:
    """Return the log of a trial; the streams are of gusts, noise and onsets."""
    setting = trial.scenario.setting
    record = record_of(setting, streams[0])
    added = faults_of(record, setting, truth, streams[2])
    return Flown(record=record, log=faulty(record, setting, list(added.values()), streams[1]), added=added)


def _identified(row: Row, trial: Trial, flown: Flown) -> Row:
    """Return the row with the answer of `bfi identify` beside the truth."""
    setting, truth = trial.scenario.setting, row.truth
    record, log, added = flown.record, flown.log, flown.added
    # Where a shared record gives no answer, the whole one says if the data could tell.
    answer = _shared_answer(setting, truth) or _whole_answer(log, setting)
    entries = _entries_of(setting, answer.estimate)
    names = {entry: injected for injected, entry in entries.items()}
    called = {name: names.get(name, name) for name in answer.estimate}
    estimate = {called[name]: z for name, z in answer.estimate.items()}
    hits = onset_errors = None
    if answer.faults is not None:
        faults = {
            called[fault_estimate.name]: fault_estimate.fault
            for fault_estimate in answer.faults
            if called[fault_estimate.name] in added
        }
        onset_errors = {name: rounded(fault.onset_s - added[name].onset_s) for name, fault in faults.items()}
        if METHODS[setting.config.method].intervals:
            ends = {called[fault_estimate.name]: fault_estimate.ci95 for fault_estimate in answer.faults}
            alike = [name for name, fault in faults.items() if fault.shape == added[name].shape]
            hits = [ends[name][0] <= truth[name] <= ends[name][1] for name in alike]
    outside = tuple(injected for injected in setting.right if injected not in entries)
    comparison = compare_faults(estimate, {k: z for k, z in truth.items() if k not in outside}, unknown=outside)
    error = comparison.magnitude_error
    shapes = {atom.called: atom.shape for atom in setting.dictionary.atoms}
    if any(injected in estimate and shapes[entry] != added[injected].shape for injected, entry in entries.items()):
        error = None  # magnitudes of different shapes have nothing in common
    window = setting.config.window
    tolerances = tolerances_of(log, log.window(window.from_s, window.to_s), setting.config.outputs, setting.config)
    beyond = {
        name: kind_of(fault, declared=False)
        for name, fault in added.items()
        if any(size > tolerances.get(at, np.inf) for at, size in largest_errors(record, setting, fault).items())
    }
    return replace(
        row,
        estimate={name: rounded(z) for name, z in estimate.items()},
        decision=answer.decision,
        abrupt=answer.verdicts["abrupt"],
        oscillating=answer.verdicts["oscillating"],
        slow=answer.verdicts["slow"],
        states={name: answer.states.get(entries.get(name, name)) for name in truth},
        beyond_tolerance=tuple(beyond),
        wrong_no_fault=tuple(name for name, kind in beyond.items() if answer.verdicts[kind] == "no_fault"),
        isolated=comparison.isolated,
        false_alarms=comparison.false_alarms,
        missed=comparison.missed,
        magnitude_error=None if error is None else rounded(error, ERROR_DIGITS),
        intervals=None if hits is None else len(hits),
        covered=None if hits is None else sum(hits),
        onset_error_s=onset_errors,
    )


def _entries_of(setting: Setting, estimate: Mapping[str, float]) -> dict[str, str]:
    """Return the entry that is taken for each injected fault that has any: of the right ones the first declared."""
    entries: dict[str, str] = {}
    for injected, right in setting.right.items():
        free = [name for name in right if name not in entries.values()]
        if free:
            entries[injected] = next((name for name in free if name in estimate), free[0])
    return entries


def _compared(row: Row, trial: Trial, flown: Flown) -> Row:
    """Return the row with what a method of `bfi compare` states beside the truth."""
    setting, log = trial.scenario.setting, flown.log
    assert setting.peer is not None
    name, peer = setting.peer
    config = with_inputs_of(log, setting.config)
    part = log.window(config.window.from_s, config.window.to_s)
    problem = Problem(log=log, part=part, dictionary=setting.dictionary, config=config, asked=setting.config)
    truth = dict(sorted(flown.added.items(), key=lambda item: item[1].onset_s))
    line_faults = [fault for fault in truth.values() if fault.shape in LINE_SHAPES]
    hit = {channel for fault in line_faults for channel in largest_errors(flown.record, setting, fault)}
    outcome = outcome_of(name, peer, problem, list(truth.values()), tuple(hit))
    statement, score = outcome.statement, outcome.score
    if statement is None or score is None:
        return replace(row, error=outcome.reason)
    pairs, others = paired(statement, list(truth.values()), tuple(hit))
    called = {id(fault): key for key, fault in truth.items()}
    declared_faults = {called[id(fault)]: suspect for suspect, fault in pairs}
    return replace(
        row,
        estimate={
            key: rounded(suspect.magnitude) for key, suspect in declared_faults.items() if suspect.magnitude is not None
        },
        decision=statement.decision,
        isolated=score.isolated == "fault" if truth else not score.false_alarms,
        false_alarms=tuple(suspect.name or f"{suspect.shape or 'fault'} {suspect.channel}" for suspect in others),
        missed=tuple(key for key in truth if key not in declared_faults),
        magnitude_error=None if score.magnitude_error is None else rounded(score.magnitude_error, ERROR_DIGITS),
        detection_delay_s=score.delay_s,
        onset_error_s={
            key: rounded(suspect.onset_s - truth[key].onset_s)
            for key, suspect in declared_faults.items()
            if suspect.onset_s is not None
        },
        score=None if statement.score is None else rounded(statement.score),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Answer:
    """What an analysis says, by entry of the dictionary; `faults` are None where it has no onsets and intervals."""

    decision: Decision
    estimate: Mapping[str, float]
    verdicts: Mapping[Kind, Decision]
    states: Mapping[str, State | None]
    faults: Sequence[FaultEstimate] | None = None


def _whole_answer(log: FlightLog, setting: Setting) -> _Answer:
    dictionary, called = setting.dictionary, dict[str, str]()
    if dictionary.exact.atoms == dictionary.atoms:
        result = identify_faults(log, dictionary, setting.config)
    else:
        result, _ = identify(log, dictionary, setting.config)
        called = _kinds_of(result.faults, dictionary.searched.resolved(result.log.start_s))
    faults = [replace(fault, name=called.get(fault.name, fault.name)) for fault in result.faults]
    return _Answer(
        decision=result.decision,
        estimate={fault.name: fault.magnitude for fault in faults},
        verdicts=result.verdicts,
        states={candidate.name.removesuffix(" (scan)"): candidate.state for candidate in result.candidates},
        faults=faults,
    )


def _kinds_of(faults: Sequence[FaultEstimate], kinds: Sequence[Fault]) -> dict[str, str]:
    """Return the name of the kind that each fault is one of, by its own name; a second of a kind keeps its own."""
    called: dict[str, str] = {}
    for estimate in faults:
        fault = estimate.fault
        for kind in kinds:
            first_s, last_s = kind.onset_range_s or (fault.onset_s, fault.onset_s)
            alike = (kind.shape, kind.channel) == (fault.shape, fault.channel)
            if alike and first_s <= fault.onset_s <= last_s and kind.called not in called.values():
                called[estimate.name] = kind.called
                break
    return called


def _shared_answer(setting: Setting, truth: Mapping[str, float]) -> _Answer | None:
    """Return the answer that a shared record gives; None where there is no such record, or nothing is declared."""
    shared = shared_record(setting)
    if shared is None:
        return None
    z = declared_magnitudes(shared, np.array([truth.get(name, 0.0) for name in shared.names]), setting)
    if z is None or not z.any():
        return None
    estimate = {name: float(value) for name, value in zip(shared.names, z, strict=True) if value}
    kinds = {kind_of(atom, declared=True) for atom in setting.dictionary.atoms if atom.called in estimate}
    return _Answer(
        decision="fault",
        estimate=estimate,
        # A method without intervals excludes nothing.
        verdicts={kind: "fault" if kind in kinds else "inconclusive" for kind in KINDS},
        states={name: "declared" if name in estimate else "not_seen" for name in truth},
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SharedRecord:
    """A clean record, factorised.

    Attributes
    ----------
    names : of the atoms, all of which the window shows.
    regression : of the clean record.
    """

    names: tuple[str, ...]
    regression: RegressionData


@lru_cache(maxsize=KEPT_FACTORS)
def shared_record(setting: Setting) -> SharedRecord | None:
    """Return the factorised record of a setting; None where its trials must be solved one by one."""
    config = setting.config
    published = config.method in ("risro", "risro-as-published") and decides_by_rule(config)
    asked = published and config.conditioning.rate_hz == "none" and config.model.order != "auto"
    silent = all(sd == 0.0 for _, sd in setting.noise)
    # A fault that depends on what the log shows is not one column of the factor in the clean and in the faulty record.
    added = not setting.injected and all(
        atom.shape in ADDITIVE and atom.onset_range_s is None for atom in setting.dictionary.atoms
    )
    if not (asked and silent and added and is_shared(setting) and len(config.outputs) == 1):
        return None
    try:
        window = prepare_window(record_of(setting, np.random.default_rng(0)), setting.dictionary, config)
        regression = regression_of(window, config)
    except BfiError:
        return None
    return None if window.reasons else SharedRecord(names=window.names, regression=regression)


def declared_magnitudes(shared: SharedRecord, truth: FloatArray, setting: Setting) -> FloatArray | None:
    """Return (n_atoms,) the magnitudes that the published rule declares, 0 where it declares none.

    None where the solver did not converge, which is no answer.

    Parameters
    ----------
    truth : (n_atoms,) magnitudes of the faults in the record.
    """
    faulty = shared.regression.with_fault(truth)
    solution = solve(faulty.data, setting.config)
    if solution.termination not in (Termination.CONVERGED, Termination.FIXED):
        return None
    z = solution.z * faulty.magnitude_unit
    return np.where(declared(solution, z, setting.config), z, 0.0)
