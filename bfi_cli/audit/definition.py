"""A dictionary as it is written: what is defined twice, and what looks like something else in the window."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from ..channels import STANDARD
from ..faults import Fault, did_you_mean
from ..preprocessing.sampling_rate import SAMPLES_PER_CYCLE

__all__ = [
    "Span",
    "fastest_hz",
    "oddities",
    "same_definition",
    "span_of",
    "starts_in_lags",
    "unit_of",
    "unknown_channels",
]

MARGIN_S = 10.0
CYCLES = 3.0
TIME_CONSTANTS = 5.0
FEWEST_CYCLES = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A window, s; `rate_hz` of its samples and `lags` of the model, None where neither is chosen."""

    start_s: float
    stop_s: float
    rate_hz: float | None = None
    lags: int | None = None


def same_definition(faults: Sequence[Fault]) -> dict[int, int]:
    """Return, for each fault that is defined like an earlier one but for name and magnitude, the first such."""
    first: dict[Fault, int] = {}
    places = [first.setdefault(replace(fault, name=None, magnitude=1.0), j) for j, fault in enumerate(faults)]
    return {j: i for j, i in enumerate(places) if i != j}


def fastest_hz(faults: Sequence[Fault]) -> float | None:
    """Return the highest frequency among the faults, None where none oscillates."""
    return max((fault.frequency_hz for fault in faults if fault.frequency_hz is not None), default=None)


def span_of(faults: Sequence[Fault], from_s: float | None, *, from_zero: bool) -> Span:
    """Return a window that shows every fault: each until it ends or has unfolded, 10 s more.

    An oscillation has unfolded after three cycles, a lagged bias after five time constants, a ramp after its duration.

    Parameters
    ----------
    faults : not empty.
    from_s : where it starts, s; None to choose.
    from_zero : choose 0 s; else 10 s before the earliest onset, where that is later.
    """
    if from_s is None:
        from_s = 0.0 if from_zero else max(0.0, min(fault.onset_s for fault in faults) - MARGIN_S)
    return Span(start_s=from_s, stop_s=max(from_s, *map(_unfolded, faults)) + MARGIN_S)


def _unfolded(fault: Fault) -> float:
    if fault.offset_s is not None:
        return fault.offset_s
    cycles = CYCLES / fault.frequency_hz if fault.frequency_hz else 0.0
    return fault.onset_s + max(cycles, TIME_CONSTANTS * (fault.time_constant_s or 0.0), fault.duration_s or 0.0)


def oddities(fault: Fault, span: Span) -> Iterator[str]:
    """Say where a fault does not show its shape in a window: too short, too slow, too fast, or too early."""
    name = f"'{fault.name or fault.shape}'"
    stop_s = span.stop_s if fault.offset_s is None else min(fault.offset_s, span.stop_s)
    shown_s = stop_s - max(fault.onset_s, span.start_s)
    if fault.frequency_hz is not None and fault.frequency_hz * shown_s < FEWEST_CYCLES:
        cycles = f"{fault.frequency_hz * shown_s:.2g} of a cycle"
        yield f"{name} shows only {cycles} in the window and looks like a drift; widen the window"
    if fault.time_constant_s is not None and fault.time_constant_s > shown_s:
        settling = f"settles in {fault.time_constant_s:g} s but shows for {shown_s:.3g} s"
        yield f"{name} {settling} and looks like a drift; widen the window"
    if fault.duration_s is not None and fault.onset_s + fault.duration_s >= stop_s:
        yield f"{name} never holds in the window and looks like a drift; widen the window or shorten duration_s"
    if span.rate_hz is not None:
        yield from _against_the_rate(fault, span, span.rate_hz)


def _against_the_rate(fault: Fault, span: Span, rate_hz: float) -> Iterator[str]:
    name = f"'{fault.name or fault.shape}'"
    if fault.frequency_hz is not None and SAMPLES_PER_CYCLE * fault.frequency_hz > rate_hz * (1.0 + 1e-6):
        per_cycle = f"{rate_hz / fault.frequency_hz:.2g} samples per cycle at {rate_hz:.4g} Hz"
        yield f"{name} has only {per_cycle}; give --rate {SAMPLES_PER_CYCLE * fault.frequency_hz:.4g} or more"
    for word, seconds in (("settles", fault.time_constant_s), ("ends its ramp", fault.duration_s)):
        if seconds is not None and seconds * rate_hz < 1.0:
            yield f"{name} {word} within a sample at {rate_hz:.4g} Hz and looks like a bias; give a higher --rate"


def starts_in_lags(fault: Fault, span: Span) -> bool:
    """Say whether a fault starts after the window does, but before the first row of the model."""
    if span.lags is None or span.rate_hz is None:
        return False
    return 0.0 < (fault.onset_s - span.start_s) * span.rate_hz < span.lags


def unknown_channels(faults: Sequence[Fault]) -> list[str]:
    """Name the channels that are no standard ones, each once: without a log nothing else can be known of them."""
    names = dict.fromkeys(fault.channel for fault in faults if fault.channel not in STANDARD)
    return [f"'{name}' is no standard channel name{_hint(name)}" for name in names]


def _hint(channel: str) -> str:
    hint = did_you_mean(channel, list(STANDARD))
    return hint if "did you mean" in hint else "; the log must have it under that name"


def unit_of(channel: str) -> str:
    """Return the unit of a standard channel, "" of any other."""
    return STANDARD[channel].unit if channel in STANDARD else ""
