"""The record of a trial: flown or read once per worker, then faults and noise added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...aircraft import find_model, flight_of
from ...errors import ConfigError, LogError
from ...faults import Fault
from ...faults.filters import recorded_signal, response_of
from ...faults.shapes import LINE_SHAPES, SHAPES
from ...flightlog import FlightLog, read_log
from ...flightlog.injection import added_by
from ...flightlog.quality import recorder_filters
from ...kernels import FloatArray
from ...quantities.text import instant
from .definition import FlownModel, InjectedFault, RecordedLog
from .scenarios import Setting

# Records that a worker keeps: a sweep's trials go through its records in turn.
KEPT_RECORDS = 32
# Parts of the window between which a fault begins that may begin at any time: nearer to its ends none can be told.
ANY_TIME = (0.1, 0.9)


def is_shared(setting: Setting) -> bool:
    """Say whether all trials begin with the same record: neither gusts nor a window are drawn."""
    if isinstance(setting.record, RecordedLog):
        return setting.record.length_s is None
    return setting.record.turbulence_m_s == 0.0


def record_of(setting: Setting, rng: np.random.Generator) -> FlightLog:
    """Return the fault-free record of a trial.

    Parameters
    ----------
    rng : of the gusts, or of the window.

    Raises
    ------
    LogError, ConfigError : it cannot be read or simulated, or is shorter than the window that is drawn from it.
    """
    if isinstance(setting.record, FlownModel) and not is_shared(setting):
        return _flown(setting.record, rng)
    names = (tuple(setting.config.channels.items()), tuple(setting.config.units.items()))
    log = _shared(setting.record, names)
    length_s = setting.record.length_s if isinstance(setting.record, RecordedLog) else None
    if length_s is None:
        return log
    first_s, last_s = float(log.time_s[0]), float(log.time_s[-1]) - length_s
    if last_s < first_s:
        there_s = float(log.time_s[-1]) - first_s
        raise LogError(f"{log.path}: length_s: longer than the {there_s:g} s there are, got {length_s:g}; lower it")
    start_s = float(rng.uniform(first_s, last_s))
    return log.window(start_s, start_s + length_s)


def faulty(log: FlightLog, setting: Setting, faults: Sequence[Fault], rng: np.random.Generator) -> FlightLog:
    """Return the record with faults and noise added, each fault to all channels that it changes, as `bfi inject` does.

    Parameters
    ----------
    faults : with their magnitudes, times on the log's axis.
    rng : of the noise; each channel has a stream of its own.

    Raises
    ------
    LogError, DictionaryError : the log has no such channel, or does not tell what a fault changes.
    """
    # A frozen sensor holds a reading, noise and all.
    held = [fault for fault in faults if SHAPES[fault.shape].acts_on == "held"]
    log = _with_faults(log, setting, [fault for fault in faults if fault not in held])
    noisy: dict[str, FloatArray] = {}
    for (name, sd), stream in zip(setting.noise, rng.spawn(len(setting.noise)), strict=True):
        channel = log.channel(name)
        noisy[channel.name] = noisy.get(channel.name, channel.values) + sd * stream.standard_normal(log.n_samples)
    return _with_faults(log.with_values(noisy), setting, held)


def _with_faults(log: FlightLog, setting: Setting, faults: Sequence[Fault]) -> FlightLog:
    for fault in faults:
        log = log.plus(_changes(log, setting, fault))
    return log


def largest_errors(log: FlightLog, setting: Setting, fault: Fault) -> dict[str, float]:
    """Return by channel the largest error that a fault of its magnitude makes within the window.

    Parameters
    ----------
    log : the record without it; fault : times on its axis.
    """
    window = setting.config.window
    inside = np.isin(log.time_s, log.window(window.from_s, window.to_s).time_s)
    return {name: float(np.abs(change[inside]).max()) for name, change in _changes(log, setting, fault).items()}


def faults_of(
    log: FlightLog, setting: Setting, truth: Mapping[str, float], rng: np.random.Generator
) -> dict[str, Fault]:
    """Return the drawn faults with their magnitudes, then the injected ones, by name, times on the log's axis.

    Parameters
    ----------
    truth : magnitude by name of the entries drawn.
    rng : of the onsets that are not stated; those of injected faults come first.
    """
    span_s = _window_s(log, setting)
    injected = {}
    for name, fault in zip(setting.right, setting.injected, strict=True):
        later = fault.onset_spread_s * float(rng.uniform(-1.0, 1.0)) if fault.fault().onset_range_s is None else 0.0
        injected[name] = _begun(_on_axis(fault, setting, span_s[0], later), span_s, rng)
    drawn = {
        name: replace(_begun(atom, span_s, rng), magnitude=truth[name])
        for atom in setting.dictionary.resolved(span_s[0])
        if (name := atom.called) in truth
    }
    return drawn | injected


def _on_axis(injected: InjectedFault, setting: Setting, start_s: float, later_s: float = 0.0) -> Fault:
    """Return an injected fault, times on the log's axis, so much later than stated."""
    return injected.fault().later(later_s + (start_s if setting.dictionary.relative_to == "window" else 0.0))


