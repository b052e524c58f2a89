"""Bars on measured rates: how few successes say that a rate is below its bar, and which lower rates are noticed.

A bar is kept where the count of independent trials does not contradict it: as few successes, or fewer, must have a
chance of more than LEVEL where the rate is what the bar says (the exact binomial test). So a bar says little where the
trials are few, and `noticed` says how little: a rate below that fails with a chance of POWER. It is printed with every
answer; where a test states what it is to notice, a full set that is too small for that fails. A seeded subset is a
smoke check and keeps the same bar. What must be shown, such as that claims are hardly ever wrong, is held against the
other limit: `at_most`.
"""

from __future__ import annotations

import os
from functools import cache

from scipy import optimize, stats

FULL = os.environ.get("BFI_FULL") == "1"
# The chance that a test fails though its bar is met: as that of two standard deviations to one side.
LEVEL = 0.025
# The chance that a test fails where the rate is what it is to notice.
POWER = 0.8


@cache
def fewest(n: int, wanted: float) -> int:
    """Return the fewest successes in n trials that do not contradict a rate of at least `wanted`."""
    count = int(stats.binom.ppf(LEVEL, n, wanted))
    return count if stats.binom.cdf(count - 1, n, wanted) <= LEVEL else count - 1


def power(n: int, wanted: float, worse: float) -> float:
    """Return the chance that n trials contradict `wanted` where the rate is `worse`."""
    return float(stats.binom.cdf(fewest(n, wanted) - 1, n, worse))


@cache
def noticed(n: int, wanted: float) -> float:
    """Return the rate that contradicts `wanted` with a chance of POWER, and lower ones with more; 0 for none."""
    if fewest(n, wanted) == 0:
        return 0.0
    return float(optimize.brentq(lambda rate: power(n, wanted, rate) - POWER, 0.0, wanted))


@cache
def trials_needed(wanted: float, worse: float) -> int:
    """Return from how many trials on a rate of `worse` contradicts `wanted` with a chance of POWER.

    The power falls a little with each trial that does not raise the count that is needed: from here on it stays above.
    """
    n = 1
    for enough in range(1, 100_000):
        if power(enough, wanted, worse) < POWER:
            n = enough + 1
        elif enough > 2 * n + 100:
            return n
    raise ValueError(f"more than 100000 trials tell {worse:g} from {wanted:g}")


def upper_limit(count: int, n: int) -> float:
    """Return the rate above which `count` of n, or fewer, have a chance of LEVEL at most (Clopper and Pearson 1934)."""
    return 1.0 if count >= n else float(stats.beta.ppf(1.0 - LEVEL, count + 1, n - count))


def not_below(share: float, wanted: float, n: int, *, worse: float | None = None) -> bool:
    """Say whether a measured share keeps a bar, and print what the test can notice.

    Parameters
    ----------
    share : of trials that may depend on each other.
    n : how many independent ones they are worth.
    worse : the rate that the full set is to notice; None where the flights leave it to what they are.
    """
    least = noticed(n, wanted)
    kind = "" if FULL else ", a smoke check unless BFI_FULL=1"
    print(
        f"  bar {wanted:.1%}: {share:.1%}, {fewest(n, wanted)} of {n} keep it; {least:.1%} fails with a chance"
        f" of {POWER:.0%}{kind}"
    )
    kept = bool(share * n >= fewest(n, wanted) - 1e-9)
    return kept and not (FULL and worse is not None and least < worse)


def not_above(share: float, wanted: float, n: int, *, worse: float | None = None) -> bool:
    """Say whether a measured share keeps a bar from below, see `not_below`."""
    return not_below(1.0 - share, 1.0 - wanted, n, worse=None if worse is None else 1.0 - worse)


def at_most(count: int, n: int, most: float) -> bool:
    """Say whether `count` of n trials show that a rate is at most `most`; of a seeded subset, that there is none."""
    print(f"  {count} of {n}: at most {upper_limit(count, n):.1%}, to be shown {most:.1%}")
    return upper_limit(count, n) <= most if FULL else count == 0


def most_events(expected: float) -> int:
    """Return the most events that do not contradict that at most so many are expected (Poisson)."""
    return int(stats.poisson.isf(LEVEL, expected))
