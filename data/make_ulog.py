"""Write a log of `bfi simulate` as the ULog that a PX4 autopilot would have made: make_ulog.py LOG.h5 OUT.ulg."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from bfi_cli.flightlog import read_log

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "flightlog"))
from made_px4 import START_S, write_ulog

# Each topic has a rate and a clock of its own, as autopilots have; a control of 1 is a full deflection.
SPEED_HZ, ATTITUDE_HZ, LATE_S = 10.0, 25.0, 0.007
FULL_DEFLECTION = 0.35  # rad

log = read_log(sys.argv[1])


def at(name: str, time_s: np.ndarray) -> np.ndarray:
    return np.interp(time_s, log.time_s, log.channel(name).values).astype(np.float32)


def stamps(time_s: np.ndarray) -> np.ndarray:
    return np.round(1e6 * (START_S + time_s)).astype(np.uint64)


end_s = log.time_s[-1] - LATE_S
speed, attitude = (np.arange(0.0, end_s, 1.0 / rate) for rate in (SPEED_HZ, ATTITUDE_HZ))
pitch, zero = at("pitch", attitude + LATE_S), np.zeros(attitude.size, np.float32)
write_ulog(
    Path(sys.argv[2]),
    {
        ("airspeed_validated", 0): {"timestamp": stamps(speed), "true_airspeed_m_s": at("tas", speed)},
        ("vehicle_attitude", 0): {
            "timestamp": stamps(attitude + LATE_S),
            "q[0]": np.cos(pitch / 2),
            "q[1]": zero,
            "q[2]": np.sin(pitch / 2),
            "q[3]": zero,
        },
        ("vehicle_angular_velocity", 0): {
            "timestamp": stamps(attitude + LATE_S),
            "xyz[0]": zero,
            "xyz[1]": at("pitch_rate", attitude + LATE_S),
            "xyz[2]": zero,
        },
        ("actuator_controls_0", 0): {
            "timestamp": stamps(attitude),
            "control[0]": zero,
            "control[1]": -at("elevator", attitude) / np.float32(FULL_DEFLECTION),
            "control[2]": zero,
            "control[3]": np.full(attitude.size, 0.5, np.float32),
        },
    },
)
