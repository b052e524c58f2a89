"""A flight without noise, made so that lift, climb, kinematics and ground speed agree to rounding."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from bfi_cli.airdata import (
    G,
    channels_of,
    climb_angle,
    impact_pressure_of_mach,
    isa_temperature,
    kinematic_acceleration,
    pressure_at,
    speed_of_sound,
    total_temperature,
)
from bfi_cli.flight.parity import Record
from bfi_cli.flight.parity.scan import WindowScan
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.kernels.likelihood_ratio import LikelihoodRatio

ZERO_LIFT = np.radians(-1.2)
WIND = (7.0, -4.0)  # m/s to the north and to the east
WARMTH = 1.03  # of the air, in temperatures of the standard atmosphere
UNITS = {"tas": "m/s", "cas": "m/s", "ias": "m/s", "mach": "1", "q_impact": "Pa", "p_total": "Pa", "p_static": "Pa"}
UNITS |= {"altitude": "m", "tat": "K", "sat": "K", "aoa": "rad", "pitch": "rad", "roll": "rad", "normal_acc": "m/s^2"}
UNITS |= {"longitudinal_acc": "m/s^2", "altitude_rate": "m/s", "velocity_north": "m/s", "velocity_east": "m/s"}
UNITS |= {"flaps": "rad", "gear": "1", "latitude": "rad", "longitude": "rad"}


def channels_at(time_s: np.ndarray, fine: int = 20) -> dict[str, np.ndarray]:
    """Return all channels at times that are evenly spaced, s."""
    step_s = float(time_s[1] - time_s[0]) / fine
    t = time_s[0] + step_s * np.arange((len(time_s) - 1) * fine + 1)
    V = 110.0 + 8.0 * np.sin(0.05 * t) + 3.0 * np.sin(0.021 * t + 1.0)
    gained = 0.4 * np.cos(0.05 * t) + 0.063 * np.cos(0.021 * t + 1.0)
    aoa = np.radians(4.0 + 1.2 * np.sin(0.07 * t + 0.4))
    pitch = np.radians(6.0 + 2.0 * np.sin(0.06 * t))
    roll = np.radians(20.0 * np.sin(0.03 * t))
    rise = V * np.sin(climb_angle(aoa, pitch, roll))
    altitude = 2500.0 + np.concatenate([[0.0], np.cumsum(0.5 * step_s * (rise[1:] + rise[:-1]))]) / WARMTH
    sat, p_static = WARMTH * isa_temperature(altitude), pressure_at(altitude)
    mach = V / speed_of_sound(sat)
    q_impact, tat = impact_pressure_of_mach(mach, p_static), total_temperature(sat, mach)
    lift = q_impact * (aoa - ZERO_LIFT)
    normal_acc = G * (lift / lift.mean() - 1.0)
    still = kinematic_acceleration(np.zeros_like(t), normal_acc, aoa, pitch, roll)
    heading, horizontal = 0.012 * t, np.sqrt(V**2 - rise**2)
    found = {
        **channels_of(p_static, q_impact, tat),
        "tas": V,
        "sat": sat,
        "tat": tat,
        "altitude": altitude,
        "altitude_rate": rise / WARMTH,
        "aoa": aoa,
        "pitch": pitch,
        "roll": roll,
        "normal_acc": normal_acc,
        "longitudinal_acc": (gained - still) / np.cos(aoa),
        "velocity_north": horizontal * np.cos(heading) + WIND[0],
        "velocity_east": horizontal * np.sin(heading) + WIND[1],
    }
    return {name: values[::fine] for name, values in found.items()}


def made_record(n: int = 121, *, start_s: float = 0.5, without: Collection[str] = (), airspeed: str = "tas") -> Record:
    """Return samples a second apart, without some of the channels."""
    time_s = start_s + np.arange(float(n))
    channels = channels_at(time_s)
    gained = channels["tas"] - channels["tas"][0]
    kept = {name: values for name, values in channels.items() if name not in without}
    kinematics = {"longitudinal_acc", "normal_acc", "aoa", "pitch", "roll"} <= kept.keys()
    return Record(time_s=time_s, channels=kept, gained=gained if kinematics else None, airspeed=airspeed)


def made_log(
    duration_s: float = 120.0, *, rate_hz: float = 10.0, start_s: float = 0.0, **more: np.ndarray
) -> FlightLog:
    """Return a log of the flight at a rate, with channels replaced or added."""
    time_s = start_s + np.arange(round(duration_s * rate_hz)) / rate_hz
    values = channels_at(time_s, fine=max(1, round(20 / rate_hz))) | more
    return log_of(time_s, values)


def log_of(time_s: np.ndarray, values: dict[str, np.ndarray]) -> FlightLog:
    """Return a log of channels."""
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=UNITS[name], source=name)
        for name, one in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=channels)


def ratio_of(scan: WindowScan, fault: str) -> LikelihoodRatio:
    """Return what the residuals of a window say of a fault."""
    k = scan.faults.index(fault)
    return replace(scan.ratios, shown=scan.ratios.shown[k], power=scan.ratios.power[k])
