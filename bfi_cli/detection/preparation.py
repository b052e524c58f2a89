"""The record of a detection: its channels, healthy time and rate, and the directions in which its inputs move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..config import Config
from ..errors import ConfigError, LogError
from ..faults.filters import alternatives, recorder_low_passes, response_of
from ..flightlog import Channel, FlightLog, require_usable, resample
from ..flightlog.derived import with_derived
from ..flightlog.phases import APART_S, flight_stretches, phases_of
from ..flightlog.quality import recorder_filters
from ..flightlog.record import frozen_array
from ..kernels import BoolArray, FloatArray
from ..kernels.input_directions import directions, independent, moments
from ..kernels.low_pass import WHITE, Response, decimate, lost_samples, lowpass_taps
from ..model.preprocessing.signals import NativeSignals, choose_rate, decimate_native, is_exact
from ..model.preprocessing.window import moves, must_resample, require_outputs_move
from ..notes import Note
from ..quantities.channels import INPUTS
from ..quantities.text import instant

# What is watched where the user names nothing, and the controls of the other axes, which then are no inputs.
OUTPUTS = ("tas", "tas_rate", "aoa", "pitch", "pitch_rate", "altitude_rate", "altitude")
LATERAL = ("aileron", "rudder")
# Accelerations feel gusts and thrust at once, which the controls do not: with them 3 of 3 biases of the airspeed are
# localised in recorded flights, with the elevator alone none (docs/validation.md).
FELT = ("longitudinal_acc", "normal_acc")
# A failure shows at once, which a higher rate than that of an identification tells sooner.
FASTEST_HZ = 20.0
# A recorder that nobody states is taken to keep at least half of this frequency, and to spread a step over no more
# seconds to either side: the slowest that is known here, of the recorded Citation flights, is a Gaussian with this
# edge, which ends within 0.75 s.
UNSTATED_HZ, UNSTATED_S = 0.75, 1.0
# Share of a step that a filter may still hold back, or show too early, where its height is read.
UNRISEN = 0.01
# The channels that describe a turn, and the outputs that it changes.
BANK = ("roll", "yaw_rate")
LONGITUDINAL = {"aoa", "pitch", "pitch_rate", "altitude_rate", "altitude", "normal_acc"}
TURNS = "inputs made of roll and yaw_rate explain turns (--no-turns omits them)"
FELT_INPUTS = "inputs include {}, which feel gusts and thrust; they are taken to be free of faults (--input chooses)"
CUT_OFF = "nothing after {} s is watched: the recorder's low-pass needs {:.2g} s more, after the end of the log"
# Cosine of the steepest bank, 78 degrees: the load factor of a turn has no bound.
STEEPEST = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderFilters:
    """What the recorder may have done to a step.

    Attributes
    ----------
    stated : whether it is known: stated or seen, or that there is none; about : a sentence on it.
    filters : whether the record went through a low-pass, or may have; reach_s : how far that reaches to either side.
    edge_hz : the lowest edge that it may have, None where it has none; shown_hz : the lowest that is stated or seen.
    ahead_s : how far it looks ahead; until_s : up to when the log is free of its end, on the log's axis.
    """

    stated: bool
    filters: bool
    reach_s: float
    edge_hz: float | None
    shown_hz: float | None
    ahead_s: float
    until_s: float
    about: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedRecord:
    """The window from the start of the healthy time on, at the log's own rate.

    Attributes
    ----------
    record : inputs, those that describe turns among them, and outputs; no dictionary.
    train : healthy time; watched : the stretches of flight after it.
    inputs : channels of the log; units : of the outputs.
    factor : of the decimation; rate_reason : why.
    exact : a linear model explains the healthy time to round-off.
    recorder : what it may have done to a step.
    """

    record: NativeSignals
    train: tuple[float, float]
    watched: tuple[tuple[float, float], ...]
    inputs: tuple[str, ...]
    units: tuple[str, ...]
    factor: int
    rate_reason: str
    exact: bool
    recorder: RecorderFilters
    notes: tuple[Note, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DecimatedRecord:
    """The record at the rate of the analysis.

    Attributes
    ----------
    path : of the log, for messages; outputs, units : names, and the unit of each.
    time_s : (n,) of the samples; reach_s : from a sample to the last sample of the log that it was filtered from.
    smear_s : the time to either side over which the filters, the recorder's among them, spread a step.
    y : (n, n_outputs).
    u : (n, k) mean and first moment, over the time since the sample before, of each direction the inputs move in.
    weak : (k,) which of them hardly stand out of the noise in the healthy time.
    healthy : (n,) samples of the healthy time; watched : (n,) samples that are watched.
    """

    path: str
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    rate_hz: float
    time_s: FloatArray
    reach_s: float
    smear_s: float
    y: FloatArray
    u: FloatArray
    weak: BoolArray
    healthy: BoolArray
    watched: BoolArray


def prepare_detection(log: FlightLog, config: Config) -> PreparedRecord:
    """Cut, check and, where the rate asks for it, resample a log.

    Raises
    ------
    LogError : it cannot be analysed.
    ConfigError : the healthy time is not in the log, or leaves nothing to watch.
    """
    # 1. The healthy time, and the flight after it.
    from_s, to_s = config.window.from_s, config.window.to_s
    given_inputs = config.inputs if "inputs" in config.model_fields_set else ()
    given_outputs = config.outputs if "outputs" in config.model_fields_set else ()
    log = with_derived(log, (*given_inputs, *given_outputs), from_s=from_s, to_s=to_s)
    part = log.window(from_s, to_s)
    last_s = float(part.time_s[-1])
    flown = _flown(log, float(part.time_s[0]), last_s + 1.0 / part.rate_hz)
    train = config.detect.train or _first_third(flown)
    watch_s = train[1] if from_s is None else max(train[1], from_s)
    watched = tuple((max(a, watch_s), b) for a, b in flown if b > watch_s)

    # 2. What is cut, and which channels of it.
    stop_s = flown[-1][1] if flown[-1][1] <= last_s else to_s
    inputs, outputs = _channels(log.window(train[0], stop_s), given_inputs, given_outputs)
    # What describes a turn counts where an output feels turns, and it is neither input nor output.
    free = all(name in log.channels and name not in (*inputs, *outputs) and moves(log.channel(name)) for name in BANK)
    turning = config.detect.turns and free and not LONGITUDINAL.isdisjoint(outputs)
    bank = [name for name in (*BANK, "pitch_rate") if turning and name in log.channels]
    part = _cut(log, config, train, stop_s, list(dict.fromkeys((*inputs, *outputs, *bank))))
    last_s = float(part.time_s[-1])

    # 3. The recorder.
    recorder = recorder_of(log, config)
    if watch_s >= min(last_s, recorder.until_s) or not watched:
        raise ConfigError(f"--train: nothing is left to watch after {instant(watch_s)} s; end it earlier")

    # 4. The signals, those that a turn makes among the inputs, and the rate.
    turns = _turns(part) if turning else {}
    part = replace(part, channels={**part.channels, **turns})
    record = NativeSignals(log=part, inputs=(*inputs, *turns), outputs=outputs)
    healthy = record.between(slice(np.count_nonzero(part.time_s < train[1])))
    cut_off = last_s > recorder.until_s
    felt = () if given_inputs else tuple(name for name in FELT if name in inputs)
    factor, reason = choose_rate(
        healthy,
        (),
        exact=False,
        asked=config.conditioning.rate_hz,
        recorder_hz=recorder.shown_hz,
        fastest_hz=FASTEST_HZ,
        purpose="detect",
    )
    return PreparedRecord(
        record=record,
        train=train,
        watched=watched,
        inputs=inputs,
        units=tuple(part.channel(name).unit for name in outputs),
        factor=factor,
        rate_reason=reason,
        exact=is_exact(healthy),
        recorder=recorder,
        notes=(
            *_notes_on_times(log, config, train, watched),
            *([Note.limit(CUT_OFF.format(instant(recorder.until_s), recorder.ahead_s))] if cut_off else []),
            *([Note.method(FELT_INPUTS.format(", ".join(felt)))] if felt else []),
            *([Note.method(TURNS)] if turning else []),
            *([Note.method(recorder.about)] if recorder.stated and recorder.about else []),
        ),
    )


def _cut(
    log: FlightLog, config: Config, train: tuple[float, float], stop_s: float | None, needed: Sequence[str]
) -> FlightLog:
    """Return the log from the start of the healthy time on, resampled where decimation cannot bring it to the rate.

    Raises
    ------
    ConfigError : the healthy time is not in it.
    """
    part, rate_hz = log.window(train[0], stop_s), config.conditioning.rate_hz
    if must_resample(part, needed, rate_hz):
        assert not isinstance(rate_hz, str)
        part = resample(log, rate_hz, from_s=train[0], to_s=stop_s)
        require_usable(part, needed)
    first_s, last_s = float(part.time_s[0]), float(part.time_s[-1])
    if train[0] < first_s - 1.0 / part.rate_hz or train[1] > last_s:
        raise ConfigError(
            f"--train: {instant(train[0])}:{instant(train[1])} is not inside the window, {instant(first_s)} s to "
            f"{instant(last_s)} s; change --train, --from or --to"
        )
    return part


def recorder_of(log: FlightLog, config: Config) -> RecorderFilters:
    """Return what the recorder of a log may have done to a step, as the log or the configuration states it."""
    filters, about = recorder_filters(log, config.recorder.edge_hz, config.recorder.kind)
    stated = log.filters is not None or config.recorder.edge_hz != "auto"
    through = response_of(filters, log.rate_hz)
    # At the end of a log a recorder that looks ahead has filtered samples that it never had.
    ahead_s = response_of(recorder_low_passes(filters), log.rate_hz).before / log.rate_hz
    # A recorder that the log shows bounds what is excluded, also where a faster one, or none, is stated.
    chains = (filters, *alternatives(filters), log.filters or ())
    shown_hz = min((low_pass.edge_hz for chain in chains for low_pass in recorder_low_passes(chain)), default=None)
    return RecorderFilters(
        stated=stated,
        filters=not stated or len(filters) > 0,
        reach_s=_spread(through) / log.rate_hz if stated else UNSTATED_S,
        shown_hz=shown_hz,
        edge_hz=shown_hz if stated else UNSTATED_HZ,
        ahead_s=ahead_s,
        until_s=float(log.time_s[-1]) - ahead_s if ahead_s > 0.0 else np.inf,
        about=about,
    )


def _turns(part: FlightLog) -> dict[str, Channel]:
    """Return what a turn adds to longitudinal motion, by name.

    The pitch angle changes with q cos(roll) - r sin(roll), not with q, and the load factor is 1 / cos(roll).
    """
    roll, yaw_rate = (part.channel(name).values for name in BANK)
    level = np.maximum(np.cos(roll), STEEPEST)
    made = {"yaw_rate sin(roll)": yaw_rate * np.sin(roll), "load factor - 1": 1.0 / level - 1.0}
    if "pitch_rate" in part.channels:
        made["pitch_rate (1 - cos(roll))"] = part.channel("pitch_rate").values * (1.0 - level)
    return {name: Channel(name=name, values=frozen_array(made[name]), unit="", source=name) for name in made}


def _notes_on_times(
    log: FlightLog, config: Config, train: tuple[float, float], watched: Sequence[tuple[float, float]]
) -> list[Note]:
    """Return the notes on the healthy time, and on the flight that is not watched."""
    from_s, to_s = log.ends(config.window.from_s, config.window.to_s)
    notes = []
    if config.detect.train is None:
        notes.append(
            Note.advice(
                f"{instant(train[0])} to {instant(train[1])} s is taken as healthy, and a fault in it passes for "
                "normal; --train A:B gives another time"
            )
        )
    elif train[0] > from_s + 1.0 / log.rate_hz:
        notes.append(Note.limit(f"nothing before the healthy time, which begins at {instant(train[0])} s, is analysed"))
    if len(watched) > 1 or (watched and watched[0][1] < to_s - APART_S):
        named = ", ".join(f"{instant(a)} to {instant(b)} s" for a, b in watched)
        notes.append(
            Note.limit(
                f"watched in flight only, {named}: not in take-off, approach, landing and parabolas, nor on the ground"
            )
        )
    return notes


def _flown(log: FlightLog, from_s: float, to_s: float) -> list[tuple[float, float]]:
    """Return the stretches of flight within a window; the whole of it where the log does not tell of a flight.

    Signals that are deviations from a trim, as linear models give them, have no airspeed that an aircraft flies at.
    """
    flown = flight_stretches([phase for phase in phases_of(log) if phase.phase != "approach"])
    inside = [(max(a, from_s), min(b, to_s)) for a, b in flown if b > from_s and a < to_s]
    if flown and not inside:
        raise LogError(
            f"{log.path}: no flight between take-off and approach in the window, {instant(from_s)} to {instant(to_s)} "
            f"s; the log flies from {instant(flown[0][0])} to {instant(flown[-1][1])} s: change --from or --to"
        )
    return inside or [(from_s, to_s)]


def _first_third(flown: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the healthy time where none is given: a third of the flight, or as much of it as a stretch holds.

    It begins with the first stretch that is long enough: shorter stretches before it are hops, and are not analysed.
    """
    third = sum(b - a for a, b in flown) / 3.0
    longest = max(b - a for a, b in flown)
    start, stop = next((a, b) for a, b in flown if b - a >= min(third, longest))
    if stop == flown[-1][1]:
        third = min(third, (stop - start) / 3.0)  # nothing else is left to watch
    return start, min(stop, start + third)


