"""Known faults added to a log and taken out of it: of one channel, or of every channel that follows from a pressure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..airdata import (
    DEPENDS_ON,
    IMPACT_SOURCES,
    STATIC_SOURCES,
    AirData,
    air_data_of,
    channels_of,
    fault_distribution,
    pressure_at,
)
from ..errors import DictionaryError, LogError
from ..faults import Fault, active_samples, course, has_channel
from ..faults.filters import recorded_signal, response_of
from ..faults.shapes import SHAPES
from ..kernels import BoolArray
from ..kernels.low_pass import Response
from ..kernels.runs import bridged
from ..notes import Note
from ..quantities.text import instant
from .derived import pressures_of
from .record import FlightLog, FloatArray, Truth, frozen_array

if TYPE_CHECKING:
    from ..faults.ordinary import Occurrence

ROUNDING = 1e-12  # of a pressure: a fault that moves it by less, a line trapped in still air, moves nothing
# The share of a pressure by which a derivative is taken: its square is far below, and round-off far above, what counts.
SMALL = 1e-4
# LEAST_LEFT: share of a line's pressure; with less left the airspeed is mostly noise. A line that has lost as
# much is what the stage of holds calls leaking (`bfi_cli.flight.parity.holds`).
LEAST_LEFT = 0.15
RATES = ("altitude_rate", "tas_rate")  # of channels that follow from a pressure; they change with its rate as well


def inject(
    log: FlightLog,
    faults: Sequence[Fault] = (),
    *,
    ordinary: Sequence[Occurrence] = (),
    response: Response | None = None,
) -> FlightLog:
    """Return `log` with `faults` added to their channels, in that order, and the truth extended by them.

    Times of the faults are on the log's own time axis; a `phase_reference` of "window" counts from its first sample.
    Faults that the log carries already stay in its truth; a clean signal is that before the first fault.
    `notes` names a fault that has neither onset nor end in the log.

    A fault of a pressure line is added by differences: the pressures that the log's channels stand for, with the fault
    and without, are turned into every recorded channel that follows from them, and what changes is added to it. So
    the log's own offsets and quantisation stay.

    Parameters
    ----------
    ordinary : what ordinarily happens, a row of `bfi_cli.flightlog.ordinary.INJECTED` each; it is there before the
        faults, and clean signals have it.
    response : through which the faults go; None for that of the filters that the log went through, as a fault of the
        aircraft would have, `bfi_cli.kernels.low_pass.IDENTITY` for none.

    Raises
    ------
    LogError : the log has no such channel, none that the pressures follow from, or holds what no subsonic flight has.
    DictionaryError : a fault is zero at every sample of the log, or its signal cannot be made.
    """
    through = response_of(log.filters or (), log.rate_hz) if response is None else response
    for occurrence in ordinary:
        log = _with_ordinary(log, occurrence, through)
    for declared in faults:
        log = _with_fault(log, declared, through)
    return log


def _with_ordinary(log: FlightLog, occurrence: Occurrence, through: Response) -> FlightLog:
    from .ordinary import INJECTED, check_within

    check_within(log, occurrence)
    cause, before = INJECTED[occurrence.cause], log.truth or Truth()
    at_s, size = occurrence.at_s, cause.size if occurrence.size is None else occurrence.size
    added: dict[str, FloatArray] = {}
    if cause.stamps is not None:
        log = replace(log, time_s=frozen_array(cause.stamps(log, at_s, size)))
    elif cause.impact is not None:
        share = cause.impact(log, at_s, size)
        # Of the tube's pressure alone.
        moved = Fault(name=occurrence.cause, shape="pitot_water", frequency_hz=1.0, magnitude=1.0, onset_s=at_s)
        added = _stored(log, moved, share, share != 0.0, slice(None), through)
    elif cause.channels is not None:
        for name, change in cause.channels(log, at_s, size).items():
            longer = np.pad(change, (through.after, through.before), mode="edge")
            added[name] = change if through.changes_nothing else through.filtered(longer)
    clean = {name: frozen_array(values + added.get(name, 0.0)) for name, values in before.clean.items()}
    made = (*before.ordinary, replace(occurrence, size=size))
    return replace(log.plus(added), truth=replace(before, clean=clean, ordinary=made), sha256="")


def _with_fault(log: FlightLog, declared: Fault, through: Response) -> FlightLog:
    start_s, stop_s = float(log.time_s[0]), float(log.time_s[-1])
    fault = replace(declared, channel=log.channel(declared.channel).name if has_channel(declared.shape) else "")
    if fault.phase_reference != "onset" and fault.frequency_hz is not None:
        # Counted from the onset, so that the truth stays true where the log is cut.
        phase = fault.phase_rad + 2.0 * math.pi * fault.frequency_hz * (fault.onset_s - start_s)
        fault = replace(fault, phase_reference="onset", phase_rad=phase % (2.0 * math.pi))
    active, added = active_samples(fault, log.time_s), added_by(log, fault, through)
    # NaN is no change: where a channel is missing nothing can be added to it.
    if not any(np.any(np.nan_to_num(change)) for change in added.values()):
        until = "" if fault.offset_s is None else f" until {instant(fault.offset_s)} s"
        size = f"magnitude {fault.magnitude:g} " if SHAPES[fault.shape].has_magnitude else ""
        why = "changes no channel of" if active.any() and fault.magnitude else "never active in"
        raise DictionaryError(
            f"{_place(log, fault)}: {why} the log, got {size}from {instant(fault.onset_s)} s{until}, the log runs from "
            f"{instant(start_s)} s to {instant(stop_s)} s; change onset, offset or magnitude"
        )
    before, notes = log.truth or Truth(), log.notes
    if active.all():
        on = f" on {fault.channel}" if fault.channel else ""
        notes += (
            Note.limit(
                f"fault '{fault.name or fault.shape}'{on} acts at every sample of the log; "
                "with neither onset nor end in it, it can pass for the aircraft's own motion"
            ),
        )
    if fault.channel in added and log.channels[fault.channel].derived_from:  # else it would be derived again
        channels = {**log.channels, fault.channel: replace(log.channels[fault.channel], derived_from=())}
        log = replace(log, channels=channels)
    clean = {channel: log.channels[channel].values for channel in added}
    truth = replace(before, faults=(*before.faults, fault), clean={**clean, **before.clean})
    return replace(log.plus(added), truth=truth, sha256="", notes=notes)


def _place(log: FlightLog, fault: Fault) -> str:
    return f"{log.path}: fault '{fault.name or fault.shape}'"


def added_by(log: FlightLog, fault: Fault, through: Response) -> Mapping[str, FloatArray]:
    """Return by channel, (n_samples,), what the log shows of a fault; nothing where it is never active in it.

    Parameters
    ----------
    fault : of a channel by its name in the log.
    through : the filters that it goes through.

    Raises
    ------
    LogError, DictionaryError : see `inject`.
    """
    acts_on, active = SHAPES[fault.shape].acts_on, active_samples(fault, log.time_s)
    if acts_on == "course":
        raise DictionaryError(
            f"{_place(log, fault)}: shape '{fault.shape}' has no course of its own; give one that has, as samples"
        )
    if acts_on == "channel":
        signal = recorded_signal(fault, log.time_s, through, window_start_s=float(log.time_s[0]))
        return {fault.channel: fault.magnitude * signal}
    if not active.any() or not fault.magnitude:
        return {}
    part = _around(active, 2 * len(through.taps))
    amount = fault.magnitude * course(fault, log.time_s[part])
    return _stored(log, fault, amount, active, part, through)


def _around(active: BoolArray, reach: int) -> slice:
    """Return the samples from `reach` before the first active one to as many after the last."""
    first, last = np.flatnonzero(active)[[0, -1]]
    return slice(max(0, int(first) - reach), int(last) + 1 + reach)


def _stored(
    log: FlightLog, fault: Fault, amount: FloatArray, active: BoolArray, part: slice, through: Response
) -> dict[str, FloatArray]:
    """Return by channel, (n_samples,), what the recorder makes of what a fault changes.

    The changes are computed from channels that went through the recorder already. Only filtered, they would lack what
    the filter takes off the motion the second time, and a trapped pressure would still move by that. So it is added, as
    the motion under the largest amount tells it, in proportion to the amount.

    Parameters
    ----------
    amount : (samples of the part,) magnitude x signal.
    """
    changes, on = _changes(log, fault, amount, part), active[part]
    added = {channel: np.zeros(log.n_samples) for channel in changes}
    if through.changes_nothing:
        for channel, change in changes.items():
            added[channel][part] = np.where(on, change, 0.0)
        return added

    def low_passed(x: FloatArray) -> FloatArray:
        # Beyond its ends a signal is taken to stay as it is there.
        return through.filtered(np.pad(x, (through.after, through.before), mode="edge"))

    largest = amount[on][np.argmax(np.abs(amount[on]))]
    under_largest = _changes(log, fault, np.full(amount.shape, largest), part)
    if not under_largest:  # where it acts it is less than rounding, as an oscillation is at its first sample
        return added
    share = low_passed(np.where(on, amount, 0.0)) / largest
    for channel, change in changes.items():
        whole = under_largest[channel]
        added[channel][part] = low_passed(np.where(on, change, 0.0)) + share * (whole - low_passed(whole))
    return added


def _changes(log: FlightLog, fault: Fault, amount: FloatArray, part: slice) -> dict[str, FloatArray]:
    """Return by channel what a fault changes in a part of the log, as if it acted throughout; gaps are bridged."""
    acts_on = SHAPES[fault.shape].acts_on
    if acts_on in ("reading", "held"):
        reading = log.channels[fault.channel].values[part]
        sensitivity = reading if acts_on == "reading" else _at_onset(log, fault) - reading
        changes = {fault.channel: amount * sensitivity}
    else:
        changes = _differences(log, fault, amount, part)
    return {channel: bridged(change) for channel, change in changes.items()}


def _at_onset(log: FlightLog, fault: Fault) -> float:
    """Return what a channel reads at the onset, or at the first sample after it where that is known."""
    values = log.channels[fault.channel].values
    known = np.isfinite(values)
    if not known.any():
        raise LogError(f"{_place(log, fault)}: '{fault.channel}' has no value; choose another channel")
    onset_s = max(fault.onset_s, float(log.time_s[known][0]))
    return float(np.interp(onset_s, log.time_s[known], values[known]))


def _under(log: FlightLog, fault: Fault, amount: FloatArray, part: slice) -> tuple[AirData, FloatArray, FloatArray]:
    """Return the air data of a part of the log, and the static and total pressure that the lines hold under a fault.

    Parameters
    ----------
    amount : (samples of the part,) magnitude x signal, as if it acted throughout.
    """
    shape, place = SHAPES[fault.shape], _place(log, fault)
    moved = shape.acts_on
    assert shape.lines is not None
    recorded = {channel: log.channels[channel].values[part] for channel in log.channels}
    for pressure, sources in (("p_static", STATIC_SOURCES), ("q_impact", IMPACT_SOURCES)):
        # Without an impact pressure no channel follows from it.
        if not set(sources) & recorded.keys() and (pressure == "p_static" or moved == "p_total"):
            raise LogError(
                f"{place}: {pressure} needs one of {', '.join(sources)}; the log has: "
                f"{', '.join(sorted(log.channels))}; map one with --channel {sources[-1]}=NAME"
            )
    if not set(IMPACT_SOURCES) & recorded.keys():
        recorded["q_impact"] = np.zeros(amount.shape)
    air, time_s = air_data_of(recorded), log.time_s[part]
    for impossible in air.impossible:
        k = int(np.argmax(impossible.where))
        odd = log.channels[impossible.channel]
        raise LogError(
            f"{place}: '{odd.name}' is {recorded[odd.name][k]:.6g} {odd.unit} at {instant(time_s[k])} s, "
            f"{impossible.why}; end the fault before with offset_s, or give its unit with --unit"
        )
    known = np.isfinite(air.p_static + air.q_impact)
    if not known.any():
        raise LogError(f"{place}: the pressures are missing wherever it is active; choose another onset")
    # Static and total pressure at the onset, or at the first sample after it where they are known.
    onset_s = max(fault.onset_s, float(time_s[known][0]))
    static, total = (
        float(np.interp(onset_s, time_s[known], pressure[known])) for pressure in (air.p_static, air.p_total)
    )
    try:
        cabin = float(pressure_at(fault.cabin_altitude_m or 0.0))
    except ValueError as error:
        raise DictionaryError(f"{place}: cabin_altitude_m: {error}; give one of air") from None
    p_static, p_total = shape.lines(air.p_static, air.p_total, first=(static, total), cabin=cabin, amount=amount)
    return air, p_static, p_total


def _differences(log: FlightLog, fault: Fault, amount: FloatArray, part: slice) -> dict[str, FloatArray]:
    """Return by channel what a fault of a pressure line changes in a part of the log, see `_under`."""
    air, p_static, p_total = _under(log, fault, amount, part)
    place, moved, time_s = _place(log, fault), SHAPES[fault.shape].acts_on, log.time_s[part]
    pairs = ((p_static, air.p_static), (p_total, air.p_total))
    if max(np.nanmax(np.abs(pressure / other - 1.0)) for pressure, other in pairs) <= ROUNDING:
        return {}
    old = channels_of(air.p_static, air.q_impact, air.tat, rate_of=time_s)
    try:
        # An instrument shows no airspeed where the total pressure is below the static one.
        new = channels_of(p_static, np.maximum(p_total - p_static, 0.0), air.tat, rate_of=time_s)
    except ValueError as error:
        raise DictionaryError(
            f"{place}: brings the air data out of what the equations hold for, {error}; end it earlier with offset_s"
        ) from None
    new |= {"p_total": p_total, "q_impact": p_total - p_static}
    follow = [channel for channel, pressures in DEPENDS_ON.items() if moved in pressures]
    has = [name for name in follow if moved in pressures_of(log, name)]
    if not has:
        raise LogError(f"{place}: no channel of the log follows from {moved}; it needs one of {', '.join(follow)}")
    changes = {channel: new[channel] - old[channel] for channel in new}
    changes["baro_altitude"] = changes["altitude"]  # whatever the setting
    return {channel: changes[channel] for channel in has}


def _growth(
    log: FlightLog, fault: Fault, amount: FloatArray, part: slice, names: Sequence[str]
) -> dict[str, FloatArray]:
    """Return by how much what a loss changes in a channel grows with the channel itself, (samples of the part,).

    The channel changes as the flight changes it: one of airspeed with the total pressure, one of altitude with the
    static one. By the chain rule, from the derivatives with the fault and without; 0 at rest, where there are none.
    """
    shape, (air, p_static, p_total) = SHAPES[fault.shape], _under(log, fault, amount, part)
    moving = (air.p_total > air.p_static) & (p_total > p_static)
    kept = 1.0 - (shape.loss or 0.0) * amount[moving]  # of a change of the pressure outside, what its line still shows
    pairs = [(static[moving], total[moving]) for static, total in ((air.p_static, air.p_total), (p_static, p_total))]
    growth = {}
    for name in names:
        pressure = "p_total" if "p_total" in DEPENDS_ON[name] else "p_static"
        by_total = int(pressure == "p_total")
        outside, shown = (fault_distribution(name, *pair, air.tat[moving])[:, by_total] for pair in pairs)
        growth[name] = np.zeros(amount.shape)
        growth[name][moving] = (kept if shape.acts_on == pressure else 1.0) * shown / outside - 1.0
    return growth


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineSignal:
    """What a fault of a pressure line does to one channel, per unit of its size, by (n_samples,) of a log that has it.

    Attributes
    ----------
    values : the channel less size x values is what it would show without the fault.
    slopes : by how much `values` changes with the channel itself; the density of the channel is that of the corrected
        one times |1 - size x slopes|. Where these were not asked for, and for the rate of a channel, 0.
    """

    values: FloatArray
    slopes: FloatArray


def line_signals(
    log: FlightLog, fault: Fault, through: Response, *, size: float = 0.0, with_slopes: bool = True
) -> dict[str, LineSignal]:
    """Return by channel the signal of a fault of a pressure line, told by the log that has it; {} where it acts not.

    Of a line that has lost a known share of its pressure the pressure outside follows, and with it every channel as it
    was: by differences, as in `inject`. A fault without a magnitude is whole, so that its signal is that of all of it.
    For others the channels are not proportional to the size; the signal is the secant to a size, or the derivative.

    Parameters
    ----------
    fault : its magnitude does not count.
    through : the filters that the log went through.
    size : magnitude to take the secant to, 0 for the derivative at no fault.

    Raises
    ------
    LogError : see `inject`.
    DictionaryError : the line keeps no trace of the pressure outside, or too little of it.
    """
    shape, active = SHAPES[fault.shape], active_samples(fault, log.time_s)
    assert shape.lines is not None
    if shape.loss is None:
        raise DictionaryError(
            f"{_place(log, fault)}: a trapped line keeps no trace of the pressure outside; use bfi diagnose, which "
            "holds the line's pressure against lift and altitude"
        )
    size = size if shape.has_magnitude else 1.0
    part = _around(active, 2 * len(through.taps)) if active.any() else slice(0, 0)
    on, lost = active[part], shape.loss * course(fault, log.time_s[part])
    if not np.any(lost[on]):
        return {}
    gone = on & (size * lost > 1.0 - LEAST_LEFT)
    if gone.any():
        raise DictionaryError(
            f"{_place(log, fault)}: leaves less than {100.0 * LEAST_LEFT:.0f} % of the line's pressure from "
            f"{instant(log.time_s[part][np.argmax(gone)])} s on, which tells no airspeed or altitude; end the window "
            "or the fault before, or use bfi diagnose"
        )
    # The fault is taken out of the log; secant or derivative, per unit of its size.
    small = SMALL / float(np.max(np.abs(lost[on])))
    sizes = (size,) if size else (small, -small)
    shares = [np.minimum(taken * lost, 1.0 - LEAST_LEFT) for taken in sizes]
    amounts = [-shape.loss * share / (1.0 - share) for share in shares]

    def per_size(corrections: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
        return {
            channel: -np.mean(
                [correction[channel] / taken for correction, taken in zip(corrections, sizes, strict=True)], axis=0
            )
            for channel in corrections[0]
            if all(channel in correction for correction in corrections)
        }

    values = per_size([_stored(log, fault, amount, active, part, through) for amount in amounts])
    slopes: dict[str, FloatArray] = {name: np.zeros(log.n_samples) for name in values}
    if with_slopes:
        names = [name for name in values if name not in RATES]
        for name, slope in per_size([_growth(log, fault, amount, part, names) for amount in amounts]).items():
            slopes[name][part] = np.where(on, slope, 0.0)
    return {
        name: LineSignal(values=frozen_array(signal), slopes=frozen_array(slopes[name]))
        for name, signal in values.items()
    }


def without_line_fault(log: FlightLog, fault: Fault, through: Response) -> FlightLog:
    """Return the log less what a fault of a pressure line, of its magnitude, changed in every channel that follows.

    A log that does not tell so large a loss is corrected to first order.

    Raises
    ------
    LogError, DictionaryError : see `line_signals`.
    """
    try:
        signals = line_signals(log, fault, through, size=fault.magnitude, with_slopes=False)
    except DictionaryError:
        signals = line_signals(log, fault, through, with_slopes=False)
    changes = {name: -fault.magnitude * signal.values for name, signal in signals.items()}
    return replace(log.plus(changes), truth=None)
