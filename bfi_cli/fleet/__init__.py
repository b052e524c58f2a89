"""Many logs in one call: which they are, the answers as they come and as they are kept, the tables and the index."""

from .answers import LogAnswer, answer_of_diagnosis, answer_of_info, rows_of_constants, unread_document
from .logs import FleetLog, is_fleet, logs_of
from .results import fleet_files, fleet_names, remove_left_over
from .running import Outcome, Task, run_fleet
from .store import Store
from .tables import columns_of_answers
from .trends import sentence_of_trend, trends_of

__all__ = ["FleetLog", "LogAnswer", "Outcome", "Store", "Task", "answer_of_diagnosis", "answer_of_info"]
__all__ += ["columns_of_answers", "fleet_files", "fleet_names", "is_fleet", "logs_of", "remove_left_over"]
__all__ += ["rows_of_constants", "run_fleet", "sentence_of_trend", "trends_of", "unread_document"]
