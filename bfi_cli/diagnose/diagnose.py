"""The diagnosis of a flight: phases, windows, every analysis that the log allows, and one answer."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..airdata import IMPACT_SOURCES
from ..channels import STANDARD
from ..config import Config, merge
from ..errors import ConfigError, LogError
from ..faults import Decision
from ..flightlog import FlightLog
from ..flightlog.phases import Phase, phases_of
from ..flightlog.record import frozen_array
from ..flightlog.recorder import with_seen_recorder
from ..kernels.progress import Progress, Report, unseen
from ..parity import (
    LENGTHS_S,
    Finding,
    Limit,
    ParityTable,
    Record,
    Threshold,
    WindowScan,
    configuration_changes,
    explain,
    record_of,
    scan_window,
    shipped_tables,
    windows_in,
    zero_lift_of,
)
from ..parity.calibration import load_air_data
from ..parity.holds import Holds, find_holds
from ..parity.record import USED
from ..parity.static_relations import RelationAnswer, RelationSeries, StaticRelations, find_static, relation_series
from ..parity.windows import clean_up_time, judged
from ..preprocessing.summary import log_summary
from ..preprocessing.tolerance import tolerance_of
from ..shapes import SHAPES, Kind
from ..verdicts import KINDS, State, decide
from .conventions import without_other_conventions
from .corrected import corrected_channels, course_of
from .events import Draft, clusters, join, merge_stages, with_ends
from .glances import GLANCE_S, INPUTS, STEP_S, glance_at_flight, inputs_for, summary_of
from .looks import SCALE_S, WITHOUT_LIFT, Scanned, look_at, scale_of, scan_flight
from .missing import missing_sentences
from .naming import contradicted, finding_of_fit, finding_of_glance, repeat_advice
from .result import Course, DiagnoseResult, Event, FlightLimit, Look, Strip

__all__ = ["diagnose_flight"]

FloatArray = NDArray[np.float64]
Window = tuple[float, float]

# A fault that the scan sees near a window's start may have begun before it: the window is moved.
NEAR_START_S = 20.0
# Where in the window that describes an event its onset lies.
ONSET_SHARE = 0.4
MOVES = 3
# Beside a held line, where the filters of the recorder and the leak itself still act; shown beside it; after it, when
# a jump back is its end and no fault of its own.
BRIDGE_S, AROUND_HOLD_S, AFTER_HOLD_S = 10.0, 60.0, 20.0
# A single window this near its threshold is no event yet: longer windows, or the next, would show a fault that grows.
NEAR = 1.2
STEPS: Mapping[Kind, str] = {"abrupt": "a step", "oscillating": "an oscillation"}
AIRSPEEDS = ("tas", "cas", "ias", "mach")
# Limits are compared over stretches of this length.
BIN_S = 30.0
QUANTILE_95 = 1.959963984540054


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """What every step of a diagnosis needs: the log, its seconds, its phases, and how its windows are judged."""

    log: FlightLog
    record: Record
    phases: tuple[Phase, ...]
    whole: Sequence[Phase] | None  # of the whole flight, where a part of it is asked for
    from_s: float
    to_s: float
    zero_lift: float | None
    zero_lift_from: str
    tables: Sequence[ParityTable]
    false_alarm: float
    moved: Sequence[Window]
    held: Holds
    tolerances: Mapping[str, float]

    @property
    def recorded(self) -> Collection[str]:
        return self.log.channels.keys()

    @property
    def without_lift(self) -> Sequence[Window]:
        """Stretches in which flaps may move and none are recorded."""
        return () if "flaps" in self.recorded else self.moved


def diagnose_flight(log: FlightLog, config: Config, *, workers: int = 1, progress: Progress = unseen) -> DiagnoseResult:
    """Say which air-data fault hit a flight, when, how large and how sure, with everything that the log allows.

    1. Phases of the flight; take-off, approach, landing and parabolas are left out.
    2. Static relations and holds of the pressure lines, over the whole flight.
    3. The parity scan, on windows of 60, 120 and 240 s.
    4. The scan for steps and oscillations, on windows of 120 s.
    5. What windows and analyses found, joined into events; each is described in the window that suits it.
    6. What could not have been seen.

    Parameters
    ----------
    config : `diagnose` holds what is special to it; `window` is the part of the flight.
    workers : processes for step 4; the numbers are the same for any.
    progress : called with the name of the step and the fraction of it that is done.

    Raises
    ------
    LogError : the log has no part in flight, or no airspeed.
    ConfigError : the calibration cannot be used.
    """
    progress("phases of the flight", 0.0)
    frozen, log = _without_frozen(log)
    flight, unlike = _prepared(log, config)
    log, notes = flight.log, [*log.notes]
    with threadpool_limits(1):
        series = relation_series(log)
        drafts = _holds(flight)
        notes += flight.held.missing
        static = _static(flight, series, partial(progress, "static relations"))
        drafts += _of_static(static)
        windows = _windows(flight)
        scanned = scan_flight(
            flight.record,
            windows,
            zero_lift=flight.zero_lift,
            without_lift=flight.without_lift,
            report=partial(progress, "lift and inertia"),
        )
        scale = scale_of(_scanned_throughout(flight, scanned), flight.tables)
        judgements = list(look_at(scanned, flight.tables, false_alarm=flight.false_alarm, scale=scale))
        drafts += _of_parity(flight, judgements, drafts, static)
    if "flaps" not in flight.recorded and flight.moved:
        notes.append(
            "no flaps: after take-off and from the last descent on, where flaps and gear may move, the lift is not used"
        )
    if scale >= 1.005:
        notes.append(
            f"this flight shows {scale:.3g} times what the flights of the tables do: thresholds are raised by that"
        )
    glanced, glances_missing = _glances(flight, config, static, workers, partial(progress, "steps and oscillations"))
    drafts += glanced
    events = tuple(_event(flight, draft) for draft in merge_stages(drafts))
    limits = _limits(flight, judgements, static, events)
    verdicts = _verdicts(events, limits)
    missing = (
        *frozen,
        *unlike,
        *missing_sentences(flight.record, scanned, limits, n_windows=sum(map(len, windows.values()))),
        *glances_missing,
        *dict.fromkeys(sentence for one in static for sentence in one[1].missing if "s of flight" not in sentence),
    )
    corrected = corrected_channels(flight.record, events)
    inside = log.window(flight.from_s, flight.to_s)
    courses = _courses(flight, events)
    return DiagnoseResult(
        log=log_summary(log.path, inside.time_s, rate_hz=log.rate_hz, native_rate_hz=log.rate_hz),
        decision=_decision(verdicts, events, config.require),
        verdicts=verdicts,
        summary=_summary(verdicts, limits, looked_for_steps=not glances_missing),
        events=events,
        limits=limits,
        phases=flight.phases,
        windows=tuple(look for _, _, look in judgements),
        missing=missing,
        false_alarm=flight.false_alarm,
        zero_lift_rad=flight.zero_lift,
        zero_lift_from=flight.zero_lift_from,
        time_s=flight.record.time_s,
        measured={name: flight.record.channels[name] for name in _shown(flight.record)},
        corrected=corrected,
        units={name: STANDARD[name].unit for name in _shown(flight.record)},
        strips=_strips(flight, judgements, static, glanced),
        courses=courses,
        notes=tuple(notes),
    )


def _without_frozen(log: FlightLog) -> tuple[list[str], FlightLog]:
    """Return the log without the channels that hold one value although they are looked at, and a sentence on each."""
    frozen = [name for name in (*USED, *INPUTS) if name in log.channels and _never_moves(log.channels[name].values)]
    frozen = list(dict.fromkeys(frozen))
    said = []
    for name in frozen:
        held = "holds one value" if np.isfinite(log.channels[name].values).any() else "holds no number"
        said.append(f"'{name}' {held} through the whole log: it was not used")
    return said, replace(log, channels={name: one for name, one in log.channels.items() if name not in frozen})


def _never_moves(values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    return known.size == 0 or float(known.min()) == float(known.max())


def _prepared(log: FlightLog, config: Config) -> tuple[Flight, tuple[str, ...]]:
    """Return what every step needs, and what is not used of the log."""
    log = with_seen_recorder(log)
    start_s, stop_s = float(log.time_s[0]), float(log.time_s[-1]) + 1.0 / log.rate_hz
    from_s = start_s if config.window.from_s is None else config.window.from_s
    to_s = stop_s if config.window.to_s is None else config.window.to_s
    log.window(from_s, to_s)  # refuses one without samples
    if not {"tas", *IMPACT_SOURCES} & log.channels.keys():
        has = ", ".join(sorted(log.channels))
        raise LogError(
            f"{log.path}: no airspeed and no impact pressure that changes; the log has: {has}; map one with --channel"
        )
    for name in config.tolerances:
        if name not in log.channels:
            has = ", ".join(sorted(log.channels))
            raise ConfigError(f"--tolerance: '{name}' is no channel, the log has: {has}; leave it out")
    held = find_holds(log, start_s, stop_s)
    phases = phases_of(_bridged(log, held.findings))
    if not judged(phases):
        raise LogError(
            f"{log.path}: no part of the log is in flight between take-off and approach; give a log of a flight, or "
            "map its airspeed with --channel"
        )
    log, unlike = without_other_conventions(log, phases)
    record = record_of(log)
    trapped = [
        (one.onset_ci95[0] - BRIDGE_S, stop_s if one.offset_s is None else one.offset_s + BRIDGE_S)
        for one in held.findings
    ]
    outside: list[Window] = [] if (from_s, to_s) == (start_s, stop_s) else [(from_s, to_s)]
    tables: Sequence[ParityTable] = shipped_tables()
    zero_lift, origin = None, "free in every window"
    if config.diagnose.calibration is not None:
        own = load_air_data(config.diagnose.calibration)
        tables = (*own.tables, *tables)
        zero_lift, origin = own.zero_lift_rad, config.diagnose.calibration
    if zero_lift is None:
        zero_lift = zero_lift_of(record, phases, without=[*outside, *trapped])
        origin = "the flight outside the window" if outside else "the whole flight"
        if zero_lift is None and outside:
            zero_lift, origin = zero_lift_of(record, phases, without=trapped), "the whole flight"
    if zero_lift is None:
        origin = "free in every window"
    flight = Flight(
        log=log,
        record=record,
        phases=tuple(one for one in phases if one.to_s > from_s and one.from_s < to_s),
        whole=phases if outside else None,
        from_s=from_s,
        to_s=to_s,
        zero_lift=zero_lift,
        zero_lift_from=origin,
        tables=tables,
        false_alarm=config.diagnose.false_alarm,
        moved=configuration_changes(phases, clean_up_s=clean_up_time(phases, record)),
        held=held,
        tolerances=config.tolerances,
    )
    return flight, unlike


def _windows(
    flight: Flight, lengths: Sequence[float] = LENGTHS_S, step_s: float | None = None
) -> dict[float, list[Window]]:
    """Return the windows of every length within what is asked for."""
    cut = tuple(
        replace(one, from_s=max(one.from_s, flight.from_s), to_s=min(one.to_s, flight.to_s)) for one in flight.phases
    )
    return {length_s: windows_in(cut, length_s, step_s=step_s) for length_s in lengths}


def _scanned_throughout(flight: Flight, scanned: Sequence[Scanned]) -> Sequence[Scanned]:
    """Return windows of the whole flight scanned, whatever part of it is asked for."""
    if flight.whole is None:
        return scanned
    windows = {SCALE_S: windows_in(flight.whole, SCALE_S, step_s=SCALE_S)}
    return scan_flight(flight.record, windows, zero_lift=flight.zero_lift, without_lift=flight.without_lift)


def _bridged(log: FlightLog, held: Sequence[Finding]) -> FlightLog:
    """Return the log with straight lines where a pressure line is held, which can make a flight look like a landing."""
    channels = dict(log.channels)
    for one in held:
        until_s = float(log.time_s[-1]) if one.offset_s is None else one.offset_s
        hidden = (log.time_s >= one.onset_ci95[0] - BRIDGE_S) & (log.time_s <= until_s + BRIDGE_S)
        for name in {*one.channels} & channels.keys():
            values = channels[name].values
            known = ~hidden & np.isfinite(values)
            if known.any():
                filled = np.where(hidden, np.interp(log.time_s, log.time_s[known], values[known]), values)
                channels[name] = replace(channels[name], values=frozen_array(filled))
    return replace(log, channels=channels)


def _holds(flight: Flight) -> list[Draft]:
    found = []
    for one in flight.held.findings:
        until_s = flight.to_s if one.offset_s is None else one.offset_s
        if one.onset_s < flight.to_s and until_s > flight.from_s:
            window = (max(one.onset_s - AROUND_HOLD_S, flight.from_s), min(until_s + AROUND_HOLD_S, flight.to_s))
            found.append(Draft(finding=one, window=window, until_s=until_s + AFTER_HOLD_S))
    return found


def _static(
    flight: Flight, series: tuple[tuple[RelationSeries, ...], tuple[str, ...]], report: Report
) -> list[tuple[Window, StaticRelations]]:
    windows = _windows(flight, (120.0,))[120.0] or _windows(flight, (60.0,))[60.0]
    answers = []
    for k, window in enumerate(windows):
        report(k / len(windows))
        answers.append((window, find_static(flight.log, *window, series=series)))
    return answers


def _of_static(answers: Sequence[tuple[Window, StaticRelations]]) -> list[Draft]:
    drafts = [
        Draft(finding=finding, window=window, until_s=window[1])
        for window, answer in answers
        for finding in answer.findings
    ]
    return join(drafts)


def _intact(static: Sequence[tuple[Window, StaticRelations]], window: Window) -> dict[str, bool]:
    """Return by channel whether every static relation that it stands in is intact over a window."""
    found: dict[str, bool] = {}
    for (first, last), answer in static:
        if last <= window[0] or first >= window[1]:
            continue
        for relation in answer.relations:
            whole = relation.statistic < relation.threshold or relation.effect < relation.least_effect
            for name in relation.channels:
                found[name] = found.get(name, True) and whole
    return found


def _of_parity(
    flight: Flight,
    judgements: Sequence[tuple[Scanned, Threshold, Look]],
    before: Sequence[Draft],
    static: Sequence[tuple[Window, StaticRelations]],
) -> list[Draft]:
    """Return one draft for every run of windows that stand out, described in the window that suits it."""
    held = [draft for draft in before if draft.finding.stage == "holds"]
    flagged = [
        (one, threshold)
        for one, threshold, _ in judgements
        if one.statistic > threshold.level
        and not any(one.to_s > draft.from_s and one.from_s < draft.until_s for draft in held)
    ]
    drafts = []
    for cluster in clusters([(one.from_s, one.to_s) for one, _ in flagged]):
        members = [flagged[k] for k in cluster]
        until_s = max(one.to_s for one, _ in members)
        draft = _described(flight, members, until_s, static)
        if draft is not None:
            drafts.append(draft)
    return drafts


def _scan(flight: Flight, window: Window) -> WindowScan | None:
    """Return the scan of a window, without the lift where flaps may move."""
    moving = any(window[0] < last and first < window[1] for first, last in flight.without_lift)
    only = WITHOUT_LIFT if moving else None
    return scan_window(flight.record.between(*window), zero_lift=flight.zero_lift, only=only)


def _described(
    flight: Flight,
    members: Sequence[tuple[Scanned, Threshold]],
    until_s: float,
    static: Sequence[tuple[Window, StaticRelations]],
) -> Draft | None:
    """Return what the windows of a run say, in the window in which their fault begins well inside.

    It is the one with the most evidence: a long window may be nearer its threshold and tell more.
    """
    first_s = min(one.from_s for one, _ in members)
    early = [pair for pair in members if pair[0].from_s <= first_s + max(LENGTHS_S)]
    one, threshold = max(early, key=lambda pair: pair[0].statistic)
    window, level, onset_s = (one.from_s, one.to_s), threshold, one.onset_s
    stretch = next((s for s in judged(flight.phases) if s[0] <= onset_s < s[1]), window)
    low, high = max(stretch[0], flight.from_s), min(stretch[1], flight.to_s)
    scan = _scan(flight, window)
    for _ in range(MOVES):
        length_s = window[1] - window[0]
        if onset_s - window[0] >= NEAR_START_S and window[1] - onset_s >= NEAR_START_S:
            break
        start_s = min(max(low, onset_s - ONSET_SHARE * length_s), high - length_s)
        moved = (start_s, start_s + length_s)
        other = _scan(flight, moved)
        if other is None or other.statistic <= level.level or abs(moved[0] - window[0]) < 1.0:
            break
        scan, window = other, moved
        best = max(scan.ratios.values(), key=lambda ratio: float(ratio.ratio.max()))
        onset_s = float(scan.onsets_s[int(np.argmax(best.ratio))])
    if scan is None:
        return None
    record = flight.record.between(*window)
    fits = explain(scan, record, ruled_out=contradicted(_intact(static, window)))
    finding = finding_of_fit(fits, record, level, flight.recorded, scan)
    return Draft(finding=finding, window=window, until_s=max(until_s, window[1]), n_windows=len(members))


def _glances(
    flight: Flight,
    config: Config,
    static: Sequence[tuple[Window, StaticRelations]],
    workers: int,
    report: Report,
) -> tuple[list[Draft], list[str]]:
    """Return what the scan for steps and oscillations found, and why it did not look."""
    inputs = inputs_for(flight.log)
    output = next((name for name in ("tas", "cas", "ias") if name in flight.recorded), None)
    if "elevator" not in inputs or output is None:
        lacking = "elevator" if output is not None else "airspeed"
        return [], [f"no {lacking}: steps and oscillations of the airspeed were not looked for"]
    windows = _windows(flight, (GLANCE_S,), STEP_S)[GLANCE_S]
    if not windows:
        return [], [f"no {GLANCE_S:g} s of flight: steps and oscillations of the airspeed were not looked for"]
    used = merge(config, {"inputs": inputs, "outputs": (output,)})
    found = glance_at_flight(flight.log, windows, used, workers=workers, report=report)
    drafts = []
    for window, answer in found:
        if isinstance(answer, str) or not answer.stands_out or answer.shape == "drift":
            continue
        relations = _intact(static, window)
        whole = output in relations and relations[output]
        finding = finding_of_glance(
            answer, flight.recorded, relations=whole, to_s=window[1], unit=STANDARD[output].unit
        )
        drafts.append(Draft(finding=finding, window=window, until_s=window[1]))
    failed = summary_of(found)
    missing = [f"{n} of {len(found)} windows were not scanned for steps: {why}" for why, n in failed.items()]
    return with_ends(join(drafts)), missing


def _event(flight: Flight, draft: Draft) -> Event:
    one = draft.finding
    stages = tuple(dict.fromkeys((one.stage, *(other.stage for other in draft.also))))
    evidence = dict(one.evidence)
    for other in draft.also:
        for name, value in other.evidence.items():
            evidence.setdefault(name, value)
    state, note = _state(flight, draft)
    ci95 = None
    if one.magnitude is not None and one.sd is not None:
        ci95 = (one.magnitude - QUANTILE_95 * one.sd, one.magnitude + QUANTILE_95 * one.sd)
    return Event(
        fault=one.fault,
        among=one.among,
        channels=one.channels,
        state=state,
        kind=SHAPES[one.shape].kind,
        stages=stages,
        shape=one.shape,
        constant_s=one.constant_s,
        frequency_hz=one.frequency_hz,
        magnitude=one.magnitude,
        unit=one.unit,
        sd=one.sd,
        ci95=ci95,
        effect=dict(one.effect),
        onset_s=one.onset_s,
        onset_ci95=one.onset_ci95,
        offset_s=one.offset_s,
        seen_until_s=draft.until_s,
        window_s=draft.window,
        statistic=one.statistic,
        threshold=one.threshold,
        p_value=one.p_value,
        evidence=evidence,
        note=note,
        repeat=repeat_advice(one.among),
    )


def _state(flight: Flight, draft: Draft) -> tuple[State, str]:
    """Return whether an event is declared, or only suspected since something else may imitate it."""
    one = draft.finding
    moving = any(draft.window[0] < last and first < draft.window[1] for first, last in flight.moved)
    if one.stage == "parity" and draft.n_windows < 2 and one.statistic < NEAR * one.threshold:
        return "suspected", "a single window shows it, just above its threshold"
    if one.stage == "scan" and one.p_value is None:
        return "suspected", "no shipped table fits this log, so that the rate of false alarms of steps is not known"
    if one.stage == "scan" and moving:
        return "suspected", "flaps or gear that move disturb the airspeed as a step would"
    return "declared", ""


def _limits(
    flight: Flight,
    judgements: Sequence[tuple[Scanned, Threshold, Look]],
    static: Sequence[tuple[Window, StaticRelations]],
    events: Sequence[Event],
) -> tuple[FlightLimit, ...]:
    """Return per fault and shape what the worst stretch of the flight excludes; of its windows the best counts.

    Stretches in which flaps and gear are moved are left out, since nothing is declared there, and windows with a
    declared fault, which exclude no other of its size.
    """
    left_out = [
        (one.onset_s, one.seen_until_s if one.offset_s is None else one.offset_s)
        for one in events
        if one.state == "declared"
    ]
    bins = np.arange(flight.from_s, flight.to_s, BIN_S) + 0.5 * BIN_S
    best: dict[tuple[str, str], list[FlightLimit | None]] = {}

    def offer(limit: FlightLimit) -> None:
        kept = best.setdefault((limit.fault, limit.shape), [None] * len(bins))
        for k in np.flatnonzero((bins >= limit.from_s) & (bins < limit.to_s)).tolist():
            other = kept[k]
            if other is None or limit.effect < other.effect:
                kept[k] = limit

    for one, threshold, _ in judgements:
        told = not any(one.from_s < last and first < one.to_s for first, last in (*flight.moved, *left_out))
        for fault in one.magnitude if told else ():
            slope, reached = one.largest_hidden(fault, threshold.level)
            offer(_flight_limit(flight, fault, slope, reached, (one.from_s, one.to_s)))
            if fault in AIRSPEEDS and fault == flight.record.airspeed and "q_impact" not in one.magnitude:
                # Where one airspeed stands for the line, what bounds the channel bounds a loss of impact pressure.
                window = (one.from_s, one.to_s)
                limit = _flight_limit(flight, fault, slope, reached, window)
                relative = 2.0 * slope / _speed(flight, window, fault)
                offer(replace(limit, fault="pitot_icing", excluded_above=relative, unit="1/s"))
    for window, answer in static:
        told = not any(window[0] < last and first < window[1] for first, last in left_out)
        for of_relation in answer.limits if told else ():
            offer(_of_limit(flight, of_relation, window))
    worst = (max((one for one in kept if one is not None), key=lambda one: one.effect) for kept in best.values())
    return tuple(sorted(worst, key=lambda one: (one.shape, one.fault)))


def _flight_limit(flight: Flight, fault: str, slope: float, reached: float, window: Window) -> FlightLimit:
    name, channel, unit, effect = fault, fault, STANDARD["tas"].unit, reached
    if fault == "q_impact":
        name, channel, unit, effect = "pitot_icing", "tas", "1", 0.5 * reached * _speed(flight, window)
    elif fault == "ground_speed":
        channel = "ground_speed"
    else:
        unit = STANDARD[fault].unit
    tolerance = _tolerance(flight, channel, window)
    per_second = {"1": "1/s", "m/s": "m/s^2", "rad": "rad/s", "m/s^2": "m/s^3", "Pa": "Pa/s"}[unit]
    return FlightLimit(
        fault=name,
        shape="drift",
        channel=channel,
        excluded_above=slope,
        unit=per_second,
        effect=effect,
        effect_unit=STANDARD[channel].unit,
        tolerance=tolerance,
        within_tolerance=tolerance is not None and effect <= tolerance,
        from_s=window[0],
        to_s=window[1],
    )


def _speed(flight: Flight, window: Window, channel: str = "tas") -> float:
    return float(np.nanmean(flight.record.between(*window).channels[channel]))


def _of_limit(flight: Flight, one: Limit, window: Window) -> FlightLimit:
    tolerance = _tolerance(flight, one.channel, window)
    return FlightLimit(
        fault=one.fault,
        shape=one.shape,
        channel=one.channel,
        excluded_above=one.excluded_above,
        unit=one.unit,
        effect=one.effect,
        effect_unit=_unit(flight, one.channel),
        tolerance=tolerance,
        within_tolerance=tolerance is not None and one.effect <= tolerance,
        from_s=window[0],
        to_s=window[1],
    )


def _unit(flight: Flight, channel: str) -> str:
    return STANDARD[channel].unit if channel in STANDARD else flight.log.channels[channel].unit


def _tolerance(flight: Flight, channel: str, window: Window) -> float | None:
    if channel in flight.tolerances:
        return flight.tolerances[channel]
    part = flight.log.window(*window)
    if channel not in part.channels:
        return None
    return tolerance_of(flight.log, part, channel)


def _verdicts(events: Sequence[Event], limits: Sequence[FlightLimit]) -> dict[Kind, Decision]:
    """Return the verdict on every kind: a slow fault is excluded where its limits on all airspeeds are tolerable.

    Relations between airspeeds say nothing of the line that all are made of, so that its own limit is needed.
    How small a step or an oscillation could hide is told by `start-time` on a window: here they are only found.
    """
    verdicts: dict[Kind, Decision] = dict.fromkeys(KINDS, "inconclusive")
    suspected = {one.kind for one in events if one.state == "suspected"}
    slow = [one for one in limits if one.shape == "drift" and one.channel in AIRSPEEDS]
    if _bounds_line(slow) and all(one.within_tolerance for one in slow) and "slow" not in suspected:
        verdicts["slow"] = "no_fault"
    for one in events:
        if one.state == "declared":
            verdicts[one.kind] = "fault"
    return verdicts


def _bounds_line(limits: Sequence[FlightLimit]) -> bool:
    return any(one.fault == "pitot_icing" for one in limits)


def _decision(verdicts: Mapping[Kind, Decision], events: Sequence[Event], required: Sequence[Kind]) -> Decision:
    if any(one.state == "suspected" for one in events) and "fault" not in verdicts.values():
        return "inconclusive"
    return decide(verdicts, required)


def _summary(verdicts: Mapping[Kind, Decision], limits: Sequence[FlightLimit], *, looked_for_steps: bool) -> str:
    slow = [one for one in limits if one.shape == "drift" and one.channel in ("tas", "cas", "ias")]
    said = []
    if verdicts["slow"] != "fault" and _bounds_line(slow):
        worst = max(slow, key=lambda one: one.effect)
        verb = "no slow fault above" if verdicts["slow"] == "no_fault" else "a slow fault could reach"
        end = "" if verdicts["slow"] == "no_fault" else " unseen"
        said.append(f"{verb} {worst.effect:.2g} m/s on {worst.channel}{end}")
    elif verdicts["slow"] != "fault":
        said.append("a slow fault of any size could be there unseen")
    unseen_kinds = [noun for kind, noun in STEPS.items() if verdicts[kind] == "inconclusive"]
    if unseen_kinds and looked_for_steps:
        said.append(f"{' or '.join(unseen_kinds)} was looked for and not found; bfi start-time says how small")
    elif unseen_kinds:
        said.append(f"{' or '.join(unseen_kinds)} was not looked for")
    return "; ".join(said)


def _shown(record: Record) -> list[str]:
    return [name for name in ("tas", "cas", "ias", "mach", "altitude", "aoa", "pitch") if name in record.channels]


def _strips(
    flight: Flight,
    judgements: Sequence[tuple[Scanned, Threshold, Look]],
    static: Sequence[tuple[Window, StaticRelations]],
    glanced: Sequence[Draft],
) -> tuple[Strip, ...]:
    """Return how near every analysis came to its threshold, once for a window in its middle."""
    found = []
    for length_s in LENGTHS_S:
        of_length = [look for one, _, look in judgements if round(one.length_s) == length_s]
        if of_length:
            found.append(
                Strip(
                    name=f"parity {length_s:g} s",
                    time_s=np.array([0.5 * (look.from_s + look.to_s) for look in of_length]),
                    share=np.array([look.statistic / look.threshold for look in of_length]),
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
        found.append(Strip(name=name, time_s=np.array([t for t, _ in pairs]), share=np.array([s for _, s in pairs])))
    return tuple(found)


def _share(relation: RelationAnswer) -> float:
    """Return how near a relation came to being declared: statistic and size are both asked for."""
    return min(relation.statistic / relation.threshold, relation.effect / relation.least_effect)


def _courses(flight: Flight, events: Sequence[Event]) -> tuple[Course, ...]:
    return tuple(
        course
        for k, event in enumerate(events)
        if (course := course_of(flight.record, event, k, zero_lift=flight.zero_lift)) is not None
    )
