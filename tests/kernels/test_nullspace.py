"""The null-space detector: theorems of paper H, then the criteria against a full decomposition of every window."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.kernels.nullspace import criteria, past_rank

made = runpy.run_path(str(Path(__file__).with_name("made_linear.py")))
flown, failed = made["flown"], made["failed"]

ROUND_OFF = 1e-11
N_Z = 3 + 2 * 2


def data_matrices(y, u, *, at: int, width: int):
    """Return Y, (n_outputs, h), and Z, (n_outputs + 2 n_inputs, h), of eq. 17 and 18."""
    i = np.arange(max(1, at - width + 1), at + 1)
    return y[i].T, np.hstack([y[i - 1], u[i - 1], u[i]]).T


def right_null_space(Z, *, tolerance: float = 1e-12):
    """Return an orthonormal N, (h, h - rank), with Z N = 0 up to the tolerance, rows scaled to equal length first."""
    norms = np.linalg.norm(Z, axis=1)
    scaled = Z[norms > 0.0] / norms[norms > 0.0, None]
    if not len(scaled):
        return np.eye(Z.shape[1])
    _, values, V = np.linalg.svd(scaled, full_matrices=True)
    return V[np.count_nonzero(values > tolerance * values[0]) :].T


def window_criteria(Y, Z, *, tolerance: float = 1e-12):
    """Return (n_outputs,) |Y(k) N| of one window, eq. 29 as printed, in the units of Y."""
    return np.linalg.norm(Y @ right_null_space(Z, tolerance=tolerance), axis=1)


def fresh(y, u, *, width: int, tolerance: float = 1e-12):
    """Return the criteria of every window from equations (17), (18) and (29) with a full decomposition."""
    found = np.full(y.shape, np.nan)
    for i in range(1, len(y)):
        Y, Z = data_matrices(y, u, at=i, width=width)
        if right_null_space(Z, tolerance=tolerance).shape[1]:
            peak = np.abs(y[1 : i + 1]).max(axis=0)
            printed = window_criteria(Y, Z, tolerance=tolerance)
            found[i] = printed / np.where(peak > 0.0, peak, 1.0) / np.sqrt(width)
    return found


def test_the_data_matrices_are_those_of_equations_17_and_18():
    y, u = flown(20)
    Y, Z = data_matrices(y, u, at=12, width=4)
    np.testing.assert_array_equal(Y, y[9:13].T)
    np.testing.assert_array_equal(Z[:, -1], np.r_[y[11], u[11], u[12]])
    assert Z.shape == (N_Z, 4)


@pytest.mark.parametrize("width", [9, 30])
def test_the_null_space_is_orthonormal_and_annihilates_past_and_outputs_of_a_healthy_window(width):
    y, u = flown()
    Y, Z = data_matrices(y, u, at=100, width=width)
    N = right_null_space(Z)
    assert N.shape == (width, width - N_Z)
    np.testing.assert_allclose(N.T @ N, np.eye(N.shape[1]), atol=1e-12)
    np.testing.assert_allclose(Z @ N, 0.0, atol=1e-12 * np.linalg.norm(Z))
    np.testing.assert_allclose(Y @ N, 0.0, atol=1e-12 * np.linalg.norm(Y))


@pytest.mark.parametrize("width", [12, 40])
@pytest.mark.parametrize("lasting", [1, None])
@pytest.mark.parametrize("channels", [(0,), (1,), (2,), (0, 2), (0, 1, 2)])
def test_a_failure_is_seen_in_its_channels_alone_at_its_very_sample(channels, lasting, width):
    y, u = flown()
    found = criteria(failed(y, 60, channels, lasting=lasting), u, width=width).channel
    healthy = [k for k in range(3) if k not in channels]
    assert np.nanmax(found[:60]) < ROUND_OFF
    assert found[60, list(channels)].min() > 1e6 * ROUND_OFF
    assert found[60, healthy].max(initial=0.0) < ROUND_OFF


@pytest.mark.parametrize(("lasting", "passed"), [(1, 11), (None, 10)])
def test_the_criterion_returns_to_round_off_when_the_window_has_passed_the_failure(lasting, passed):
    width = 10
    y, u = flown()
    found = criteria(failed(y, 60, [1], lasting=lasting), u, width=width).channel
    assert found[60:63, 1].min() > 1e6 * ROUND_OFF
    assert found[60 + passed :].max() < ROUND_OFF


def test_the_criterion_at_the_failure_is_the_error_times_the_null_vector_s_last_element():
    """Eq. (28): only the last column is wrong, so that |dY N| = |dy| |N's last row|, proportional to 1 - gain."""
    y, u = flown()
    sizes = []
    for gain in (0.9, 0.8, 0.0):
        wrong = failed(y, 60, [1], gain=gain)
        Y, Z = data_matrices(wrong, u, at=60, width=12)
        expected = abs(wrong[60, 1] - y[60, 1]) * np.linalg.norm(right_null_space(Z)[-1])
        sizes.append(window_criteria(Y, Z)[1])
        assert sizes[-1] == pytest.approx(expected, rel=1e-9)
        assert abs(wrong[60, 1] - y[60, 1]) * criteria(wrong, u, width=12).share[60] == pytest.approx(
            expected, rel=1e-9
        )
    assert np.array(sizes) / sizes[0] == pytest.approx([1.0, 2.0, 10.0], rel=1e-9)


