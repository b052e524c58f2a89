"""The Jensen-Shannon divergence: known answers, bounds, invariances, and Monte Carlo against quadrature."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import plain_density as plain
import pytest
from scipy import stats
from scipy.integrate import quad

from bfi_cli.kernels.divergence import (
    Density,
    draw,
    gaussian_density,
    jensen_shannon_montecarlo,
    jensen_shannon_quadrature,
    kernel_density,
)

rng = np.random.default_rng(11)
DENSITIES = {
    "normal": kernel_density(rng.standard_normal(80)),
    "wide": kernel_density(rng.normal(0.5, 3.0, 80)),
    "two humps": kernel_density(np.concatenate([rng.normal(-4.0, 0.2, 40), rng.normal(3.0, 1.0, 40)])),
    "heavy": kernel_density(rng.standard_t(2, 80), exponent=None),
    "gaussian": gaussian_density(rng.normal(1.0, 0.5, 80)),
}
each_pair = pytest.mark.parametrize(("first", "second"), list(combinations(DENSITIES, 2)))


def kernels(*pairs: tuple[float, float]) -> Density:
    centres, widths = np.array(pairs).T
    return Density(samples=centres, bandwidths=widths, pilot_bandwidth=1.0, exponent=0.0)


def of_gaussians(shift: float, ratio: float) -> float:
    """J of N(0, 1) and N(shift, ratio^2) in bits, piece by piece."""

    def height(x: float) -> float:
        p, q = stats.norm.logpdf(x), stats.norm.logpdf(x, shift, ratio)
        mean = np.logaddexp(p, q) - np.log(2.0)
        return float(0.5 * (np.exp(p) * (p - mean) + np.exp(q) * (q - mean)) / np.log(2.0))

    near = [n * unit + centre for n in (-12, -4, -1, 0, 1, 4, 12) for unit, centre in ((1.0, 0.0), (ratio, shift))]
    edges = sorted({-40.0, 40.0, *near})
    return sum(quad(height, a, b, epsabs=1e-13, epsrel=1e-13)[0] for a, b in pairwise(edges))


@pytest.mark.parametrize(
    ("shift", "ratio"), [(0.01, 1.0), (1.0, 1.0), (3.0, 1.0), (0.0, 2.0), (0.0, 0.01), (2.0, 0.3), (15.0, 1.0)]
)
def test_gaussians(shift: float, ratio: float):
    found = jensen_shannon_quadrature(kernels((0.0, 1.0)), kernels((shift, ratio)))
    assert found == pytest.approx(of_gaussians(shift, ratio), abs=1e-9, rel=1e-9)


def test_a_small_shift_costs_its_square_over_eight():
    """J = Fisher information x shift^2 / 8 to the leading order, in nats."""
    shift = 1e-3
    found = jensen_shannon_quadrature(kernels((0.0, 1.0)), kernels((shift, 1.0)))
    assert found == pytest.approx(shift**2 / (8.0 * np.log(2.0)), rel=1e-4)


@pytest.mark.parametrize("width", [1.0, 1e-4])
@pytest.mark.parametrize("far", [40.0, 1e4])
def test_a_narrow_kernel_far_away_is_not_missed(width: float, far: float):
    """q is p for one half and nothing that p knows for the other: J is a number of four logarithms."""
    found = jensen_shannon_quadrature(kernels((0.0, 1.0)), kernels((0.0, 1.0), (far, width)))
    assert found == pytest.approx(0.5 * np.log2(4 / 3) + 0.25 * np.log2(2 / 3) + 0.25, abs=1e-9)


@each_pair
def test_is_symmetric_and_between_nothing_and_a_bit(first: str, second: str):
    p, q = DENSITIES[first], DENSITIES[second]
    found = jensen_shannon_quadrature(p, q)
    assert found == pytest.approx(jensen_shannon_quadrature(q, p), abs=1e-9)
    assert 0.0 < found < 1.0


@pytest.mark.parametrize("name", DENSITIES)
def test_of_a_density_and_itself_is_zero(name: str):
    p = DENSITIES[name]
    assert jensen_shannon_quadrature(p, p) == pytest.approx(0.0, abs=1e-12)
    assert jensen_shannon_montecarlo(p, p, 100, rng=rng) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_of_what_has_nothing_in_common_is_one():
    assert jensen_shannon_quadrature(kernels((0.0, 1.0)), kernels((1e3, 1.0))) == pytest.approx(1.0, abs=1e-12)


@each_pair
def test_its_root_is_a_metric(first: str, second: str):
    """Endres and Schindelin 2003: the triangle inequality holds for the square root."""
    distance = np.sqrt(jensen_shannon_quadrature(DENSITIES[first], DENSITIES[second]))
    for between in DENSITIES.values():
        legs = [jensen_shannon_quadrature(DENSITIES[end], between) for end in (first, second)]
        assert distance <= sum(np.sqrt(leg) for leg in legs) + 1e-9


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0.0), (1e4, 1e5), (-3.0, 1.0)])
def test_follows_neither_unit_nor_origin(scale: float, shift: float):
    samples = np.random.default_rng(3).standard_normal((2, 50)) + np.array([[0.0], [1.5]])
    expected = jensen_shannon_quadrature(*map(kernel_density, samples))
    moved = [kernel_density(scale * one + shift) for one in samples]
    assert jensen_shannon_quadrature(*moved) == pytest.approx(expected, abs=1e-9)


@each_pair
def test_montecarlo_is_within_four_standard_errors_of_quadrature(first: str, second: str):
    p, q = DENSITIES[first], DENSITIES[second]
    value, error = jensen_shannon_montecarlo(p, q, 4000, rng=np.random.default_rng(2))
    assert abs(value - jensen_shannon_quadrature(p, q)) < 4.0 * error
    assert error < 0.012


def test_the_standard_error_is_that_of_repetitions():
    p, q = DENSITIES["normal"], DENSITIES["wide"]
    stream = np.random.default_rng(8)
    values, errors = np.transpose([jensen_shannon_montecarlo(p, q, 300, rng=stream) for _ in range(200)])
    low, high = np.sqrt(stats.chi2.ppf([1e-4, 1.0 - 1e-4], 199) / 199)
    assert low < np.std(values, ddof=1) / np.sqrt(np.mean(errors**2)) < high


@pytest.mark.parametrize("constant", [1.0 / plain.SQRT_2_PI, 1.0 / (2.0 * np.pi)])
def test_the_printed_estimate_with_its_halves_for_either_constant_of_the_kernel(constant: float):
    """(17) twice what it should be, and no matter which constant (20) has: only ratios of densities count."""
    samples = [rng.standard_normal(30), rng.normal(1.0, 2.0, 30)]
    p, q = map(kernel_density, samples)
    widths = [plain.local_bandwidths(one, 0.5, constant=constant) for one in samples]
    stream, printed = np.random.default_rng(4), 0.0
    for own, density in enumerate((p, q)):
        logarithms = []
        for r in draw(density, 50, rng=stream):
            heights = [plain.density(r, *pair, constant=constant) for pair in zip(samples, widths, strict=True)]
            logarithms.append(np.log2(2.0 * heights[own] / sum(heights)))
        printed += np.mean(logarithms)
    value, _ = jensen_shannon_montecarlo(p, q, 50, rng=np.random.default_rng(4))
    assert value == pytest.approx(0.5 * printed, abs=1e-12)


def test_a_single_draw_has_no_standard_error():
    with pytest.raises(ValueError, match="2 values or more, got 1"):
        jensen_shannon_montecarlo(DENSITIES["normal"], DENSITIES["wide"], 1, rng=rng)
