"""What an identification says of every entry of its dictionary: declared, suspected, excluded or not seen.

An entry that is not declared is excluded where the log excludes every magnitude of it whose error on the channel is
beyond the tolerance, at 95 %. The limit is the larger of the minimal detectable magnitude and of |z| + 1.64 standard
deviations, and it is checked against the likelihood profile: a model whose dynamics nearly integrate absorbs a fault of
any size, which no standard deviation at the minimum tells.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..decision import Candidate, candidate_of, finite, untested
from ..kernels import ONE_SIDED_95, FloatArray
from ..kernels.lagged import constants_and_signals
from ..kernels.onset.scan import ENDING, STARTING
from ..kernels.variable_projection import fit_magnitudes, log_dets_beside
from ..methods import METHODS
from .magnitudes import MethodResult
from .preprocessing.regression import RegressionData
from .preprocessing.tolerance import is_any
from .preprocessing.window import DEPENDENT, PreparedWindow

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
    detectable = float(magnitudes.minimal_detectable[n]) if seen else np.nan
    limit = effect = note = None
    if not declared and METHODS[method].intervals and seen:
        limit = finite(excluded)
        if limit is None:
            note = "the inputs and lags of the model can explain a fault of any size"
        else:
            effect = limit * float(window.largest[entry])
            if is_any(effect, window.log, channel.name):
                limit = effect = None
                note = "a fault as large as all that the channel reads could hide"
    claim = candidate_of(
        fault,
        channel.unit,
        declared=declared,
        suspected=suspected,
        magnitude=z,
        sd=sd,
        minimal_detectable=finite(detectable),
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
    return claim if tested or not (METHODS[method].intervals and seen) else untested(claim)


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
    _, flat = constants_and_signals(window.signals.theta)
    norms = np.linalg.norm(flat, axis=0)
    twins = {}
    for entry in window.reasons:
        if norms[entry] > 0.0:
            likeness = [abs(float(flat[:, entry] @ flat[:, j])) / norms[entry] / norms[j] for j in window.live]
            best = int(np.argmax(likeness))
            if likeness[best] >= 1.0 - DEPENDENT:
                twins[entry] = window.live[best]
    return twins
