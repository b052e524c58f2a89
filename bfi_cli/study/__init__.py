"""A window of a log made ready for an analysis: checked, conditioned, scaled, factorised once."""

from .intake import Intake, lowpass_of, take_in
from .scaled import Study, feasible_orders, floor_of, left_out, prepare, study_of

__all__ = ["Intake", "Study", "feasible_orders", "floor_of", "left_out", "lowpass_of", "prepare", "study_of", "take_in"]
