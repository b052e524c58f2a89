"""What is counted of the trials of a scenario: shares with their intervals, and how cells and curves show them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...faults import Decision
from ...faults.shapes import Kind
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


@dataclass(frozen=True, slots=True, kw_only=True)
class EqualRate:
    """A method of `bfi compare` at the same rate of false alarms as the others.

    Attributes
    ----------
    false_alarm : the rate wanted.
    threshold : of the score, from the first half of the trials without a fault: so large that another such trial
        exceeds it with that probability at most. None where they are too few to tell.
    alarms : of the second half of the trials without a fault, those beyond it.
    detected : of this scenario's trials with a score, those beyond it.
    """

    false_alarm: float
    threshold: float | None
    alarms: Proportion
    detected: Proportion


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioSummary:
    """A scenario.

    Attributes
    ----------
    axes : what it is, value by axis.
    trials, failed : how many, and how many gave an error instead of an answer.
    isolation_rate : trials whose declared faults are those added; a failed trial isolates nothing.
    false_alarm_rate : trials with an answer that declare a fault which was not added.
    missed_detection_rate : trials with an answer and faults that do not declare one of them.
    decisions : trials with an answer by their decision; verdicts : by their verdict on each kind of fault.
    wrong_no_fault_rate : trials with an answer and a fault whose largest error in the window exceeds the channel's
        tolerance, in which the verdict that covers such a fault is no_fault.
    coverage : 95 % intervals of rightly declared faults that hold the truth.
    magnitude_error : quantiles over trials with an answer and faults, relative; None where there are none.
    onset_error_s : median size of the errors of the onsets of rightly declared faults.
    seconds : median time of a trial.
    equal_rate : of a method of `bfi compare` that has scores, where the sweep has the same trials without a fault.
    """

    name: str
    axes: Mapping[str, Any]
    trials: int
    failed: int
    isolation_rate: Proportion
    false_alarm_rate: Proportion
    missed_detection_rate: Proportion
    decisions: Mapping[Decision, Proportion]
    verdicts: Mapping[Kind, Mapping[Decision, Proportion]]
    wrong_no_fault_rate: Proportion
    coverage: Proportion
    magnitude_error: Mapping[str, float] | None
    detection_delay_s: float | None
    onset_error_s: float | None
    seconds: float | None
    equal_rate: EqualRate | None = None


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
