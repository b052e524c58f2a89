"""The flight in one command: every analysis of the air data that the log allows, and one verdict.

Finders propose events; with `weighing` one likelihood of all recorded channels (`judge`, on the flight model of `model`
and `tables`) weighs each of them against what ordinarily happens in flight.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .diagnose import diagnose_flight
    from .report import diagnose_content, diagnose_document
    from .result import DiagnoseResult, Event, FlightLimit

_HOME = {
    "diagnose": ("diagnose_flight",),
    "report": ("diagnose_content", "diagnose_document"),
    "result": ("DiagnoseResult", "Event", "FlightLimit"),
}

__all__ = ["DiagnoseResult", "Event", "FlightLimit", "diagnose_content", "diagnose_document"]
__all__ += ["diagnose_flight"]


def __getattr__(name: str) -> Any:
    """Import a name when it is first used: analyses of a window ask `plausibility` alone."""
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
