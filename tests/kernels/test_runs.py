"""Runs of a mask and stretches of time."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.kernels.runs import bridged, joined, runs, runs_with, shared, within

MASKS = st.lists(st.booleans(), max_size=60).map(lambda bits: np.array(bits, dtype=bool))


@given(mask=MASKS)
def test_runs_are_the_mask_and_never_touch(mask: np.ndarray):
    marked = np.zeros_like(mask)
    for first, end in runs(mask):
        marked[first:end] = True
    np.testing.assert_array_equal(marked, mask)
    assert joined(runs(mask), 0) == runs(mask)


@given(mask=MASKS, apart=st.integers(0, 5))
def test_joined_runs_bridge_the_gaps_that_are_short_enough_and_no_others(mask: np.ndarray, apart: int):
    bridged = mask.copy()
    for first, end in runs(~mask):
        bridged[first:end] = end - first <= apart and first > 0 and end < mask.size
    assert joined(runs(mask), apart) == runs(bridged)


@given(mask=MASKS)
def test_hysteresis_keeps_the_weak_runs_that_hold_something_strong(mask: np.ndarray):
    assert runs_with(mask, mask) == runs(mask)
    assert runs_with(np.zeros_like(mask), mask) == []
    strong, weak = np.array([0, 1, 0, 0, 0, 0, 1], dtype=bool), np.array([1, 1, 0, 1, 1, 0, 0], dtype=bool)
    assert runs_with(strong, weak) == [(0, 2), (6, 7)]


def test_the_end_of_a_stretch_is_no_part_of_it_and_what_is_shared_is_what_lies_in_both():
    assert within(np.arange(6.0), [(1.0, 3.0), (4.0, 4.0)]).tolist() == [False, True, True, False, False, False]
    assert shared((2.0, 10.0), [(0.0, 3.0), (5.0, 6.0), (11.0, 12.0)]) == 2.0


@given(mask=MASKS, most=st.integers(0, 5))
def test_lines_bridge_what_is_missing_up_to_a_length_and_leave_the_rest(mask: np.ndarray, most: int):
    line = 3.0 - 0.5 * np.arange(mask.size)
    filled = bridged(np.where(mask, np.nan, line))
    inner = slice(int(np.argmin(mask)), mask.size - int(np.argmin(mask[::-1]))) if (~mask).any() else slice(0)
    np.testing.assert_allclose(filled[inner], line[inner], atol=1e-12)
    left = [run for run in runs(mask) if run[1] - run[0] > most]
    expected = left if (~mask).any() else runs(mask)
    assert runs(np.isnan(bridged(np.where(mask, np.nan, line), most=most))) == expected
