"""A channel that the others contradict throughout a flight, and what would make it fit: frozen data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

What = Literal["unit", "sign", "swapped", "clock", "offset", "scale"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Implausible:
    """Channels that others contradict throughout a flight.

    Attributes
    ----------
    channels : that are to blame, () for the time axis.
    what : is wrong with them; unit : what they are in, or how the clock runs, "" where that has no name.
    factor, offset : factor * reading + offset fits; of the clock how many seconds one of its seconds is.
    agrees_with : the channels that agree with them then.
    relative_misfit : what is left of the difference, over what is expected.
    rivals : channels that could be to blame in their place.
    text, advice : that in words, and what to do about it.
    factor_ci95 : 95 % interval of the factor, None where it is not estimated.
    fixed : whether it was applied: when the log was read (--fix-units), or as a fault that a diagnosis leaves out.
    """

    channels: tuple[str, ...]
    what: What
    unit: str
    factor: float
    offset: float
    agrees_with: tuple[str, ...]
    relative_misfit: float
    rivals: tuple[str, ...]
    text: str
    advice: str
    factor_ci95: tuple[float, float] | None = None
    fixed: bool = False

    @property
    def is_constant(self) -> bool:
        """Whether it is an error of size alone, which a model fitted to the window absorbs."""
        return self.what in ("offset", "scale")

    @property
    def is_certain(self) -> bool:
        """Whether it is a unit or a sign, of which a reader may be sure."""
        return self.what in ("unit", "sign") and not self.rivals


def in_words(findings: Sequence[Implausible]) -> str:
    """Return what to state first, and why: "state the unit with --unit tas=kt: tas looks like kt, ..."."""
    return "; ".join(f"{one.advice}: {one.text}" for one in findings if not one.fixed)
