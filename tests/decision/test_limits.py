"""What a limit holds for: the worst of several views of a record."""

from __future__ import annotations

import pytest

from bfi_cli.decision import candidate_of, worst_view
from bfi_cli.decision.limits import STANDS_FOR
from bfi_cli.faults import Fault


@pytest.mark.parametrize(
    ("effects", "expected", "hides"),
    [
        ((1.0, 2.0), 2.0, False),
        ((2.0, 1.0), 2.0, False),
        ((1.0, 4.0), 4.0, True),
        ((1.0, None), None, True),
        ((None, 1.0), None, False),
        ((4.0, 5.0), 5.0, False),
        ((3.0, 3.5), 3.5, True),
        ((1.0, 3.0), 3.0, False),
    ],
)
def test_the_larger_limit_of_two_views_counts(effects, expected, hides):
    """With a tolerance of 3 the second view hides a fault where it alone exceeds that."""
    fault = Fault(shape="bias", channel="tas")
    views = [candidate_of(fault, "m/s", effect=one, excluded_above=one, tolerance=3.0, note="own") for one in effects]
    worst = worst_view(views)
    assert (worst.effect, worst.excluded_above) == (expected, expected)
    assert worst.state == ("not_seen" if expected is None or expected > 3.0 else "excluded")
    assert worst.note == (STANDS_FOR if hides else "own")
