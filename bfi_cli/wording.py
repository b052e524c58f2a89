"""Numbers and sentences as a reader of a table, a figure or a report sees them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .faults import FaultEstimate
from .identify.result import Candidate, IdentifyResult
from .printable import shortened
from .shapes import SHAPES

__all__ = [
    "axis_label",
    "describe",
    "instant",
    "interval",
    "number",
    "quantity",
    "shortened",
    "times",
    "verdict",
]

NAMED_LIMITS = 3


def number(value: float | None, *, spread: float | None = None, digits: int = 4, extra: int = 0) -> str:
    """Return `value` rounded as its precision allows, "-" if absent.

    Parameters
    ----------
    value : any number.
    spread : half the width of its interval; the last digit shown is the first digit of it.
    digits : significant digits where there is no spread.
    extra : digits shown beyond the first one of `spread`.
    """
    if value is None or not math.isfinite(value):
        return "-"
    if spread is None or not math.isfinite(spread) or spread <= 0.0:
        return _without_negative_zero(f"{value:.{digits}g}")
    decimals = extra - math.floor(math.log10(spread))
    return _without_negative_zero(f"{value:.{max(decimals, 0)}f}" if decimals <= 6 else f"{value:.6g}")


def _without_negative_zero(text: str) -> str:
    return text if text.strip("-0.") else text.removeprefix("-")


def instant(time_s: float) -> str:
    """Return a time in s to 10 ms where the axis counts from 1970, to six digits elsewhere."""
    return f"{time_s:.6g}" if abs(time_s) < 1e5 else f"{time_s:.2f}".rstrip("0").rstrip(".")


def quantity(value: float | None, unit: str) -> str:
    """Return a number to two significant digits with its unit; "-" if absent."""
    if value is None or not math.isfinite(value):
        return "-"
    shown = number(value, digits=2) if abs(value) < 100.0 else f"{value:.0f}"
    return f"{shown} {unit}".rstrip()


def interval(ci95: Sequence[float], *, joint: str = " to ", extra: int = 0) -> str:
    """Return "low to high", both rounded to the first digit of the half width; "-" where it is unknown."""
    low, high = ci95
    if not (math.isfinite(low) and math.isfinite(high)):
        return "-"
    spread = 0.5 * abs(high - low)
    return joint.join(number(value, spread=spread, extra=extra) for value in (low, high))


def axis_label(name: str, unit: str) -> str:
    """Return "name [unit]"; a log that states no unit is said to have none."""
    return f"{shortened(name, 28)} [{unit or 'unit not stated'}]"


def times(estimate: FaultEstimate) -> str:
    """Return when the fault acts: "from 13.8 s", "from 40 s to 60 s"."""
    fault = estimate.fault
    until = "" if fault.offset_s is None else f" to {instant(fault.offset_s)} s"
    return f"from {instant(fault.onset_s)} s{until}"


def describe(estimate: FaultEstimate) -> str:
    """Return one fault in words: "a bias of 4.00 m/s (95 % interval 3.99 to 4.02) on tas from 13.8 s"."""
    low, high = physical_interval(estimate)
    unit = f" {estimate.physical_unit}".rstrip()
    value = number(estimate.physical_value, spread=0.5 * (high - low))
    within = f" (95 % interval {interval((low, high))})" if math.isfinite(high - low) else " (interval unknown)"
    return f"a {_shape(estimate)} of {value}{unit}{within} on {shortened(estimate.fault.channel, 40)} {times(estimate)}"


def physical_interval(estimate: FaultEstimate) -> tuple[float, float]:
    """Return the 95 % interval of the physical value (the magnitude's, scaled alike)."""
    scale = estimate.physical_value / estimate.magnitude if estimate.magnitude else 1.0
    low, high = sorted(scale * bound for bound in estimate.ci95)
    return low, high


def _shape(estimate: FaultEstimate) -> str:
    fault = estimate.fault
    word = SHAPES[fault.shape].label
    return word if fault.frequency_hz is None else f"{fault.frequency_hz:.4g} Hz {word}"


def verdict(result: IdentifyResult) -> str:
    """Return the answer in one sentence, with what it could not have seen."""
    if result.decision == "not_identifiable":
        reason = result.notes[0] if result.notes else "no reason was recorded"
        return f"This log cannot tell: {reason.rstrip('.')}."
    if result.decision == "no_fault":
        return f"No fault of the dictionary is present; {_would_have_been_found(result.candidates)}."
    if len(result.faults) == 1:
        return f"Fault: {describe(result.faults[0])}."
    return f"{len(result.faults)} faults: {'; '.join(describe(estimate) for estimate in result.faults)}."


def _would_have_been_found(candidates: Sequence[Candidate]) -> str:
    limits = [
        f"{shortened(candidate.name, 40)} larger than {quantity(candidate.minimal_detectable, candidate.unit)}"
        for candidate in candidates
        if candidate.minimal_detectable is not None and math.isfinite(candidate.minimal_detectable)
    ]
    if not limits:
        return "how large a fault would have been found is not known"
    if len(limits) == 1:
        return f"a {limits[0]} would have been found (90 % power)"
    named = limits[:NAMED_LIMITS]
    more = f"; {len(limits) - len(named)} more in the table" if len(limits) > len(named) else ""
    return f"{', '.join(named[:-1])} or {named[-1]} would have been found (90 % power each, if alone{more})"
