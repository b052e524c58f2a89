"""When did it start: the thesis's figures 5-14 to 5-16 with noise, and oscillations with an unknown start and end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bars import FULL, not_below
from onset_trials import SEEDS, Outcome, Trial, calibrated, described, run, run_all
from trials import sized

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, read_log

pytestmark = pytest.mark.slow

LONG = pytest.mark.skipif(not FULL, reason="half an hour: only where BFI_FULL=1 is set")
BIAS = Fault(shape="bias", magnitude=5.0, onset_s=15.0)
DRIFT = Fault(shape="drift", magnitude=0.25, onset_s=16.0)
AT_10_HZ = {"conditioning.rate_hz": 10.0}
SAMPLE_S = 0.1
NOISE = 0.01
WINDOWS = sized(100, 0.25)

ENDS = {**AT_10_HZ, "start_time.ends": True}
ENDS_NOISE, ENDS_WINDOWS = 0.02, 40
BAND_HZ, MAGNITUDE, CYCLES = (0.2, 2.0), 0.5, 3.0
FREE_START_S, FREE_END_S = 4.0, 2.5


@pytest.fixture(scope="module")
def flown() -> FlightLog:
    """Return the thesis's record: 31.72 s of the Citation at 100 Hz, without noise."""
    return simulate(MODELS["citation"], manoeuvre("3211", time_axis()), rng=np.random.default_rng(0))


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(("bias", "drift"), id="figures"),
        pytest.param(("bias", "drift", "sine"), id="default", marks=LONG),
    ],
)
def config(request: pytest.FixtureRequest, flown: FlightLog, tmp_path_factory: pytest.TempPathFactory) -> Config:
    """Return settings whose threshold comes from fault-free flights with the same noise."""
    plain = merge(Config(), {**AT_10_HZ, "start_time.shapes": list(request.param)})
    folder = tmp_path_factory.mktemp("calibration")
    return calibrated(flown, plain, noise=NOISE, windows=WINDOWS, folder=folder)


def shown(name: str, outcomes: list[Outcome], *, wrong: list[Outcome]) -> None:
    """Print how many are right and what the others say; none may have failed."""
    print(f"\n{name}: {len(outcomes) - len(wrong)} of {len(outcomes)} as wanted")
    for outcome in wrong:
        print(f"  {described(outcome)}")
    assert [outcome.trial.seed for outcome in outcomes if outcome.defect] == []


def test_figure_5_14_bias(flown: FlightLog, config: Config) -> None:
    outcomes = run_all([Trial(seed, BIAS, NOISE) for seed in SEEDS], flown, config)
    late = [abs(one.late_s) if one.shape == "bias" else np.inf for one in outcomes]
    shown("bias at 15 s", outcomes, wrong=[one for one, s in zip(outcomes, late, strict=True) if s > SAMPLE_S])
    print(f"  onset off by at most {max(late):.3f} s, interval covers {np.mean([one.covered for one in outcomes]):.1%}")
    print(f"  more than one fault declared: {sum(len(one.faults) > 1 for one in outcomes)}")
    assert max(late) <= SAMPLE_S + 1e-9


def test_figure_5_15_drift_without_noise(flown: FlightLog, config: Config) -> None:
    outcome = run(Trial(0, DRIFT, 0.0), log=flown, config=config)
    print(f"\ndrift at 16 s, no noise: {described(outcome)}")
    assert outcome.shape == "drift"
    assert abs(outcome.late_s) <= 0.2


def test_figure_5_15_drift(flown: FlightLog, config: Config) -> None:
    outcomes = run_all([Trial(seed, DRIFT, NOISE) for seed in SEEDS], flown, config)
    right = [one for one in outcomes if one.shape == "drift"]
    covered = float(np.mean([one.covered for one in outcomes]))
    shown("drift at 16 s", outcomes, wrong=[one for one in outcomes if one.shape != "drift" or not one.covered])
    late = np.abs([one.late_s for one in right])
    print(
        f"  declared a drift {len(right)}, interval covers {covered:.1%}, onset off by {np.median(late):.3f} s median"
    )
    print(f"  more than one fault declared: {sum(len(one.faults) > 1 for one in outcomes)}")
    assert not_below(covered, 0.90, len(outcomes))
    assert {one.shape for one in outcomes} <= {"drift", "none"}


