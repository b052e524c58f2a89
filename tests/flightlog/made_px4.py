"""A flight of a PX4 autopilot made up for the tests, as a folder of `ulog2csv` and as ULog."""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Topics = Mapping[tuple[str, int], Mapping[str, NDArray[np.number]]]
LENGTH_S, START_S = 60.0, 100.0


def tas(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return 20.0 + 2.0 * np.sin(0.5 * t)


def pitch(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return 0.1 * np.sin(0.8 * t)


def clock(rate_hz: float, *, jitter: float = 0.0, start_s: float = START_S, seed: int = 0) -> NDArray[np.uint64]:
    """Return microseconds at a rate, each off by up to `jitter` periods."""
    t = start_s + np.arange(round(LENGTH_S * rate_hz)) / rate_hz
    off = jitter * np.random.default_rng(seed).uniform(-1.0, 1.0, t.size) / rate_hz
    return np.round(1e6 * (t + off)).astype(np.uint64)


def px4_topics(*, rate_hz: float = 5.0, jitter: float = 0.0) -> dict[tuple[str, int], dict[str, NDArray[np.number]]]:
    """Return topics by name and instance; the airspeed is at `rate_hz`, attitude at 50 Hz, wind at 1 Hz."""
    speed, attitude = clock(rate_hz, jitter=jitter), clock(50.0, start_s=START_S + 0.004, jitter=jitter, seed=1)
    wind, status = clock(1.0, start_s=START_S - 0.3), clock(2.0)
    t, a = speed / 1e6, attitude / 1e6
    yaw = 3.0 + 0.02 * (a - START_S)  # through the end of its range after 7 s
    half = (np.zeros(a.size), pitch(a) / 2.0, yaw / 2.0)
    (cr, cp, cy), (sr, sp, sy) = map(np.cos, half), map(np.sin, half)
    quaternion = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return {
        ("airspeed_validated", 0): {
            "timestamp": speed,
            "true_airspeed_m_s": tas(t).astype(np.float32),
            "indicated_airspeed_m_s": (0.9 * tas(t)).astype(np.float32),
        },
        ("airspeed", 0): {
            "timestamp": wind,
            "true_airspeed_m_s": tas(wind / 1e6).astype(np.float32),
        },
        ("vehicle_attitude", 0): {
            "timestamp": attitude,
            **{f"q[{i}]": q.astype(np.float32) for i, q in enumerate(quaternion)},
        },
        ("vehicle_acceleration", 0): {
            "timestamp": attitude,
            "xyz[0]": (9.80665 * np.sin(pitch(a))).astype(np.float32),
            "xyz[1]": np.zeros(a.size, np.float32),
            "xyz[2]": np.full(a.size, -9.80665, np.float32),
        },
        ("actuator_controls_0", 0): {
            "timestamp": attitude,
            "control[0]": np.zeros(a.size, np.float32),
            "control[1]": (0.3 * np.sin(1.3 * a)).astype(np.float32),
            "control[2]": np.zeros(a.size, np.float32),
            "control[3]": np.full(a.size, 0.3, np.float32),
        },
        ("airspeed_wind", 0): {
            "timestamp": wind,
            "windspeed_north": (3.0 + 0.01 * np.arange(wind.size)).astype(np.float32),
            "windspeed_east": np.full(wind.size, np.nan, np.float32),
        },
        ("battery_status", 0): {"timestamp": status, "nav_state": np.ones(status.size, np.uint8)},
    }


def write_ulog2csv(folder: Path, topics: Topics, *, log: str = "flight") -> Path:
    """Write a file for each topic, as `ulog2csv` does."""
    folder.mkdir(exist_ok=True)
    for (name, instance), fields in topics.items():
        rows = zip(*(values.tolist() for values in fields.values()), strict=True)
        text = "".join(",".join(map(repr, row)) + "\n" for row in rows)
        (folder / f"{log}_{name}_{instance}.csv").write_text(",".join(fields) + "\n" + text)
    return folder


ULOG_TYPES = {"<u8": "uint64_t", "<f4": "float", "|u1": "uint8_t", "<f8": "double"}


def message(kind: str, body: bytes) -> bytes:
    """Return a message of a ULog."""
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog_bytes(topics: Topics, *, padding: int = 0, sync_every: int = 50) -> bytes:
    """Return a ULog of topics, messages in order of time; `padding` bytes stand in the formats but not in the data."""
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", int(1e6 * START_S)), message("B", bytes(40))]
    data: list[tuple[int, bytes]] = []
    added: list[bytes] = []
    for number, ((name, instance), fields) in enumerate(topics.items()):
        parts: dict[str, tuple[str, int]] = {}
        for label, values in fields.items():
            own, kind = re.sub(r"\[\d+\]$", "", label), ULOG_TYPES[values.dtype.str]
            parts[own] = (kind, parts.get(own, (kind, 0))[1] + (1 if label.endswith("]") else 0))
        text = "".join(f"{kind}[{n}] {own};" if n else f"{kind} {own};" for own, (kind, n) in parts.items())
        text += f"uint8_t[{padding}] _padding0;" if padding else ""
        out.append(message("F", f"{name}:{text}".encode()))
        added.append(message("A", struct.pack("<BH", instance, number) + name.encode()))
        table = np.rec.fromarrays(list(fields.values()), names=[f"f{i}" for i in range(len(fields))])
        data += [
            (int(when), message("D", struct.pack("<H", number) + row.tobytes()))
            for when, row in zip(fields["timestamp"], table, strict=True)
        ]
    out += added
    sync = message("S", b"\x2f\x73\x13\x20\x25\x0c\xbb\x12")
    for k, (_, one) in enumerate(sorted(data)):
        out += [sync, one] if k % sync_every == 0 else [one]
    return b"".join(out)


def write_ulog(path: Path, topics: Topics) -> Path:
    """Write a ULog and return its path."""
    path.write_bytes(ulog_bytes(topics))
    return path
