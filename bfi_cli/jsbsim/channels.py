"""The properties of JSBSim that are channels of a log, and their units."""

from __future__ import annotations

from dataclasses import dataclass

from ..quantities.channels import FOOT, POUND, G

# File in the folder of a flight with the part of the flight that is done.
FLOWN = "flown.txt"

RANKINE = 5.0 / 9.0  # K
PSF = POUND * G / FOOT**2  # Pa, pounds per square foot

# Inputs, in the order of a flight's controls, and what moves them in parts of their travel: a positive stick lowers
# the nose, rolls right, and a positive pedal is JSBSim's, which yaws left or right by aircraft.
CONTROLS = {
    "elevator": "fcs/elevator-cmd-norm",
    "aileron": "fcs/aileron-cmd-norm",
    "rudder": "fcs/rudder-cmd-norm",
    "throttle": "fcs/throttle-cmd-norm",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """An output: its standard name, JSBSim's property, and value = property x scale + offset in SI.

    `per_mass` marks a force, lb, that is divided by the mass in slugs first, `per_engine` a property of each engine, of
    which the sum is recorded.
    """

    name: str
    property: str
    scale: float = 1.0
    offset: float = 0.0
    per_mass: bool = False
    per_engine: bool = False


# Pressures, temperatures and airspeeds are those of JSBSim's own equations. Forces without the weight, per mass, are
# what accelerometers at the centre of gravity feel; `normal_acc` is upward, with gravity taken out, as the other two
# are not.
_PROPERTIES = (
    ("tas", "velocities/vtrue-fps", FOOT),
    ("cas", "velocities/vc-fps", FOOT),
    ("mach", "velocities/mach", 1.0),
    ("altitude", "atmosphere/pressure-altitude", FOOT),
    ("altitude_rate", "velocities/h-dot-fps", FOOT),
    ("p_static", "atmosphere/P-psf", PSF),
    ("p_total", "propulsion/pt-lbs_sqft", PSF),
    ("tat", "propulsion/tat-r", RANKINE),
    ("sat", "atmosphere/T-R", RANKINE),
    ("aoa", "aero/alpha-rad", 1.0),
    ("sideslip", "aero/beta-rad", 1.0),
    ("roll", "attitude/phi-rad", 1.0),
    ("pitch", "attitude/theta-rad", 1.0),
    ("yaw", "attitude/psi-rad", 1.0),
    ("roll_rate", "velocities/p-rad_sec", 1.0),
    ("pitch_rate", "velocities/q-rad_sec", 1.0),
    ("yaw_rate", "velocities/r-rad_sec", 1.0),
    ("velocity_north", "velocities/v-north-fps", FOOT),
    ("velocity_east", "velocities/v-east-fps", FOOT),
)
RECORDED = (
    *(Recorded(name=name, property=source, scale=scale) for name, source, scale in _PROPERTIES),
    Recorded(name="fuel_flow", property="fuel-flow-rate-pps", scale=POUND, per_engine=True),
    Recorded(name="longitudinal_acc", property="forces/fbx-total-lbs", scale=FOOT, per_mass=True),
    Recorded(name="lateral_acc", property="forces/fby-total-lbs", scale=FOOT, per_mass=True),
    Recorded(name="normal_acc", property="forces/fbz-total-lbs", scale=-FOOT, offset=-G, per_mass=True),
)
