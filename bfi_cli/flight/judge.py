"""The judge: every fault that could act at a place of a flight against no fault, in one likelihood of all channels.

Without a fault every ordinary cause (`tables.ORDINARY`) is free to act about the onset, and about the end; with one
only the manoeuvre is. The margin of a fault is the difference of the log densities of the same recorded samples, and
each row's part of it says who confirms the fault and who refutes it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from ..kernels import TWO_SIDED_95, FloatArray
from ..kernels.bounded_filter import StackRun
from .bench import FAULT_STATES, SHOWN_S, Bench, Place, jump, jump_seconds, place_of, run_place
from .lines import line_weights
from .model import FlightModel, second_airspeed
from .result import Event
from .tables import MANOEUVRE, ORDINARY, ROWS, Loads
from .weight import ALIKE, Ordinary, Weight, against, beside, dispersion, floored_density, memory

# What air data are held against. A receiver of satellites errs by itself so much more rarely than a tube or a port that
# it is no rival of theirs; where a finder names it, it is.
# A temperature drifts with the air that it is measured in: alone it is no rival either.
REFERENCES = ("ground_speed", "gps_altitude", "sat", "tat")
FROZEN = "frozen"
# Standard deviations of an error of a channel before anything is known of it.
WIDE: Mapping[str, float] = {
    "altitude": 100.0,
    "altitude_rate": 5.0,
    "gps_altitude": 100.0,
    "normal_acc": 2.0,
    "tas": 15.0,
    "cas": 15.0,
    "mach": 15.0,
    "pitch": 0.08,
    "aoa": 0.08,
    "sat": 8.0,
    "ground_speed": 15.0,
}
# Seconds within which an error grows before it stays; infinite of one that grows on.
GROWTHS_S = (0.0, 60.0, 200.0, np.inf)
SLOW_S = 200.0  # in which a growing error reaches its width
GONE = "nothing of it is left at its end"  # of an error without one: for some seconds it only set a channel aside
AT_END_S = 6  # after the end, when an error is over
# Seconds by which an onset may be earlier, and after an end in which filters of recorder and instrument still act.
BEFORE_NEXT_S, AFTER_END_S = 20.0, 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What the flight model says of a place.

    Attributes
    ----------
    weights : by fault, the best first; refused ones last.
    cause : the ordinary cause that explains the place best, "" where the manoeuvre or nothing at all does as well.
    gain : log density that the cause is worth.
    """

    weights: tuple[Weight, ...]
    cause: str
    gain: float

    def weight(self, fault: str) -> Weight | None:
        """Return what a fault is worth, None where the model does not know it."""
        return next((weight for weight in self.weights if weight.fault == fault), None)

    @property
    def among(self) -> tuple[str, ...]:
        """The faults within ten to one of the best."""
        possible = [weight for weight in self.weights if not weight.refused]
        return tuple(weight.fault for weight in possible if weight.margin >= possible[0].margin - ALIKE)


def judge(
    bench: Bench,
    onset_s: float,
    offset_s: float | None,
    *,
    until_s: float = np.inf,
    named: Collection[str] = (),
    frozen: str = "",
) -> Judgement | None:
    """Return what every fault is worth at a place; None where nothing of it is flown, or the log has too little.

    Parameters
    ----------
    until_s : what comes later is not weighed: another fault begins then.
    named : faults that a finder proposes: of `REFERENCES` only these are weighed, and of these errors that grow for a
        while.
    frozen : a channel that may hold its reading, which is weighed as the fault `FROZEN`.
    """
    place = place_of(bench, onset_s, offset_s, until_s)
    return None if place is None else judge_place(place, ordinary_of(place), named=named, frozen=frozen)


def judge_place(place: Place, ordinary: Ordinary, *, named: Collection[str] = (), frozen: str = "") -> Judgement:
    """Return what every fault is worth beside the best ordinary explanation of its place, see `judge`."""
    held = _frozen_weight(place, ordinary, frozen) if frozen in place.bench.model.rows else None
    weights = [
        *([] if held is None else [held]),
        *_channel_weights(place, ordinary, named),
        *line_weights(place, ordinary, named),
    ]
    order = sorted(weights, key=attrgetter("rank"), reverse=True)
    return Judgement(weights=tuple(order), cause=ordinary.cause, gain=ordinary.gain)


