"""Which faults of a dictionary are in a log, how large, how sure.

`identify_faults` prepares the window, runs a method of the registry (`methods`) and assembles the result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .identify import identify_faults

__all__ = ["identify_faults"]


def __getattr__(name: str) -> Any:
    """Import the analysis when it is first used: the configuration needs no more of this package than the registry."""
    if name == "identify_faults":
        from .identify import identify_faults

        return identify_faults
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