def test_a_failure_as_an_input_moves_for_the_first_time_is_not_seen_at_that_sample():
    """The null vectors then have no part in the last column."""
    y, u = flown(n_u=1)
    still = np.hstack([u, np.zeros_like(u)])
    still[60:, 1] = 1.0
    found = criteria(failed(y, 60, [1]), still, width=12)
    assert found.channel[60].max() < ROUND_OFF < 1e-4 < found.channel[62, 1]
    assert found.share[60] < ROUND_OFF < 1e-4 < found.share[62]


def test_the_same_gain_of_all_channels_holds_condition_30_and_one_gain_blames_a_healthy_channel_later():
    y, u = flown()
    later = criteria(failed(y, 60, [1]), u, width=12).channel[61:70, [0, 2]]
    assert later.max() > 1e-4
    free = np.zeros((40, 1))
    motion = np.array([[0.9**k, 0.8**k] for k in range(40)])
    diagonal = criteria(failed(motion, 20, [0]), free, width=6).channel
    assert diagonal[20:30, 1].max() < ROUND_OFF < 1e-4 < diagonal[20, 0]


@pytest.mark.parametrize("width", [10, 16, 17, 45, 64, 80])
def test_the_criteria_are_those_of_a_full_decomposition_of_every_window(width):
    y, u = flown(260)
    y = failed(failed(y, 60, [1], lasting=1), 150, [0, 2])
    found = criteria(y, u, width=width)
    np.testing.assert_allclose(found.channel, fresh(y, u, width=width), atol=1e-11)
    assert found.ready == N_Z + 2
    assert found.rank[-1] == N_Z == past_rank(y, u)


@pytest.mark.parametrize("width", [12, 60])
def test_dependent_rows_of_the_past_change_the_rank_and_not_the_criteria(width):
    y, u = flown(200)
    y = failed(y, 120, [1])
    doubled = np.hstack([u, u[:, :1] - 3.0 * u[:, 1:], np.zeros((len(u), 1))])
    plain, redundant = criteria(y, u, width=width), criteria(y, doubled, width=width)
    np.testing.assert_array_equal(redundant.rank, plain.rank)
    np.testing.assert_allclose(redundant.channel, plain.channel, atol=1e-11)
    assert redundant.ready == plain.ready
    np.testing.assert_allclose(redundant.channel, fresh(y, doubled, width=width), atol=1e-11)


def test_the_criteria_do_not_depend_on_the_units():
    y, u = flown()
    y = failed(y, 60, [1])
    found = criteria(y, u, width=20)
    scaled = criteria(y * [1e3, 1e-5, 57.3], u * [1e-4, 1e2], width=20)
    np.testing.assert_allclose(scaled.channel, found.channel, atol=1e-12)
    np.testing.assert_array_equal(scaled.rank, found.rank)


def test_surfaces_that_move_together_or_not_at_all_change_nothing():
    y, u = flown(60)
    y = np.where(np.arange(60)[:, None] < 40, y, 0.9 * y)
    more = np.column_stack([u, -3.0 * u[:, 0], np.zeros(60), u[:, 0]])
    plain, other = criteria(y, u), criteria(y, more)
    assert np.nanmax(plain.channel[:40]) < ROUND_OFF < 1e-3 < plain.channel[40:].max()
    np.testing.assert_allclose(other.channel, plain.channel, atol=ROUND_OFF)
    np.testing.assert_array_equal(other.rank, plain.rank)


def test_a_record_at_rest_has_criteria_of_zero():
    found = criteria(np.zeros((30, 2)), np.zeros((30, 1)), width=5)
    assert found.ready == 2
    np.testing.assert_array_equal(found.channel[1:], 0.0)


def test_no_window_with_a_null_space_is_said_so():
    y, u = flown()
    found = criteria(y, u, width=N_Z)
    assert found.ready is None
    assert np.isnan(found.channel).all()


def test_the_record_is_not_modified():
    y, u = flown()
    before = y.copy(), u.copy()
    criteria(y, u, width=20)
    np.testing.assert_array_equal(y, before[0])
    np.testing.assert_array_equal(u, before[1])


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda y, u: criteria(y[:, 0], u), "n_samples, n_channels"),
        (lambda y, u: criteria(y, u[:-1]), "n_samples, n_channels"),
        (lambda y, u: criteria(y[:1], u[:1]), "two samples or more"),
        (lambda y, u: criteria(np.where(y > 2.0, np.nan, y), u), "must be finite"),
        (lambda y, u: criteria(y, u, width=1), "two columns or more, got 1"),
    ],
)
def test_what_cannot_be_used_is_refused(change, text):
    with pytest.raises(ValueError, match=text):
        change(*flown())
