"""The flight in one command: every analysis of the air data that the log allows, and one verdict.

Finders propose events, and the flight model does (`proposals`); each is taken from where its fault begins (`placing`),
and with `weighing` one likelihood of all recorded channels (`judge`, on the model of `model` and `tables`) weighs it
against what ordinarily happens in flight. Windows ask `plausibility` alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..first_use import import_on_first_use

if TYPE_CHECKING:
    from .diagnose import diagnose_flight
    from .report import diagnose_content, diagnose_document
    from .result import DiagnoseResult, Event, FlightLimit

__all__ = ["DiagnoseResult", "Event", "FlightLimit", "diagnose_content", "diagnose_document", "diagnose_flight"]

__getattr__ = import_on_first_use(
    __name__,
    {
        "diagnose": ("diagnose_flight",),
        "report": ("diagnose_content", "diagnose_document"),
        "result": ("DiagnoseResult", "Event", "FlightLimit"),
    },
)
