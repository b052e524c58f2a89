"""Quality of a log: rate, gaps, held samples, recorder's low-pass, and whether it is long or of the ground."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..faults.filters import Filter
from ..kernels.low_pass import Kind, recorder_from_jumps, recorder_from_spectra
from ..kernels.quantisation import Hold, find_hold, may_be_held, repeat_fraction
from ..kernels.runs import repeats, shared
from ..quantities.channels import INDEPENDENT
from ..quantities.text import instant
from .phases import HOVER, NO_AIRSPEED, TRANSITION, phases_of, spans_of
from .rates import AS_FAST, GAP
from .record import LARGEST_VALUE, Channel, FlightLog, FloatArray

UNEVEN = 0.02  # share of the median time step by which a uniform clock may wander
PIECE = 1_000_000  # samples whose steps are computed at once, for memory
MOSTLY = 0.5  # share of a window on the ground from which the user is told
# In a longer record, s, the dynamics change and a scan takes minutes.
LONG_S = 600.0
# Phases that no linear model follows.
UNFIT = ("ground", "take-off", "landing", "stall", "parabola", HOVER, TRANSITION, NO_AIRSPEED)
# Samples that are looked at: three hours at 10 Hz hold hundreds of jumps.
MOST_SAMPLES = 108_000
# Relative difference of two edges beyond which they contradict each other: the accuracy of the spectra.
SAME_EDGE = 0.2
UNKNOWN = "it is unknown whether the recorder low-passed the log; no low-pass is assumed (--recorder HZ states one)"
# Samples of one value from which a sensor may be frozen for good (`bfi_cli.flight.parity.frozen`).
FEWEST_REPEATS = 20


def median_step(time_s: FloatArray) -> float:
    """Return the median time step, s, in the memory of one array of the steps."""
    return float(np.median(np.diff(time_s), overwrite_input=True))


def gap_starts(time_s: FloatArray) -> NDArray[np.intp]:
    """Return the samples after which a gap begins: at least one sample is missing."""
    return np.flatnonzero(np.diff(time_s) > GAP * median_step(time_s))


def time_jitter(time_s: FloatArray) -> float:
    """Return the largest deviation of a time step from the median step, relative to it, gaps left out."""
    relative = np.diff((time_s - time_s[0]) / median_step(time_s))
    return float(np.max(np.abs(relative[relative <= GAP] - 1.0), initial=0.0))


def _uneven_step(time_s: FloatArray) -> int | None:
    """Return the first k whose step t[k] - t[k-1] is off by more than 2 % and single-precision rounding, else None."""
    median, starts = median_step(time_s), range(0, len(time_s) - 1, PIECE)
    parts = (time_s[k : k + PIECE + 1] for k in starts)
    is_single = all(np.array_equal(part.astype(np.float32), part) for part in parts)
    largest = np.float32(max(abs(float(time_s.min())), abs(float(time_s.max()))))
    rounding = 2.0 * float(np.spacing(largest)) if is_single else 0.0
    for start in starts:
        step = np.diff(time_s[start : start + PIECE + 1])
        bad = np.abs(step - median) > UNEVEN * median + rounding
        if bad.any():
            return start + int(np.argmax(bad)) + 1
    return None


def is_uniform(time_s: FloatArray) -> bool:
    """Say whether the samples lie on a uniform grid."""
    return _uneven_step(time_s) is None


def is_long(log: FlightLog) -> bool:
    """Say whether a record is so long that windows of it are suggested."""
    return float(log.time_s[-1] - log.time_s[0]) > LONG_S


def advice_on_the_ground(
    log: FlightLog, from_s: float | None, to_s: float | None, *, suspects: Collection[str] = ()
) -> str | None:
    """Return a sentence where most of the window is on the ground, None elsewhere.

    Parameters
    ----------
    from_s, to_s : the window; None for the ends of the log.
    suspects : see `bfi_cli.flightlog.phases.phases_of`.
    """
    first, last = log.ends(from_s, to_s)
    phases = phases_of(log, suspects=suspects)
    if not shared((first, last), spans_of(phases, ("ground",))) > MOSTLY * (last - first):
        return None
    flown = [phase for phase in phases if phase.phase not in UNFIT]
    aloft = f" (in flight from {instant(flown[0].from_s)} to {instant(flown[-1].to_s)} s)" if flown else ""
    return (
        f"the aircraft is on the ground for most of the window, {instant(first)} to {instant(last)} s{aloft}: its "
        "airspeed is wind and noise, and the answer is not about a flight"
    )


def hold_of(log: FlightLog, values: FloatArray) -> Hold | None:
    """Return the clock of a held signal (n_samples,) of the log, NaN left out; None where it is not held."""
    finite = np.isfinite(values)
    known = values if finite.all() else values[finite]
    if not may_be_held(known):
        return None
    position = log.time_s - log.time_s[0]
    position /= median_step(log.time_s)
    return find_hold(known, position[finite])


def held_hz(log: FlightLog, channel: Channel) -> float | None:
    """Return the rate at which a held channel has new values, None for a channel that is not held.

    The rate of a signal with a separate clock is that of the file; otherwise the repeated values tell it.
    """
    if channel.own_rate_hz is not None and channel.own_rate_hz < AS_FAST * log.rate_hz:
        return channel.own_rate_hz
    hold = hold_of(log, channel.values)
    return None if hold is None else log.rate_hz / hold.period


def require_usable(log: FlightLog, names: Sequence[str], *, resampling: bool = False) -> None:
    """Check that the channels can be analysed.

    Parameters
    ----------
    names : standard names, or names in the file.
    resampling : the log is resampled afterwards, so an uneven time step and held samples do not matter.

    Raises
    ------
    LogError : a channel is missing, holds NaN or absurd values, repeats its values, or the time step is not uniform.
    """
    channels = [log.channel(name) for name in names]
    for channel in channels:
        values, place = channel.values, f"{log.path}: '{channel.name}' is"
        huge = np.flatnonzero(np.isfinite(values) & (np.abs(values) > LARGEST_VALUE))
        if huge.size:
            raise LogError(
                f"{place} no measurement at sample {huge[0]} ({instant(log.time_s[huge[0]])} s), got "
                f"{values[huge[0]]:.3g} {channel.unit}; choose a window without it with --from/--to"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise LogError(
                f"{place} not a number at sample {bad[0]} ({instant(log.time_s[bad[0]])} s), {bad.size} of "
                f"{log.n_samples} samples in all; choose a window without them with --from/--to"
            )
    if resampling:
        return
    k = _uneven_step(log.time_s)
    if k is not None:
        step = float(log.time_s[k] - log.time_s[k - 1])
        raise LogError(
            f"{log.path}: time step is not uniform: {step:.4g} s at sample {k}, {1.0 / log.rate_hz:.4g} s elsewhere; "
            "give --rate to resample, or cut the window with --from/--to"
        )
    for channel in channels:
        if (held := held_hz(log, channel)) is not None:
            rate, repeated = f"{held:.3g}", 100.0 * repeat_fraction(channel.values)
            raise LogError(
                f"{log.path}: '{channel.name}' repeats its value {repeated:.0f} % of the time (held samples, about "
                f"{rate} Hz); give --rate {rate} to decimate"
            )


def is_told_by_physics(log: FlightLog, outputs: Sequence[str]) -> bool:
    """Return whether physics may show a fault of an output: other channels bound it, or it may be frozen."""
    if not log.channels.keys().isdisjoint(INDEPENDENT):
        return True
    rests = (repeats(log.channels[name].values) for name in outputs if name in log.channels)
    return any(end - first >= FEWEST_REPEATS for spans in rests for first, end in spans)


def with_seen_recorder(log: FlightLog) -> FlightLog:
    """Return the log with the recorder's filter as its channels show it, unless the file states filters.

    Jumps of one quantum show kind and edge; if they are as sharp as the samples there is no filter. Without jumps, a
    common cut-off in the spectra of most channels shows a filter, whose kind and edge are then uncertain.
    """
    if log.filters is not None or not is_uniform(log.time_s):
        return log
    values = [channel.between(slice(0, MOST_SAMPLES)) for channel in log.channels.values()]
    if jumps := recorder_from_jumps(values, log.rate_hz):
        if jumps.kind is None or jumps.edge_hz is None:
            return replace(log, filters=())
        kind, edge_hz, source = jumps.kind, jumps.edge_hz, f"seen in {jumps.n_jumps} jumps of one quantum"
    elif spectra := recorder_from_spectra(values, log.rate_hz):
        others = ", ".join(f"{kind} {edge_hz:.3g} Hz" for kind, edge_hz in spectra.others)
        source = (
            f"uncertain: from the spectra of {spectra.n_channels} channels, which other kinds would fit with {others}"
        )
        kind, edge_hz = spectra.kind, spectra.edge_hz
    else:
        return log
    seen = Filter(kind=kind, edge_hz=edge_hz, rate_hz=log.rate_hz, source=source, uncertain=jumps is None)
    return replace(log, filters=(seen,))


def recorder_filters(
    log: FlightLog, edge_hz: float | str = "auto", kind: Kind | Literal["auto"] = "auto"
) -> tuple[tuple[Filter, ...], str]:
    """Return the filters that a fault of the aircraft went through, recorder first, and a sentence on the recorder.

    A stated filter is used even where the log shows another, which the sentence then mentions.

    Parameters
    ----------
    edge_hz : of the recorder; "none" for no filter, "auto" for what the log states or shows.
    kind : of the recorder; "auto" for what the log states or shows, a Gaussian where only the edge is known.
    """
    known = log.filters or ()
    later = tuple(low_pass for low_pass in known if low_pass.stage != "recorder")
    recorders = [low_pass for low_pass in known if low_pass.stage == "recorder"]
    if edge_hz == "none":
        return later, " ".join(
            f"no recorder's low-pass is assumed, as stated; {_contrary(low_pass)}" for low_pass in recorders
        )
    if not isinstance(edge_hz, str):
        shape: Kind = "gaussian" if kind == "auto" else kind
        rate_hz = later[0].rate_hz if later else log.rate_hz
        stated = Filter(kind=shape, edge_hz=edge_hz, rate_hz=rate_hz, source="as stated")
        contrary = [
            _contrary(low_pass) for low_pass in recorders if abs(low_pass.edge_hz - edge_hz) > SAME_EDGE * edge_hz
        ]
        return (stated, *later), "; ".join([_sentence(stated), *contrary])
    if kind != "auto":
        recorders = [replace(low_pass, kind=kind) for low_pass in recorders]
    if log.filters is None:
        return (), UNKNOWN
    return (*recorders, *later), " ".join(map(_sentence, recorders))


def _contrary(low_pass: Filter) -> str:
    return f"but the log has one ({low_pass.kind}, gain one half at {low_pass.edge_hz:.3g} Hz, {low_pass.source})"


def _sentence(low_pass: Filter) -> str:
    return (
        f"faults are taken through the recorder's low-pass ({low_pass.kind}, gain one half at "
        f"{low_pass.edge_hz:.3g} Hz, {low_pass.source}); --recorder states another"
    )
