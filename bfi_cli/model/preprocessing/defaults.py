"""Output, inputs, window and tolerances of an analysis where the user names none, and what would answer more.

The output is tas, the inputs are the trusted channels that the log has, of published methods the elevator, and the
window is the whole log. Where a log lacks them, as an autopilot's without a true airspeed or a Garmin's without an
elevator, the nearest channels are taken. What differs from the configuration is named in a note. Manoeuvres that no
linear model of one trim follows are evidence of their own. A fault is excluded where no error of its channel beyond the
tolerance can hide. What an analysis leaves open is answered by channels to record, or by a command that works.
"""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...config import Config, merge
from ...decision import Evidence, Manoeuvre
from ...dictionary import is_shipped
from ...errors import ConfigError, LogError
from ...faults import Decision, Fault, did_you_mean
from ...faults.shapes import Kind
from ...flightlog import Channel, FlightLog
from ...flightlog.phases import (
    HOVER,
    RECOVERY_S,
    TRANSITION,
    Phase,
    airborne_phases,
    airborne_stretches,
    phases_of,
)
from ...flightlog.quality import gap_starts, held_hz, is_long
from ...flightlog.signs import HEIGHTS, cruise_of
from ...kernels import FloatArray
from ...kernels.runs import left_of, runs, within
from ...methods import METHODS
from ...notes import Note
from ...quantities.channels import INPUTS, channel_in_words, quantity_of
from ...quantities.text import instant
from .window import TRUSTED

OTHER_AIRSPEEDS = ("cas", "ias")
# Phases that no linear model of one trim follows.
MANOEUVRES = ("stall", "parabola")
# What moves an aircraft lengthwise, and what shows that it does: one of each group, the first that moves.
SURFACES = tuple(name for name in INPUTS if name.startswith("elevator"))
THRUST = ("throttle", "n1_left", "n1_right")
IN_PLACE_OF_ELEVATOR = (SURFACES, THRUST, ("pitch",), ("longitudinal_acc",))
# Part of a lever's travel, or of an engine's speed, that a pilot moves on purpose. Then the elevator does not tell the
# airspeed: in simulated flights of JSBSim with a doublet of the throttle by 0.15, a 737 and an F-16 without a fault
# had ramps declared in 39 of 40 windows with the elevator alone, in none with these inputs. Thrust follows its lever
# with a lag of its own, so that the throttle beside the elevator does not suffice.
MOVED_THRUST = 0.05
# An aircraft that stands or rolls is lower than the lowest hundredth of its flight by less than this part of what it
# flew above it: an airport may lie above another. Chosen without a tuning record.
LOW = 0.2
# A cut of less is none, s: an airspeed wavers at the ends of a log.
LEAST_CUT_S = 1.0
# Each has a trim of its own; take-off and landing are too short to hold a dictionary.
TRIMS = ("climb", "cruise", "descent", "approach")
# Exact by definition.
KNOT, FOOT, DEGREE = 1852.0 / 3600.0, 0.3048, np.pi / 180.0
AIRSPEEDS = ("tas", "cas", "ias", "lift_speed", "ground_airspeed")
# CS/FAR 25.1323(b): the error of an airspeed may be 3 % or 5 kt, whichever is greater; of a slow aircraft that would
# be most of its speed, so no more than a tenth.
AIRSPEED_SHARE, AIRSPEED_LEAST, AIRSPEED_MOST = 0.03, 5.0 * KNOT, 0.1
# CS/FAR 25.1325(e): the error of an altitude may be 30 ft per 100 kt, and at least 30 ft.
ALTITUDE_PER_SPEED, ALTITUDE_LEAST = 30.0 * FOOT / (100.0 * KNOT), 30.0 * FOOT
# ICAO Annex 6, part I, appendix 8: a recorded outside or total air temperature may err by 2 degrees.
TEMPERATURE = 2.0
# No regulation names these; they are what a flight-test engineer would repeat a test point for.
FIXED = {
    **dict.fromkeys(("tat", "sat"), TEMPERATURE),
    "mach": 0.01,
    "altitude_rate": 1.5,
    **dict.fromkeys(("aoa", "sideslip", "pitch", "roll", "yaw", "flight_path_angle", "climb_angle"), DEGREE),
    **dict.fromkeys(("pitch_rate", "roll_rate", "yaw_rate"), DEGREE),
    **dict.fromkeys(("longitudinal_acc", "lateral_acc", "normal_acc", "kinematic_acc"), 0.3),
}
OTHER_SHARE = 0.1  # of the range of a channel that neither names
# FIRST: inputs that shorten the tail of healthy windows most, wherever they are recorded.
FIRST = ("pitch", "longitudinal_acc")
# WIDER_S [s]: by how much a window is begun earlier and ended later; half of that of the shipped tables.
WIDER_S = 60.0


