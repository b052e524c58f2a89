"""A limit of a static relation is a theorem: an error a hundredth above it is told, of either sign, at every onset."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_flights import made_flight
from made_logs import made_log

from bfi_cli.airdata import SENSORS
from bfi_cli.flight.parity.relation_series import Balance, RelationSeries
from bfi_cli.flight.parity.static_relations import LEAST_STEPS, find_static
from bfi_cli.serialization import to_plain

FROM_S, TO_S = 0.0, 120.0
TIME_S = np.arange(0.5, 120.0)
GAIN = {"tas": 1.0, "mach": -340.0, "tat": 0.2}
UNITS = {"tas": "m/s", "mach": "1", "tat": "K", "pitch": "rad", "aoa": "rad"}
LOG = made_log(TIME_S, UNITS, **{name: np.ones(TIME_S.size) for name in UNITS})


def series(
    values: np.ndarray, *, noise_sd: float, resting_step: float = 0.0, gain: dict | None = None
) -> RelationSeries:
    flight = np.column_stack([np.ones(TIME_S.size), 100.0 + np.sin(TIME_S / 9.0), 10.0 * TIME_S])
    channel, *others = gain or GAIN
    rates = np.column_stack([np.gradient(flight[:, 1]), np.gradient(flight[:, 2])])
    return RelationSeries(
        relation=Balance("tas", "m/s", channel, tuple(others), lambda values: 0.0),
        time_s=TIME_S,
        values=values,
        nuisances=np.column_stack([flight, rates]),
        sizes=np.array([np.inf, 0.05, 2e-4, 0.1, 0.02]),
        effects={name: np.full(TIME_S.size, size) for name, size in (gain or GAIN).items()},
        noise_sd=noise_sd,
        resting_step=resting_step,
    )


def noise(kind: str) -> np.ndarray:
    rng = np.random.default_rng(4)
    if kind == "none":
        return np.zeros(TIME_S.size)
    y = rng.standard_normal(TIME_S.size)
    for k in range(1, y.size if kind == "slow" else 0):
        y[k] = 0.9 * y[k - 1] + np.sqrt(0.19) * y[k]
    return 0.1 * y


def found(one: RelationSeries, size: float, shape: str, onset_s: float) -> bool:
    since = TIME_S - onset_s
    course = (since >= 0.0).astype(float) if shape == "bias" else np.maximum(since, 0.0)
    changed = replace(one, values=one.values + size * course)
    return bool(find_static(LOG, FROM_S, TO_S, series=((changed,), ())).findings)


@pytest.mark.parametrize(
    ("kind", "noise_sd", "resting_step"),
    [("white", 0.01, 0.0), ("slow", 0.01, 0.0), ("none", 0.02, 0.0), ("none", 0.001, 0.5), ("white", 0.02, 0.3)],
)
def test_an_error_above_its_limit_is_told(kind: str, noise_sd: float, resting_step: float):
    one = series(noise(kind), noise_sd=noise_sd, resting_step=resting_step)
    limits = find_static(LOG, FROM_S, TO_S, series=((one,), ())).limits
    assert {(limit.channel, limit.shape) for limit in limits} == {(name, s) for name in GAIN for s in ("bias", "drift")}
    for limit in limits:
        if limit.channel != "mach":
            continue
        for k in (0, len(limit.sizes) // 2 - 1, len(limit.sizes) - 1):
            size = 1.01 * limit.sizes[k] * GAIN["mach"]
            assert found(one, size, limit.shape, limit.onsets_s[k])
            assert found(one, -size, limit.shape, limit.onsets_s[k])


def test_the_limit_of_a_channel_is_that_of_its_relation_by_its_part_in_it():
    limits = find_static(LOG, FROM_S, TO_S, series=((series(noise("slow"), noise_sd=0.01),), ())).limits
    by_shape = {shape: {one.channel: one for one in limits if one.shape == shape} for shape in ("bias", "drift")}
    for of_channel in by_shape.values():
        for name, gain in GAIN.items():
            np.testing.assert_allclose(of_channel[name].sizes * abs(gain), of_channel["tas"].sizes)


def test_drifts_are_bounded_that_begin_well_before_the_end():
    one = series(noise("none"), noise_sd=0.02)
    one = replace(one, nuisances=one.nuisances * [1.0, 0.0, 0.0, 0.0, 0.0])
    limits = find_static(LOG, FROM_S, TO_S, series=((one,), ())).limits
    step, drift = (next(one for one in limits if (one.channel, one.shape) == ("tas", s)) for s in ("bias", "drift"))
    # Onsets lie 8 s from the ends; later ones reach little in the window.
    assert (step.onsets_s[0], step.onsets_s[-1]) == (8.0, 112.0)
    assert (drift.onsets_s[0], drift.onsets_s[-1]) == (8.0, 100.0)
    assert np.ptp(step.sizes) < 1e-9
    assert drift.sizes[51] == max(drift.sizes[:52]) < drift.sizes[52]


def test_a_limit_is_no_larger_than_it_must_be():
    """Without noise the smallest change that counts is 3.5 times the least noise: a little less is not told."""
    one = series(noise("none"), noise_sd=0.02)
    (limit,) = (
        limit
        for limit in find_static(LOG, FROM_S, TO_S, series=((one,), ())).limits
        if (limit.channel, limit.shape) == ("tas", "bias")
    )
    assert limit.sizes.max() == pytest.approx(LEAST_STEPS * 0.02)
    assert not any(found(one, 0.99 * limit.sizes.max(), "bias", onset_s) for onset_s in (8.0, 60.0, 112.0))
    # What rounding may make of a channel that rests is no change, and a limit is beyond it.
    resting = replace(one, resting_step=0.5)
    (limit,) = (
        limit
        for limit in find_static(LOG, FROM_S, TO_S, series=((resting,), ())).limits
        if (limit.channel, limit.shape) == ("tas", "bias")
    )
    assert limit.sizes.max() >= 0.25
    assert not any(found(resting, 0.24, "bias", onset_s) for onset_s in (8.0, 60.0, 112.0))


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_relations_the_better_one_bounds_a_channel(order: int):
    calm, rough = series(noise("none"), noise_sd=0.01), series(noise("none"), noise_sd=0.05)
    alone = find_static(LOG, FROM_S, TO_S, series=((calm,), ())).limits
    both = find_static(LOG, FROM_S, TO_S, series=((calm, rough)[::order], ())).limits
    assert to_plain(both) == to_plain(alone)


def test_beside_a_change_that_is_told_nothing_is_excluded():
    one = series(noise("white"), noise_sd=0.01)
    changed = replace(one, values=one.values + 2.0 * (TIME_S >= 60.0))
    answer = find_static(LOG, FROM_S, TO_S, series=((changed,), ()))
    assert answer.findings
    assert answer.limits == ()


def test_channels_of_one_sensor_bound_how_far_they_disagree_and_those_of_others_the_error():
    assert SENSORS["tas"] & SENSORS["tat"]
    shared = find_static(LOG, FROM_S, TO_S, series=((series(noise("white"), noise_sd=0.01),), ())).limits
    assert {one.bounds for one in shared} == {"disagreement"}
    apart = series(noise("white"), noise_sd=0.01, gain={"pitch": 1.0, "aoa": -1.0})
    limits = find_static(LOG, FROM_S, TO_S, series=((apart,), ())).limits
    assert {(one.channel, one.bounds) for one in limits} == {("pitch", "error"), ("aoa", "error")}


def test_two_airspeeds_of_one_sensor_bound_no_error():
    """They agree to a millionth of a metre per second, whatever the pitot tube does."""
    flight = made_flight()
    cas = flight.channels["cas"]
    pair = replace(flight, channels={**flight.channels, "ias": replace(cas, name="ias", source="ias")})
    limits = [one for one in find_static(pair, 240.0, 360.0).limits if one.channel in ("cas", "ias")]
    assert {one.channel for one in limits} == {"cas", "ias"}
    assert {one.bounds for one in limits} == {"disagreement"}
    assert min(one.sizes.max() for one in limits if one.shape == "bias") < 1e-3


def test_a_change_is_told_from_a_statistic_of_twenty_five_on():
    """The largest of 1554 healthy windows is 17."""
    one, told = series(noise("white"), noise_sd=0.01), {}
    for size in np.linspace(0.14, 0.24, 21):
        changed = replace(one, values=one.values + size * (TIME_S >= 60.0))
        answer = find_static(LOG, FROM_S, TO_S, series=((changed,), ()))
        told[answer.relations[0].statistic] = bool(answer.findings)
    assert all(found == (statistic >= 25.0) for statistic, found in told.items())
    assert any(25.0 <= statistic < 32.5 for statistic in told)
    assert any(17.5 < statistic < 25.0 for statistic in told)


@pytest.mark.parametrize(("size", "told"), [(0.0702, True), (0.0690, False)])
def test_a_change_is_none_below_a_whole_step_of_a_quantisation(size: float, told: bool):
    """12^0.5 = 3.46 standard deviations of its rounding."""
    assert found(series(noise("none"), noise_sd=0.02), size, "bias", 60.0) == told
