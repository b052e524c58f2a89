"""The shapes that are scanned, as the low-pass and the decimation of the record leave them.

The low-pass smears the start of a fault over a few samples. A shape is therefore made at the log's own rate and passed
through the same filter: it starts a few conditioned samples before its onset, which may lie between two of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...config import StartTime
from ...decision import KINDS
from ...faults import Fault, unit_signal
from ...faults.shapes import ADDITIVE, SCANNED_AS, SHAPES, Shape, scanned_shape
from ...kernels import FloatArray
from ...kernels.low_pass import IDENTITY, Lowpass, Response, decimate, lost_samples, lowpass_taps
from ...kernels.onset import waveform as waveforms
from ...kernels.onset.waveform import Waveform
from ...quantities.text import instant

# A conditioned sample, and the phase of one of the log's own samples before it, see `waveform`.
SubsampleIndex = tuple[int, int]
Ranges = dict[tuple[Shape, int], tuple[float, float]]  # of onsets, s, by shape and output

# Time constants and durations to try, a factor of two apart: the response to one between two of them differs little
# from the nearer. One longer than a quarter of the window cannot be told from a drift.
CONSTANTS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
LARGEST_SHARE = 0.25  # of the window
# An oscillation of a stated frequency is sought this near to it: the search moves by less than a hundredth of it.
SAME_FREQUENCY = (0.98, 1.02)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Number and rate of the conditioned samples, and the low-pass and factor they were decimated with (1: neither).

    `response` is that of the recorder, at the log's own rate.
    """

    n_samples: int
    rate_hz: float
    factor: int
    lowpass: Lowpass
    response: Response = IDENTITY

    @property
    def lead(self) -> int:
        """Samples by which the filters show a fault before its onset."""
        half_width = self.lowpass.half_width if self.factor > 1 and self.lowpass.kind == "linear-phase" else 0
        return half_width + -(-self.response.before // self.factor)

    @property
    def native_hz(self) -> float:
        """Rate of the log."""
        return self.rate_hz * self.factor


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeHypothesis:
    """The hypothesis of a shape on one output.

    Attributes
    ----------
    output : its index.
    parameter : frequency, time constant or duration, in Hz or s; None where the shape has none, or the scan seeks it.
    file : that holds a sampled shape.
    phase_rad : phase of a sine at the sample `anchor`, or at the onset where there is no anchor.
    anchor : sample of the log's own rate, counted from the first conditioned sample.
    """

    shape: Shape
    output: int
    parameter: float | None = None
    file: str | None = None
    phase_rad: float = 0.0
    anchor: int | None = None

    @property
    def frequency_hz(self) -> float | None:
        """Of a sine."""
        return self.parameter if self.shape == "sine" else None

    def phase_at(self, sample: int, rate_hz: float) -> float:
        """Return the phase of a sine that starts at a sample of the log's own rate, radians in -pi..pi."""
        if self.anchor is None or self.parameter is None:
            return self.phase_rad
        phase = self.phase_rad + 2.0 * np.pi * self.parameter * (sample - self.anchor) / rate_hz
        return float(np.remainder(phase + np.pi, 2.0 * np.pi) - np.pi)


def shape_hypotheses(wanted: StartTime, n_outputs: int, duration_s: float) -> tuple[ShapeHypothesis, ...]:
    """Return every shape on every output; time constants and durations on a grid up to a quarter of the window."""
    return tuple(
        ShapeHypothesis(
            shape=shape, output=output, parameter=parameter, file=wanted.samples if shape == "samples" else None
        )
        for output in range(n_outputs)
        for shape in wanted.shapes
        for parameter in (constants_s(duration_s) if shape in SCANNED_AS else (None,))
    )


def constants_s(duration_s: float) -> tuple[float, ...]:
    """Return the time constants and durations to try in a window of some length."""
    return tuple(c for c in CONSTANTS_S if c <= LARGEST_SHARE * duration_s) or CONSTANTS_S[:1]


def lags_and_ramps(wanted: StartTime, n_outputs: int, duration_s: float) -> tuple[ShapeHypothesis, ...]:
    """Return what a step may be, too, where every kind is asked for without a dictionary, unless it ends."""
    asks_for_all = {SHAPES[shape].kind for shape in wanted.shapes} == set(KINDS) and "bias" in wanted.shapes
    beside = tuple(SCANNED_AS) if asks_for_all and not wanted.ends else ()
    return tuple(
        ShapeHypothesis(shape=shape, output=output, parameter=parameter)
        for output in range(n_outputs)
        for shape in beside
        if shape not in wanted.shapes
        for parameter in constants_s(duration_s)
    )


def kinds_of_entries(
    wanted: StartTime, entries: Sequence[Fault], outputs: Sequence[str], duration_s: float
) -> tuple[StartTime, tuple[ShapeHypothesis, ...], Ranges, dict[tuple[Shape, int], str]]:
    """Return what is asked for, the rivals, the onsets and the names of entries that state no onset and are scanned.

    Parameters
    ----------
    entries : on the axis of the log.
    outputs : of the analysis, which has the channels of the entries.
    """
    detected: list[Shape] = []
    rivals: list[ShapeHypothesis] = []
    ranges_s: Ranges = {}
    names: dict[tuple[Shape, int], str] = {}
    bands: list[tuple[float, float] | None] = []
    for entry in entries:
        shape = scanned_shape(entry.shape)
        if shape is None or entry.onset_range_s is None:
            continue
        key = (shape, outputs.index(entry.channel))
        first, last = ranges_s.get(key, entry.onset_range_s)
        ranges_s[key] = (min(first, entry.onset_range_s[0]), max(last, entry.onset_range_s[1]))
        names.setdefault(key, entry.called)
        detected.append(SCANNED_AS.get(shape, shape))
        stated = entry.parameter
        if shape == "sine":
            bands.append(None if stated is None else (SAME_FREQUENCY[0] * stated, SAME_FREQUENCY[1] * stated))
            bands[-1] = entry.parameter_range or bands[-1]
        elif shape in SCANNED_AS:
            low, high = entry.parameter_range or (0.0, np.inf)
            tried = (stated,) if stated else tuple(c for c in constants_s(duration_s) if low <= c <= high) or (low,)
            rivals += [ShapeHypothesis(shape=shape, output=key[1], parameter=parameter) for parameter in tried]
    known = [band for band in bands if band is not None]
    band_hz = (min(low for low, _ in known), max(high for _, high in known)) if known and None not in bands else None
    shapes = tuple(dict.fromkeys(detected))
    asked = {"shapes": shapes, "samples": None, "frequency_hz": band_hz, "ends": False}
    return wanted.model_copy(update=asked), tuple(rivals), ranges_s, names


# A shape is scanned, weighed against others and sized in one record.
@lru_cache(maxsize=64)
def waveform(form: ShapeHypothesis, sampling: Sampling, phase: int = 0) -> Waveform:
    """Return the shape of unit magnitude, conditioned; it starts `sampling.lead` samples before its onset.

    Parameters
    ----------
    form : a sine needs its frequency.
    sampling : of the record.
    phase : samples of the log's own rate from the conditioned sample to the onset, in -(factor - 1)..0.
    """
    n, factor, response = sampling.n_samples, sampling.factor, sampling.response
    if factor == 1 and response.changes_nothing:
        return _ideal(form, n, sampling.rate_hz)
    taps = lowpass_taps(factor, sampling.lowpass).size
    before = response.after + lost_samples(factor, sampling.lowpass)[0] + sampling.lead * factor + phase
    length = response.after + taps + (n - 1) * factor + response.before
    native = _ideal(form, length - before, sampling.native_hz)
    signals = np.zeros((length, 1 + len(native.tails)))
    signals[before:] = np.vstack([native.samples, native.tails]).T
    conditioned = decimate(response.filtered(signals), factor, sampling.lowpass).T
    weights = native.weights[:, ::factor][:, : n + 1]
    # The last few weights are repeated: no fault within the record needs them.
    weights = np.pad(weights, ((0, 0), (0, n + 1 - weights.shape[1])), mode="edge")
    return Waveform(
        samples=conditioned[0],
        unit=native.unit,
        tails=conditioned[1:],
        weights=weights,
        shortest=-(-native.shortest // factor),
    )


def subsample_index(sample: int, factor: int) -> SubsampleIndex:
    """Return the conditioned sample and the phase of a sample of the log's own rate, see `waveform`."""
    conditioned = -(-sample // factor)
    return conditioned, sample - conditioned * factor


def signal(
    form: ShapeHypothesis, sampling: Sampling, start: SubsampleIndex, end: SubsampleIndex | None = None
) -> FloatArray:
    """Return (n_samples,) what a fault of magnitude 1 adds to its output, conditioned.

    Parameters
    ----------
    start, end : conditioned sample, and phase as in `waveform`; without an end the fault lasts.
    """
    n, factor, response = sampling.n_samples, sampling.factor, sampling.response
    lost, after = lost_samples(factor, sampling.lowpass) if factor > 1 else (0, 0)
    before = response.after + lost
    native = np.zeros(before + (n - 1) * factor + 1 + after + response.before)
    first = before + start[0] * factor + start[1]
    last = len(native) if end is None else before + end[0] * factor + end[1]
    begun = replace(form, phase_rad=form.phase_at(first - before, sampling.native_hz), anchor=None)
    native[first:last] = _unit_signal(begun, len(native) - first, sampling.native_hz)[: last - first]
    return decimate(response.filtered(native), factor, sampling.lowpass)


def _unit_signal(form: ShapeHypothesis, n: int, rate_hz: float) -> FloatArray:
    """Return (n,) the shape of magnitude 1; a sine, of which hundreds are fitted, without the tails of its waveform."""
    if form.shape == "sine" and form.parameter is not None:
        return np.asarray(np.sin(2.0 * np.pi * form.parameter / rate_hz * np.arange(float(n)) + form.phase_rad))
    wave = _ideal(form, n, rate_hz)
    return wave.unit * wave.samples


def _ideal(form: ShapeHypothesis, n: int, rate_hz: float) -> Waveform:
    shape = SHAPES[form.shape]
    if not shape.is_scanned:
        raise ValueError(f"a {form.shape} is not scanned")
    if shape.parameter is not None and form.parameter is None:
        raise ValueError(f"a {form.shape} needs its parameter")
    if shape.waveform is None:
        return waveforms.sampled(_sampled(form, n, rate_hz))
    return shape.waveform(n, rate_hz, form.parameter or 0.0, form.phase_rad)


@lru_cache(maxsize=8)
def _sampled(form: ShapeHypothesis, n: int, rate_hz: float) -> FloatArray:
    return unit_signal(fault_of(form, ""), np.arange(n) / rate_hz, window_start_s=0.0)


def hypothesis_of(fault: Fault, outputs: Sequence[str]) -> ShapeHypothesis | None:
    """Return the hypothesis of a fault that begins with its phase 0; None where no scan of the outputs looks for it."""
    shape = scanned_shape(fault.shape) if fault.shape in ADDITIVE else None
    if shape is None or fault.channel not in outputs:
        return None
    return ShapeHypothesis(shape=shape, output=outputs.index(fault.channel), parameter=fault.parameter, file=fault.file)


def fault_of(
    form: ShapeHypothesis, channel: str, *, magnitude: float = 1.0, onset_s: float = 0.0, offset_s: float | None = None
) -> Fault:
    """Return the fault of a hypothesis."""
    key = SHAPES[form.shape].parameter
    named = {} if key is None else {key: form.parameter}
    return Fault(
        shape=form.shape,
        channel=channel,
        magnitude=magnitude,
        onset_s=onset_s,
        offset_s=offset_s,
        name=f"{form.shape}_{instant(onset_s)}",
        file=form.file,
        phase_rad=form.phase_rad if form.shape == "sine" else 0.0,
        **named,  # type: ignore[arg-type]
    )
