"""How well each fault of a dictionary can be seen, and told from the others, before there is one.

`measured` is what one fault-free record says of the dictionary, `judged` turns it into bits at the magnitudes of
`sizes`, `manoeuvres` flies a model to find the manoeuvre that shows most.
"""

from .assessing import assess
from .document import diagnosability_document
from .exhibit import diagnosability_exhibit
from .manoeuvres import Flights, assess_manoeuvres, flights_of
from .result import DiagnosabilityResult
from .sizes import Sizes, sizes_of

__all__ = [
    "DiagnosabilityResult",
    "Flights",
    "Sizes",
    "assess",
    "assess_manoeuvres",
    "diagnosability_document",
    "diagnosability_exhibit",
    "flights_of",
    "sizes_of",
]
