"""What long loops tell of how far they are: it never falls, stays within 0 and 1, and ends at 1."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.kernels.progress import Report, parts, shares, steps

WEIGHTS = st.lists(st.integers(0, 1000), min_size=1, max_size=6).filter(any)
# A loop: how many steps, each of them a loop of its own; a number is a loop of unknown length.
LOOPS = st.recursive(st.integers(0, 5), lambda inner: st.lists(inner, max_size=4), max_leaves=20)


def work(loop: list | int, report: Report) -> None:
    if isinstance(loop, int):
        step = steps(report, 3)
        for _ in range(loop):
            step()
        return
    for inner, own in parts(report, loop):
        work(inner, own)


@given(LOOPS.filter(bool))
def test_loops_within_loops(loop: list | int):
    told: list[float] = []
    work(loop, told.append)
    assert told == sorted(told)
    assert told[0] >= 0.0
    assert (told[-1] == 1.0) if isinstance(loop, list) else (told[-1] < 1.0)


@given(WEIGHTS)
def test_shares_follow_each_other_and_are_as_long_as_their_weights(weights: list[int]):
    told: list[float] = []
    lengths = []
    for own in shares(told.append, *weights):
        own(0.0)
        own(1.0)
        lengths.append(told[-1] - told[-2])
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)
    assert all(abs(length - weight / sum(weights)) < 1e-12 for length, weight in zip(lengths, weights, strict=True))


def test_a_loop_of_unknown_length_is_half_done_after_about_its_length():
    told: list[float] = []
    step = steps(told.append, 7)
    for _ in range(7):
        step()
    assert told[-1] == 0.5


def test_what_is_left_early_is_done_where_the_outer_loop_goes_on():
    told: list[float] = []
    for _, own in parts(told.append, "ab"):
        for _ in parts(own, range(10)):
            break
    assert told == [0.5, 1.0]
