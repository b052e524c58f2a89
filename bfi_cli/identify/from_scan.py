"""Identification and the scan over all onsets on one window: they check each other, or the scan takes the lead.

A dictionary states onsets, so that a fault at another one is not in it. The scan looks at all of them: what it declares
is never "no fault". Without a dictionary the scan proposes the faults, and identification estimates them
jointly; what it cannot confirm is suspected, with both numbers.
"""

from __future__ import annotations

from dataclasses import fields, replace

from ..config import Config, merge
from ..decision import KINDS, UNTESTED, Candidate, decide, kind_of, summarise, verdicts_of
from ..dictionary import Dictionary
from ..faults import FaultEstimate
from ..filters import response_of
from ..flightlog import FlightLog, inject
from ..flightlog.injection import without_line_fault
from ..flightlog.recorder import recorder_filters
from ..kernels.progress import Progress, unseen
from ..onset import (
    STANDS_FOR,
    OnsetResult,
    find_onset,
    propose_dictionary,
    scan_beside,
    why_not_scanned,
    with_limit_of_scan,
)
from ..preprocessing.advice import require_one_trim
from ..preprocessing.window import with_inputs_of
from ..report.text import instant, quantity
from ..shapes import OF_LINES, SHAPES
from ..truth import Comparison, compare_by_onset
from .identify import NOT_CONVERGED, identify_faults
from .methods import METHODS
from .result import IdentifyResult, ScanSummary

__all__ = ["identify_and_scan", "identify_from_scan"]

# Samples by which an estimated onset may miss the injected one: one for the estimate, half a one for the resampling.
# Chosen without a tuning record; only the comparison with an injected truth depends on it.
ONSET_SAMPLES = 1.5
# Variance accounted for, %, beyond which the prediction errors at the log's own rate are round-off.
EXPLAINED = 100.0 - 1e-9


def identify_and_scan(
    log: FlightLog, dictionary: Dictionary, config: Config, progress: Progress = unseen
) -> IdentifyResult:
    """Identify the faults of a dictionary, and let the scan over all onsets look at the same window.

    1. Identify the faults of the dictionary.
    2. Scan all onsets of the window less the declared faults. What the scan declares there is suspected.
    3. Of a kind of fault that the dictionary has no entry of, the scan's verdict is given. Where onsets are known to a
       tolerance only, the limits of the entries are those of the scan. Entries too near an end of the window for any
       claim count for no verdict: a note names the onsets of the others.

    Raises
    ------
    LogError, ConfigError, DictionaryError : see `bfi_cli.identify.identify_faults` and `bfi_cli.onset.find_onset`.
    """
    part = log.window(config.window.from_s, config.window.to_s)
    faults = dictionary.resolved(float(part.time_s[0]))
    require_one_trim(part, faults, config)
    result = identify_faults(log, dictionary, config, progress)
    exact = result.log.rate_hz == result.log.native_rate_hz and all(
        vaf > EXPLAINED for vaf in result.vaf_output.values()
    )
    if any(SHAPES[one.fault.shape].acts_on == "course" for one in result.faults):
        return _with_scan(_unchecked(result, config), None, "not scanned beside a fault of unknown shape")
    scanned = why_not_scanned(part, config, exact=exact) or scan_beside(
        _corrected(log, result, config), config, faults, progress, exact=exact
    )
    if isinstance(scanned, str):
        return _with_scan(result if exact else _unchecked(result, config), None, scanned)
    result = _with_onsets(_checked(result, scanned, config))
    if not result.faults or "no_fault" not in result.verdicts.values():
        return result
    measured = scan_beside(part, config, (), progress, exact=False)
    return _as_measured(result, measured, config)


def _with_onsets(result: IdentifyResult) -> IdentifyResult:
    """Return the result with a note on the onsets of the entries that count, where others begin too near an end."""
    untested = sum(one.state is None and one.note == UNTESTED for one in result.candidates)
    counted = [one.onset_s for one in result.candidates if one.state is not None and one.onset_s is not None]
    if not untested or not counted:
        return result
    begin = f"{untested} entries begin" if untested > 1 else "one entry begins"
    note = f"claims hold for onsets from {instant(min(counted))} to {instant(max(counted))} s: {begin} {UNTESTED}"
    return replace(result, notes=(*result.notes, note))


