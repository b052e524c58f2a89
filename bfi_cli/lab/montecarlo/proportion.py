"""So many of so many: the share, its 95 % Wilson interval, and how cells and curves show it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...kernels import TWO_SIDED_95
from ...quantities.text import number
from ...report.content import Curve, Style, curve


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportion:
    """So many of so many, with the 95 % Wilson interval; None where there are none to count."""

    count: int
    of: int
    rate: float | None
    ci95: tuple[float, float] | None

    def percent(self, digits: int | None = None) -> tuple[str, str, str] | None:
        """Return the rate and the ends of its interval in percent, whole or to some digits; None without trials."""
        if self.rate is None or self.ci95 is None:
            return None
        rate, low, high = (
            f"{100.0 * share:.0f}" if digits is None else number(100.0 * share, digits=digits)
            for share in (self.rate, *self.ci95)
        )
        return rate, low, high


def wilson(count: int, of: int) -> tuple[float, float] | None:
    """Return the 95 % interval of a proportion (Wilson 1927), None without trials."""
    if of == 0:
        return None
    share, z2 = count / of, TWO_SIDED_95**2
    middle = share + z2 / (2 * of)
    half = TWO_SIDED_95 * math.sqrt(share * (1 - share) / of + z2 / (4 * of**2))
    low = 0.0 if count == 0 else (middle - half) / (1 + z2 / of)
    return low, 1.0 if count == of else (middle + half) / (1 + z2 / of)


def proportion(count: int, of: int) -> Proportion:
    """Return so many of so many with their interval."""
    return Proportion(count=count, of=of, rate=count / of if of else None, ci95=wilson(count, of))


def share_cell(share: Proportion | None, digits: int | None = None) -> str:
    """Return a share in percent with its interval: "96 (90-98)", "-" where there is none."""
    percent = None if share is None else share.percent(digits)
    return "-" if percent is None else "{} ({}-{})".format(*percent)


def with_interval(share: Proportion) -> str:
    """Return a share in percent with its interval: "96 % (90 to 98)", "-" where there is none."""
    percent = share.percent()
    return "-" if percent is None else "{} % ({} to {})".format(*percent)


def curve_of_shares(label: str, x: Sequence[float], shares: Sequence[Proportion], *, style: Style) -> Curve:
    """Return the curve of shares in percent, with their intervals."""
    ends = [share.ci95 or (math.nan, math.nan) for share in shares]
    return curve(
        label,
        x,
        [100.0 * (math.nan if share.rate is None else share.rate) for share in shares],
        style=style,
        low=[100.0 * low for low, _ in ends],
        high=[100.0 * high for _, high in ends],
    )