def causes_of(model: FlightModel) -> dict[str, Mapping[str, float]]:
    """Return the jumps of the ordinary causes that a log could show."""
    return {
        name: cause.jumps
        for name, cause in ORDINARY.items()
        if (not cause.needs or set(cause.needs) & {*model.rows})
        and cause.unless not in model.seconds.channels
        and set(cause.jumps) & {*model.states}
    }


def ordinary_of(place: Place, *, without: str | None = None) -> Ordinary:
    """Return the best explanation without a fault: a cause other than `without` about the onset, and one at the end."""
    options: list[tuple[str, Mapping[str, float]]] = [("", {}), ("", MANOEUVRE)]
    options += [(name, jumps) for name, jumps in causes_of(place.bench.model).items() if name != without]
    shocks = np.stack([jump(place, place.onset, jumps) for _, jumps in options], axis=1)
    run = run_place(place, shocks=shocks)
    best = int(np.argmax(run.log_likelihood))
    cause, gain = options[best][0], float(run.log_likelihood[best] - run.log_likelihood[:2].max())
    lead = float(run.log_likelihood[best] - np.delete(run.log_likelihood, [0, 1, best]).max(initial=-np.inf))
    if cause:
        # A manoeuvre goes with a cause as with any fault: where flaps move the pilot answers.
        freed = np.maximum(shocks[:, [best]], shocks[:, [1]])
        steered = run_place(place, shocks=freed)
        by_steering = float(steered.log_likelihood[0] - run.log_likelihood[best])
        if by_steering > 0.0:
            gain, run, shocks, best = gain + by_steering, steered, freed, 0
    if place.offset is not None and place.offset < place.n:
        at_end = np.stack([jump(place, place.offset, jumps) for _, jumps in options], axis=1) + shocks[:, [best]]
        ended = run_place(place, shocks=at_end)
        then = int(np.argmax(ended.log_likelihood))
        if ended.log_likelihood[then] > run.log_likelihood[best]:
            gain += float(ended.log_likelihood[then] - max(ended.log_likelihood[:2].max(), run.log_likelihood[best]))
            cause = cause or options[then][0]
            run, shocks, best = ended, at_end, then
    return Ordinary(
        log_density=run.log_density[:, best],
        innovation=run.innovation[:, best],
        sd=run.sd[:, best],
        mean=run.mean[:, best],
        shocks=shocks[:, best],
        cause=cause,
        gain=gain,
        lead=lead,
    )


def channel_faults(model: FlightModel) -> dict[str, Loads]:
    """Return by fault of one channel what an error of 1 makes of each row, (n,) or a number."""
    c = model.coefficients
    faults: dict[str, Loads] = {}
    for name in ("altitude", "altitude_rate", "gps_altitude", "normal_acc", "pitch", "aoa"):
        if name in model.rows:
            faults[name] = {name: 1.0}
    if {"altitude", "cas"} <= {*faults, *model.rows}:  # which is held against a true airspeed at that altitude
        faults["altitude"] = {"altitude": 1.0, "cas": -c.cas_by_height}
    if "tas" in model.rows:
        airspeed = model.seconds.record.airspeed
        if airspeed in ("tas", ""):
            faults["tas"] = {"tas": 1.0}
        elif airspeed in ("cas", "ias"):
            faults[airspeed] = {"tas": 1.0 / c.cas_share}
    if "cas" in model.rows:
        faults[second_airspeed(model.seconds)] = {"cas": 1.0}
    if "mach" in model.rows:
        faults["mach"] = {"mach": 1.0}
    if "sat" in model.rows:
        faults["sat" if "sat" in model.seconds.recorded else "tat"] = {"sat": 1.0}
    if "velocity_north" in model.rows:
        faults["ground_speed"] = {"velocity_north": np.cos(c.track), "velocity_east": np.sin(c.track)}
    elif "ground_speed" in model.rows:
        faults["ground_speed"] = {"ground_speed": 1.0}
    return faults


def width_of(name: str, loads: Loads) -> float:
    """Return the standard deviation of an error of a channel before anything is known of it."""
    return WIDE["ground_speed" if name == "ground_speed" else next(iter(loads))]


