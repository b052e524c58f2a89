"""The screen of windows in which a fault stands out, by which `bfi diagnose` leaves windows out.

Windows of 120 s of tours of three aircraft of JSBSim with a step or an oscillation, from hardly to clearly seen, at one
order, as they are screened. A few windows run; BFI_FULL=1 takes all.
"""

from __future__ import annotations

import numpy as np
import pytest
from bars import FULL
from jsbsim_trials import AIRCRAFT, tour

from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.flight.looks import inputs_for
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.model.onset.decision import shipped_rule
from bfi_cli.model.onset.scan import PROMISED, SCREENED, promise_of, scan_hypotheses, screened
from bfi_cli.model.onset.scan_record import prepare_record

pytestmark = pytest.mark.slow

WINDOW_S, ORDERS = 120.0, (2, 4, 6)
STARTS_S = np.arange(120.0, 760.0, 40.0 if FULL else 120.0)
SEEDS = 2 if FULL else 1
MARGIN = 2.0  # that is left to the least screen seen


def faulty(log: FlightLog, shape: str, from_s: float, rng: np.random.Generator) -> FlightLog:
    """Return a tour with a step of 0.2 to 3 m/s, or an oscillation of a third of it, of the airspeed in a window."""
    onset_s, size = from_s + float(rng.uniform(20.0, 60.0)), float(np.exp(rng.uniform(*np.log((0.2, 3.0)))))
    if shape == "bias":
        return inject(log, [Fault(shape="bias", channel="tas", magnitude=size, onset_s=onset_s)])
    hz = float(rng.uniform(0.1, 1.0))
    return inject(log, [Fault(shape="sine", channel="tas", magnitude=size / 3.0, onset_s=onset_s, frequency_hz=hz)])


def screen_of(log: FlightLog, shape: str, from_s: float, order: int) -> tuple[float, float] | None:
    """Return screen and promise of a shape over its threshold; None where its statistic does not exceed that."""
    window = {"from_s": from_s, "to_s": from_s + WINDOW_S}
    used = {"inputs": inputs_for(log), "outputs": ("tas",), "window": window, "model": {"order": order}}
    config = merge(Config(), used)
    record = prepare_record(log, config)
    threshold = shipped_rule(record, config).threshold(shape)
    (peak,) = (peak for peak in scan_hypotheses(record, record.y).peaks if peak.form.shape == shape)
    (form,) = (form for form in record.forms if form.shape == shape)
    if peak.statistic <= threshold:
        return None
    return screened(record, record.y, form) / threshold, promise_of(record, record.y, form) / threshold


@pytest.mark.parametrize("shape", ["bias", "sine"])
@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_no_window_in_which_a_fault_stands_out_is_left_out(aircraft: str, shape: str) -> None:
    screens: list[tuple[float, float]] = []
    for seed in range(SEEDS):
        rng = np.random.default_rng([7, AIRCRAFT.index(aircraft), seed])
        for from_s in STARTS_S:
            log = faulty(tour(aircraft, seed=seed), shape, float(from_s), rng)
            screen = screen_of(log, shape, float(from_s), int(rng.choice(ORDERS)))
            screens += [] if screen is None else [screen]
    screen, promise = map(min, zip(*screens, strict=True))
    print(
        f"{aircraft}, {shape}: {len(screens)} stand out, screen {screen:.2f} and promise {promise:.2f} of the threshold"
    )
    assert screen > MARGIN / SCREENED
    assert promise > 1.0 > 1.0 / PROMISED
