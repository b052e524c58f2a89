"""How well faults can be diagnosed: frozen data."""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels import FloatArray
from ..preprocessing.summary import LogSummary, ModelSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosedAtom:
    """One entry of the dictionary; numbers are None where it is left out, or nothing is known.

    Attributes
    ----------
    live : it can be looked for in the window; note : why not.
    magnitude : root mean square at which it is assessed; unit : of it.
    divergence_bits : information of the window on whether the fault is there, 0 to 1.
    sample_bits : divergence of single prediction errors from the onset on, as the paper compares them; None in a large
        dictionary too.
    minimal_detectable : magnitude declared with 90 % power if it is the only fault.
    most_like : the entry it is most easily taken for; apart_bits : information on which of the two it is, if it is this
        one and the other may have any size.
    """

    name: str
    channel: str
    live: bool
    note: str | None
    magnitude: float | None
    unit: str
    divergence_bits: float | None
    sample_bits: float | None
    minimal_detectable: float | None
    most_like: str | None
    apart_bits: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ManoeuvreScore:
    """A manoeuvre flown on a model, the mean over draws of the noise.

    Attributes
    ----------
    bits : mean over the faults of `DiagnosedAtom.apart_bits`; None where the flight could not be used.
    standard_error : of it over the draws; None for one draw.
    weakest : the fault with the least of these, and weakest_bits.
    divergence_bits, minimal_detectable : of each fault, in the order of the atoms.
    problem : why the flight could not be used.
    """

    name: str
    bits: float | None = None
    standard_error: float | None = None
    weakest: str | None = None
    weakest_bits: float | None = None
    divergence_bits: tuple[float | None, ...]
    minimal_detectable: tuple[float | None, ...]
    problem: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DiagnosabilityResult:
    """The whole answer of `bfi diagnosability`.

    Attributes
    ----------
    dictionary : where it was read from.
    draws : records behind the numbers: 1 for a log.
    in_limits : the magnitudes were given in minimal detectable ones.
    limit_deviations : how many standard deviations a minimal detectable magnitude is.
    atoms : every entry.
    between : (n_atoms, n_atoms) bits, NaN for entries left out.
    deviations, bits : (n,) information against magnitude over its standard deviation.
    manoeuvres : best first; best : the first one's name. Empty and None for a log.
    """

    log: LogSummary
    model: ModelSummary
    dictionary: str
    draws: int
    in_limits: bool
    limit_deviations: float
    atoms: tuple[DiagnosedAtom, ...]
    between: FloatArray
    deviations: FloatArray
    bits: FloatArray
    manoeuvres: tuple[ManoeuvreScore, ...]
    best: str | None
    notes: tuple[str, ...]
