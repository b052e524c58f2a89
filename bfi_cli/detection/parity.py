"""Detection by parity residuals: predict the watched channels, declare the one that fails, monitor the others.

The residuals are those of a regression on the past. The channel is declared whose failure explains most of them. The
rule that decides is turned into the step that a channel would have needed: a deviate above its level for as many rows
as it has to last. The worst onset counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..flightlog.record import frozen_array
from ..kernels import ONE_SIDED_90, ONE_SIDED_99, FloatArray
from ..kernels.parity import Drops, StepHeight, drop_at, largest_drops, step_height
from ..kernels.progress import Report, silent
from ..kernels.runs import running_weights
from ..kernels.whiteness import block_maxima, fit_tail, white_level
from ..model.preprocessing.signals import SAMPLES_PER_EDGE
from ..notes import Note
from .predictor import Predictor, fit_predictor
from .preparation import UNSTATED_HZ, DecimatedRecord, PreparedRecord, decimate_record
from .result import Alarm, Calibration, Detection, StepLimits

# A step is sought among the onsets of the last rows, or of the last second if that is more: a failure that shows later
# is detected as a step with a later onset.
SHORTEST_WINDOW, WINDOW_S = 10, 1.0
# Rows a deviate has to last: a gust is over in one, a failure is not (docs/theory.md, 11.2).
LASTING = 2
# Errors whose running size, over PATCH_S to each side, spreads by more are no white noise of one size: gusts came and
# went. It spreads by 1.15 at most in 150 flights of the simulated Boeing 747 with white noise, by 1.41 at least in 188
# runs on two recorded flights.
UNEQUAL = 1.3
# In gusts: seconds whose typical error enlarges the variance, and rows a deviate has to last. Chosen together on two
# recorded flights, with four choices of channels (docs/theory.md, 11.3). All excesses within such a time belong to one
# patch of gusts, and say as much about gusts that the healthy time did not have as a single excess.
PATCH_S, LASTING_IN_GUSTS = 10.0, 3
# Stretches of healthy time with which the rate of false alarms can be relied on: with fewer the tail is mostly that of
# white noise, known from five excesses.
FEWEST_BLOCKS = 10
# Quantile of the held-back deviates by which a channel is scaled (docs/theory.md, 11.3).
HIGH = 0.95
# Independent onsets in the window of a row, of which the largest deviate of white noise is the maximum.
WHITE_ONSETS = 3.0
# Factors on the magnitudes that parity residuals tell, for a log without a recorder's low-pass and for one that has or
# may have one. The closed form leaves out that the predictor learns from the rows of the step, that its regressors move
# with it, and that a recorder smears it. Counted at random onsets: of steps of 1.25, 1.5 and 1.75 times the closed form
# 50, 79 and 94 % of 48 are declared in four simulated flights of the Boeing 747. In six windows of 300 s of recorded
# flights all of 30 sharp steps of 1.5 times it raise an alarm; through the recorder 50, 70, 97 and 100 % of 30 of 1.5,
# 2, 2.5 and 3 times. It holds up to the rate `RATE_PER_EDGE`.
ABSORBED, SMEARED = 1.7, 2.5
# Samples per second and Hz of a recorder's edge above which its low-pass spreads a step over so many of them that no
# count bounds what passes unseen. Of steps through the recorder of two flights (edge 0.75 Hz), 2 % above what is
# excluded, 95 of 96 raise an alarm at 2 Hz, 94 of 95 at 2.5 Hz, 111 of 127 at 3.3 Hz, and at 10 Hz steps of 80 times it
# raise none (tests/measurements/test_detect_recorded).
RATE_PER_EDGE = SAMPLES_PER_EDGE["detect"]
UNSTATED = "it is unknown whether the recorder low-passed the log"
SLOW = "slow failures are not detected, since the model adapts to them; bfi start-time looks for drifts"


def detect_by_parity(prepared: PreparedRecord, config: Config, report: Report) -> Detection:
    """Return what the parity residuals say at the rate of the analysis, and its limits, None where it has none.

    The calibration is that of the first pass.
    """
    samples, outputs = decimate_record(prepared, prepared.factor), prepared.record.outputs
    alarms, passes = monitor_sequentially(samples, false_alarm=config.detect.false_alarm, report=report)
    statistic, level = np.full(samples.y.shape, np.nan), np.zeros(len(outputs))
    for monitored in passes:  # the last pass of a channel counts
        channels = list(monitored.channels)
        statistic[:, channels], level[channels] = np.nan, monitored.threshold.level
        statistic[monitored.model.predicted[:, None], channels] = monitored.drops.deviate
    model, threshold = passes[0].model, passes[0].threshold
    first_held, last_held = (float(samples.time_s[model.samples[k]]) for k in (model.errors.start, model.n_healthy - 1))
    notes = [
        *prepared.notes,
        Note.method(f"rate: {prepared.rate_reason}"),
        Note.limit(SLOW),
        *_threshold_notes(prepared, threshold),
    ]
    limits, edge_hz = None, prepared.recorder.edge_hz
    if edge_hz is not None and samples.rate_hz > RATE_PER_EDGE * edge_hz:
        edge = f"(gain one half at {edge_hz:.3g} Hz)"
        which = f"the recorder's low-pass {edge}" if prepared.recorder.stated else f"{UNSTATED}; a low-pass {edge}"
        notes.append(
            Note.limit(
                f"{which} spreads a step over several samples at {samples.rate_hz:.3g} Hz, so that no step is "
                f"excluded; what gives limits: {'; '.join(slower(prepared, config))}"
            )
        )
    else:
        limits = parity_limits(samples, passes, factor=SMEARED if prepared.recorder.filters else ABSORBED)
        if not prepared.recorder.stated:
            notes.append(
                Note.limit(
                    f"{UNSTATED}: limits are of steps through any low-pass that keeps half of {UNSTATED_HZ:g} Hz; "
                    "--recorder HZ states a slower one"
                )
            )
    return Detection(
        method="parity",
        rate_hz=samples.rate_hz,
        time_s=samples.time_s,
        y=samples.y,
        statistic=statistic,
        threshold=level,
        reach_s=samples.reach_s,
        alarms=tuple(alarms),
        limits=limits,
        is_calibrated=len(threshold.maxima) >= FEWEST_BLOCKS,
        ready_s=prepared.watched[0][0],
        calibration=Calibration(
            held_back_s=(first_held, last_held),
            n_blocks=len(threshold.maxima),
            white_level=threshold.white,
            level=threshold.common,
            heavy=threshold.is_heavy,
            scale=dict(zip(outputs, threshold.scale.tolist(), strict=True)),
            block_maxima=frozen_array(threshold.maxima),
        ),
        model=model.summary,
        notes=tuple(notes),
    )


def slower(prepared: PreparedRecord, config: Config) -> list[str]:
    """Return what gives limits where the rate is too high for the recorder."""
    if prepared.recorder.stated and config.conditioning.rate_hz == "auto":
        # The healthy time has too few samples at a lower rate.
        return ["a longer healthy time (--train A:B)"]
    assert prepared.recorder.edge_hz is not None
    lower = f"--rate {SAMPLES_PER_EDGE['scan'] * prepared.recorder.edge_hz:.2g}"
    return [lower] if prepared.recorder.stated else [lower, "--recorder HZ, or none where there is none"]


def _threshold_notes(prepared: PreparedRecord, threshold: DetectionThreshold) -> list[Note]:
    """Return what gusts and the held-back healthy time mean for the threshold."""
    notes = []
    if threshold.gusty:
        notes.append(
            Note.method(
                f"in gusts, prediction errors are scaled by their size in the last {PATCH_S:g} s and an alarm needs "
                f"{LASTING_IN_GUSTS} samples; a failure that shows in calm air only may be missed"
            )
        )
    if len(threshold.maxima) < FEWEST_BLOCKS:
        notes.append(
            Note.advice(
                f"the healthy time has only {len(threshold.maxima)} independent stretches, too few to show rare gusts, "
                "so that the threshold is higher; give a longer --train"
            )
        )
    elif threshold.is_heavy:
        notes.append(
            Note.method(
                f"healthy data have a heavier tail than white noise: the threshold is {threshold.tail:.3g} instead of "
                f"{threshold.white:.3g} standard deviations"
            )
        )
    higher = [
        name for name, most in zip(prepared.record.outputs, threshold.largest, strict=True) if most > threshold.white
    ]
    if higher:
        notes.append(
            Note.method(
                f"{', '.join(higher)}: the threshold is raised, because the model predicts the healthy time badly"
            )
        )
    return notes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionThreshold:
    """The deviate above which a channel is declared, and where it comes from.

    Attributes
    ----------
    level : (n_outputs,).
    white : the level of white noise; tail : that of the held-back deviates.
    gusty : whether the errors change in size.
    scale : (n_outputs,) factors on the larger of both.
    maxima : (n_blocks,) largest scaled deviates of blocks of the held-back rows.
    largest : (n_outputs,) of the held-back deviates.
    """

    level: FloatArray
    white: float
    tail: float
    gusty: bool
    scale: FloatArray
    maxima: FloatArray
    largest: FloatArray

    @property
    def common(self) -> float:
        """The level before it is scaled for a channel."""
        return max(self.white, self.tail)

    @property
    def is_heavy(self) -> bool:
        """Whether the tail of the held-back deviates sets the level."""
        return self.tail > self.white


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MonitoringPass:
    """One pass over the record with some of the channels.

    Attributes
    ----------
    channels : indices of the outputs watched.
    drops : their deviate is the least over the last rows, as many as an alarm has to last; `old_size` and `old_sd` are
        of the onsets about to leave the window in these rows.
    window : rows in which a step is sought.
    decided : (n,) the rows of the drops on which this pass decided, up to the one of its failure.
    """

    channels: tuple[int, ...]
    model: Predictor
    drops: Drops
    threshold: DetectionThreshold
    window: int
    decided: NDArray[np.intp]


def monitor_sequentially(
    samples: DecimatedRecord, *, false_alarm: float, report: Report = silent
) -> tuple[list[Alarm], list[MonitoringPass]]:
    """Monitor all channels until one fails, then the rest from that failure on, until none fails any more.

    Raises
    ------
    LogError : the healthy time is too short for any model.
    """
    channels = list(range(samples.y.shape[1]))
    window = max(SHORTEST_WINDOW, round(WINDOW_S * samples.rate_hz))
    alarms: list[Alarm] = []
    begin = 0
    passes: list[MonitoringPass] = []
    while channels:
        report(len(passes) / samples.y.shape[1])
        model = fit_predictor(samples, channels)
        patch = round(PATCH_S * samples.rate_hz)
        weights = running_weights(model.errors.residual, patch)
        gusty = bool(weights.max() > UNEQUAL * weights.min())
        lasting = LASTING_IN_GUSTS if gusty else LASTING
        patch = patch if gusty else 0
        drops = largest_drops(model.errors, model.basis, window=window, patch=patch, n_old=lasting)
        # The deviate that counts is the least over the last rows.
        padded = np.vstack([np.zeros((lasting - 1, len(channels))), drops.deviate])
        drops = replace(drops, deviate=np.lib.stride_tricks.sliding_window_view(padded, lasting, axis=0).min(axis=2))
        threshold = _threshold(model, drops, window, false_alarm, patch=patch)
        # The first row, after the onset of the failure before, whose deviate is above its level.
        at = model.predicted
        decided = np.flatnonzero((np.arange(len(at)) >= model.n_held_back) & (at >= begin))
        above = decided[(drops.deviate[decided] > threshold.level).any(axis=1)]
        passes.append(
            MonitoringPass(
                channels=tuple(channels),
                model=model,
                drops=drops,
                threshold=threshold,
                window=window,
                decided=decided[decided <= above[0]] if above.size else decided,
            )
        )
        if not above.size:
            break
        row = int(above[0])
        k = int(drops.deviate[row].argmax())
        onset, unit = row - int(drops.age[row, k]), float(model.unit[k])
        begin = int(at[row] - drops.age[row, k])
        height, output = _height(samples, model, onset, k), channels.pop(k)
        alarms.append(
            Alarm(
                channel=samples.outputs[output],
                time_s=float(samples.time_s[at[row]] + samples.reach_s),
                onset_s=float(samples.time_s[begin]),
                statistic=float(drops.deviate[row, k]),
                threshold=float(threshold.level[k]),
                size=None if height is None else height.height * unit,
                ci95=None if height is None else (height.low * unit, height.high * unit),
                unit=samples.units[output],
            )
        )
    return alarms, passes


def _height(samples: DecimatedRecord, model: Predictor, onset: int, output: int) -> StepHeight | None:
    """Return the height of a step in one of the watched outputs; None where the record does not determine it.

    An error that goes on growing is no step and has no height: the height over a stretch after the onset must be that
    over the next stretch, where the record has it.

    Parameters
    ----------
    onset : row of the errors at which it begins to show; the filters smear it over `smear_s` to each side.
    """
    start, smear = model.errors.start, int(np.ceil(samples.smear_s * samples.rate_hz)) + 1
    begin, n_shared = start + onset - smear, max(SHORTEST_WINDOW, round(WINDOW_S * samples.rate_hz))

    def height_after(n_free: int) -> StepHeight | None:
        rows = model.samples[max(begin, 0) : begin + n_free + n_shared]
        if begin <= start or len(rows) < n_free + n_shared or rows[-1] - rows[0] >= len(rows):
            return None
        return step_height(
            model.X,
            model.Y,
            model.errors.coefficients,
            model.basis,
            begin=begin,
            n_free=n_free,
            n_shared=n_shared,
            output=output,
        )

    first, then = height_after(2 * smear), height_after(2 * smear + n_shared)
    if first is None or then is None:
        return first
    apart = np.hypot(first.high - first.height, then.high - then.height)
    return first if abs(first.height - then.height) <= apart else None


def _threshold(model: Predictor, drops: Drops, window: int, false_alarm: float, *, patch: int) -> DetectionThreshold:
    """Return the level of white noise, or that of the tail of held-back deviates where that is heavier.

    Parameters
    ----------
    patch : rows to each side over which gusts are of one size, 0 where there are none.
    """
    n_held = model.n_held_back
    n_watched, q = len(drops.deviate) - n_held, drops.deviate.shape[1]
    white = white_level(max(n_watched, 1) * q * window, false_alarm)
    held = drops.deviate[min(window, n_held) : n_held]
    usual = white_level(WHITE_ONSETS, 1.0 - HIGH)
    scale = np.maximum(np.quantile(held, HIGH, axis=0) / usual, 1.0) if len(held) else np.ones(q)
    maxima = block_maxima(held / scale, window)
    tail = fit_tail(maxima, WHITE_ONSETS * q * window, alike=2.0 * patch / window)
    level = tail.level(false_alarm / max(n_watched / window, 1.0))
    return DetectionThreshold(
        level=scale * max(white, level),
        white=white,
        tail=level,
        gusty=patch > 0,
        scale=scale,
        maxima=maxima,
        largest=held.max(axis=0, initial=0.0),
    )


def parity_limits(samples: DecimatedRecord, passes: Sequence[MonitoringPass], *, factor: float) -> StepLimits:
    """Return what the parity residuals could not have declared, every row from the pass that decided on it.

    A step is seen best when it is about to leave the window in which onsets are sought. The size of a step that began
    there has a known standard deviation; the drop of chi-square that the level asks for, in all rows over which a
    deviate has to last, gives the size that would be declared in half of the cases, and 1.28 standard deviations more
    in 90 %, if the step changed neither the predictor nor its regressors. Onsets covered are those from the first row
    watched to a window before the last one.

    Parameters
    ----------
    factor : on these magnitudes, ABSORBED or SMEARED.
    """
    keys, limits = ("onset_s", "size", "sd", "detectable", "hidden"), []
    for monitored in passes:
        drops, window, lasting = monitored.drops, monitored.window, monitored.drops.old_size.shape[1]
        # A row tells of the onset that is the oldest in its window, the rows before it of the same onset.
        rows = monitored.decided[monitored.decided - window + 1 >= monitored.model.n_held_back]
        place = np.arange(lasting)
        run = rows[:, None] - place[::-1]
        needed = np.sqrt(drop_at(monitored.threshold.level, drops.freedom[run][:, :, None]))
        declared = factor * ((needed + ONE_SIDED_90) * drops.old_sd[run, place]).max(axis=1)
        size, sd = drops.old_size[rows, -1], drops.old_sd[rows, -1]
        hidden = np.maximum(declared, np.abs(size) + ONE_SIDED_99 * sd)
        steps = np.full((4, len(rows), samples.y.shape[1]), np.nan)
        steps[:, :, monitored.channels] = np.array([size, sd, declared, hidden]) * monitored.model.unit
        limits.append((samples.time_s[monitored.model.predicted[rows - window + 1]], *steps))
    joined = (np.concatenate(arrays) for arrays in zip(*limits, strict=True))
    return StepLimits(**dict(zip(keys, joined, strict=True)))
