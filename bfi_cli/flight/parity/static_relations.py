"""What the static relations of a flight say of a window: an air-data computer, or a second sensor, that disagrees."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter

import numpy as np

from ...airdata.relations import AIR
from ...faults.shapes import SHAPES
from ...flightlog import FlightLog
from ...kernels import CHI_SQUARE_95, BoolArray, FloatArray
from ...kernels.change_scan import ChangeScan, steps_and_ramps
from .finding import AS_GOOD, Bound, Finding, Hidden, squares_by_onset
from .relation_series import AVERAGED, BLOCK_S, RelationSeries, Series, quantity_measured, relation_series
from .sampled import unit_of
from .stuck import stuck_errors

# Onsets lie this far from the ends of a window: a change needs both sides.
MARGIN_S = 8.0
# Drifts are excluded that begin so long before that, as in the parity scan: 20 s before the end of a window.
LATE_S = 12.0
FEWEST_BLOCKS = 40  # of a window; with fewer the two sides of a change say nothing of the noise's correlation
# Twice the gain in log-likelihood. In 1554 windows of 120 and 240 s of two recorded flights, 10 s apart, the largest of
# what is large enough (`LEAST_STEPS`) is 17; an error of 0.1 m/s of tas has 50 and more.
THRESHOLD = 25.0
# A change is declared where the largest error that it makes is this many times the least noise: a quantity that rests
# at the edge between two steps of a quantisation changes by a whole one, 12^0.5 standard deviations.
LEAST_STEPS = 3.5


@dataclass(frozen=True, slots=True, kw_only=True)
class RelationAnswer:
    """What one relation says of a window.

    Attributes
    ----------
    channels : that stand in it.
    statistic, threshold : twice the gain in log-likelihood of the best change, and what it takes.
    effect : largest error of the relation in the window under the best change; `least_effect` what it takes.
    declares : whether a change of it is a fault.
    """

    name: str
    channels: tuple[str, ...]
    statistic: float
    threshold: float
    effect: float
    least_effect: float
    declares: bool

    @property
    def changes(self) -> bool:
        """Whether the relation is broken in the window: both statistic and size are asked for."""
        return self.statistic >= self.threshold and self.effect >= self.least_effect


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticRelations:
    """What the static relations of a log say of a window.

    Attributes
    ----------
    findings : none or one, the change that the relations show best.
    relations : of every relation that the log has.
    limits : by channel and shape, what a change of it could not have been.
    """

    findings: tuple[Finding, ...]
    relations: tuple[RelationAnswer, ...]
    limits: tuple[Hidden, ...]


_Stuck = tuple[float, Finding]  # twice the negative log-likelihood, but for a constant, and the sensor that is stuck


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scanned:
    """A relation in a window.

    Attributes
    ----------
    effects : by channel, what one unit of its error adds to the relation.
    reach : (n_candidates,) the largest value of each candidate in the window, of size 1.
    stuck : its sensors as stuck ones, the likeliest first; empty where no step or ramp is as bad.
    """

    series: RelationSeries
    scan: ChangeScan
    effects: Mapping[str, float]
    reach: FloatArray
    stuck: tuple[_Stuck, ...]

    @property
    def least(self) -> FloatArray:
        """Sizes of the candidates from which on a change is told.

        Where a channel rests, what rounding takes away may follow any course of at most half a step.
        """
        leverage = np.where(np.isfinite(self.scan.leverage), self.scan.leverage, 0.0)
        return np.maximum(LEAST_STEPS * self.series.noise_sd / self.reach, 0.5 * self.series.resting_step * leverage)

    @property
    def hidden(self) -> FloatArray:
        """Largest sizes of the candidates that, added to the window, may not be told."""
        return np.maximum(self.scan.hidden, np.abs(self.scan.amplitude) + self.least)

    def not_overruled(self, changed: Sequence[_Scanned]) -> tuple[_Stuck, ...]:
        """Return what is stuck, without a sensor whose twin is at odds with a third channel while it is not itself."""
        at_odds = [relation.effects.keys() for relation in changed if relation.effects.keys() & self.effects.keys()]
        return tuple(stuck for stuck in self.stuck if all(stuck[1].fault in channels for channels in at_odds))

    @property
    def best(self) -> int:
        """The candidate that explains it best among those that are large enough, of all where none is."""
        large = np.abs(self.scan.amplitude) >= self.least
        statistic = self.scan.statistic
        return int(np.argmax(np.where(large, statistic, -1.0) if large.any() else statistic))

    @property
    def answer(self) -> RelationAnswer:
        best, reached = self.best, self.reach[self.best]
        statistic, effect = float(self.scan.statistic[best]), abs(float(self.scan.amplitude[best] * reached))
        least_effect = float(self.least[best] * reached)
        if self.stuck:
            _, stuck = self.stuck[0]
            statistic, effect = stuck.statistic, abs(stuck.effect[stuck.fault] * self.effects[stuck.fault])
            least_effect = LEAST_STEPS * self.series.noise_sd
        return RelationAnswer(
            name=self.series.relation.name,
            channels=tuple(self.effects),
            statistic=statistic,
            threshold=THRESHOLD,
            effect=effect,
            least_effect=least_effect,
            declares=self.series.relation.declares,
        )


def find_static(log: FlightLog, from_s: float, to_s: float, *, series: Series | None = None) -> StaticRelations:
    """Return the channel that disagrees with the others in a window, from some time on, if there is one.

    Parameters
    ----------
    log : the whole log rather than the window, which shows its noise and steps better.
    series : of the same log by `relation_series`, where many windows are looked at; None to make them.
    """
    every, _ = relation_series(log) if series is None else series
    scanned: list[_Scanned] = []
    onsets_s = np.arange(np.ceil(from_s + MARGIN_S), to_s - MARGIN_S + 1e-9, BLOCK_S)
    reach = np.concatenate([np.ones(onsets_s.size), to_s - onsets_s])
    for part in (whole.between(from_s, to_s) for whole in every):
        if len(part.time_s) < FEWEST_BLOCKS or not onsets_s.size:
            continue
        candidates = np.hstack(steps_and_ramps(part.time_s, onsets_s))
        scan = part.scan(candidates, declared_at=THRESHOLD)
        effects = {name: float(np.nanmedian(effect)) for name, effect in part.effects.items()}
        effects = {name: effect for name, effect in effects.items() if effect}  # at rest a temperature has none
        stuck = tuple(_stuck_sensors(part, onsets_s, candidates, effects))
        scanned.append(_Scanned(series=part, scan=scan, effects=effects, reach=reach, stuck=stuck))
    changed = [relation for relation in scanned if relation.answer.declares and relation.answer.changes]
    scanned = [replace(relation, stuck=relation.not_overruled(changed)) for relation in scanned]
    answers = tuple(relation.answer for relation in scanned)
    broken = [k for k, answer in enumerate(answers) if answer.declares and answer.changes]
    if not broken:
        return StaticRelations(findings=(), relations=answers, limits=_limits(log, scanned, onsets_s, (from_s, to_s)))
    # What is stuck its twin tells for certain; a step or a ramp of another relation may be no more than like it.
    strongest = scanned[max(broken, key=lambda k: (bool(scanned[k].stuck), answers[k].statistic, k))]
    if strongest.stuck:
        loss, finding = strongest.stuck[0]
        among = dict.fromkeys(other.fault for its_loss, other in strongest.stuck if its_loss <= loss + AS_GOOD)
        finding = replace(finding, among=tuple(among), evidence={answer.name: answer.statistic for answer in answers})
    else:
        finding = _finding(log, scanned, strongest, onsets_s)
    # Beside a change that is told no second one is looked for.
    return StaticRelations(findings=(finding,), relations=answers, limits=())


def _showing(series: Series, channel: str, window: tuple[float, float]) -> Iterator[tuple[RelationSeries, float]]:
    """Yield the relations that a fault of a channel breaks, in a window, and what a unit of its error adds to each."""
    for whole in series[0]:
        part = whole.between(*window)
        if whole.relation.declares and channel in part.effects and len(part.time_s) >= FEWEST_BLOCKS:
            effect = float(np.nanmedian(part.effects[channel]))
            if effect:
                yield part, effect


def hidden_sizes(
    series: Series, channel: str, window: tuple[float, float], courses: Callable[[FloatArray], FloatArray]
) -> dict[Bound, FloatArray]:
    """Return by what a relation bounds (n_courses,) the largest errors of a channel that none would have told.

    Parameters
    ----------
    courses : from times (n,), (n, n_courses) an error of size 1 at these.
    """
    hidden: dict[Bound, FloatArray] = {}
    for part, effect in _showing(series, channel, window):
        candidates = courses(part.time_s)
        scanned = _Scanned(
            series=part,
            scan=part.scan(candidates, declared_at=THRESHOLD),
            effects={channel: effect},
            reach=np.ones(candidates.shape[1]),
            stuck=(),
        )
        bounds, sizes = part.relation.bounds(channel), scanned.hidden / abs(effect)
        hidden[bounds] = np.minimum(hidden.get(bounds, sizes), sizes)
    return hidden


@dataclass(frozen=True, slots=True, kw_only=True)
class RelationOscillation:
    """An oscillation that a relation shows throughout a window: its frequency, Hz, and size on a channel."""

    words: str
    frequency_hz: float
    size: float
    sd: float


def find_oscillation(
    series: Series, channel: str, window: tuple[float, float], frequencies_hz: FloatArray, *, least: float
) -> RelationOscillation | None:
    """Return the oscillation of a channel that its relations show best in a window, None where none stands out.

    Parameters
    ----------
    least : size of the smallest that is wanted, in the channel's unit; a relation that varies by less is not searched.
    """
    best, statistic = None, THRESHOLD
    for part, effect in _showing(series, channel, window):
        # A mean over a block flattens it.
        flattened = np.sinc(BLOCK_S * frequencies_hz)
        if np.std(part.values) < 0.5 * least * abs(effect) * float(flattened.min()):
            continue
        phases = 2.0 * np.pi * frequencies_hz * part.time_s[:, None]
        scan = part.scan(np.hstack([flattened * np.sin(phases), flattened * np.cos(phases)]))
        both, amplitudes, sds = (x.reshape(2, -1) for x in (scan.statistic, scan.amplitude, scan.sd))
        k = int(np.argmax(both.max(axis=0)))
        if both[:, k].max() > statistic:
            statistic = float(both[:, k].max())
            best = RelationOscillation(
                words=part.relation.words,
                frequency_hz=float(frequencies_hz[k]),
                size=float(np.hypot(*amplitudes[:, k]) / abs(effect)),
                sd=float(sds[:, k].max() / abs(effect)),
            )
    return best


def _stuck_courses(part: RelationSeries, during: BoolArray) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield channel, shape and (n, n_stretches) what each of two sensors adds to their difference while it is stuck.

    Parameters
    ----------
    during : (n, n_stretches) where it is stuck, the whole window last.
    """
    air = {name: reading for name, reading in part.readings.items() if name in AIR}
    for channel, twin in (part.relation.needs, part.relation.needs[::-1]):
        effect, readings = part.effects[channel][:, None], part.readings[channel]
        for shape, errors in stuck_errors(
            quantity_measured(channel), readings, part.readings[twin], air, during
        ).items():
            healthy = part.values[:, None] - effect * errors
            level = np.mean(healthy[:, :-1], axis=0, where=during[:, :-1])
            level -= np.mean(healthy[:, :-1], axis=0, where=~during[:, :-1])
            yield channel, shape, effect * errors + np.append(level, 0.0) * during


