"""The recorder's low-pass, as stated by the file or the user, or as identified from the log."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from ..faults.filters import Filter
from ..kernels.low_pass import Kind
from ..kernels.recorder_response import recorder_from_jumps, recorder_from_spectra
from .quality import is_uniform
from .record import FlightLog

# Samples that are looked at: three hours at 10 Hz hold hundreds of jumps.
MOST_SAMPLES = 108_000
# Relative difference of two edges beyond which they contradict each other: the accuracy of the spectra.
SAME_EDGE = 0.2
UNKNOWN = "it is unknown whether the recorder low-passed the log; no low-pass is assumed (--recorder HZ states one)"


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
