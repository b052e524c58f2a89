"""The channels of a log that others contradict throughout the flight, in words, and the log without what is certain.

The scale of the true airspeed is told by turns over the ground: a wrong one needs a wind that turns with the aircraft.
In a turn the ground velocity less a steady wind has the airspeed's size in every direction, so that both follow from
half a circle alone, whatever the heading reads. Half circles differ by what the wind changes between them; their spread
is the error of the mean.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...airdata import relations as table
from ...airdata.relations import NAMES, State
from ...decision.implausible import Implausible, Setting
from ...errors import LogError
from ...flightlog import FlightLog
from ...flightlog.formats import parameters_of
from ...flightlog.phases import airborne
from ...flightlog.plausible import impossible_median, sentence_of_impossible
from ...kernels import TWO_SIDED_95, FloatArray
from ...kernels.compiled import special
from ...model.preprocessing.defaults import tolerance_of
from ...notes import Note
from ...quantities.channels import STANDARD
from ...quantities.text import quantity
from .misfits import known_seconds, misfit_of, seconds_of

if TYPE_CHECKING:
    from .changes import Change
    from .search import Blame

TINY = 1e-12  # a tolerance of nothing, of a channel that rests
FEWEST_WITNESSES = 2  # other channels that contradict one which is to blame; of two alone either may be wrong


def implausible_channels(log: FlightLog) -> tuple[Implausible, ...]:
    """Return what arithmetic says is wrong with channels throughout a flight; nothing where none says that it flies."""
    seconds = seconds_of(log, NAMES)
    if seconds is None:
        return ()
    stated = {name: log.channels[name].source_unit for name in seconds.values}
    sources = {name: log.channels[name].source for name in seconds.values}
    to_blame = _blames(seconds, stated)
    named = {name for blame in to_blame if not blame.change.is_constant for name in blame.change.channels}
    impossible = {
        name: middle
        for name, values in seconds.values.items()
        if name not in named and (middle := impossible_median(name, values)) is not None
    }
    if impossible:
        seconds = seconds.without(impossible)
        to_blame = _blames(seconds, stated)
    findings = (
        *(_impossible(name, middle, sources) for name, middle in impossible.items()),
        *(_finding(_beyond_tolerance(blame, log, seconds), seconds, stated, sources) for blame in to_blame),
    )
    is_known = any("tas" in finding.channels or finding.what == "clock" for finding in findings)
    turned = None if is_known else scale_by_circles(log)
    return with_settings(log, findings if turned is None else (*findings, turned))


def _blames(seconds: State, stated: Mapping[str, str | None]) -> list[Blame]:
    """Return what explains the relations that fail throughout a flight; nothing where all of them hold."""
    known = known_seconds(table.RELATIONS, seconds)
    if not any(misfit_of(relation, rows, seconds).fails for relation, rows in known.items()):
        return []
    from .search import blames

    return blames(known, seconds, stated)


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
    def change(name: str, values: FloatArray) -> FloatArray:
        for finding in findings:
            if name in finding.channels:
                values = finding.factor * values + finding.offset
                values.setflags(write=False)
        return values

    notes = []
    for finding in findings:
        shift = f" {finding.offset:+.4g} {STANDARD[finding.channels[0]].unit}" if finding.offset else ""
        read = f"{finding.factor:.4g} x {_and(finding.channels)}{shift}"
        notes.append(Note.method(f"{who}: {finding.text}; read as {read}"))
    return log.changed(change, notes=(*log.notes, *notes)) if findings else log


def _beyond_tolerance(blame: Blame, log: FlightLog, seconds: State) -> Blame:
    """Return what is to blame, without those whose error would be one that any such channel may have."""
    from .changes import RANKS

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


def _finding(blame: Blame, seconds: State, stated: Mapping[str, str | None], sources: Mapping[str, str]) -> Implausible:
    change = blame.change
    explained = [relation.channels(seconds.values) for relation in blame.explains]
    every = [name for channels in explained for name in channels]
    others = tuple(dict.fromkeys(name for name in every if name not in change.channels))
    near = [name for name in explained[0] if name not in change.channels]
    text, advice = _words(change, _and(near or others), blame.misfit, stated, sources)
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
        advice="kept as stated" if is_stated else advice,
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


def _words(
    change: Change, others: str, misfit: float, stated: Mapping[str, str | None], sources: Mapping[str, str]
) -> tuple[str, str]:
    """Return what is wrong, and what to do about it."""
    names, several = _and(change.channels), len(change.channels) > 1
    if change.what == "unit":
        shift = f" {change.offset:+.4g}" if change.offset else ""
        was = stated[change.channels[0]]
        statement = f" {'are' if several else 'is'} stated in {was} and" if was else ""
        looks = f"{names}{statement} {'look' if several else 'looks'} like {change.unit}"
        fits = f"x {change.factor:.3g}{shift} agrees with {others} to {max(100.0 * misfit, 0.1):.2g} %"
        units = " ".join(f"--unit {name}={change.unit}" for name in change.channels)
        return f"{looks}: {fits}", f"state the unit with {units}"
    if change.what == "sign":
        text = f"{names} {'have' if several else 'has'} the other sign: turned over it agrees with {others}"
        return text, f"turn {names} over, or read with --fix-units"
    if change.what == "swapped":
        first, other = change.channels
        places = f"--channel {first}={sources[other]} --channel {other}={sources[first]}"
        text = f"{names} look swapped: each in the place of the other they agree with {others}"
        return text, f"state which is which with {places}"
    if change.what == "clock":
        runs = f"runs {change.unit}" if change.unit else f"runs {1.0 / change.factor:.3g} times too slow"
        text = f"time {runs}: where a second of it is {change.factor:.3g} s, {others} agree"
        return text, "reverse the samples" if change.factor < 0.0 else f"multiply the times by {change.factor:.3g}"
    size = f" {1.0 / change.factor:.3g} times" if change.what == "scale" else _size(change)
    return f"{names} is{size} what {others} imply", f"check {names}"


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


def _and(names: Collection[str]) -> str:
    *first, last = names or ("",)
    return f"{', '.join(first)} and {last}" if first else last


# By topic of a log, from which an airspeed is taken, how a parameter enters it: its names, of the first sensor and of
# the second (of several spellings the log lists one); a power, to one over which the airspeed goes with it; and the
# channels of the topic in which its present value is, which in the others would be 1. ArduPilot, AP_Airspeed:
# sqrt(pressure * ARSPD_RATIO) is the airspeed. PX4, airspeed_selector_main: ASPD_SCALE_1 (of firmware before 1.13
# ASPD_SCALE) is calibrated over indicated airspeed, and is in what follows from the calibrated.
SCALES: Mapping[str, tuple[tuple[tuple[str, ...], ...], int, tuple[str, ...]]] = {
    "ARSP": ((("ARSPD_RATIO",), ("ARSPD2_RATIO",)), 2, ("ias", "cas", "tas")),
    "airspeed_validated": ((("ASPD_SCALE_1", "ASPD_SCALE"),), 1, ("cas", "tas")),
    "airspeed": ((("ASPD_SCALE_1", "ASPD_SCALE"), ("ASPD_SCALE_2",)), 1, ()),
}
AIRSPEEDS = ("tas", "cas", "ias")
DIGITS = 4  # of a setting that is printed: an autopilot's own calibration states as many


def with_settings(log: FlightLog, findings: tuple[Implausible, ...]) -> tuple[Implausible, ...]:
    """Return findings, those about the scale of an airspeed with the parameter to set where the log lists it."""
    if not any(map(_is_about_airspeed, findings)):
        return findings
    try:
        parameters = parameters_of(log.path)
    except LogError:
        return findings
    return tuple(
        with_setting(log, finding, parameters) if _is_about_airspeed(finding) else finding for finding in findings
    )


def with_setting(log: FlightLog, finding: Implausible, parameters: Mapping[str, float]) -> Implausible:
    """Return a finding about the scale of an airspeed with the parameter that mends it, if it is among `parameters`."""
    (channel,) = finding.channels
    topic, _, _ = log.channels[channel].source.partition(".")
    for name_of_topic, (spellings, power, applied) in SCALES.items():
        if topic != name_of_topic and not topic.startswith(f"{name_of_topic}_"):
            continue
        sensor = "0" if topic == name_of_topic else topic.removeprefix(f"{name_of_topic}_")
        names = spellings[int(sensor)] if sensor.isdecimal() and int(sensor) < len(spellings) else ()
        name = next((name for name in names if name in parameters), None)
        if name is not None:
            present = parameters[name]
            factor = present if channel in applied else 1.0
            value, *ends = (float(factor * by**power) for by in (finding.factor, *(finding.factor_ci95 or ())))
            ci95 = (ends[0], ends[1]) if ends else None
            setting = Setting(name=name, present=present, value=value, ci95=ci95)
            return replace(finding, setting=setting, advice=sentence_of_setting(setting))
    return finding


def sentence_of_setting(setting: Setting) -> str:
    """Return what to set, to which value, and what it is now: "set ARSPD_RATIO to 2.205 (2.1 to 2.31), now 2"."""
    between = "" if setting.ci95 is None else f" ({' to '.join(f'{end:.{DIGITS}g}' for end in setting.ci95)})"
    return f"set {setting.name} to {setting.value:.{DIGITS}g}{between}, now {setting.present:.{DIGITS}g}"


def _is_about_airspeed(finding: Implausible) -> bool:
    return finding.what == "scale" and not finding.rivals and finding.channels in [(name,) for name in AIRSPEEDS]


NEEDS = ("tas", "velocity_north", "velocity_east")
# Hz at which velocities are compared; gusts are slower.
RATE_HZ = 2.0
# s: a turn that takes longer, twice that at the standard rate of 3 degrees a second, meets another wind; one that takes
# less has too few gusts for their mean.
SLOWEST_S, FASTEST_S = 120.0, 15.0
# rad over the ground: half a circle tells the scale from the wind. Of 40 windows of 120 to 170 s of a circling glider
# all had three half circles and most not three full ones; all intervals held the scale of the whole flight.
TURN = math.pi
# Turns below which their spread says little, and that are looked at of a long flight.
FEWEST, MOST = 3, 60


def scale_by_circles(log: FlightLog) -> Implausible | None:
    """Return the finding of a true airspeed of a wrong scale; None where turns show none beyond the tolerance."""
    if not log.channels.keys() >= {*NEEDS}:
        return None
    scales = circle_scales(log)
    if scales.size < FEWEST:
        return None
    mean = float(scales.mean())
    half = float(special.stdtrit(scales.size - 1, 0.975) * scales.std(ddof=1) / math.sqrt(scales.size))
    flown = log.time_s[airborne(log, log.time_s)]
    part = log.window(float(flown[0]), float(flown[-1]))
    speed = float(np.nanmedian(part.channels["tas"].values))
    if abs(mean - 1.0) <= half or abs(mean - 1.0) * speed <= tolerance_of(log, part, "tas"):
        return None
    low, high = 1.0 / (mean + half), 1.0 / max(mean - half, 1e-3)
    return Implausible(
        channels=("tas",),
        what="scale",
        unit="",
        factor=mean,
        offset=0.0,
        agrees_with=NEEDS[1:],
        relative_misfit=half / mean,
        rivals=(),
        text=f"tas is {1.0 / mean:.3g} times ({low:.3g} to {high:.3g}) what the ground velocity in {scales.size} "
        "half circles implies: the wind would have to turn with the aircraft",
        advice="check tas",
        factor_ci95=(mean - half, mean + half),
    )


def circle_scales(log: FlightLog) -> FloatArray:
    """Return (n_circles,) by what the true airspeed must be multiplied in each circle of a flight."""
    every = max(1, round(log.rate_hz / RATE_HZ))
    flown = np.flatnonzero(airborne(log, log.time_s))[::every]
    speed, north, east = (log.channels[name].values[flown] for name in NEEDS)
    known = np.isfinite(speed + north + east)
    time_s, speed, north, east = log.time_s[flown][known], speed[known], north[known], east[known]
    pieces = _circles(time_s, np.unwrap(np.arctan2(east, north)))
    chosen = pieces[:: max(1, -(-len(pieces) // MOST))]
    return np.array([_scale(speed[circle], north[circle], east[circle]) for circle in chosen])


def _circles(time_s: FloatArray, course: FloatArray) -> list[slice]:
    """Return the stretches, one after the other, in which the course (n,) over the ground turns by half a circle."""
    pieces, first = [], 0
    for k in range(len(time_s)):
        while time_s[k] - time_s[first] > SLOWEST_S:
            first += 1
        turned = abs(course[k] - course[first]) >= TURN
        if turned and time_s[k] - time_s[first] >= FASTEST_S:
            pieces.append(slice(first, k + 1))
            first = k + 1 if k + 1 < len(time_s) else k
    return pieces


def _scale(speed: FloatArray, north: FloatArray, east: FloatArray) -> float:
    """Return the scale s of least squares of |ground velocity - wind| - s speed, with the wind free."""
    from scipy.optimize import least_squares  # takes as long to import as a short log to read

    def misfit(p: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(north - p[1], east - p[2]) - p[0] * speed)

    # Exact without noise: |v|^2 = s^2 speed^2 + 2 v w - |w|^2 is linear.
    A = np.column_stack([speed**2, 2.0 * north, 2.0 * east, np.ones(len(speed))])
    unit = np.linalg.norm(A, axis=0)
    unit[unit == 0.0] = 1.0
    start = np.linalg.lstsq(A / unit, north**2 + east**2, rcond=None)[0] / unit
    steady = np.median(speed) * 0.01 > speed.std()
    begin = [1.0 if steady else math.sqrt(max(start[0], 0.01)), start[1], start[2]]
    return float(least_squares(misfit, begin).x[0])