def _stuck_sensors(
    part: RelationSeries, onsets_s: FloatArray, candidates: FloatArray, effects: Mapping[str, float]
) -> list[_Stuck]:
    """Return two sensors as stuck ones, by channel and shape in the likeliest stretch, the likeliest first.

    A sensor is stuck from an onset on, or was before and is until some time, or throughout the window. It then errs by
    the whole of what its twin does, and what it keeps is what it read within the second of its onset. The hypotheses
    are compared by all that each leaves of the difference, slow or not: noise of any size that wanders would take a
    sensor that moves for one that rests.

    Parameters
    ----------
    candidates : (n, n_candidates) steps and ramps, none of which may be as likely.
    effects : by channel, what one unit of its error adds to the relation.
    """
    least, n = LEAST_STEPS * part.noise_sd, len(part.time_s)
    if not part.relation.twins or np.ptp(part.values) < least:
        return []

    def loss(squares: FloatArray) -> FloatArray:
        """Return twice the negative logarithm of the likelihood of what is left."""
        return np.asarray(n * np.log(np.maximum(squares / n, part.noise_sd**2)))

    # Steps within a second too, which move its mean by a part.
    steps, _ = np.hsplit(candidates, 2)
    within = [steps[:, 1:] + share * np.diff(-steps, axis=1) for share in (0.25, 0.5, 0.75)]
    others = np.hstack([candidates, *within])
    bound = loss(squares_by_onset(part.values, others[:, np.ptp(others, axis=0) > 0.0])[0]).min() - AS_GOOD
    rows = np.unique(np.searchsorted(part.time_s, onsets_s))
    rows = rows[(rows > 0) & (rows < n - 1)]
    after = np.arange(n)[:, None] >= rows
    during = np.hstack([after, ~after, np.ones((n, 1), dtype=bool)])
    begins = np.arange(len(rows))  # of `during`, the stretches of which the onset is in the window
    stuck = []
    for channel, shape, courses in _stuck_courses(part, during):
        losses = loss(n * np.var(part.values[:, None] - courses, axis=0))
        first, second = courses[rows, begins], courses[rows + 1, begins]
        losses[begins] += (first / np.hypot(second - first, part.noise_sd)) ** 2
        losses[~np.isfinite(losses)] = np.inf
        best = int(np.argmin(losses))
        if not losses[best] < bound:
            continue
        statistic = float(part.scan(courses[:, [best]]).statistic[0])
        sizes = np.sort(np.abs(courses[:, best]))
        # A second in which one of them begins or ends to err moves it too: what is stuck errs for longer.
        if statistic < THRESHOLD or sizes[-round(MARGIN_S / BLOCK_S)] < least:
            continue
        stuck_s = part.time_s[during[:, best]]
        near_s = part.time_s[rows[losses[begins] <= losses[best] + CHI_SQUARE_95]]
        first_s, last_s = (near_s[0], near_s[-1]) if best in begins else (-np.inf, stuck_s[0])
        finding = Finding(
            fault=channel,
            among=(channel,),
            channels=(channel,),
            stage="static relations",
            shape=shape,
            onset_s=float(stuck_s[0]) - 0.5 * BLOCK_S,
            onset_ci95=(float(first_s) - 1.5 * BLOCK_S, float(last_s) + 0.5 * BLOCK_S),
            offset_s=None if during[-1, best] else float(stuck_s[-1]) + 0.5 * BLOCK_S,
            statistic=statistic,
            threshold=THRESHOLD,
            effect={channel: float(sizes[-1]) / abs(effects[channel])},
        )
        stuck.append((float(losses[best]), finding))
    return sorted(stuck, key=itemgetter(0))


