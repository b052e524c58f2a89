"""The onset of a step in a relation, dated on the samples: its interval covers, whatever the rate and the recorder.

A few relations run; BFI_FULL=1 takes 200.
"""

from __future__ import annotations

from dataclasses import replace
from operator import itemgetter
from typing import Any

import numpy as np
import pytest
from bars import FULL, not_below

from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flight.parity import Finding
from bfi_cli.flight.parity.relation_course import with_course, with_onset_of_samples
from bfi_cli.flight.parity.relation_series import Balance, RelationSeries
from bfi_cli.flight.parity.sampled import Blocks
from bfi_cli.flight.parity.static_relations import LEAST_STEPS, THRESHOLD
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.kernels.change_scan import steps_and_ramps
from bfi_cli.kernels.runs import sd_about_lines

pytestmark = pytest.mark.slow

N = 200 if FULL else 40
LENGTH_S, NOISE, FINE = 160.0, 0.05, 20
PIECE = 20  # seconds about whose lines a relation shows its noise
RATES_HZ = (1.0, 2.0, 4.0, 5.0, 8.0, 10.0, 16.0, 20.0, 25.0, 50.0, 100.0)
FOUND = Finding(
    fault="tas",
    among=("tas",),
    channels=("tas",),
    stage="static relations",
    shape="bias",
    onset_s=0.0,
    onset_ci95=(0.0, 0.0),
    statistic=0.0,
    threshold=THRESHOLD,
)


def drawn(number: int) -> tuple[FlightLog, float]:
    """Return two airspeeds of which one steps, and when: any rate, noise, size, filter known or not, held or not."""
    rng = np.random.default_rng([38, 7, number])
    rate_hz = float(rng.choice(RATES_HZ))
    time_s = np.arange(0.0, LENGTH_S, 1.0 / rate_hz) + rng.uniform(0.0, 1.0 / rate_hz)
    lasts_s, noise = float(np.exp(rng.uniform(*np.log((0.05, 20.0))))), rng.standard_normal(time_s.size)
    kept = np.exp(-1.0 / (rate_hz * lasts_s))
    for k in range(1, noise.size):
        noise[k] = kept * noise[k - 1] + np.sqrt(1.0 - kept**2) * noise[k]
    noise = NOISE * (noise + rng.uniform() * rng.standard_normal(noise.size))
    onset_s, size = float(rng.uniform(60.0, 90.0)), NOISE * float(np.exp(rng.uniform(*np.log((3.0, 100.0)))))
    known = [Filter(kind=rng.choice(["gaussian", "butterworth", "causal", "fir"]), edge_hz=1.0, rate_hz=rate_hz)]
    known = [replace(known[0], edge_hz=float(rng.uniform(0.5, min(0.4 * rate_hz, 3.0))))] if rate_hz >= 4.0 else []
    # The step itself goes through a filter of what the recorder samples.
    response = response_of(known, FINE * rate_hz)
    fine_s = time_s[0] + np.arange(-response.after, FINE * time_s.size + response.before) / (FINE * rate_hz)
    step = response.filtered((fine_s >= onset_s).astype(np.float64))[::FINE][: time_s.size]
    values = 100.0 + size * step + noise
    own_hz = float(rng.choice([1.0, 2.0, 4.0])) if rate_hz > 8.0 and rng.uniform() < 0.3 else None
    if own_hz is not None:
        values = values[np.searchsorted(time_s, np.floor(time_s * own_hz) / own_hz)]
    if rng.uniform() < 0.3:
        values = np.round(values / 0.1) * 0.1
    made = {"tas": values, "tas_2": np.full(time_s.size, 100.0)}
    stated: dict[str, Any] = {"unit": "m/s", "own_rate_hz": own_hz}
    channels = {name: Channel(name=name, source=name, values=x, **stated) for name, x in made.items()}
    filters = tuple(known) if rng.uniform() < 0.5 else None
    return FlightLog(path="two.csv", time_s=time_s, channels=channels, filters=filters), onset_s


def dated(log: FlightLog) -> Finding | None:
    """Return the step as it is told, None where it is too small to be told or is told as another shape."""
    blocks = Blocks.of(log.time_s, 1.0)
    values = blocks.mean(log.channels["tas"].values - log.channels["tas_2"].values)
    n = values.size
    series = RelationSeries(
        relation=Balance("tas - tas_2", "m/s", "tas", ("tas_2",), itemgetter("tas_2"), twins=True),
        time_s=blocks.time_s,
        values=values,
        nuisances=np.column_stack([np.ones(n), np.zeros((n, 4))]),
        sizes=np.array([np.inf, 1.0, 1.0, 1.0, 1.0]),
        effects={"tas": np.ones(n), "tas_2": -np.ones(n)},
        noise_sd=max(float(np.median(sd_about_lines(values, PIECE, 1))), 1e-6),
        resting_step=0.0,
    )
    onsets_s = np.arange(8.0, LENGTH_S - 8.0)
    scan = series.scan(steps_and_ramps(series.time_s, onsets_s)[0])
    best = int(np.argmax(scan.statistic))
    if scan.statistic[best] < THRESHOLD or abs(scan.amplitude[best]) < LEAST_STEPS * series.noise_sd:
        return None
    found = replace(FOUND, onset_s=float(onsets_s[best]), onset_ci95=(onsets_s[best] - 1.0, onsets_s[best] + 1.0))
    told = with_course(series, found, (0.0, LENGTH_S), "m/s")
    return with_onset_of_samples(series, told, log) if told.shape == "bias" else None


def test_the_interval_of_a_steps_onset_covers() -> None:
    widths, inside = list[float](), 0
    for number in range(N):
        log, onset_s = drawn(number)
        finding = dated(log)
        if finding is None:
            continue
        first_s, last_s = finding.onset_ci95
        inside += first_s <= onset_s <= last_s
        widths.append(last_s - first_s)
        if not first_s <= onset_s <= last_s:
            print(number, log.rate_hz, log.filters, first_s - onset_s, last_s - onset_s)
    n = len(widths)
    print(f"{n} of {N} told as steps, onset in its interval {inside}, median width {np.median(widths):.2f} s")
    assert n >= 0.8 * N
    assert not_below(inside / n, 0.95, n)
