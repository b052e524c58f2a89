"""How much better one explanation of a relation that fails has to be than another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.airdata.relations import Relation, State
from bfi_cli.flight.plausibility.changes import Change
from bfi_cli.flight.plausibility.misfits import Misfit, known_seconds
from bfi_cli.flight.plausibility.search import blames

PIECES, SECONDS = 8, 60
SPREAD = np.array([-7.0, -5.0, -3.0, -1.0, 1.0, 3.0, 5.0, 7.0])  # of the speeds flown, m/s
ROUGH = np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0])  # of no slope over the speeds, nor a level


def state_of(indicated: Sequence[float], calibrated: Sequence[float]) -> State:
    """Return a flight in pieces, in each of which both airspeeds stay."""
    values = {"ias": np.repeat(indicated, SECONDS), "cas": np.repeat(calibrated, SECONDS)}
    zeros = np.zeros(PIECES * SECONDS)
    return State(values=values, rates=dict.fromkeys(values, zeros), time_s=np.arange(PIECES * SECONDS, dtype=float))


@pytest.mark.parametrize(("times", "what"), [(1.85, "offset"), (2.25, "scale")])
def test_a_scale_is_to_blame_where_it_leaves_half_of_what_an_offset_leaves(times: float, what: str) -> None:
    """An offset leaves what the speeds spread times the scale's error, a scale what is rough."""
    relation = Relation(
        lambda state: state.values["ias"], lambda state: state.values["cas"], needs=("ias", "cas"), tolerance=5.0
    )
    factor, spread = 1.5, 0.5 * SPREAD
    # Taken off the larger reading a scale leaves less than put on the other, by its factor.
    rough = float(np.std(spread)) / np.sqrt((times / factor) ** 2 - 1.0) * ROUGH
    state = state_of(factor * (100.0 + SPREAD) + rough, 100.0 + SPREAD)
    (blame,) = blames(known_seconds([relation], state), state, {"ias": None, "cas": None})
    assert blame.change.what == what


@pytest.mark.parametrize(("times", "fits"), [(2.7, False), (3.4, True)])
def test_another_unit_has_to_fit_three_times_as_well(times: float, fits: bool) -> None:
    """A factor that makes a misfit a little smaller is no unit; one that states no name is told as soon as it holds."""
    yes, ones = np.ones(4, dtype=bool), np.ones(4)
    after = Misfit(
        levels=np.full(PIECES, 0.8),
        correlation=ones,
        slope=ones,
        is_informative=~yes,
        follows=yes,
        difference=0.0,
        size=100.0,
        tolerance=10.0,
    )
    before = replace(after, levels=times * after.levels)
    assert before.explained_by(after, Change(what="unit", channels=("tas",), factor=0.9, unit="kt")) is fits
    assert before.explained_by(after, Change(what="scale", channels=("tas",), factor=0.9))
