"""The record of a scan: a window of a log, conditioned and scaled as for an identification, and its likelihood."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...config import Config
from ...decision.calibration import CalibrationSettings
from ...dictionary import Dictionary
from ...errors import ConfigError, LogError
from ...faults import Fault, magnitude_unit
from ...faults.shapes import SCANNED_AS, Shape, sample_bytes
from ...flightlog import FlightLog
from ...kernels import FloatArray, IntArray
from ...kernels.covariance import FitRows, Layout, unfold
from ...kernels.onset.scan import ENDING, FLOOR, STARTING, Scan, default_onsets
from ...kernels.progress import Report, Step, silent
from ...kernels.variable_projection import Fit, fit_magnitudes, project_inputs
from ..preprocessing.window import PreparedWindow, prepare_window, regression_of, with_inputs_of
from .shapes import Ranges, Sampling, ShapeHypothesis, fault_of, kinds_of_entries, lags_and_ramps, shape_hypotheses

# Without --frequency an oscillation has at least three periods in the window, since two are the least that can be told
# from a drift, and at least five samples per period.
CYCLES = 3.0
FASTEST = 0.2  # of the rate
# Times are rounded to a nanosecond, so that 13.8 s is not shown as 13.799999999999999 s.
DECIMALS = 9
# Fall of the log-likelihood per row at which a fit ends: in a record of 1000 rows a tenth of a standard deviation, and
# far less after the step that brings it.
TOLERANCE = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanRecord:
    """The inputs and outputs that are scanned, scaled, and the hypotheses to test.

    Attributes
    ----------
    window : the filtered and decimated window of the log.
    layout : inputs, outputs and weights of the rows, without signals.
    unit : (n_outputs,), times which the scaled outputs are those in SI but for a constant.
    floor : smallest standard deviation of a prediction error, scaled; None for that of the kernel.
    forms : hypotheses to test; rivals : that compete with them for the name of what stands out.
    ranges_s : of what may be named, the onsets, without any everything at any onset; names : what results call it.
    band_hz : lowest and highest frequency of an oscillation.
    settings : of the scan, as a calibration table states them.
    scans : the factorisations made last, by outputs, order, faulty output and first row (`scan.scan_of`).
    """

    window: PreparedWindow
    layout: Layout
    unit: FloatArray
    floor: float | None
    sampling: Sampling
    forms: tuple[ShapeHypothesis, ...]
    rivals: tuple[ShapeHypothesis, ...]
    ranges_s: Ranges
    names: Mapping[tuple[Shape, int], str]
    band_hz: tuple[float, float]
    settings: CalibrationSettings
    scans: dict[Hashable, Scan] = field(init=False, repr=False, default_factory=dict)

    @property
    def orders(self) -> tuple[int, ...]:
        """Of the model, to choose from."""
        return self.settings.orders

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency of an oscillation, cycles per sample."""
        return self.band_hz[0] / self.sampling.rate_hz, self.band_hz[1] / self.sampling.rate_hz

    @property
    def u(self) -> FloatArray:
        """(n_samples, n_inputs) of unit spread."""
        return np.asarray(self.layout.u)

    @property
    def y(self) -> FloatArray:
        """(n_samples, n_outputs) of unit spread."""
        return np.asarray(self.layout.y)

    @property
    def time_s(self) -> FloatArray:
        """(n_samples,) of the samples analysed."""
        return self.window.signals.time_s

    def output(self, index: int) -> tuple[str, float, str]:
        """Return name of an output, what makes of its scaled values those in SI, and its unit."""
        name = self.settings.outputs[index]
        return name, float(self.unit[index]), self.window.log.channel(name).unit

    def magnitude(self, form: ShapeHypothesis) -> tuple[str, float, str]:
        """Return the channel of a hypothesis, what makes of its scaled magnitudes those in SI, and their unit."""
        channel, scale, unit = self.output(form.output)
        return channel, scale, magnitude_unit(fault_of(form, channel), unit)

    def onset_s(self, sample: int, phase: int = 0) -> float:
        """Return the time of a conditioned sample, or of one of the log's own samples before it."""
        after = (sample + phase / self.sampling.factor) / self.sampling.rate_hz
        return round(float(self.time_s[0]) + after, DECIMALS)

    def onsets_s(self, samples: IntArray) -> FloatArray:
        """Return the times of conditioned samples."""
        times_s = float(self.time_s[0]) + samples / self.sampling.rate_hz
        return np.array([round(time_s, DECIMALS) for time_s in times_s.tolist()])

    def native(self, time_s: float) -> int:
        """Return the sample of the log's own rate at a time, counted from the first conditioned one."""
        return round((time_s - float(self.time_s[0])) * self.sampling.native_hz)

    def may_be(self, shape: Shape, output: int) -> bool:
        """Say whether a fault of this shape on this output may be named."""
        return not self.ranges_s or (shape, output) in self.ranges_s

    def onsets_of(self, shape: Shape, output: int) -> tuple[float, float]:
        """Return the earliest and the latest onset, s, of faults of a shape, and of those that it is scanned for."""
        alike = [
            span
            for (other, channel), span in self.ranges_s.items()
            if channel == output and shape in (other, SCANNED_AS.get(other))
        ]
        return min((first for first, _ in alike), default=-np.inf), max((last for _, last in alike), default=np.inf)

    def admitted_onsets(self, scan: Scan, form: ShapeHypothesis) -> IntArray:
        """Return (n_onsets,) the onsets of a scan at which faults of a hypothesis may begin."""
        onsets, (first_s, last_s) = default_onsets(scan), self.onsets_of(form.shape, form.output)
        at_s = float(self.time_s[0]) + (onsets + self.sampling.lead) / self.sampling.rate_hz
        near_s = 0.5 / self.sampling.rate_hz
        return onsets[(at_s >= first_s - near_s) & (at_s <= last_s + near_s)]

    def without_fault(self, y: FloatArray, order: int) -> FitRows:
        """Return the fault-free model of scaled outputs y (n_samples, n_outputs), evaluated on its rows."""
        likelihood = self.likelihood(y, order)
        return unfold(likelihood.layout, likelihood.fault_free)

    def likelihood(self, y: FloatArray, order: int, step: Step | None = None) -> Likelihood:
        """Return the likelihood of scaled outputs y (n_samples, n_outputs) at an order of the model."""
        return Likelihood(record=self, layout=replace(self.layout, y=y, first=order), step=step)


