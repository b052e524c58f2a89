"""Whether the channels of a log can be true together, in absolute terms, before anything is concluded from them.

Arithmetic alone tells a unit, a sign, an exchange of two channels, a clock that runs wrong and an error that is
constant over the flight: each relation between channels (`relations`) is held against the medians of pieces of the
flight, and where one fails throughout, the change of one channel is looked for that lets all of them hold (`search`).
What begins during a flight is a fault with an onset, and left to the analyses; a constant error is told beside what
they find, and is no fault of the flight (`bfi_cli.decision.conclude`).
"""

from ...decision.implausible import Implausible, in_words
from .implausible import implausible_channels, with_fixed_units, without_constant_errors

__all__ = ["Implausible", "implausible_channels", "in_words", "with_fixed_units", "without_constant_errors"]
