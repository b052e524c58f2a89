"""Figure 1 of Bondarenko and Zybin (2020), sensors of a Boeing 747 failing, localised by the data's null space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...aircraft.catalogue import B747, ELEVATORS, ENGINES
from ...aircraft.model import LinearModel, propagate, response
from ...kernels import FloatArray
from ...kernels.nullspace import Criteria, criteria
from ...quantities.text import number
from ...report.content import Panel, ReportContent, curve
from .page import drawing, load, report_content, table
from .record import Settings

Failure = tuple[int, tuple[str, ...]]

# The paper's experiment: samples, columns of its matrices, and the sensors that fail at which sample.
RATE_HZ, N_SAMPLES, WIDTH = 100.0, 61, 10
GAIN = 0.9  # of a failed sensor, not printed
DEFLECTION = np.radians(5.0)  # of the engines' levers
LEVEL = 1e-4  # half way, in decades, between the smallest failure and the largest healthy channel
FAILURES: tuple[Failure, ...] = (
    (10, ("aoa",)),
    (15, ("tas_rate",)),
    (20, ("pitch",)),
    (25, ("pitch_rate",)),
    (30, ("altitude_rate",)),
    (35, ("altitude",)),
    (40, ("tas_rate", "pitch_rate")),
)
KINDS = {"one sample": 1, "to the end": N_SAMPLES}  # samples that a failure lasts
LEAST = 1e-18  # what a log axis shows of zero
LATER = 5  # samples after a failure in which its ratio is followed
PRINTED_A15 = -2.4e-6  # in the paper, where the test data have -2.04e-6

# Condition (30) is shown on systems of two channels.
SHORT_N_SAMPLES, ONSET = 60, 30
COUPLED = np.array([[0.9, 0.3], [-0.2, 0.8]])
DIAGONAL = np.diag([0.9, 0.8])
SEEN = 1e-6  # of the largest magnitude: below it a criterion is called round-off


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A flight with failures.

    Attributes
    ----------
    failures : (sample, channels) of each.
    healthy, measured, u : (n_samples, n_channels) true outputs, those with the failures, inputs.
    null_space : the criteria of the measured ones.
    """

    failures: tuple[Failure, ...]
    healthy: FloatArray
    measured: FloatArray
    u: FloatArray
    null_space: Criteria

    @property
    def expected(self) -> set[tuple[int, str]]:
        """(sample, channel) of every failure."""
        return {(k, name) for k, names in self.failures for name in names}

    @property
    def flagged(self) -> set[tuple[int, str]]:
        """(sample, channel) wherever a criterion rises above the level."""
        above = np.nan_to_num(self.null_space.channel) > LEVEL
        rises = above[1:] & ~above[:-1]
        return {(int(i) + 1, B747.outputs[k]) for i, k in np.argwhere(rises)}

    @property
    def ratios(self) -> list[float]:
        """The ratio of every failure at its sample."""
        return [self.ratio(failure) for failure in self.failures]

    @property
    def shares(self) -> list[float]:
        """Criteria (29) as printed over the measurement errors, in the same units, at the samples of the failures."""
        shares: list[float] = []
        for k, names in self.failures:
            failed = _columns(names)
            at_once = self.null_space.channel[k] * np.abs(self.measured[1 : k + 1]).max(axis=0) * np.sqrt(WIDTH)
            shares += list(at_once[failed] / np.abs(self.measured - self.healthy)[k, failed])
        return shares

    def levels(self, failure: Failure, *, after: int = 0) -> tuple[float, float]:
        """Return the least criterion of the channels that fail, and the largest of those without a failure.

        Both `after` samples after the failure; without a failure means none inside the window.
        """
        i = failure[0] + after
        recent = np.zeros(len(B747.outputs), dtype=bool)
        for k, names in self.failures:
            recent[_columns(names)] |= k <= i <= k + WIDTH
        values = self.null_space.channel[i]
        return float(values[_columns(failure[1])].min()), float(values[~recent].max(initial=0.0))

    def ratio(self, failure: Failure, *, after: int = 0) -> float:
        """Return the ratio of `levels`, no criterion counted below the precision of a number near 1."""
        low, high = self.levels(failure, after=after)
        return low / max(high, float(np.finfo(np.float64).eps) / 2)

    @property
    def worst(self) -> float:
        """The largest criterion of a channel without a failure inside the window, over the last failure's window."""
        return max(self.levels(self.failures[-1], after=after)[1] for after in range(WIDTH))


