"""The criterion of the paper for data without noise: the right null space of the last samples (H, eq. 29)."""

from __future__ import annotations

import numpy as np

from ..kernels import BoolArray, FloatArray
from ..kernels.nullspace import Criteria, criteria, past_rank
from ..model.preprocessing.signals import NativeSignals
from ..notes import Note
from .preparation import PreparedRecord
from .result import Alarm, Detection, StepLimits

# Threshold of the criterion, relative to a channel's own size. Boeing 747 without noise: healthy channels stay 3e10
# times below a failing one (docs/validation.md). The healthy time must stay below a tenth of it.
LEVEL, MARGIN = 1e-7, 0.1
# One lag where the outputs hold all states (H 15); two or four where they do not.
LAGS = (1, 2, 4)
# Columns of a window at least, and how many more than the rank, so that the null space is not empty.
NARROWEST, SPARE = 10, 5
# Share of the largest criterion below which a channel is not declared: what a failure inside the window leaves in the
# other channels is smaller by orders of magnitude (H, after eq. 29).
SELECTIVE = 1e-2
# A sample of which less than this share is outside the row space of its window moves in a direction of its own, as the
# first ones after an input begins to move do: no claim is made for a failure that begins there.
LEAST_SHARE = 1e-3
GAPS = (
    "a failure at one of {} samples may show in another channel or not at all: they move as none before them in their "
    "window, like the first ones after an input begins to move"
)
NOISY = Note.advice(
    "the healthy time is not explained to round-off: this log has noise, or needs more channels, and the alarms mean "
    "nothing; give --method parity"
)


def detect_exactly(prepared: PreparedRecord) -> Detection:
    """Return what the right null space of the last samples says of each output, at the log's own rate (paper H).

    The past data have the fewest lags that explain the healthy time. A constant counts as an input, so that values need
    not be deviations from a trim. For as long as a failure is inside the window, other channels may leave round-off too
    (paper H, after eq. 29), by orders of magnitude less: they are not declared.
    """
    record = prepared.record
    criterion, lags, width, explained = _criterion(record, record.time_s < prepared.train[1])
    channel = np.nan_to_num(criterion.channel)
    levels = np.maximum(LEVEL, SELECTIVE * channel.max(axis=1))
    limits, left_out = _limits(record, criterion, width=width, level=levels) if explained else (None, 0)
    return Detection(
        method="exact",
        rate_hz=record.rate_hz,
        time_s=record.time_s,
        y=record.y,
        statistic=criterion.channel,
        threshold=np.full(record.y.shape[1], LEVEL),
        alarms=_alarms(prepared, channel, levels, width),
        limits=limits,
        is_calibrated=explained,
        ready_s=None if criterion.ready is None else float(record.time_s[criterion.ready - 1]),
        width=width,
        notes=(
            Note.method(
                f"the healthy time has no noise (a linear model of order {lags} explains it to round-off): a channel "
                f"fails where more than {LEVEL:g} of its size stays unexplained in {width} samples"
            )
            if explained
            else NOISY,
            *([] if criterion.ready is None else [Note.method(f"ready after {criterion.ready} samples")]),
            *([Note.limit(GAPS.format(left_out))] if left_out else []),
        ),
    )


def _criterion(record: NativeSignals, healthy: BoolArray) -> tuple[Criteria, int, int, bool]:
    """Return the criterion with the fewest lags that explain the healthy time, or with the most.

    Returns
    -------
    The criterion, its lags, the samples of its window, and whether it explains the healthy time.
    """
    u = np.column_stack([record.u, np.ones(len(record.u))])
    both = np.hstack([record.y, u])
    for lags in LAGS:
        # Inputs bring the samples before the last one with them: z(i) then reaches `lags` samples back.
        past = (np.vstack([np.zeros((lag, both.shape[1])), both[:-lag]]) for lag in range(1, lags))
        inputs = np.hstack([u, *past])
        width = max(NARROWEST, past_rank(record.y[healthy], inputs[healthy]) + SPARE)
        criterion = criteria(record.y, inputs, width=width)
        explained = not bool((np.nan_to_num(criterion.channel[healthy]) > MARGIN * LEVEL).any())
        if explained:
            break
    return criterion, lags, width, explained


def _alarms(prepared: PreparedRecord, channel: FloatArray, levels: FloatArray, width: int) -> tuple[Alarm, ...]:
    """Return the alarms: a channel raises one where it exceeds its level, unless it did so within the window before.

    Parameters
    ----------
    channel : (n_samples, n_outputs) the criterion; levels : (n_samples,) above which a channel is declared.
    """
    last = np.full(channel.shape[1], -width - 1)
    alarms = []
    for i in np.flatnonzero((channel > LEVEL).any(axis=1)):
        above = channel[i] > levels[i]
        time_s = float(prepared.record.time_s[i])
        alarms += [
            Alarm(
                channel=prepared.record.outputs[k],
                time_s=time_s,
                onset_s=time_s,
                statistic=float(channel[i, k]),
                threshold=LEVEL,
                size=None,
                unit=prepared.units[k],
            )
            for k in np.flatnonzero(above & (last < i - width))
        ]
        last[above] = i
    return tuple(alarms)


def _limits(record: NativeSignals, criterion: Criteria, *, width: int, level: FloatArray) -> tuple[StepLimits, int]:
    """Return what the criterion of data without noise could not have declared.

    At its first sample a step d changes Y alone, in its channel's row, so that the criterion becomes at least |d| times
    the share of the sample outside the row space of Z, over the channel's size, less what the healthy record leaves. It
    is above the level wherever |d| exceeds their quotient. Samples that have next to no such share are not covered.

    Parameters
    ----------
    level : (n_samples,) above which a channel is declared.

    Returns
    -------
    The limits, and the number of samples that are not covered.
    """
    share = criterion.share
    at = np.flatnonzero(np.nan_to_num(share) >= LEAST_SHARE)
    size = np.maximum.accumulate(np.abs(record.y), axis=0)[at] * np.sqrt(width)
    limit = (level[at, None] + criterion.channel[at]) * size / share[at, None]
    none = np.zeros_like(limit)
    left_out = int(np.count_nonzero(np.isfinite(share))) - len(at)
    return StepLimits(onset_s=record.time_s[at], size=none, sd=none, detectable=limit, hidden=limit), left_out
