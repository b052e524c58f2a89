"""What may be wrong with channels throughout a flight, and the log without it: units, signs, offsets, scales, swaps."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain, combinations

from ...airdata.relations import State
from ...decision.implausible import What
from ...quantities.channels import CONVERSIONS, STANDARD, Conversion, conversion_of

# The likelier first: what is known by name, and then what fits whatever it is. Within a rank all are as likely.
RANKS: Mapping[What, int] = {"unit": 0, "sign": 0, "clock": 0, "swapped": 1, "offset": 2, "scale": 2}
SIGNED = (
    *("aoa", "pitch", "roll", "yaw", "pitch_rate", "roll_rate", "yaw_rate", "altitude_rate", "velocity_north"),
    *("velocity_east", "longitudinal_acc", "lateral_acc", "normal_acc", "flight_path_angle", "tas_rate", "sideslip"),
)
# Channels that one recorder states in one unit.
TOGETHER = (
    ("tas", "cas"),
    ("tas", "ias"),
    ("tas", "cas", "ias"),
    ("tas", "cas", "ias", "ground_speed"),
    ("pitch", "roll"),
    ("pitch", "roll", "yaw"),
    ("aoa", "pitch", "roll"),
    ("aoa", "pitch", "roll", "yaw"),
    ("pitch_rate", "roll_rate"),
    ("pitch_rate", "roll_rate", "yaw_rate"),
    ("longitudinal_acc", "normal_acc"),
    ("velocity_north", "velocity_east"),
    ("latitude", "longitude"),
    ("tat", "sat"),
)
# How many seconds a second of the time axis may be, and how that is said.
CLOCKS = {
    10.0: "ten times too fast",
    0.1: "ten times too slow",
    1e-3: "a thousand times too slow",
    1e3: "a thousand times too fast",
    -1.0: "backwards",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What would make channels fit: factor * reading + offset, or their places changed, or another clock.

    Attributes
    ----------
    channels : that are changed, () for the clock.
    unit : that the values are in, in the words of the command line, or how the clock runs; "" where that has no name.
    """

    what: What
    channels: tuple[str, ...]
    factor: float = 1.0
    offset: float = 0.0
    unit: str = ""

    @property
    def rank(self) -> int:
        """How likely it is before the log is asked, the likeliest 0."""
        return RANKS["scale" if self.what == "clock" and not self.unit else self.what]

    @property
    def is_constant(self) -> bool:
        """Whether it is an error of size alone."""
        return self.what in ("offset", "scale")

    def doubts_unit(self, stated: Mapping[str, str | None]) -> bool:
        """Return whether it gives a channel another unit than the one that is stated for it."""
        return self.what == "unit" and any(stated[name] for name in self.channels)

    def part(self, share: float) -> Change:
        """Return a share of it: an offset or a scale of so much less."""
        return replace(self, offset=share * self.offset, factor=1.0 + share * (self.factor - 1.0))

    def of(self, state: State) -> State:
        """Return the channels with the change."""
        values, rates = dict(state.values), dict(state.rates)
        if self.what == "clock":
            rates = {name: rate / self.factor for name, rate in rates.items()}
            return replace(state, values=values, rates=rates, time_s=state.time_s * abs(self.factor))
        if self.what == "swapped":
            first, other = self.channels
            for known in (values, rates):
                known[first], known[other] = known[other], known[first]
            return replace(state, values=values, rates=rates)
        for name in self.channels:
            if name in values:
                values[name] = self.factor * values[name] + self.offset
                rates[name] = self.factor * rates[name]
        return replace(state, values=values, rates=rates)


def unit_changes(channels: tuple[str, ...], stated: str | None) -> Iterator[Change]:
    """Yield what other units do to channels whose values are taken to be in the `stated` one, None for SI."""
    si = STANDARD[channels[0]].unit
    known = conversion_of(stated) if stated else Conversion(1.0, si)
    for conversion, spellings in CONVERSIONS:
        if conversion.si == si and (conversion.factor, conversion.offset) != (known.factor, known.offset):
            ratio = conversion.factor / known.factor
            shift = conversion.offset - ratio * known.offset
            yield Change(what="unit", channels=channels, factor=ratio, offset=shift, unit=spellings.split()[0])


def named_changes(suspects: Collection[str], known: Collection[str], stated: Mapping[str, str | None]) -> list[Change]:
    """Return the changes that have a name: of units, signs, places and the clock, of one channel or of several.

    Parameters
    ----------
    suspects : channels of relations that fail; known : all; stated : the units that the log states for them.
    """
    groups = [(name,) for name in suspects], (tuple(name for name in group if name in known) for group in TOGETHER)
    changes: list[Change] = []
    for members in dict.fromkeys(chain(*groups)):
        if set(members) & set(suspects) and len({stated[name] for name in members}) == 1:
            changes += unit_changes(members, stated[members[0]])
            if all(name in SIGNED for name in members):
                changes.append(Change(what="sign", channels=members, factor=-1.0))
    changes += [
        Change(what="swapped", channels=(name, other))
        for name, other in combinations(sorted(suspects), 2)
        if STANDARD[name].unit == STANDARD[other].unit
    ]
    changes += [Change(what="clock", channels=(), factor=factor, unit=words) for factor, words in CLOCKS.items()]
    return list(dict.fromkeys(changes))