def _as_measured(result: IdentifyResult, measured: OnsetResult | str, config: Config) -> IdentifyResult:
    """Return the result with no claim on a kind of fault of which a scan of the window as measured makes none.

    What is declared may stand for another fault, as a lag and a step do for a slow oscillation. The window less it
    does not show that fault any more.
    """
    kinds = [
        kind
        for kind, verdict in result.verdicts.items()
        if verdict == "no_fault" and (isinstance(measured, str) or measured.verdicts[kind] != "no_fault")
    ]
    if not kinds:
        return result
    candidates = tuple(
        replace(one, state="not_seen", excluded_above=None, effect=None, note=STANDS_FOR)
        if one.kind in kinds and one.state == "excluded"
        else one
        for one in result.candidates
    )
    verdicts = {kind: "inconclusive" if kind in kinds else verdict for kind, verdict in result.verdicts.items()}
    return replace(result, candidates=candidates, verdicts=verdicts, summary=summarise(verdicts, candidates))


def _unchecked(result: IdentifyResult, config: Config) -> IdentifyResult:
    """Return the result of a window that was not scanned: onsets known to a tolerance only exclude nothing."""
    if config.onset_tolerance_s == 0.0 or result.summary == NOT_CONVERGED:
        return result
    candidates = tuple(
        with_limit_of_scan(one, None, None) if one.state in ("excluded", "not_seen") else one
        for one in result.candidates
    )
    verdicts = verdicts_of(candidates)
    decision = "fault" if result.decision == "fault" else decide(verdicts, config.require)
    summary = summarise(verdicts, candidates)
    return replace(result, candidates=candidates, verdicts=verdicts, decision=decision, summary=summary)


def _corrected(log: FlightLog, result: IdentifyResult, config: Config) -> FlightLog:
    """Return the window of a log less the faults that are declared in it."""
    part = log.window(config.window.from_s, config.window.to_s)
    response = response_of(recorder_filters(log, config.recorder.edge_hz, config.recorder.kind)[0], log.rate_hz)
    # A channel that is derived from others is made of them anew in the scan.
    known = [one for one in result.faults if one.magnitude and one.fault.channel in part.channels]
    of_lines = [one for one in known if one.fault.shape in OF_LINES]
    faults = [replace(one.fault, magnitude=-one.magnitude) for one in known if one not in of_lines]
    part = replace(inject(part, faults, response=response), truth=None) if faults else part
    for one in of_lines:
        part = without_line_fault(part, replace(one.fault, magnitude=one.magnitude), response)
    return part


def identify_from_scan(
    log: FlightLog, config: Config, progress: Progress = unseen
) -> tuple[IdentifyResult, Dictionary]:
    """Identify the faults that the onset scan declares, and return them with the dictionary they make.

    The magnitudes are estimated jointly, onsets taken as known; where a joint estimate is compatible with no fault at
    all, or has the other sign, the fault is suspected. Where the scan declares none, neither does this, and the
    candidates are those of the scan.

    Raises
    ------
    LogError, ConfigError : see `bfi_cli.onset.find_onset` and `bfi_cli.identify.identify_faults`.
    """
    config = with_inputs_of(log, config)
    scanned = find_onset(log, merge(config, {"method": "ml"}), progress)
    dictionary = propose_dictionary(scanned)
    if scanned.faults:
        result = identify_faults(log, dictionary, config, progress, given=config.method == "ml")
        said = (
            f"no dictionary: {len(scanned.faults)} found by the onset scan; their onsets are taken as known here, and "
            "magnitudes estimated jointly"
        )
    else:
        nothing = config.selection.model_copy(update={"max_active": 0})
        none = config.model_copy(update={"selection": nothing, "method": "ml"})
        result = identify_faults(log, dictionary, none, progress)
        said = (
            f"no dictionary: the onset scan finds no fault at a false-alarm rate of {100.0 * scanned.false_alarm:.3g} %"
        )
    faults, suspects = _confirmed(result, scanned)
    declared = {fault.name for fault in faults}
    own = [one for one in result.candidates if one.name in declared]
    candidates = (*own, *suspects, *(one for one in scanned.candidates if one.state != "declared"))
    verdicts = verdicts_of(candidates)
    notes = (said, *scanned.notes, *(note for note in result.notes if note not in scanned.notes))
    truth = result.truth
    if truth is not None:  # it asks for the very same signal, which an estimated onset or frequency never gives
        tolerance_s = ONSET_SAMPLES / result.log.rate_hz
        comparison = compare_by_onset(faults, scanned.truth or (), tolerance_s=tolerance_s)
        truth = replace(truth, **{field.name: getattr(comparison, field.name) for field in fields(Comparison)})
    result = replace(
        result,
        faults=faults,
        candidates=candidates,
        verdicts=verdicts,
        decision=decide(verdicts, config.require),
        summary=summarise(verdicts, candidates),
        notes=notes,
        truth=truth,
    )
    return _with_scan(result, scanned, "it proposed the faults"), dictionary


