"""The whole flight through the flight model without a fault: from where the judge starts anywhere in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..kernels import BoolArray, FloatArray
from ..kernels.bounded_filter import Coupling, Stack, StackRun, Transition, filter_stack
from ..kernels.runs import runs
from .fit import fitted_levels
from .model import FlightModel
from .tables import ORDINARY, STATES

CHECK_S = 50  # seconds between the states of the flight that are kept
# JUMP_S [s]: times beside a jump at which the state is free, so that it may take half a minute. A jump at every
# second would cost the likelihood more than most of them are worth.
JUMP_S = (-12, -5, -1, 0, 1, 5, 12)
SET_S, SET_M = range(-2, 6), 100.0  # about a recorded click of the altimeter's knob, and the height of a few
# Seconds before an onset from which its noise is taken, after one that are weighed, after an end, and before an onset
# in which all hypotheses are still the same flight: jumps begin later.
BEFORE_S, AFTER_S, AFTER_END_S, CALM_BEFORE_S = 400, 600, 200, 20
LONGEST_S = 900  # of a fault with an end; what lasts longer is weighed where it begins
# Share of the flight's median airspeed below which one that is predicted there is not read, and how long a fault is
# shown at least.
ZERO, SHOWN_S = 0.35, 60
# The noise of rows and gusts before a place, in that of the flight.
SCALES = (0.65, 1.0, 1.5)
SMOOTHED_S = 200  # beside a part: its courses are medians and means over a minute, one of the other
FAULT_STATES = 2  # of a hypothesis: its value, and the value's rate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bench:
    """A flight model with its levels, filtered over the flight.

    Attributes
    ----------
    y : (n, n_rows) measurements that are weighed.
    R, Q : (n, n_rows) and (n, n_states) variances.
    checks : by second the state before it.
    innovation : (n, n_rows), over their standard deviations, without a fault.
    """

    model: FlightModel
    levels: Mapping[str, float]
    y: FloatArray
    R: FloatArray
    Q: FloatArray
    transition: Transition
    checks: Mapping[int, tuple[FloatArray, FloatArray]]
    innovation: FloatArray

    def without(self, rows: Sequence[str], from_s: float, to_s: float) -> Bench:
        """Return the bench without some rows between two times: a fault is known there."""
        time_s, y = self.model.time_s, self.y.copy()
        inside = (time_s >= from_s) & (time_s < to_s)
        for name in rows:
            if name in self.model.rows:
                y[inside, self.model.row(name)] = np.nan
        return _filtered(replace(self, y=y))


def bench_of(
    model: FlightModel,
    *,
    without: BoolArray | None = None,
    causes: Sequence[tuple[str, float]] = (),
) -> Bench:
    """Return a flight through its model.

    Parameters
    ----------
    without : (n,) seconds that tell no level: those about what is to be weighed.
    causes : of `ORDINARY` that act whatever else does, with their times, s: every hypothesis may jump there.
    """
    levels = fitted_levels(model, without)
    R, Q = model.noise(levels)
    if "setting" in model.states:
        clicks = np.flatnonzero(model.knob)
        for second in np.unique([at + beside for at in clicks for beside in SET_S]):
            if 0 <= second - 1 < model.n:
                Q[int(second) - 1, model.state("setting")] += SET_M**2
    for cause, at_s in causes:
        beside = model.second(at_s) - 1 + np.array(JUMP_S)
        seconds = beside[(beside >= 0) & (beside < model.n)]
        for name, sd in ORDINARY[cause].jumps.items():
            if name in model.states and seconds.size:
                Q[seconds, model.state(name)] += sd**2 / seconds.size
    bench = Bench(
        model=model,
        levels=levels,
        y=model.y,
        R=R,
        Q=Q,
        transition=model.transition(),
        checks={},
        innovation=np.full(model.y.shape, np.nan),
    )
    return _filtered(bench)


def _filtered(bench: Bench) -> Bench:
    """Return the bench with the states of the flight every `CHECK_S`, from each take-off on."""
    model = bench.model
    checks: dict[int, tuple[FloatArray, FloatArray]] = {}
    innovation = np.full(bench.y.shape, np.nan)
    flown = np.flatnonzero(model.frame.airborne)
    first, last = int(flown[0]), int(flown[-1]) + 1
    mean, covariance = model.start, model.start_covariance()
    takeoffs = takeoffs_of(model)
    edges = sorted({*range(first, last, CHECK_S), *takeoffs, last})
    for start, end in pairwise(edges):
        if start in takeoffs and start > first:
            mean, covariance = _after_ground(model, mean, covariance, start)
        checks[start] = mean, covariance
        part = slice(start, end)
        stack = Stack(y=bench.y[part, None], Z=model.Z[part, None], R=bench.R[part, None], Q=bench.Q[part, None])
        run = filter_stack(stack, bench.transition, mean=mean, covariance=covariance)
        mean, covariance = run.final_mean[0], run.final_covariance[0]
        innovation[part] = run.innovation[:, 0]
    return replace(bench, checks=checks, innovation=innovation)


def takeoffs_of(model: FlightModel) -> set[int]:
    """Return the seconds from which on a model flies."""
    return {start for start, _ in runs(model.frame.airborne)}


def _after_ground(
    model: FlightModel, mean: FloatArray, covariance: FloatArray, second: int
) -> tuple[FloatArray, FloatArray]:
    """Return a state whose motion and gusts are free again: those of a new take-off."""
    mean, covariance = mean.copy(), covariance.copy()
    moving = [
        k
        for k, name in enumerate(model.states)
        if name in ("height", "climb", "airspeed", "shown_climb") or STATES[name].memory_s < np.inf
    ]
    covariance[moving] = 0.0
    covariance[:, moving] = 0.0
    for k in moving:
        covariance[k, k] = STATES[model.states[k]].start ** 2
        mean[k] = 0.0
    mean[model.state("height")] = model.coefficients.height[second]
    mean[model.state("airspeed")] = model.coefficients.airspeed[second]
    return mean, covariance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Place:
    """The part of a flight in which a candidate is weighed, with the state before it.

    Attributes
    ----------
    first, end : seconds of the flight; onset, offset : seconds of the part, offset None where none is known.
    R, Q : variances at the noise before the onset.
    jumps : seconds beside an onset or an end at which a state may jump.
    """

    bench: Bench
    first: int
    end: int
    onset: int
    offset: int | None
    scale: float
    R: FloatArray
    Q: FloatArray
    mean: FloatArray
    covariance: FloatArray
    jumps: Sequence[int] = JUMP_S

    def at(self, onset: int, offset: int | None, *, jumps: Sequence[int] = (0,)) -> Place:
        """Return the part for a fault that begins, and ends, at other seconds of it, by default at once."""
        return replace(self, onset=onset, offset=offset, jumps=jumps)

    def until(self, n: int) -> Place:
        """Return the first seconds of the part."""
        n = min(n, self.n)
        offset = None if self.offset is None or self.offset >= n else self.offset
        return replace(self, end=self.first + n, offset=offset, R=self.R[:n], Q=self.Q[:n])

    @property
    def part(self) -> slice:
        return slice(self.first, self.end)

    @property
    def n(self) -> int:
        return self.end - self.first

    @property
    def around(self) -> slice:
        """The part with what the smoothing of a model reaches beside it."""
        return slice(max(self.first - SMOOTHED_S, 0), min(self.end + SMOOTHED_S, self.bench.model.n))

    @property
    def inside(self) -> slice:
        """The part within what is around it."""
        first = self.first - self.around.start
        return slice(first, first + self.n)

    @property
    def before(self) -> slice:
        """The minute of the flight before the onset."""
        onset = self.first + self.onset
        return slice(max(onset - 60, 0), max(onset - 5, 1))

    @property
    def during(self) -> BoolArray:
        """(n,) where the fault lasts."""
        at = np.arange(self.n)
        return (at >= self.onset) & (at < (self.n if self.offset is None else self.offset))


def place_of(
    bench: Bench, onset_s: float, offset_s: float | None, until_s: float = np.inf, *, earlier_s: int = 0
) -> Place | None:
    """Return the part about a candidate; None where the aircraft is on the ground, or has just taken off.

    Parameters
    ----------
    until_s : when the part ends at the latest.
    earlier_s : by how much the onset may be earlier.
    """
    model = bench.model
    at = model.second(onset_s)
    if at >= model.n or not model.frame.airborne[min(at, model.n - 1)]:
        return None
    first = at - earlier_s - CALM_BEFORE_S
    earlier = [second for second in bench.checks if second <= max(at - earlier_s - BEFORE_S, min(bench.checks))]
    last = int(np.flatnonzero(model.frame.airborne)[-1]) + 1
    offset, end = None, at + AFTER_S
    if offset_s is not None and offset_s - onset_s <= LONGEST_S:
        offset = model.second(offset_s)
        end = offset + AFTER_END_S
    end = min(end, last, int(np.searchsorted(model.time_s, until_s)))
    if offset is None:
        end = min(end, _read_until(bench, at))
    if not earlier or first - max(earlier) < CALM_BEFORE_S or end - at < CALM_BEFORE_S:
        return None
    # The noise is chosen before the onset, and is that of every hypothesis.
    mean, covariance = bench.checks[max(earlier)]
    before, scales = slice(max(earlier), first), np.array(SCALES)
    R = bench.R[before, None] * scales[:, None] ** 2
    Q = np.repeat(bench.Q[before, None], scales.size, axis=1)
    gusts = _gusts(model)
    Q[:, :, gusts] *= scales[:, None] ** 2
    stack = Stack(y=bench.y[before, None], Z=model.Z[before, None], R=R, Q=Q)
    run = filter_stack(stack, bench.transition, mean=mean, covariance=covariance)
    chosen = int(np.argmax(run.log_likelihood))
    scale, part = SCALES[chosen], slice(first, end)
    Q_part = bench.Q[part].copy()
    Q_part[:, gusts] *= scale**2
    return Place(
        bench=bench,
        first=first,
        end=end,
        onset=at - first,
        offset=None if offset is None else min(offset, end) - first,
        scale=scale,
        R=bench.R[part] * scale**2,
        Q=Q_part,
        mean=run.final_mean[chosen],
        covariance=run.final_covariance[chosen],
    )


def places_of(bench: Bench, spans: Sequence[tuple[float, float | None]], until_s: float = np.inf) -> list[Place]:
    """Return spans as places of one part of a flight, none where nothing is flown or one begins after what is weighed.

    A margin is over an ordinary explanation that may jump where its span ends: margins of spans with other ends compare
    only with the log density of that.

    Parameters
    ----------
    spans : onset and end of each, s, the end None where none is known.
    """
    ends_s = [end_s for _, end_s in spans if end_s is not None]
    whole = place_of(bench, min(onset_s for onset_s, _ in spans), max(ends_s, default=None), until_s)
    if whole is None:
        return []
    places = []
    for span in spans:
        onset, end = (None if at_s is None else bench.model.second(at_s) - whole.first for at_s in span)
        assert onset is not None
        places.append(whole.at(onset, None if end is None or end >= whole.n else end, jumps=JUMP_S))
    return places if max(place.onset for place in places) + CALM_BEFORE_S <= whole.n else []


def _read_until(bench: Bench, at: int) -> int:
    """Return until when an airspeed is read after a fault without an end: what reads nothing says nothing more."""
    model = bench.model
    from_s = at + SHOWN_S
    if "tas" not in model.rows or from_s >= model.n:
        return model.n
    nothing = np.flatnonzero(bench.y[from_s:, model.row("tas")] < ZERO * model.frame.middle_speed)
    return from_s + int(nothing[0]) if nothing.size else model.n


def _gusts(model: FlightModel) -> list[int]:
    """Return the states that are gusts: processes of less than a minute's memory."""
    return [k for k, name in enumerate(model.states) if STATES[name].memory_s < 60.0]


