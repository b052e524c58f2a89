"""Faults of unknown shape on a nonlinear Citation simulation: their course, and none where there is none.

The inputs are elevator, pitch and longitudinal acceleration. From the elevator alone the airspeed nearly integrates,
and what `bfi identify` must do there is to say so.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from free_shape_trials import INPUTS, decaying_step, half_sine, nothing, run_all, two_slopes

from bfi_cli.flightlog import FlightLog, read_log

pytestmark = [pytest.mark.slow, pytest.mark.realdata]


@pytest.fixture(scope="module")
def log(flights: Path) -> FlightLog:
    return read_log(flights / "de3211_1.mat").window(19.0, 50.7)


@pytest.mark.parametrize("course", [two_slopes, decaying_step, half_sine])
def test_the_course_is_found(log: FlightLog, course: Callable[[np.ndarray], np.ndarray]) -> None:
    outcomes = run_all(log, course, INPUTS)
    declared = [one for one in outcomes if one.state == "declared"]
    vaf = [one.vaf for one in declared]
    print(
        f"\n{course.__name__}: declared in {len(declared)} of {len(outcomes)}, fault VAF {np.median(vaf):.1f} % in the "
        f"median, {np.quantile(vaf, 0.1):.1f} % in the worst tenth, {np.mean(np.array(vaf) >= 90.0):.0%} at 90 % and "
        f"more; the band covers {np.mean([one.covered for one in declared]):.0%}"
    )
    assert FULL or declared == outcomes  # of these every answer is known
    assert not_below(len(declared) / len(outcomes), 0.9, len(outcomes))
    assert np.median(vaf) >= 90.0
    # 19 in 20 are wanted; an error of the model, common to all seeds, is no binomial one.
    assert np.mean([one.covered for one in declared]) >= 0.9


def test_without_a_fault_none_is_declared(log: FlightLog) -> None:
    for inputs in (INPUTS, ("elevator",)):
        outcomes = run_all(log, nothing, inputs)
        share = float(np.mean([one.state != "declared" for one in outcomes]))
        print(f"\n{', '.join(inputs)}: no fault of unknown shape declared in {share:.1%} of {len(outcomes)}")
        assert FULL or share == 1.0
        assert not_below(share, 0.97, len(outcomes))


@pytest.mark.parametrize("course", [two_slopes, decaying_step, half_sine])
def test_from_the_elevator_alone_no_course_is_made_up(
    log: FlightLog, course: Callable[[np.ndarray], np.ndarray]
) -> None:
    outcomes = run_all(log, course, ("elevator",))
    wrong = [one for one in outcomes if one.state == "declared" and one.vaf < 90.0]
    print(f"\n{course.__name__} from the elevator: {len(wrong)} of {len(outcomes)} courses made up")
    assert FULL or not wrong
    assert not_below(1.0 - len(wrong) / len(outcomes), 0.95, len(outcomes))
