"""The F-16's rows of state and controls, mass, inertia, dimensions, surface limits. SI, radians; power in percent.

Source: Stevens and Lewis, Aircraft Control and Simulation, section 3.5, after NASA TP-1538.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["AIRFRAME", "BOOK_AIRFRAME", "CONTROLS", "FOOT", "POUND", "SLUG_FT2", "STATES", "SURFACE_LIMITS", "Airframe"]

STATES = (
    *("tas", "aoa", "sideslip", "roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate"),
    *("north", "east", "altitude", "power"),
)
TAS, AOA, SIDESLIP, ROLL, PITCH, YAW = range(6)
RATES = slice(6, 9)
GROUND = slice(9, 12)
ALTITUDE, POWER = 11, 12

CONTROLS = ("elevator", "aileron", "rudder", "throttle", "nozzle_yaw", "nozzle_pitch")
ELEVATOR, THROTTLE = 0, 3
SURFACES = slice(0, 3)
NOZZLE = slice(4, 6)

FOOT = 0.3048
POUND = 4.4482216152605
SLUG_FT2 = 1.3558179483314
DEGREE = 0.017453292519943295

SURFACE_LIMITS = (25.0 * DEGREE, 21.5 * DEGREE, 30.0 * DEGREE)
"""Largest elevator, aileron and rudder deflections."""

IXX, IYY, IZZ, IXZ = 9496.0, 55814.0, 63100.0, 982.0  # slug ft^2
GAMMA = IXX * IZZ - IXZ * IXZ


@dataclass(frozen=True, slots=True, kw_only=True)
class Airframe:
    """A rigid body with a spinning engine.

    Attributes
    ----------
    inertia : c1 .. c9 of the moment equations (Stevens and Lewis, eq. 1.7-18); c3, c4, c7, c9 in 1/(kg m^2).
    engine_momentum : angular momentum of the engine along body x, kg m^2/s.
    reference_cg : centre of gravity of the tables, as a part of the chord.
    """

    inertia: tuple[float, ...]
    mass_kg: float = 1.0 / 1.57e-3 * POUND / FOOT
    wing_area_m2: float = 300.0 * FOOT**2
    span_m: float = 30.0 * FOOT
    chord_m: float = 11.32 * FOOT
    engine_momentum: float = 160.0 * SLUG_FT2
    reference_cg: float = 0.35
    gravity_m_s2: float = 32.17 * FOOT


AIRFRAME = Airframe(
    inertia=(
        ((IYY - IZZ) * IZZ - IXZ * IXZ) / GAMMA,
        (IXX - IYY + IZZ) * IXZ / GAMMA,
        IZZ / GAMMA / SLUG_FT2,
        IXZ / GAMMA / SLUG_FT2,
        (IZZ - IXX) / IYY,
        IXZ / IYY,
        1.0 / IYY / SLUG_FT2,
        ((IXX - IYY) * IXX + IXZ * IXZ) / GAMMA,
        IXX / GAMMA / SLUG_FT2,
    )
)
"""The inertia of NASA TP-1538."""

BOOK_AIRFRAME = Airframe(
    inertia=(
        *(-0.770, 0.02755, 1.055e-4 / SLUG_FT2, 1.642e-6 / SLUG_FT2, 0.9604),
        *(1.759e-2, 1.792e-5 / SLUG_FT2, -0.7336, 1.587e-5 / SLUG_FT2),
    )
)
"""The same with the coefficients rounded as in the book, whose check case was computed with them."""