def decimate_record(prepared: PreparedRecord, factor: int) -> DecimatedRecord:
    """Return the record filtered and decimated by `factor`.

    Between two samples an input may move in any way. Its mean and first moment over that time determine nearly all of
    its effect on rigid-body motion; its value at the sample does not.

    Raises
    ------
    LogError : the window is shorter than the filter.
    """
    record = prepared.record
    decimated = decimate_native(replace(record, inputs=()), factor)[0]
    moving, weak = directions(record.u, record.time_s < prepared.train[1])
    u = decimate(moments(moving, factor), factor, WHITE)
    before, after = lost_samples(factor, WHITE)
    through = Response(taps=lowpass_taps(factor, WHITE), before=before)
    time_s, reach_s = decimated.time_s, after / record.rate_hz
    own_s = _spread(through) / record.rate_hz if factor > 1 else 0.0
    kept = independent(u)
    return DecimatedRecord(
        path=decimated.path,
        outputs=record.outputs,
        units=prepared.units,
        rate_hz=decimated.rate_hz,
        time_s=time_s,
        reach_s=reach_s,
        smear_s=prepared.recorder.reach_s + own_s,
        y=decimated.y,
        u=u[:, kept],
        weak=np.resize(weak, u.shape[1])[kept],
        healthy=time_s + reach_s < prepared.train[1],
        watched=(time_s + reach_s <= prepared.recorder.until_s)
        & np.any([(time_s - reach_s >= a) & (time_s + reach_s <= b) for a, b in prepared.watched], axis=0),
    )


def _spread(response: Response) -> int:
    """Return the samples to either side of a step beyond which a filter leaves less than UNRISEN of it."""
    course = np.cumsum(response.taps)
    beyond = np.flatnonzero(np.minimum(np.abs(course), np.abs(1.0 - course)) > UNRISEN)
    return int(np.max(np.abs(beyond - response.before), initial=0)) + 1


def _channels(
    part: FlightLog, given_inputs: tuple[str, ...], given_outputs: tuple[str, ...]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the channels that are given, else the controls and accelerations, and the flight data, that move."""
    inputs = given_inputs or tuple(
        name
        for name in (*INPUTS, *FELT)
        if name not in (*LATERAL, *given_outputs) and name in part.channels and moves(part.channel(name))
    )
    outputs = given_outputs or tuple(
        name for name in OUTPUTS if name in part.channels and name not in inputs and moves(part.channel(name))
    )
    if not outputs:
        has = ", ".join(sorted(part.channels))
        raise LogError(f"{part.path}: no output to watch; the log has: {has}; name some with --output")
    require_outputs_move(part, outputs)
    return inputs, outputs
