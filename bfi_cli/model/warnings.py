"""Notes beside the numbers of a result: what this window cannot show, late onsets, slow shapes, jumps, the rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..dictionary import dead_reason, dead_sentences
from ..faults.shapes import SHAPES
from ..kernels.whiteness import exceedances
from ..notes import Note
from .magnitudes import MethodResult
from .preprocessing.magnitudes import MagnitudeEstimates
from .preprocessing.window import PreparedWindow
from .result import OutputSeries, ResidualSummary

# p-value of the Ljung-Box test below which intervals are suspected: hundreds of samples of real gusts rarely pass 0.05.
WHITE_P = 1e-3
# Regressors this dependent leave eight digits of the sixteen of double precision to their coefficients.
ILL_CONDITIONED = 1e8
# DEPENDENT [1]: condition number from which a regressor follows from others to the rounding of a log, as states of a
# simulation do: the space they span, which alone bears on a fault's size, loses nothing by it.
DEPENDENT = 1e12
MOST_NAMED = 5  # entries in a sentence
# A fault that must be this many times the output's whole movement to be seen cannot be excluded by the log.
BLIND = 3.0
# More exceedances of five standard deviations than this share are gusts rather than an abrupt event.
RARE = 0.02
# An oscillation of fewer cycles in the window can be a change of thrust or wind.
SLOW_CYCLES = 10.0
BLIND_NOTE = "only a fault larger than the output's whole movement would be seen in this window"


def hidden_atoms(window: PreparedWindow, magnitudes: MagnitudeEstimates) -> tuple[bool, ...]:
    """Say for each live atom whether only a fault far larger than the output's whole movement could be seen."""
    hidden, theta, moved = [], window.signals.theta, np.ptp(window.signals.y, axis=0)
    peaks = theta.of(window.live).peaks()
    for peak, detectable in zip(peaks.T, magnitudes.minimal_detectable, strict=True):
        smallest, movement = detectable * float(peak.max()), float(moved[np.argmax(peak)])
        hidden.append(not np.isfinite(smallest) or smallest > BLIND * movement)
    return tuple(hidden)


def warnings_of(
    window: PreparedWindow,
    outcome: MethodResult,
    series: Sequence[OutputSeries],
    residuals: Sequence[ResidualSummary],
    hidden: Sequence[bool],
) -> list[Note]:
    """Return the notes that every method gives, those on the declared faults first.

    Parameters
    ----------
    hidden : of each live atom, see `hidden_atoms`.
    """
    time_s, native = window.signals.time_s, window.native
    first = len(time_s) - len(outcome.error)
    declared = [window.live[n] for n in outcome.atoms]
    late = [window.names[j] for j in declared if np.sum(time_s >= window.faults[j].onset_s) < 2 * first]
    duration_s = len(native.time_s) / native.rate_hz
    slow = [
        window.names[j]
        for j in declared
        if SHAPES[(fault := window.faults[j]).shape].kind == "slow"
        or (fault.frequency_hz is not None and fault.frequency_hz * duration_s < SLOW_CYCLES)
    ]
    unseen = [window.names[j] for j, is_hidden in zip(window.live, hidden, strict=True) if is_hidden]
    limits = []
    if late:
        limits.append(
            f"{_named(late)}: fewer than {2 * first} samples after its onset; choose a window that ends later"
        )
    if slow:
        limits.append(
            f"{_named(slow)}: a change of thrust, configuration or wind that is not among the inputs can look like a "
            "slow fault; add inputs that explain it (--input)"
        )
    for output in series:
        error = output.prediction_error[first:]
        jumps_s = time_s[first:][exceedances(error)]
        if 0 < jumps_s.size <= max(1.0, RARE * len(error)):
            shown = ", ".join(f"{t:.4g}" for t in jumps_s[:MOST_NAMED])
            count = "once (at" if jumps_s.size == 1 else f"{jumps_s.size} times (first at"
            limits.append(
                f"the prediction error of '{output.channel}' still exceeds five standard deviations {count} {shown} "
                "s): an abrupt event that is not in the dictionary, or gusts"
            )
    notes = [
        *map(Note.limit, limits),
        Note.method(f"analysed at {window.signals.rate_hz:.4g} Hz: {window.rate.reason}"),
    ]
    limits = [f"{_named(unseen)}: {BLIND_NOTE}"] if unseen else []
    ends: dict[str, Any] = {"start_s": window.window_start_s, "stop_s": window.window_stop_s}
    ends["outputs"] = window.outputs
    limits += dead_sentences([window.faults[j] for j in sorted(window.reasons)], **ends)
    limits += [reason for j, reason in sorted(window.reasons.items()) if dead_reason(window.faults[j], **ends) is None]
    if outcome.condition_number > DEPENDENT:
        notes.append(
            Note.method(
                f"regressors follow from others to round-off (condition number above {DEPENDENT:.0e}), as in "
                "simulations: coefficients of the model mean nothing, sizes of faults do not depend on them"
            )
        )
    elif outcome.condition_number > ILL_CONDITIONED:
        limits.append(
            f"the regressors are nearly dependent (condition number {outcome.condition_number:.1e}): the inputs hardly "
            "move, or the rate is far above the dynamics"
        )
    limits += [
        f"the model's prediction errors of '{each.channel}' are not white: intervals may be too narrow"
        for each in residuals
        if each.ljung_box_p < WHITE_P and np.isfinite(outcome.magnitudes.degrees)
    ]
    return [*notes, *map(Note.limit, limits)]


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(f"'{name}'" for name in names[:MOST_NAMED])
    return shown if len(names) <= MOST_NAMED else f"{shown} and {len(names) - MOST_NAMED} more"
