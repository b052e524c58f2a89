"""Similarity of the live atoms, and atoms that the model can absorb, with the sentences on both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.coherence import Dependence, dependence, homogeneous_order, mutual_coherence

# At this coherence the standard deviation of either magnitude is 1/sqrt(1 - 0.99^2) = 7 times that of the fault alone.
NEARLY_ALIKE = 0.99
# At this condition number some combination of unit signatures has a hundredth of the norm of the strongest one; named
# are the atoms whose coefficient in it is at least this share of the largest.
NEARLY_DEPENDENT, TAKES_PART = 100.0, 0.2
# Largest order of a homogeneous equation that is tried for a signal: a drift has order 2, an oscillation 2, their sum
# with a bias 5. Not tuned.
LARGEST_ORDER = 6
MOST_NAMED = 5  # entries in a sentence


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signatures:
    """Signatures of the live atoms: their signals, on a log filtered by its predictor and off its regressors.

    Attributes
    ----------
    names : (n_live,).
    time_s : (n_rows,); values : (n_rows, n_live), each on the channel that it moves most.
    coherence : (n_live, n_live), NaN for a signature that is zero.
    among : the linear dependence of the other signatures.
    """

    names: tuple[str, ...]
    time_s: FloatArray
    values: FloatArray
    coherence: FloatArray
    among: Dependence


def own_channel(theta: FloatArray) -> FloatArray:
    """Return (n_samples, n_atoms) of (n_samples, n_outputs, n_atoms): each atom on the output that it moves most."""
    outputs = np.argmax(np.max(np.abs(theta), axis=0), axis=0)
    return np.asarray(np.take_along_axis(theta, outputs[None, None, :], axis=1)[:, 0, :])


def compare(names: Sequence[str], time_s: FloatArray, values: FloatArray, G: FloatArray) -> Signatures:
    """Return the signatures with their coherence, and the linear dependence of those that are not zero.

    Parameters
    ----------
    names : (n_live,).
    time_s : (n_rows,); values : (n_rows, n_live), see `Signatures`.
    G : (n, n_live) columns of which the coherence is computed.
    """
    return Signatures(
        names=tuple(names),
        time_s=frozen_array(time_s),
        values=frozen_array(values),
        coherence=frozen_array(mutual_coherence(G)),
        among=dependence(G[:, np.any(G != 0.0, axis=0)]),
    )


def most_like(signatures: Signatures, j: int) -> tuple[str | None, float | None]:
    """Return the atom most coherent with the j-th, and the coherence; None where no other has a signature."""
    row = np.array(signatures.coherence[j])
    row[j] = np.nan
    if np.isnan(row).all():
        return None, None
    other = int(np.nanargmax(row))
    return signatures.names[other], float(row[other])


def pairs(names: Sequence[str], coherence: FloatArray, *, at_least: float = 0.0) -> list[tuple[str, str, float]]:
    """Return pairs of atoms and their coherence, most coherent first."""
    rows, columns = np.triu_indices(len(names), k=1)
    values = coherence[rows, columns]
    order = [n for n in np.argsort(-values, kind="stable") if values[n] >= at_least]
    return [(names[rows[n]], names[columns[n]], float(values[n])) for n in order]


def sentences(signatures: Signatures) -> list[str]:
    """Return warnings of pairs of atoms that are nearly alike, and of atoms that are nearly dependent."""
    alike, among = pairs(signatures.names, signatures.coherence, at_least=NEARLY_ALIKE), signatures.among
    warnings = [
        f"'{a}' and '{b}' can hardly be told apart (coherence {value:.4f}): drop one, or move an onset"
        for a, b, value in alike[:MOST_NAMED]
    ]
    if len(alike) > MOST_NAMED:
        warnings.append(f"{len(alike) - MOST_NAMED} more pairs have a coherence of {NEARLY_ALIKE} or more")
    if among.condition_number > NEARLY_DEPENDENT:
        seen = [name for name, c in zip(signatures.names, np.diag(signatures.coherence), strict=True) if c == c]
        share = np.abs(among.weakest) / np.max(np.abs(among.weakest))
        part = [f"'{seen[j]}'" for j in np.argsort(-share, kind="stable")[:MOST_NAMED] if share[j] >= TAKES_PART]
        warnings.append(
            f"the magnitudes of {', '.join(part)} cannot be told apart together (condition number "
            f"{among.condition_number:.3g}): drop some"
        )
    return warnings


def absorbed(name: str, signal: FloatArray, *, largest_model: int, n_outputs: int, when: str) -> str | None:
    """Return a warning that the model can take an atom for motion of the aircraft, None where it cannot.

    It can if the atom obeys a homogeneous equation of low order in all rows, without its onset or end among them.

    Parameters
    ----------
    signal : (n_samples,) the atom over the rows that the model is fitted to.
    largest_model : the largest order an analysis would try.
    n_outputs : of the model.
    when : the extent of `signal`, for the sentence.
    """
    order = homogeneous_order(signal, min(LARGEST_ORDER, largest_model - 1))
    if not order:
        return None
    limit = f"n + {order}" if n_outputs == 1 else f"(n + {order})/{n_outputs}"
    return (
        f"'{name}' obeys an equation of order {order} {when}, so the model can absorb it: it needs its onset or end "
        f"inside the window, or an order below {limit} (n states of the aircraft, longitudinally 4)"
    )


def advised(reasons: Mapping[int, str], values: FloatArray) -> dict[int, str]:
    """Return why atoms are left out, and for atoms that depend on others also the remedy.

    Parameters
    ----------
    reasons : sentence by atom.
    values : (n_samples, n_atoms) of all atoms.
    """
    changing = {j for j in reasons if homogeneous_order(values[:, j], 1) is None}
    return {j: f"{reason}; drop one, or move an onset" if j in changing else reason for j, reason in reasons.items()}
