"""Bars: the level is kept exactly, the power is what is said, and what is noticed comes nearer with more trials."""

from __future__ import annotations

import math
import re
from pathlib import Path

import bars
import pytest
from bars import (
    LEVEL,
    POWER,
    at_most,
    fewest,
    most_events,
    not_above,
    not_below,
    noticed,
    power,
    trials_needed,
    upper_limit,
)

HERE = Path(__file__).parent
VALIDATION = (HERE.parents[1] / "docs" / "validation.md").read_text("utf-8")
WANTED = (0.5, 0.8, 0.9, 0.95, 0.99)
NUMBERS = (1, 2, 5, 8, 20, 63, 254, 1300)


def chance_below(count: int, n: int, rate: float) -> float:
    """Return the chance of fewer than `count` successes, summed by hand."""
    odds = math.log(rate), math.log1p(-rate)
    ways = (math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1) for k in range(count))
    return math.fsum(math.exp(way + k * odds[0] + (n - k) * odds[1]) for k, way in enumerate(ways))


@pytest.mark.parametrize("wanted", WANTED)
def test_the_level_is_kept_and_no_larger_count_keeps_it(wanted: float):
    for n in range(1, 120):
        count = fewest(n, wanted)
        assert chance_below(count, n, wanted) <= LEVEL + 1e-12
        assert chance_below(count + 1, n, wanted) > LEVEL - 1e-12


@pytest.mark.parametrize("wanted", WANTED)
def test_the_power_is_the_chance_to_fail_and_grows_with_what_is_worse(wanted: float):
    for n in (8, 40, 100):
        chances = [power(n, wanted, worse) for worse in (0.2 * wanted, 0.6 * wanted, 0.8 * wanted, wanted)]
        assert chances[0] == pytest.approx(chance_below(fewest(n, wanted), n, 0.2 * wanted), abs=1e-12)
        assert chances == sorted(chances, reverse=True)
        assert chances[-1] <= LEVEL + 1e-12


@pytest.mark.parametrize("wanted", WANTED)
def test_with_four_times_the_trials_the_power_is_no_less(wanted: float):
    """From trial to trial it is not: a trial more may need no success more."""
    for worse in (0.7 * wanted, 0.9 * wanted):
        assert all(power(4 * n, wanted, worse) >= power(n, wanted, worse) for n in range(2, 100))


@pytest.mark.parametrize("wanted", WANTED)
def test_what_is_noticed_fails_with_its_chance(wanted: float):
    for n in NUMBERS:
        least = noticed(n, wanted)
        assert 0.0 <= least < wanted
        if least:
            assert power(n, wanted, least) == pytest.approx(POWER, abs=1e-6)
        else:
            assert power(n, wanted, 0.0) == 0.0
    assert noticed(8, wanted) < noticed(63, wanted) < noticed(1300, wanted)


@pytest.mark.parametrize(("wanted", "worse"), [(0.95, 0.85), (0.9, 0.8), (0.99, 0.95), (0.5, 0.3)])
def test_from_the_trials_that_are_needed_on_the_power_stays(wanted: float, worse: float):
    n = trials_needed(wanted, worse)
    assert power(n - 1, wanted, worse) < POWER
    assert all(power(more, wanted, worse) >= POWER for more in range(n, 3 * n))


def test_eight_windows_cannot_tell_three_of_four_from_nineteen_of_twenty():
    assert fewest(8, 0.95) == 6
    assert power(8, 0.95, 0.75) < 0.5
    assert noticed(8, 0.95) < 0.6
    assert trials_needed(0.95, 0.85) > 60


def test_two_of_seventy_eight_contradict_one_in_a_hundred_not_and_show_it_less():
    assert not_above(2 / 78, 0.01, 78)
    assert upper_limit(2, 78) > 0.08
    assert upper_limit(0, 78) < 0.05 < upper_limit(1, 78)


@pytest.mark.parametrize("n", NUMBERS)
def test_a_limit_of_a_rate_is_not_exceeded_but_with_the_chance_of_the_level(n: int):
    for count in {0, 1, n // 3, n - 1}:
        if count < n:
            assert chance_below(count + 1, n, upper_limit(count, n)) == pytest.approx(LEVEL, abs=1e-9)
    assert upper_limit(n, n) == 1.0


def test_what_must_be_shown_needs_many_trials_in_the_full_set_and_none_wrong_in_a_part(monkeypatch):
    assert at_most(0, 4, 0.07)
    assert not at_most(1, 400, 0.07)
    monkeypatch.setattr(bars, "FULL", True)
    assert not at_most(0, 4, 0.07)
    assert at_most(1, 400, 0.07)


def test_a_full_set_that_cannot_notice_what_it_is_to_notice_fails(monkeypatch):
    assert not_below(1.0, 0.95, 20, worse=0.85)
    monkeypatch.setattr(bars, "FULL", True)
    assert not_below(1.0, 0.95, 20)
    assert not not_below(1.0, 0.95, 20, worse=0.85)
    assert not_below(1.0, 0.95, trials_needed(0.95, 0.85), worse=0.85)
    assert not not_above(0.0, 0.05, 20, worse=0.15)


@pytest.mark.parametrize("expected", [0.3, 3.0, 24.0])
def test_more_events_than_that_have_a_chance_of_the_level_at_most(expected: float):
    def chance_above(most: int) -> float:
        return 1.0 - math.fsum(math.exp(-expected) * expected**k / math.factorial(k) for k in range(most + 1))

    assert chance_above(most_events(expected)) <= LEVEL + 1e-12
    assert chance_above(most_events(expected) - 1) > LEVEL


def test_every_measurement_has_its_place_in_the_page_and_every_name_there_a_file():
    named = set(re.findall(r"`(test_\w+)`", VALIDATION))
    assert {path.stem for path in HERE.glob("test_*.py")} - named == set()
    assert named - {path.stem for path in HERE.parent.rglob("test_*.py")} == set()


def test_the_table_of_the_page_is_what_the_bars_are():
    rows = re.findall(r"^\| (\d+) \| (\d+) % \| (\d+) \| (\d+) % \|$", VALIDATION, flags=re.MULTILINE)
    assert len(rows) >= 5
    for n, wanted, keep, fails in (map(int, row) for row in rows):
        assert fewest(n, wanted / 100.0) == keep
        assert 100.0 * noticed(n, wanted / 100.0) == pytest.approx(fails, abs=0.5)