def _columns(names: Sequence[str]) -> list[int]:
    return [B747.outputs.index(name) for name in names]


def fly(
    failures: Sequence[Failure], *, lasting: int, model: LinearModel = B747, elevators: FloatArray | None = None
) -> Case:
    """Fly the experiment from rest under thrust, every failure a gain of 0.9 during `lasting` samples.

    Parameters
    ----------
    elevators : (n_samples,) deflection of all four, rad; the paper leaves them at rest.
    """
    u = np.zeros((N_SAMPLES, len(model.inputs)))
    u[:, [model.inputs.index(name) for name in ENGINES]] = DEFLECTION
    if elevators is not None:
        u[:, [model.inputs.index(name) for name in ELEVATORS]] = elevators[:, None]
    healthy = response(model, u, rate_hz=RATE_HZ, rule="euler")
    measured = healthy.copy()
    for k, names in failures:
        measured[k : k + lasting, _columns(names)] *= GAIN
    null_space = criteria(measured, u, width=WIDTH)
    return Case(failures=tuple(failures), healthy=healthy, measured=measured, u=u, null_space=null_space)


def blamed(A: FloatArray, gains: tuple[float, float], *, onset: int = ONSET, step: int | None = None) -> FloatArray:
    """Return (2, n_outputs): the criteria at the sample of the failure, and the largest until the window has passed.

    The outputs are the states of x(k+1) = A x(k) + b u(k), driven by two sines or, from the sample `step` on, by a
    first step; sensor k reads gains[k] times its state from `onset` on.
    """
    i = np.arange(SHORT_N_SAMPLES)
    u = np.asarray(np.sin(0.5 * i) + np.sin(1.3 * i) if step is None else i >= step, dtype=np.float64)
    y = propagate(A, u[:, None], x0=np.ones(2))
    y[onset:] *= gains
    values = criteria(y, u[:, None], width=WIDTH).channel
    at = max(onset, ONSET)
    return np.array([values[at], values[at : at + WIDTH].max(axis=0)])


def hankel_b747(settings: Settings) -> ReportContent:
    """Return figure 1 with failures of one sample and to the end, in one flight and alone; it has no choices."""
    page = load("hankel_b747")
    flights = {kind: fly(FAILURES, lasting=lasting) for kind, lasting in KINDS.items()}
    alone = {kind: [fly([failure], lasting=lasting) for failure in FAILURES] for kind, lasting in KINDS.items()}
    settings.report(1, 1)
    together = list(flights.values())
    single = [case for cases in alone.values() for case in cases[:-1]]
    double = [cases[-1] for cases in alone.values()]
    everything = [*together, *single, *double]
    right = all(case.flagged == case.expected for case in everything)

    A = B747.A.copy()
    A[0, 4] = PRINTED_A15
    printed = fly(FAILURES, lasting=1, model=replace(B747, A=A))
    i = np.arange(N_SAMPLES)
    elevators = 0.05 * (np.sin(0.3 * i) + np.sin(0.9 * i) + np.sin(1.7 * i))
    moved = {failure[1]: fly([failure], lasting=N_SAMPLES, elevators=elevators).worst for failure in FAILURES}

    hits = {kind: len(case.flagged & case.expected) for kind, case in flights.items()}
    values = {
        "every": page["every"][right],
        "least": min(ratio for case in everything for ratio in case.ratios),
        "width": WIDTH,
        "ready": together[0].null_space.ready,
        "gain": GAIN,
        "hits": {
            kind: f"{hits[kind]} of {len(case.expected)}; {len(case.flagged) - hits[kind]} other alarms"
            for kind, case in flights.items()
        },
        "shares": _range([share for case in (*single, *double) for share in case.shares]),
        "single": _range([ratio for case in single for ratio in case.ratios]),
        "double": _range([ratio for case in double for ratio in case.ratios]),
        "flights": _range([ratio for case in together for ratio in case.ratios]),
        "same": page["same"][printed.flagged == printed.expected],
        "printed": min(printed.ratios),
        "rise_double": alone["to the end"][-1].worst,
        "rise_together": flights["to the end"].worst,
        "rise_moved": max(level for names, level in moved.items() if len(names) == 1),
        "rise_redundant": max(moved[name,] for name in ("aoa", "pitch", "altitude_rate")),
    }
    words = page["words"]
    rows = {
        "together": [_row(kind, case, failure, words) for kind, case in flights.items() for failure in FAILURES],
        "alone": [_row(kind, case, case.failures[0], words) for kind, cases in alone.items() for case in cases],
        "condition_30": _condition_30(),
    }
    figures = {"one sample": "hankel_b747", "to the end": "hankel_b747_persistent"}
    return report_content(
        page,
        values,
        heading=right,
        tables=[table(page, name, body) for name, body in rows.items()],
        drawings=[drawing(page, figures[kind], _panels(case, words), kind=kind) for kind, case in flights.items()],
    )


