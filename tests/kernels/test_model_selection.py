"""The search over supports: it finds what a brute-force search finds, and the truth in noise."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from made_varx import dictionary, made, wave
from scipy import stats

from bfi_cli.kernels.lagged import compress, restrict
from bfi_cli.kernels.model_selection import (
    BACKWARD_LIMIT,
    Fit,
    Penalty,
    Visited,
    full_support,
    least_criterion,
    refine_supports,
    search_orders,
)
from bfi_cli.kernels.risro_varx import SparseStage, risro_varx, sparse_varx
from bfi_cli.kernels.variable_projection import fit_magnitudes, project_inputs, relaxed_bound

ORDER = 2
FLOOR = 1e-10
Z = np.array([1.0, 0.0, -2.0, 0.0, 1.5])


def problem_of(seed: int, z=Z, *, n: int = 250, n_y: int = 1, noise_sd: float = 0.1):
    rng = np.random.default_rng(seed)
    u, y = made(rng, order=ORDER, n_y=n_y).fly(n, rng, noise_sd=noise_sd)
    theta = dictionary(n, n_y=n_y, n_atoms=len(z))
    return project_inputs(compress(u, y + theta @ np.array(z), theta, order=ORDER), ORDER, floor=FLOOR)


def penalty_of(problem, n_candidates: int, *, evidence: float = 6.0, n_effective: float | None = None) -> Penalty:
    n = problem.n_rows
    return Penalty(n_rows=n, n_effective=n_effective or n, n_candidates=n_candidates, evidence=evidence)


def best_of(search: Visited) -> Fit:
    return least_criterion(search.values())


def search_order(problem, candidates, penalty, **limits) -> Visited:
    (search,) = search_orders([problem], candidates, penalty, **limits)
    return search


def start_of(problem, atoms) -> np.ndarray:
    return np.array([relaxed_bound(problem, None, atom)[1] for atom in atoms])


@pytest.mark.parametrize("seed", range(8))
def test_the_first_addition_is_the_best_of_all_single_ones(seed):
    """The relaxed fit is a true bound there, so what it spares cannot have been better."""
    problem = problem_of(seed, noise_sd=0.5)
    search = search_order(problem, range(5), penalty_of(problem, 5), max_active=1)
    fits = [
        fit_magnitudes(problem, (atom,), start)
        for atom in range(5)
        for start in (np.zeros(1), start_of(problem, (atom,)))
    ]
    best = min(fits, key=lambda fit: fit.log_det)
    assert min(scored.log_det for scored in search.values()) == pytest.approx(best.log_det, abs=1e-9)
    assert search.get(best.atoms) is not None


@pytest.mark.first_rows(2)
@pytest.mark.parametrize("seed", range(6))
def test_the_answer_is_that_of_trying_every_support(seed):
    problem = problem_of(seed)
    penalty = penalty_of(problem, 5)
    every = [support for size in range(6) for support in combinations(range(5), size)]
    brute = min(
        penalty.criterion(fit_magnitudes(problem, support, start))
        for support in every
        for start in (np.zeros(len(support)), Z[list(support)])
    )
    assert best_of(search_order(problem, range(5), penalty)).criterion == pytest.approx(brute, abs=1e-4)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(("n_y", "runs"), [(1, 8), (1, 20), (2, 20)])
def test_the_true_support_is_found_in_noise(n_y, runs):
    """Faults of ten and more deviations each; missing one in fifty supports would still be within the bound."""
    found = []
    for seed in range(runs):
        problem = problem_of(seed, n_y=n_y, noise_sd=0.05)
        found.append(best_of(search_order(problem, range(5), penalty_of(problem, 5))).atoms == (0, 2, 4))
    assert sum(found) >= stats.binom.ppf(1e-4, runs, 0.95)


@pytest.mark.slow
def test_fault_free_records_stay_fault_free():
    """An atom must bring log n + 2 log 5 + 6 = 14.7: chi-square of one has 1.3e-4 beyond, for each of five atoms."""
    alarms = []
    for seed in range(40):
        problem = problem_of(seed, np.zeros(5))
        alarms.append(best_of(search_order(problem, range(5), penalty_of(problem, 5))).atoms != ())
    assert sum(alarms) <= stats.binom.isf(1e-4, 40, 5 * stats.chi2.sf(14.7, 1))


def test_more_evidence_asked_for_never_brings_more_faults():
    problem = problem_of(3, [0.3, 0.1, -0.2, 0.05, 0.4], noise_sd=0.3)
    sizes = [
        len(best_of(search_order(problem, range(5), penalty_of(problem, 5, evidence=evidence))).atoms)
        for evidence in (0.0, 6.0, 20.0, 60.0, 1e4)
    ]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > sizes[-1] == 0


def test_the_criterion_is_the_sum_of_its_parts():
    problem = problem_of(0)
    fit = fit_magnitudes(problem, (0, 2))
    n = 100.0
    for extended, per_atom in ((True, 6.0 + 2 * np.log(5)), (False, 6.0)):
        penalty = Penalty(n_rows=problem.n_rows, n_effective=n, n_candidates=5, evidence=6.0, extended=extended)
        assert penalty.criterion(fit) == pytest.approx(n * fit.log_det + fit.n_parameters * np.log(n) + 2 * per_atom)
        assert penalty.per_atom == pytest.approx(per_atom)


@pytest.mark.parametrize("limit", [0, 1, 2, 5, 99])
def test_no_support_is_larger_than_asked_for(limit):
    problem = problem_of(1)
    search = search_order(problem, range(5), penalty_of(problem, 5), max_active=limit)
    assert max(len(scored.atoms) for scored in search.values()) <= limit
    assert len(best_of(search).atoms) == min(limit, 3)


def test_an_atom_that_stood_in_for_two_is_dropped_when_both_are_there():
    """The third looks like the sum of the first two and is taken first; no search from the full support helps here."""
    rng = np.random.default_rng(9)
    n = 300
    u, y = made(rng, order=ORDER).fly(n, rng, noise_sd=0.05)
    k = np.arange(n)
    a, b, c, d, other = (np.sin(frequency * k) * (k > 60) for frequency in (0.9, 1.3, 1.7, 2.1, 2.5))
    theta = np.stack([a, b, a + b + 0.3 * other, c, d], axis=1)[:, None, :]
    problem = project_inputs(compress(u, y + theta @ [1.0, 1.0, 0.0, 0.0, 0.0], theta, order=ORDER), ORDER, floor=FLOOR)
    search = search_order(problem, range(5), penalty_of(problem, 5), max_active=4)
    assert best_of(search).atoms == (0, 1)
    assert search.get((2,)) is not None


def test_no_candidates():
    problem = problem_of(2)
    search = search_order(problem, [], penalty_of(problem, 0))
    assert [scored.atoms for scored in search.values()] == [()]
    assert best_of(search).z.shape == (0,)


def test_candidates_left_out_are_never_visited():
    problem = problem_of(2)
    search = search_order(problem, [1, 3, 4], penalty_of(problem, 5))
    assert {atom for scored in search.values() for atom in scored.atoms} <= {1, 3, 4}
    assert 4 in best_of(search).atoms


def test_visits_are_of_distinct_supports_and_can_be_looked_up():
    problem = problem_of(4)
    search = search_order(problem, range(5), penalty_of(problem, 5))
    supports = [scored.atoms for scored in search.values()]
    assert len(set(supports)) == len(supports)
    assert all(list(support) == sorted(support) for support in supports)
    assert search[0, 2, 4] is best_of(search)
    assert search.get((0, 1, 2, 3, 4)) is not None
    assert search_order(problem, range(5), penalty_of(problem, 5), max_active=1).get((0, 1, 2)) is None


def test_a_large_fault_is_fitted_from_its_relaxed_magnitude_too():
    """From zero this drift ends in a worse maximum, in the search forward (no other starts here) and of all atoms."""
    rng = np.random.default_rng(6)
    u, y = made(rng, order=ORDER).fly(300, rng, noise_sd=0.1)
    drift = dictionary(300)[:, :, 2:]
    others = np.stack([wave(300, 60 + 8 * j, "step") for j in range(BACKWARD_LIMIT)], axis=1)[:, None, :]
    theta = np.concatenate([drift, others], axis=2)
    problem = project_inputs(compress(u, y + 20.0 * drift[:, :, 0], theta, order=ORDER), ORDER, floor=FLOOR)
    best = fit_magnitudes(problem, (0,), np.array([20.0])).log_det
    assert fit_magnitudes(problem, (0,)).log_det > best + 1.0
    penalty = penalty_of(problem, theta.shape[2])
    search = search_order(problem, range(theta.shape[2]), penalty, max_active=1)
    assert best_of(search).atoms == (0,)
    assert best_of(search).log_det == pytest.approx(best, abs=1e-6)
    assert full_support(problem, (0,), penalty).log_det == pytest.approx(best, abs=1e-6)


MANY = BACKWARD_LIMIT + 2


def oscillations(seed: int, *, noise_sd: float = 0.3):
    """Return u, y without a fault, and more oscillations (n, 1, MANY) than the search backward from all takes."""
    rng, k = np.random.default_rng(seed), np.arange(200)
    u, y = made(rng, order=ORDER).fly(len(k), rng, noise_sd=noise_sd)
    return u, y, np.stack([np.sin((0.2 + 0.09 * j) * k) * (k > 40 + 3 * j) for j in range(MANY)], axis=1)[:, None, :]


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("seed", [2, 3, 5])
def test_every_order_visits_the_best_support_of_every_other(seed):
    u, y, theta = oscillations(seed)
    data = compress(u, y + 0.5 * theta[:, :, 3] + 0.4 * theta[:, :, 9], theta, order=8)
    problems = [project_inputs(data, order, floor=FLOOR) for order in (1, 2, 8)]
    penalty = penalty_of(problems[0], MANY, evidence=2.0)
    alone = [search_order(problem, range(MANY), penalty) for problem in problems]
    leaders = [best_of(search).atoms for search in alone]
    together = search_orders(problems, range(MANY), penalty)
    assert None in [search.get(leader) for search in alone for leader in leaders]
    assert None not in [search.get(leader) for search in together for leader in leaders]
    for one, other in zip(together, alone, strict=True):
        assert best_of(one).criterion <= best_of(other).criterion


def test_two_atoms_that_only_help_together_are_found():
    """Their difference is the fault; what they share is far larger, so that neither alone pays for itself."""
    u, y, theta = oscillations(0, noise_sd=0.1)
    shared, fault = 10.0 * theta[:, :, 4], theta[:, :, 0].copy()
    theta[:, :, 0], theta[:, :, 1] = shared + fault, shared - fault
    theta[:, :, 4] = theta[:, :, 5]
    problem = project_inputs(compress(u, y + 0.4 * fault, theta, order=ORDER), ORDER, floor=FLOOR)
    search = search_order(problem, range(MANY), penalty_of(problem, MANY))
    assert best_of(search).atoms == (0, 1)
    first = min((scored for scored in search.values() if len(scored.atoms) == 1), key=lambda one: one.criterion)
    assert first.criterion > search[()].criterion


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("n_candidates", [BACKWARD_LIMIT, BACKWARD_LIMIT + 1])
def test_small_dictionaries_are_searched_from_all_atoms_too(n_candidates):
    u, y, theta = oscillations(1)
    problem = project_inputs(compress(u, y, theta, order=ORDER), ORDER, floor=FLOOR)
    search = search_order(problem, range(n_candidates), penalty_of(problem, n_candidates))
    assert (search.get(tuple(range(n_candidates))) is not None) == (n_candidates <= BACKWARD_LIMIT)


@pytest.mark.parametrize("n_y", [1, 2])
def test_a_support_leaves_two_rows_beside_its_parameters(n_y):
    problem = problem_of(0, np.zeros(5), n=14, n_y=n_y)
    regressors = 1 + ORDER + ORDER * n_y
    for n_rows in range(regressors + 2, regressors + 9):
        fit = full_support(
            problem, (0, 1, 2, 3, 4), Penalty(n_rows=n_rows, n_effective=9.0, n_candidates=5, evidence=0.0)
        )
        assert (fit is not None) == (n_rows - regressors - 5 >= 2)


def test_more_atoms_than_rows():
    """The support stays within what the rows can carry, and the answer is finite."""
    rng = np.random.default_rng(5)
    n, n_atoms = 24, 30
    u, y = made(rng, order=1).fly(n, rng, noise_sd=0.1)
    theta = np.zeros((n, 1, n_atoms))
    for j in range(n_atoms):
        theta[:, 0, j] = wave(n, 4 + j // 2, "step" if j % 2 else "wave")
    y = y + 5.0 * theta[:, :, 11]
    problem = project_inputs(compress(u, y, theta, order=1), 1, floor=FLOOR)
    search = search_order(problem, range(n_atoms), penalty_of(problem, n_atoms))
    assert 11 in best_of(search).atoms
    assert np.isfinite([scored.criterion for scored in search.values()]).all()
    assert max(len(scored.atoms) for scored in search.values()) < n - 4


def test_permuting_the_candidates_changes_nothing():
    problem = problem_of(6)
    one, other = (
        best_of(search_order(problem, order, penalty_of(problem, 5))) for order in (range(5), [4, 2, 0, 3, 1])
    )
    assert one.atoms == other.atoms
    np.testing.assert_allclose(one.z, other.z, rtol=1e-5)


def test_fewer_effective_rows_make_a_fault_harder_to_declare():
    problem = problem_of(7, [0.0, 0.0, 0.8, 0.0, 0.0], noise_sd=0.3)
    whole = search_order(problem, range(5), penalty_of(problem, 5, evidence=0.0))
    few = search_order(problem, range(5), penalty_of(problem, 5, evidence=0.0, n_effective=20.0))
    assert len(best_of(few).atoms) <= len(best_of(whole).atoms)
    assert len(best_of(whole).atoms) > 0


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("seed", range(6))
def test_what_the_stage_proposes_is_no_worse_than_the_exhaustive_search(seed):
    """Over three orders, with noise from a twentieth of to as large as the smallest fault."""
    rng, n = np.random.default_rng(seed), 250
    u, y = made(rng, order=ORDER).fly(n, rng, noise_sd=(0.05, 0.3, 1.0)[seed % 3])
    theta = dictionary(n, n_atoms=5)
    data = compress(u, y + theta @ (Z * rng.permutation([0.0, 1.0, 2.0, 1.0, 1.0])), theta, order=4)
    problems = [project_inputs(data, order, floor=FLOOR) for order in (1, 2, 4)]
    penalty = penalty_of(problems[0], 5)
    price = penalty.per_parameter + penalty.per_atom
    proposals = [
        (problem.order, support, went.z[list(support)])
        for problem in problems
        for went in sparse_varx(
            problem,
            risro_varx(restrict(data, order=problem.order)),
            n_atoms=5,
            stage=SparseStage(kind="exp-l0"),
            price=price,
        )
        for support in went.supports
    ]
    ours, agreed = refine_supports(problems, range(5), penalty, proposals=proposals)
    theirs = search_orders(problems, range(5), penalty)
    best, other = (min(best_of(search).criterion for search in searches) for searches in (ours, theirs))
    assert best <= other + 1e-6 or not agreed
    assert sum(len(search) for search in ours) < sum(len(search) for search in theirs)
    both = search_orders(problems, range(5), penalty, known=ours)
    assert min(best_of(search).criterion for search in both) <= min(best, other) + 1e-6


def test_from_no_proposal_the_neighbours_lead_to_the_answer():
    problem = problem_of(0)
    penalty = penalty_of(problem, 5)
    (search,), agreed = refine_supports([problem], range(5), penalty)
    assert not agreed
    assert best_of(search).atoms == (0, 2, 4)
    (limited,), _ = refine_supports([problem], range(5), penalty, max_active=1)
    assert len(best_of(limited).atoms) == 1
    proposal = (ORDER, (0, 1, 2, 3, 4), np.zeros(5))
    (dropped,), agreed = refine_supports([problem], range(5), penalty, proposals=[proposal], dropping_only=True)
    assert agreed
    assert best_of(dropped).atoms == (0, 2, 4)
