"""The record of a trial: flown or read once per worker, then faults and noise added."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..aircraft import Dryden, find_model, manoeuvre, simulate, time_axis
from ..faults import Fault
from ..filters import recorded_signal, response_of
from ..flightlog import FlightLog, read_log
from ..flightlog.injection import added_by
from ..flightlog.record import frozen_array
from ..flightlog.recorder import recorder_filters
from ..shapes import SHAPES
from .definition import FlownModel, RecordedLog
from .scenarios import Setting

__all__ = ["faulty", "is_shared", "largest_errors", "record_of"]

FloatArray = NDArray[np.float64]

# Records that a worker keeps: a sweep's trials go through its records in turn.
KEPT_RECORDS = 32


def is_shared(setting: Setting) -> bool:
    """Say whether all trials begin with the same record: no gusts are drawn."""
    return isinstance(setting.record, RecordedLog) or setting.record.turbulence_m_s == 0.0


def record_of(setting: Setting, rng: np.random.Generator) -> FlightLog:
    """Return the fault-free record of a trial.

    Parameters
    ----------
    rng : of the gusts.

    Raises
    ------
    LogError, ConfigError : it cannot be read or simulated.
    """
    if is_shared(setting):
        names = (tuple(setting.config.channels.items()), tuple(setting.config.units.items()))
        return _shared(setting.record, names)
    assert isinstance(setting.record, FlownModel)
    return _flown(setting.record, rng)


def faulty(log: FlightLog, setting: Setting, truth: Mapping[str, float], rng: np.random.Generator) -> FlightLog:
    """Return the record with faults and noise added; times of a dictionary relative to the window count from its start.

    Parameters
    ----------
    truth : magnitude by name of the atom.
    rng : of the noise; each channel has a stream of its own.

    Raises
    ------
    LogError : the log has no such channel.
    """
    added: dict[str, FloatArray] = {}
    for atom, signal in _recorded(log, setting, truth):
        channel = log.channel(atom.channel)
        added[channel.name] = added.get(channel.name, channel.values) + signal
    for (name, sd), stream in zip(setting.noise, rng.spawn(len(setting.noise)), strict=True):
        channel = log.channel(name)
        added[channel.name] = added.get(channel.name, channel.values) + sd * stream.standard_normal(log.n_samples)
    channels = {name: replace(log.channels[name], values=frozen_array(values)) for name, values in added.items()}
    return replace(log, channels={**log.channels, **channels})


def largest_errors(log: FlightLog, setting: Setting, truth: Mapping[str, float]) -> list[tuple[Fault, float]]:
    """Return every fault of a truth with the largest error that it makes on its channel within the window.

    Parameters
    ----------
    truth : magnitude by name of the atom.
    """
    window = setting.config.window
    inside = np.isin(log.time_s, log.window(window.from_s, window.to_s).time_s)
    return [(atom, float(np.abs(signal[inside]).max())) for atom, signal in _recorded(log, setting, truth)]


def _recorded(log: FlightLog, setting: Setting, truth: Mapping[str, float]) -> Iterator[tuple[Fault, FloatArray]]:
    """Yield every fault of a truth, times on the log's axis, and its signal as the log shows it."""
    window, recorder = setting.config.window, setting.config.recorder
    start_s = float(log.window(window.from_s, window.to_s).time_s[0])
    response = response_of(recorder_filters(log, recorder.edge_hz, recorder.kind)[0], log.rate_hz)
    for atom in setting.dictionary.resolved(start_s):
        name = atom.name or atom.shape
        if name in truth:
            if SHAPES[atom.shape].acts_on == "reading":
                scaled = replace(atom, magnitude=truth[name], channel=log.channel(atom.channel).name)
                yield atom, added_by(log, scaled, response).get(scaled.channel, np.zeros(log.n_samples))
                continue
            yield atom, truth[name] * recorded_signal(atom, log.time_s, response, window_start_s=start_s)


@lru_cache(maxsize=KEPT_RECORDS)
def _shared(source: FlownModel | RecordedLog, names: tuple[tuple[tuple[str, str], ...], ...]) -> FlightLog:
    if isinstance(source, FlownModel):
        return _flown(source, np.random.default_rng(0))
    channels, units = map(dict, names)
    span = {"from_s": source.from_s, "to_s": source.to_s}
    log = read_log(source.log, group=source.group, channel_map=channels, unit_map=units, **span)
    return log.window(source.from_s, source.to_s)


def _flown(source: FlownModel, rng: np.random.Generator) -> FlightLog:
    time_s = time_axis(duration_s=source.duration_s, rate_hz=source.rate_hz)
    deflection = manoeuvre(
        source.manoeuvre, time_s, amplitude_rad=source.amplitude_rad, start_s=source.start_s, step_s=source.step_s
    )
    return simulate(
        find_model(source.model),
        deflection,
        rng=rng,
        rate_hz=source.rate_hz,
        discretisation=source.discretisation,
        turbulence=Dryden(sigma_m_s=source.turbulence_m_s) if source.turbulence_m_s else None,
    )
