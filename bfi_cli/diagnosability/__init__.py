"""How well each fault of a dictionary can be seen, and told from the others, before there is one.

`signatures` fits one fault-free record and filters every fault through the fit, `divergence` turns that into bits at
given magnitudes, `assess` makes the result of a log, and `manoeuvres` flies a model to find the manoeuvre that shows
most.
"""

from .assess import Magnitudes, assess, magnitudes_of
from .manoeuvres import ModelFlights, assess_manoeuvres, flights_of
from .report import diagnosability_content, diagnosability_document
from .result import DiagnosabilityResult

__all__ = [
    "DiagnosabilityResult",
    "Magnitudes",
    "ModelFlights",
    "assess",
    "assess_manoeuvres",
    "diagnosability_content",
    "diagnosability_document",
    "flights_of",
    "magnitudes_of",
]
