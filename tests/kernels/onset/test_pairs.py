"""Start and end together, and a sine of unknown frequency: exact per pair, and the best pair of all."""

from __future__ import annotations

import numpy as np
import pytest
from bars import not_above
from plain_onset import plain_rss, random_record, record, signal, waveforms
from trials import sized

from bfi_cli.kernels.onset import waveform as shapes
from bfi_cli.kernels.onset.frequency import MIN_CYCLES, scan_frequency, scan_frequency_ends
from bfi_cli.kernels.onset.pairs import climb, pair_limits, scan_ends, scan_pairs, screen_pairs, tabulate_pairs
from bfi_cli.kernels.onset.scan import prepare_scan, scan_shape

N = 400
CLOSED = ("bias", "drift", "lagged bias", "ramp-hold", "sine", "slow sine")


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("order", [1, 4, 10])
@pytest.mark.parametrize("n_outputs", [1, 2])
def test_rss_of_a_pair_is_that_of_a_plain_least_squares(name, order, n_outputs):
    u, y = record(N, n_outputs=n_outputs)
    waveform, channel = waveforms(N)[name], n_outputs - 1
    y[:, channel] += 20.0 * signal(waveform, 170, 260)
    scan = prepare_scan(u, y, order=order, channel=channel)
    pairs = np.array([[3 * order, 170, 172, 230], [3 * order + 18, 260, 320, N - 2 * order]])
    found = scan_pairs(scan, tabulate_pairs(scan, waveform), pairs)
    for k, (start, end) in enumerate(pairs.T):
        theta = signal(waveform, start, end)
        expected = plain_rss(u, y, theta, z=found.z[k], order=order, channel=channel)
        assert found.rss[k] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("name", CLOSED)
