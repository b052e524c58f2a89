"""How many lags a rate asks for: measurement noise needs memory, and a lower rate gives it for fewer of them."""

from __future__ import annotations

from dataclasses import replace

from ..conditioning import Choice, Record, condition, lowest_rate
from ..config import Config
from ..errors import LogError
from ..faults import Fault
from ..kernels.decimation import Lowpass
from ..kernels.progress import Report, parts, shares, silent
from ..kernels.selection import Penalty, full_support
from .scaled import study_of

__all__ = ["slowed"]

MANY_LAGS = 8
MOST_ATOMS = 24


def slowed(
    record: Record,
    choice: Choice,
    faults: dict[int, Fault],
    config: Config,
    lowpass: Lowpass,
    report: Report = silent,
) -> Choice:
    """Halve the rate for as long as a VARX there prefers many lags and the dictionary allows it (METHOD section 4).

    Parameters
    ----------
    record : at the log's own rate.
    choice : the fastest rate that suits.
    faults : what is looked for, by its place in the dictionary.
    report : told how far it is.
    """
    while record.rate_hz / (2 * choice.factor) >= lowest_rate(record, list(faults.values())):
        first, report = shares(report, 1, 1)
        lags = _preferred_order(record, choice.factor, faults, config, lowpass, first)
        if lags < MANY_LAGS:
            break
        rate = record.rate_hz / choice.factor
        choice = replace(choice, factor=2 * choice.factor, reason=f"at {rate:.4g} Hz the noise asks for {lags} lags")
    return choice


def _preferred_order(
    record: Record, factor: int, faults: dict[int, Fault], config: Config, lowpass: Lowpass, report: Report
) -> int:
    """Return the order with the best BIC, all faults of a small dictionary free; 0 where the window is too short."""
    try:
        factorising, trying = shares(report, 1, 1)
        conditioned = condition(record, factor, lowpass)
        study = study_of(record.path, conditioned, tuple(faults), config, any_order=True, report=factorising)
    except LogError:
        return 0
    atoms = tuple(range(len(study.live))) if len(study.live) <= MOST_ATOMS else ()
    penalty = Penalty(
        n_rows=study.n_rows, n_effective=float(study.n_rows), n_candidates=len(atoms), evidence=0.0, extended=False
    )
    fits = (full_support(study.problem(order), atoms, penalty) for order, _ in parts(trying, study.orders))
    scored = [found for found in fits if found is not None]
    return min(scored, key=lambda found: found.criterion).fit.order if scored else 0
