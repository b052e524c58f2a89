"""What physics says of one window of a log: relations between channels, pressure lines, lift and inertia.

The evidence that `bfi identify` and `bfi start-time` weigh beside their own models, which slow faults hide from. It is
the diagnosis of a window, without the scan for steps and oscillations, which these commands do themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..config import Config, merge
from ..decision import MOSTLY, Candidate, Evidence, candidate_of, estimate_of
from ..errors import LogError
from ..faults import Fault, FaultEstimate
from ..faults.shapes import CONSTANTS, SHAPES
from ..flightlog import FlightLog, is_told_by_physics
from ..flightlog.phases import phases_of
from ..kernels import TWO_SIDED_95, FloatArray
from ..kernels.progress import Progress, unseen
from ..model.onset.claims import CLAIMED_CYCLES
from ..notes import Note
from ..quantities.channels import STANDARD
from ..quantities.text import instant, quantity
from ..threads import one_thread
from .diagnose import events_of, lasting_faults
from .events import growth
from .flight import Flight, flight_of
from .limits import BIN_S, Bounds, bounds_of, hidden_slopes
from .parity import RESIDUALS, available, configuration_changes
from .parity.explain import course_for
from .parity.relation_series import Series
from .parity.static_relations import find_oscillation
from .parity.windows import LENGTHS_S
from .relations import StaticWindows, drafts_at_start
from .result import Event
from .step_bounds import error_by_any_sensor, step_bounds

SOURCE = "physics"
# Beside the window: what tells the angle of zero lift (five minutes of clean flight), how far calm air moves a pressure
# line, and whether this flight is rougher than those of the tables (ten windows of two minutes).
BESIDE_S = 600.0
# SHARE: physics' share of a window's rate of false alarms; the other half is that of the window's own model.
SHARE = 0.5
# FASTEST_SHOWN_HZ: means of a second show no faster oscillation well: of this one 0.7.
FASTEST_SHOWN_HZ = 0.45
# What each residual reads, and what it is called.
_READS = {kind.name: kind.reads.union(*kind.needs) for kind in RESIDUALS}
WORDS = {"lift": "lift", "climb": "the climb angle", "kinematics": "inertia", "ground_speed": "the ground speed"}


def physics_evidence(log: FlightLog, config: Config, progress: Progress = unseen) -> Evidence:
    """Return the slow faults of the outputs that physics declares in a window, and how large others and steps could be.

    1. The flight about the window: its phases, defects, held lines, and angle of zero lift.
    2. Faults that sensors, lines, static relations, lift and inertia show, and the errors that they make on outputs.
    3. By output the largest slow error that may hide, and the largest step, whichever of its sensors makes it.

    Parameters
    ----------
    log : the whole log, of which `config.window` is the part analysed and `config.outputs` may be faulty.

    Returns
    -------
    Empty where the log has no channels that physics could compare, and with a note where it cannot.
    """
    if not is_told_by_physics(log, config.outputs):
        return Evidence(source=SOURCE)
    progress("physics", 0.0)
    evidence = _evidence(log, config)
    progress("physics", 1.0)
    return evidence


def _evidence(log: FlightLog, config: Config) -> Evidence:
    try:
        flight = _flight_about(log, config)
    except LogError as error:
        return _silent(str(error).removeprefix(f"{log.path}: ").partition(";")[0])
    too_short = not any(flight.windows(length_s) for length_s in LENGTHS_S)
    why = f"no {min(LENGTHS_S):g} s of the window are in flight between take-off and landing"
    # A line that loses its pressure ends what looks like flight: it is told without the windows of the others.
    if too_short and not (flight.held.findings or flight.resting):
        return _silent(why)
    with one_thread():
        drafts, static, slow = lasting_faults(flight, unseen)
        flight = slow.flight
        events = events_of(flight, [*drafts, *drafts_at_start(flight, static)])
        bounds = bounds_of(flight, slow.scanned, static, events)
        outputs = [name for name in config.outputs if name in flight.recorded and name in STANDARD]
        tolerances = {name: flight.tolerance(name, (flight.from_s, flight.to_s)) or np.inf for name in outputs}
        steps = step_bounds(flight, slow.scanned, static, events, outputs)
        since_start = _oscillations(flight.series, static, tolerances)
    faults: list[FaultEstimate] = []
    notes: list[Note] = []
    for event in events:
        estimates = [
            estimate for name in outputs if (estimate := _estimate(event, name, flight, tolerances[name])) is not None
        ]
        if event.state == "declared" and event.beyond_tolerance is not False and estimates:
            faults += estimates
        else:
            notes.append(_beside(event))
    candidates_of = {name: _candidate(flight, bounds, name, tolerances[name], faults, events) for name in outputs}
    if too_short:
        notes += _silent(why).notes
    unbounded = [name for name, candidate in candidates_of.items() if candidate is None]
    if unbounded and any(event.state == "declared" for event in events):
        named = ", ".join(unbounded)
        notes.append(Note.limit(f"physics bounds no slow fault of {named} beside the declared ones"))
    else:
        notes += dict.fromkeys(_what_would_help(flight, name, unbounded) for name in unbounded)
    candidates = [candidate for candidate in candidates_of.values() if candidate is not None]
    return Evidence(
        source=SOURCE,
        faults=tuple(faults),
        candidates=tuple(candidates),
        bounds=steps,
        since_start=since_start,
        notes=tuple(notes),
    )


def _oscillations(series: Series, static: StaticWindows, tolerances: Mapping[str, float]) -> Mapping[str, str]:
    """Return, by output that a relation shows to oscillate since the start, maybe beyond its tolerance, what shows it.

    A model of the window takes an oscillation that is older than its first onset for one of the aircraft.
    """
    shown = dict[str, str]()
    for (from_s, to_s), _ in static[:1]:
        frequencies_hz = np.arange(CLAIMED_CYCLES / (to_s - from_s), FASTEST_SHOWN_HZ, 0.5 / (to_s - from_s))
        for channel, tolerance in tolerances.items():
            best = find_oscillation(series, channel, (from_s, to_s), frequencies_hz, least=tolerance)
            if best is not None and best.size + TWO_SIDED_95 * best.sd > tolerance:
                size = quantity(best.size, STANDARD[channel].unit)
                shown[channel] = f"{best.words} oscillates by {size} at {best.frequency_hz:.2g} Hz since the start"
    return shown


def _silent(why: str) -> Evidence:
    return Evidence(source=SOURCE, notes=(Note.limit(f"physics bounds no slow fault: {why}"),))


def _flight_about(log: FlightLog, config: Config) -> Flight:
    """Return the flight about the window of a configuration, at the rate of false alarms that physics has in it.

    Raises
    ------
    LogError : it is not in flight.
    """
    first_s, stop_s = log.span_s
    from_s = first_s if config.window.from_s is None else config.window.from_s
    to_s = stop_s if config.window.to_s is None else config.window.to_s
    about = log.window(max(from_s - BESIDE_S, first_s), to_s + BESIDE_S)
    tolerances = {name: size for name, size in config.tolerances.items() if name in log.channels}
    rate = SHARE * config.start_time.false_alarm
    flight = flight_of(about, merge(config, {"tolerances": tolerances, "diagnose.false_alarm": rate}))
    # Flaps may move from the last descent on, which may end later.
    moved = configuration_changes(phases_of(log), flight.record)
    return replace(flight, moved=moved, counted=flight.part_phases)


def _estimate(event: Event, channel: str, flight: Flight, tolerance: float) -> FaultEstimate | None:
    """Return a declared event as a fault of an output, None where it does not err, or by an unknown amount."""
    if channel not in event.channels:
        return None
    effect = event.effect.get(channel)
    shown_s = event.window_s[1] - event.onset_s
    until_s = (flight.to_s if event.offset_s is None else min(event.offset_s, flight.to_s)) - event.onset_s
    if effect is not None:
        effect *= growth(event.shape, event.constant_s, shown_s=shown_s, until_s=until_s)
    constant_s = event.constant_s or event.evidence.get("time_constant_s")
    is_line_fault = event.fault in SHAPES and (event.shape == "drift" or not SHAPES[event.fault].has_magnitude)
    shape = event.fault if is_line_fault else event.shape
    if shape not in SHAPES or any(key.required and key.name not in CONSTANTS for key in SHAPES[shape].keys):
        return None
    fault = Fault(
        shape=shape,
        channel=channel,
        onset_s=event.onset_s,
        offset_s=event.offset_s,
        time_constant_s=constant_s if "time_constant_s" in _keys(shape) else None,
        duration_s=event.constant_s if "duration_s" in _keys(shape) else None,
    )
    relative = np.nan if not event.magnitude or event.sd is None else event.sd / abs(event.magnitude)
    if not SHAPES[shape].has_magnitude:
        magnitude, relative = 1.0, np.nan
    elif event.magnitude is not None and (is_line_fault or event.fault == channel):
        magnitude = event.magnitude
    elif effect and (course := course_for(event.shape, event.constant_s)) is not None:
        magnitude = effect / float(course(np.array([max(until_s, shown_s)]))[0])
    else:
        return None
    estimate = estimate_of(
        replace(fault, magnitude=magnitude),
        magnitude,
        abs(magnitude) * relative,
        STANDARD[channel].unit,
        effect=None if effect is None else abs(effect),
        tolerance=tolerance,
        name=event.fault if is_line_fault else f"{event.shape} of {channel}",
        onset_ci95=event.onset_ci95,
        statistic=event.statistic,
        p_value=event.p_value,
        among=event.among,
        source=SOURCE,
    )
    is_own = is_line_fault or event.fault == channel
    return replace(estimate, unit=event.unit if is_own else estimate.physical_unit)


def _keys(shape: str) -> set[str]:
    return {key.name for key in SHAPES[shape].keys}


def _beside(event: Event) -> Note:
    """Return the sentence on an event that is no declared fault of an output."""
    size = "" if event.magnitude is None else f" of {quantity(event.magnitude, event.unit)}"
    what = f"{event.fault}, {event.shape}{size} from {instant(event.onset_s)} s"
    if event.state != "declared":
        return Note.limit(f"physics suspects {what}: {event.note}")
    small = ", within the tolerances" if event.beyond_tolerance is False else ""
    return Note.limit(f"physics finds {what}{small}; wrong channels: {', '.join(event.channels)}")


def _candidate(
    flight: Flight,
    bounds: Sequence[Bounds],
    channel: str,
    tolerance: float,
    faults: Sequence[FaultEstimate],
    events: Sequence[Event],
) -> Candidate | None:
    """Return what became of slow faults of an output, None where nothing bounds them."""
    declared = next(
        (
            estimate
            for estimate in faults
            if estimate.fault.channel == channel and SHAPES[estimate.fault.shape].kind == "slow"
        ),
        None,
    )
    suspected = [
        event for event in events if event.state == "suspected" and channel in event.channels and event.kind == "slow"
    ]
    starts = np.arange(flight.from_s, flight.to_s - BIN_S + 1e-6, BIN_S)
    errors, declared_errors = _hidden_errors(flight, bounds, channel, starts)
    known = np.flatnonzero(np.isfinite(errors))
    slope = effect = seen_above = None
    note = f"{suspected[0].fault}: {suspected[0].note}" if suspected else None
    if declared is not None:
        effect = declared.effect
    elif known.size:
        worst = known[0] + int(np.argmax(errors[known[0] : known[-1] + 1]))
        if np.isfinite(errors[worst]):
            effect = float(errors[worst])
            slope = effect / (flight.to_s - float(starts[worst]))
            seen = np.quantile(declared_errors[known[0] : known[-1] + 1], MOSTLY, method="higher")
            seen_above = max(float(seen), effect)
        last_s = float(starts[known[-1]]) + BIN_S
        note = note or f"for onsets from {instant(starts[known[0]])} to {instant(last_s)} s"
    elif not suspected:
        return None
    drift = declared if declared is not None and declared.fault.shape == "drift" else None
    return candidate_of(
        Fault(shape="drift", channel=channel),
        STANDARD[channel].unit,
        name=f"slow fault of {channel} (physics)",
        declared=declared is not None,
        suspected=bool(suspected),
        magnitude=None if drift is None else drift.magnitude,
        sd=None if drift is None else drift.sd,
        excluded_above=slope,
        effect=effect,
        seen_above=seen_above,
        tolerance=tolerance,
        note=note,
    )


def _hidden_errors(
    flight: Flight, bounds: Sequence[Bounds], channel: str, starts: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (n_starts,) the largest error of an output at the window's end that may begin there unseen.

    The second is that from which on a fault that begins there would be declared.

    Parameters
    ----------
    starts : (n_starts,) of the stretches.
    """
    part = flight.record.between(flight.from_s, flight.to_s)
    slopes = {
        (windows[0].fault, windows[0].bounds): np.array(hidden_slopes(windows, starts))
        for windows in bounds
        if windows[0].shape == "drift"
    }
    nothing = np.full((2, len(starts)), np.inf)

    def errors(k: int) -> FloatArray:
        return error_by_any_sensor(
            part,
            channel,
            lambda fault, what: np.asarray(slopes.get((fault, what), nothing)[k]),
            flight.to_s - starts,
            is_sudden=False,
        )

    return errors(0), errors(1)


def _what_would_help(flight: Flight, channel: str, unbounded: Sequence[str]) -> Note:
    """Return which channels would bound slow faults of an output, those of the relation that lacks the fewest."""
    _, lacking = available(flight.record.channels)
    useful = {name: lacks for name, lacks in lacking.items() if channel in _READS[name]}
    if not useful:
        return Note.limit(f"physics bounds no slow fault of {channel} in this window")
    name = min(useful, key=lambda name: useful[name].count(","))
    alike = ", ".join(output for output in unbounded if output in _READS[name])
    lacking_here = useful[name].replace(", ", " and ")
    return Note.advice(f"record {lacking_here}: {WORDS[name]} would bound slow faults of {alike}")