def test_figure_5_16_without_a_fault(flown: FlightLog, config: Config) -> None:
    """Of what is above the right shape is asked; here of 1 % wanted up to 3 %, as 100 windows know it no better."""
    outcomes = run_all([Trial(seed, None, NOISE) for seed in SEEDS], flown, config)
    shown("no fault", outcomes, wrong=[one for one in outcomes if one.faults])
    assert not_below(float(np.mean([not one.faults for one in outcomes])), 0.97, len(outcomes))


@LONG
def test_the_shipped_table_beside_it(flown: FlightLog) -> None:
    """No bar: the shipped thresholds are those of real flights, so a weak drift in a quiet record stays below them."""
    config = merge(Config(), {**AT_10_HZ, "start_time.shapes": ["bias", "drift"]})
    for fault in (BIAS, DRIFT):
        outcomes = run_all([Trial(seed, fault, NOISE) for seed in SEEDS], flown, config)
        shapes = [one.shape for one in outcomes]
        print(f"\n{fault.shape}, shipped table: { ({shape: shapes.count(shape) for shape in sorted(set(shapes))}) }")
        assert set(shapes) <= {fault.shape, "none"}


@pytest.fixture(scope="module")
def manoeuvred(flights: Path) -> FlightLog:
    """Return the 3-2-1-1 of the nonlinear simulation, without noise."""
    return read_log(flights / "sim_ae4320_de3211_1.h5").window(19.0, 50.7 if FULL else 40.0)


def oscillation(seed: int, log: FlightLog) -> Fault:
    """Draw frequency, start and end, at least three cycles apart and where the scan looks for them."""
    rng = np.random.default_rng([6, seed])
    frequency = float(rng.uniform(*BAND_HZ))
    first, last = float(log.time_s[0]) + FREE_START_S, float(log.time_s[-1]) - FREE_END_S
    shortest = CYCLES / frequency
    start = float(rng.uniform(first, last - shortest))
    end = float(rng.uniform(start + shortest, last))
    return Fault(shape="sine", magnitude=MAGNITUDE, frequency_hz=frequency, onset_s=start, offset_s=end)


@pytest.mark.realdata
@pytest.mark.parametrize("calibration", ["shipped", pytest.param("same noise", marks=LONG)])
def test_oscillations_of_unknown_frequency_start_and_end(
    manoeuvred: FlightLog, tmp_path: Path, calibration: str
) -> None:
    config = merge(Config(), ENDS)
    if calibration == "same noise":
        config = calibrated(manoeuvred, config, noise=ENDS_NOISE, windows=ENDS_WINDOWS, folder=tmp_path)
    # A trial takes as long as fifty of the figures.
    trials = [Trial(seed, oscillation(seed, manoeuvred), ENDS_NOISE) for seed in (SEEDS if FULL else SEEDS[:1])]
    outcomes = run_all(trials, manoeuvred, config)
    declared = [one for one in outcomes if one.shape == "sine"]
    right = [one for one in declared if is_located(one)]
    errors = [abs(abs(one.first.magnitude) / MAGNITUDE - 1.0) for one in declared]
    shown(f"oscillation, {calibration} table", outcomes, wrong=[one for one in outcomes if one not in right])
    print(f"  declared {len(declared)}, of these located {len(right)}, magnitude off by {np.median(errors):.1%} median")
    print(f"  more than one fault declared: {sum(len(one.faults) > 1 for one in outcomes)}")
    assert right
    assert np.median(errors) <= 0.05
    assert not_below(len(right) / len(declared), 0.90, len(declared))
    assert not_below(len(declared) / len(outcomes), 0.90, len(outcomes))


def is_located(outcome: Outcome) -> bool:
    """Say whether the frequency is within 0.02 Hz and the start within half a period."""
    found, truth = outcome.first.fault, outcome.trial.fault
    assert truth is not None
    assert truth.frequency_hz is not None
    assert found.frequency_hz is not None
    return abs(found.frequency_hz - truth.frequency_hz) <= 0.02 and abs(outcome.late_s) <= 0.5 / truth.frequency_hz
