"""Faults of the pressure lines in the flight model: by their own physics, linear about what the line would have shown.

A line that loses by degrees has one more state: of the pitot line the logarithm of what is left of the impact
pressure, of the static line the height by which it errs. A trapped line does not read the flight at all while it is:
its total pressure is constant, and the impact pressure is what the static one leaves of it; or its static pressure is,
and the altitude stands still. The measurements stay those recorded, so that densities compare without a Jacobian;
loadings are those of the true flight times what the fault makes of them, about a course that is made again from the
filter's answer.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter

import numpy as np

from ..airdata import (
    HIGHEST,
    LOWEST,
    SEA_LEVEL_PRESSURE,
    SONIC_RATIO,
    G,
    channels_of,
    isa_temperature,
    pressure_at,
    speed_of_sound,
    total_temperature,
)
from ..kernels import BoolArray, FloatArray
from ..kernels.bounded_filter import StackRun
from ..kernels.runs import noise_of_second_differences, runs
from .bench import FAULT_STATES, SHOWN_S, ZERO, Bench, Place, jump_seconds, run_place
from .model import FlightModel, rounding_of, second_airspeed
from .parity.record import STATIC_LEAK, without_fault
from .seconds import filled, rate_of, smoothed
from .tables import AIRSPEED_ROWS
from .weight import ALIKE, Ordinary, Weight, against, beside, dispersion, floored_density, memory

OfCourse = Callable[[FloatArray], FloatArray]
PITOT_LEAK, PITOT_ICING, PITOT_BLOCKED, STATIC_BLOCKED = "pitot_leak", "pitot_icing", "pitot_blocked", "static_blocked"


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """How a fault of a line goes on.

    Attributes
    ----------
    sudden : standard deviation of what is lost about the onset: of the logarithm of the impact pressure, or m of
        height.
    rate : of what is lost or gained in a second from then on.
    walk : of a second's step after that: laws are rigid.
    start : of what a trapped pressure is beside its first readings, Pa of the total one, m of the height; of what a
        leak with a time constant goes to.
    time_constant_s : with which a line goes to another pressure, None of one that does not.
    grows_s : in which what a line loses has grown to the whole, evenly; None of one that grows otherwise.
    """

    fault: str
    sudden: float = 0.0
    rate: float = 0.0
    walk: float = 0.0
    start: float = 0.0
    time_constant_s: float | None = None
    grows_s: float | None = None


# A tube that leaks loses a part at once, or all of it within a minute: the logarithm falls by a sixtieth in a second.
# Ice takes 0.1 to 0.5 % in a second. A cabin that is not pressurised differs by tens of metres, one that is by
# kilometres that are reached within minutes.
LAWS = (
    Law(fault=PITOT_LEAK, sudden=0.5, walk=0.001),
    Law(fault=PITOT_LEAK, rate=0.03),
    Law(fault=PITOT_ICING, rate=0.004),
    Law(fault=PITOT_BLOCKED, start=300.0),
    Law(fault=STATIC_LEAK, sudden=60.0, rate=0.3, walk=0.03),
    Law(fault=STATIC_LEAK, sudden=60.0, rate=10.0, walk=0.03),
    Law(fault=STATIC_BLOCKED, start=10.0),
)
# A static line that goes to its cabin's pressure: time constants from what shows within a few seconds to a minute.
LEAKS = tuple(Law(fault=STATIC_LEAK, start=2000.0, time_constant_s=seconds) for seconds in (4.0, 8.0, 16.0, 32.0, 64.0))
# Ice that grows for a while and stays: of a tenth to a half of the impact pressure at 0.1 to 0.5 % in a second.
ICINGS = tuple(
    Law(fault=PITOT_ICING, start=0.3, grows_s=seconds) for seconds in (30.0, 60.0, 90.0, 135.0, 200.0, 300.0)
)
COURSE_S = 11  # over which a course is smoothed
MOST_HEIGHT = 8000.0  # m between an aircraft and its cabin: a differential pressure of 0.6 bar
# LIMITS: bounds of the course of a line that loses: the logarithm of what is left, a share, m.
LIMITS = {PITOT_LEAK: (-3.0, 0.3), PITOT_ICING: (-0.95, 0.3), STATIC_LEAK: (-MOST_HEIGHT, MOST_HEIGHT)}
LEAST_LOSS = 0.01  # a smaller one is none of a line that iced up or leaks
PREDICTED_PA = (
    8.0  # noise of a pressure that a trapped one predicts beside that of the reading: half a millibar's tenth
)
# HEATED [K s^2/m^2]: by which air that is brought to rest warms, by the square of its speed.
HEATED = float(total_temperature(1.0, 1.0) - 1.0) / float(speed_of_sound(1.0)) ** 2
# THERMOMETER_S [s]: time constant of the slowest thermometer in flight.
THERMOMETER_S = 20.0
# STRAYS [1]: standard deviations of its noise beyond which a trapped pressure is never twice in a row.
STRAYS = 4.0
AT_ONCE = 12  # laws and places of one filter, of which each takes 20 MB where the part has 800 s
REFERENCE_S = 20  # after the onset, in which the trapped pressure is read
# Share of the flight's median airspeed below which an instrument reads anything down to nothing, all of it as likely.
UNREADABLE = 0.45


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rows:
    """Measurements, loadings, those of the fault's states, and variances of a hypothesis, (n, n_rows, ...)."""

    y: FloatArray
    Z: FloatArray
    extra: FloatArray
    R: FloatArray
    floored: BoolArray  # samples that the fault predicts better than a flight is
    unread: BoolArray  # airspeeds of which it says that they are below what the instrument reads


