"""What an explanation of a place is worth, and what a fault is worth beside the best ordinary one."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from ..kernels import BoolArray, FloatArray
from ..kernels.bounded_filter import BOUND, bounded_log_density
from .bench import Place, jump
from .tables import MANOEUVRE

# Ten to one: what explains a place as well as the best but for this is told with it.
ALIKE = float(np.log(10.0))
LIKEST = 0.95  # correlation of neighbours that a minute of readings tells from one without an end
# Log density over the best ordinary explanation above which a fault is declared: none of 14 healthy flights of seven
# aircraft has one of its own proposals above it (tests/measurements/test_judge.py).
DECLARED = 20.0
# Times as much, above which what a finder only suspects is declared: twice what a healthy light aircraft showed.
SURE = 15.0
# A channel speaks against a fault by this share of all that is said, and at least by so much log density.
LOUD, AUDIBLE = 0.05, 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Weight:
    """What a fault is worth at a place.

    Attributes
    ----------
    margin : its log density over that of the best ordinary explanation.
    shares : of it by channel, largest first.
    size, sd : of the error at its end, in the unit of its channel; of a pitot line the logarithm of what is left of the
        impact pressure, of a static line m of height. sd is None where it is not known.
    growth_s : seconds within which it grows, None of a pressure line.
    refused : why it can be none, "" where it can.
    dispersion : twice the loss of a measurement of its channels while it lasts, in the mean; 1 of what it describes to
        their noise.
    memory_s : for which its errors last, 1 where each is of its own: readings within that say the same.
    heats : whether the static temperature is made of a total one and the Mach number that a line shows.
    """

    fault: str
    margin: float
    shares: Mapping[str, float]
    size: float
    sd: float | None = None
    growth_s: float | None = None
    refused: str = ""
    dispersion: float = 1.0
    memory_s: float = 1.0
    heats: bool = False

    @property
    def rank(self) -> tuple[bool, float]:
        """By which the best of some is the largest: one that can be none is behind all others."""
        return not self.refused, self.margin

    @property
    def repeated(self) -> float:
        """How many times its log densities say the same: what they have to be divided by."""
        return self.dispersion * self.memory_s

    @property
    def wide_sd(self) -> float | None:
        """Standard deviation of its size, wider by what its course leaves unexplained, and for how long."""
        return None if self.sd is None else self.sd * float(np.sqrt(self.repeated))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ordinary:
    """The best explanation of a place without a fault.

    Attributes
    ----------
    log_density, innovation, sd : (n, n_rows), of the rows given what came before.
    mean : (n, n_states).
    shocks : (n, n_states) variances of the jumps that it asks for.
    cause : an ordinary cause, "" for none; gain : log density that it is worth, lead : over any other cause.
    """

    log_density: FloatArray
    innovation: FloatArray
    sd: FloatArray
    mean: FloatArray
    shocks: FloatArray
    cause: str
    gain: float
    lead: float

    @property
    def log_likelihood(self) -> float:
        """Log density of the part."""
        return float(np.nansum(self.log_density))


def beside(place: Place, ordinary: Ordinary, rows: Collection[str]) -> FloatArray:
    """Return (n, n_states) variances of what may happen beside a fault of some rows.

    The jumps of the best ordinary explanation, but for those that the rows of the fault would show: they are its
    rivals. A manoeuvre goes with any fault.
    """
    model = place.bench.model
    shocks = ordinary.shocks.copy()
    loads = np.abs(model.Z[place.part][:, [model.row(name) for name in rows]]).max(axis=(0, 1), initial=0.0)
    for k, name in enumerate(model.states):
        if loads[k] > 0.0 and name not in MANOEUVRE:
            shocks[:, k] = 0.0
    return np.maximum(shocks, jump(place, place.onset, MANOEUVRE))


def against(place: Place, ordinary: Ordinary, log_density: FloatArray) -> tuple[float, dict[str, float]]:
    """Return the margin of (n, n_rows) log densities over the ordinary ones, and each channel's share of it."""
    by_row = np.nansum(log_density - ordinary.log_density, axis=0)
    shares: dict[str, float] = {}
    for name, value in zip(place.bench.model.rows, by_row, strict=True):
        channel = "ground_speed" if name.startswith("velocity") else name
        shares[channel] = shares.get(channel, 0.0) + float(value)
    order = sorted(shares.items(), key=lambda share: -abs(share[1]))
    return float(by_row.sum()), dict(order)


def dispersion(place: Place, innovation: FloatArray, rows: Collection[str]) -> float:
    """Return twice the bounded loss of a measurement of some rows while a fault lasts, in the mean, at least 1."""
    size = np.abs(innovation[place.during][:, [place.bench.model.row(name) for name in rows]])
    inside = np.minimum(size, BOUND)
    losses = inside * (2.0 * size - inside)
    return max(1.0, float(np.nanmean(losses))) if np.isfinite(losses).any() else 1.0


def memory(place: Place, innovation: FloatArray, rows: Collection[str]) -> float:
    """Return for how many seconds errors of some rows last while a fault does, as those of a process of first order.

    Their mean is known as well as that of n / memory independent ones: (1 + r) / (1 - r) with the correlation r of
    neighbours.
    """
    size = np.clip(innovation[place.during][:, [place.bench.model.row(name) for name in rows]], -BOUND, BOUND)
    squares, products = np.nansum(size**2), np.nansum(size[1:] * size[:-1])
    r = float(np.clip(products / squares, 0.0, LIKEST)) if squares > 0.0 else 0.0
    return (1.0 + r) / (1.0 - r)


def floored_density(
    ordinary: Ordinary, density: FloatArray, innovation: FloatArray, sd: FloatArray, floored: BoolArray
) -> FloatArray:
    """Return log densities in which no sample is predicted with less noise than in flight.

    A line that rests is smoother than a flight; that it is must not be worth anything by itself.
    """

    def effective(innovation: FloatArray, sd: FloatArray) -> FloatArray:
        return sd * np.maximum(np.abs(innovation) / BOUND, 1.0)

    mine, flight = effective(innovation, sd), effective(ordinary.innovation, ordinary.sd)
    low = floored & (mine < flight)
    with np.errstate(invalid="ignore"):
        raised = bounded_log_density(innovation * mine / flight, np.where(low, flight, 1.0))
    return np.where(low, raised, density)


def refuting(weight: Weight) -> tuple[str, ...]:
    """Return the channels that speak against a fault, the loudest first."""
    total = sum(abs(value) for value in weight.shares.values())
    return tuple(name for name, value in weight.shares.items() if value < -max(LOUD * total, AUDIBLE))
