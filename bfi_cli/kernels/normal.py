"""The normal distribution: the quantiles of which intervals, limits and powers are made."""

__all__ = ["ONE_SIDED_90", "ONE_SIDED_95", "TWO_SIDED_95"]

# Standard deviations to both sides of the mean that hold 95 %.
TWO_SIDED_95 = 1.959963984540054
# Standard deviations above the mean below which 90 % and 95 % lie.
ONE_SIDED_90, ONE_SIDED_95 = 1.2815515655446004, 1.6448536269514722
