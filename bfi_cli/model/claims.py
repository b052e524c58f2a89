"""What an identification says of every entry of its dictionary: declared, suspected, excluded or not seen.

An entry that is not declared is excluded where the log excludes every magnitude of it whose error on the channel is
beyond the tolerance, at 95 %. The limit is the larger of the minimal detectable magnitude and of |z| + 1.64 standard
deviations, and it is checked against the likelihood profile: a model whose dynamics nearly integrate absorbs a fault of
any size, which no standard deviation at the minimum tells.

Notes beside the numbers of a result say what this window cannot show, and warn of late onsets, slow shapes, jumps and
the rate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..decision import Candidate, candidate_of, untested
from ..dictionary import dead_reason, dead_sentences
from ..faults.shapes import SHAPES
from ..kernels import ONE_SIDED_95, FloatArray
from ..kernels.atom_signals import amplitudes, some_of
from ..kernels.onset.scan import ENDING, STARTING
from ..kernels.variable_projection import fit_magnitudes, log_dets_beside
from ..kernels.whiteness import exceedances
from ..methods import METHODS
from ..notes import Note
from .preprocessing.defaults import is_any
from .preprocessing.magnitudes import MagnitudeEstimates
from .preprocessing.regression import RegressionData
from .preprocessing.window import DEPENDENT, PreparedWindow
from .result import OutputSeries, ResidualSummary
from .selection import MethodResult

# Multiples of the limit at which the profile is asked, until it excludes one.
MULTIPLES = (1.0, 1.5, 2.25, 3.5, 6.0)


def claims_of_entries(
    window: PreparedWindow,
    regression: RegressionData,
    outcome: MethodResult,
    method: str,
    tolerances: Mapping[str, float],
) -> tuple[Candidate, ...]:
    """Return one candidate per entry of the dictionary, in its order.

    A method without intervals knows declared and not seen only.

    Parameters
    ----------
    regression : of the window; outcome : of the method on it.
    tolerances : by output.
    """
    twins, excluded = _twins(window), _excluded_above(regression, outcome, method).tolist()
    known = {entry: _claim(window, outcome, excluded[n], method, tolerances, n) for n, entry in enumerate(window.live)}
    # An entry of unknown course excludes nothing.
    for course in outcome.free:
        fault = window.faults[course.entry]
        known[course.entry] = candidate_of(
            fault,
            window.log.channel(fault.channel).unit,
            declared=course.declared,
            suspected=course.suspected,
            magnitude=float(course.value[course.peak]),
            sd=float(course.sd[course.peak]),
            onset_s=fault.onset_s,
            note=course.note,
        )
    for entry, reason in window.reasons.items():
        fault, twin = window.faults[entry], known.get(twins.get(entry, -1))
        channel = window.log.channels.get(fault.channel)
        as_twin = {"state": None} if twin is None else {"state": twin.state, "kind": twin.kind}
        known[entry] = candidate_of(
            fault, "" if channel is None else channel.unit, onset_s=fault.onset_s, note=reason, **as_twin
        )
    return tuple(known[entry] for entry in range(len(window.faults)))


def _claim(
    window: PreparedWindow,
    outcome: MethodResult,
    excluded: float,
    method: str,
    tolerances: Mapping[str, float],
    n: int,
) -> Candidate:
    """Return the candidate of the n-th live entry, of which `excluded` is the least size that is."""
    entry, magnitudes, seen = window.live[n], outcome.magnitudes, outcome.converged
    fault, declared, suspected = window.faults[entry], n in outcome.atoms, n in outcome.declined
    channel = window.log.channel(fault.channel)
    z, sd = float(magnitudes.value[n]), float(np.sqrt(magnitudes.variance[n])) if seen else np.nan
    limit = effect = note = None
    bounds = METHODS[method].intervals and seen
    if bounds and not declared:
        limit, effect = excluded, excluded * float(window.largest[entry])
        if is_any(effect, window.log, channel.name):
            note = "a fault as large as all that the channel reads could hide"
            if not np.isfinite(excluded):
                note = "the inputs and lags of the model can explain a fault of any size"
            limit = effect = None
    claim = candidate_of(
        fault,
        channel.unit,
        declared=declared,
        suspected=suspected,
        magnitude=z,
        sd=sd,
        minimal_detectable=float(magnitudes.minimal_detectable[n]) if seen else None,
        excluded_above=limit,
        effect=effect,
        seen_above=effect,
        tolerance=tolerances[channel.name],
        onset_s=fault.onset_s,
        note=outcome.declined.get(n, note),
    )
    # As of a scan over all onsets, none is made some samples from the ends of the window.
    rate_hz, time_s, order = window.signals.rate_hz, window.signals.time_s, outcome.order
    tested = time_s[0] + STARTING * order / rate_hz <= fault.onset_s <= time_s[-1] - ENDING * order / rate_hz
    return claim if tested or not bounds else untested(claim)


def _excluded_above(regression: RegressionData, outcome: MethodResult, method: str) -> FloatArray:
    """Return (n_live,) the least size, SI, of each entry that is not declared which the likelihood profile excludes.

    A fault of this size, added to the record, must reach the statistic that the rule asks for (in the mean of both
    signs), and explain the record worse than no fault with either. Sizes are multiples of a limit; infinite where none
    is excluded.
    """
    magnitudes, atoms, unit = outcome.magnitudes, list(outcome.atoms), regression.magnitude_unit
    excluded = np.full(len(unit), np.inf)
    if outcome.needed is None or not (METHODS[method].intervals and outcome.converged):
        return excluded
    reach = np.abs(magnitudes.value) + ONE_SIDED_95 * np.sqrt(magnitudes.variance)
    limits = np.maximum(magnitudes.minimal_detectable, np.where(np.isnan(reach), 0.0, reach))
    problem, rows = regression.problem(outcome.order), regression.n_rows
    fit = fit_magnitudes(problem, atoms, magnitudes.value[atoms] / unit[atoms])
    left = np.setdiff1d(np.flatnonzero(np.isfinite(limits)), atoms)
    for multiple in MULTIPLES:
        sizes = multiple * limits[left]
        falls = rows * (log_dets_beside(problem, left.tolist(), sizes / unit[left], fit) - fit.log_det)
        enough = (falls.mean(axis=1) >= outcome.needed[left]) & (falls.min(axis=1) >= 0.0)
        excluded[left[enough]] = sizes[enough]
        left = left[~enough]
    return excluded


def _twins(window: PreparedWindow) -> dict[int, int]:
    """Return, for entries left out because they are another's signal, that other entry."""
    if not window.reasons:
        return {}
    flat = window.signals.theta.reshape(-1, window.signals.theta.shape[2])
    norms = np.linalg.norm(flat, axis=0)
    twins = {}
    for entry in window.reasons:
        if norms[entry] > 0.0:
            likeness = [abs(float(flat[:, entry] @ flat[:, j])) / norms[entry] / norms[j] for j in window.live]
            best = int(np.argmax(likeness))
            if likeness[best] >= 1.0 - DEPENDENT:
                twins[entry] = window.live[best]
    return twins


