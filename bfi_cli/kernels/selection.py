"""Support and order chosen together by an extended Bayesian information criterion (METHOD section 3).

Chen and Chen (2008) for the criterion; an atom must lower it by `evidence`, on the scale of twice the log Bayes factor
(Jeffreys 1961: ten to one, or 4.6, is strong evidence).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bilinear import Bilinear, Fit, fit_magnitudes, relaxed
from .progress import Report, Step, parts, shares, silent, steps

__all__ = ["Penalty", "Scored", "Search", "full_support", "search_orders"]

FloatArray = NDArray[np.float64]

BACKWARD_LIMIT = 24
PATIENCE = 2
MARGIN = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Penalty:
    """What a fit must pay.

    Attributes
    ----------
    n_rows : rows the likelihood sums over.
    n_effective : independent ones among them, at most n_rows.
    n_candidates : atoms to choose from.
    evidence : fall of the criterion an atom must bring on top of its dimension.
    extended : charge 2 log n_candidates per atom.
    """

    n_rows: int
    n_effective: float
    n_candidates: int
    evidence: float
    extended: bool = True

    @property
    def per_parameter(self) -> float:
        return float(np.log(self.n_effective))

    @property
    def per_atom(self) -> float:
        """On top of `per_parameter`."""
        return self.evidence + (2.0 * float(np.log(max(self.n_candidates, 1))) if self.extended else 0.0)

    def criterion(self, fit: Fit) -> float:
        """Return the criterion of a fit; smaller is better."""
        cost = fit.n_parameters * self.per_parameter + len(fit.atoms) * self.per_atom
        return self.n_effective * fit.log_det + cost


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """A fit and its criterion."""

    criterion: float
    fit: Fit


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Every support visited at one order, the best visit of each."""

    order: int
    visited: tuple[Scored, ...]

    @property
    def best(self) -> Scored:
        return min(self.visited, key=lambda scored: scored.criterion)

    def of(self, atoms: Iterable[int]) -> Scored | None:
        """Return the visit of a support, None where it was not visited."""
        wanted = tuple(sorted(atoms))
        return next((scored for scored in self.visited if scored.fit.atoms == wanted), None)


def search_orders(
    problems: Sequence[Bilinear],
    candidates: Sequence[int],
    penalty: Penalty,
    *,
    max_active: int | None = None,
    report: Report = silent,
) -> tuple[Search, ...]:
    """Search supports at every order: forward from none, backward from all (of a small dictionary) and from the best.

    Each order then starts again from the best answers of the others: a model with lags to spare can absorb an
    oscillation, and what it settles at from zero may be a poor local maximum that a tighter model does not have.

    Parameters
    ----------
    problems : one per order, on the same rows.
    candidates : live atoms.
    penalty : the criterion.
    max_active : largest support; None for all candidates.
    report : told how far it is.
    """
    exploring, comparing = shares(report, 3, 1)
    # Of an order nobody knows how many fits it takes: adding PATIENCE atoms that do not help tries each so often.
    about = (PATIENCE + 1) * len(candidates) + 1
    every = []
    for problem, of_order in parts(exploring, problems):
        every.append(_Visits(problem, penalty, steps(of_order, about)))
        _explore(every[-1], candidates, max_active)
    leaders = [visits.search().best.fit for visits in every]
    for (visits, own), of_order in parts(comparing, list(zip(every, leaders, strict=True))):
        visits.step = steps(of_order, about)
        for leader in leaders:
            if leader is not own and leader.atoms:
                _backward(visits, visits.visit(leader.atoms, [leader.z]), visits.limit)
    return tuple(visits.search() for visits in every)


def full_support(problem: Bilinear, atoms: tuple[int, ...], penalty: Penalty) -> Scored | None:
    """Return the fit of all atoms at once, None where the rows do not suffice."""
    if len(atoms) > _room(problem, penalty.n_rows):
        return None
    return _Visits(problem, penalty, steps(silent, 1)).full(atoms)


def _explore(visits: _Visits, candidates: Sequence[int], max_active: int | None) -> None:
    room = _room(visits.problem, visits.penalty.n_rows)
    limit = min(len(candidates) if max_active is None else max_active, len(candidates), room)
    forward = _forward(visits, candidates, limit)
    if len(candidates) <= min(BACKWARD_LIMIT, room):
        _backward(visits, visits.full(tuple(candidates)), limit)
    _backward(visits, forward, limit)
    visits.limit = limit