def _finding(log: FlightLog, scanned: list[_Scanned], strongest: _Scanned, onsets_s: FloatArray) -> Finding:
    """Return the fault that the strongest relation shows, named by all of them."""
    scan, effects, reach, best = strongest.scan, strongest.effects, strongest.reach, strongest.best
    shape = "bias" if best < onsets_s.size else "drift"
    onset_s = float(onsets_s[best % onsets_s.size])
    seen = np.array([relation.scan.amplitude[best] for relation in scanned])
    sds = np.hypot(
        [relation.scan.sd[best] for relation in scanned],
        [AVERAGED * relation.series.noise_sd / relation.reach[best] for relation in scanned],
    )

    def misfit(channel: str) -> float:
        """Return how badly an error of a channel, of the best size, explains what all relations show."""
        parts = np.array([relation.effects.get(channel, 0.0) for relation in scanned]) / sds
        rest = seen / sds
        rest -= parts * (parts @ rest) / float(parts @ parts)
        return float(rest @ rest)

    # Losses of two sensors of one quantity are equal but for rounding: the first is named with its sign.
    ranked = sorted((float(f"{misfit(channel):.9g}"), i, channel) for i, channel in enumerate(effects))
    among = tuple(channel for loss, _, channel in ranked if loss <= ranked[0][0] + AS_GOOD)
    fault = among[0]
    # The size from the relation that shows it best, whose noise alone the interval has.
    magnitude, sd = scan.amplitude[best] / effects[fault], scan.sd[best] / abs(effects[fault])
    shape_onsets = slice(0, onsets_s.size) if shape == "bias" else slice(onsets_s.size, None)
    near = onsets_s[scan.statistic[shape_onsets] >= scan.statistic[best] - CHI_SQUARE_95]
    return Finding(
        fault=fault,
        among=among,
        channels=(fault,),
        stage="static relations",
        shape=shape,
        magnitude=float(magnitude),
        sd=float(sd),
        unit=SHAPES[shape].magnitude_unit(unit_of(log, fault), slope=None),
        onset_s=onset_s,
        onset_ci95=(float(near[0]) - BLOCK_S, float(near[-1]) + BLOCK_S),
        statistic=float(scan.statistic[best]),
        threshold=THRESHOLD,
        effect={fault: float(abs(magnitude) * reach[best])},
        rivals={channel: abs(effects[fault] / effects[channel]) for channel in among[1:]},
        evidence={relation.series.relation.name: float(relation.scan.statistic[best]) for relation in scanned},
    )


