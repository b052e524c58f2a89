"""What a declared fault leaves of others: its magnitude is free, and what may stand in its place is not excluded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bars import not_above
from trials import sized

from bfi_cli.config import Config, merge
from bfi_cli.decision import Candidate
from bfi_cli.faults import Fault
from bfi_cli.faults.shapes import Shape
from bfi_cli.flightlog import FlightLog
from bfi_cli.model.onset.claims import claims_of
from bfi_cli.model.onset.decision import shipped_rule
from bfi_cli.model.onset.estimate import Estimate, as_scanned, subtract_faults
from bfi_cli.model.onset.rivals import rivals_of, scans_beside, with_rivals
from bfi_cli.model.onset.scan import lasting_peak, scan_hypotheses, scan_of
from bfi_cli.model.onset.scan_record import ScanRecord, prepare_record
from bfi_cli.model.onset.shapes import ShapeHypothesis, constants_s

ORDER, RATE_HZ = 4, 10.0
CONFIG = merge(Config(), {"conditioning.rate_hz": RATE_HZ, "model.order": ORDER})
TOLERANCE = 3.0
# Faults that are in the log, slow oscillations of any phase, and what is declared in their place.
MISTAKEN: tuple[tuple[Shape, Shape], ...] = (
    ("sine", "lagged_bias"),
    ("sine", "drift"),
    ("ramp_hold", "drift"),
    ("lagged_bias", "drift"),
    ("drift", "lagged_bias"),
)
SPANS: dict[Shape, dict[str, tuple[float, float]]] = {
    "sine": {"frequency_hz": (0.2, 0.4), "phase_rad": (-np.pi, np.pi)},
    "ramp_hold": {"duration_s": (1.0, 7.0)},
    "lagged_bias": {"time_constant_s": (0.5, 7.0)},
    "drift": {},
}


@pytest.fixture(scope="module")
def record(flown: Callable[..., FlightLog]) -> ScanRecord:
    return prepare_record(flown(Fault(shape="bias", channel="tas", magnitude=4.0, onset_s=13.8)), CONFIG)


def declared_as(record: ScanRecord, shape: Shape) -> Estimate:
    """Return the likeliest fault of a shape in the record as measured."""
    parameters = constants_s(record.settings.duration_s) if shape in ("lagged_bias", "ramp_hold") else (None,)
    scan = scan_of(record, record.y, ORDER, output=0)
    forms = [ShapeHypothesis(shape=shape, output=0, parameter=parameter) for parameter in parameters]
    return as_scanned(record, max((lasting_peak(record, scan, form) for form in forms), key=lambda one: one.statistic))


def test_the_limits_beside_a_declared_fault_do_not_depend_on_its_magnitude_to_first_order(record: ScanRecord):
    """The residual sum of squares is stationary in it, where that of the record less the fault alone is not."""
    fault = declared_as(record, "bias")
    signal = fault.signal / fault.z

    def rss(change: float, *, free: bool) -> float:
        off = replace(fault, signal=(fault.z + change) * signal)
        y = subtract_faults(record.y, off)
        scan = scans_beside(record, y, [off], ORDER)[0] if free else scan_of(record, y, ORDER, output=0)
        return scan.rss0

    best, change = rss(0.0, free=True), 0.3 * abs(fault.sd)
    assert best <= rss(0.0, free=False)
    rises = {free: 0.5 * (rss(change, free=free) + rss(-change, free=free)) - best for free in (True, False)}
    assert abs(rises[True]) < 0.02 * rises[False]


def test_what_is_declared_hides_a_fault_of_its_own_signature_and_no_other(record: ScanRecord):
    fault = declared_as(record, "bias")
    y = subtract_faults(record.y, fault)

    def rise(shift: int, *, free: bool) -> float:
        """Return what a step, so many samples after the declared one, adds to the logarithm of the residuals."""
        step = 0.01 * np.roll(fault.signal / fault.z, shift)[:, None]
        if free:
            before, after = (scans_beside(record, one, [fault], ORDER)[0].rss0 for one in (y, y + step))
        else:
            before, after = (scan_of(record, one, ORDER, output=0).rss0 for one in (y, y + step))
        return float(np.log(after / before))

    assert rise(0, free=True) < 0.05 * rise(0, free=False)
    assert rise(60, free=True) == pytest.approx(rise(60, free=False), rel=0.2)


def mistaken(flown: Callable[..., FlightLog], true: Shape, taken_for: Shape, seed: int) -> tuple[bool, str | None]:
    """Return whether the true shape stands in `among` of another that is declared, and its state."""
    rng = np.random.default_rng(seed)
    keys = {key: float(rng.uniform(*span)) for key, span in SPANS[true].items()}
    size = TOLERANCE * float(rng.uniform(1.0, 3.0)) * float(rng.choice([-1.0, 1.0]))
    fault = Fault(
        shape=true,
        channel="tas",
        magnitude=size / 15.0 if true == "drift" else size,
        onset_s=float(rng.uniform(8.0, 18.0)),
        **keys,
    )
    record = prepare_record(flown(fault, seed=seed), CONFIG)
    first, rule = scan_hypotheses(record, record.y), shipped_rule(record, CONFIG)
    declared = declared_as(record, taken_for)
    y = subtract_faults(record.y, declared)
    named = with_rivals(record, y, [declared], {"tas": TOLERANCE}, order=ORDER, seen={})
    candidates = claims_of(
        record,
        first,
        first,
        [declared],
        rule,
        {"tas": TOLERANCE},
        scans_beside(record, y, [declared], ORDER),
        order=ORDER,
        rivals=rivals_of(named),
        doubted={},
    )
    return true in named[0].among, state_of_shape(candidates, true)


def state_of_shape(candidates: tuple[Candidate, ...], shape: Shape) -> str | None:
    """Return the state of the candidate of a shape."""
    return next((one.state for one in candidates if one.shape == shape), None)


@pytest.mark.first_rows(2)
@pytest.mark.parametrize(("true", "taken_for"), MISTAKEN)
def test_the_true_kind_stands_among_the_rivals_of_a_wrong_one_and_is_not_excluded(flown, true: Shape, taken_for: Shape):
    assert mistaken(flown, true, taken_for, seed=0)[1] in ("suspected", "not_seen")


@pytest.mark.slow
@pytest.mark.parametrize(("true", "taken_for"), MISTAKEN)
def test_a_kind_that_is_taken_for_another_is_excluded_in_1_percent_at_most(flown, true: Shape, taken_for: Shape):
    outcomes = [mistaken(flown, true, taken_for, seed) for seed in range(sized(100, 0.05))]
    among = np.mean([stands for stands, _ in outcomes])
    wrong = np.mean([state == "excluded" for _, state in outcomes])
    print(f"{true} taken for {taken_for}: among {among:.0%}, excluded {wrong:.0%} of {len(outcomes)}")
    assert not_above(float(wrong), 0.01, len(outcomes))