def _room(problem: Bilinear, n_rows: int) -> int:
    """How many magnitudes the rows leave room for beside the predictor."""
    return max(0, n_rows - problem.n_base - problem.order * problem.n_outputs - 2)


class _Visits:
    """Fits of one order, each support's best remembered."""

    def __init__(self, problem: Bilinear, penalty: Penalty, step: Step) -> None:
        self.step = step
        self.problem = problem
        self.penalty = penalty
        self.limit = 0
        self.scored: dict[tuple[int, ...], Scored] = {}

    def search(self) -> Search:
        """Return what was visited within the limit on the number of active atoms."""
        allowed = (scored for scored in self.scored.values() if len(scored.fit.atoms) <= self.limit)
        return Search(order=self.problem.order, visited=tuple(allowed))

    def visit(self, atoms: tuple[int, ...], starts: Iterable[Sequence[float] | FloatArray]) -> Scored:
        """Fit a support (ascending) from several starts."""
        for start in starts:
            self.step()
            fit = fit_magnitudes(self.problem, atoms, np.asarray(start, dtype=np.float64))
            known = self.scored.get(atoms)
            if known is None or fit.log_det < known.fit.log_det:
                self.scored[atoms] = Scored(criterion=self.penalty.criterion(fit), fit=fit)
        return self.scored[atoms]

    def relaxed(self, base: Fit | None, atom: int) -> tuple[float, float]:
        """Free the lags of an atom, see `relaxed`."""
        self.step()
        return relaxed(self.problem, base, atom)

    def add(self, base: Fit, atom: int, magnitude: float) -> Scored:
        """Fit `base` with one more atom, from zero and from its relaxed magnitude."""
        atoms = tuple(sorted((*base.atoms, atom)))
        known = dict(zip(base.atoms, base.z, strict=True))
        return self.visit(atoms, ([(known | {atom: m})[a] for a in atoms] for m in (0.0, magnitude)))

    def drop(self, base: Fit, atom: int) -> Scored:
        """Fit `base` without one of its atoms."""
        kept = [j for j, a in enumerate(base.atoms) if a != atom]
        return self.visit(tuple(base.atoms[j] for j in kept), [base.z[kept]])

    def full(self, atoms: tuple[int, ...]) -> Scored:
        """Fit all atoms at once, from zero and from the magnitudes of the relaxed problem."""
        guess = [self.relaxed(None, atom)[1] for atom in atoms]
        return self.visit(atoms, [np.zeros(len(atoms)), guess])


def _forward(visits: _Visits, candidates: Sequence[int], limit: int) -> Scored:
    best = current = visits.visit((), [[]])
    since = 0
    while len(current.fit.atoms) < limit and since < PATIENCE:
        current = _best_addition(visits, current.fit, candidates)
        since = 0 if current.criterion < best.criterion else since + 1
        best = min(best, current, key=lambda scored: scored.criterion)
    return best


def _best_addition(visits: _Visits, base: Fit, candidates: Sequence[int]) -> Scored:
    """Return the best single addition; atoms whose relaxed fit is worse than the best found are not fitted."""
    bounds = [(*visits.relaxed(base, atom), atom) for atom in candidates if atom not in base.atoms]
    best: Scored | None = None
    for bound, magnitude, atom in sorted(bounds):
        if best is not None and bound > best.fit.log_det + MARGIN:
            break
        trial = visits.add(base, atom, magnitude)
        if best is None or trial.fit.log_det < best.fit.log_det:
            best = trial
    assert best is not None
    return best


def _backward(visits: _Visits, start: Scored, limit: int) -> None:
    current, since = start, 0
    best = start.criterion
    while current.fit.atoms and (since < PATIENCE or len(current.fit.atoms) > limit):
        base = current.fit
        current = min((visits.drop(base, atom) for atom in base.atoms), key=lambda scored: scored.criterion)
        since = 0 if current.criterion < best else since + 1
        best = min(best, current.criterion) if len(current.fit.atoms) <= limit else current.criterion
