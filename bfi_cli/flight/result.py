"""The diagnosis of a flight: frozen data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..decision import Proof, State
from ..decision.implausible import Implausible
from ..faults import Decision
from ..faults.shapes import Kind
from ..flightlog.phases import Phase
from ..kernels import FloatArray
from ..model.result import LogSummary
from ..notes import Note
from ..report.presented import Presented
from .parity.finding import Bound, Explanation, Stage


@dataclass(frozen=True, slots=True, kw_only=True)
class Event(Explanation):
    """One fault of the flight, from what every analysis says of it; what explains its window is that which suits it.

    Attributes
    ----------
    state : declared, or suspected where something else may imitate it.
    kind : abrupt, oscillating or slow, by its shape.
    stages : the analyses that saw it, the one that describes it first.
    ci95 : of its magnitude; None for a line that is held, where no size is known.
    beyond_tolerance : whether its effect, counted on to the last window that shows it, is surely more, or surely no
        more, than what is tolerated of every channel; None where its interval holds that, or it has no size.
    seen_until_s : end of the last window that shows it.
    window_s : the window that describes it.
    note : what limits the answer, "" for nothing; repeat : what a repeated flight should record, "" for nothing.
    margin : log density of the flight model for the fault over the best ordinary cause; None where it was not weighed.
    refuted_by : channels that speak against it there.
    count, times_s, duration_s : of short defects (dropout, frozen, spikes) how many, when each begins, and how long
        they last together; None for another fault.
    """

    state: State
    kind: Kind
    stages: tuple[Stage, ...]
    ci95: tuple[float, float] | None = None
    beyond_tolerance: bool | None
    seen_until_s: float
    window_s: tuple[float, float]
    note: str = ""
    repeat: str = ""
    count: int | None = None
    times_s: tuple[float, ...] | None = None
    duration_s: float | None = None
    margin: float | None = None
    refuted_by: tuple[str, ...] = ()

    @property
    def shown_s(self) -> tuple[float, float]:
        """From its onset to its end, or to that of the last window that shows it."""
        return self.onset_s, self.seen_until_s if self.offset_s is None else self.offset_s


@dataclass(frozen=True, slots=True, kw_only=True)
class OrdinaryEvent:
    """What happens in any flight, and looked like a fault or stands out by itself.

    Attributes
    ----------
    cause : by its name in `bfi_cli.flight.tables.ORDINARY`.
    from_s, to_s : on the log's axis; to_s is None where it lasts.
    magnitude, unit, ci95 : of the fault that it looks like, or of the jump that stands out; None where it has none.
    looks_like : that fault, "" for none.
    evidence : log densities: `gain` of the cause over none, `margin` of the fault, or of the best one, over the cause.
    stated : whether the engineer states it, in `diagnose.events`.
    """

    cause: str
    from_s: float
    to_s: float | None
    magnitude: float | None
    unit: str
    ci95: tuple[float, float] | None
    looks_like: str
    evidence: Mapping[str, float]
    stated: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimit:
    """What a flight excludes of a fault and shape: magnitudes above `excluded_above`.

    Attributes
    ----------
    bounds : the error of the channel, or how far it disagrees with channels that share a sensor with it.
    holds_in : the share of the watched time in which it holds: 1 for the worst stretch, 0.95 beside it.
    grows_on : whether it is that of a fault that grows beyond a window until a later one would have shown it.
    excluded_above, effect : None where any size could hide; effect is the error on `channel` that this magnitude makes
        by `to_s`, in `effect_unit`.
    seen_above, seen_effect : magnitude from which on the fault would be declared with 90 % power in that share of the
        time, and the error that it makes within `seen_within_s`, a window; None where it is not known or none would.
    within_tolerance : whether that is no more than the channel's tolerance there.
    from_s, to_s : of the window; where the fault grows on, from its onset.
    """

    fault: str
    shape: str
    channel: str
    bounds: Bound
    holds_in: float
    grows_on: bool
    excluded_above: float | None
    unit: str
    effect: float | None
    effect_unit: str
    tolerance: float | None
    within_tolerance: bool
    from_s: float
    to_s: float
    seen_above: float | None = None
    seen_effect: float | None = None
    seen_within_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LimitCourse:
    """The limit of a drift over the flight.

    Attributes
    ----------
    time_s, excluded_above : (n,) by onset every ten seconds, in `unit`; NaN where nothing bounds it.
    mostly, worst : what 95 % of the watched time exclude, and all of it.
    """

    fault: str
    unit: str
    time_s: FloatArray
    excluded_above: FloatArray
    mostly: float
    worst: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """One window of the parity scan.

    Attributes
    ----------
    residuals : that were used.
    statistic, threshold, p_value : the largest ratio over faults and onsets.
    fault, onset_s : where it is largest.
    """

    from_s: float
    to_s: float
    residuals: tuple[str, ...]
    statistic: float
    threshold: float
    p_value: float | None
    fault: str
    onset_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strip:
    """The evidence of one residual, or of an analysis, over the flight: (n,) share of its threshold."""

    name: str
    time_s: FloatArray
    share: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """The course of an event: of its window, what its residual shows beside the named shape, in `unit`.

    Attributes
    ----------
    event : its index.
    time_s, free, low, high : (n,) of a course of any shape with its band; named : (n,) of the named shape.
    """

    event: int
    channel: str
    unit: str
    time_s: FloatArray
    free: FloatArray
    low: FloatArray
    high: FloatArray
    named: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class DiagnoseResult(Presented):
    """The result of `diagnose_flight`.

    Attributes
    ----------
    verdicts : on each kind of fault; decision : on those required.
    summary : what the log says of the kinds of which no fault is declared.
    events : the largest over its tolerance first; deviations : what is surely within the tolerances, and no fault.
    ordinary : ordinary causes that looked like a fault, or that stand out by themselves.
    limits : per fault and shape.
    unwatched : (from_s, to_s, why) of half a minute of flight and more that an analysis did not cover.
    windows : of the parity scan.
    missing : what the log lacks, and what that costs.
    zero_lift_rad : angle of attack of zero lift, None where it is not known; zero_lift_from : where it comes from.
    proved : what the limits are worth on this flight; empty where that was not asked for.
    time_s : (n,) once a second; measured, corrected : by channel, NaN where corrected says nothing.
    """

    makers = ("flight.report", "diagnose_content", "diagnose_document")

    log: LogSummary
    decision: Decision
    verdicts: Mapping[Kind, Decision]
    summary: str
    events: tuple[Event, ...]
    deviations: tuple[Event, ...]
    limits: tuple[FlightLimit, ...]
    unwatched: tuple[tuple[float, float, str], ...]
    phases: tuple[Phase, ...]
    windows: tuple[Look, ...]
    missing: tuple[str, ...]
    false_alarm: float
    zero_lift_rad: float | None
    zero_lift_from: str
    time_s: FloatArray
    measured: Mapping[str, FloatArray]
    corrected: Mapping[str, FloatArray]
    units: Mapping[str, str]
    strips: tuple[Strip, ...]
    limit_courses: tuple[LimitCourse, ...]
    courses: tuple[Course, ...]
    notes: tuple[Note, ...]
    plausibility: tuple[Implausible, ...] = ()
    ordinary: tuple[OrdinaryEvent, ...] = ()
    proved: tuple[Proof, ...] = ()

    @property
    def is_trusted(self) -> bool:
        """Whether the log could tell."""
        return self.decision != "inconclusive"