def _with_scan(result: IdentifyResult, scanned: OnsetResult | None, note: str) -> IdentifyResult:
    """Return the result with what the scan says of the window."""
    if scanned is None:
        summary = ScanSummary(decision=None, verdicts=dict.fromkeys(KINDS, "inconclusive"), faults=(), note=note)
        return replace(result, scan=summary, notes=(*result.notes, note))
    said = tuple(_said(one.estimate) for one in scanned.faults)
    return replace(
        result, scan=ScanSummary(decision=scanned.decision, verdicts=scanned.verdicts, faults=said, note=note)
    )


def _said(fault: FaultEstimate) -> str:
    size = quantity(fault.magnitude, fault.unit)
    return f"{SHAPES[fault.fault.shape].label} of {size} on {fault.fault.channel} from {instant(fault.fault.onset_s)} s"


def _confirmed(result: IdentifyResult, scanned: OnsetResult) -> tuple[tuple[FaultEstimate, ...], tuple[Candidate, ...]]:
    """Return the scan's faults that the joint estimate confirms, and the others as suspected candidates."""
    if not scanned.faults:
        return (), ()
    by_name, own = {one.name: one for one in result.faults}, {one.channel: one.unit for one in result.outputs}
    joint = {one.name: one for one in result.candidates}
    faults, suspects = [], []
    for one, atom in zip(scanned.faults, propose_dictionary(scanned).atoms, strict=True):
        name, scan = atom.name or atom.shape, one.estimate
        here = by_name.get(name)
        if here is not None and here.magnitude * scan.magnitude > 0.0 and not here.ci95[0] <= 0.0 <= here.ci95[1]:
            faults.append(here)
            continue
        other = joint.get(name)
        size = "-" if other is None or other.magnitude is None else quantity(other.magnitude, scan.unit)
        suspects.append(
            Candidate(
                name=name,
                shape=scan.fault.shape,
                channel=scan.fault.channel,
                kind=kind_of(scan.fault, declared=True),
                state="suspected",
                magnitude=scan.magnitude,
                unit=scan.unit,
                sd=None,
                channel_unit=own.get(scan.fault.channel, ""),
                note=(
                    f"the scan over all onsets declares {quantity(scan.magnitude, scan.unit)}, the joint estimate at "
                    f"its onset {size} does not confirm it"
                ),
            )
        )
    return tuple(faults), tuple(suspects)


def _checked(result: IdentifyResult, scanned: OnsetResult, config: Config) -> IdentifyResult:
    """Return the result with the scan's verdicts on kinds that the dictionary lacks, and what it declares suspected.

    Parameters
    ----------
    scanned : the window less the declared faults.
    """
    if result.summary == NOT_CONVERGED:
        return _with_scan(result, scanned, "it cannot check an answer of a solver that did not converge")
    candidates = list(result.candidates)
    if config.onset_tolerance_s > 0.0 and METHODS[config.method].intervals:
        limits = zip(candidates, scanned.of_dictionary, strict=True)
        candidates = [with_limit_of_scan(one, limit, scanned.covered_s) for one, limit in limits]
    looked_for = {one.kind for one in candidates if one.state is not None}
    found = [one.estimate for one in scanned.faults]
    for estimate in found:
        kind, channel = kind_of(estimate.fault, declared=True), estimate.fault.channel
        note = f"the scan over all onsets declares a {_said(estimate)}"
        for i, one in enumerate(candidates):
            alike = one.channel == channel and SHAPES[one.shape].kind == kind
            if alike and one.state in ("excluded", "not_seen"):
                candidates[i] = replace(one, state="suspected", kind=kind, note=note)
    # What the scan declares or suspects beside the dictionary's faults is suspected here.
    extra = [
        replace(one, state="suspected") if one.state == "declared" else one
        for one in scanned.candidates
        if one.kind not in looked_for or one.state in ("declared", "suspected")
    ]
    suspects = [replace(one, name=f"{one.name} (scan)") for one in extra if one.state == "suspected"]
    verdicts = verdicts_of([*candidates, *extra])
    disagreement = [
        f"the scan over all onsets declares a {_said(estimate)}, which no declared entry of the dictionary explains; "
        "see bfi start-time"
        for estimate in found
    ]
    decision = "fault" if result.decision == "fault" else decide(verdicts, config.require)
    result = replace(
        result,
        candidates=(*candidates, *suspects),
        verdicts=verdicts,
        decision="inconclusive" if found and decision == "no_fault" else decision,
        summary=summarise(verdicts, [*candidates, *extra]),
        notes=(*disagreement, *result.notes),
    )
    return _with_scan(result, scanned, "it declares another fault" if found else "it declares no other fault")
