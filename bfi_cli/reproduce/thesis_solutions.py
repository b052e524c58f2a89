"""The published method on a faulty record, at many orders from one factorisation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import Config, merge
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..identify.risro import declared, solve
from ..kernels.lagged import restrict
from ..preprocessing.regression import build_regression
from ..preprocessing.window import prepare_window
from .record import thesis_dictionary

__all__ = ["LISTING", "SETTLED", "Solved", "solved", "vaf"]

FloatArray = NDArray[np.float64]

OWN_RATE = {"method": "risro", "conditioning.rate_hz": "none"}
LISTING = merge(Config(), {**OWN_RATE, "risro": {"as_published": True, "sparsity": "exp_l0", "p0": 1e-300}})
"""As the listing runs: 50 steps, its updates that never happen, its matrix put together anew after every step."""
SETTLED = merge(Config(), OWN_RATE)
"""The same problem with the corner of the matrix imposed, solved until it settles."""
LISTING_SHARE = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """The published method at one order.

    Attributes
    ----------
    z : (n_atoms,) all magnitudes of the dictionary.
    names : declared by the rule of section 5-1.
    n_listing : how many the listing of the sweep over orders counts, whose rule is ten times as strict.
    error : of the magnitudes, equation 5-1; NaN where no true fault is in the dictionary.
    fault : (n_samples,) from all magnitudes, as in the thesis.
    vaf_fault, vaf_output : equation 5-2 in %, not below 0 (as in the listing); the output about its mean.
    """

    order: int
    z: FloatArray
    names: tuple[str, ...]
    n_listing: int
    error: float
    fault: FloatArray
    vaf_fault: float
    vaf_output: float


def solved(
    log: FlightLog,
    orders: Sequence[int],
    config: Config,
    *,
    report: Callable[[int], None] = lambda _done: None,
) -> tuple[Solved, ...]:
    """Solve a log with injected faults for the thesis's dictionary, every order on the rows of the largest.

    Parameters
    ----------
    log : with its truth.
    config : `LISTING` or `SETTLED`.
    report : told how many orders are done.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used, or is too short for an order.
    DictionaryError : no signal of the dictionary can be seen in it.
    """
    assert log.truth is not None
    window = prepare_window(log, thesis_dictionary(), config)
    regression = build_regression(window.signals, window.live, config, orders=orders)
    channel = window.log.channel("tas")
    true = channel.values - log.truth.clean[channel.name]
    sizes = {fault.name: fault.magnitude for fault in log.truth.faults}
    wanted = np.array([sizes.get(name, 0.0) for name in window.names])
    spread = float(np.linalg.norm(regression.layout.y[regression.layout.first :, 0]))
    found = []
    for done, order in enumerate(regression.orders, start=1):
        solution = solve(restrict(regression.data, order=order), config)
        z = np.zeros(len(window.names))
        z[list(window.live)] = solution.z * regression.magnitude_unit
        size = float(np.linalg.norm(z))
        names = declared(solution, z[list(window.live)], config)
        fault = window.signals.theta[:, 0] @ z
        found.append(
            Solved(
                order=order,
                z=frozen_array(z),
                names=tuple(window.names[j] for j, is_one in zip(window.live, names, strict=True) if is_one),
                n_listing=int(np.sum(np.abs(z) > LISTING_SHARE * size)),
                error=float(np.linalg.norm(z - wanted) / np.linalg.norm(wanted)) if wanted.any() else float("nan"),
                fault=frozen_array(fault),
                vaf_fault=vaf(true, fault),
                vaf_output=max(0.0, 100.0 * (1.0 - (solution.misfit / spread) ** 2)),
            )
        )
        report(done)
    return tuple(found)


def vaf(true: FloatArray, estimate: FloatArray) -> float:
    """Return the variance accounted for in %, not below 0 (equation 5-2 and the listing)."""
    return max(0.0, float(100.0 * (1.0 - np.sum((true - estimate) ** 2) / np.sum(true**2))))