@dataclass(frozen=True, kw_only=True, eq=False)
class Likelihood:
    """The likelihood of a record at one order of the model, maximised over the magnitudes of given signals.

    Attributes
    ----------
    layout : of the record with the outputs, the order its first row.
    step : called at every fit; it reports the progress of a search that makes many fits.
    """

    record: ScanRecord
    layout: Layout
    step: Step | None

    @property
    def n_rows(self) -> int:
        """Rows of the regression."""
        return len(self.layout.y) - self.layout.first

    @cached_property
    def fault_free(self) -> Fit:
        """The maximum without a fault."""
        return self.fit(np.zeros((*self.layout.y.shape, 0)))

    def statistic(self, fit: Fit) -> float:
        """Return 2 log of the likelihood ratio of a fit against no fault."""
        return self.n_rows * (self.fault_free.log_det - fit.log_det)

    def fit(self, theta: FloatArray, start: FloatArray | None = None) -> Fit:
        """Return the maximum over the magnitudes of signals theta (n_samples, n_outputs, n_signals)."""
        if self.step is not None:
            self.step()
        data = replace(self.layout, theta=theta).factor()
        floor = FLOOR if self.record.floor is None else self.record.floor
        problem = project_inputs(data, self.layout.first, floor=floor)
        return fit_magnitudes(problem, range(theta.shape[2]), start, tolerance=TOLERANCE)


