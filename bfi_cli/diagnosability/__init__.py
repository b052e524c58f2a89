"""How well each fault of a dictionary can be seen, and told from the others, before there is one.

`signatures` fits one fault-free record, filters every fault through the fit and turns that into bits at given
magnitudes, `assess` makes the result of a log, and `manoeuvres` simulates flights of a model to compare manoeuvres.
"""

from .assess import DiagnosabilityResult, Magnitudes, assess, magnitudes_of
from .manoeuvres import ModelFlights, assess_manoeuvres, flights_of
from .report import diagnosability_content, diagnosability_document

__all__ = ["DiagnosabilityResult", "Magnitudes", "ModelFlights", "assess", "assess_manoeuvres"]
__all__ += ["diagnosability_content", "diagnosability_document", "flights_of", "magnitudes_of"]
