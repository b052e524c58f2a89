"""The pilot of a simulated flight: keeps the wings level, or flies climbs, descents and turns.

The feedback is the true motion, not that of sensors, so that a fault of a sensor never moves the aircraft.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..kernels import FloatArray
from ..quantities.channels import FOOT


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A part of a tour: bank and climb angle in rad, airspeed as a part of the trimmed one."""

    duration_s: float
    bank_rad: float = 0.0
    climb_rad: float = 0.0
    speed: float = 1.0


# Six minutes, flown again and again: straight and level, climb, turns both ways, faster and slower, descent.
TOUR = (
    Leg(duration_s=40.0),
    Leg(duration_s=60.0, climb_rad=0.035),
    Leg(duration_s=30.0),
    Leg(duration_s=50.0, bank_rad=0.35),
    Leg(duration_s=30.0, speed=1.08),
    Leg(duration_s=50.0, bank_rad=-0.35),
    Leg(duration_s=60.0, climb_rad=-0.035),
    Leg(duration_s=40.0, speed=0.94),
)
# Gains, in parts of a control's travel: rules of thumb that keep aircraft from the Cub to the 747 in a tour.
ROLL_GAIN, ROLL_DAMPING = 0.5, 0.2  # per rad, per rad/s
PITCH_GAIN, PITCH_DAMPING, PITCH_TRIM = 1.0, 0.4, 0.3  # per rad, per rad/s, per rad s
CLIMB_GAIN = 0.15  # rad/s of pitch per rad of climb angle
PITCH_RANGE = 0.25  # rad about the trim, within which the pilot keeps the attitude
# m/s of airspeed error over which the throttle moves all its way, as a part of the trimmed airspeed; and per second.
THROTTLE_GAIN, THROTTLE_TRIM = 3.0, 0.1
# An altitude is held by a climb angle, per s of height over airspeed, and at most rad. The loops within it are tighter
# than a pilot's, and its trim slower, so that from 0.16 rad/s of pitch by all of the elevator's travel (a 737) to 0.44
# (a C172) every mode is damped by a half; with the pilot's gains the height of a 737 swings by 30 m ever more.
HOLD_GAIN, MOST_CLIMB = 0.1, 0.1
HOLD_PITCH_GAIN, HOLD_PITCH_DAMPING, HOLD_CLIMB_GAIN = 4.0, 1.0, 0.05
# An approach at 3 degrees, height and share at which it is flared, and the part of the brakes after it.
GLIDE, FLARE_M, LEAST_GLIDE, BRAKES = -0.052, 15.0, 0.15, 0.3
ROLL_RATE, CLIMB_RATE, SPEED_RATE = 0.08, 0.01, 0.01  # per s: how fast the wanted values change


@dataclass(slots=True, kw_only=True, eq=False)
class Pilot:
    """Feedback that adds to the controls of trim and manoeuvre; without a tour it only keeps the wings level.

    Attributes
    ----------
    held_m : altitude that an autopilot holds, wings level; runway_m : altitude of the runway that is approached;
        sheared_m : above which the wind changes with height. None for none.
    """

    tas_m_s: float
    pitch_rad: float
    step_s: float
    tour: bool
    has_landed: bool = False
    held_m: float | None = None
    runway_m: float | None = None
    sheared_m: float | None = None
    bank: float = 0.0
    climb: float = 0.0
    speed: float = 1.0
    pitch_shift: float = 0.0
    elevator_trim: float = 0.0
    throttle_trim: float = 0.0
    legs: tuple[float, ...] = field(default=tuple(float(end) for end in np.cumsum([leg.duration_s for leg in TOUR])))

    def sticks(self, time_s: float, fdm: Any) -> FloatArray:
        """Return what is added to elevator, aileron, rudder and throttle, in parts of their travel."""
        added = np.zeros(4)
        if self.tour:
            self._plan(time_s)
        flies = self.tour or self.held_m is not None
        if self.held_m is not None:
            low = (self.held_m - float(fdm["position/h-sl-ft"]) * FOOT) / self.tas_m_s
            self.bank, self.speed = 0.0, 1.0
            self.climb = min(max(HOLD_GAIN * low, -MOST_CLIMB), MOST_CLIMB)
        if self.runway_m is not None:
            flies = self._approach(fdm)
        roll, roll_rate = fdm["attitude/phi-rad"], fdm["velocities/p-rad_sec"]
        added[1] = ROLL_GAIN * (self.bank - roll) - ROLL_DAMPING * roll_rate
        if flies:
            added[0], added[3] = self._elevator(fdm), self._throttle(fdm)
        elif self.runway_m is not None:
            added[3] = -1.0
        return added

    def _approach(self, fdm: Any) -> bool:
        """Want a glide to the runway and a flare, wings level; brake on it. Return whether the aircraft still flies."""
        above_m = float(fdm["position/h-sl-ft"]) * FOOT - (self.runway_m or 0.0)
        self.bank, self.speed = 0.0, 1.0
        self.climb = GLIDE if above_m > FLARE_M else GLIDE * max(above_m / FLARE_M, LEAST_GLIDE)
        self.has_landed = self.has_landed or bool(fdm["gear/wow"])
        if self.has_landed:
            fdm["fcs/left-brake-cmd-norm"] = fdm["fcs/right-brake-cmd-norm"] = BRAKES
        return not self.has_landed

    def _plan(self, time_s: float) -> None:
        self._turn_to(TOUR[int(np.searchsorted(self.legs, time_s % self.legs[-1], side="right"))])

    def _turn_to(self, leg: Leg) -> None:
        """Move the wanted bank, climb angle and airspeed towards those of a leg."""
        for name, wanted, rate in (
            ("bank", leg.bank_rad, ROLL_RATE),
            ("climb", leg.climb_rad, CLIMB_RATE),
            ("speed", leg.speed, SPEED_RATE),
        ):
            now, most = getattr(self, name), rate * self.step_s
            setattr(self, name, now + min(max(wanted - now, -most), most))

    def _elevator(self, fdm: Any) -> float:
        gain, damping, climb_gain = PITCH_GAIN, PITCH_DAMPING, CLIMB_GAIN
        if self.held_m is not None and self.runway_m is None:
            gain, damping, climb_gain = HOLD_PITCH_GAIN, HOLD_PITCH_DAMPING, HOLD_CLIMB_GAIN
        climbing = float(fdm["velocities/h-dot-fps"]) * FOOT / self.tas_m_s
        self.pitch_shift += climb_gain * (self.climb - climbing) * self.step_s
        self.pitch_shift = min(max(self.pitch_shift, -PITCH_RANGE), PITCH_RANGE)
        low = self.pitch_rad + self.climb + self.pitch_shift - float(fdm["attitude/theta-rad"])
        self.elevator_trim = min(max(self.elevator_trim - PITCH_TRIM * low * self.step_s, -0.5), 0.5)
        return -gain * low + damping * float(fdm["velocities/thetadot-rad_sec"]) + self.elevator_trim

    def _throttle(self, fdm: Any) -> float:
        slow = self.speed - float(fdm["velocities/vtrue-fps"]) * FOOT / self.tas_m_s
        self.throttle_trim = min(max(self.throttle_trim + THROTTLE_TRIM * slow * self.step_s, -0.5), 0.5)
        return THROTTLE_GAIN * slow + self.throttle_trim