def prepare_record(
    log: FlightLog, config: Config, report: Report = silent, *, entries: Sequence[Fault] = ()
) -> ScanRecord:
    """Return the window of a log made ready for the scan; `report` is called with the fraction that is done.

    Parameters
    ----------
    entries : of a dictionary, whose onsets are searched, on the axis of the log; without them every kind is.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    ConfigError : the frequencies asked for are too high for the rate asked for.
    """
    config = with_inputs_of(log, config)
    part = log.window(config.window.from_s, config.window.to_s)
    duration_s = part.n_samples / part.rate_hz
    wanted, ranges_s, names = config.start_time, Ranges(), dict[tuple[Shape, int], str]()
    if entries:
        wanted, rivals, ranges_s, names = kinds_of_entries(wanted, entries, config.outputs, duration_s)
        config = config.model_copy(update={"start_time": wanted})
    else:
        rivals = lags_and_ramps(wanted, len(config.outputs), duration_s)
    window = prepare_window(log, _probes(part, config), config, report, purpose="scan")
    regression = regression_of(window, config)
    layout = regression.layout
    n, rate_hz = len(window.signals.time_s), window.signals.rate_hz
    low, high = searched_band_hz(wanted.frequency_hz, rate_hz, n)
    if wanted.frequency_hz is not None and high > 0.5 * rate_hz:
        raise ConfigError(
            f"--frequency: {high:g} Hz is more than a rate of {rate_hz:g} Hz resolves; "
            f"give frequencies up to {0.5 * rate_hz:g} Hz, or a higher --rate"
        )
    orders = _with_room(regression.orders, n, 2.0 * rate_hz / high, window.log) if wanted.ends else regression.orders
    return ScanRecord(
        window=window,
        layout=replace(
            layout,
            u=np.asarray(layout.u),
            y=np.asarray(layout.y),
            theta=np.empty((*layout.y.shape, 0)),
            weights=None if wanted.ends else layout.weights,
            earlier=None,
        ),
        unit=regression.unit,
        floor=None if window.signals.factor == 1 else regression.floor,
        sampling=Sampling(
            n_samples=n,
            rate_hz=rate_hz,
            factor=window.signals.factor,
            lowpass=window.lowpass,
            response=window.response,
        ),
        forms=shape_hypotheses(wanted, len(config.outputs), n / rate_hz),
        rivals=rivals,
        ranges_s=ranges_s,
        names=names,
        band_hz=(min(low, high), high),
        settings=CalibrationSettings(
            rate_hz=rate_hz,
            duration_s=n / rate_hz,
            orders=orders,
            feedthrough=layout.feedthrough,
            inputs=config.inputs,
            outputs=config.outputs,
            shapes=wanted.shapes,
            ends=wanted.ends,
            frequency_hz=wanted.frequency_hz,
            native_rate_hz=window.native_rate_hz,
            recorder_hz=window.recorder_hz,
            variance=config.conditioning.variance,
            samples=None if wanted.samples is None else hashlib.sha256(sample_bytes(wanted.samples)).hexdigest(),
        ),
    )


def searched_band_hz(asked: tuple[float, float] | None, rate_hz: float, n_samples: int) -> tuple[float, float]:
    """Return the lowest and the highest frequency of oscillations that a scan looks for, as asked or by default."""
    return asked or (CYCLES * rate_hz / n_samples, FASTEST * rate_hz)


def _with_room(orders: Sequence[int], n: int, shortest: float, log: FlightLog) -> tuple[int, ...]:
    """Return the orders at which a fault with two ends fits between the first and the last onset of n samples.

    Parameters
    ----------
    shortest : samples that it must hold, two periods of the fastest oscillation.
    """
    fitting = tuple(s for s in orders if n - (STARTING + ENDING) * s > max(ENDING * s, shortest) + 1)
    if not fitting:
        raise LogError(
            f"{log.path}: {n} samples are too few to look for start and end at order {min(orders)}; "
            "give a longer window, a lower --order, or leave --ends out"
        )
    return fitting


def _probes(part: FlightLog, config: Config) -> Dictionary:
    """Return what the rate is chosen for: a step amid the window and the fastest oscillation asked for."""
    wanted, channel, onset_s = config.start_time, config.outputs[0], float(part.time_s[part.n_samples // 2])
    atoms = [Fault(shape="bias", channel=channel, onset_s=onset_s, name="a step")]
    if wanted.frequency_hz is not None and "sine" in wanted.shapes:
        fastest = Fault(shape="sine", channel=channel, onset_s=onset_s, frequency_hz=wanted.frequency_hz[1])
        atoms.append(replace(fastest, name="an oscillation"))
    return Dictionary(atoms=tuple(atoms), relative_to="log", sha256="", path="start-time")
