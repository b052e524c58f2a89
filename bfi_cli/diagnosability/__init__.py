"""Diagnosability: how well each fault of a dictionary can be seen, and told from the others, before one occurs.

`signatures` fits one fault-free record, filters every fault through the fit and computes divergences in bits at given
magnitudes; `assess` does so for a log, or for simulated flights of a model to compare manoeuvres.
"""

from .assess import DiagnosabilityResult, assess, assess_manoeuvres, flown
from .report import diagnosability_content, diagnosability_document

__all__ = ["DiagnosabilityResult", "assess", "assess_manoeuvres", "diagnosability_content", "diagnosability_document"]
__all__ += ["flown"]