# p-value of the Ljung-Box test below which intervals are suspected: hundreds of samples of real gusts rarely pass 0.05.
WHITE_P = 1e-3
# Regressors this dependent leave eight digits of the sixteen of double precision to their coefficients.
ILL_CONDITIONED = 1e8
# COLLINEAR [1]: condition number from which a regressor follows from others to the rounding of a log, as states of a
# simulation do: the space they span, which alone bears on a fault's size, loses nothing by it.
COLLINEAR = 1e12
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
    for peak, detectable in zip(amplitudes(some_of(theta, window.live)).T, magnitudes.minimal_detectable, strict=True):
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
        Note.method(f"analysed at {window.signals.rate_hz:.4g} Hz: {window.rate_reason}"),
    ]
    limits = [f"{_named(unseen)}: {BLIND_NOTE}"] if unseen else []
    ends: dict[str, Any] = {"start_s": window.window_start_s, "stop_s": window.window_stop_s}
    ends["outputs"] = window.outputs
    limits += dead_sentences([window.faults[j] for j in sorted(window.reasons)], **ends)
    limits += [reason for j, reason in sorted(window.reasons.items()) if dead_reason(window.faults[j], **ends) is None]
    if outcome.condition_number > COLLINEAR:
        notes.append(
            Note.method(
                f"regressors follow from others to round-off (condition number above {COLLINEAR:.0e}), as in "
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
