"""Air data as one system: pressures and temperature, and the airspeeds, Mach number and altitude that follow from them.

Functions of arrays of any shape, SI and kelvin, subsonic, between -5000 and 20 000 m. NaN gives NaN.

    p_static, p_total   static and total pressure, Pa
    q_impact            impact pressure, p_total - p_static, Pa; not the dynamic pressure of incompressible flow
    cas, tas            calibrated and true airspeed, m/s
    altitude            pressure altitude, m: geopotential height of the standard atmosphere of the same pressure
    tat, sat            total and static air temperature, K; a probe of recovery factor 1

The standard atmosphere is that of ICAO Doc 7488 and, below 20 000 m, of the U.S. Standard Atmosphere 1976.
"""

from .airspeed import (
    GAMMA,
    HIGHEST,
    LOWEST,
    PRESSURES,
    SEA_LEVEL_PRESSURE,
    SEA_LEVEL_SPEED_OF_SOUND,
    SEA_LEVEL_TEMPERATURE,
    SONIC_RATIO,
    G,
    altitude_of,
    calibrated_airspeed,
    impact_pressure_of_cas,
    impact_pressure_of_mach,
    isa_temperature,
    mach_number,
    mach_of_tas,
    pressure_at,
    speed_of_sound,
    static_temperature,
    total_temperature,
    true_airspeed,
)
from .motion import (
    EARTH_RADIUS,
    KINEMATICS,
    climb_angle,
    constant_wind,
    ground_speed_of,
    ground_velocity,
    kinematic_acceleration,
    lift_speed,
    longitudinal_acceleration,
    normal_acceleration,
    vane_angle,
    zero_lift_angle,
)
from .system import (
    DEPENDS_ON,
    IMPACT_SOURCES,
    SENSORS,
    STATIC_SOURCES,
    AirData,
    Impossible,
    air_data_of,
    channels_of,
    fault_distribution,
)

__all__ = ["DEPENDS_ON", "EARTH_RADIUS", "GAMMA", "HIGHEST", "IMPACT_SOURCES", "KINEMATICS", "LOWEST", "PRESSURES"]
__all__ += ["SEA_LEVEL_PRESSURE", "SEA_LEVEL_SPEED_OF_SOUND", "SEA_LEVEL_TEMPERATURE", "SENSORS", "SONIC_RATIO"]
__all__ += ["STATIC_SOURCES", "AirData", "G", "Impossible", "air_data_of", "altitude_of", "calibrated_airspeed"]
__all__ += ["channels_of", "climb_angle", "constant_wind", "fault_distribution", "ground_speed_of"]
__all__ += ["ground_velocity", "longitudinal_acceleration", "normal_acceleration"]
__all__ += ["impact_pressure_of_cas", "impact_pressure_of_mach", "isa_temperature", "kinematic_acceleration"]
__all__ += ["lift_speed", "mach_number", "mach_of_tas", "pressure_at", "speed_of_sound", "static_temperature"]
__all__ += ["total_temperature", "true_airspeed", "vane_angle", "zero_lift_angle"]
