"""The course of an error in a static relation: onsets between seconds, ramps that stop, honest intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.flight.parity import Finding
from bfi_cli.flight.parity.relation_course import with_course, with_onset_of_samples
from bfi_cli.flight.parity.relation_series import Balance, RelationSeries
from bfi_cli.flightlog import Channel, FlightLog

T = np.arange(160.0) + 0.45  # means of seconds
WINDOW = (0.0, 160.0)
RAW = np.arange(0.0, 160.0, 0.1)
FOUND = Finding(
    fault="tas",
    among=("tas",),
    channels=("tas",),
    stage="static relations",
    shape="bias",
    magnitude=1.0,
    sd=0.1,
    unit="m/s",
    onset_s=70.0,
    onset_ci95=(69.0, 71.0),
    statistic=99.0,
    threshold=25.0,
)


def told(error: np.ndarray, *, effect: float = 1.0, noise: float = 0.015, seed: int = 0) -> Finding:
    """Return what is told of an error, at 10 Hz, in a relation with noise that changes slowly."""
    rng = np.random.default_rng(seed)
    slow = np.zeros(T.size)
    for k in range(1, T.size):
        slow[k] = 0.9 * slow[k - 1] + np.sqrt(1.0 - 0.81) * rng.standard_normal()
    series = RelationSeries(
        relation=Balance("tas", "m/s", "tas", ("mach",), lambda values: 0.0),
        time_s=T,
        values=effect * error.reshape(-1, 10).mean(axis=1) + noise * slow,
        nuisances=np.column_stack([np.ones(T.size), np.zeros((T.size, 4))]),
        sizes=np.array([np.inf, 1.0, 1.0, 1.0, 1.0]),
        effects={"tas": np.full(T.size, effect)},
        noise_sd=0.01,
        resting_step=0.0,
    )
    return with_course(series, FOUND, WINDOW, "m/s")


@pytest.mark.parametrize("slope", [-0.03, 0.03])
def test_a_step_is_not_taken_for_what_its_relation_follows(slope: float):
    """The airspeed that a relation follows is the one that errs: of a step it would take the share that it follows."""
    rng = np.random.default_rng(1)
    flown, step = 100.0 + 8.0 * np.sin(T / 9.0), 8.0 * (T >= 70.0)
    rate = np.gradient(flown + step, T)
    none = np.zeros(T.size)
    series = RelationSeries(
        relation=Balance("ias", "m/s", "ias", ("tas",), lambda values: 0.0),
        time_s=T,
        values=step + slope * flown + 0.02 * rng.standard_normal(T.size),
        nuisances=np.column_stack([np.ones(T.size), flown + step, none, rate, none]),
        sizes=np.array([np.inf, 0.05, 2e-4, 0.1, 0.02]),
        effects={"ias": np.ones(T.size)},
        noise_sd=0.02,
        resting_step=0.0,
    )
    found = replace(FOUND, fault="ias", among=("ias",), channels=("ias",))
    follows = with_course(series, found, WINDOW, "m/s")
    answer = with_course(replace(series, speeds={"ias": np.ones(T.size)}), found, WINDOW, "m/s")
    assert abs(follows.magnitude - 8.0) > 0.15
    assert answer.magnitude == pytest.approx(8.0, abs=0.05)


@pytest.mark.parametrize("onset_s", [70.0, 70.2, 70.5, 70.8])
def test_a_step_within_a_second_has_its_whole_size(onset_s: float):
    """A candidate at whole seconds has up to a third less: the mean of that second moves by a part only."""
    answer = told(5.0 * (onset_s - 1e-9 <= RAW))
    assert answer.shape == "bias"
    assert answer.magnitude == pytest.approx(5.0, abs=0.05)
    assert answer.onset_s == pytest.approx(onset_s, abs=0.15)
    assert answer.onset_ci95[0] <= onset_s <= answer.onset_ci95[1]


@pytest.mark.parametrize("lag_s", [1.5, 3.0, 10.0])
def test_a_reading_that_lags_has_its_whole_size(lag_s: float):
    """The nearest step has a third of it, with an interval that says nothing of the rest."""
    answer = told(-5.0 * -np.expm1(-np.maximum(RAW - 60.2, 0.0) / lag_s))
    assert answer.shape == "lagged_bias"
    assert answer.constant_s == pytest.approx(lag_s, rel=0.1)
    assert answer.onset_s == pytest.approx(60.2, abs=0.2)
    assert answer.magnitude == pytest.approx(-5.0, abs=3.0 * (answer.sd or 0.0))
    assert (answer.sd or np.inf) < 0.1


def test_a_step_behind_a_low_pass_has_its_whole_size():
    lag = np.arange(-15, 16)
    taps = np.exp(-0.5 * (lag / 2.5) ** 2)
    step = np.convolve(np.pad(5.0 * (RAW >= 70.3), 15, mode="edge"), taps / taps.sum(), mode="valid")
    answer = told(step)
    assert (answer.shape, answer.constant_s) == ("bias", None)
    assert answer.magnitude == pytest.approx(5.0, abs=0.05)


@pytest.mark.parametrize("onset_s", [70.3, 70.9])
def test_a_step_is_told_beside_a_manoeuvre_that_the_relation_follows_worse(onset_s: float):
    """Between the onsets of a coarse search a step explains less than the manoeuvre seems to."""
    manoeuvre = np.where((RAW >= 110.0) & (RAW < 118.0), np.sin((RAW - 110.0) * np.pi / 8.0), 0.0)
    answer = told(-5.0 * (onset_s <= RAW) + 6.0 * manoeuvre)
    assert answer.shape == "bias"
    assert answer.magnitude == pytest.approx(-5.0, abs=1.0)
    assert answer.onset_s == pytest.approx(onset_s, abs=0.15)


@pytest.mark.parametrize("seconds", [33.0, 60.0])
def test_a_drift_that_stops_has_its_size_and_duration(seconds: float):
    answer = told(0.1 * np.clip(RAW - 50.4, 0.0, seconds), effect=-0.5)
    assert (answer.shape, answer.unit) == ("ramp_hold", "m/s")
    assert answer.constant_s == pytest.approx(seconds, abs=2.5)
    assert answer.magnitude == pytest.approx(0.1 * seconds, abs=0.15)
    assert answer.onset_s == pytest.approx(50.4, abs=2.0)


def test_a_drift_that_goes_on_stays_one():
    answer = told(0.1 * np.maximum(RAW - 50.4, 0.0))
    assert (answer.shape, answer.constant_s, answer.unit) == ("drift", None, "m/s^2")
    assert answer.magnitude == pytest.approx(0.1, rel=0.02)


@pytest.mark.parametrize("onset_s", [70.02, 70.27, 70.5, 70.98])
@pytest.mark.parametrize("lasts_s", [0.1, 3.0])
def test_the_samples_date_a_step_better_than_means_of_a_second(onset_s: float, lasts_s: float):
    """Means of a second leave a second, whatever the rate of the log."""
    rng, kept = np.random.default_rng(0), np.exp(-0.1 / lasts_s)
    noise = 0.05 * rng.standard_normal(RAW.size)
    for k in range(1, RAW.size):
        noise[k] = kept * noise[k - 1] + np.sqrt(1.0 - kept**2) * noise[k]
    values = {"tas": 100.0 + 3.0 * (onset_s <= RAW) + noise, "mach": np.full(RAW.size, 100.0)}
    log = FlightLog(
        path="step.csv",
        time_s=RAW,
        channels={name: Channel(name=name, values=x, unit="m/s", source=name) for name, x in values.items()},
        filters=(),
    )
    n = T.size
    series = RelationSeries(
        relation=Balance("tas", "m/s", "tas", ("mach",), lambda v: v["mach"]),
        time_s=T,
        values=(values["tas"] - values["mach"]).reshape(-1, 10).mean(axis=1),
        nuisances=np.column_stack([np.ones(n), np.zeros((n, 4))]),
        sizes=np.array([np.inf, 1.0, 1.0, 1.0, 1.0]),
        effects={"tas": np.ones(n), "mach": -np.ones(n)},
        noise_sd=0.01,
        resting_step=0.0,
    )
    coarse = with_course(series, FOUND, WINDOW, "m/s")
    answer = with_onset_of_samples(series, coarse, log)
    first_s, last_s = answer.onset_ci95
    assert coarse.onset_ci95[1] - coarse.onset_ci95[0] > 1.0
    assert first_s <= onset_s <= last_s
    assert last_s - first_s < 0.4


@pytest.mark.slow
def test_the_intervals_cover():
    """Of eight, six and more with a probability of 0.994."""
    answers = [told(0.05 * np.clip(RAW - 40.7, 0.0, 55.0), seed=seed, noise=0.05) for seed in range(8)]
    inside = [abs(one.magnitude - 2.75) <= 1.96 * one.sd for one in answers if one.shape == "ramp_hold"]
    assert len(inside) >= 7
    assert sum(inside) >= len(inside) - 2
