"""The channels of a log that others contradict throughout the flight, in words, and the log without what is certain."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...airdata import relations as table
from ...airdata.relations import NAMES, State
from ...decision.implausible import Implausible
from ...flightlog import FlightLog
from ...flightlog.plausible import impossible_median, sentence_of_impossible
from ...kernels import TWO_SIDED_95, FloatArray
from ...model.preprocessing.tolerance import tolerance_of
from ...notes import Note
from ...quantities.channels import STANDARD
from ...quantities.text import quantity
from .changes import RANKS, Change
from .circling import scale_by_circles
from .search import Blame, blames, known_relations
from .seconds import seconds_of
from .settings import with_settings

TINY = 1e-12  # a tolerance of nothing, of a channel that rests
FEWEST_WITNESSES = 2  # other channels that contradict one which is to blame; of two alone either may be wrong


def implausible_channels(log: FlightLog) -> tuple[Implausible, ...]:
    """Return what arithmetic says is wrong with channels throughout a flight; nothing where none says that it flies."""
    seconds = seconds_of(log, NAMES)
    if seconds is None:
        return ()
    stated = {name: log.channels[name].source_unit for name in seconds.values}
    sources = {name: log.channels[name].source for name in seconds.values}
    to_blame = blames(known_relations(table.RELATIONS, seconds), seconds, stated)
    named = {name for blame in to_blame if not blame.change.is_constant for name in blame.change.channels}
    impossible = {
        name: middle
        for name, values in seconds.values.items()
        if name not in named and (middle := impossible_median(name, values)) is not None
    }
    if impossible:
        seconds = seconds.without(impossible)
        to_blame = blames(known_relations(table.RELATIONS, seconds), seconds, stated)
    findings = (
        *(_impossible(name, middle, sources) for name, middle in impossible.items()),
        *(_finding(_beyond_tolerance(blame, log, seconds), stated, sources) for blame in to_blame),
    )
    turned = (
        None
        if any("tas" in finding.channels or finding.what == "clock" for finding in findings)
        else scale_by_circles(log)
    )
    return with_settings(log, findings if turned is None else (*findings, turned))


def with_fixed_units(
    log: FlightLog, findings: Sequence[Implausible], given: Collection[str] = ()
) -> tuple[FlightLog, tuple[Implausible, ...]]:
    """Return the log in the units and signs that are certain, with notes, and the findings with these fixed.

    Parameters
    ----------
    given : channels, or their names in the file, whose unit the user has given, which stays.
    """

    def is_given(finding: Implausible) -> bool:
        return not {*finding.channels, *(log.channels[name].source for name in finding.channels)}.isdisjoint(given)

    marked = tuple(replace(finding, fixed=finding.is_certain and not is_given(finding)) for finding in findings)
    return _changed(log, [finding for finding in marked if finding.fixed], "--fix-units"), marked


def without_constant_errors(
    log: FlightLog, findings: Sequence[Implausible], tolerances: Mapping[str, float]
) -> tuple[FlightLog, tuple[Implausible, ...]]:
    """Return the log less the constant errors of single channels, with notes, and the findings with these fixed.

    Parameters
    ----------
    tolerances : that are stated, by channel; an error within the tolerance is left where it is.
    """

    def is_certain(finding: Implausible) -> bool:
        if finding.what != "offset" or finding.rivals or len(finding.agrees_with) < FEWEST_WITNESSES:
            return False
        (channel,) = finding.channels
        return abs(finding.offset) > (tolerances.get(channel) or tolerance_of(log, log, channel))

    marked = tuple(replace(finding, fixed=finding.fixed or is_certain(finding)) for finding in findings)
    constant = [finding for finding in marked if finding.fixed and finding.is_constant]
    return _changed(log, constant, "throughout the flight"), marked


def _changed(log: FlightLog, findings: Sequence[Implausible], who: str) -> FlightLog:
    steps = [(finding.channels, finding.factor, finding.offset) for finding in findings]

    def change(name: str, values: FloatArray) -> FloatArray:
        for channels, factor, offset in steps:
            if name in channels:
                values = factor * values + offset
                values.setflags(write=False)
        return values

    notes = tuple(Note.method(f"{who}: {finding.text}; read as {_as_read(finding)}") for finding in findings)
    return log.changed(change, notes=(*log.notes, *notes)) if steps else log


def _beyond_tolerance(blame: Blame, log: FlightLog, seconds: State) -> Blame:
    """Return what is to blame, without those whose error would be one that any such channel may have."""
    if blame.change.rank < max(RANKS.values()) or not blame.rivals:
        return blame

    def shares(change: Change) -> float:
        if not change.channels:
            return math.inf
        (name,) = change.channels
        error = abs(change.offset) + abs(change.factor - 1.0) * float(np.nanmedian(np.abs(seconds.values[name])))
        return error / max(tolerance_of(log, log, name), TINY)

    every = (blame.change, *blame.rivals)
    kept = [change for change in every if shares(change) > 1.0] or every
    return replace(blame, change=kept[0], rivals=tuple(kept[1:]))


def _as_read(finding: Implausible) -> str:
    shift = f" {finding.offset:+.4g} {STANDARD[finding.channels[0]].unit}" if finding.offset else ""
    return f"{finding.factor:.4g} x {_and(finding.channels)}{shift}"


def _finding(blame: Blame, stated: Mapping[str, str | None], sources: Mapping[str, str]) -> Implausible:
    change = blame.change
    every = [name for relation in blame.explains for name in relation.channels]
    others = tuple(dict.fromkeys(name for name in every if name not in change.channels))
    near = [name for name in blame.explains[0].channels if name not in change.channels]
    text = _text(change, _and(near) or _and(others), blame.misfit, stated)
    if rivals := [f"{_and(rival.channels) or 'time'}{_wrong(rival)}" for rival in blame.rivals]:
        text += f"; or {' or '.join(rivals)}"
    is_stated = change.doubts_unit(stated)
    return Implausible(
        channels=change.channels,
        what=change.what,
        unit=change.unit,
        factor=change.factor,
        offset=change.offset,
        agrees_with=others,
        relative_misfit=blame.misfit,
        rivals=tuple(dict.fromkeys(name for rival in blame.rivals for name in rival.channels)),
        text=text,
        advice="kept as stated" if is_stated else _advice(change, sources),
        factor_ci95=_interval(change.factor, blame.share_sd * (change.factor - 1.0)),
        offset_ci95=_interval(change.offset, blame.share_sd * change.offset),
        is_stated=is_stated,
    )


def _interval(value: float, sd: float) -> tuple[float, float] | None:
    """Return a 95 % interval, None where nothing is estimated or nothing tells how well."""
    half = TWO_SIDED_95 * abs(sd)
    return (value - half, value + half) if 0.0 < half < np.inf else None


def _impossible(name: str, middle: float, sources: Mapping[str, str]) -> Implausible:
    return Implausible(
        channels=(name,),
        what="impossible",
        unit="",
        factor=1.0,
        offset=0.0,
        agrees_with=(),
        relative_misfit=1.0,
        rivals=(),
        text=sentence_of_impossible(name, middle),
        advice=f"map the channel that is {name} with --channel {name}=NAME, if it is not {sources[name]}",
        fixed=True,
    )


def _text(change: Change, others: str, misfit: float, stated: Mapping[str, str | None]) -> str:
    names, several = _and(change.channels), len(change.channels) > 1
    to = f"to {max(100.0 * misfit, 0.1):.2g} %"
    if change.what == "unit":
        shift = f" {change.offset:+.4g}" if change.offset else ""
        was = stated[change.channels[0]]
        statement = f" {'are' if several else 'is'} stated in {was} and" if was else ""
        looks = "look" if several else "looks"
        return f"{names}{statement} {looks} like {change.unit}: x {change.factor:.3g}{shift} agrees with {others} {to}"
    if change.what == "sign":
        return f"{names} {'have' if several else 'has'} the other sign: turned over it agrees with {others}"
    if change.what == "swapped":
        return f"{names} look swapped: each in the place of the other they agree with {others}"
    if change.what == "clock":
        runs = f"runs {change.unit}" if change.unit else f"runs {1.0 / change.factor:.3g} times too slow"
        return f"time {runs}: where a second of it is {change.factor:.3g} s, {others} agree"
    if change.what == "scale":
        return f"{names} is {1.0 / change.factor:.3g} times what {others} imply"
    return f"{names} is{_size(change)} what {others} imply"


def _size(change: Change) -> str:
    """Return how a channel errs by an offset or a scale, "" for another change."""
    if change.what == "offset":
        unit = STANDARD[change.channels[0]].unit
        size = quantity(abs(change.offset), "" if unit == "1" else unit)
        return f" {size} {'above' if change.offset < 0.0 else 'below'}"
    return f" {1.0 / change.factor:.4g} times" if change.what == "scale" else ""


def _wrong(change: Change) -> str:
    """Return what is wrong with a rival."""
    words = {"unit": f" is in {change.unit}", "sign": " has the other sign", "swapped": " are swapped"}
    return words.get(change.what) or f" is{_size(change)} it"


def _advice(change: Change, sources: Mapping[str, str]) -> str:
    if change.what == "unit":
        return "state the unit with " + " ".join(f"--unit {name}={change.unit}" for name in change.channels)
    if change.what == "sign":
        return f"turn {_and(change.channels)} over, or read with --fix-units"
    if change.what == "swapped":
        first, other = change.channels
        return f"state which is which with --channel {first}={sources[other]} --channel {other}={sources[first]}"
    if change.what == "clock":
        return "reverse the samples" if change.factor < 0.0 else f"multiply the times by {change.factor:.3g}"
    return f"check {_and(change.channels)}"


def _and(names: Collection[str]) -> str:
    *first, last = names or ("",)
    return f"{', '.join(first)} and {last}" if first else last
