"""The blind FIR example: exact by RISRO, as good as the first-order bound with noise, and why the nuclear norm errs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bfi_cli.lab.reproduce.fir import (
    METHODS,
    TAPS,
    Problem,
    bound,
    error,
    identify_fir,
    output,
    run,
    slow_and_white,
    z_of,
)
from bfi_cli.report.content import ReportContent


def outcomes(white: float, noise: float, n: int) -> list[tuple[float, ...]]:
    problem = Problem(theta=None, white=white, noise=noise)
    found = [run((problem, (0, number))) for number in range(n)]
    return [(one[0], one[-2], one[-1]) for one in found]


def test_the_product_is_recovered_to_1e_8_without_noise(made: Callable[[str], ReportContent]):
    ours = {row[0]: row[2] for row in made("fir").tables[0].rows}
    assert float(ours["error of b z^T, RISRO, no noise"]) < 1e-8
    assert float(next(value for name, value in ours.items() if name.startswith("RISRO, no noise")).split()[-1]) < 1e-8


def test_lags_that_coincide_raise_the_condition_number_and_not_the_error_without_noise():
    well, ill = outcomes(1.0, 0.0, 3), outcomes(0.001, 0.0, 3)
    assert max(one[2] for one in well) < 10.0
    assert min(one[2] for one in ill) > 500.0
    assert max(one[0] for one in (*well, *ill)) < 1e-8


def test_the_squared_error_with_noise_is_that_of_the_bound():
    """Least squares over the tangent space has 3 + 7 - 1 degrees of freedom: a chi-square bound on their mean."""
    n = 40
    ratios = [(off / limit) ** 2 for off, limit, _ in outcomes(1.0, 1e-3, n)]
    assert np.mean(ratios) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (9 * n)))


def test_the_bound_is_proportional_to_the_noise_and_zero_without():
    theta = slow_and_white(0.3, np.random.default_rng(0))
    z = z_of(theta.shape[1])
    assert bound(theta, z, 0.0) == 0.0
    assert bound(theta, z, 0.2) == pytest.approx(2.0 * bound(theta, z, 0.1), rel=1e-12)


def test_the_output_is_equation_3_2():
    theta = slow_and_white(0.5, np.random.default_rng(1))
    z = z_of(theta.shape[1])
    u, y = theta @ z, output(theta, z)
    k = 500
    assert y[k] == pytest.approx(sum(b * u[k - i] for i, b in enumerate(TAPS, start=1)), rel=1e-12)


def test_the_nuclear_norm_keeps_the_sum_of_the_taps_and_loses_their_differences(made: Callable[[str], ReportContent]):
    table = made("fir").tables[1]
    rows = {row[0]: [float(cell) for cell in row[1:]] for row in table.rows}
    common, differing = table.heads.index("sum of the taps") - 1, table.heads.index("their differences") - 1
    relaxed = rows["nuclear norm, penalty 0.001"]
    assert relaxed[common] < 0.05 < 0.5 < relaxed[differing]
    assert rows["nuclear norm, penalty 1e-06"][differing] < relaxed[differing]
    assert list(rows) == list(METHODS)


def test_both_methods_agree_where_the_lags_differ():
    theta = slow_and_white(1.0, np.random.default_rng(2))
    z = z_of(theta.shape[1])
    found = identify_fir(output(theta, z), theta, n_taps=3, penalty=1e-6)
    assert error(found.product, z) < 1e-4


def test_no_line_goes_through_the_two_noises_of_a_quick_run(made: Callable[[str], ReportContent]):
    content = made("fir")
    condition, noise = content.drawings
    assert {one.style for panel in condition.panels for one in panel.curves} == {"bars", "dotted"}
    assert {one.style for panel in noise.panels for one in panel.curves} == {"points"}
    assert dict(content.facts)["Points"] == "3 condition numbers, 2 noises"