def with_defaults_of(log: FlightLog, config: Config) -> tuple[Config, tuple[Note, ...]]:
    """Return the configuration with what a log has in place of defaults that it lacks, and notes that name it.

    1. Output: tas; in a log without it the airspeed with the highest rate of its own, of equal ones cas before ias.
    2. Inputs: see `default_inputs`.
    3. Window, where neither end is given: from take-off to landing, if the log shows a ground speed or an altitude
       that tells them; an airspeed alone may be the faulty channel. Of a log whose messages have clocks of their own,
       the longest stretch therein without a gap.

    Inputs, output and window that the command line or a file states are left as they are.
    """
    chosen, notes = config.model_fields_set, []
    others = [log.channels[name] for name in OTHER_AIRSPEEDS if name in log.channels and name not in config.inputs]
    if "outputs" not in chosen and "tas" not in log.channels and others:
        output = max(others, key=lambda channel: channel.own_rate_hz or log.rate_hz).name
        notes.append(Note.method(f"no 'tas' in the log: the output is '{output}', the fastest airspeed there is"))
        config = merge(config, {"outputs": [output]})
    if "inputs" not in chosen and (inputs := default_inputs(log, config)) != config.inputs:
        why = "all trusted channels"
        if "elevator" not in inputs:
            why = f"'elevator' {'does not move' if 'elevator' in log.channels else 'is not in the log'}"
        elif METHODS[config.method].is_published:
            why = f"'{inputs[1]}' moves, which changes the airspeed too"
        notes.append(Note.method(f"{why}: the inputs are {', '.join(inputs)}"))
        config = merge(config, {"inputs": list(inputs)})
    if (config.window.from_s, config.window.to_s) == (None, None):
        config, about = _with_window(log, config)
        notes += about
    return config, tuple(notes)


def default_inputs(log: FlightLog, config: Config) -> tuple[str, ...]:
    """Return the inputs where the user names none: those that are there, move, and follow from no output.

    The elevator; where the log has none, or one that never moves, another elevator surface, throttle or N1, pitch and
    longitudinal acceleration. Where the pilot moves throttle or N1 in the window, these beside the elevator. Beside
    these, but for published methods, the trusted channels that are finite throughout the window.
    """
    groups: tuple[tuple[str, ...], ...] = IN_PLACE_OF_ELEVATOR
    if "elevator" in log.channels and np.ptp(_finite(log.channels["elevator"].values)) > 0.0:
        groups = (("elevator",), *(IN_PLACE_OF_ELEVATOR[1:] if _thrust_is_moved(log, config) else ()))
    usable = [
        name
        for name, channel in log.channels.items()
        if name not in config.outputs and not {*channel.derived_from} & {*config.outputs}
    ]
    inputs = []
    for group in groups:
        inputs += [name for name in group if name in usable and _moves(log, log.channels[name])][:1]
    if not METHODS[config.method].is_published:
        part = log.window(config.window.from_s, config.window.to_s)
        beside = [name for name in TRUSTED if name in usable and name not in inputs]
        beside = [name for name in beside if np.isfinite(part.channels[name].values).all()]
        inputs += [name for name in beside if _moves(log, log.channels[name])]
    return tuple(inputs) or config.inputs


def _thrust_is_moved(log: FlightLog, config: Config) -> bool:
    """Say whether the first of `THRUST` that is there moves in the window by more than engines do alone."""
    names = (name for name in THRUST if name in log.channels and name not in config.outputs)
    name = next((name for name in names if _moves(log, log.channels[name])), None)
    if name is None:
        return False
    first = -np.inf if config.window.from_s is None else config.window.from_s
    last = np.inf if config.window.to_s is None else config.window.to_s
    values = log.channels[name].values[(log.time_s >= first) & (log.time_s <= last)]
    values = values[np.isfinite(values)]
    return bool(values.size and np.ptp(values) > MOVED_THRUST)


