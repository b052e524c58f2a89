"""The dictionary's entries with what is said of each: the same layout with and without a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..faults import Fault, magnitude_unit, physical
from .comparison import absorbed, most_like
from .definition import Span, oddities, same_definition, starts_in_lags
from .result import AuditedAtom, Signatures

__all__ = ["Limits", "Listing", "entries", "largest_order", "reasons_of", "remarks_of"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Listing:
    """All entries and what is known of each.

    Attributes
    ----------
    faults, names, units : (n_atoms,) with the unit of each fault's channel.
    reasons : why an entry is left out; remarks : what is odd about one that is live; by index.
    """

    faults: tuple[Fault, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    reasons: Mapping[int, str]
    remarks: Mapping[int, Sequence[str]]

    @property
    def live(self) -> tuple[int, ...]:
        return tuple(j for j in range(len(self.faults)) if j not in self.reasons)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """Of the live atoms on a log, (n_live,): what can be detected (NaN where nothing is seen) and what is visible.

    Attributes
    ----------
    minimal_detectable : magnitudes; peak : the most each moves its output at magnitude 1.
    visible : see `AuditedAtom`.
    """

    minimal_detectable: FloatArray
    peak: FloatArray
    visible: FloatArray


def reasons_of(faults: Sequence[Fault], names: Sequence[str], reasons: Mapping[int, str]) -> dict[int, str]:
    """Return the reasons, those of an entry whose twin by definition is live in words of the definition."""
    twins = {j: i for j, i in same_definition(faults).items() if j in reasons and i not in reasons}
    worded = {j: f"'{names[j]}' is defined as '{names[i]}' is; drop one of them" for j, i in twins.items()}
    return {**reasons, **worded}


def largest_order(config: Config) -> int:
    """Return the largest order an analysis with this configuration tries."""
    return config.model.order if isinstance(config.model.order, int) else max(config.model.orders)


def remarks_of(
    faults: Mapping[int, Fault], span: Span, values: FloatArray | None, *, largest_model: int, n_outputs: int
) -> dict[int, list[str]]:
    """Return what is odd about each live fault, by index; faults with nothing odd have no entry.

    Parameters
    ----------
    faults : the live ones, by index.
    span : the window.
    values : (n_samples, n_live) on their own channels; None where there are too many to look at.
    largest_model, n_outputs : see `absorbed`.
    """
    remarks: dict[int, list[str]] = {}
    for n, (j, fault) in enumerate(faults.items()):
        said, name = list(oddities(fault, span)), fault.name or fault.shape
        lost = f"the first {span.lags} samples, which the model's lags use up"
        early, taken = starts_in_lags(fault, span), None
        if values is not None:
            when = f"after {lost}" if early else "over the whole window"
            taken = absorbed(name, values[:, n], largest_model=largest_model, n_outputs=n_outputs, when=when)
        if taken is not None:
            said.append(taken)
        elif early:
            said.append(f"'{name}' starts within {lost}; start the window earlier")
        if said:
            remarks[j] = said
    return remarks


def entries(listing: Listing, signatures: Signatures | None, limits: Limits | None) -> tuple[AuditedAtom, ...]:
    """Return one entry per fault of the dictionary, in its order."""
    place = {j: n for n, j in enumerate(listing.live)}
    atoms = []
    for j, (fault, name, unit) in enumerate(zip(listing.faults, listing.names, listing.units, strict=True)):
        n = place.get(j)
        said = [listing.reasons[j]] if n is None else listing.remarks.get(j, ())
        other, coherence = (None, None) if signatures is None or n is None else most_like(signatures, n)
        z = peak = visible = None
        if limits is not None and n is not None:
            visible = float(limits.visible[n])
            if np.isfinite(limits.minimal_detectable[n]):
                z = float(limits.minimal_detectable[n])
                peak = z * float(limits.peak[n])
        atoms.append(
            AuditedAtom(
                name=name,
                fault=fault,
                live=n is not None,
                note="; ".join(said) or None,
                unit=magnitude_unit(fault, unit),
                channel_unit=unit,
                minimal_detectable=z,
                minimal_physical=None if z is None else physical(fault, z, unit),
                minimal_peak=peak,
                visible=visible,
                most_coherent_with=other,
                coherence=coherence,
            )
        )
    return tuple(atoms)
