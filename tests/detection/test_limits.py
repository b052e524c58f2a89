"""What the detector could not have declared: limits follow from the rule that decides, and from nothing else."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import special

from bfi_cli.detection.parity import (
    LASTING,
    LASTING_IN_GUSTS,
    WHITE_ONSETS,
    MonitoringPass,
    monitor_sequentially,
    parity_limits,
)
from bfi_cli.detection.preparation import DecimatedRecord
from bfi_cli.kernels.whiteness import fit_tail

N, HEALTHY, RATE_HZ = 240, 140, 5.0


def recorded(seed: int, growth: float = 1.0) -> DecimatedRecord:
    """Return 48 s of two channels in noise that is larger by a factor in every other quarter."""
    rng = np.random.default_rng(seed)
    size = np.where(np.arange(N) // (N // 4) % 2, growth, 1.0)
    y = np.cumsum(0.1 * rng.standard_normal((N, 2)) * size[:, None], axis=0) * np.array([1.0, 30.0])
    return DecimatedRecord(
        path="made",
        outputs=("one", "two"),
        units=("m/s", "m"),
        rate_hz=RATE_HZ,
        time_s=np.arange(N) / RATE_HZ,
        reach_s=0.0,
        smear_s=0.0,
        y=y,
        u=np.zeros((N, 0)),
        weak=np.zeros(0, dtype=bool),
        healthy=np.arange(N) < HEALTHY,
        watched=np.arange(N) >= HEALTHY,
    )


@cache
def watched(growth: float = 1.0, sizes: tuple[float, float] = (1.0, 1.0)) -> tuple[DecimatedRecord, MonitoringPass]:
    """Return the record, each channel times a size, and the one pass over it, in which nothing fails."""
    samples = recorded(3, growth)
    samples = replace(samples, y=samples.y * np.array(sizes))
    alarms, (first, *_) = monitor_sequentially(samples, false_alarm=0.01)
    assert not alarms
    return samples, first


@pytest.mark.parametrize("growth", [1.0, 4.0])
def test_a_detectable_step_is_declared_with_nine_chances_in_ten_by_the_row_that_sees_it_worst(growth: float):
    """The root of a drop is normal about the step over its deviation, with a standard deviation of one."""
    samples, one = watched(growth)
    drops, lasting = one.drops, one.drops.old_sd.shape[1]
    limits = parity_limits(samples, [one], factor=1.0)
    rows = one.decided[one.decided - one.window + 1 >= one.model.n_healthy - one.model.errors.start]
    assert limits.detectable.shape == (len(rows), 2)
    for row, detectable in zip(rows, limits.detectable / one.model.unit, strict=True):
        chances = []
        for place in range(lasting):
            at = row - lasting + 1 + place
            z = detectable / drops.old_sd[row - lasting + 1 + place, place]
            # The root of the drop that as many of nine chances in ten exceed, as a deviate: `largest_drops` has this.
            root = z - special.ndtri(0.9)
            tail = -0.5 * drops.freedom[at] * np.log1p(root**2 / drops.freedom[at])
            chances.append(-special.ndtri_exp(tail - np.log(2.0)) - one.threshold.level)
        np.testing.assert_allclose(np.min(chances, axis=0), 0.0, atol=1e-6)
    twice = parity_limits(samples, [one], factor=2.0)
    np.testing.assert_allclose(twice.detectable, 2.0 * limits.detectable)
    assert np.all(limits.hidden >= limits.detectable)


def test_in_gusts_what_exceeds_in_one_patch_tells_once_of_those_that_are_not_met():
    calm, gusty = (watched(growth)[1] for growth in (1.0, 4.0))
    assert not calm.threshold.gusty
    assert gusty.threshold.gusty
    # Patches of 10 s to each side, of blocks of 2 s.
    for one, alike in ((calm, 1.0), (gusty, 10.0)):
        held, n_watched = one.threshold, int(np.count_nonzero(one.model.samples >= HEALTHY))
        tail = fit_tail(held.maxima, WHITE_ONSETS * 2 * one.window, alike=alike)
        assert held.tail == pytest.approx(tail.level(0.01 * one.window / n_watched))
        np.testing.assert_allclose(held.level, held.scale * max(held.white, held.tail))


def test_a_deviate_has_to_last_longer_in_gusts():
    assert [watched(growth)[1].drops.old_sd.shape[1] for growth in (1.0, 4.0)] == [LASTING, LASTING_IN_GUSTS]


def test_the_size_of_a_channel_scales_its_limits_alone():
    before, after = (
        parity_limits(samples, [one], factor=1.0) for samples, one in (watched(), watched(sizes=(1.0, -50.0)))
    )
    np.testing.assert_allclose(after.detectable, before.detectable * np.array([1.0, 50.0]), rtol=1e-6)