def _moves(log: FlightLog, channel: Channel) -> bool:
    """Say whether a channel moves, and is not held between values of a lower rate."""
    values = channel.values  # of a day read once
    return bool(np.ptp(_finite(values)) > 0.0) and held_hz(log, channel) is None


def _finite(values: FloatArray) -> FloatArray:
    """Return the samples that are numbers, or a zero where none is."""
    known = np.isfinite(values)
    return values if known.all() else values[known] if known.any() else np.zeros(1)


def _with_window(log: FlightLog, config: Config) -> tuple[Config, list[Note]]:
    """Return the configuration with the window from take-off to landing, without gaps where clocks are the log's."""
    notes = []
    first, stop = _flight(log)  # samples
    if (first, stop) != (0, log.n_samples):
        cut = [f"from {instant(log.time_s[first])} s, after take-off"] * (first > 0)
        cut += [f"to {instant(log.time_s[stop - 1])} s, before landing"] * (stop < log.n_samples)
        notes.append(Note.method(f"analysed {', '.join(cut)}; --from and --to take more"))
    if "hover" in log.channels or any(channel.own_rate_hz is not None for channel in log.channels.values()):
        pieces = _whole_pieces(log, [*config.inputs, *config.outputs], first, stop)
        why = "gaps or hovers" if "hover" in log.channels else "gaps"
        if pieces and pieces != [(first, stop)]:
            first, stop = max(pieces, key=lambda piece: piece[1] - piece[0])
            notes.append(
                Note.method(
                    f"the log has {why}: of {len(pieces)} stretches the longest without is analysed, from "
                    f"{instant(log.time_s[first])} s to {instant(log.time_s[stop - 1])} s; --from and --to take another"
                )
            )
    if (first, stop) == (0, log.n_samples):
        return config, []
    step = 1.0 / log.rate_hz
    window = {"window.from_s": float(log.time_s[first])} if first > 0 else {}
    if stop < log.n_samples:
        window["window.to_s"] = float(log.time_s[stop - 1]) + 0.5 * step
    return merge(config, window), notes


def _flight(log: FlightLog) -> tuple[int, int]:
    """Return the first sample after take-off and the first at or after landing; the whole log if unknown.

    They are the outer ends of `airborne_stretches`, by the ground speed, or by an airspeed where the altitude agrees.
    Between them the aircraft is in the air, whatever the sensors show.
    """
    whole = (0, log.n_samples)
    by_ground_speed = "ground_speed" in log.channels
    if not by_ground_speed and log.channels.keys().isdisjoint(HEIGHTS):
        return whole
    stretches = airborne_stretches(log, suspects=("tas", "cas", "ias", "mach"))
    if not stretches:
        return whole
    from_s, to_s = stretches[0][0], stretches[-1][1]
    first, stop = (int(np.searchsorted(log.time_s, end)) for end in (from_s, to_s))
    if log.time_s[first] - log.time_s[0] < LEAST_CUT_S or not (
        by_ground_speed or _is_low(log, first, stop, slice(first))
    ):
        first = 0
    if log.time_s[-1] - to_s < LEAST_CUT_S or not (by_ground_speed or _is_low(log, first, stop, slice(stop, None))):
        stop = log.n_samples
    return first, stop


