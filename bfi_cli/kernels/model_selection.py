"""Support and order chosen together by an extended Bayesian information criterion.

Chen and Chen (2008) for the criterion; an atom must lower it by `evidence`, on the scale of twice the log Bayes factor
(Jeffreys 1961: ten to one, or 4.6, is strong evidence).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations
from operator import attrgetter

import numpy as np

from . import FloatArray
from .progress import Report, Step, parts, shares, silent, steps
from .variable_projection import Fit, ProjectedRegression, fit_magnitudes, linear_additions, relaxed_bound

# The search backward from all candidates costs their number squared in fits, so only small dictionaries afford it.
BACKWARD_LIMIT = 24
# Steps forward or backward without a better criterion before a search ends: two atoms may help only together.
PATIENCE = 2
# Additions to a support that are fitted, those that gain the most to first order, which may rank two alike wrongly.
ADDITIONS = 3
# Atoms whose removal is fitted: those that cost the least to first order.
REMOVALS = 3
# log det by which a relaxed fit must be worse than the best addition before no further one is tried: round-off.
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

    @property
    def per_fault(self) -> float:
        """Fall of the criterion that one more atom needs, its magnitude included."""
        return self.per_parameter + self.per_atom

    def criterion(self, fit: Fit) -> float:
        """Return the criterion of a fit; smaller is better."""
        cost = fit.n_parameters * self.per_parameter + len(fit.atoms) * self.per_atom
        return self.n_effective * fit.log_det + cost

    def scored(self, fit: Fit) -> Fit:
        """Return a fit with its criterion."""
        return replace(fit, criterion=self.criterion(fit))


def least_criterion(scored: Iterable[Fit]) -> Fit:
    """Return the fit with the least criterion."""
    return min(scored, key=attrgetter("criterion"))


# A support (ascending) to score at an order, its first number, and its magnitudes to start from.
Proposal = tuple[int, tuple[int, ...], FloatArray]
# Every support (ascending) visited at one order, the best visit of each.
Visited = Mapping[tuple[int, ...], Fit]


def search_orders(
    problems: Sequence[ProjectedRegression],
    candidates: Sequence[int],
    penalty: Penalty,
    *,
    max_active: int | None = None,
    known: Sequence[Visited] = (),
    report: Report = silent,
) -> tuple[Visited, ...]:
    """Search supports at every order: forward from none, backward from all (of a small dictionary) and from the best.

    Each order then starts again from the best fits of the others: a model with lags to spare can absorb an
    oscillation, and what it reaches from zero may be a poor local maximum that a tighter model does not have.

    Parameters
    ----------
    problems : one per order, on the same rows.
    candidates : live atoms.
    penalty : the criterion.
    max_active : largest support; None for all candidates.
    known : what was visited before.
    report : called with the fraction that is done.
    """
    exploring, comparing = shares(report, 3, 1)
    # Nobody knows how many fits an order takes: adding PATIENCE atoms that do not help tries each so often.
    about = (PATIENCE + 1) * len(candidates) + 1
    every = _visits(problems, candidates, penalty, max_active, known)
    for visits, part_report in parts(exploring, every):
        visits.step = steps(part_report, about)
        forward = visits.search_forward(candidates)
        if len(candidates) <= min(BACKWARD_LIMIT, visits.room):
            visits.search_backward(visits.fit_all(tuple(candidates)))
        visits.search_backward(forward)
    leaders = [visits.best for visits in every]
    for (visits, best), part_report in parts(comparing, list(zip(every, leaders, strict=True))):
        visits.step = steps(part_report, about)
        for leader in leaders:
            if leader is not best and leader.atoms:
                visits.search_backward(visits.visit(leader.atoms, [leader.z]))
    return tuple(visits.allowed for visits in every)


def refine_supports(
    problems: Sequence[ProjectedRegression],
    candidates: Sequence[int],
    penalty: Penalty,
    *,
    proposals: Sequence[Proposal] = (),
    known: Sequence[Visited] = (),
    max_active: int | None = None,
    dropping_only: bool = False,
) -> tuple[tuple[Visited, ...], bool]:
    """Score proposed supports at every order, and go from the best to a neighbour as long as one is better.

    Neighbours are the supports without one of its atoms, and unless `dropping_only` those with one more and with one,
    or two, exchanged for another, the most promising of either to first order.

    Parameters
    ----------
    problems, candidates, penalty, max_active : as in `search_orders`.
    proposals : supports to score first.
    known : what was visited before.

    Returns
    -------
    searches : by order.
    agreed : the best support was proposed, or is part of a proposed one.
    """
    every = _visits(problems, candidates, penalty, max_active, known)
    for visits in every:
        visits.visit((), [[]])
        for order, atoms, z in proposals:
            if order == visits.problem.order and len(atoms) <= visits.room:
                visited = visits.visit(atoms, [z])
                if len(atoms) > visits.limit:
                    visits.search_backward(visited)
    agreed, seen = True, set()
    while True:
        best = least_criterion(visits.best for visits in every)
        for visits in every:
            if best.atoms not in visits.scored and len(best.atoms) <= visits.limit:
                visits.visit(best.atoms, [best.z])
        at = min(every, key=lambda visits: visits.best.criterion)
        best = at.best
        if (at.problem.order, best.atoms) in seen:
            return tuple(visits.allowed for visits in every), agreed
        seen.add((at.problem.order, best.atoms))
        at.search_backward(best)
        if dropping_only or at.best is not best:
            continue
        for visits in every:
            # An atom more may pay at an order at which the support itself is worse by less than its price.
            same = visits.scored.get(best.atoms)
            if same and same.criterion < best.criterion + penalty.per_fault:
                visits.search_beside(same, candidates, exchanging=visits is at)
        agreed = agreed and min(visits.best.criterion for visits in every) == best.criterion


def full_support(problem: ProjectedRegression, atoms: tuple[int, ...], penalty: Penalty) -> Fit | None:
    """Return the fit of all atoms at once, None where the rows do not suffice."""
    visits = _Visits(problem, penalty, len(atoms))
    return visits.fit_all(atoms) if len(atoms) <= visits.room else None


class _Visits:
    """Fits of one order, each support's best remembered.

    `room` is the number of magnitudes that the rows can carry beside the predictor, `limit` the largest support that
    may be the answer.
    """

    def __init__(self, problem: ProjectedRegression, penalty: Penalty, limit: int, known: Sequence[Fit] = ()) -> None:
        self.problem, self.penalty = problem, penalty
        self.room = max(0, penalty.n_rows - problem.n_base - problem.order * problem.n_outputs - 2)
        self.limit = min(limit, self.room)
        self.scored = {fit.atoms: penalty.scored(fit) for fit in known}
        self.step: Step = steps(silent, 1)

    @property
    def allowed(self) -> Visited:
        """What was visited within the limit on the number of active atoms."""
        return {atoms: scored for atoms, scored in self.scored.items() if len(atoms) <= self.limit}

    @property
    def best(self) -> Fit:
        return least_criterion(self.allowed.values())

    def visit(self, atoms: tuple[int, ...], starts: Iterable[Sequence[float] | FloatArray]) -> Fit:
        """Fit a support (ascending) from several starts."""
        for start in starts:
            self.step()
            fit = fit_magnitudes(self.problem, atoms, np.asarray(start, dtype=np.float64))
            known = self.scored.get(atoms)
            if known is None or fit.log_det < known.log_det:
                self.scored[atoms] = self.penalty.scored(fit)
        return self.scored[atoms]

    def bound(self, base: Fit | None, atom: int) -> tuple[float, float]:
        """Return criterion and magnitude of the relaxed problem, see `relaxed_bound`."""
        self.step()
        return relaxed_bound(self.problem, base, atom)

    def fit_all(self, atoms: tuple[int, ...]) -> Fit:
        """Fit all atoms at once, from zero and from the magnitudes of the relaxed problem."""
        guess = [self.bound(None, atom)[1] for atom in atoms]
        return self.visit(atoms, [np.zeros(len(atoms)), guess])

    def search_forward(self, candidates: Sequence[int]) -> Fit:
        """Add the best atom again and again, from none; return the best support on the way."""
        best = current = self.visit((), [[]])
        since = 0
        while len(current.atoms) < self.limit and since < PATIENCE:
            current = self.best_addition(current, candidates)
            since = 0 if current.criterion < best.criterion else since + 1
            best = least_criterion((best, current))
        return best

    def best_addition(self, base: Fit, candidates: Sequence[int]) -> Fit:
        """Return the best single addition, each fitted from zero and from its relaxed magnitude.

        Atoms whose relaxed fit is worse than the best addition so far are not fitted.
        """
        known = dict(zip(base.atoms, base.z, strict=True))
        bounds = [(*self.bound(base, atom), atom) for atom in candidates if atom not in known]
        best: Fit | None = None
        for bound, magnitude, atom in sorted(bounds):
            if best is not None and bound > best.log_det + MARGIN:
                break
            atoms = tuple(sorted((*base.atoms, atom)))
            starts = ([(known | {atom: start})[a] for a in atoms] for start in (0.0, magnitude))
            trial = self.visit(atoms, starts)
            if best is None or trial.log_det < best.log_det:
                best = trial
        assert best is not None
        return best

    def search_beside(self, fit: Fit, candidates: Sequence[int], *, exchanging: bool) -> None:
        """Visit the most promising supports with one atom more, and with one atom, or two, exchanged for another.

        For an exchange, the supports without these atoms are visited first where they were not yet.
        """
        for leaving in chain(*(combinations(fit.atoms, n) for n in ((0, 1, 2) if exchanging else (0,)))):
            base = fit
            for atom in leaving:
                j = base.atoms.index(atom)
                base = self.scored.get(base.atoms[:j] + base.atoms[j + 1 :]) or self.without(base, j)
            others = [atom for atom in candidates if atom not in leaving and atom not in base.atoms]
            if not others or len(base.atoms) >= self.limit:
                continue
            gains, magnitudes = linear_additions(self.problem, base, others)
            for n in np.argsort(-gains)[: 1 if leaving else ADDITIONS]:
                together = dict(zip((*base.atoms, others[n]), (*base.z, magnitudes[n]), strict=True))
                atoms = tuple(sorted(together))
                if atoms not in self.scored:
                    self.visit(atoms, [[together[atom] for atom in atoms]])

    def without(self, fit: Fit, j: int) -> Fit:
        """Visit the support of a fit less its j-th atom, from what the others are to first order.

        A support that was visited from elsewhere is visited again: that may have ended in a poorer maximum.
        """
        atoms, covariance = fit.atoms[:j] + fit.atoms[j + 1 :], fit.covariance
        share = fit.z[j] / covariance[j, j] if covariance[j, j] > 0.0 else 0.0
        return self.visit(atoms, [np.delete(fit.z - share * covariance[:, j], j)])

    def search_backward(self, start: Fit) -> None:
        """Drop the least atom again and again."""
        current, since, best = start, 0, start.criterion
        while current.atoms and (since < PATIENCE or len(current.atoms) > self.limit):
            fit, variance = current, np.diag(current.covariance)
            costs = np.divide(fit.z**2, variance, out=np.zeros(len(fit.z)), where=variance > 0.0)
            current = least_criterion(self.without(fit, j) for j in np.argsort(costs)[:REMOVALS].tolist())
            since = 0 if current.criterion < best else since + 1
            best = min(best, current.criterion) if len(current.atoms) <= self.limit else current.criterion


def _visits(
    problems: Sequence[ProjectedRegression],
    candidates: Sequence[int],
    penalty: Penalty,
    max_active: int | None,
    known: Sequence[Visited],
) -> list[_Visits]:
    """Return the visits of every order, with what is known of it."""
    limit = len(candidates) if max_active is None else min(max_active, len(candidates))
    fits = [list(visited.values()) for visited in known] or [[] for _ in problems]
    return [_Visits(problem, penalty, limit, order_fits) for problem, order_fits in zip(problems, fits, strict=True)]