def _begun(fault: Fault, span_s: tuple[float, float], rng: np.random.Generator) -> Fault:
    """Return a fault with an onset, drawn where it states none."""
    if fault.onset_range_s is None:
        return fault
    onset_s = rng.uniform(*onsets_within(fault.onset_range_s, *span_s))
    return replace(fault, onset_s=float(onset_s), onset_range_s=None, parameter_range=None)


def onsets_within(onsets_s: tuple[float, float], start_s: float, stop_s: float) -> tuple[float, float]:
    """Return the times between which a fault begins; an infinite one is at 10 %, or 90 %, of the window."""
    ends = [start_s + part * (stop_s - start_s) for part in ANY_TIME]
    first, last = (at_s if np.isfinite(at_s) else end for at_s, end in zip(onsets_s, ends, strict=True))
    return first, last


def check_onsets(log: FlightLog, setting: Setting, *, drawing: bool, where: str) -> None:
    """Refuse a fault whose onset is drawn where the record has no time for it.

    Parameters
    ----------
    drawing : whether faults of the dictionary are added too.

    Raises
    ------
    ConfigError : it could begin outside the window.
    """
    start_s, stop_s = _window_s(log, setting)
    injected = [_on_axis(fault, setting, start_s) for fault in setting.injected]
    entries = setting.dictionary.resolved(start_s) if drawing else ()
    for key, fault in (*(("inject", fault) for fault in injected), *(("dictionary", atom) for atom in entries)):
        if fault.onset_range_s is None:
            continue
        first, last = onsets_within(fault.onset_range_s, start_s, stop_s)
        if not start_s <= first < last <= stop_s:
            raise ConfigError(
                f"{where}: {key}: onset_s: '{fault.called}' would begin at {instant(first)} to {instant(last)} s, "
                f"and the window of {log.path} is {instant(start_s)} to {instant(stop_s)} s; move from or to"
            )


def _window_s(log: FlightLog, setting: Setting) -> tuple[float, float]:
    window = setting.config.window
    time_s = log.window(window.from_s, window.to_s).time_s
    return float(time_s[0]), float(time_s[-1])


def _changes(log: FlightLog, setting: Setting, fault: Fault) -> dict[str, FloatArray]:
    """Return by channel, (n_samples,), what the log shows of a fault."""
    recorder = setting.config.recorder
    response = response_of(recorder_filters(log, recorder.edge_hz, recorder.kind)[0], log.rate_hz)
    if fault.shape in LINE_SHAPES:
        return dict(added_by(log, replace(fault, channel=""), response))
    channel = log.channel(fault.channel).name
    if SHAPES[fault.shape].acts_on in ("reading", "held"):
        return dict(added_by(log, replace(fault, channel=channel), response))
    signal = recorded_signal(fault, log.time_s, response, window_start_s=_window_s(log, setting)[0])
    return {channel: fault.magnitude * signal}


@lru_cache(maxsize=KEPT_RECORDS)
def _shared(source: FlownModel | RecordedLog, names: tuple[tuple[tuple[str, str], ...], ...]) -> FlightLog:
    if isinstance(source, FlownModel):
        return _flown(source, np.random.default_rng(0))
    channels, units = map(dict, names)
    from_s, to_s = source.from_s, source.to_s
    log = read_log(source.log, group=source.group, channel_map=channels, unit_map=units, from_s=from_s, to_s=to_s)
    return log.window(from_s, to_s)


def _flown(source: FlownModel, rng: np.random.Generator) -> FlightLog:
    given = source.model_dump(exclude={"model", "manoeuvre"})
    return flight_of(find_model(source.model), source.manoeuvre, rng=rng, **given)
