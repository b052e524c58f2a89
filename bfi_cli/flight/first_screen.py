"""The first screen of a diagnosis: what is wrong with the flight, and what could not have been seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..faults.shapes import SHAPES
from ..kernels.runs import within
from ..quantities.channels import STANDARD, channel_in_words
from ..quantities.text import SI, Units, change, duration, instant, interval, number
from ..report.first_screen import (
    Headline,
    Label,
    Screen,
    State,
    beside_tolerance,
    contradiction,
    error_in_words,
    intervals,
    lines_of,
    note_lines,
    proof_in_words,
)
from .limits import AIRSPEEDS
from .result import DiagnoseResult, Event, FlightLimit, OrdinaryEvent
from .tables import ORDINARY as CAUSES

# What a channel does that has short defects of a shape.
SHORT = {"dropout": "drops out", "frozen": "stays still", "spikes": "jumps out"}
# SMALLEST [tolerances]: error down to which a limit is told, as wherever sizes are tried: no sensor errs by less.
SMALLEST = 0.001
MOST_ORDINARY = 3  # causes of a first screen: the report has all
PITOT = ("pitot_blocked", "pitot_leak", "pitot_icing", "pitot_water")
STATIC = ("static_blocked", "static_leak")
# By fault what a mechanic looks at first.
LOOK_AT = {
    **dict.fromkeys(PITOT, "pitot tube, drain, heater, line"),
    **dict.fromkeys(STATIC, "static ports, static line, drain"),
    **dict.fromkeys(("aoa", "sideslip"), "vane, its bearing and its wiring"),
    **dict.fromkeys(("sat", "tat"), "temperature probe and its heater"),
    **dict.fromkeys(("pitch", "roll", "yaw"), "attitude sensor and its mounting"),
}


def diagnose_screen(result: DiagnoseResult, units: Units = SI) -> Screen:
    """Return the first screen of a diagnosis, in `units`."""
    contradicted = contradiction(result.plausibility, result.notes, units)
    if contradicted is not None:
        return contradicted
    declared = [event for event in result.events if event.state == "declared"]
    # The surest suspicion first: what a healthy flight shows as well may begin before it.
    suspected = [event for event in result.events if event.state == "suspected"]
    suspected.sort(key=lambda event: -(event.margin or 0.0))
    small = [*result.deviations]
    listed = [
        *(event_in_words(event, units) for event in declared),
        *(f"suspected: {event_in_words(event, units)}" for event in suspected),
        *(f"within its tolerance: {event_in_words(event, units)}" for event in small),
    ]
    first = next(iter([*declared, *suspected, *small]), None)
    if first is None:
        state, channel, text = _quiet_headline(result, units)
    else:
        state = "fault" if declared else "suspected" if suspected else "deviation"
        channel, text = channel_of(first.fault), event_in_words(first, units)
        if state == "suspected" and first.note:
            text += f": {units.sentence(first.note)}"
        if state == "deviation":
            text += f", within its tolerance{_tolerance_of(first, result.limits, units)}"
    bounds = _bounds_in_words(result, units, state)
    seen = [*bounds.pop("Would have been found", ()), *_steps_in_words(result, units, state)]
    seen = [*(["; ".join(seen)] if seen else []), *proof_in_words(result.proved, units)]
    longest = sorted(result.unwatched, key=lambda stretch: stretch[0] - stretch[1])
    unwatched = [f"{from_s:.0f} to {to_s:.0f} s: {why}" for from_s, to_s, why in longest]
    notes = note_lines(result.notes, units)
    wrong = first.channels if first is not None and state == "fault" else ()
    return Screen(
        state=state,
        channel=channel,
        text=text,
        lines=lines_of(
            {
                "Wrong from then on": [", ".join(map(channel_in_words, wrong))] if len(wrong) > 1 else [],
                "Also": listed[1:],
                "Ordinary": _ordinary_in_words(result.ordinary),
                **bounds,
                "Would have been found": seen,
                "Not checked": [*unwatched, *map(units.sentence, result.missing)],
                "Caution": [*(units.sentence(event.note) for event in declared if event.note), *notes["Caution"]],
                "To decide": [*(event.repeat for event in result.events if event.repeat), *notes["To decide"]],
                "Look at": [LOOK_AT.get(event.fault, "") for event in declared],
            }
        ),
    )


def is_quiet(result: DiagnoseResult) -> bool:
    """Return whether nothing is declared, suspected or in doubt, and most of the flight was watched for every fault."""
    is_open = any(finding.is_open for finding in result.plausibility)
    seconds = np.arange(result.log.start_s, result.log.stop_s)
    watched = ~within(seconds, [(from_s, to_s) for from_s, to_s, _ in result.unwatched])
    quiet = result.decision != "fault" and not result.events and not result.deviations and not is_open
    return quiet and bool(2 * np.count_nonzero(watched) > seconds.size)


def _quiet_headline(result: DiagnoseResult, units: Units) -> Headline:
    """Return the headline of a flight in which nothing is found."""
    phases = {phase.phase for phase in result.phases}
    span = f"{instant(round(result.log.start_s))} to {instant(round(result.log.stop_s))} s"
    if is_quiet(result):
        part = "from take-off to landing" if {"take-off", "landing"} <= phases else f"from {span}"
        return "no_fault_found", "", part
    worst = _worst(result.limits)
    if worst is None:
        return "cannot_tell", "", f"nothing in the log bounds an airspeed from {span}"
    return "cannot_tell", worst.channel, f"most of {span} could not be checked"


def _worst(limits: Sequence[FlightLimit], *, seen: bool = False) -> FlightLimit | None:
    """Return what bounds slow faults of an airspeed least, in most of the flight.

    Parameters
    ----------
    seen : by the size that would be declared, not by that which the flight excludes.
    """
    mostly = [
        limit
        for limit in limits
        if limit.bounds == "error"
        and limit.shape == "drift"
        and limit.holds_in < 1.0
        and limit.channel in AIRSPEEDS[:3]
    ]
    return max(
        mostly,
        key=lambda limit: beside_tolerance(limit.seen_effect if seen else limit.effect, limit.tolerance),
        default=None,
    )


def _bounds_in_words(result: DiagnoseResult, units: Units, state: State) -> dict[Label, list[str]]:
    """Return what would have been found of slow faults, or could still be there."""
    worst = _worst(result.limits, seen=state == "no_fault_found")
    if worst is None:
        other = "another" if result.verdicts["slow"] == "fault" else "a"
        return {"Still possible": [f"{other} slow error of any size"]}
    most = f"in {worst.holds_in:.0%} of the checked flight".replace("%", " %")
    channel, shown = channel_in_words(worst.channel), units.of(worst.effect_unit, channel=worst.channel)
    if state == "no_fault_found" and worst.seen_effect is not None:
        length = f"within {worst.seen_within_s:.0f} s ({most})"
        return {
            "Would have been found": [f"slow errors of {channel} above {change(worst.seen_effect, shown)} {length}"]
        }
    if worst.effect is None:
        return {"Still possible": [f"a slow error of {channel} of any size"]}
    bound = f"{change(worst.effect, shown)} within {worst.to_s - worst.from_s:.0f} s ({most})"
    if worst.within_tolerance:
        return {"Ruled out": [f"slow errors of {channel} above {bound}"]}
    return {"Still possible": [f"a slow error of {channel} of up to {bound}"]}


def _steps_in_words(result: DiagnoseResult, units: Units, state: State) -> list[str]:
    """Return from which size on a step of one airspeed alone would have been found, where nothing larger was."""
    alone = [
        limit
        for limit in result.limits
        if (limit.bounds, limit.shape) == ("disagreement", "bias")
        and limit.holds_in < 1.0
        and limit.channel in AIRSPEEDS[:3]
        and limit.seen_effect is not None
    ]
    if state not in ("no_fault_found", "deviation") or not alone:
        return []
    worst = max(alone, key=lambda limit: limit.seen_effect or 0.0)
    error = max(worst.seen_effect or 0.0, SMALLEST * (worst.tolerance or 0.0))
    size = change(error, units.of(worst.effect_unit, channel=worst.channel))
    return [
        f"a step of one airspeed alone above {size} (in {worst.holds_in:.0%} of the checked flight)".replace("%", " %")
    ]


def event_in_words(event: Event, units: Units) -> str:
    """Return an event: what is wrong, how far, from when, with 95 % intervals."""
    subject = channel_in_words(event.fault)
    if event.count:
        return f"{subject} {_short_defects(event)}{_reach(event, event.fault, units)}"
    shown = units.of(event.unit, channel=channel_of(event.fault))
    shape = event.fault if event.fault in SHAPES else event.shape
    text, size = error_in_words(
        shape if shape in SHAPES else "bias",
        channel_of(event.fault),
        event.magnitude,
        event.ci95,
        shown,
        frequency_hz=event.frequency_hz,
        seconds=event.constant_s,
    )
    others = ", ".join(
        channel_in_words(name) if name in STANDARD else name.replace("_", " ") for name in event.among[1:]
    )
    until = "" if event.offset_s is None else f" to {second(event.offset_s)}"
    low, high = event.onset_ci95
    spread = 0.5 * (high - low)
    onset = number(event.onset_s, spread=spread) if spread > 0.0 else second(event.onset_s)
    between = interval((low, high)) if spread > 0.0 else ""
    airspeed = next((name for name in AIRSPEEDS if name in event.effect and name != event.fault), "")
    reach = _reach(event, airspeed, units) if airspeed and event.fault not in event.effect else ""
    rivals = f" (or {others})" if others else ""
    return f"{text} from {onset}{until} s{intervals(size, between)}{rivals}{reach}"


def _short_defects(event: Event) -> str:
    """Return short defects in words: "drops out 5 times from 812 to 3021 s, 9.3 s in all"."""
    what, lasts = SHORT[event.shape], duration(event.duration_s)
    if event.count == 1:
        return f"{what} at {second(event.onset_s)} s for {lasts}"
    return f"{what} {event.count} times from {second(event.onset_s)} to {second(event.offset_s)} s, {lasts} in all"


def _reach(event: Event, channel: str, units: Units) -> str:
    """Return how large the error of a channel becomes, "" where that is not known."""
    if channel not in event.effect:
        return ""
    return f"; error of {channel_in_words(channel)} reaches {error_of(channel, event.effect[channel], units)}"


def error_of(channel: str, size: float, units: Units) -> str:
    """Return an error of a channel: "-19 m/s"."""
    return change(size, units.of(STANDARD[channel].unit if channel in STANDARD else "", channel=channel))


def second(time_s: float | None) -> str:
    """Return a time in s to a tenth, "-" for None."""
    return "-" if time_s is None else instant(round(round(time_s, 6), 1))  # the last bit turns no tie


def channel_of(fault: str) -> str:
    """Return the channel that a fault is named after, "" for a fault of a pressure line."""
    return fault if fault in STANDARD else ""


def _tolerance_of(event: Event, limits: Sequence[FlightLimit], units: Units) -> str:
    """Return " of 3.1 m/s", "" where no limit states the tolerance of the channel."""
    known = next((limit for limit in limits if limit.channel == event.fault and limit.tolerance is not None), None)
    return "" if known is None else f" of {change(known.tolerance, units.of(known.effect_unit, channel=known.channel))}"


def cause_in_words(name: str) -> str:
    """Return what happened, as a report says it."""
    return CAUSES[name].text if name in CAUSES else name.replace("_", " ")


def _ordinary_in_words(events: Sequence[OrdinaryEvent]) -> list[str]:
    """Return what happens in any flight, and when: what is stated or looked like a fault first, then the surest."""
    order = sorted(events, key=lambda event: (not event.stated, not event.looks_like, -event.evidence.get("gain", 0.0)))
    more = [f"{len(order) - MOST_ORDINARY} more in the report"] if len(order) > MOST_ORDINARY else []
    return [*map(_cause_and_time, order[:MOST_ORDINARY]), *more]


def _cause_and_time(event: OrdinaryEvent) -> str:
    """Return "flaps or gear move at 4780 s"."""
    at = f"at {event.from_s:.0f} s" if event.to_s is None else f"from {event.from_s:.0f} to {event.to_s:.0f} s"
    return f"{cause_in_words(event.cause)} {at}{', as is stated' if event.stated else ''}"
