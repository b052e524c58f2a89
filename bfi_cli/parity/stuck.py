"""The error of a sensor that is stuck while its twin moves: a reading that stays still, or a pressure that is trapped.

Of one sensor nobody knows whether it rests because the air does; its twin says what it should have read.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..airdata import IMPACT_SOURCES, SEA_LEVEL_PRESSURE, SONIC_RATIO, STATIC_SOURCES, air_data_of, channels_of

FloatArray = NDArray[np.float64]


def stuck_errors(
    quantity: str, twin: FloatArray, air: Mapping[str, FloatArray], rows: NDArray[np.intp]
) -> dict[str, FloatArray]:
    """Return by shape of a fault (n, n_onsets) what a sensor reads too much from each row on, 0 before.

    "frozen" keeps its reading, "pitot_blocked" the total pressure in its own tube and "static_blocked" the static
    pressure of its own port. NaN where the pressures leave subsonic flight.

    Parameters
    ----------
    quantity : what it measures; twin : (n,) what a healthy one reads.
    air : (n,) by quantity, static pressure or altitude and temperature, as far as they are known.
    rows : (n_onsets,) first row that it is stuck in.
    """
    after = np.arange(len(twin))[:, None] >= rows
    true = twin[:, None]
    readings = {"frozen": twin[rows][None, :]}
    if quantity in IMPACT_SOURCES and set(STATIC_SOURCES) & air.keys():
        known = air_data_of({**{name: x for name, x in air.items() if name not in IMPACT_SOURCES}, quantity: twin})
        static, total, tat = known.p_static[:, None], known.p_total[:, None], known.tat[:, None]
        for shape, port, tube in (
            ("pitot_blocked", static, known.p_total[rows][None, :]),
            ("static_blocked", known.p_static[rows][None, :], total),
        ):
            port, impact = np.broadcast_arrays(port, np.maximum(tube - port, 0.0))
            subsonic = impact <= SONIC_RATIO * np.minimum(port, SEA_LEVEL_PRESSURE)
            readings[shape] = channels_of(port, np.where(subsonic, impact, np.nan), tat)[quantity]
    return {shape: np.where(after, reading - true, 0.0) for shape, reading in readings.items()}
