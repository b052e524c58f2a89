"""Many logs in one call: which they are, the answers as they come and as they are kept, the tables and the index."""

from .answers import LogAnswer, answer_of_diagnosis, answer_of_info, unread_document
from .logs import FleetLog, is_fleet, logs_of
from .results import fleet_files, fleet_names, remove_other_format
from .running import Outcome, Task, run_fleet
from .store import Store

__all__ = ["FleetLog", "LogAnswer", "Outcome", "Store", "Task", "answer_of_diagnosis", "answer_of_info"]
__all__ += ["fleet_files", "fleet_names", "is_fleet", "logs_of", "remove_other_format", "run_fleet"]
__all__ += ["unread_document"]
