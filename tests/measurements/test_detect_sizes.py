"""How often the interval of a detected step holds its true size, with white noise and in gusts."""

from __future__ import annotations

import numpy as np
import pytest
from bars import FULL, not_below
from trials import sized

from bfi_cli.aircraft import Dryden, find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.detection import detect_faults
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject

pytestmark = pytest.mark.slow

MODEL, RATE_HZ, NOISE, NEAR_S = find_model("citation"), 25.0, 0.02, 1.5
N = sized(200, 0.025)


@pytest.mark.parametrize(("gusts_m_s", "duration_s", "larger"), [(0.0, 60.0, 1.0), (0.5, 90.0, 5.0)])
def test_intervals_hold_the_size_of_a_step(gusts_m_s: float, duration_s: float, larger: float):
    time_s = time_axis(duration_s=duration_s, rate_hz=RATE_HZ)
    u = np.sum([manoeuvre("3211", time_s, start_s=start) for start in np.arange(2.0, duration_s - 10.0, 15.0)], axis=0)
    clean = simulate(MODEL, u, rng=np.random.default_rng(0), rate_hz=RATE_HZ)
    noise_sd = {name: NOISE * float(clean.channel(name).values.std()) for name in MODEL.outputs}
    config = merge(Config(), {"detect.train": (0.0, 0.5 * duration_s)})
    turbulence = Dryden(sigma_m_s=gusts_m_s) if gusts_m_s else None
    held, widths = [], []
    for seed in range(N):
        rng = np.random.default_rng([5, seed])
        log = simulate(MODEL, u, rng=rng, rate_hz=RATE_HZ, noise_sd=noise_sd, turbulence=turbulence)
        name = str(rng.choice(MODEL.outputs))
        onset_s = float(rng.uniform(0.5 * duration_s + 3.0, duration_s - 6.0))
        size = larger * float(rng.choice([6.0, 10.0, 20.0])) * noise_sd[name]
        fault = Fault(shape="bias", channel=name, magnitude=size, onset_s=onset_s)
        alarms = detect_faults(inject(log, [fault]), config).alarms
        own = [one for one in alarms if one.channel == name and abs(one.onset_s - onset_s) < NEAR_S]
        if own and own[0].ci95 is not None:
            low, high = own[0].ci95
            held.append(low <= size <= high)
            widths.append((high - low) / (2.0 * size))
    print(f"gusts {gusts_m_s} m/s: {sum(held)} of {len(held)} hold the size, half width {np.median(widths):.3f} of it")
    assert FULL or all(held)  # of these every answer is known
    assert len(held) > 0.8 * N
    assert not_below(sum(held) / len(held), 0.95, len(held))
