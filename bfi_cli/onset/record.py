"""The record a scan works on: a window of a log, conditioned and scaled as for an identification."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..calibration import CalibrationSettings as Settings
from ..config import Config
from ..dictionary import Dictionary
from ..errors import ConfigError, LogError
from ..faults import Fault
from ..flightlog import FlightLog
from ..kernels.onset.scan import ENDING, STARTING
from ..kernels.progress import Report, silent
from ..preprocessing.window import PreparedWindow, prepare_window, regression_of
from ..sample_file import sample_bytes
from .shapes import Form, Sampling, forms_of

__all__ = ["DECIMALS", "ScanRecord", "prepare_record"]

FloatArray = NDArray[np.float64]

CYCLES = 3.0
FASTEST = 0.2
DECIMALS = 9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanRecord:
    """What is scanned, in scaled units.

    Attributes
    ----------
    window : as it was filtered and decimated.
    u : (n_samples, n_inputs), y : (n_samples, n_outputs), of unit spread; y in SI is scaled y times `unit`, and a
        constant more.
    orders : to choose from.
    floor : smallest standard deviation of a prediction error, scaled; None for that of the kernel.
    forms : shapes to look for.
    band_hz : of the oscillations.
    settings : of the scan, as a calibration names them.
    """

    window: PreparedWindow
    u: FloatArray
    y: FloatArray
    unit: FloatArray
    orders: tuple[int, ...]
    feedthrough: bool
    floor: float | None
    sampling: Sampling
    forms: tuple[Form, ...]
    band_hz: tuple[float, float]
    settings: Settings

    @property
    def time_s(self) -> FloatArray:
        """(n_samples,) of the samples analysed."""
        return self.window.signals.time_s

    def onset_s(self, sample: int, phase: int = 0) -> float:
        """Return the time of a conditioned sample, or of one of the log's own samples before it."""
        after = (sample + phase / self.sampling.factor) / self.sampling.rate_hz
        return round(float(self.time_s[0]) + after, DECIMALS)

    def native(self, time_s: float) -> int:
        """Return the sample of the log's own rate at a time, counted from the first conditioned one."""
        return round((time_s - float(self.time_s[0])) * self.sampling.rate_hz * self.sampling.factor)


def prepare_record(log: FlightLog, config: Config, report: Report = silent) -> ScanRecord:
    """Return the window of a log made ready for the scan; `report` is told how far it is.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    ConfigError : the frequencies asked for are too high for the rate asked for.
    """
    window = prepare_window(log, _probes(log, config), config, report)
    regression = regression_of(window, config)
    layout, orders = regression.layout, regression.orders
    n, rate_hz = len(window.signals.time_s), window.signals.rate_hz
    asked = config.start_time
    band_hz = _band(asked.frequency_hz, n, rate_hz)
    if asked.ends:
        orders = _long_enough(window.log.path, orders, n, 2.0 * rate_hz / band_hz[1])
    sampling = Sampling(n_samples=n, rate_hz=rate_hz, factor=window.rate.factor, lowpass=window.lowpass)
    return ScanRecord(
        window=window,
        u=layout.u,
        y=layout.y,
        unit=regression.unit,
        orders=orders,
        feedthrough=layout.feedthrough,
        floor=None if window.rate.factor == 1 else regression.floor,
        sampling=sampling,
        forms=forms_of(asked, len(config.outputs), n / rate_hz),
        band_hz=band_hz,
        settings=Settings(
            rate_hz=rate_hz,
            duration_s=n / rate_hz,
            orders=orders,
            feedthrough=layout.feedthrough,
            inputs=config.inputs,
            outputs=config.outputs,
            shapes=asked.shapes,
            ends=asked.ends,
            frequency_hz=asked.frequency_hz,
            samples=None if asked.samples is None else hashlib.sha256(sample_bytes(asked.samples)).hexdigest(),
        ),
    )


def _probes(log: FlightLog, config: Config) -> Dictionary:
    """Return what the rate is chosen for: a step amid the window and the fastest oscillation asked for."""
    part = log.window(config.window.from_s, config.window.to_s)
    middle = float(part.time_s[part.n_samples // 2])
    atoms = [Fault(shape="bias", channel=config.outputs[0], onset_s=middle, name="a step")]
    if config.start_time.frequency_hz is not None and "sine" in config.start_time.shapes:
        high = config.start_time.frequency_hz[1]
        atoms.append(
            Fault(shape="sine", channel=config.outputs[0], onset_s=middle, frequency_hz=high, name="an oscillation")
        )
    return Dictionary(atoms=tuple(atoms), relative_to="log", sha256="", path="start-time")


def _band(asked: tuple[float, float] | None, n_samples: int, rate_hz: float) -> tuple[float, float]:
    """Return the frequencies to look for, within what the record resolves."""
    low, high = asked or (CYCLES * rate_hz / n_samples, FASTEST * rate_hz)
    if asked is not None and high > 0.5 * rate_hz:
        raise ConfigError(
            f"--frequency: {high:g} Hz is more than a rate of {rate_hz:g} Hz resolves; "
            f"give frequencies up to {0.5 * rate_hz:g} Hz, or a higher --rate"
        )
    return min(low, high), high


def _long_enough(path: str, orders: tuple[int, ...], n_samples: int, shortest: float) -> tuple[int, ...]:
    """Return the orders at which a fault with two ends fits between the first and the last onset."""
    kept = tuple(s for s in orders if n_samples - (STARTING + ENDING) * s > max(ENDING * s, shortest) + 1)
    if not kept:
        raise LogError(
            f"{path}: {n_samples} samples are too few to look for start and end at order {min(orders)}; "
            "give a longer window, a lower --order, or leave --ends out"
        )
    return kept