def _channel_weights(place: Place, ordinary: Ordinary, named: Collection[str]) -> Iterator[Weight]:
    """Yield what an error of every channel is worth: a step, one that grows for a while, one that grows on."""
    faults = {
        name: loads
        for name, loads in channel_faults(place.bench.model).items()
        if name not in REFERENCES or name in named
    }
    kinds = [
        (name, growth_s) for name in faults for growth_s in GROWTHS_S if name in named or growth_s in (0.0, np.inf)
    ]
    run = _run_of_channels(place, [(name, growth_s, place) for name, growth_s in kinds])
    likelihood = run.log_likelihood
    best = {
        name: max((h for h, kind in enumerate(kinds) if kind[0] == name), key=lambda h: likelihood[h])
        for name in faults
    }
    shocks = np.stack([beside(place, ordinary, list(faults[name])) for name in best], axis=1)
    moved = _run_of_channels(place, [(*kinds[h], place) for h in best.values()], shocks=shocks)
    freed = moved.log_likelihood
    for k, (name, h) in enumerate(best.items()):
        which, at = (moved, k) if freed[k] > likelihood[h] else (run, h)
        yield _weight_of_channel(place, ordinary, which, at, (name, kinds[h][1]))


def weights_of_channel(name: str, growth_s: float, places: Sequence[Place], ordinary: Ordinary) -> tuple[Weight, ...]:
    """Return what an error of a channel is worth at places that differ in onset and end alone."""
    run = _run_of_channels(places[0], [(name, growth_s, place) for place in places])
    return tuple(_weight_of_channel(place, ordinary, run, h, (name, growth_s)) for h, place in enumerate(places))


def _run_of_channels(
    place: Place, hypotheses: Sequence[tuple[str, float, Place]], shocks: FloatArray | None = None
) -> StackRun:
    """Return the filter of errors of channels: name, seconds of growth, and place of each."""
    model = place.bench.model
    faults = channel_faults(model)
    extra = np.zeros((place.n, len(hypotheses), len(model.rows), FAULT_STATES))
    moves = np.zeros((place.n, len(hypotheses), FAULT_STATES))
    start = np.zeros((len(hypotheses), FAULT_STATES))
    seconds = np.arange(place.n)
    for h, (name, growth_s, at_place) in enumerate(hypotheses):
        width = width_of(name, faults[name])
        onset, offset = at_place.onset, at_place.offset
        after_s = AT_END_S if max(at_place.jumps) > 0 else 0  # what ends at once is over at once
        lasts = np.ones(place.n) if offset is None else (seconds < offset + after_s).astype(np.float64)
        course = np.clip((seconds - onset) / growth_s, 0.0, 1.0) if 0.0 < growth_s < np.inf else np.ones(place.n)
        for row, load in faults[name].items():
            at = np.asarray(load)[place.part] if np.ndim(load) else load
            extra[:, h, model.row(row), 0] = at * course * lasts
        begins = jump_seconds(at_place, onset)
        if growth_s == 0.0:
            moves[begins, h, 0] = width**2 / begins.size
        elif growth_s == np.inf:
            moves[begins, h, 1] = (width / SLOW_S) ** 2 / begins.size
        else:
            start[h, 0] = width
        ends = jump_seconds(at_place, offset) if offset is not None and after_s else begins[:0]
        ends = ends[ends < (offset or 0) + after_s]
        if ends.size:
            moves[ends, h, 0] += width**2 / ends.size
    return run_place(place, shocks=shocks, extra=extra, extra_Q=moves, extra_start=start)


