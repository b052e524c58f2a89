"""What an identification says of every entry of its dictionary: declared, suspected, excluded or not seen.

An entry that is not declared is excluded where the log excludes every magnitude of it whose error on the channel is
beyond the tolerance, at 95 %. The limit is the larger of the minimal detectable magnitude and of |z| + 1.64 standard
deviations, and it is checked against the likelihood profile: a model whose dynamics nearly integrate absorbs a fault of
any size, which no standard deviation at the minimum tells.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..decision import UNTESTED, Candidate, State, finite, kind_of, state_of
from ..faults import magnitude_unit, meaning
from ..kernels.lagged import constants_and_signals
from ..kernels.normal import ONE_SIDED_95
from ..kernels.variable_projection import fit_magnitudes, without_signal
from ..preprocessing.regression import RegressionData
from ..preprocessing.tolerance import is_any
from ..preprocessing.window import PreparedWindow
from .magnitudes import FreeOutcome, MethodResult
from .methods import METHODS

__all__ = ["claims_of"]

# Multiples of the limit at which the profile is asked, until it excludes one.
MULTIPLES = (1.0, 1.5, 2.25, 3.5, 6.0)
# Seconds after the window's start and before its end in which no claim is made, in orders of the model: the same as
# those of the scan over all onsets (`kernels.onset.scan`).
STARTING, ENDING = 3, 2


def claims_of(
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
    place = {entry: n for n, entry in enumerate(window.live)}
    twins = _twins(window)
    known: dict[int, Candidate] = {}
    for entry in window.live:
        known[entry] = _claim(window, regression, outcome, method, tolerances, entry, place[entry])
    free = {one.entry: one for one in outcome.free}
    candidates = []
    for entry, fault in enumerate(window.faults):
        if entry in free:
            candidates.append(_claim_of_course(window, free[entry]))
            continue
        if entry in known:
            candidates.append(known[entry])
            continue
        channel = window.log.channels.get(fault.channel)
        twin = known.get(twins.get(entry, -1))
        scale, unit = meaning(fault, "" if channel is None else channel.unit)
        candidates.append(
            Candidate(
                name=window.names[entry],
                shape=fault.shape,
                channel=fault.channel,
                kind=kind_of(fault, declared=False) if twin is None else twin.kind,
                state=None if twin is None else twin.state,
                magnitude=None,
                unit=magnitude_unit(fault, "" if channel is None else channel.unit),
                sd=None,
                channel_unit="" if channel is None else channel.unit,
                onset_s=fault.onset_s,
                note=window.reasons.get(entry),
                physical_scale=scale,
                physical_unit=unit,
            )
        )
    return tuple(candidates)


def _claim_of_course(window: PreparedWindow, one: FreeOutcome) -> Candidate:
    """Return the candidate of an entry of unknown course: of all that it may do, nothing is excluded."""
    fault = window.faults[one.entry]
    unit, at = window.log.channel(fault.channel).unit, one.peak
    return Candidate(
        name=window.names[one.entry],
        shape=fault.shape,
        channel=fault.channel,
        kind=kind_of(fault, declared=one.declared),
        state=state_of(declared=one.declared, suspected=one.suspected, effect=None, tolerance=None),
        magnitude=float(one.value[at]),
        unit=unit,
        sd=float(one.sd[at]),
        channel_unit=unit,
        onset_s=fault.onset_s,
        note=one.note,
    )


def _claim(
    window: PreparedWindow,
    regression: RegressionData,
    outcome: MethodResult,
    method: str,
    tolerances: Mapping[str, float],
    entry: int,
    n: int,
) -> Candidate:
    """Return the candidate of a live entry, the n-th of them."""
    fault, magnitudes, seen = window.faults[entry], outcome.magnitudes, outcome.converged
    channel = window.log.channel(fault.channel)
    tolerance = tolerances[channel.name]
    declared = n in outcome.atoms
    z, sd = float(magnitudes.value[n]), float(np.sqrt(magnitudes.variance[n])) if seen else np.nan
    detectable = float(magnitudes.minimal_detectable[n]) if seen else np.nan
    limit = effect = note = None
    if not declared and METHODS[method].intervals and seen:
        limit = _limit(regression, outcome, n, max(detectable, abs(z) + ONE_SIDED_95 * sd))
        if limit is None:
            note = "the inputs and lags of the model can explain a fault of any size"
        else:
            effect = limit * float(window.largest[entry])
            if is_any(effect, window.log, channel.name):
                limit = effect = None
                note = "a fault as large as all that the channel reads could hide"
    suspected = n in outcome.declined
    scale, unit = meaning(fault, channel.unit)
    state: State | None = state_of(declared=declared, suspected=suspected, effect=effect, tolerance=tolerance)
    tested = _onset_is_covered(window, outcome.order, fault.onset_s)
    if not (declared or suspected or tested) and METHODS[method].intervals and seen:
        # It narrows the claim, and is no doubt of it.
        state, note, limit, effect = None, UNTESTED, None, None
    return Candidate(
        name=window.names[entry],
        shape=fault.shape,
        channel=fault.channel,
        kind=kind_of(fault, declared=declared),
        state=state,
        magnitude=finite(z),
        unit=magnitude_unit(fault, channel.unit),
        sd=finite(sd),
        minimal_detectable=finite(detectable),
        excluded_above=limit,
        effect=effect,
        tolerance=tolerance,
        channel_unit=channel.unit,
        onset_s=fault.onset_s,
        note=outcome.declined.get(n, note),
        physical_scale=scale,
        physical_unit=unit,
    )


def _limit(regression: RegressionData, outcome: MethodResult, n: int, limit: float) -> float | None:
    """Return the first multiple of a limit, SI, that the likelihood profile excludes; None where it excludes none.

    A fault of this size, added to the record, must reach the statistic that the rule asks for (in the mean of both
    signs), and explain the record worse than no fault with either.
    """
    if not np.isfinite(limit) or outcome.needed is None:
        return None
    problem, rows = regression.problem(outcome.order), regression.n_rows
    atoms = outcome.atoms
    start = outcome.magnitudes.value[list(atoms)] / regression.magnitude_unit[list(atoms)]
    without = fit_magnitudes(problem, atoms, start).log_det
    for multiple in MULTIPLES:
        u = multiple * limit / float(regression.magnitude_unit[n])
        both = [
            rows * (fit_magnitudes(without_signal(problem, n, sign * u), atoms, start).log_det - without)
            for sign in (1.0, -1.0)
        ]
        if 0.5 * sum(both) >= outcome.needed[n] and min(both) >= 0.0:
            return multiple * limit
    return None


def _onset_is_covered(window: PreparedWindow, order: int, onset_s: float) -> bool:
    rate, time_s = window.signals.rate_hz, window.signals.time_s
    return bool(time_s[0] + STARTING * order / rate <= onset_s <= time_s[-1] - ENDING * order / rate)


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
            if likeness[best] >= SAME:
                twins[entry] = window.live[best]
    return twins


# Coherence of two entries that are one signal: what `preprocessing.window` calls dependent.
SAME = 1.0 - 1e-7
