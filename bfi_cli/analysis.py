"""The analyses of a window: every source gives its evidence, and one conclusion is made of it.

The sources are the entries of a dictionary at the onsets that they state, the search over all onsets for the kinds of
fault whose onsets are not known, and what relations between channels, pressure lines, lift and inertia say.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from . import flightlog, model
from .config import Config, merge
from .decision import (
    KINDS,
    ONSET_SAMPLES,
    Evidence,
    at_entries,
    decide,
    not_excluded,
    verdicts_of,
    with_limit_of_scan,
)
from .dictionary import Dictionary, dead_reason_of_kind
from .errors import ConfigError, DictionaryError, LogError
from .faults import Fault, FaultEstimate
from .faults.fault import compare_by_onset
from .faults.filters import alternatives, response_of
from .faults.shapes import LINE_SHAPES, SHAPES, Kind, Shape, scanned_shape
from .kernels.progress import Progress, unseen
from .methods import METHODS
from .model import onset, preprocessing
from .notes import Note
from .quantities.text import instant, quantity

if TYPE_CHECKING:
    from .decision.implausible import Implausible
    from .faults.fault import Comparison
    from .flightlog import FlightLog
    from .model import Identification, IdentifyResult, ScanSummary
    from .model.onset import OnsetResult, OnsetSearch
    from .model.preprocessing import Purpose

# Variance accounted for, %, beyond which the prediction errors at the log's own rate are round-off.
EXPLAINED = 100.0 - 1e-9

# A longer record, counted at the rate that is asked for or at 10 Hz, would take minutes.
MOST_SAMPLES, FASTEST_HZ = 20_000, 10.0


def start_time(
    log: FlightLog, config: Config, progress: Progress = unseen, *, findings: Sequence[Implausible] = ()
) -> OnsetResult:
    """Say when a fault started, of which shape and how large, from all sources; see `bfi_cli.model.onset.find_onset`.

    Parameters
    ----------
    findings : on channels that are wrong throughout the flight.
    """
    config = preprocessing.with_inputs_of(log, config)
    _require_one_model(log.window(config.window.from_s, config.window.to_s), config)
    physics, scanning = _physics(log, config, progress)
    beside, false_alarm = [physics, _arithmetic(findings)], config.start_time.false_alarm
    return onset.find_onset(log, scanning, progress, beside=beside, false_alarm=false_alarm)


def _arithmetic(findings: Sequence[Implausible]) -> Evidence:
    return Evidence(source="arithmetic", findings=tuple(findings))


def _require_one_model(part: FlightLog, config: Config, purpose: Purpose = "scan") -> None:
    """Refuse at once a window that is too long for one model, whatever rate is chosen for it."""
    rate_hz = preprocessing.slowest_rate_hz(part.rate_hz, config.conditioning.rate_hz)
    preprocessing.require_one_model(part.path, part.n_samples / part.rate_hz, rate_hz, purpose=purpose)


def _physics(log: FlightLog, config: Config, progress: Progress) -> tuple[Evidence, Config]:
    """Return what physics says of the window, and the configuration of a search with its share of the level."""
    if config.method != "ml" or not flightlog.is_told_by_physics(log, config.outputs):
        return Evidence(source="physics"), config
    # What is imported here takes as long as a short log without such channels.
    from .flight.evidence import SHARE, physics_evidence

    physics = physics_evidence(log, config, progress)
    if not physics.candidates and not physics.faults:
        return physics, config
    return physics, merge(config, {"start_time.false_alarm": (1.0 - SHARE) * config.start_time.false_alarm})


def identify(
    log: FlightLog,
    dictionary: Dictionary | None,
    config: Config,
    progress: Progress = unseen,
    *,
    findings: Sequence[Implausible] = (),
) -> tuple[IdentifyResult, Dictionary]:
    """Identify faults in a window, and return the result with the dictionary of what was identified.

    1. Identify the entries whose onsets are stated.
    2. Search all onsets of the window less these faults: for the kinds of fault of the dictionary, without one for
       all; beside entries that state their onsets for whatever they do not explain.
    3. Conclude from the evidence of both.
    4. Estimate again, jointly, where the search found faults.

    Parameters
    ----------
    dictionary : None to search for every kind of fault.
    findings : on channels that are wrong throughout the flight.

    Raises
    ------
    LogError, ConfigError, DictionaryError : see `bfi_cli.model.identify_faults` and `bfi_cli.model.onset.find_onset`.
    """
    config = preprocessing.with_inputs_of(log, config)
    part = log.window(config.window.from_s, config.window.to_s)
    kinds = () if dictionary is None else _live_kinds(part, dictionary.searched, config)
    arithmetic = _arithmetic(findings)
    if dictionary is None or (kinds and not dictionary.exact.atoms):
        return _identify_kinds(log, part, dictionary, kinds, config, arithmetic, progress)
    _require_one_model(part, config, "estimate")
    on_model: tuple[Note, ...] = ()
    if log.earlier:
        log, on_model = model.with_those_that_share(log, dictionary.exact, config, progress)
        part = replace(part, earlier=log.earlier)
    result = _identify_entries(log, part, dictionary, kinds, config, arithmetic, progress, first=on_model)
    return result, dictionary


def _live_kinds(part: FlightLog, searched: Dictionary, config: Config) -> tuple[Fault, ...]:
    """Return the kinds of fault of a dictionary that may begin in the window, on the axis of the log.

    Raises
    ------
    DictionaryError : there are some, and none may.
    """
    start_s, stop_s = float(part.time_s[0]), float(part.time_s[-1])
    kinds = searched.resolved(start_s)
    reasons = [dead_reason_of_kind(kind, start_s, stop_s, config.outputs) for kind in kinds]
    if kinds and all(reasons):
        raise DictionaryError(f"{searched.path}: no live atom: {reasons[0]}")
    return tuple(kind for kind, reason in zip(kinds, reasons, strict=True) if reason is None)


def _identify_kinds(
    log: FlightLog,
    part: FlightLog,
    dictionary: Dictionary | None,
    kinds: Sequence[Fault],
    config: Config,
    arithmetic: Evidence,
    progress: Progress,
) -> tuple[IdentifyResult, Dictionary]:
    """Identify kinds of fault whose onsets are not known: the search names them, and the model is that with them."""
    _require_one_model(part, config)
    physics, scanning = _physics(log, config, progress)
    scanned = [kind for kind in kinds if scanned_shape(kind.shape) is not None]
    searched = onset.search_onsets(log, merge(scanning, {"method": "ml"}), progress, kinds=scanned)
    evidence = searched.evidence
    if dictionary is not None:
        from_s = float(part.time_s[0]) if dictionary.relative_to == "window" else 0.0
        evidence = replace(evidence, faults=tuple(_named(fault, dictionary, from_s) for fault in evidence.faults))
    sources = [evidence, physics, arithmetic]
    conclusion = model.conclusion_of(log, config, sources)
    declared = [fault for fault in conclusion.faults if fault.source == "scan"]
    proposed = _as_dictionary([estimate.fault for estimate in declared] or searched.likeliest, dictionary)
    log, on_model = model.with_those_that_share(log, proposed, config) if log.earlier else (log, ())
    if declared:
        fit = model.identification(log, proposed, config, progress, given=config.method == "ml")
    else:
        nothing = config.selection.model_copy(update={"max_active": 0})
        none = config.model_copy(update={"selection": nothing, "method": "ml"})
        fit = model.identification(log, proposed, none, progress)
    if fit.outcome.fires:
        # The search decides, whatever becomes of a solver that only makes the model that is shown.
        conclusion = model.conclusion_of(log, config, sources, replace(fit.outcome, converged=True))
    how = "no dictionary" if dictionary is None else "the onsets of the dictionary are not known"
    if declared:
        how += f": {len(declared)} declared by the search over all onsets, magnitudes estimated jointly"
    else:
        percent = 100.0 * config.start_time.false_alarm
        how += f": the search over all onsets declares none at a false-alarm rate of {percent:.3g} %"
    result = model.result_of(
        log,
        config,
        replace(fit, truth=_truth_by_onset(fit, conclusion.faults, part)),
        conclusion,
        _summary_of(evidence, "it proposed the faults"),
        first=[Note.method(how)],
        notes=(*on_model, *evidence.notes, *physics.notes, *_left_out(dictionary, kinds, physics)),
    )
    return result, proposed


def _left_out(dictionary: Dictionary | None, live: Sequence[Fault], physics: Evidence) -> tuple[Note, ...]:
    """Return notes on kinds of a dictionary that cannot begin in the window, or that nothing in the log tells."""
    names = {kind.name for kind in live}
    late = [f"'{atom.name}'" for atom in (dictionary.searched.atoms if dictionary else ()) if atom.name not in names]
    untold = [f"'{kind.name}'" for kind in live if scanned_shape(kind.shape) is None]
    notes = [Note.limit(f"no onset of {', '.join(late)} is in the window: left out")] if late else []
    if untold and not physics.candidates and not physics.faults:
        notes.append(Note.limit(f"left out: no channel of the log tells {', '.join(untold)} from other slow faults"))
    return tuple(notes)


def _named(estimate: FaultEstimate, dictionary: Dictionary, from_s: float) -> FaultEstimate:
    """Return a fault with the name of its entry; one without a name of its own is called shape_channel_second.

    Parameters
    ----------
    from_s : what the times of the dictionary count from, on the axis of the log.
    """
    channel, shape = estimate.fault.channel, estimate.fault.shape
    stem = f"{shape}_{channel}"
    names = [atom.name or stem for atom in dictionary.searched.atoms if (atom.shape, atom.channel) == (shape, channel)]
    name = next(iter(names), stem)
    if name == stem:
        name = f"{stem}_{estimate.fault.onset_s - from_s:.0f}"
    return replace(estimate, name=name, fault=replace(estimate.fault, name=name))


def _as_dictionary(atoms: Sequence[Fault], dictionary: Dictionary | None) -> Dictionary:
    """Return faults as a dictionary, each with a name of its own."""
    if len({atom.name for atom in atoms}) < len(atoms):
        atoms = [replace(atom, name=f"{atom.name}_{i}") for i, atom in enumerate(atoms, 1)]
    known = Dictionary(atoms=(), relative_to="log", sha256="", path="onset scan") if dictionary is None else dictionary
    return replace(known, atoms=tuple(atoms), relative_to="log")


def _truth_by_onset(fit: Identification, faults: Sequence[FaultEstimate], part: FlightLog) -> Comparison | None:
    """Return the comparison with injected faults, by onset: no search finds the very signal that was injected."""
    if fit.truth is None:
        return None
    tolerance_s, injected = ONSET_SAMPLES / fit.window.summary.rate_hz, part.truth.faults if part.truth else ()
    comparison = compare_by_onset(faults, injected, tolerance_s=tolerance_s)
    return replace(comparison, vaf_fault=fit.truth.vaf_fault)


def _identify_entries(
    log: FlightLog,
    part: FlightLog,
    dictionary: Dictionary,
    kinds: Sequence[Fault],
    config: Config,
    arithmetic: Evidence,
    progress: Progress,
    *,
    first: Sequence[Note],
) -> IdentifyResult:
    """Identify entries that state their onsets, and search the window less these for what they do not explain."""
    stated = dictionary.exact.resolved(float(part.time_s[0]))
    preprocessing.require_one_trim(part, stated, config)
    physics, scanning = _physics(log, config, progress)
    fit = model.identification(log, dictionary.exact, config, progress)
    entries = fit.evidence
    if not fit.outcome.converged:
        scan = model.ScanSummary.not_made("not scanned: the solver did not converge")
        conclusion = model.conclusion_of(log, config, [entries, arithmetic], fit.outcome)
        return model.result_of(log, config, fit, conclusion, scan, first=first, notes=[Note.limit(scan.note)])
    summary = fit.window.summary
    exact = summary.rate_hz == summary.native_rate_hz and all(vaf > EXPLAINED for vaf in fit.vaf_output.values())
    looked_for = {candidate.kind for candidate in entries.candidates if candidate.state is not None}
    duration_s = summary.stop_s - summary.start_s
    as_entries = partial(at_entries, entries=stated, rate_hz=fit.model.rate_hz, duration_s=duration_s)
    entries, physics = as_entries(entries, physics)
    searched: OnsetSearch | str
    if any(SHAPES[estimate.fault.shape].acts_on == "course" for estimate in entries.faults):
        searched = "not scanned: a fault of unknown shape is declared"
    elif (why_not := _why_not_scanned(part, config, exact=exact)) is not None:
        searched = why_not
    else:
        searched = _scan_beside(
            _corrected(part, fit, config),
            scanning,
            stated,
            progress,
            kinds=kinds,
            claims=[kind for kind in KINDS if kind not in looked_for or kinds or entries.faults],
            known=entries.faults,
        )
    if isinstance(searched, str):
        entries = entries if exact else _within_tolerance(entries, None, config)
        conclusion = model.conclusion_of(log, config, [entries, physics, arithmetic], fit.outcome)
        scan, notes = model.ScanSummary.not_made(searched), (*physics.notes, Note.limit(searched))
        return model.result_of(log, config, fit, conclusion, scan, first=first, notes=notes)
    entries = _within_tolerance(entries, searched, config)
    entries = replace(
        entries,
        candidates=not_excluded(entries.candidates, searched.rivals),
        faults=tuple(_with_rivals(fault, searched.rivals) for fault in entries.faults),
    )
    entries, scanned = as_entries(entries, searched.evidence)
    sources = [entries, _beside_entries(scanned, looked_for), physics, arithmetic]
    conclusion = model.conclusion_of(log, config, sources, fit.outcome)
    joint = _jointly(log, dictionary, conclusion.faults, config, progress)
    if joint is not None:
        # All faults in one model have other sizes than each beside some of them, and the same states.
        sources = [replace(evidence, faults=_sized_by(joint, evidence.faults, log, config)) for evidence in sources]
        conclusion = model.conclusion_of(log, config, sources, fit.outcome)
    declares = any(fault.source == "scan" for fault in conclusion.faults)
    return model.result_of(
        log,
        config,
        fit,
        conclusion,
        _summary_of(searched.evidence, f"it declares {'another' if declares else 'no other'} fault"),
        shown=joint,
        first=first,
        notes=physics.notes,
    )


def _with_rivals(fault: FaultEstimate, rivals: Collection[tuple[Shape, str]]) -> FaultEstimate:
    """Return a fault that is told from no fault of another kind which may stand in its place."""
    kind, channel = SHAPES[fault.fault.shape].kind, fault.fault.channel
    others = [shape for shape, on in sorted(rivals) if on == channel and SHAPES[shape].kind != kind]
    return replace(fault, among=tuple(dict.fromkeys((*fault.among, *others))))


def _scan_beside(
    window: FlightLog,
    config: Config,
    entries: Sequence[Fault],
    progress: Progress,
    *,
    kinds: Sequence[Fault],
    claims: Collection[Kind],
    known: Sequence[FaultEstimate],
) -> OnsetSearch | str:
    """Search all onsets of a window beside entries of a dictionary that state theirs, or return why not.

    The calibration is a table that fits or the nearest one: windows of the log itself would take longer than the
    analysis beside which this is done.

    Parameters
    ----------
    window : of the log, less the faults that are known; known : these.
    entries : of the dictionary, on the axis of the window.
    kinds : entries whose onsets are searched; without them every kind is.
    claims : the kinds of fault of which limits are sought, as the dictionary has none of them.
    """
    try:
        channels = [name for name in (*config.inputs, *config.outputs) if name in window.channels]
        preprocessing.must_resample(window, channels, config.conditioning.rate_hz)
        scanning = merge(config, {"method": "ml", "model.feedthrough": config.feedthrough})
        if config.start_time.calibration == "self":
            scan = scanning.start_time.model_copy(update={"calibration": None})
            scanning = scanning.model_copy(update={"start_time": scan})
        return onset.search_onsets(window, scanning, progress, kinds=kinds, entries=entries, claims=claims, known=known)
    except (ConfigError, LogError) as problem:
        return f"not scanned for other onsets: {problem}"


def _why_not_scanned(window: FlightLog, config: Config, *, exact: bool) -> str | None:
    """Return why a window is not scanned beside an analysis, as far as its length tells; None where it may be."""
    if exact:
        return "not scanned for other onsets: the model explains the log to round-off"
    asked = config.conditioning.rate_hz
    rate_hz = asked if not isinstance(asked, str) else min(window.rate_hz, FASTEST_HZ)
    n_samples = round(window.n_samples / window.rate_hz * (window.rate_hz if asked == "none" else rate_hz))
    if n_samples > MOST_SAMPLES:
        return f"not scanned for other onsets: {n_samples} samples are more than {MOST_SAMPLES}; cut the window"
    return None


def _within_tolerance(entries: Evidence, searched: OnsetSearch | None, config: Config) -> Evidence:
    """Return the evidence of entries whose onsets are known to a tolerance only, with the limits of the search."""
    if config.onset_tolerance_s == 0.0 or not METHODS[config.method].intervals:
        return entries
    scanned = [None] * len(entries.candidates) if searched is None else searched.entry_claims
    return replace(entries, candidates=tuple(map(with_limit_of_scan, entries.candidates, scanned)))


def _beside_entries(evidence: Evidence, looked_for: set[Kind]) -> Evidence:
    """Return what a search says beside entries of a dictionary: faults, suspects, limits of kinds they lack."""
    candidates = tuple(
        replace(candidate, name=f"{candidate.name} (scan)")
        for candidate in evidence.candidates
        if candidate.kind not in looked_for or candidate.state in ("declared", "suspected")
    )
    return replace(evidence, candidates=candidates)


def _jointly(
    log: FlightLog, dictionary: Dictionary, faults: Sequence[FaultEstimate], config: Config, progress: Progress
) -> Identification | None:
    """Return the identification of a model with all declared faults, None where the dictionary's has them already."""
    if all(fault.source == "dictionary" for fault in faults):
        return None
    # The log has no signal of what holds a reading.
    with_signal = [estimate for estimate in faults if SHAPES[estimate.fault.shape].acts_on != "held"]
    if config.method != "ml" or not with_signal:
        return None
    atoms = tuple(replace(estimate.fault, name=estimate.name, magnitude=1.0) for estimate in with_signal)
    return model.identification(log, replace(dictionary, atoms=atoms, relative_to="log"), config, progress, given=True)