def _limits(
    log: FlightLog, scanned: list[_Scanned], onsets_s: FloatArray, window: tuple[float, float]
) -> tuple[Hidden, ...]:
    """Return by channel and shape the largest changes that would not have been told, by their onsets.

    A relation excludes what moves one of its sides alone: where the others share a sensor with a channel, how far that
    channel is from what they make of it, and not its error. Of several relations that counts which leaves the least
    error at the worst of the onsets, of a drift of those in the first half of the window.
    """
    if not scanned:
        return ()
    n = onsets_s.size
    half = max(1, n // 2)  # a drift that begins late in the window may be of nearly any size
    last = max(half, int(np.searchsorted(onsets_s, onsets_s[-1] - LATE_S)) + 1)  # later it holds too little of one
    shapes = (("bias", slice(0, n), n, n), ("drift", slice(n, 2 * n), half, last))
    declaring = [relation for relation in scanned if relation.series.relation.declares]
    least: dict[tuple[str, str], tuple[float, Hidden]] = {}
    for relation, (shape, every, n_counted, n_kept) in product(declaring, shapes):
        sizes, reach = relation.hidden[every], relation.reach[every]
        worst = float((sizes * reach)[:n_counted].max())
        for channel, effect in relation.effects.items() if np.isfinite(worst) else ():
            known = least.get((channel, shape))
            if known is not None and worst / abs(effect) >= known[0]:
                continue
            hidden = Hidden(
                fault=channel,
                shape=shape,
                channel=channel,
                unit=SHAPES[shape].magnitude_unit(unit_of(log, channel), slope=None),
                bounds=relation.series.relation.bounds(channel),
                window=window,
                onsets_s=onsets_s[:n_kept],
                sizes=(kept := sizes[:n_kept] / abs(effect)),
                declared=kept,
                spreads=kept,
            )
            least[channel, shape] = worst / abs(effect), hidden
    return tuple(hidden for _, hidden in least.values())
