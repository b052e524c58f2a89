"""The level of limits: how often a fault is larger than what its own simulated record is said to exclude."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bars import not_above
from scipy.signal import lfilter
from trials import sized

from bfi_cli.config import Config, merge
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.onset import claims
from bfi_cli.model.onset.scan import scan_of
from bfi_cli.model.onset.scan_record import ScanRecord, prepare_record
from bfi_cli.model.onset.shapes import ShapeHypothesis, waveform

pytestmark = pytest.mark.slow

RATE_HZ, N, ORDER = 2.0, 200, 4
CONFIG = merge(Config(), {"conditioning.rate_hz": "none", "model.order": ORDER, "start_time.shapes": ("bias", "sine")})
FORMS = {
    "bias": ShapeHypothesis(shape="bias", output=0),
    "lag": ShapeHypothesis(shape="lagged_bias", output=0, parameter=5.0),
    "ramp": ShapeHypothesis(shape="ramp_hold", output=0, parameter=10.0),
    "sine": ShapeHypothesis(shape="sine", output=0, parameter=0.1),
}
# In standard deviations at the median onset: smaller faults are hardly ever excluded, larger ones no more.
SIZES = (2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0)
TRIALS = 4000
# What a threshold asks for is not counted: it makes limits larger still.
RULE: Any = SimpleNamespace(threshold=lambda _shape: 1e-6, suspicion=lambda _shape: 1e-6)


def flight(rng: np.random.Generator) -> FlightLog:
    """Return a log of a random stable system with noise of random size in it and on it."""
    poles: list[complex] = []
    for _ in range(rng.integers(1, 4)):
        pole = (1.0 - 10 ** rng.uniform(-2.3, -0.5)) * np.exp(1j * rng.uniform(0.0, 1.0))
        poles += [pole, np.conj(pole)] if rng.random() < 0.6 else [abs(pole)]
    u = np.sign(lfilter([1.0], [1.0, -0.95], rng.standard_normal(N)))
    drive = lfilter(np.append(0.0, 0.2 * rng.standard_normal(len(poles))), [1.0], u)
    drive += 10 ** rng.uniform(-2.5, -0.3) * rng.standard_normal(N)
    tas = lfilter([1.0], np.poly(poles).real, drive) + 10 ** rng.uniform(-3.0, -1.0) * rng.standard_normal(N)
    values = {"tas": (100.0 + tas, "m/s"), "elevator": (u, "rad")}
    channels = {
        name: Channel(name=name, values=frozen_array(own), unit=unit, source=name)
        for name, (own, unit) in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(np.arange(N) / RATE_HZ), channels=channels, filters=())


def excluded(record: ScanRecord, y: np.ndarray, form: ShapeHypothesis, unit: float) -> float:
    """Return the largest error, scaled, that may hide in a record."""
    scan = scan_of(record, y, ORDER, output=0)
    with pytest.MonkeyPatch.context() as patch:
        if form.shape == "bias":
            patch.setattr(claims, "WEIGHED", ())
        limits = claims._limits(record, scan, form, RULE, unit * float(record.unit[0]))
    assert limits is not None
    return limits.hidden()[1]


def counted(form: ShapeHypothesis, seeds: Sequence[int]) -> dict[float, list[bool]]:
    """Return, by size, whether the record with a fault of it excluded it."""
    wrong: dict[float, list[bool]] = {size: [] for size in SIZES}
    for seed in seeds:
        rng = np.random.default_rng(seed)
        record = prepare_record(flight(rng), CONFIG)
        wave = waveform(form, record.sampling)
        samples = wave.unit * wave.samples
        scan = scan_of(record, record.y, ORDER, output=0)
        onsets = claims._covered(record, scan, form)
        profile = claims.scan_shape(scan, wave, onsets)
        reach = np.maximum.accumulate(np.abs(samples))[N - 1 - onsets]
        sd = float(np.nanmedian(profile.sd * reach))
        size, k = SIZES[seed % len(SIZES)], int(rng.integers(len(onsets)))
        theta = np.zeros((N, 1))
        theta[onsets[k] :, 0] = samples[: N - onsets[k]] / reach[k]
        faulty = record.y + rng.choice([-1.0, 1.0]) * size * sd * theta
        wrong[size].append(excluded(record, faulty, form, sd) < size * sd * (1.0 - 1e-6))
    return wrong


@pytest.mark.parametrize("name", FORMS)
def test_of_faults_of_any_size_5_percent_are_beyond_the_limit_at_most(name: str):
    wrong = counted(FORMS[name], range(sized(TRIALS, 0.05)))
    for size, own in wrong.items():
        print(f"{name} of {size:g} standard deviations: {np.mean(own):.1%} of {len(own)} excluded")
    every = [one for own in wrong.values() for one in own]
    assert not_above(float(np.mean(every)), 0.05, len(every))
    for own in wrong.values():
        assert not_above(float(np.mean(own)), 0.05, len(own))
