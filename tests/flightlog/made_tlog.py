"""A telemetry log of MAVLink made up for the tests; packets arrive in bursts of half a second."""

from __future__ import annotations

import math

import numpy as np

from bfi_cli.flightlog.tlog import MESSAGES, checksum

NUMBERS = {name: number for number, (name, *_) in MESSAGES.items()}


def packet(
    arrival_s: float, name: str, *values: float, version: int = 2, system: int = 1, signed: bool = False
) -> bytes:
    """Return a packet behind its time of arrival; version 2 leaves zeros at the end out."""
    number = NUMBERS[name]
    _, layout, extra, _ = MESSAGES[number]
    payload = layout.pack(*values)
    if version == 2:
        payload = payload[:1] + payload[1:].rstrip(b"\0")
        head = bytes((0xFD, len(payload), int(signed), 0, 7, system, 1)) + number.to_bytes(3, "little")
    else:
        head = bytes((0xFE, len(payload), 7, system, 1, number))
    crc = checksum(head[1:] + payload + bytes([extra]))
    tail = crc.to_bytes(2, "little") + (bytes(13) if signed else b"")
    return round(1e6 * (1.7e9 + arrival_s)).to_bytes(8, "big") + head + payload + tail


def tlog_bytes(*, version: int = 2, length_s: float = 40.0, hovers_s: float | None = None) -> bytes:
    """Return a log of an airspeed at 4 Hz and an attitude at 8 Hz.

    Parameters
    ----------
    hovers_s : until when a quadplane loiters on its rotors; its heartbeat and that of a ground station are at 2 Hz.
    """
    out = []
    for k in range(round(8 * length_s)):
        t = k / 8.0
        arrival = math.ceil(2.0 * t) / 2.0 + 1e-4 * (k % 4)
        pitch = 0.1 * float(np.sin(0.8 * t))
        out.append(packet(arrival, "ATTITUDE", round(1000 * t) + 5000, 0.0, pitch, 3.0, 0.0, 0.0, 0.0, version=version))
        if hovers_s is not None and k % 4 == 0:
            mode = 19 if t < hovers_s else 10
            out += [packet(arrival, "HEARTBEAT", mode, 1, 3, 0, 4, 3, system=system) for system in (1, 255)]
        if k % 2 == 0:
            speed = 20.0 + 2.0 * float(np.sin(0.5 * t))
            out.append(packet(arrival, "VFR_HUD", speed, 19.0, 100.0, 0.0, 90, 50, version=version))
    return b"".join(out)