def jump(place: Place, at: int, sizes: Mapping[str, float]) -> FloatArray:
    """Return (n, n_states) variances of jumps of some standard deviations in all about a second of the part."""
    model = place.bench.model
    Q = np.zeros((place.n, len(model.states)))
    seconds = jump_seconds(place, at)
    for name, sd in sizes.items():
        if name in model.states and seconds.size:
            Q[seconds, model.state(name)] += sd**2 / seconds.size
    return Q


def jump_seconds(place: Place, at: int) -> FloatArray:
    """Return the seconds after which a state may jump about a second of the part."""
    seconds = np.array([at + beside - 1 for beside in place.jumps])
    return seconds[(seconds >= 0) & (seconds < place.n)]


def run_place(
    place: Place,
    *,
    shocks: FloatArray | None = None,
    y: FloatArray | None = None,
    Z: FloatArray | None = None,
    R: FloatArray | None = None,
    extra: FloatArray | None = None,
    extra_Q: FloatArray | None = None,
    extra_start: FloatArray | None = None,
) -> StackRun:
    """Return the filter of hypotheses over a part.

    Parameters
    ----------
    shocks : (n, n_h, n_states) variances beside those of the part.
    y, Z, R : (n, n_h or 1, ...) of hypotheses that are not measured as recorded; those of the part by default.
    extra, extra_Q : (n, n_h, n_rows, 2) loadings of the fault's value and rate, and (n, n_h, 2) variances of these.
    extra_start : (n_h, 2) standard deviations at the start of the part.
    """
    model = place.bench.model
    Q = place.Q[:, None] if shocks is None else place.Q[:, None] + shocks
    mean, covariance, transition = place.mean, place.covariance, place.bench.transition
    if extra is not None:
        n_h, n_x = extra.shape[1], len(model.states)
        moves = np.zeros((place.n, n_h, FAULT_STATES)) if extra_Q is None else extra_Q
        Q = np.concatenate([np.broadcast_to(Q, (place.n, n_h, n_x)), moves], axis=2)
        mean = np.concatenate([mean, np.zeros(FAULT_STATES)])
        whole = np.zeros((n_h, n_x + FAULT_STATES, n_x + FAULT_STATES))
        whole[:, :n_x, :n_x] = covariance
        if extra_start is not None:
            for k in range(FAULT_STATES):
                whole[:, n_x + k, n_x + k] = extra_start[:, k] ** 2
        covariance = whole
        transition = Transition(
            decay=np.concatenate([transition.decay, np.ones(FAULT_STATES)]),
            couplings=(*transition.couplings, Coupling(to=n_x, source=n_x + 1, value=1.0)),
        )
    stack = Stack(
        y=place.bench.y[place.part, None] if y is None else y,
        Z=model.Z[place.part, None] if Z is None else Z,
        R=place.R[:, None] if R is None else R,
        Q=Q,
        extra=extra,
    )
    return filter_stack(stack, transition, mean=mean, covariance=covariance)
