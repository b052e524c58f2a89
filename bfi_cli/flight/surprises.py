"""Where a flight surprises its model as an ordinary cause or a fault would: places that no other finder proposes.

One backward pass over the flight says of every second what a jump of the states there would explain of all that
follows. Where that is much, the judge weighs the place as it weighs a finder's: what is told is the ordinary cause that
explains it clearly better than nothing, than a manoeuvre, and than every fault in its place. An error of a channel is
a state that rests at nothing and may jump: where that explains more than any ordinary cause about, it is proposed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..airdata import DEPENDS_ON
from ..flightlog.phases import Phase, spans_of
from ..kernels import FloatArray
from ..kernels.bounded_filter import Coupling, Stack, Transition, change_scores, filter_stack
from ..kernels.runs import within
from .bench import CHECK_S, JUMP_S, Bench, Place, place_of, takeoffs_of
from .judge import REFERENCES, causes_of, channel_faults, explains, judge_place, ordinary_of, rows_of, width_of
from .lines import pitot_loss_rows
from .result import Event, OrdinaryEvent
from .tables import ALTIMETER_SET, MANOEUVRE, ORDINARY, STATES
from .weight import ALIKE, Ordinary

# Log densities from which on a change is looked at more closely, and how many of these. Flaps and a front take some ten
# seconds: a front of 8 m/s in 10 s, worth 71 so, is worth 9 as a jump.
PROPOSED, MOST_PLACES = 20.0, 8
GRADUAL_S = 5  # time constant of a change that takes ten seconds
APART_S = 40  # seconds within which the largest surprise stands for all
# Log density over the best of nothing and a manoeuvre from which on a cause is told: that from which on a fault is. Of
# 14 healthy flights of six aircraft nothing that no fault and no other cause does as well reaches 10, but for flaps
# before two landings, 25 to 433 (tests/measurements/test_told_levels.py).
TOLD = 20.0
# Over any other cause, ten thousand to one: a heading that is said to settle in a climb, in which the wind does as
# well, leads by 6; flaps that move by 67 and more, fronts by 19 and more.
LEADS = float(np.log(1e4))
WEIGHED_S = 200.0  # after a jump, in which it is told from what grows and from what settles
# Seconds beside a place at which the states may jump: at once, within 10 s as flaps and fronts do, and as the judge's.
TAKES_S = ((0,), (-4, -2, 0, 2, 4, 6), JUMP_S)
BESIDE_S = 30  # of a jump, when its size is read
LARGEST = 3.0  # standard deviations of a jump that a cause still makes
SAME_S = 60.0  # from an event of a finder, when both are of the same place
# What ice takes in the end, the logarithm of the impact pressure, and the time constant, s, with which it does: a tenth
# to a half at 0.1 to 0.5 % in a second.
ICED, GROWS_S = 0.3, 60.0
ICY = 150.0  # log density from which on that is looked at more closely: half of what alone declares a fault
TWINS = {"altitude": ALTIMETER_SET}  # by channel the cause that moves it as its error does: both are told
UNLIKE_FLIGHT = ("stall", "parabola")  # phases in which the rows are no linear functions of the states


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChangeGains:
    """What a change from a second on is worth, (2, n) log densities of what follows up to the next take-off.

    The first of the two is that of a jump, the second that of a gradual change.

    Attributes
    ----------
    causes : by sought ordinary cause, and "" for a manoeuvre.
    faults : by channel that may err.
    ice : (n,) of a pitot line that loses by degrees.
    """

    causes: Mapping[str, FloatArray]
    faults: Mapping[str, FloatArray]
    ice: FloatArray


def surprising_events(
    bench: Bench, phases: Sequence[Phase], events: Sequence[Event], gains: ChangeGains
) -> Iterator[OrdinaryEvent]:
    """Yield the ordinary causes that act where no finder proposes a fault, or where what it suspects may be one.

    A fault within ten to one of the cause leaves a place to the finders: it is told where one suspects it, and stays
    suspected.

    Parameters
    ----------
    events : that stand. Where one of air data is declared, the courses about which the model is linear are wrong.
    gains : of `change_gains`.
    """
    without = [*spans_of(phases, UNLIKE_FLIGHT), *filter(None, map(_wrong_for, events))]
    for surprise in _surprises(bench, without, gains):
        suspected = next((event for event in events if _is_of(bench, event, surprise)), None)
        if suspected is not None:
            yield replace(surprise, looks_like=suspected.fault)
        elif surprise.evidence["margin"] <= -ALIKE:
            yield surprise


def sudden_winds(bench: Bench, phases: Sequence[Phase], gains: ChangeGains) -> Iterator[tuple[float, float]]:
    """Yield when the wind would change at once, and the log density that it is worth: a pressure line does as well.

    Parameters
    ----------
    gains : of `change_gains`.
    """
    if "wind" not in gains.causes:
        return
    at_once, gradual = gains.causes["wind"]
    for begins, _ in _largest(gains.causes["wind"] - _manoeuvre_gain(gains)):
        about = slice(max(begins - APART_S, 0), begins + APART_S)
        at_s, gain = float(bench.model.time_s[about][np.argmax(at_once[about])]), float(at_once[about].max())
        if gain > gradual[about].max() and not within(np.array([at_s]), spans_of(phases, UNLIKE_FLIGHT)).any():
            yield at_s, gain


def sudden_errors(bench: Bench, events: Sequence[Event], gains: ChangeGains) -> Iterator[tuple[str, float, float]]:
    """Yield the channels that seem to err from a time on, with the log density over any ordinary change about it.

    Parameters
    ----------
    events, gains : as of `surprising_events`.
    """
    names = [name for name in gains.faults if name not in REFERENCES]
    net = np.array([gains.faults[name].max(axis=0) - _ordinary_gain(gains, TWINS.get(name)) for name in names])
    net[:, within(bench.model.time_s, [*filter(None, map(_wrong_for, events))])] = 0.0
    most = net.max(axis=0, initial=0.0)
    peaks = np.flatnonzero((most > PROPOSED) & (most == _most_about(most, APART_S)))
    for at in peaks[np.argsort(-most[peaks])][:MOST_PLACES]:
        yield names[int(np.argmax(net[:, at]))], float(bench.model.time_s[at]), float(most[at])


def slow_losses(bench: Bench, gains: ChangeGains) -> Iterator[tuple[float, float]]:
    """Yield when a pitot line seems to begin to lose by degrees, and the log density over any ordinary change there."""
    net = gains.ice - _ordinary_gain(gains, None)
    peaks = np.flatnonzero((net > ICY) & (net == _most_about(net, APART_S)))
    for at in peaks[np.argsort(-net[peaks])][:MOST_PLACES]:
        yield float(bench.model.time_s[at]), float(net[at])


def _ordinary_gain(gains: ChangeGains, without: str | None) -> FloatArray:
    """Return (n,) what the best ordinary change but one about each second is worth, at least nothing."""
    causes = [gain.max(axis=0) for name, gain in gains.causes.items() if name != without]
    return _most_about(np.maximum(np.max(causes, axis=0), 0.0), GRADUAL_S)


def _most_about(values: FloatArray, reach_s: int) -> FloatArray:
    """Return (n,) the largest of values within some seconds of each."""
    return np.asarray(sliding_window_view(np.pad(values, reach_s, mode="edge"), 2 * reach_s + 1).max(axis=-1))


def _wrong_for(event: Event) -> tuple[float, float] | None:
    """Return when air data are wrong by an event, None where none are."""
    if event.state != "declared" or not DEPENDS_ON.keys() & {*event.channels}:
        return None
    return event.onset_ci95[0] - SAME_S, event.until_s + SAME_S


def _is_of(bench: Bench, event: Event, surprise: OrdinaryEvent) -> bool:
    """Return whether a suspected event may be what surprises."""
    near = abs(event.onset_s - surprise.from_s) < SAME_S and event.state == "suspected"
    return near and explains(bench, surprise.cause, rows_of(bench, event.channels))


def _surprises(bench: Bench, without: Sequence[tuple[float, float]], gains: ChangeGains) -> Iterator[OrdinaryEvent]:
    """Yield what explains a flight's surprises, in their order, a cause once within a minute: the jump that is most."""
    seconds = _proposed(gains, bench.model.n)
    times_s = bench.model.time_s[seconds]
    standing: dict[float, OrdinaryEvent] = {}
    for at_s in times_s[~within(times_s, without)].tolist():
        near = [surprise for at, surprise in standing.items() if abs(at - at_s) < SAME_S]
        surprise = _weighed(bench, at_s)
        if surprise is not None and surprise.cause not in {other.cause for other in near}:
            standing[at_s] = surprise
    for at_s in sorted(standing):
        yield standing[at_s]