def test_an_end_after_the_last_sample_is_no_end(name):
    u, y = record(N)
    y[170:] += 0.3
    scan, waveform = prepare_scan(u, y, order=4), waveforms(N)[name]
    onsets = np.arange(20, 360, 7)
    pairs = scan_pairs(scan, tabulate_pairs(scan, waveform), np.stack([onsets, np.full_like(onsets, N)]))
    np.testing.assert_allclose(pairs.statistic, scan_shape(scan, waveform, onsets).statistic, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", CLOSED)
def test_screening_never_promises_too_much(name):
    u, y = record(N)
    y[170:260] += 0.2
    scan, waveform = prepare_scan(u, y, order=4), waveforms(N)[name]
    pairs = pair_limits(scan, waveform).pairs(np.arange(12, 390, 23), np.arange(12, 390, 23))
    tables = tabulate_pairs(scan, waveform)
    rough, exact = screen_pairs(scan, tables, pairs), scan_pairs(scan, tables, pairs).statistic
    assert (rough >= 0.0).all()
    assert (rough <= exact + 1e-6).all()


@pytest.mark.first_rows(2)
@pytest.mark.parametrize("name", ["bias", "drift", "sine"])
@pytest.mark.parametrize("order", [4, 10])
def test_a_clear_fault_is_found_from_start_to_end(name, order):
    u, y = record(N)
    waveform = waveforms(N)[name]
    y[:, 0] += 1.5 * signal(waveform, 151, 263)
    found = scan_ends(prepare_scan(u, y, order=order), waveform)
    assert abs(found.start - 151) <= 1
    assert found.end == 263
    best, profile = found.over_starts.best, found.over_starts
    assert abs(profile.z[best] - 1.5) < 5.0 * profile.sd[best]
    assert profile.onsets[best] == found.start
    assert profile.statistic[best] == found.statistic


def test_pairs_to_consider_are_all_that_fit():
    scan = prepare_scan(*record(60), order=4)
    limits = pair_limits(scan, shapes.bias(60))
    fitting = {(a, b) for a in range(60) for b in range(61) if a >= 12 and b <= 60 - 8 and b - a >= 8}
    starts = {tuple(pair) for end in range(20, 53) for pair in limits.starts(end).T.tolist()}
    ends = {tuple(pair) for start in range(12, 45) for pair in limits.ends(start).T.tolist()}
    everything = {tuple(pair) for pair in limits.pairs(np.arange(12, 53), np.arange(12, 53)).T.tolist()}
    assert starts == ends == everything == fitting


def suboptimal(seed):
    """Return whether the scan of every pair beats the search, in a random record with or without a fault."""
    rng = np.random.default_rng(seed)
    n, order = 240, int(rng.choice([2, 4]))
    u, y = random_record(n, rng)
    name = ("bias", "drift", "sine", "lagged bias")[seed % 4]
    waveform = waveforms(n)[name]
    start = int(rng.integers(3 * order, 150))
    theta = signal(waveform, start, int(rng.integers(start + 20, n - 2 * order)))
    y = y + 10 ** rng.uniform(-1.0, 1.0) * (rng.random() < 0.7) * theta[:, None]
    scan = prepare_scan(u, y, order=order)
    limits = pair_limits(scan, waveform)
    every = np.arange(limits.first, limits.last + 1)
    exhaustive = scan_pairs(scan, tabulate_pairs(scan, waveform), limits.pairs(every, every))
    return scan_ends(scan, waveform).statistic < exhaustive.statistic.max() - 1e-3


@pytest.mark.slow
def test_the_best_pair_is_found():
    assert sum(suboptimal(seed) for seed in range(4)) == 0


@pytest.mark.slow
def test_the_best_pair_is_found_in_94_of_100_random_cases(capsys):
    """Of 200 where BFI_FULL=1 is set, else of 50: a search that misses 20 % fails with a chance of 81 %."""
    n = sized(200, 0.25)
    count = sum(suboptimal(seed) for seed in range(1000, 1000 + n))
    with capsys.disabled():
        print(f"\nbest of all pairs missed in {count} of {n} random cases")
    assert not_above(count / n, 0.06, n)


def test_a_climb_from_a_start_with_no_room_behind_it_begins_at_the_last_that_has():
    scan = prepare_scan(*record(120), order=4)
    tables = tabulate_pairs(scan, shapes.bias(scan.n_samples))
    limits = pair_limits(scan, shapes.bias(scan.n_samples))
    latest = limits.last - limits.shortest
    reached = [climb(scan, tables, limits=limits, begin=[(start, limits.last)]) for start in (latest, latest + 3)]
    assert reached[0] == reached[1]


def test_a_fault_that_does_not_fit_is_refused():
    u, y = record(60)
    ramp = shapes.ramp_hold(60, duration=50.0)
    with pytest.raises(ValueError, match="a fault of 50 samples does not fit between samples 12 and 52"):
        scan_ends(prepare_scan(u, y, order=4), ramp)


def best_sine(n, frequency):
    return shapes.sine(n, angle=2 * np.pi * frequency)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("frequency", [0.0571, 0.1321])
def test_an_unknown_frequency_is_found_with_its_onset(frequency):
    u, y = record(300)
    y[:, 0] += 0.8 * signal(best_sine(300, frequency), 143)
    scan = prepare_scan(u, y, order=4)
    found = scan_frequency(scan, (3 / 300, 0.2))
    profile, truth = (scan_shape(scan, best_sine(300, f)) for f in (found, frequency))
    assert profile.onsets[profile.best] == 143
    assert found == pytest.approx(frequency, abs=0.1 / 157)
    assert profile.statistic.max() > truth.statistic.max() - 0.5
    grid = [scan_shape(scan, best_sine(300, f)).statistic for f in np.linspace(3 / 300, 0.2, 20)]
    assert profile.statistic.max() > np.max(grid)


@pytest.mark.slow
def test_frequency_start_and_end_are_found_together():
    u, y = record(160)
    y[:, 0] += 0.8 * signal(best_sine(160, 0.11), 60, 101)
    scan = prepare_scan(u, y, order=4)
    found = scan_frequency_ends(scan, (0.05, 0.15))
    span, truth = (scan_ends(scan, best_sine(160, f)) for f in (found, 0.11))
    assert abs(span.start - 60) <= 1
    assert abs(span.end - 101) <= 1
    assert found == pytest.approx(0.11, abs=0.1 / 41)
    assert span.statistic > truth.statistic - 0.5


@pytest.mark.slow
def test_frequencies_that_do_not_fit_the_record_are_cut():
    """A band whose lowest frequency has half a period in the record gives what the band without it gives."""
    u, y = record(60)
    y[:, 0] += 0.8 * signal(best_sine(60, 0.11), 18, 42)
    scan = prepare_scan(u, y, order=4)
    lowest = MIN_CYCLES / (60 - 5 * 4 - 1)
    assert scan_frequency_ends(scan, (0.5 / 60, 0.15)) == scan_frequency_ends(scan, (lowest, 0.15))


@pytest.mark.parametrize("band", [(0.0, 0.1), (0.2, 0.1), (0.1, 0.6)])
def test_a_band_outside_what_samples_can_show_is_refused(band):
    u, y = record(60)
    with pytest.raises(ValueError, match=r"the band must lie within 0\.\.0\.5 cycles per sample"):
        scan_frequency(prepare_scan(u, y, order=2), band)
