"""The magnitudes at which faults are assessed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..errors import ConfigError
from ..faults import did_you_mean

__all__ = ["UNIT", "Sizes", "sizes_of"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Root mean square of the magnitude of each fault.

    Attributes
    ----------
    common : of those not named.
    named : by name of the entry.
    in_limits : they count in minimal detectable magnitudes, each fault in its own; else in the magnitude's unit.

    Raises
    ------
    ConfigError : a magnitude is not a positive number.
    """

    common: float = 1.0
    named: Mapping[str, float] = field(default_factory=dict)
    in_limits: bool = False

    def __post_init__(self) -> None:
        for value in (self.common, *self.named.values()):
            if not (np.isfinite(value) and value > 0.0):
                raise ConfigError(
                    f"--magnitude: must be positive, got {value:g}; it is a root mean square, sign included"
                )

    def magnitudes(self, names: Sequence[str], limits: FloatArray) -> FloatArray:
        """Return (n_atoms,) magnitudes; not finite where they count in limits and there is none.

        Parameters
        ----------
        names : of the entries; limits : (n_atoms,) their minimal detectable magnitudes.

        Raises
        ------
        ConfigError : a name is none of the dictionary's.
        """
        for name in self.named:
            if name not in names:
                raise ConfigError(f"--magnitude: no entry of the dictionary, got '{name}'{did_you_mean(name, names)}")
        sizes = np.array([self.named.get(name, self.common) for name in names])
        return sizes * limits if self.in_limits else sizes


UNIT = Sizes()


def sizes_of(config: Config) -> Sizes:
    """Return the magnitudes a configuration states."""
    stated = config.diagnosability
    return Sizes(common=stated.magnitude, named=stated.magnitudes, in_limits=stated.at_limit)