def _weighed(bench: Bench, at_s: float) -> OrdinaryEvent | None:
    """Return what an ordinary cause is worth at a place; None where none is worth telling."""
    whole = place_of(bench, at_s, None, at_s + WEIGHED_S)
    if whole is None:
        return None
    weighed = [(place, ordinary_of(place)) for place in (whole.at(whole.onset, None, jumps=jumps) for jumps in TAKES_S)]
    place, ordinary = max(weighed, key=lambda pair: float(np.nansum(pair[1].log_density)))
    if not ordinary.cause or not ORDINARY[ordinary.cause].is_sought or ordinary.gain < TOLD:
        return None
    state, size = _jump(place, ordinary)
    if abs(size) > LARGEST * ORDINARY[ordinary.cause].jumps[state]:
        return None
    return OrdinaryEvent(
        cause=ordinary.cause,
        from_s=at_s,
        to_s=None,
        magnitude=size,
        unit=ORDINARY[ordinary.cause].unit,
        ci95=None,
        looks_like="",
        evidence={"gain": ordinary.gain, "margin": _margin_of_faults(place, ordinary, state)},
    )


def _margin_of_faults(place: Place, ordinary: Ordinary, state: str) -> float:
    """Return the margin of the best fault over a cause: in its place, and not beside it; 0 where any is as good."""
    if ordinary.lead < LEADS:
        return 0.0  # another cause is as good: it may be no jump of this one's states at all
    model = place.bench.model
    moved = [name for name in model.rows if np.any(model.Z[place.part, model.row(name), model.state(state)])]
    lasts = STATES[state].memory_s == np.inf
    if lasts and len(moved) == 1 and moved[0] not in rows_of(place.bench, REFERENCES):
        return 0.0  # an error of the one channel that it moves, of the same course, is as good
    without = replace(ordinary, shocks=np.zeros_like(ordinary.shocks))
    return judge_place(place, without, named=moved).weights[0].margin