def _weight_of_channel(place: Place, ordinary: Ordinary, run: StackRun, h: int, kind: tuple[str, float]) -> Weight:
    name, growth_s = kind
    loads = channel_faults(place.bench.model)[name]
    margin, shares = against(place, ordinary, run.log_density[:, h])
    end = min(place.n, place.n if place.offset is None else place.offset) - 1
    # What grows on is beyond any instrument in the end: it is asked what it is after a minute.
    early = min(end, place.onset + SHOWN_S) if growth_s == np.inf else end
    sd = float(np.sqrt(max(run.final_covariance[h, -FAULT_STATES, -FAULT_STATES], 0.0)))
    refused = _refused(name, loads, float(run.mean[early, h, -FAULT_STATES]))
    if place.offset is None and abs(run.mean[end, h, -FAULT_STATES]) < TWO_SIDED_95 * sd:
        refused = GONE
    return Weight(
        fault=name,
        margin=margin,
        shares=shares,
        size=float(run.mean[end, h, -FAULT_STATES]),
        sd=sd,
        growth_s=growth_s,
        refused=refused,
        dispersion=dispersion(place, run.innovation[:, h], list(loads)),
        memory_s=memory(place, run.innovation[:, h], list(loads)),
    )


def _frozen_weight(place: Place, ordinary: Ordinary, row: str) -> Weight:
    """Return what a reading that holds is worth: while it lasts it reads a constant, with the noise of flight."""
    model, during = place.bench.model, place.during
    j = model.row(row)
    y, Z = place.bench.y[place.part].copy(), model.Z[place.part].copy()
    held = y[during, j]
    y[during, j] -= np.nanmedian(held) if np.isfinite(held).any() else 0.0
    Z[during, j] = 0.0
    extra = np.zeros((place.n, 1, len(model.rows), FAULT_STATES))
    extra[during, 0, j, 0] = 1.0
    floored = np.zeros(y.shape, dtype=bool)
    floored[during, j] = True
    run = run_place(
        place,
        shocks=beside(place, ordinary, [row])[:, None],
        y=y[:, None],
        Z=Z[:, None],
        extra=extra,
        extra_start=np.array([[WIDE[row], 0.0]]),
    )
    density = floored_density(ordinary, run.log_density[:, 0], run.innovation[:, 0], run.sd[:, 0], floored)
    margin, shares = against(place, ordinary, density)
    return Weight(fault=FROZEN, margin=margin, shares=shares, size=0.0)


def _refused(fault: str, loads: Loads, size: float) -> str:
    row = ROWS[next(iter(loads))]
    limit = row.plausible if row.channel != "mach" else ROWS["tas"].plausible
    return f"its size of {size:.3g} is beyond any instrument" if abs(size) > limit else ""


def rows_of(bench: Bench, channels: Sequence[str]) -> tuple[str, ...]:
    """Return the rows that measure some channels."""
    model = bench.model
    airspeed, second = model.seconds.record.airspeed, second_airspeed(model.seconds)
    names = {airspeed: "tas", second: "cas", "tat": "sat", "p_static": "altitude"}
    rows = [names.get(channel, channel) for channel in channels]
    if "ground_speed" in channels:
        rows += ["velocity_north", "velocity_east"]
    return tuple(name for name in rows if name in model.rows)


def with_known(bench: Bench, event: Event) -> Bench:
    """Return the bench without the rows that a known fault makes wrong, while it lasts."""
    until_s = event.until_s + AFTER_END_S
    return bench.without(rows_of(bench, event.channels), event.onset_ci95[0] - BEFORE_NEXT_S, until_s)


GROUND_BEFORE_S = 10.0  # in which nothing flies before what begins on the ground
SET_WITHIN_S = 15.0  # of an onset, when the altimeter is set at it


def is_on_ground(bench: Bench, at_s: float) -> bool:
    """Return whether nothing flies about a time and before it: airspeed, ground speed and height agree."""
    model = bench.model
    about = model.frame.airborne[model.second(at_s - GROUND_BEFORE_S) : model.second(at_s) + 1]
    return bool(about.size and not about.any())


def is_set(bench: Bench, at_s: float) -> bool:
    """Return whether a recorded setting of the altimeter changes about a time."""
    return bool(bench.model.knob[np.abs(bench.model.time_s - at_s) <= SET_WITHIN_S].any())


def explains(bench: Bench, cause: str, names: Collection[str]) -> bool:
    """Return whether an ordinary cause moves one of some rows."""
    model = bench.model
    if cause not in ORDINARY:
        return False
    rows = [model.row(name) for name in names]
    states = [model.state(name) for name in ORDINARY[cause].jumps if name in model.states]
    return bool(np.abs(model.Z[:, rows][:, :, states]).max(initial=0.0) > 0.0)
