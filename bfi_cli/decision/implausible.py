"""A channel that is wrong throughout a flight, and what would make it fit: frozen data."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from ..airdata import G

What = Literal["unit", "sign", "swapped", "clock", "offset", "scale", "unrelated", "impossible"]

# rad; the trim of a board that is mounted askew that an autopilot takes at most (ArduPilot, AHRS_TRIM_X: 0.1745).
ASKEW = math.radians(10.0)
# rad/s; the zero-rate output of a raw micromechanical gyro (MPU-6000 Product Specification, 6.1: 20 degrees/s).
ZERO_RATE = math.radians(20.0)
# By channel, in its unit, the largest constant error by where and how its sensor is mounted.
INSTALLATION: Mapping[str, float] = {
    **dict.fromkeys(("aoa", "sideslip", "pitch", "roll"), ASKEW),
    **dict.fromkeys(("pitch_rate", "roll_rate", "yaw_rate"), ZERO_RATE),
    **dict.fromkeys(("longitudinal_acc", "lateral_acc", "normal_acc"), G * math.sin(ASKEW)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A parameter of the autopilot that mends a channel.

    Attributes
    ----------
    name : of the parameter; present : its value as the log lists it.
    value, ci95 : to set, and its 95 % interval, None where that of the finding is not known.
    """

    name: str
    present: float
    value: float
    ci95: tuple[float, float] | None


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
    factor_ci95, offset_ci95 : 95 % intervals, None where they are not estimated.
    fixed : whether it was applied when the log was read (--fix-units), or is left out of a diagnosis.
    is_stated : whether it doubts a unit that the file or the user states: that is kept, and nothing depends on it.
    setting : of the autopilot that wrote the log, which would mend it; None where none is known.
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
    offset_ci95: tuple[float, float] | None = None
    fixed: bool = False
    is_stated: bool = False
    setting: Setting | None = None

    @property
    def sentence(self) -> str:
        """What to do about it, and why: "state the unit with --unit tas=kt: tas looks like kt, ..."."""
        return f"{self.advice}: {self.text}"

    @property
    def is_constant(self) -> bool:
        """Whether it is an error of size alone, from the first sample on: told beside what the flight shows."""
        return self.what in ("offset", "scale")

    @property
    def is_set_aside(self) -> bool:
        """Whether its channels say nothing of the flight, and no analysis uses them."""
        return self.what in ("unrelated", "impossible")

    @property
    def is_open(self) -> bool:
        """Whether nothing can be concluded before a unit, a sign, a place or the clock is stated."""
        return not (self.fixed or self.is_stated or self.is_constant or self.is_set_aside)

    @property
    def is_installation(self) -> bool:
        """Whether it is a constant error no larger than the mounting of a healthy sensor makes."""
        limits = [INSTALLATION.get(name, 0.0) for name in (*self.channels, *self.rivals)]
        return self.what == "offset" and abs(self.offset) <= min(limits, default=0.0)

    @property
    def is_certain(self) -> bool:
        """Whether it is a unit or a sign, of which a reader may be sure."""
        return self.what in ("unit", "sign") and not self.rivals


def in_words(findings: Sequence[Implausible]) -> str:
    """Return what to state first, and why."""
    return "; ".join(finding.sentence for finding in findings if not (finding.fixed or finding.is_stated))