def _proposed(gains: ChangeGains, n: int) -> list[int]:
    """Return the seconds about which a change of an ordinary cause is worth most, the best first."""
    causes = [gain for name, gain in gains.causes.items() if name]
    net = np.max(causes, axis=0, initial=0.0) - _manoeuvre_gain(gains)
    return [min(begins + is_gradual * GRADUAL_S, n - 1) for begins, is_gradual in _largest(net)]


def _manoeuvre_gain(gains: ChangeGains) -> FloatArray:
    """Return (n,) what a manoeuvre is worth, at once or gradual."""
    return np.asarray(np.maximum(np.max(gains.causes[""], axis=0), 0.0))


def _largest(net: FloatArray) -> list[tuple[int, bool]]:
    """Return the largest of (2, n) gains at once and gradual, far from each other: when, and whether gradual."""
    net = net.copy()
    largest: list[tuple[int, bool]] = []
    while len(largest) < MOST_PLACES and net.max(initial=0.0) > PROPOSED:
        how, begins = np.unravel_index(int(np.argmax(net)), net.shape)
        largest.append((int(begins), bool(how)))
        net[:, max(begins - APART_S, 0) : begins + APART_S] = 0.0
    return largest


def change_gains(bench: Bench) -> ChangeGains:
    """Return what changes of ordinary causes, of a manoeuvre and of errors of channels are worth at every second."""
    model, faults = bench.model, channel_faults(bench.model)
    # Of ice the loss and its rate, which wears off; a rate has loadings by what becomes of it alone.
    loads = [*faults.values(), pitot_loss_rows(model), {}]
    errors = np.zeros((model.n, len(model.rows), len(loads)))
    for k, by_row in enumerate(loads):
        for row, load in by_row.items():
            errors[:, model.row(row), k] = load
    errors_sd = [width_of(name, by_row) for name, by_row in faults.items()]
    widths = np.concatenate([np.zeros(len(model.states)), errors_sd, [0.0, ICED / GROWS_S]])
    causes = {name: jumps for name, jumps in causes_of(model).items() if ORDINARY[name].is_sought}
    sds = {
        name: np.pad(_deviations(bench, jumps), (0, len(loads))) for name, jumps in {"": MANOEUVRE, **causes}.items()
    }
    gains, errors_worth = {name: np.zeros((2, model.n)) for name in sds}, np.zeros((len(loads), 2, model.n))
    # The stretches between checks run side by side, what follows a jump in one after the other.
    starts = np.array(list(bench.checks))
    ends = np.append(starts[1:], int(np.flatnonzero(model.frame.airborne)[-1]) + 1)
    seconds = starts + np.arange(CHECK_S)[:, None]
    known = (seconds < ends)[..., None] & np.isfinite(bench.y[np.minimum(seconds, model.n - 1)])
    y, Z, R, Q, extra = (
        values[np.minimum(seconds, model.n - 1)] for values in (bench.y, model.Z, bench.R, bench.Q, errors)
    )
    stack = Stack(y=np.where(known, y, np.nan), Z=Z, R=R, Q=Q)
    mean, covariance = (np.stack(parts) for parts in zip(*bench.checks.values(), strict=True))
    run = filter_stack(stack, bench.transition, mean=mean, covariance=covariance, with_gains=True)
    assert run.gains is not None
    # Errors that are known to be none move no filter: of their own they have nothing but loadings.
    transition = _with_ice(bench.transition.with_constants(len(loads)))
    loaded = np.where(known[..., None], np.concatenate([Z, extra], axis=-1), 0.0)
    takeoffs, after = takeoffs_of(model), None
    for h in range(starts.size - 1, -1, -1):
        n = int(ends[h] - starts[h])
        part = run.gains.between(0, n, h).with_constants(len(loads))
        scores = change_scores(loaded[:n, h], part, transition, after, time_constant=GRADUAL_S)
        for name, sd in sds.items():
            gains[name][:, starts[h] : ends[h]] = scores.jump.gain(sd), scores.gradual.gain(sd)
        for how, score in enumerate((scores.jump, scores.gradual)):
            errors_worth[:, how, starts[h] : ends[h]] = score.gains_alone(widths)[:, len(model.states) :].T
        after = None if starts[h] in takeoffs else scores
    return ChangeGains(
        causes=gains, faults=dict(zip(faults, errors_worth[:-2], strict=True)), ice=errors_worth[-1].max(axis=0)
    )


def _with_ice(transition: Transition) -> Transition:
    """Return a transition in which the last state is the rate of the one before, and wears off."""
    last, decay = transition.decay.size - 1, transition.decay.copy()
    decay[last] = np.exp(-1.0 / GROWS_S)
    return replace(
        transition, decay=decay, couplings=(*transition.couplings, Coupling(to=last - 1, source=last, value=1.0))
    )


def _deviations(bench: Bench, jumps: Mapping[str, float]) -> FloatArray:
    return np.array([jumps.get(name, 0.0) for name in bench.model.states])


def _jump(place: Place, ordinary: Ordinary) -> tuple[str, float]:
    """Return the state that jumps most for its standard deviation, and by how much."""
    states, jumps = place.bench.model.states, ORDINARY[ordinary.cause].jumps
    before, after = max(place.onset - BESIDE_S, 0), min(place.onset + BESIDE_S, place.n - 1)
    moved = ordinary.mean[after] - ordinary.mean[before]
    state = max(jumps.keys() & {*states}, key=lambda name: abs(moved[states.index(name)]) / jumps[name])
    return state, float(moved[states.index(state)])
