"""The magnitudes of the faults that the scan declares, as `identify` would estimate them with their onsets given.

The scan's rate and order are those at which most faults are detected. An estimate needs more of what the recorder left
above its edge, and its interval the spread between rates and between models with and without a root at 1, which a
single model does not show (docs/theory.md, 5.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...config import Config
from ...dictionary import Dictionary
from ...errors import DictionaryError, LogError
from ...flightlog import FlightLog
from ...kernels.model_selection import Penalty, least_criterion
from ...kernels.progress import Report, parts, shares, silent
from ...kernels.variable_projection import fit_magnitudes
from ..preprocessing.fault_free_model import scored_by
from ..preprocessing.magnitudes import at_half_rate, estimate_magnitudes, overdispersion
from ..preprocessing.window import prepare_window, regression_of
from .estimate import Estimate
from .scan_record import ScanRecord
from .shapes import fault_of


def measure(
    log: FlightLog, record: ScanRecord, faults: Sequence[Estimate], config: Config, report: Report = silent
) -> list[Estimate]:
    """Return faults with their magnitudes estimated together at the rate of an estimate, onsets and shapes kept.

    They stay as they are where the window is too short for that rate, or cannot tell the faults from each other there,
    and where the recorder is uncertain: each was then measured with the likeliest of several.

    Parameters
    ----------
    log : the whole log, of which the record is the window that `config` states.
    report : receives the progress.
    """
    if not faults:
        return []
    if any(low_pass.uncertain for low_pass in record.window.filters):
        return list(faults)
    atoms = []
    for n, fault in enumerate(faults, 1):
        channel, _, _ = record.output(fault.form.output)
        atom = fault_of(fault.form, channel, onset_s=fault.onset_s, offset_s=fault.offset_s)
        atoms.append(replace(atom, name=f"fault {n}"))
    dictionary = Dictionary(atoms=tuple(atoms), relative_to="log", sha256="", path="start-time")
    preparing, fitting, elsewhere, halving, sizing = shares(report, 1, 1, 2, 1, 2)
    try:
        window = prepare_window(log, dictionary, config, preparing)
        regression = regression_of(window, config)
    except (DictionaryError, LogError):
        return list(faults)
    if len(window.live) < len(faults):
        return list(faults)
    units = np.array([float(record.unit[fault.form.output]) for fault in faults])
    start = np.array([fault.z for fault in faults]) * units / regression.magnitude_unit
    rows = float(regression.n_rows)
    penalty = Penalty(n_rows=regression.n_rows, n_effective=rows, n_candidates=len(faults), evidence=0.0)
    fits = [
        fit_magnitudes(regression.problem(order), range(len(faults)), start)
        for order, _ in parts(fitting, regression.orders)
    ]
    scored, penalty = scored_by(regression, fits, penalty)
    dispersion = overdispersion(window, regression, least_criterion(scored).fit, elsewhere)
    coarse = at_half_rate(window, regression, config, halving)
    estimates = estimate_magnitudes(regression, scored, penalty, dispersion, coarse, sizing)
    z, sd = estimates.value / units, np.sqrt(estimates.variance) / units
    return [
        replace(
            fault,
            z=float(z[n]),
            sd=float(np.hypot(sd[n], fault.onset_spread)),
            signal=fault.signal * (float(z[n]) / fault.z),
        )
        for n, fault in enumerate(faults)
    ]
