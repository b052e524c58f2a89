"""Whether the faults that a scan declares stand out with all trusted channels of the log as inputs, too.

A change of thrust or wind that the inputs do not show looks like a fault of the output. What the log's other channels
explain is no fault.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...config import Config, merge
from ...errors import LogError
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...quantities.text import instant
from ..preprocessing.window import with_inputs_of
from .estimate import Estimate, subtract_faults, unit_signals
from .scan import lasting_peak, scan_of
from .scan_record import ScanRecord, prepare_record

# Share of its statistic that a fault keeps where the other channels are inputs, too. With the elevator alone it kept 1
# to 29 % of that of the six false alarms in 137 windows of two recorded flights, and 49 % or more of that of 39 steps,
# drifts and oscillations in 19 of them: what is in the output alone stands out the more, the less else is unexplained.
LEAST_SHARE = 0.4
# Seconds by which the onset may differ: one sample of the usual rate of the scan, and its low-pass.
NEAR_S = 1.5


def unconfirmed(
    log: FlightLog, record: ScanRecord, estimates: Sequence[Estimate], config: Config, *, order: int
) -> dict[int, str]:
    """Return, by the index of each estimate that the log's other channels explain, why it is only suspected.

    Empty where all trusted channels are inputs already, or where the window has too few samples for them.

    Parameters
    ----------
    log : with all its channels.
    record : of the window with the inputs of the configuration; estimates : declared in it.
    order : of the model that is left without the faults.
    """
    with_all = with_inputs_of(log, merge(config, {"inputs": ("auto",)})) if estimates else config
    more = [name for name in with_all.inputs if name not in config.inputs]
    if not more:
        return {}
    alike = {"inputs": (*config.inputs, *more), "conditioning.rate_hz": record.window.same_rate}
    try:
        wider = prepare_record(log, merge(with_all, alike))
    except LogError:
        return {}
    if wider.y.shape != record.y.shape or order > max(wider.orders):
        return {}
    doubts = {}
    for i, fault in enumerate(estimates):
        others = [other for other in estimates if other is not fault]
        statistic = _statistic_of(wider, subtract_faults(wider.y, *others), fault, order)
        if statistic < LEAST_SHARE * fault.statistic:
            doubts[i] = (
                f"the {fault.form.shape} from {instant(fault.onset_s)} s is only suspected: its statistic falls from "
                f"{fault.statistic:.3g} to {statistic:.3g} with {', '.join(more)} as inputs"
            )
    return doubts


def _statistic_of(record: ScanRecord, y: FloatArray, fault: Estimate, order: int) -> float:
    """Return the statistic of a fault as it was estimated, or of one that begins near it where that is larger."""
    likelihood = record.likelihood(y, order)
    same = likelihood.statistic(likelihood.fit(unit_signals(y, [fault])))
    if fault.offset_s is not None:
        return same
    profile = lasting_peak(record, scan_of(record, y, order, output=fault.form.output), fault.form).profile
    near = np.abs(record.onsets_s(profile.onsets) - fault.onset_s) <= NEAR_S
    return max(same, float(profile.statistic[near].max(initial=0.0)))
