"""What the detector says of every channel it watched: that it fails, or how large a step could have stayed unseen.

The rule that decides is turned into the step that a channel would have needed: a deviate above its level for as many
rows as it has to last, or, for data without noise, a criterion above its level. The worst onset counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..decision import Candidate, shown_limit, state_of
from ..kernels import FloatArray
from ..kernels.normal import ONE_SIDED_90, ONE_SIDED_99
from ..kernels.nullspace import Criteria
from ..kernels.parity import drop_at
from ..preprocessing.regression import Signals
from ..report.text import instant
from .parity import MonitoringPass
from .preparation import DecimatedRecord, PreparedRecord

__all__ = ["ABSORBED", "SMEARED", "StepLimits", "candidates_of", "exact_limits", "parity_limits"]

# Factors on the magnitudes that parity residuals tell, for a log without a recorder's low-pass and for one that has or
# may have one. The closed form leaves out that the predictor learns from the rows of the step, that its regressors move
# with it, and that a recorder smears it. Counted at random onsets: of steps of 1.25, 1.5 and 1.75 times the closed form
# 50, 79 and 94 % of 48 are declared in four simulated flights of the Boeing 747. In six windows of 300 s of recorded
# flights all of 30 sharp steps of 1.5 times it raise an alarm; through the recorder 50, 70, 97 and 100 % of 30 of 1.5,
# 2, 2.5 and 3 times. It holds up to the rate `detect.RATE_PER_EDGE`.
ABSORBED, SMEARED = 1.7, 2.5
# Share of the onsets whose limit a note gives where the worst one is beyond the tolerance: while the inputs move as
# never before, the predictor knows nothing for a few seconds.
USUAL = 0.95
# A sample of which less than this share is outside the row space of its window moves in a direction of its own, as the
# first ones after an input begins to move do: no claim is made for a failure that begins there.
LEAST_SHARE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepLimits:
    """Over the onsets that the claim covers, (n_onsets, n_outputs) each, in the units of the outputs.

    Attributes
    ----------
    onset_s : (n_onsets,).
    size, sd : of the step that would explain the record best.
    detectable : step that would be declared with 90 % power.
    hidden : step beyond which the record excludes one.
    """

    onset_s: FloatArray
    size: FloatArray
    sd: FloatArray
    detectable: FloatArray
    hidden: FloatArray


def parity_limits(samples: DecimatedRecord, passes: Sequence[MonitoringPass], *, factor: float) -> StepLimits:
    """Return what the parity residuals could not have declared, every row from the pass that decided on it.

    A step is seen best when it is about to leave the window in which onsets are sought. The size of a step that began
    there has a known standard deviation; the drop of chi-square that the level asks for, in all rows over which a
    deviate has to last, gives the size that would be declared in half of the cases, and 1.28 standard deviations more
    in 90 %, if the step changed neither the
    predictor nor its regressors. Onsets covered are those from the first row watched to a window before the last one.

    Parameters
    ----------
    factor : on these magnitudes, ABSORBED or SMEARED.
    """
    q, parts = samples.y.shape[1], []
    for one in passes:
        drops, window, lasting = one.drops, one.window, one.drops.old_size.shape[1]
        # A row tells of the onset that is the oldest in its window, the rows before it of the same onset.
        rows = one.decided[one.decided - window + 1 >= one.model.n_healthy - one.model.errors.start]
        run = rows[:, None] - np.arange(lasting)[::-1]
        place = np.arange(lasting)
        needed = np.sqrt(drop_at(one.threshold.level, drops.freedom[run][:, :, None]))
        declared = factor * ((needed + ONE_SIDED_90) * drops.old_sd[run, place]).max(axis=1)
        size, sd = drops.old_size[rows, -1], drops.old_sd[rows, -1]
        each = {
            "size": size,
            "sd": sd,
            "detectable": declared,
            "hidden": np.maximum(declared, np.abs(size) + ONE_SIDED_99 * sd),
        }
        full = {key: np.full((len(rows), q), np.nan) for key in each}
        for key, values in each.items():
            full[key][:, one.channels] = values * one.model.unit
        onset_s = samples.time_s[one.model.samples[one.model.errors.start :][rows - window + 1]]
        parts.append(StepLimits(onset_s=onset_s, **full))
    return StepLimits(
        **{key: np.concatenate([getattr(one, key) for one in parts]) for key in StepLimits.__dataclass_fields__}
    )


def exact_limits(record: Signals, criterion: Criteria, *, width: int, level: FloatArray) -> tuple[StepLimits, int]:
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


def candidates_of(
    prepared: PreparedRecord,
    limits: StepLimits | None,
    declared: Mapping[str, float | None],
    tolerances: Mapping[str, float],
) -> tuple[Candidate, ...]:
    """Return a step in every channel watched.

    Parameters
    ----------
    limits : None where nothing can be said of what was not declared.
    declared : by output, the size of a declared step, None where it is unknown.
    tolerances : by output.
    """
    candidates = []
    for i, (channel, unit) in enumerate(zip(prepared.outputs, prepared.units, strict=True)):
        size = sd = detectable = hidden = None
        if channel in declared:
            size = declared[channel]
        elif limits is not None and len(limits.onset_s):
            detectable = _finite(float(np.median(limits.detectable[:, i])))
            hidden = _finite(float(limits.hidden[:, i].max()))
            clearest = int(np.argmax(np.abs(limits.size[:, i]) / np.maximum(limits.sd[:, i], np.finfo(float).tiny)))
            if limits.sd[clearest, i] > 0.0:
                size, sd = _finite(float(limits.size[clearest, i])), _finite(float(limits.sd[clearest, i]))
        one = Candidate(
            name="bias" if len(prepared.outputs) == 1 else f"bias on {channel}",
            shape="bias",
            channel=channel,
            kind="abrupt",
            state=state_of(declared=channel in declared, suspected=False, effect=hidden, tolerance=tolerances[channel]),
            magnitude=size,
            unit=unit,
            sd=sd,
            minimal_detectable=detectable,
            excluded_above=hidden,
            effect=hidden,
            tolerance=tolerances[channel],
            channel_unit=unit,
        )
        if one.state == "not_seen" and limits is not None and hidden is not None:
            worst_s = limits.onset_s[limits.hidden[:, i].argmax()]
            usual = replace(one, effect=float(np.quantile(limits.hidden[:, i], USUAL)))
            note = (
                f"worst from {instant(worst_s)} s; from {100.0 * USUAL:g} % of the onsets {shown_limit(usual)} at most"
            )
            one = replace(one, note=note)
        candidates.append(one)
    return tuple(candidates)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
