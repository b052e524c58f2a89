"""How the rate follows the noise, and the thesis's rule in place of the criterion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_logs import made_log
from noted import texts

from bfi_cli.aircraft import Dryden, find_model, manoeuvre, simulate, time_axis
from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.errors import LogError
from bfi_cli.flightlog import FlightLog
from bfi_cli.model import identify_faults
from bfi_cli.model.preprocessing.defaults import require_one_trim

# Without limits for onsets that are known to a tolerance only, which take most of the time.
EXACT = merge(Config(), {"onset_tolerance_s": 0.0})


def flown(noise: float, gusts: float = 0.0) -> FlightLog:
    """Return the thesis's manoeuvre with measurement noise, or with gusts, both in m/s."""
    time_s = time_axis(duration_s=31.72, rate_hz=100.0)
    return simulate(
        find_model("citation"),
        manoeuvre("3211", time_s),
        rng=np.random.default_rng(5),
        rate_hz=100.0,
        noise_sd={"tas": noise},
        turbulence=Dryden(sigma_m_s=gusts) if gusts else None,
    )


def test_the_output_has_no_say_in_rate_and_orders(thesis):
    """A fault in it, or more noise, would else lead to another analysis."""
    quiet, noisy = (identify_faults(log, thesis, EXACT) for log in (flown(0.0, gusts=0.3), flown(0.1)))
    assert (quiet.log.rate_hz, quiet.model.orders) == (noisy.log.rate_hz, noisy.model.orders)
    assert noisy.faults == ()


def test_the_rate_never_falls_below_four_samples_per_cycle_of_the_dictionary(thesis):
    fastest = max(fault.frequency_hz or 0.0 for fault in thesis.atoms)
    assert identify_faults(flown(0.5), thesis, merge(EXACT, {"model.order": 4})).log.rate_hz >= 4.0 * fastest


@pytest.mark.parametrize(("threshold", "found"), [(0.3, {"bias_13.8", "sine_1.15"}), (0.7, {"bias_13.8"})])
def test_a_threshold_replaces_the_criterion(flight, thesis, faulty, threshold, found):
    log = faulty(flight(1), thesis, {"bias_13.8": 4.0, "sine_1.15": 2.0})
    result = identify_faults(log, thesis, merge(EXACT, {"selection.threshold": threshold, "model.order": 5}))
    assert {fault.name for fault in result.faults} == found


def test_a_tiny_threshold_declares_everything(flight, thesis):
    result = identify_faults(flight(1), thesis, merge(Config(), {"selection.threshold": 1e-12}))
    assert len(result.faults) == len(thesis.atoms)


def test_what_the_dictionary_does_not_hold_is_pointed_at(flight, thesis, faulty):
    """A step that is not in the dictionary is no fault of it, but the reader is told that something is there."""
    log = faulty(flight(1), thesis, {"bias_13.8": 3.0})
    late = replace(
        thesis, atoms=tuple(replace(atom, onset_s=20.0) for atom in thesis.atoms if atom.name == "bias_13.8")
    )
    result = identify_faults(log, late, Config())
    assert any("an abrupt event" in note for note in texts(result.notes))


def test_a_flight_of_many_trims_is_refused_with_the_windows_to_take(thesis):
    """Its dictionary begins in the first half minute; whatever one model leaves of climb and descent is no fault."""
    time_s = np.arange(0.0, 2400.0, 0.2)
    altitude = np.interp(time_s, [0.0, 600.0, 1500.0, 2400.0], [500.0, 3500.0, 3500.0, 500.0])
    speed = np.interp(time_s, [0.0, 500.0, 700.0, 1400.0, 1600.0, 2400.0], [90.0, 90.0, 120.0, 120.0, 100.0, 100.0])
    moves = 0.05 * np.sin(time_s) * (np.abs(time_s - 1000.0) < 10.0)
    units = {"tas": "m/s", "cas": "m/s", "altitude": "m", "elevator": "rad"}
    log = made_log(time_s, units=units, tas=speed, cas=speed, altitude=altitude, elevator=moves)
    with pytest.raises(LogError, match=r"40 min long; windows to take: .* 2 phases \(cruise, descent\)") as caught:
        identify(log, thesis, Config())[0]
    assert "\n" not in str(caught.value)
    cruise = log.window(700.0, 1400.0)
    require_one_trim(cruise, thesis.resolved(700.0), Config())  # long, but of one trim