def line_weights(place: Place, ordinary: Ordinary, named: Collection[str] = ()) -> Iterator[Weight]:
    """Yield what every fault of a pressure line is worth at a place: the best of its laws.

    Where a line that loses explains anything, or is `named` by a finder, the finer laws of its course are weighed too.
    """
    model = place.bench.model
    if not has_lines(model):
        return
    best = _best_laws(place, ordinary, LAWS)
    explains = max(best[fault].margin for fault in LIMITS) > 0.0
    finer = [law for law in (*ICINGS, *LEAKS) if explains or law.fault in named]
    if finer:
        for fault, weight in _best_laws(place, ordinary, finer).items():
            best[fault] = max(best[fault], weight, key=attrgetter("rank"))
    yield from best.values()


def weight_of_line(place: Place, ordinary: Ordinary, fault: str) -> Weight:
    """Return what a fault of a pressure line is worth at a place, by the first of its laws."""
    return _best_laws(place, ordinary, [law for law in LAWS if law.fault == fault])[fault]


def _best_laws(place: Place, ordinary: Ordinary, laws: Sequence[Law]) -> dict[str, Weight]:
    """Return by fault what the best of its laws is worth beside what else may happen at a place."""
    # A layer of other air is no rival of a line: it moves the temperature alone.
    shocks = np.stack([beside(place, ordinary, _moved_rows(place.bench.model, law.fault)) for law in laws], axis=1)
    best: dict[str, Weight] = {}
    for weight in weights_of_laws([(law, place) for law in laws], ordinary, shocks=shocks):
        best[weight.fault] = max(best.get(weight.fault, weight), weight, key=attrgetter("rank"))
    return best