def _sized_by(
    joint: Identification, faults: Sequence[FaultEstimate], log: FlightLog, config: Config
) -> tuple[FaultEstimate, ...]:
    """Return faults with the magnitudes of a model that has all of them."""
    # An uncertain recorder was profiled for each fault where it was found, and is not for all of them together.
    if alternatives(flightlog.recorder_filters(log, config.recorder.edge_hz, config.recorder.kind)[0]):
        return tuple(faults)
    sized = {fault.name: fault for fault in joint.evidence.faults}
    keys = ("magnitude", "physical_value", "sd", "ci95")
    return tuple(
        replace(fault, **{key: getattr(sized[fault.name], key) for key in keys}) if fault.name in sized else fault
        for fault in faults
    )


def _corrected(part: FlightLog, fit: Identification, config: Config) -> FlightLog:
    """Return the window of a log less the faults that are declared in it, through the recorder that they suit."""
    recorder = fit.recorder or config.recorder
    response = response_of(flightlog.recorder_filters(part, recorder.edge_hz, recorder.kind)[0], part.rate_hz)
    # A channel that is derived from others is made of them anew in the scan.
    declared = fit.evidence.faults
    known = [estimate for estimate in declared if estimate.magnitude and estimate.fault.channel in part.channels]
    line_faults = [estimate for estimate in known if estimate.fault.shape in LINE_SHAPES]
    faults = [
        replace(estimate.fault, magnitude=-estimate.magnitude) for estimate in known if estimate not in line_faults
    ]
    part = replace(flightlog.inject(part, faults, response=response), truth=None) if faults else part
    for line_fault in line_faults:
        part = flightlog.without_line_fault(part, replace(line_fault.fault, magnitude=line_fault.magnitude), response)
    return part


def _summary_of(evidence: Evidence, note: str) -> ScanSummary:
    """Return what the search alone says of the window."""
    verdicts = verdicts_of(evidence.candidates)
    faults = tuple(_sentence(fault) for fault in evidence.faults)
    return model.ScanSummary(decision=decide(verdicts, KINDS), verdicts=verdicts, faults=faults, note=note)


def _sentence(estimate: FaultEstimate) -> str:
    size, onset_s = quantity(estimate.magnitude, estimate.unit), instant(estimate.fault.onset_s)
    return f"{SHAPES[estimate.fault.shape].label} of {size} on {estimate.fault.channel} from {onset_s} s"
