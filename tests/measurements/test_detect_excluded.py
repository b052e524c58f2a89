"""How often a step just above what a detection excludes raises an alarm, through the recorder of a simulated flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bars import FULL, not_below
from trials import sized

from bfi_cli.aircraft import Dryden, find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config
from bfi_cli.detection import detect_faults
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import frozen_array

pytestmark = pytest.mark.slow

MODEL, RATE_HZ, DURATION_S, NOISE, ABOVE = find_model("citation"), 10.0, 240.0, 0.01, 1.02
# Onsets in the time that is watched, the last two thirds.
EARLIEST_S, LATEST_S = 81.0, 230.0
# Kind and edge of the recorder, gusts in m/s, and white noise behind the recorder relative to that before it.
CASES = {
    "none": (None, 0.5, 0.0),
    "gaussian, gusts": (Filter(kind="gaussian", edge_hz=0.75, rate_hz=RATE_HZ), 0.5, 0.0),
    "gaussian, noise behind": (Filter(kind="gaussian", edge_hz=0.75, rate_hz=RATE_HZ), 0.0, 0.3),
    "windowed sinc, at the highest rate": (Filter(kind="fir", edge_hz=1.701, rate_hz=RATE_HZ), 0.5, 0.0),
    "causal, at the highest rate": (Filter(kind="causal", edge_hz=1.701, rate_hz=RATE_HZ), 0.0, 0.5),
}


def flown(seed: int, recorder: Filter | None, gusts_m_s: float, behind: float) -> FlightLog:
    """Fly 3-2-1-1s with noise and gusts, all of it through the recorder."""
    time_s = time_axis(duration_s=DURATION_S, rate_hz=RATE_HZ)
    u = np.sum([manoeuvre("3211", time_s, start_s=start_s) for start_s in np.arange(2.0, DURATION_S, 15.0)], axis=0)
    rng, filters = np.random.default_rng([31, seed]), () if recorder is None else (recorder,)
    clean = simulate(MODEL, u, rng=rng, rate_hz=RATE_HZ)
    noise_sd = {name: NOISE * float(clean.channel(name).values.std()) for name in MODEL.outputs}
    turbulence = Dryden(sigma_m_s=gusts_m_s) if gusts_m_s else None
    log = simulate(MODEL, u, rng=rng, rate_hz=RATE_HZ, noise_sd=noise_sd, turbulence=turbulence)
    through, channels = response_of(filters, RATE_HZ), dict(log.channels)
    for name, one in channels.items():
        values = through.filtered(np.pad(one.values, (through.after, through.before), mode="edge"))
        values = values + behind * noise_sd.get(name, 0.0) * rng.standard_normal(log.n_samples)
        channels[name] = replace(one, values=frozen_array(values))
    return replace(log, channels=channels, filters=filters)


@pytest.mark.parametrize("case", CASES)
def test_steps_just_above_what_is_excluded_raise_an_alarm(case: str) -> None:
    found, n = 0, 0
    for seed in range(sized(12, 1 / 12)):
        log, rng = flown(seed, *CASES[case]), np.random.default_rng([37, seed])
        result = detect_faults(log, Config())
        for one in result.candidates:
            assert one.excluded_above is not None
            size = ABOVE * float(rng.choice([-1.0, 1.0])) * one.excluded_above
            onset_s = float(rng.uniform(EARLIEST_S, LATEST_S))
            fault = Fault(shape="bias", channel=one.channel, magnitude=size, onset_s=onset_s)
            found, n = found + bool(detect_faults(inject(log, [fault]), Config()).alarms), n + 1
    print(f"\n{case}, {result.log.rate_hz:g} Hz: {found} of {n} raise an alarm")
    assert FULL or found == n  # of these every answer is known
    assert not_below(found / n, 0.95, n)