def rests_about(bench: Bench, at_s: float) -> Iterator[tuple[str, float, float]]:
    """Yield the faults of a trapped line that rests about a time, or before or after it: with its onset and its end."""
    model = bench.model
    if not has_lines(model):
        return
    air, at = model.seconds.air, int(np.searchsorted(model.time_s, at_s))
    # An airspeed that reads nothing does not show where its tube is.
    reads = filled(model.y[:, model.row("tas")]) >= ZERO * model.frame.middle_speed
    shows = {PITOT_BLOCKED: (air.p_total, reads), STATIC_BLOCKED: (air.p_static, np.ones(model.n, dtype=bool))}
    for fault, (pressure, read) in shows.items():
        values, stretches = filled(pressure), set()
        flown, rounding = values[model.frame.airborne], _rounding_pa(model, fault)
        # Of flight as it usually is and as it is at its calmest, between which the noise of a trapped line lies.
        for quiet in (0.5, 0.05):
            noise = max(noise_of_second_differences(flown, 2 * REFERENCE_S, quiet), rounding)
            for second in (at - REFERENCE_S, at, at + REFERENCE_S):
                level = np.median(values[max(second - COURSE_S // 2, 0) : second + COURSE_S // 2 + 1])
                away = read & (np.abs(values - level) > STRAYS * noise)
                first, last = next(((a, b) for a, b in runs(~(away & np.roll(away, 1))) if a <= second < b), (0, 0))
                stretches.add((first, last))
        for first, last in sorted(stretches):
            if last - first >= SHOWN_S:
                yield fault, float(model.time_s[first]), float(model.time_s[last - 1])


def _rounding_pa(model: FlightModel, fault: str) -> float:
    """Return what the steps of a record leave in the pressure of a line, Pa, in the median of the flight."""
    c, metres = model.coefficients, rounding_of(model, "altitude")
    if fault == PITOT_BLOCKED:  # d q = rho V dV
        metres = np.hypot(metres, rounding_of(model, "tas") * c.airspeed / G)
    return float(np.median((metres * _metre_pa(c.height))[model.frame.airborne]))


def has_lines(model: FlightModel) -> bool:
    """Return whether a model measures what the pressure lines make."""
    return {"tas", "altitude"} <= {*model.rows}


def pitot_loss_rows(model: FlightModel) -> dict[str, FloatArray]:
    """Return what a small loss of impact pressure makes of each airspeed, (n,) by its logarithm."""
    c = model.coefficients
    return {name: 0.5 * c.airspeed * (c.cas_share if name == "cas" else 1.0) for name, _ in _airspeed_rows(model)}


def _weight_of_law(place: Place, fault: str, ordinary: Ordinary, run: StackRun, h: int, rows: _Rows) -> Weight:
    """Return what a hypothesis of a run is worth."""
    density = floored_density(ordinary, run.log_density[:, h], run.innovation[:, h], run.sd[:, h], rows.floored)
    anything = -np.log(UNREADABLE * place.bench.model.frame.middle_speed)
    margin, shares = against(place, ordinary, np.where(rows.unread, np.fmax(density, anything), density))
    size = float(run.mean[(place.n if place.offset is None else place.offset) - 1, h, -FAULT_STATES])
    return Weight(
        fault=fault,
        margin=margin,
        shares=shares,
        size=size,
        sd=float(np.sqrt(max(run.final_covariance[h, -FAULT_STATES, -FAULT_STATES], 0.0))),
        refused=_refused(fault, size),
        dispersion=dispersion(place, run.innovation[:, h], shown_rows(place.bench.model, fault)),
        memory_s=memory(place, run.innovation[:, h], shown_rows(place.bench.model, fault)),
    )


def _heats(weights: Sequence[Weight]) -> bool:
    """Return whether a static temperature is made of a line's readings: one that is measured explains less."""
    most = max(weight.margin for weight in weights)
    return not any(weight.margin > most - ALIKE for weight in weights if not weight.heats)


def weights_of_laws(
    hypotheses: Sequence[tuple[Law, Place]], ordinary: Ordinary, *, shocks: FloatArray | None = None
) -> tuple[Weight, ...]:
    """Return what each law is worth, the best of the passes, at places that differ in onset and end alone.

    Parameters
    ----------
    shocks : (n, n_laws, n_states) variances of what else may happen beside each, which the last pass asks for too.
    """
    if len(hypotheses) > AT_ONCE:
        parts = [slice(k, k + AT_ONCE) for k in range(0, len(hypotheses), AT_ONCE)]
        freed = [None if shocks is None else shocks[:, part] for part in parts]
        weights = (weights_of_laws(hypotheses[part], ordinary, shocks=x) for part, x in zip(parts, freed, strict=True))
        return tuple(weight for part in weights for weight in part)
    lags_s, n = _lags_s(hypotheses[0][1].bench.model), len(hypotheses)
    # 1. The course of every law from all but the temperature, which a wrong course makes wrong, too.
    courses = [_first_course(place, law.fault) for law, place in hypotheses]
    rows = [_without_temperature(_about(*each, 0)) for each in zip(hypotheses, courses, strict=True)]
    courses = _courses_of(hypotheses, _run_of_laws(hypotheses, rows))
    # 2. Whether the temperature is made of the line's readings, and how late.
    abouts = [_about(*each, 1) for each in zip(hypotheses, courses, strict=True)]
    rows = [_with_heat(about, lag_s) for lag_s in lags_s for about in abouts]
    run = _run_of_laws(hypotheses, rows)
    weighed = _weights_of_run(hypotheses, ordinary, run, rows, lags_s)
    likeliest = [max(range(j, len(rows), n), key=lambda h: weighed[h].rank) for j in range(n)]
    # 3. About the course that this makes of it.
    courses = _courses_of(hypotheses, run, likeliest)
    rows = [
        _with_heat(_about(hypothesis, course, 2), lags_s[h // n])
        for hypothesis, course, h in zip(hypotheses, courses, likeliest, strict=True)
    ]
    again = _weights_of_run(hypotheses, ordinary, _run_of_laws(hypotheses, rows, shocks), rows)
    return tuple(
        replace(
            max(weight, weighed[h], key=attrgetter("rank")),
            heats=_heats([weighed[k] for k in range(j, len(weighed), n)]),
        )
        for j, (weight, h) in enumerate(zip(again, likeliest, strict=True))
    )


def _courses_of(
    hypotheses: Sequence[tuple[Law, Place]], run: StackRun, likeliest: Sequence[int] | None = None
) -> list[FloatArray]:
    """Return the course of each law that a filter found, in the run of its number."""
    runs = range(len(hypotheses)) if likeliest is None else likeliest
    return [
        _next_course(place, law.fault, run.mean[:, h]) * _growth(place, law)
        for (law, place), h in zip(hypotheses, runs, strict=True)
    ]


def _weights_of_run(
    hypotheses: Sequence[tuple[Law, Place]],
    ordinary: Ordinary,
    run: StackRun,
    rows: Sequence[_Rows],
    lags_s: Sequence[float | None] = (None,),
) -> list[Weight]:
    """Return what each law is worth with each of its rows, without or with what else may happen beside it."""
    weights, likelihood = [], run.log_likelihood
    for h, law_rows in enumerate(rows):
        law, place = hypotheses[h % len(hypotheses)]
        freed = max(range(h, likelihood.size, len(rows)), key=likelihood.__getitem__)
        weight = _weight_of_law(place, law.fault, ordinary, run, freed, law_rows)
        heats = lags_s[h // len(hypotheses)] is not None and "sat" in place.bench.model.seconds.recorded
        weights.append(replace(weight, heats=heats))
    return weights


def _lags_s(model: FlightModel) -> tuple[float | None, ...]:
    """Return the time constants that a thermometer may have, None where the static temperature may be measured.

    It is made of a total one and of the Mach number that is read, or measured: the log need not say.
    """
    if "sat" not in model.rows:
        return (None,)
    return (0.0, THERMOMETER_S) if "tat" in model.seconds.recorded else (0.0, THERMOMETER_S, None)


def _run_of_laws(
    hypotheses: Sequence[tuple[Law, Place]], rows: Sequence[_Rows], shocks: FloatArray | None = None
) -> StackRun:
    """Return the filter of the rows of every law, of several to a law one law after the other.

    Parameters
    ----------
    shocks : (n, n_laws, n_states) of what else may happen; the same rows follow with these.
    """
    first, n = hypotheses[0][1], len(rows)
    moves, starts = zip(*(_moves(place, law) for law, place in hypotheses), strict=True)
    growths = [_growth(place, law)[:, None, None] for law, place in hypotheses]
    extra = np.stack([law_rows.extra * growths[j % len(growths)] for j, law_rows in enumerate(rows)], axis=1)
    y, Z, R = (np.stack([getattr(law_rows, name) for law_rows in rows], axis=1) for name in ("y", "Z", "R"))
    times, freed = n // len(hypotheses), None
    if shocks is not None:
        freed = np.concatenate([np.zeros((first.n, n, shocks.shape[2])), np.tile(shocks, (1, times, 1))], axis=1)
        y, Z, R, extra = (np.concatenate([part, part], axis=1) for part in (y, Z, R, extra))
        times *= 2
    return run_place(
        first,
        shocks=freed,
        y=y,
        Z=Z,
        R=R,
        extra=extra,
        extra_Q=np.tile(np.stack(moves, axis=1), (1, times, 1)),
        extra_start=np.tile(np.stack(starts), (times, 1)),
    )


def shown_rows(model: FlightModel, fault: str) -> list[str]:
    """Return the rows of what a fault of a line changes."""
    return [*_moved_rows(model, fault), *(["sat"] if "sat" in model.rows else [])]


def _moved_rows(model: FlightModel, fault: str) -> list[str]:
    """Return the rows of the airspeeds and heights that a line makes wrong."""
    heights = ("altitude", "altitude_rate") if fault in (STATIC_LEAK, STATIC_BLOCKED) else ()
    return [name for name in (*AIRSPEED_ROWS, *heights) if name in model.rows]


def _refused(fault: str, size: float) -> str:
    if fault in (PITOT_LEAK, PITOT_ICING) and size > -LEAST_LOSS:
        return "the impact pressure does not fall"
    if fault == STATIC_LEAK and abs(size) > MOST_HEIGHT:
        return f"its size of {size:.3g} m is beyond any cabin"
    return ""


def _moves(place: Place, law: Law) -> tuple[FloatArray, FloatArray]:
    """Return (n, 2) variances of a fault's value and rate by second, and (2,) standard deviations at the start."""
    moves = np.zeros((place.n, FAULT_STATES))
    begins = jump_seconds(place, place.onset)
    moves[begins] = np.array([law.sudden, law.rate]) ** 2 / begins.size
    moves[place.onset :, 0] += law.walk**2
    return moves, np.array([law.start, 0.0])


def _growth(place: Place, law: Law) -> FloatArray:
    """Return (n,) the share of what a line goes to that it has reached."""
    since_s = np.maximum(np.arange(place.n) - place.onset + 0.5, 0.0)
    if law.grows_s is not None:
        return np.asarray(np.minimum(since_s / law.grows_s, 1.0))
    if law.time_constant_s is None:
        return np.ones(place.n)
    return np.asarray(-np.expm1(-since_s / law.time_constant_s))


def _first_course(place: Place, fault: str) -> FloatArray:
    """Return (n,) of a line that loses no loss; of a trapped one what the flight is taken for at first.

    Of a trapped total pressure that is the true airspeed, from the ground velocity and the wind before; of a trapped
    static pressure the height, geometric where it is recorded.
    """
    model = place.bench.model
    if fault == PITOT_BLOCKED:
        return _airspeed_without(place)
    if fault == STATIC_BLOCKED:
        height = model.coefficients.height[place.part]
        if "gps_altitude" in model.rows:
            geometric = filled(model.y[:, model.row("gps_altitude")])
            above = np.median((geometric - model.coefficients.height)[place.before])
            return np.where(place.during, geometric[place.part] - above, height)
        return height.copy()
    return np.zeros(place.n)


def _airspeed_without(place: Place) -> FloatArray:
    """Return (n,) airspeed, while a tube is blocked that of ground velocity less the wind before, else as it was."""
    model, c = place.bench.model, place.bench.model.coefficients
    speed = c.airspeed[place.part].copy()
    middle, usual = model.frame.middle_speed, float(np.median(c.airspeed[place.before]))
    guess, channels = np.full(place.n, usual), model.seconds.channels
    if "wind_north" in model.states:
        wind_north, wind_east = (place.mean[model.state(name)] for name in ("wind_north", "wind_east"))
        if "velocity_north" in channels:
            through_air = np.hypot(
                filled(channels["velocity_north"]) - wind_north, filled(channels["velocity_east"]) - wind_east
            )
        else:
            through_air = filled(channels["ground_speed"]) - wind_north * np.cos(c.track) - wind_east * np.sin(c.track)
        share = usual / max(float(np.median(through_air[place.before])), 1.0)
        guess = through_air[place.part] * np.clip(share, 0.8, 1.25)
    return np.where(place.during, np.clip(smoothed(guess, 9), 0.45 * middle, 1.8 * middle), speed)


def _next_course(place: Place, fault: str, mean: FloatArray) -> FloatArray:
    """Return the course that the filter found."""
    model = place.bench.model
    middle = model.frame.middle_speed
    if fault == PITOT_BLOCKED:
        speed = np.clip(smoothed(mean[:, model.state("airspeed")], 7), 0.4 * middle, 2.0 * middle)
        return np.where(place.during, speed, model.coefficients.airspeed[place.part])
    if fault == STATIC_BLOCKED:
        height = smoothed(mean[:, model.state("height")], 7)
        return np.where(place.during, height, model.coefficients.height[place.part])
    value = mean[:, -FAULT_STATES]
    limits = LIMITS[fault]
    course = smoothed(np.clip(value, *limits), COURSE_S)
    course[: max(place.onset + min(place.jumps) - COURSE_S // 2 - 3, 0)] = 0.0
    return np.where(_acts(place), course, 0.0)


def _acts(place: Place) -> BoolArray:
    """Return (n,) where a line that loses may err: until its end."""
    return np.arange(place.n) < (place.n if place.offset is None else place.offset)


def _corrected(place: Place, fault: str, course: FloatArray) -> FlightModel:
    """Return the model around a place of the channels as they would be recorded without the fault."""
    model, around, inside = place.bench.model, place.around, place.inside
    seconds = model.seconds.taken(around)
    record, read = seconds.record, np.clip(model.coefficients.height[around], LOWEST, HIGHEST)
    amount = np.zeros(seconds.time_s.size)
    if fault in (PITOT_LEAK, PITOT_ICING):
        amount[inside] = course if fault == PITOT_ICING else np.expm1(course)
        channels = without_fault(record, "q_impact", amount).channels
    elif fault in (STATIC_LEAK, STATIC_BLOCKED):
        height = model.coefficients.height[place.part] - course if fault == STATIC_LEAK else course
        amount[inside] = pressure_at(read[inside]) - pressure_at(np.clip(height, LOWEST, HIGHEST))
        channels = without_fault(record, STATIC_LEAK, amount).channels
    else:
        # A blocked tube: the channels of the airspeed that the course is.
        share = course / np.maximum(model.coefficients.airspeed[place.part], 1.0)
        names = [name for name in ("tas", second_airspeed(seconds), "mach") if name in seconds.channels]
        channels = {name: filled(seconds.channels[name]).copy() for name in names}
        for values in channels.values():
            values[inside] = np.where(place.during, smoothed(values, 9)[inside] * share, values[inside])
    return model.about_seconds(seconds.with_channels(channels), around)


def _airspeed_rows(model: FlightModel) -> list[tuple[str, int]]:
    return [(name, model.row(name)) for name in AIRSPEED_ROWS if name in model.rows]


def _start_rows(place: Place, corrected: FlightModel) -> _Rows:
    """Return the rows of the corrected model, the air-data channels as recorded."""
    model = place.bench.model
    y = corrected.y[place.inside].copy()
    y = np.where(np.isfinite(place.bench.y[place.part]), y, np.nan)
    for name in ("altitude", "altitude_rate", *AIRSPEED_ROWS):
        if name in model.rows:
            y[:, model.row(name)] = place.bench.y[place.part, model.row(name)]
    return _Rows(
        y=y,
        Z=corrected.Z[place.inside].copy(),
        extra=np.zeros((*y.shape, FAULT_STATES)),
        R=place.R.copy(),
        floored=np.zeros(y.shape, dtype=bool),
        unread=np.zeros(y.shape, dtype=bool),
    )


_About = tuple[Place, FlightModel, _Rows]  # a place, the model around it without a fault, and the rows with it


def _about(hypothesis: tuple[Law, Place], course: FloatArray, k: int) -> _About:
    """Return what a law makes of its place about a course, in a pass."""
    law, place = hypothesis
    corrected = _corrected(place, law.fault, course)
    return place, corrected, _ROWS_OF[law.fault](place, corrected, course, k)


def _without_temperature(about: _About) -> _Rows:
    """Return the rows without the static temperature while the fault lasts."""
    place, _, rows = about
    is_temperature = np.array([name == "sat" for name in place.bench.model.rows])
    return replace(rows, y=np.where(place.during[:, None] & is_temperature, np.nan, rows.y))


def _with_heat(about: _About, lag_s: float | None) -> _Rows:
    """Return the rows with the static temperature by the height and the airspeed that are flown.

    Parameters
    ----------
    lag_s : time constant of the thermometer in the air that is brought to rest, of whose temperature and of the Mach
        number that is read the static one is made; None where it is measured.
    """
    place, corrected, rows = about
    model = place.bench.model
    if "sat" not in model.rows:
        return rows
    rows = replace(rows, y=rows.y.copy(), Z=rows.Z.copy(), extra=rows.extra.copy())
    _add_heat(place, corrected, rows, "altitude", isa_temperature, 0.0)
    if lag_s is not None:
        speeds = [name for name in ("tas", "mach") if name in model.rows]
        missing = [np.isnan(rows.y[place.during, model.row(name)]).sum() for name in speeds]
        read = speeds[int(np.argmin(missing))]
        _add_heat(place, corrected, rows, read, lambda speed: HEATED * speed**2, lag_s)
    return rows


def _add_heat(place: Place, corrected: FlightModel, rows: _Rows, name: str, kelvin: OfCourse, lag_s: float) -> None:
    """Add to the row of the static temperature what it differs by where another height or airspeed is read than flown.

    Courses of both differ by the fault alone, so that without it the row is that of a flight without one. By what the
    states differ from these the row is linear; it follows with a time constant.
    """
    model, part, i, j = place.bench.model, place.part, place.bench.model.row(name), place.bench.model.row("sat")
    if name == "altitude":
        heights = model.coefficients.height[part], corrected.coefficients.height[place.inside]
        read, flown = (np.clip(height, LOWEST, HIGHEST) for height in heights)
    else:
        read, flown = filled(model.y[:, i])[part], filled(corrected.y[:, i])[place.inside]
    by_read, by_flown = ((kelvin(course + 0.5) - kelvin(course - 0.5))[:, None] for course in (read, flown))
    shift = _over_fault(place, rows.y[:, i] - place.bench.y[part, i])
    constant = kelvin(flown) - kelvin(read) - by_flown[:, 0] * flown + by_read[:, 0] * (read + shift)
    makes = np.column_stack(
        [constant, by_flown * model.Z[part, i] - by_read * rows.Z[:, i], -by_read * rows.extra[:, i]]
    )
    makes = np.where(place.during[:, None], makes, 0.0)
    if lag_s > 0.0:
        answers = np.diff(-np.exp(-np.arange(place.n + 1) / lag_s))  # to what was measured so long ago
        makes = np.stack([np.convolve(made, answers)[: place.n] for made in makes.T], axis=1)
    rows.y[:, j] -= makes[:, 0]
    rows.Z[:, j] += makes[:, 1:-FAULT_STATES]
    rows.extra[:, j] += makes[:, -FAULT_STATES:]


def _over_fault(place: Place, values: FloatArray) -> FloatArray:
    """Return (n,) values with those of the fault alone over what is missing while it lasts."""
    at, known = np.arange(place.n), place.during & np.isfinite(values)
    return np.interp(at, at[known], values[known]) if known.any() else np.zeros(place.n)


def _speeds(model: FlightModel, part: slice, row: int) -> FloatArray:
    """Return (n,) smoothed readings of an airspeed, at least a tenth of the usual."""
    values = smoothed(filled(model.y[:, row]), 9)[part]
    return np.maximum(values, 0.1 * model.frame.middle_speed)


def _pitot_loss(
    place: Place, corrected: FlightModel, course: FloatArray, _: int, *, slope: OfCourse, left: OfCourse
) -> _Rows:
    """Return the rows about a course of what is lost of the impact pressure.

    Parameters
    ----------
    slope : derivative of the logarithm of what is left by the course; left : what is left, a share.
    """
    model, rows = place.bench.model, _start_rows(place, corrected)
    acts = _acts(place)
    for _name, j in _airspeed_rows(model):
        load = 0.5 * _speeds(model, place.part, j) * slope(course) * acts
        rows.Z[:, j] *= np.sqrt(left(course))[:, None]
        rows.extra[:, j, 0] = load
        rows.y[:, j] += load * course
        rows.floored[:, j] = place.during
    # Near nothing an instrument reads anything.
    low = place.during & (_speeds(model, place.part, model.row("tas")) < ZERO * model.frame.middle_speed)
    for _name, j in _airspeed_rows(model):
        rows.unread[low, j] = True
    return rows


def _static_error(place: Place, corrected: FlightModel, rows: _Rows, course: FloatArray) -> dict[int, FloatArray]:
    """Scale the airspeed rows about a height error and return what a metre of it makes of each."""
    model, c = place.bench.model, place.bench.model.coefficients
    loads = {}
    for name, j in _airspeed_rows(model):
        reading, true = _speeds(model, place.part, j), _speeds(corrected, place.inside, j)
        share = c.cas_share[place.part] if name == "cas" else np.ones(place.n)
        # Weight of impact pressure by g rho of a metre, of the true airspeed by the static pressure in it besides.
        load = G * share**2 / reading
        ratio = np.clip(true / reading, 0.3, 3.0)
        readings, trues = model.y[place.part, j], corrected.y[place.inside, j]
        rows.Z[:, j] *= ratio[:, None]
        rows.y[:, j] = np.where(course != 0.0, ratio * trues + load * course, readings)
        loads[j] = load
    return loads


def _static_leak(place: Place, corrected: FlightModel, course: FloatArray, k: int) -> _Rows:
    model, rows = place.bench.model, _start_rows(place, corrected)
    acts = _acts(place).astype(np.float64)
    for j, load in _static_error(place, corrected, rows, course).items():
        rows.extra[:, j, 0] = load * acts
        rows.floored[:, j] = place.during
        rows.unread[:, j] = place.during & (_speeds(model, place.part, j) < ZERO * model.frame.middle_speed)
    rows.extra[:, model.row("altitude"), 0] = acts
    rows.floored[:, model.row("altitude")] = place.during
    if "altitude_rate" in model.rows and not model.seconds.record.is_inertial:
        j = model.row("altitude_rate")
        climb = rate_of(course, 5) * acts
        if k == 0:
            rows.extra[:, j, 1] = acts
        rows.y[:, j] -= climb
        rows.R[:, j] += (0.3 * climb) ** 2
    return rows


def _static_blocked(place: Place, corrected: FlightModel, course: FloatArray, k: int) -> _Rows:
    model, rows = place.bench.model, _start_rows(place, corrected)
    during, at = place.during, model.row("altitude")
    recorded = rows.y[:, at].copy()
    held = recorded[place.onset : place.onset + REFERENCE_S]
    held_m = float(np.nanmedian(held)) if np.isfinite(held).any() else 0.0
    error = np.where(during, held_m - course, 0.0)
    height = model.state("height")
    slow = ZERO * model.frame.middle_speed
    for j, load in _static_error(place, corrected, rows, error).items():
        rows.Z[during, j, height] -= load[during]
        rows.extra[during, j, 0] = load[during]
        rows.y[during, j] -= (load * held_m)[during]
        if k == 0:
            rows.y[during, j] = np.nan
        low = during & (model.y[place.part, j] < slow)
        rows.unread[low & (_speeds(model, place.part, j) < slow), j] = True
        rows.floored[:, j] = during
    rows.Z[during, at] = 0.0
    rows.extra[during, at, 0] = 1.0
    rows.y[during, at] = recorded[during] - held_m
    rows.floored[during, at] = True
    if "altitude_rate" in model.rows and not model.seconds.record.is_inertial:
        j = model.row("altitude_rate")
        rows.Z[during, j] = 0.0
        rows.floored[during, j] = True
        rows.R[place.onset : place.onset + 6, j] += 4.0
    return rows


def _pitot_blocked(place: Place, corrected: FlightModel, course: FloatArray, _: int) -> _Rows:
    model, rows = place.bench.model, _start_rows(place, corrected)
    during, air = place.during, model.seconds.air
    pressures = [filled(signal) for signal in (air.p_static, air.q_impact, air.tat)]
    as_flown = _readings(*pressures)
    p_static, q_impact, tat = (signal[place.part] for signal in pressures)
    total = (p_static + q_impact)[place.onset : place.onset + REFERENCE_S]
    trapped = float(np.median(total))
    sonic = SONIC_RATIO * np.minimum(p_static, SEA_LEVEL_PRESSURE) - 30.0
    made = [_readings(p_static, np.clip(trapped - p_static, 0.0, sonic) + more, tat) for more in (0.0, 30.0)]
    readings = []
    for name, j in _airspeed_rows(model):
        shares = (model.y[:, j] / np.maximum(as_flown[name], 1.0))[place.before]
        share = float(np.nanmedian(shares)) if np.isfinite(shares).any() else 1.0
        share = share if np.isfinite(share) and 0.8 < share < 1.25 else 1.0
        per_pa = np.clip((made[1][name] - made[0][name]) / 30.0, 1e-6, 0.3)
        readings.append((j, share * made[0][name], per_pa))
    # The pressures that err are those of the airspeed that is read best: others are held against what it reads.
    best = min(readings, key=lambda reading: float(np.median(place.R[:, reading[0]] / reading[2] ** 2)))[0]
    speed, height = model.state("airspeed"), model.coefficients.height[place.part]
    # The line beside it shows the height that is flown, not the steps in which that is recorded.
    metre_pa = _metre_pa(height)
    for j, predicted, per_pa in readings:
        recorded = model.y[place.part, j]
        if j == best:
            rows.y[during, j] = (recorded - predicted + per_pa * metre_pa * height)[during]
            rows.Z[during, j] = 0.0
            rows.Z[during, j, model.state("height")] = (per_pa * metre_pa)[during]
            rows.extra[during, j, 0] = per_pa[during]
            rows.R[during, j] += ((per_pa * PREDICTED_PA) ** 2)[during]
        else:
            Z = model.Z[place.part]
            ratio = Z[:, j, speed] / np.maximum(Z[:, best, speed], 1e-6)
            rows.y[during, j] = (recorded - ratio * model.y[place.part, best])[during]
            rows.Z[during, j] = (Z[:, j] - ratio[:, None] * Z[:, best])[during]
            rows.R[during, j] += (ratio**2 * place.R[:, best])[during]
        # Near nothing an instrument reads anything: that it reads little is all that is predicted.
        low = during & (predicted < ZERO * model.frame.middle_speed)
        rows.R[low, j] += (0.15 * model.frame.middle_speed) ** 2
        rows.unread[low & (recorded < UNREADABLE * model.frame.middle_speed), j] = True
        rows.floored[:, j] = during
    return rows


def _metre_pa(height: FloatArray) -> FloatArray:
    """Return (n,) by how much the static pressure falls in a metre, Pa."""
    height = np.clip(height, LOWEST, HIGHEST)
    return np.asarray(pressure_at(height - 0.5) - pressure_at(height + 0.5))


def _readings(p_static: FloatArray, q_impact: FloatArray, tat: FloatArray) -> Mapping[str, FloatArray]:
    """Return what an air-data computer makes of pressures, by airspeed row."""
    made = channels_of(p_static, q_impact, tat)
    sound = np.where(made["mach"] > 0.0, made["tas"] / np.maximum(made["mach"], 1e-6), 0.0)
    return {"tas": made["tas"], "cas": made["cas"], "mach": made["mach"] * sound}


_ROWS_OF: Mapping[str, Callable[[Place, FlightModel, FloatArray, int], _Rows]] = {
    PITOT_LEAK: partial(_pitot_loss, slope=lambda course: np.ones(course.shape), left=np.exp),
    PITOT_ICING: partial(_pitot_loss, slope=lambda course: 1.0 / (1.0 + course), left=lambda course: 1.0 + course),
    PITOT_BLOCKED: _pitot_blocked,
    STATIC_LEAK: _static_leak,
    STATIC_BLOCKED: _static_blocked,
}
