"""The statement of a method about a log, and its score."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ...faults import Decision, Fault
from ...kernels import FloatArray
from ...model.result import LogSummary
from ...notes import Note

# Seconds by which an alarm may precede its fault: the low-pass of an analysis at 1 Hz spreads a step that far.
SPREAD_S = 1.0
# "fault": channel and kind of fault are right; "channel": only the channel, the best of a method that tells no kind.
Isolation = Literal["fault", "channel", "no"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspect:
    """One fault that a method declares; None for an attribute that it does not tell.

    Attributes
    ----------
    declared_s : when the method, run in flight, declares it; None for one that looks at the whole window at once.
    """

    channel: str
    shape: str | None = None
    name: str | None = None
    onset_s: float | None = None
    offset_s: float | None = None
    magnitude: float | None = None
    declared_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """What a method says about a log: its decision, and the faults it declares, in any order.

    Attributes
    ----------
    score : evidence for a fault, in units of the method and independent of its threshold, so that thresholds of several
        methods can be set to one rate of false alarms; None for a method without such a number.
    """

    decision: Decision
    suspects: tuple[Suspect, ...] = ()
    score: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """A statement against the injected faults.

    Attributes
    ----------
    isolated : None where nothing was injected.
    onset_error_s, magnitude_error, delay_s : of the first injected fault that was declared: estimated less true onset,
        relative error of the magnitude, time from onset to declaration; None where the method does not tell.
    false_alarms, missed : number of suspects without an injected fault, and of injected faults without a suspect.
    """

    isolated: Isolation | None
    onset_error_s: float | None
    magnitude_error: float | None
    delay_s: float | None
    false_alarms: int
    missed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One method on the log.

    Attributes
    ----------
    statement : None where it did not run; reason says why.
    seconds : of the clock.
    score : None without injected faults in the log's truth.
    agrees : the other methods with the same decision and, where both name channels, the same channels.
    """

    method: str
    summary: str
    statement: Statement | None
    reason: str | None
    seconds: float
    score: Score | None
    agrees: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ComparisonResult:
    """Every method on one log.

    Attributes
    ----------
    truth : injected faults that act in the window; None where the log has no truth.
    outputs : names; time_s : (n_samples,); measured : one (n_samples,) per output.
    """

    log: LogSummary
    truth: tuple[Fault, ...] | None
    outcomes: tuple[Outcome, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    time_s: FloatArray
    measured: tuple[FloatArray, ...]
    notes: tuple[Note, ...] = ()
