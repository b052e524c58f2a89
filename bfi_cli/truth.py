"""Declared faults against injected ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

__all__ = ["Comparison", "compare_faults"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What was declared against what was injected.

    Attributes
    ----------
    isolated : every injected fault was declared, and nothing else.
    false_alarms : names of the declared faults that were not injected.
    missed : names of the injected faults that were not declared.
    magnitude_error : norm of the error of all magnitudes over the norm of the injected ones, a fault that is absent
        counting 0; None where nothing was injected, or a fault that is no entry of the dictionary.
    """

    isolated: bool
    false_alarms: tuple[str, ...]
    missed: tuple[str, ...]
    magnitude_error: float | None


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
