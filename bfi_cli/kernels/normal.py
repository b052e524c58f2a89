"""The normal distribution: the quantile of which every 95 % interval is made."""

__all__ = ["TWO_SIDED_95"]

# Standard deviations to both sides of the mean that hold 95 %.
TWO_SIDED_95 = 1.959963984540054
