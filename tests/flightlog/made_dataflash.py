"""A flight of ArduPilot made up for the tests, as a DataFlash log."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

LENGTH_S = 40.0
STRUCT = {"Q": "Q", "B": "B", "f": "f", "c": "h", "L": "i", "I": "I", "N": "16s", "g": "e", "h": "h"}
# Message: type, letters, names, rate in Hz.
KINDS = {
    "ARSP": (1, "QBff", "TimeUS,I,Airspeed,DiffPress", 10.0),
    "ATT": (2, "Qccc", "TimeUS,Roll,Pitch,Yaw", 25.0),
    "IMU": (3, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", 50.0),
    "AETR": (4, "Qfff", "TimeUS,Ail,Elev,Thr", 25.0),
    "GPS": (5, "QBLLff", "TimeUS,I,Lat,Lng,Spd,GCrs", 5.0),
    "MODE": (6, "QBN", "TimeUS,Mode,Name", 1.0),
}


def airspeed(t: float) -> float:
    return 20.0 + 2.0 * float(np.sin(0.5 * t))


def values_of(name: str, t: float) -> tuple[object, ...]:
    """Return what a message says at a time, without it."""
    pitch = 0.1 * float(np.sin(0.8 * t))
    return {
        "ARSP": (0, airspeed(t), 0.6 * airspeed(t) ** 2),
        "ATT": (0, round(100.0 * np.rad2deg(pitch)), 35_900 - 36_000 if t < 20.0 else 100),
        "IMU": (0, 0.0, 0.08 * float(np.cos(0.8 * t)), 0.0, 9.8 * pitch, 0.0, -9.80665),
        "AETR": (0.0, 4500.0 * 0.3 * float(np.sin(1.3 * t)), 40.0),
        "GPS": (0, 520_000_000, -50_000_000, 25.0, 90.0),
        "MODE": (1, b"AUTO"),
    }[name]


def fmt(kind: int, name: str, letters: str, names: str) -> bytes:
    """Return the message that describes a kind of message."""
    length = 3 + struct.calcsize("<" + "".join(STRUCT[letter] for letter in letters))
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name.encode(), letters.encode(), names.encode())


def dataflash_bytes(only: Sequence[str] = tuple(KINDS)) -> bytes:
    """Return a log of the kinds of messages that are named, in order of time."""
    out = [FMT_OF_FMT]
    messages: list[tuple[int, bytes]] = []
    for name in only:
        kind, letters, names, rate = KINDS[name]
        out.append(fmt(kind, name, letters, names))
        layout = "<" + "".join(STRUCT[letter] for letter in letters)
        for k in range(round(LENGTH_S * rate)):
            t = 10.0 + k / rate
            body = struct.pack(layout, round(1e6 * t), *values_of(name, t))
            messages.append((round(1e6 * t), bytes((0xA3, 0x95, kind)) + body))
    return b"".join([*out, *(body for _, body in sorted(messages, key=lambda one: one[0]))])


FMT_OF_FMT = b"\xa3\x95\x80" + struct.pack(
    "<BB4s16s64s", 0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"
)