def _condition_30() -> list[tuple[str, ...]]:
    """Return what two sensors show for failures that hold and break condition (30), and for unseen ones."""
    first, same = (GAIN, 1.0), (GAIN, GAIN)
    cases = (
        ("coupled channels, gain of the first", "no", blamed(COUPLED, first)),
        ("independent channels (diagonal), gain of the first", "yes", blamed(DIAGONAL, first)),
        ("coupled channels, the same gain of both", "yes", blamed(COUPLED, same)),
        ("gain of the first from before the record on", "no", blamed(COUPLED, first, onset=0)),
        ("gain of the first as an input moves for the first time", "no", blamed(COUPLED, first, step=ONSET)),
    )
    return [
        (what, holds, *(f"{value:.1e}" if value > SEEN else "round-off" for value in both.T.ravel()))
        for what, holds, both in cases
    ]


def _range(values: Sequence[float]) -> str:
    return f"{number(min(values), digits=2)} to {number(max(values), digits=2)}"


def _row(kind: str, case: Case, failure: Failure, words: dict[str, str]) -> tuple[str, ...]:
    k, names = failure
    rises = sorted({i for i, name in case.flagged if name in names and abs(i - k) <= LATER})
    low, high = case.levels(failure)
    later = min(case.ratio(failure, after=after) for after in range(1, LATER + 1))
    channels = " and ".join(words[name] for name in names)
    when = ", ".join(f"{i / RATE_HZ:.2f}" for i in rises) or "-"
    shown = (f"{low:.1e}", f"{high:.1e}", f"{case.ratio(failure):.0e}", f"{later:.0e}")
    return (kind, channels, f"{k / RATE_HZ:.2f}", when, *shown)


def _panels(case: Case, words: dict[str, str]) -> list[Panel]:
    """Return the measurement errors and the criteria of every channel."""
    t = np.arange(N_SAMPLES) / RATE_HZ
    peaks = np.maximum.accumulate(np.abs(case.healthy), axis=0)
    errors = np.abs(case.measured - case.healthy) / np.where(peaks > 0.0, peaks, 1.0)
    return [
        Panel(
            x_label="time [s]",
            y_label=label,
            curves=tuple(curve(words[name], t, np.maximum(drawn, LEAST)[:, k]) for k, name in enumerate(B747.outputs)),
            log_y=True,
            levels=levels,
        )
        for label, drawn, levels in (
            ("error [-]", errors, ()),
            ("criterion (29) [-]", case.null_space.channel, (("level", LEVEL),)),
        )
    ]