def _is_low(log: FlightLog, first: int, stop: int, part: slice) -> bool:
    """Say whether the outer half of a part of the log before take-off or after landing is as low as the ground."""
    altitude = next(log.channels[name].values for name in HEIGHTS if name in log.channels)
    flown = altitude[first:stop]
    flown, outer = flown[np.isfinite(flown)], altitude[part]
    outer = outer[: -(-outer.size // 2)] if part.stop is not None else outer[outer.size // 2 :]
    outer = outer[np.isfinite(outer)]
    if not flown.size or not outer.size:
        return False
    low, high = np.quantile(flown, [0.01, 0.99])
    return bool(np.median(outer) <= low + LOW * (high - low))


def _whole_pieces(log: FlightLog, names: Sequence[str], first: int, stop: int) -> list[tuple[int, int]]:
    """Return (first, stop) of the pieces without a gap in which every channel is a number."""
    known = np.zeros(log.n_samples, dtype=bool)
    known[first:stop] = True
    for name in names:
        if name in log.channels:
            known &= np.isfinite(log.channels[name].values)
    rotors = [(phase.from_s, phase.to_s) for phase in phases_of(log) if phase.phase in (HOVER, TRANSITION)]
    known &= ~within(log.time_s, rotors)
    pieces, gaps = list[tuple[int, int]](), gap_starts(log.time_s) + 1
    for low, high in runs(known):
        pieces += pairwise([low, *gaps[(gaps > low) & (gaps < high)].tolist(), high])
    return pieces


def require_one_trim(window: FlightLog, faults: Sequence[Fault], config: Config) -> None:
    """Refuse a long window that goes on, after the last onset of a dictionary, for phases as long as all its onsets.

    A model of one trim describes one of them, and what it leaves of the others looks like a fault.

    Parameters
    ----------
    faults : of the dictionary, on the axis of the window.

    Raises
    ------
    LogError : naming windows to take.
    """
    if not is_long(window):
        return
    start_s, stop_s = float(window.time_s[0]), float(window.time_s[-1])
    last_s = max((fault.onset_s for fault in faults if start_s <= fault.onset_s <= stop_s), default=start_s)
    later = [
        phase.phase
        for phase in phases_of(window, suspects=config.outputs)
        if phase.phase in TRIMS and phase.from_s > last_s and phase.to_s - phase.from_s > last_s - start_s
    ]
    if later:
        from ...flightlog.excitation import advice_on_windows

        named = ", ".join(dict.fromkeys(later))
        raise LogError(
            f"{window.path}: {advice_on_windows(window)}; after {instant(last_s)} s, where the last entry of the "
            f"dictionary begins, come {len(later)} phases ({named}) that a model of one trim does not describe; give "
            "--from and --to within one of them"
        )


def manoeuvres_of(log: FlightLog, suspects: Collection[str]) -> Evidence:
    """Return the stalls and parabolas of a log.

    Parameters
    ----------
    suspects : channels that may be faulty, which do not say how the aircraft flies where others do.
    """
    return Evidence(source="phases", manoeuvres=_manoeuvres(phases_of(log, suspects=suspects)))


def modelled_stretches(log: FlightLog, suspects: Collection[str]) -> list[tuple[float, float]]:
    """Return (from_s, to_s) of the stretches of flight that a linear model may follow: without stalls and parabolas."""
    phases = phases_of(log, suspects=suspects)
    return left_of(airborne_phases(phases), [manoeuvre.reach_s for manoeuvre in _manoeuvres(phases)])


def _manoeuvres(phases: Sequence[Phase]) -> tuple[Manoeuvre, ...]:
    return tuple(
        Manoeuvre(name=phase.phase, from_s=phase.from_s, to_s=phase.to_s, beside_s=RECOVERY_S)
        for phase in phases
        if phase.phase in MANOEUVRES
    )


def is_any(error: float, window: FlightLog, channel: str) -> bool:
    """Return whether an error is as large as any could be: of a speed, larger than all that it reads in the window."""
    known = window.channel(channel)
    if quantity_of(known.name) not in (*AIRSPEEDS, "ground_speed", "mach"):
        return not np.isfinite(error)
    return not error <= float(np.max(np.abs(known.values[np.isfinite(known.values)]), initial=0.0))


def tolerances_of(log: FlightLog, window: FlightLog, channels: tuple[str, ...], config: Config) -> dict[str, float]:
    """Return the tolerance of each channel, the one that the configuration states or that of `tolerance_of`.

    Raises
    ------
    ConfigError : a tolerance is stated for a channel that is no output.
    """
    stated = config.tolerances
    for name in stated:
        if name not in channels:
            place = config.place(f"tolerances.{name}")
            raise ConfigError(f"{place}: '{name}' is no output of this analysis{did_you_mean(name, channels)}")
    return {name: stated.get(name) or tolerance_of(log, window, name) for name in channels}


def tolerance_of(log: FlightLog, window: FlightLog, channel: str) -> float:
    """Return the default tolerance of a channel, in its unit.

    Parameters
    ----------
    log : the flight, of which the part outside the window says how far a channel without a rule travels.
    window : the part analysed, whose airspeed counts.
    """
    name = window.channel(channel).name
    quantity = quantity_of(name)
    if quantity in FIXED:
        return FIXED[quantity]
    if quantity in AIRSPEEDS:
        speed = _cruising_speed(window, name)
        # An airspeed that is lost from the first sample on has no share of a speed.
        return min(max(AIRSPEED_SHARE * speed, AIRSPEED_LEAST), AIRSPEED_MOST * speed) or AIRSPEED_LEAST
    if quantity in ("altitude", "baro_altitude"):
        known = [name for name in AIRSPEEDS if name in window.channels]
        speed = _cruising_speed(window, known[0]) if known else 0.0
        return max(ALTITUDE_PER_SPEED * speed, ALTITUDE_LEAST)
    outside = (log.time_s < window.time_s[0]) | (log.time_s > window.time_s[-1])
    # Travels of the window alone where it is the whole log, the channel is derived within it, or rests elsewhere.
    elsewhere = [log.channel(name).values[outside]] if name in log.channels else []
    travels = (_travel(values) for values in (*elsewhere, window.channel(name).values))
    return OTHER_SHARE * next((travel for travel in travels if travel > 0.0), 0.0)


def _travel(values: FloatArray) -> float:
    """Return the distance between the least and the greatest value; 0 of none."""
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _cruising_speed(window: FlightLog, channel: str) -> float:
    """Return the median of an airspeed where it is not lost, nor the aircraft on the ground; 0 where there is none."""
    return cruise_of(np.abs(window.channel(channel).values))


def what_would_help(
    log: FlightLog, config: Config, verdicts: Mapping[Kind, Decision], *, dictionary: str | None = None
) -> Note | None:
    """Return advice on what would answer the kinds that are inconclusive, None where none is.

    Parameters
    ----------
    log : with all its channels.
    config : with the inputs in use.
    dictionary : path of the dictionary of an identification, which may be no file; None of a search over all onsets.
    """
    left = [kind for kind, verdict in verdicts.items() if verdict == "inconclusive"]
    if not left:
        return None
    unused = [name for name in TRUSTED if name not in (*config.inputs, *config.outputs)]
    here = [name for name in unused if name in log.channels]
    missing = [name for name in FIRST if name in unused and name not in log.channels]
    decided = [kind for kind in verdicts if kind not in left]
    wider = _wider(log, config) if "oscillating" in left else ()
    options: tuple[str, ...] = ()
    if here:
        why, options = f"take {', '.join(here)} as inputs too", ("--input", "auto")
    elif wider:
        why, options = "take a longer window", wider
    elif left == ["slow"] and decided:
        why, options = "ask only for what the log can tell", ("--require", ",".join(decided))
    helps = [f"record {' and '.join(channel_in_words(name) for name in missing)}"] if missing else []
    if "oscillating" in left and not wider:
        helps.append("record for longer")
    if "abrupt" in left and not here and not missing:
        helps.append("take a window with less turbulence and a manoeuvre")
    if options:
        helps.append(f"{'or ' if helps else ''}{why}: {_again(log, config, options, dictionary)}")
    return Note.advice(f"for {', '.join(left)} faults: {', '.join(helps)}") if helps else None


def _wider(log: FlightLog, config: Config) -> tuple[str, ...]:
    """Return the options of a longer window within the same flight, none where the log has no more of it."""
    from_s, to_s = log.ends(config.window.from_s, config.window.to_s)
    flown = [(low, high) for low, high in airborne_stretches(log) if low <= from_s and to_s <= high]
    if not flown:
        return ()
    low, high = max(flown[0][0], from_s - WIDER_S), min(flown[0][1], to_s + WIDER_S)
    is_longer = (high - low) - (to_s - from_s) >= WIDER_S
    return ("--from", instant(low), "--to", instant(high)) if is_longer else ()


def _again(log: FlightLog, config: Config, options: tuple[str, ...], dictionary: str | None) -> str:
    """Return the command line that asks anew with other options, these alone for a log that is no file.

    Its configuration, dictionary, outputs and window are those in use.
    """
    if not Path(log.path).is_file():
        return " ".join(options)
    words = ["bfi", "start-time" if dictionary is None else "identify", log.path]
    words += ["--config", config.path] if config.path else []
    words += ["-d", dictionary] if dictionary and (is_shipped(dictionary) or Path(dictionary).is_file()) else []
    if config.outputs != Config().outputs:
        words += [word for name in config.outputs for word in ("--output", name)]
    for option, at_s in (("--from", config.window.from_s), ("--to", config.window.to_s)):
        words += [] if at_s is None or option in options else [option, instant(at_s)]
    return shlex.join([*words, *options])
