"""The flight in one command: every analysis of the air data that the log allows, and one verdict.

Finders propose events; with `weighing` one likelihood of all recorded channels (`judge`, on the flight model of `model`
and `tables`) weighs each of them against what ordinarily happens in flight.
"""

from .diagnose import diagnose_flight
from .report import diagnose_content, diagnose_document
from .result import DiagnoseResult, Event, FlightLimit

__all__ = ["DiagnoseResult", "Event", "FlightLimit", "diagnose_content", "diagnose_document"]
__all__ += ["diagnose_flight"]
