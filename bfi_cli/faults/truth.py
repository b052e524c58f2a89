"""Declared faults against injected ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .fault import Fault, FaultEstimate, fault_to_dict


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What was declared against what was injected.

    Attributes
    ----------
    isolated : every injected fault was declared, and nothing else.
    false_alarms : names of the declared faults that were not injected.
    missed : names of the injected faults that were not declared.
    magnitude_error : norm of the error of all magnitudes over the norm of the injected ones, a fault that is absent
        counting 0; None where nothing was injected, or a fault that no declared one could be.
    vaf_fault : by output the variance accounted for of the fault, %; None where there is no fault in the window.
    """

    isolated: bool
    false_alarms: tuple[str, ...]
    missed: tuple[str, ...]
    magnitude_error: float | None
    vaf_fault: Mapping[str, float | None] = field(default_factory=dict)


def compare_faults(
    declared: Mapping[str, float], injected: Mapping[str, float], *, unknown: Sequence[str] = ()
) -> Comparison:
    """Compare magnitudes by name of fault.

    Parameters
    ----------
    declared, injected : magnitude by name of the dictionary's entry.
    unknown : injected faults that are no entry of the dictionary, and so are missed by any answer.
    """
    missed = (*(name for name in injected if name not in declared), *unknown)
    extra = tuple(name for name in declared if name not in injected)
    error = None
    if injected and not unknown:
        difference = [declared.get(name, 0.0) - injected.get(name, 0.0) for name in {**injected, **declared}]
        error = float(np.linalg.norm(difference) / np.linalg.norm(list(injected.values())))
    return Comparison(isolated=not missed and not extra, false_alarms=extra, missed=missed, magnitude_error=error)


def name_of(injected: Fault) -> str:
    """Return the name of an injected fault, or what tells it from the others of the log."""
    on = f", channel={injected.channel}" if injected.channel else ""
    return injected.name or f"{injected.shape}{on}, onset_s={injected.onset_s:g}"


def is_same_fault(first: Fault, second: Fault) -> bool:
    """Say whether two faults have the same definition but for name and magnitude, times on the same axis."""

    def definition(fault: Fault) -> dict[str, Any]:
        # A cabin that no altitude is given of is held at sea level.
        at = {"cabin_altitude_m": fault.cabin_altitude_m or 0.0}
        return {**fault_to_dict(fault), **at, "name": None, "magnitude": None}

    return definition(first) == definition(second)


def compare_by_onset(declared: Sequence[FaultEstimate], injected: Sequence[Fault], *, tolerance_s: float) -> Comparison:
    """Compare faults of which the onset was estimated with injected ones of the same shape, channel and onset.

    Parameters
    ----------
    declared : of different names.
    injected : on the same time axis; signs do not count, since half a period turns that of an oscillation.
    tolerance_s : onsets that differ by no more are the same.
    """
    sizes = {estimate.name: abs(estimate.magnitude) for estimate in declared}
    paired: dict[str, float] = {}
    unknown: list[str] = []
    for fault in injected:
        place = (fault.shape, fault.channel)
        rest = [estimate for estimate in declared if estimate.name not in paired]
        same = [estimate for estimate in rest if (estimate.fault.shape, estimate.fault.channel) == place]
        near = (estimate.name for estimate in same if abs(estimate.fault.onset_s - fault.onset_s) <= tolerance_s)
        if (name := next(near, None)) is not None:
            paired[name] = abs(fault.magnitude)
        else:
            unknown.append(name_of(fault))
    return compare_faults(sizes, paired, unknown=unknown)
