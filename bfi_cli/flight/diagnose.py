"""The diagnosis of a flight: phases, windows, every analysis that the log allows, and one answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np

from ..config import Config, merge
from ..decision import WITHHELD, State, conclude
from ..faults.shapes import SHAPES
from ..flightlog import FlightLog
from ..kernels import TWO_SIDED_95, FloatArray
from ..kernels.progress import Progress, Report, unseen
from ..model.result import LogSummary, log_summary
from ..notes import Note
from ..quantities.channels import STANDARD
from ..quantities.text import quantity
from ..threads import one_thread
from .corrected import SHOWN, corrected_channels, course_of
from .events import (
    Draft,
    as_one,
    beyond_its_tolerance,
    errors_of_rivals,
    is_certain,
    join,
    largest_first,
    merge_stages,
    with_ends,
)
from .exact_events import (
    AFTER_HOLD_S,
    events_of_defects,
    notes_on_defects,
)
from .flight import Flight, flight_of
from .limits import bounds_of, limit_courses, limits_of
from .looks import (
    GLANCE_S,
    SHORTEST_S,
    STEP_S,
    Scanned,
    glance_at_flight,
    inputs_for,
    rate_of,
    search_stretch,
    summary_of,
)
from .naming import finding_of_glance, findings_of_search, repeat_advice, vote_against
from .parity import LENGTHS_S
from .parity.finding import Explanation
from .parity.leaks import begins_within
from .parity.record import STATIC_LEAK, record_of
from .parity.sampled import unit_of
from .parity.static_relations import RelationAnswer
from .parity.windows import Window, overlaps, windows_in
from .plausibility import Implausible, without_constant_errors
from .relations import StaticWindows, drafts_of_disagreements, drafts_of_relations, find_relations, intact_channels
from .result import DiagnoseResult, Event, Strip
from .slow_faults import SlowFaults, find_slow_faults
from .unwatched import missing_sentences, unwatched_by_lines, unwatched_by_scan, unwatched_by_steps
from .verdict import evidence_of, sentence_of
from .weighing import weigh_events

AROUND_HOLD_S = 60.0  # shown beside a held line
# UNLIKE: times its threshold, up to which a statistic is doubted that no shipped table fits: by so much do thresholds
# of one aircraft differ with the inputs; the largest of 129 healthy windows is 129 with three and 39 with seven
# (docs/validation.md, constants, 10.2).
UNLIKE = 3.3


def diagnose_flight(
    log: FlightLog,
    config: Config,
    *,
    findings: Sequence[Implausible] = (),
    workers: int = 1,
    progress: Progress = unseen,
) -> DiagnoseResult:
    """Say which air-data fault hit a flight, when, how large and how sure, with everything that the log allows.

    1. Constant errors, dropouts, spikes and readings that stay still, which are left out of what follows. Phases of the
       flight: take-off, landing and parabolas are left out.
    2. Static relations and holds of the pressure lines, over the whole flight.
    3. The parity scan, on windows of 60, 120 and 240 s.
    4. The scan for steps and oscillations, on windows of 120 s.
    5. What windows and analyses found, joined into events; each is described in the window that suits it. What surely
       lies within the tolerances is a deviation.
    6. What could not have been seen.

    Parameters
    ----------
    findings : on channels that are wrong throughout; constant errors of one channel among them are taken out first.
    config : `diagnose` holds what is special to it; `window` is the part of the flight.
    workers : processes for step 4; the numbers are the same for any.
    progress : called with the name of the step and the fraction of it that is done.

    Raises
    ------
    LogError : the log has no part in flight, or no airspeed, or a time of `diagnose.events` is outside.
    ConfigError : the calibration cannot be used, or no flight has a cause of `diagnose.events`.
    """
    # 1. Short defects and constant errors are taken out, and the phases found.
    progress("phases of the flight", 0.0)
    recorded, (log, findings) = log, without_constant_errors(log, findings, config.tolerances)
    flight = flight_of(log, config)

    # 2. and 3. What lasts: holds, relations and the parity scan.
    with one_thread():
        drafts, static, slow = lasting_faults(flight, progress)
    flight = slow.flight

    # 4. Steps and oscillations.
    glanced, glances_missing, stepped = _glances(
        flight, config, static, workers, partial(progress, "steps and oscillations")
    )

    # 5. Events, and deviations within the tolerances.
    lasting = events_of(flight, [*drafts, *glanced])
    proposed = (*events_of_defects(flight), *lasting)
    answer = weigh_events(flight, proposed, config.diagnose)
    events = tuple(event for event in answer.events if event.beyond_tolerance is not False)

    # 6. What could not have been seen, and the conclusion.
    bounds = bounds_of(flight, slow.scanned, static, lasting)
    limits = limits_of(flight, bounds)
    unwatched = [*unwatched_by_scan(flight, bounds, lasting, events), *unwatched_by_lines(flight)]
    without_steps = unwatched_by_steps(flight, stepped) if stepped else []
    says = partial(sentence_of, events, limits, unwatched, without_steps, looked_for_steps=bool(stepped))
    evidence = evidence_of(events, limits, unwatched, flight.recorded, (*findings, *flight.not_credible))
    conclusion = conclude([evidence], config.require, says=says)
    events = tuple(map(_suspected, events)) if conclusion.is_withheld else events
    return DiagnoseResult(
        log=_summary(flight),
        decision=conclusion.decision,
        verdicts=conclusion.verdicts,
        summary=conclusion.summary,
        events=events,
        deviations=tuple(event for event in answer.events if event.beyond_tolerance is False),
        limits=limits,
        unwatched=tuple((stretch.from_s, stretch.to_s, stretch.why) for stretch in (*unwatched, *without_steps)),
        phases=flight.part_phases,
        windows=tuple(scan.look for scan in slow.scanned),
        missing=(
            *flight.unused,
            *missing_sentences(flight, slow.scanned, limits),
            *glances_missing,
            *(dict.fromkeys(flight.series[1]) if static else ()),
        ),
        false_alarm=flight.false_alarm,
        zero_lift_rad=flight.zero_lift,
        zero_lift_from=flight.zero_lift_from,
        time_s=flight.record.time_s,
        measured=_measured(recorded, flight),
        corrected=corrected_channels(flight.record, events),
        units={name: STANDARD[name].unit for name in _shown(flight)},
        strips=_strips(slow.scanned, static),
        limit_courses=limit_courses(flight, bounds),
        courses=tuple(course for k, event in enumerate(events) if (course := course_of(flight, event, k)) is not None),
        notes=(*_notes(slow), *answer.notes, *conclusion.notes),
        plausibility=conclusion.plausibility,
        ordinary=answer.ordinary,
    )


def _summary(flight: Flight) -> LogSummary:
    """Return what of the log was analysed."""
    log = flight.log
    inside = log.window(flight.from_s, flight.to_s)
    return log_summary(log.path, inside.time_s, rate_hz=log.rate_hz, native_rate_hz=log.rate_hz, epoch=log.epoch)


def _suspected(event: Event) -> Event:
    """Return an event that is declared as suspected, while channels contradict each other."""
    return replace(event, state="suspected", note=WITHHELD) if event.state == "declared" else event


def _notes(slow: SlowFaults) -> tuple[Note, ...]:
    """Return what is said of short defects, of what was not watched or set aside, and of thresholds that are raised."""
    flight = slow.flight
    unwatched = map(Note.limit, flight.held.missing(flight.from_s, flight.to_s))
    notes = [*flight.log.notes, *notes_on_defects(flight), *unwatched, *slow.notes]
    if "flaps" not in flight.recorded and flight.moved:
        notes.append(
            Note.limit(
                "no flaps are recorded: lift is not used after take-off and from the last descent on, where they may "
                "move"
            )
        )
    if slow.scale >= 1.005:
        notes.append(
            Note.method(
                f"thresholds are raised by {slow.scale:.3g}, as residuals are so many times those of the calibration "
                "flights: rough air, or a fault through most of the flight"
            )
        )
    return tuple(notes)


def lasting_faults(flight: Flight, progress: Progress) -> tuple[list[Draft], StaticWindows, SlowFaults]:
    """Return what sensors, pressure lines, static relations, lift and inertia show, the relations, and the scan."""
    part = (flight.from_s, flight.to_s)
    drafts = [
        Draft(finding=finding, window=part, until_s=finding.offset_s or part[1])
        for finding in flight.resting
        if finding.onset_s < part[1] and (finding.offset_s is None or finding.offset_s > part[0])
    ]
    drafts += [
        Draft(
            finding=finding,
            window=flight.around(finding.onset_s, finding.onset_s, AROUND_HOLD_S),
            until_s=finding.onset_ci95[1] + AFTER_HOLD_S,
        )
        for finding in flight.stepped
        if part[0] <= finding.onset_s < part[1]
    ]
    held: list[Draft] = []
    for hold in flight.held.findings:
        until_s = part[1] if hold.offset_s is None else hold.offset_s
        if hold.onset_s < part[1] and until_s > part[0]:
            window = flight.around(hold.onset_s, until_s, AROUND_HOLD_S)
            held.append(Draft(finding=hold, window=window, until_s=until_s + AFTER_HOLD_S))
    drafts += [*held, *drafts_of_disagreements(flight, held)]
    static = find_relations(flight, report=partial(progress, "static relations"))
    drafts += drafts_of_relations(flight, static)
    slow = find_slow_faults(flight, drafts, static, report=partial(progress, "lift and inertia"))
    drafts = [draft for draft in drafts if not _follows_from_leak(flight, draft, slow.drafts)]
    return [*drafts, *slow.drafts], static, slow


def events_of(flight: Flight, drafts: Sequence[Draft]) -> list[Event]:
    """Return what windows and analyses found as events, the largest beside its tolerance first."""
    large, small = _by_tolerance(flight, merge_stages(*_by_tolerance(flight, drafts)))
    return [_event(flight, draft) for draft in largest_first(flight, [*as_one(large), *as_one(small)])]


def _shown(flight: Flight) -> list[str]:
    """Return the channels that are drawn over the flight, those with short defects too."""
    wrong = (defect.channel for defect in flight.defects)
    return [name for name in dict.fromkeys((*SHOWN, *wrong)) if name in flight.record.channels]


def _measured(recorded: FlightLog, flight: Flight) -> dict[str, FloatArray]:
    """Return the channels that are shown once a second, with the short defects that the analyses leave out."""
    shown = _shown(flight)
    wrong = [name for name in dict.fromkeys(defect.channel for defect in flight.defects) if name in shown]
    as_recorded = record_of(replace(recorded, channels={name: recorded.channels[name] for name in wrong}))
    return {name: (as_recorded if name in wrong else flight.record).channels[name] for name in shown}


def _by_tolerance(flight: Flight, drafts: Sequence[Draft]) -> tuple[list[Draft], list[Draft]]:
    """Return the drafts that may be beyond the tolerances, and those that are surely within: these hide no other."""
    within = [beyond_its_tolerance(flight, draft) is False for draft in drafts]
    pairs = list(zip(drafts, within, strict=True))
    return [draft for draft, is_small in pairs if not is_small], [draft for draft, is_small in pairs if is_small]


def _follows_from_leak(flight: Flight, line: Draft, slow: Sequence[Draft]) -> bool:
    """Return whether a pitot line is held that loses its airspeed to a static line which leaks already, not only may.

    A static line that rests shows it itself, and is absorbed by no leak that the scan infers.
    """
    if line.finding.stage != "holds" or line.finding.fault == "static_blocked":
        return False
    leaks = [
        draft.finding for draft in slow if draft.finding.fault == STATIC_LEAK and _state(flight, draft)[0] == "declared"
    ]
    return any(begins_within(line.finding, leak) for leak in leaks)


def _glances(
    flight: Flight,
    config: Config,
    static: StaticWindows,
    workers: int,
    report: Report,
) -> tuple[list[Draft], list[str], list[Window]]:
    """Return what the scan for steps and oscillations found, why it did not look, and the windows in which it did."""
    inputs = inputs_for(flight.log)
    output = next((name for name in ("tas", "cas", "ias") if name in flight.recorded), None)
    if output is None:
        return [], ["no airspeed: steps and oscillations of the airspeed were not looked for"], []
    windows = flight.windows(GLANCE_S, STEP_S)
    if not windows:
        return _searched(flight, config, static, output, report)
    if "elevator" not in inputs:
        return [], [f"no elevator: windows of {GLANCE_S:g} s were not scanned for steps and oscillations"], []
    rate = rate_of(flight.false_alarm, len(windows_in(flight.phases, GLANCE_S, step_s=STEP_S)))
    used = merge(config, {"inputs": inputs, "outputs": (output,), "start_time": {"false_alarm": rate}})
    answers = glance_at_flight(flight.log, windows, used, workers=workers, report=report)
    drafts = []
    for window, answer in answers:
        if answer is None or isinstance(answer, str):
            continue
        relations = intact_channels(static, window)
        whole = output in relations and relations[output]
        finding = finding_of_glance(answer, flight.recorded, relations=whole, unit=STANDARD[output].unit)
        drafts.append(Draft(finding=finding, window=window, until_s=window[1]))
    failed = summary_of(answers)
    missing = [f"{n} of {len(answers)} windows were not scanned for steps: {why}" for why, n in failed.items()]
    return with_ends(join(drafts)), missing, [window for window, answer in answers if not isinstance(answer, str)]


def _searched(
    flight: Flight, config: Config, static: StaticWindows, output: str, report: Report
) -> tuple[list[Draft], list[str], list[Window]]:
    """Return what `_glances` does of a flight too short for its windows: each stretch is searched as a whole."""
    stretches = [stretch for stretch in flight.stretches if stretch[1] - stretch[0] >= SHORTEST_S]
    if not stretches:
        return [], [f"no {SHORTEST_S:g} s of flight: steps and oscillations of the airspeed were not looked for"], []
    used = merge(
        config, {"outputs": (output,), "start_time": {"false_alarm": rate_of(flight.false_alarm, len(stretches))}}
    )
    drafts, missing, windows = [], [], []
    for k, window in enumerate(stretches):
        report(k / len(stretches))
        search = search_stretch(flight.log, window, used)
        if isinstance(search, str):
            missing.append(f"{window[0]:.0f} to {window[1]:.0f} s was not searched for steps: {search}")
            continue
        relations = intact_channels(static, window)
        whole = output in relations and relations[output]
        findings = findings_of_search(search, output, flight.recorded, relations=whole)
        drafts += [Draft(finding=finding, window=window, until_s=window[1]) for finding in findings]
        windows.append(window)
    return drafts, missing, windows


def _event(flight: Flight, draft: Draft) -> Event:
    finding = draft.finding
    stages = tuple(dict.fromkeys((finding.stage, *(other.stage for other in draft.also))))
    evidence = dict(finding.evidence)
    for other in draft.also:
        for name, value in other.evidence.items():
            evidence.setdefault(name, value)
    state, note = _state(flight, draft)
    ci95 = None
    if finding.magnitude is not None and finding.sd is not None:
        ci95 = (finding.magnitude - TWO_SIDED_95 * finding.sd, finding.magnitude + TWO_SIDED_95 * finding.sd)
    explanation = {field.name: getattr(finding, field.name) for field in fields(Explanation)}
    return Event(
        **(explanation | {"evidence": evidence, "effect": dict(finding.effect)}),
        state=state,
        kind=SHAPES[finding.shape].kind if finding.shape in SHAPES else "abrupt",
        stages=stages,
        ci95=ci95,
        beyond_tolerance=beyond_its_tolerance(flight, draft),
        seen_until_s=draft.until_s,
        window_s=draft.window,
        note=note,
        repeat=repeat_advice(finding.among),
    )


def _state(flight: Flight, draft: Draft) -> tuple[State, str]:
    """Return whether an event is declared, or only suspected: something may imitate it, or its interval holds none."""
    finding = draft.finding
    if finding.doubt:
        return "suspected", finding.doubt
    if not is_certain(draft) and draft.lasting:
        return "suspected", f"it may be an after-effect of the fault of {' and '.join(draft.lasting)}"
    if not is_certain(draft):
        return "suspected", "a healthy flight of this length shows as much once on average"
    if finding.magnitude is not None and finding.sd is not None and abs(finding.magnitude) < TWO_SIDED_95 * finding.sd:
        return "suspected", "its size cannot be told from none"
    if finding.stage == "scan" and finding.p_value is None and finding.statistic <= UNLIKE * finding.threshold:
        return "suspected", "no shipped table fits this log, so that the rate of false alarms of steps is not known"
    if finding.stage == "scan" and overlaps(draft.window, flight.moved):
        return "suspected", "flaps or gear that move disturb the airspeed as a step would"
    others = [
        f"of {name} {quantity(size, unit_of(flight.log, name))}" for name, size in errors_of_rivals(finding).items()
    ]
    return "declared", vote_against(finding, flight.recorded) or (f"or an error {', '.join(others)}" if others else "")


def _strips(scanned: Sequence[Scanned], static: StaticWindows) -> tuple[Strip, ...]:
    """Return how near every analysis came to its threshold, once for a window in its middle."""
    strips = []
    for length_s in LENGTHS_S:
        scans = [scan for scan in scanned if round(scan.to_s - scan.from_s) == length_s]
        if scans:
            strips.append(
                Strip(
                    name=f"parity {length_s:g} s",
                    time_s=np.array([0.5 * (scan.from_s + scan.to_s) for scan in scans]),
                    share=np.array([scan.statistic / scan.threshold for scan in scans]),
                )
            )
    names = dict.fromkeys(relation.name for _, answer in static for relation in answer.relations)
    for name in names:
        pairs = [
            (0.5 * (window[0] + window[1]), _share(relation))
            for window, answer in static
            for relation in answer.relations
            if relation.name == name
        ]
        strips.append(Strip(name=name, time_s=np.array([t for t, _ in pairs]), share=np.array([s for _, s in pairs])))
    return tuple(strips)


def _share(relation: RelationAnswer) -> float:
    """Return how near a relation came to being declared: statistic and size are both asked for."""
    return min(relation.statistic / relation.threshold, relation.effect / relation.least_effect)
