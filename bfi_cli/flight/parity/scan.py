"""The scan of one window for a fault that grows, in any sensor or pressure line that the residuals involve."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ...kernels import BoolArray, FloatArray, IntArray
from ...kernels.change_scan import steps_and_ramps
from ...kernels.likelihood_ratio import LikelihoodRatio, NoiseModel, Residual, likelihood_ratios, noise_model
from ...kernels.runs import bridged
from .record import STATIC_LEAK, STEP_S, Hypothesis, Record, Rounding, climbing, hypotheses, without_fault
from .residuals import RESIDUALS, Constants, ResidualKind, available, constants_of, weights_of
from .windows import DEFLECTED

# A ramp whose onset lies between two of these loses 0.6 % of its statistic at most; `explain` goes on in whole seconds.
ONSET_STEP_S = 3.0
# Times the size of a small fault: what a fault that has grown makes of a residual besides what a small one does.
# Only that it is many times as large counts: between 3 and 1000 times nothing depends on it.
LARGE = 300.0
# After the window's start and before its end: a slope after the onset takes longer to tell from the slow noise than the
# level before it. Chosen by hand; the shipped tables hold for these.
FIRST_ONSET_S, LAST_ONSET_S = 10.0, 20.0
# MOVED [rad, 1]: change of flaps, and of a gear that is down at 1: more is no play of a sensor. Chosen by hand.
MOVED = {"flaps": DEFLECTED, "gear": 0.2}
# LOST: share of the least noise of a residual below which that of steps changes nothing: a variance of 1 %.
LOST = 0.1
# FEWEST: share of a window's sampled seconds in which a residual must be known. Chosen by hand.
FEWEST = 0.7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WindowScan:
    """What the residuals of a window say of every fault that grows from an onset on.

    Attributes
    ----------
    onsets_s : (n_onsets,) on the log's axis.
    faults : those that a residual shows; ratios : (n_faults, n_onsets) of them.
    kinds : the residuals used; residuals : of each the whitened one, at the seconds where it is known.
    columns : of each (n, m), what is added to it in unknown amounts, at these seconds.
    lacking : what the others lacked, by name.
    """

    onsets_s: FloatArray
    faults: tuple[str, ...]
    ratios: LikelihoodRatio
    kinds: tuple[ResidualKind, ...]
    residuals: tuple[Residual, ...]
    known: tuple[BoolArray, ...]
    columns: tuple[FloatArray, ...]
    constants: Constants
    lacking: Mapping[str, str]

    @property
    def statistic(self) -> float:
        """The largest ratio over faults and onsets."""
        return float(self.ratios.ratio.max())

    @property
    def strongest(self) -> tuple[str, float]:
        """The fault and the onset of the largest ratio."""
        fault, onset = np.unravel_index(int(self.ratios.ratio.argmax()), self.ratios.ratio.shape)
        return self.faults[int(fault)], float(self.onsets_s[int(onset)])

    @property
    def length_s(self) -> float:
        return FIRST_ONSET_S + float(self.onsets_s[-1] - self.onsets_s[0]) + LAST_ONSET_S

    @property
    def weights(self) -> FloatArray:
        """(n_residuals,) what their log-likelihoods are worth of what their noise models say."""
        return weights_of(self.kinds, self.length_s)


@lru_cache(maxsize=64)  # 0.5 MB each at 240 s
def _noise(kind: str, n: int, missing: bytes, levels: tuple[float, ...]) -> NoiseModel:
    model = next(residual for residual in RESIDUALS if residual.name == kind)
    return _noise_beside(model, ~np.frombuffer(missing, dtype=bool), 0.0, np.array(levels))


def _noise_beside(kind: ResidualKind, known: BoolArray, rounding: FloatArray | float, levels: FloatArray) -> NoiseModel:
    """Return the noise of the known seconds of a residual, (n, n) covariance of its rounding beside its own."""
    time_s = STEP_S * np.arange(known.size, dtype=np.float64)
    return noise_model(time_s[known], levels, (kind.slow(time_s) + rounding)[np.ix_(known, known)])


def rounding_of(kind: ResidualKind, slopes: Slopes, roundings: Sequence[Rounding | None]) -> FloatArray | None:
    """Return (n, n) covariance of a residual by the steps of its channels, None where it is lost in its least noise.

    Parameters
    ----------
    slopes : of the residual.
    roundings : of the channel of each fault, None where it has no steps.
    """
    counts, sds = (LOST * kind.levels[0]) ** 2, np.zeros(slopes.values.shape)
    stepped = [(k, x) for k, i in enumerate(slopes.acting.tolist()) if (x := roundings[i]) is not None]
    for k, rounding in stepped:
        sds[:, k] = rounding.sd
    if np.median(np.sum(slopes.largest(sds) ** 2, axis=1)) <= counts:
        return None
    covariance = np.zeros((len(sds), len(sds)))
    for k, rounding in stepped:
        made = slopes.of(k).signatures(rounding.factor())[:, 0]
        covariance += made @ made.T
    return covariance if np.median(covariance.diagonal()) > counts else None


def _noise_of(kind: ResidualKind, slopes: Slopes, roundings: Sequence[Rounding | None], known: BoolArray) -> NoiseModel:
    """Return the noise of the known seconds of a residual, with that of its rounding where it counts."""
    rounding = rounding_of(kind, slopes, roundings)
    if rounding is None:
        return _noise(kind.name, known.size, (~known).tobytes(), tuple(kind.levels.tolist()))
    # A sensor that rests within a step shows no noise there: the level of the flight is not below what the steps make.
    least = 0.0 if kind.rate is not None else float(np.sqrt(np.median(rounding.diagonal())))
    return _noise_beside(kind, known, rounding, np.maximum(kind.levels, min(least, kind.levels[-1])))


def scan_window(
    record: Record,
    *,
    zero_lift: float | None,
    only: Collection[str] | None = None,
    lasting: Collection[str] = (),
    whole: Record | None = None,
) -> WindowScan | None:
    """Return the scan of a window; None where the log allows no residual.

    Parameters
    ----------
    record : the seconds of the window.
    zero_lift : angle of attack of zero lift, rad, where it is known.
    only : names of the residuals to use; None for all that the log allows.
    lasting : faults that began before the window. Whatever constant and drift they may have in it is no evidence.
    whole : what `record` is some seconds of: its slopes are made once for all of its windows.
    """
    kinds, lacking = available(record.channels)
    kinds = tuple(kind for kind in kinds if only is None or kind.name in only)
    if not kinds or not np.isfinite(record.channels["tas"]).any():
        return None
    reason = _reconfigured(record)
    if reason and "lift" not in lacking:
        kinds = tuple(kind for kind in kinds if kind.name != "lift")
        lacking["lift"] = reason
    constants = constants_of(record, zero_lift=zero_lift)
    first, last = record.time_s[0] - 0.5 * STEP_S, record.time_s[-1] + 0.5 * STEP_S
    onsets_s = np.arange(first + FIRST_ONSET_S, last - LAST_ONSET_S + 1e-6, ONSET_STEP_S)
    if not len(onsets_s):
        return None
    _, ramps = steps_and_ramps(record.time_s, onsets_s)
    n, fewest = len(record.time_s), FEWEST * _samples(record)
    possible = hypotheses(record)
    begun = [candidate for candidate in possible if candidate.fault in lasting]
    course = np.column_stack([np.ones(n), (record.time_s - record.time_s[0]) / n])
    roundings = [record.rounding.get(hypothesis.fault) for hypothesis in possible]
    used: list[tuple[ResidualKind, Residual, BoolArray, FloatArray, Slopes]] = []
    for kind in kinds:
        values = residual_values(record, record, constants, kind)
        columns, prior_sd = np.ones((n, 1)), np.array([np.inf])
        if kind.nuisances is not None:
            more, sd = kind.nuisances(record, constants)
            columns, prior_sd = np.column_stack([columns, more]), np.append(prior_sd, sd)
        for hypothesis in begun:
            added = _lasting_columns(kind, constants, record, hypothesis, course)
            columns = np.column_stack([columns, np.nan_to_num(added)])
            prior_sd = np.append(prior_sd, np.full(added.shape[1], np.inf))
        known = np.isfinite(values) & np.isfinite(columns).all(axis=1)
        if np.count_nonzero(known) < fewest:
            lacking[kind.name] = _gaps(record, kind, fewest)
            continue
        slopes = _slopes_in(whole, kind, record, possible, constants)
        noise = _noise_of(kind, slopes, roundings, known)
        residual = Residual.of(noise, values[known], columns[known], prior_sd, ramps[known])
        used.append((kind, residual, known, columns[known], slopes))
    if not used:
        return None
    kinds, residuals, masks, nuisances, sloped = zip(*used, strict=True)
    none = np.empty((0, len(residuals), len(onsets_s)))
    scan = WindowScan(
        onsets_s=onsets_s,
        faults=(),
        ratios=LikelihoodRatio(shown=none, power=none, costs=none),
        kinds=kinds,
        residuals=residuals,
        known=masks,
        columns=nuisances,
        constants=constants,
        lacking=lacking,
    )
    every = likelihood_ratios(residuals, _signatures(sloped, masks, ramps), len(possible))
    shown = every.power.any(axis=(1, 2))
    faults = tuple(possible[i].fault for i in np.flatnonzero(shown))
    ratios = replace(every, shown=every.shown[shown], power=every.power[shown])
    return replace(scan, faults=faults, ratios=ratios) if faults else None


def _samples(record: Record) -> float:
    """Return how many samples a window has where there are no gaps: fewer than seconds in a slower log."""
    n = len(record.time_s)
    sampled = np.flatnonzero(np.any([np.isfinite(values) for values in record.channels.values()], axis=0))
    return n / float(np.median(np.diff(sampled))) if len(sampled) > 1 else float(n)


def _gaps(record: Record, kind: ResidualKind, fewest: float) -> str:
    """Return which channels a residual that has too few values lacks."""
    channels = record.channels
    short = [
        " or ".join(group)
        for group in kind.needs
        if not any(name in channels and np.isfinite(channels[name]).sum() >= fewest for name in group)
    ]
    return ", ".join(f"{names} without gaps" for names in short) or "flight with lift and airspeed"


def _reconfigured(record: Record) -> str:
    """Return what moves that changes the lift at an angle of attack, "" for nothing."""
    for name in ("flaps", "gear"):
        values = record.channels.get(name)
        if values is not None and np.isfinite(values).any() and np.nanmax(values) - np.nanmin(values) > MOVED[name]:
            return f"{name} that stay where they are" if name == "flaps" else f"a {name} that stays where it is"
    return ""


def residual_values(record: Record, original: Record, constants: Constants, kind: ResidualKind) -> FloatArray:
    """Return (n,) of a residual.

    Parameters
    ----------
    original : the record as it was recorded, where `record` is a corrected one; the integral of the kinematic
        acceleration at the log's rate belongs to it.
    """
    values = kind.values(record, constants)
    if kind.rate is None:
        return values
    assert original.gained is not None
    gained = original.gained
    if np.isfinite(gained).any():
        gained = gained - np.nanmean(gained)
    values = values - gained
    if record is not original:
        values = values - _integral(kind.rate(record) - kind.rate(original))
    return values


def without_lasting(record: Record, fault: str, amount: FloatArray) -> Record:
    """Return a record as it would be without a fault of `amount`, (n,), with the integral of its accelerations."""
    other = without_fault(record, fault, amount)
    if record.gained is None:
        return other
    (rate,) = (kind.rate for kind in RESIDUALS if kind.rate is not None)
    return replace(other, gained=record.gained + _integral(rate(other) - rate(record)))


def _integral(rates: FloatArray) -> FloatArray:
    """Return the integral, by the trapezoidal rule as the acceleration itself is integrated, at the seconds.

    What is not known of rates, (n,), is bridged; those of several courses, (n, ..., n_courses), are all known.
    """
    known = np.nan_to_num(bridged(rates)) if rates.ndim == 1 else rates
    if rates.ndim < 3:
        return np.asarray(STEP_S * (np.cumsum(known, axis=0) - 0.5 * known))
    sums = known.copy()
    for before, row in pairwise(sums):  # `cumsum` goes through the memory of many courses column by column
        row += before
    return np.asarray(STEP_S * (sums - 0.5 * known))


def _each_bridged(rates: FloatArray) -> FloatArray:
    """Return (n, n_acting) rates with what is not known of each bridged, 0 where nothing is."""
    if np.isfinite(rates).all():
        return rates
    return np.stack([np.nan_to_num(bridged(rate)) for rate in rates.T], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slopes:
    """What small constant faults make of a residual, over their sizes.

    Attributes
    ----------
    acting : (n_acting,) indices of the faults that move what it reads.
    values : (n, n_acting) of what is not integrated; rate : (n, n_acting) of what is, None where nothing is.
    climb : (n, n_acting) by the rate of the faults: a static pressure that changes shows as a climb; None where none
        does.
    """

    acting: IntArray
    values: FloatArray
    rate: FloatArray | None
    climb: FloatArray | None

    def taken(self, rows: slice, scale: float) -> Slopes:
        """Return some of their samples, times a scale."""
        rate, climb = (None if x is None else scale * x[rows] for x in (self.rate, self.climb))
        return replace(self, values=scale * self.values[rows], rate=rate, climb=climb)

    def of(self, k: int) -> Slopes:
        """Return those of one fault that acts."""
        rate, climb = (None if x is None else x[:, [k]] for x in (self.rate, self.climb))
        return Slopes(acting=self.acting[[k]], values=self.values[:, [k]], rate=rate, climb=climb)

    def largest(self, sds: FloatArray) -> FloatArray:
        """Return (n, n_acting) the largest standard deviations that errors, of `sds` alike, make of it but by climb."""
        largest: FloatArray = np.where(np.isfinite(self.values), np.abs(self.values), 0.0) * sds
        return largest if self.rate is None else largest + _integral(_each_bridged(np.abs(self.rate)) * sds)

    def signatures(self, courses: FloatArray) -> FloatArray:
        """Return (n, n_acting, n_courses) what faults of these courses, (n, n_courses), make of it, 0 if unknown."""
        is_known = np.isfinite(self.values if self.climb is None else self.values + self.climb)
        signatures: FloatArray = np.where(is_known, self.values, 0.0)[:, :, None] * courses[:, None]
        if self.rate is not None:
            signatures -= _integral(_each_bridged(self.rate)[:, :, None] * courses[:, None])
        if self.climb is not None:
            climb, changes = np.where(is_known, self.climb, 0.0), np.gradient(courses, STEP_S, axis=0)
            for i in np.flatnonzero(climb.any(axis=0)).tolist():
                signatures[:, i] += climb[:, i, None] * changes
        return signatures


def slopes_of(kind: ResidualKind, record: Record, faults: Sequence[Hypothesis], constants: Constants) -> Slopes:
    """Return the slopes of a residual at a record, of those faults that move what it reads."""
    small = [record.with_small(hypothesis) for hypothesis in faults]
    acting = [i for i, (_, moved) in enumerate(small) if not moved.isdisjoint(kind.reads)]
    healthy, sizes = kind.values(record, constants), np.array([faults[i].size for i in acting])
    values, rate, climb = np.empty((len(healthy), len(acting))), None, None
    for k, i in enumerate(acting):
        values[:, k] = kind.values(small[i][0], constants) - healthy
    if kind.rate is not None:
        rate, healthy_rate = np.empty(values.shape), kind.rate(record)
        for k, i in enumerate(acting):
            rate[:, k] = kind.rate(small[i][0]) - healthy_rate
        rate /= sizes
    if "altitude_rate" in kind.reads and STATIC_LEAK in (leaking := [faults[i].fault for i in acting]):
        climb, k = np.zeros(values.shape), leaking.index(STATIC_LEAK)
        climb[:, k] = (kind.values(climbing(record, sizes[k]), constants) - healthy) / sizes[k]
    return Slopes(acting=np.array(acting, dtype=np.intp), values=values / sizes, rate=rate, climb=climb)


def fault_signatures(
    scan: WindowScan, record: Record, faults: Sequence[Hypothesis], courses: FloatArray, whole: Record | None = None
) -> list[tuple[IntArray, FloatArray]]:
    """Return by residual which faults act on it, and what they make of it, (n, n_acting, n_courses), by course.

    Parameters
    ----------
    record : where it is linearised; whole : see `scan_window`.
    courses : (n, n_courses).
    """
    sloped = [_slopes_in(whole, kind, record, faults, scan.constants) for kind in scan.kinds]
    return _signatures(sloped, scan.known, courses)


def _signatures(
    sloped: Sequence[Slopes], masks: Sequence[BoolArray], courses: FloatArray
) -> list[tuple[IntArray, FloatArray]]:
    signatures = []
    for slopes, known in zip(sloped, masks, strict=True):
        by_fault = slopes.signatures(courses)
        signatures.append((slopes.acting, by_fault if known.all() else by_fault[known]))
    return signatures


def _slopes_in(
    whole: Record | None, kind: ResidualKind, record: Record, faults: Sequence[Hypothesis], constants: Constants
) -> Slopes:
    """Return `slopes_of` a window: some samples of those of the whole record, but for the wind of the window."""
    if whole is None:
        return slopes_of(kind, record, faults, constants)
    key = kind.name, constants.zero_lift
    if key not in whole.slopes:
        whole.slopes[key] = slopes_of(kind, whole, faults, replace(constants, speed=1.0, wind=(0.0, 0.0)))
    edges_s = record.time_s[[0, -1]] + np.array([-0.5, 0.5]) * STEP_S
    rows = slice(*np.searchsorted(whole.time_s, edges_s).tolist())
    slopes: Slopes = whole.slopes[key].taken(rows, constants.speed if kind.by_speed else 1.0)
    for k, i in enumerate(slopes.acting.tolist()):
        if faults[i].fault == "ground_speed":
            slopes.values[:, [k]] = slopes_of(kind, record, [faults[i]], constants).values
    return slopes


def _lasting_columns(
    kind: ResidualKind, constants: Constants, record: Record, hypothesis: Hypothesis, courses: FloatArray
) -> FloatArray:
    """Return (n, n_courses + 1) what a fault of any size makes of a residual: each course, and the constant squared."""
    sizes = (hypothesis, replace(hypothesis, size=LARGE * hypothesis.size))
    small, large = (slopes_of(kind, record, [size], constants) for size in sizes)
    if not small.acting.size or not large.acting.size:
        return np.zeros((len(courses), courses.shape[1] + 1))
    first = small.signatures(courses)[:, 0]
    return np.column_stack([first, large.signatures(courses[:, :1])[:, 0] - first[:, :1]])
