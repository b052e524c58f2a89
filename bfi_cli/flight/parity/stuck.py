"""The error of a sensor that is stuck while its twin moves: a reading that stays still, or a pressure that is trapped.

Of one sensor nobody knows whether it rests because the air does; its twin says what it should have read.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...airdata import IMPACT_SOURCES, SEA_LEVEL_PRESSURE, SONIC_RATIO, STATIC_SOURCES, air_data_of, channels_of
from ...kernels import BoolArray, FloatArray

# ROUNDS: iterations for the static pressure that a port holds: each leaves q/p of the error, 0.35 at Mach 0.7.
ROUNDS = 8


def stuck_errors(
    quantity: str, reading: FloatArray, twin: FloatArray, air: Mapping[str, FloatArray], during: BoolArray
) -> dict[str, FloatArray]:
    """Return by shape of a fault (n, n_stretches) what a sensor reads too much while it is stuck, 0 else.

    "frozen" keeps its reading, "pitot_blocked" the total pressure in its own tube and "static_blocked" the static
    pressure of its own port; what it keeps is the mean of what its readings say. NaN where the pressures leave subsonic
    flight.

    Parameters
    ----------
    quantity : what it measures; reading : (n,) what it reads; twin : (n,) what a healthy one reads.
    air : (n,) by quantity, static pressure or altitude and temperature, as far as they are known.
    during : (n, n_stretches) where it may be stuck, each stretch somewhere.
    """

    def kept(values: FloatArray) -> FloatArray:
        return np.asarray(np.mean(np.broadcast_to(values[:, None], during.shape), axis=0, where=during))

    readings = {"frozen": kept(reading)[None, :]}
    if quantity in IMPACT_SOURCES and set(STATIC_SOURCES) & air.keys():
        true = air_data_of({**{name: x for name, x in air.items() if name not in IMPACT_SOURCES}, quantity: twin})

        def impact(p_static: FloatArray) -> FloatArray:
            return air_data_of({"p_static": p_static, "tat": true.tat, quantity: reading}).q_impact

        port = true.p_static
        for _ in range(ROUNDS):
            port = true.p_total - impact(port)
        for shape, static, total in (
            ("pitot_blocked", true.p_static[:, None], kept(true.p_static + impact(true.p_static))[None, :]),
            ("static_blocked", kept(port)[None, :], true.p_total[:, None]),
        ):
            static, q_impact = np.broadcast_arrays(static, np.maximum(total - static, 0.0))
            subsonic = q_impact <= SONIC_RATIO * np.minimum(static, SEA_LEVEL_PRESSURE)
            readings[shape] = channels_of(static, np.where(subsonic, q_impact, np.nan), true.tat[:, None])[quantity]
    return {shape: np.where(during, would - twin[:, None], 0.0) for shape, would in readings.items()}
