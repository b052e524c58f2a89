"""What is known of the recorder's low-pass: stated by the file or the user, or seen in the log itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from ..filters import Filter
from ..kernels.low_pass import Kind
from ..kernels.recorder_response import recorder_from_jumps
from .quality import is_uniform
from .record import FlightLog

__all__ = ["recorder_filters", "with_seen_recorder"]

# Samples that are enough to see hundreds of jumps: three hours at 10 Hz.
MOST_SAMPLES = 108_000


def with_seen_recorder(log: FlightLog) -> FlightLog:
    """Return the log with the recorder's filter where jumps of one quantum show it, unless its file states filters.

    Jumps that are as sharp as the samples say that there is none.
    """
    if log.filters is not None or not is_uniform(log.time_s):
        return log
    values = [channel.values[:MOST_SAMPLES] for channel in log.channels.values()]
    seen = recorder_from_jumps(values, log.rate_hz)
    if seen is None:
        return log
    if seen.kind is None or seen.edge_hz is None:
        return replace(log, filters=())
    source = f"seen in {seen.n_jumps} jumps of one quantum"
    return replace(log, filters=(Filter(kind=seen.kind, edge_hz=seen.edge_hz, rate_hz=log.rate_hz, source=source),))


def recorder_filters(
    log: FlightLog, edge_hz: float | str = "auto", kind: Kind | Literal["auto"] = "auto"
) -> tuple[tuple[Filter, ...], str]:
    """Return the filters that a fault of the aircraft went through, recorder first, and a sentence on the recorder.

    Parameters
    ----------
    edge_hz : of the recorder; "none" for no filter, "auto" for what the log states or shows.
    kind : of the recorder; "auto" for what the log states or shows, a Gaussian where only the edge is known.
    """
    known = log.filters or ()
    later = tuple(one for one in known if one.stage != "recorder")
    if edge_hz == "none":
        return later, ""
    if not isinstance(edge_hz, str):
        shape: Kind = "gaussian" if kind == "auto" else kind
        rate_hz = later[0].rate_hz if later else log.rate_hz
        stated = Filter(kind=shape, edge_hz=edge_hz, rate_hz=rate_hz, source="as stated")
        return (stated, *later), _sentence(stated)
    recorders = [one for one in known if one.stage == "recorder"]
    if kind != "auto":
        recorders = [replace(one, kind=kind) for one in recorders]
    return (*recorders, *later), " ".join(map(_sentence, recorders))


def _sentence(one: Filter) -> str:
    return (
        f"faults are taken through the recorder's low-pass ({one.kind}, gain one half at {one.edge_hz:.3g} Hz, "
        f"{one.source}); --recorder states another"
    )
