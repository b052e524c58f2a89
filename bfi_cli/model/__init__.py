"""Which faults of a dictionary are in a log, how large, how sure.

`identify_faults` prepares the window, runs a method of the registry (`methods`) and assembles the result; `identify`
has its steps, for an analysis that concludes from more than one source.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..first_use import import_on_first_use

if TYPE_CHECKING:
    from .identify import Identification, conclusion_of, identification, identify_faults, result_of
    from .result import IdentifyResult, ScanSummary
    from .shared_model import with_those_that_share

__all__ = ["Identification", "IdentifyResult", "ScanSummary", "conclusion_of", "identification", "identify_faults"]
__all__ += ["result_of", "with_those_that_share"]

# The configuration needs no more of this package than the registry.
__getattr__ = import_on_first_use(
    __name__,
    {
        "identify": ("Identification", "conclusion_of", "identification", "identify_faults", "result_of"),
        "result": ("IdentifyResult", "ScanSummary"),
        "shared_model": ("with_those_that_share",),
    },
)
