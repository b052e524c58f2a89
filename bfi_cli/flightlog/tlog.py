"""MAVLink telemetry logs (.tlog): packets as a ground station received them, each after the time of its arrival.

Framing and check sum are those of the MAVLink guide ("Packet Serialization"), versions 1 and 2; payloads are those of
the messages below in common.xml and ardupilotmega.xml, fields in their order on the wire. Packets arrive in bursts, so
the time of a message is that of the autopilot's clock (`time_boot_ms`), or without one that of the message before it.
"""

from __future__ import annotations

import mmap
import os
import re
import struct
from bisect import bisect_right
from collections import Counter
from collections.abc import Collection, Mapping

import numpy as np

from ..notes import Note
from .axis import boot_starts
from .formats import ARRIVAL, V1, packet_length
from .raw import require_memory
from .topics import Topic, notes_on

HEARTBEAT = 0  # which a ground station sends too
# Number: name, layout, extra byte of the check sum, names of the fields.
MESSAGES: Mapping[int, tuple[str, struct.Struct, int, tuple[str, ...]]] = {
    number: (name, struct.Struct(f"<{layout}"), extra, tuple(fields.split()))
    for number, name, layout, extra, fields in (
        (HEARTBEAT, "HEARTBEAT", "I5B", 50, "custom_mode type autopilot base_mode system_status mavlink_version"),
        (2, "SYSTEM_TIME", "QI", 137, "unix_usec time_boot_ms"),
        (26, "SCALED_IMU", "I9h", 170, "time_boot_ms xacc yacc zacc xgyro ygyro zgyro xmag ymag zmag"),
        (29, "SCALED_PRESSURE", "I2fh", 115, "time_boot_ms press_abs press_diff temperature"),
        (30, "ATTITUDE", "I6f", 39, "time_boot_ms roll pitch yaw rollspeed pitchspeed yawspeed"),
        (32, "LOCAL_POSITION_NED", "I6f", 185, "time_boot_ms x y z vx vy vz"),
        (33, "GLOBAL_POSITION_INT", "I4i3hH", 104, "time_boot_ms lat lon alt relative_alt vx vy vz hdg"),
        (74, "VFR_HUD", "4fhH", 20, "airspeed groundspeed alt climb heading throttle"),
        (245, "EXTENDED_SYS_STATE", "2B", 130, "vtol_state landed_state"),
        (11020, "AOA_SSA", "Q2f", 205, "time_usec AOA SSA"),
    )
}
CLOCK = "time_boot_ms"
# Bytes of memory for a byte of the file at most: a packet of 48 bytes with its time of arrival takes 550 as objects.
TAKEN = 12


def checksum(data: bytes) -> int:
    """Return the CRC-16/MCRF4XX of MAVLink."""
    crc = 0xFFFF
    for byte in data:
        low = (byte ^ crc) & 0xFF
        low = (low ^ (low << 4)) & 0xFF
        crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    return crc


def read_tlog_topics(path: str, _names: Collection[str] = ()) -> tuple[list[Topic], list[Note]]:
    """Return the messages of `MESSAGES` of the sender with the most of them, and notes on the file.

    Raises
    ------
    LogError : memory does not hold the packets.
    """
    require_memory(path, TAKEN * os.path.getsize(path), "its packets", "cut the log")
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        packets, damaged = _packets(data)
    notes = notes_on(damaged)
    senders = Counter(sender for sender, number, _ in packets if number != HEARTBEAT)
    chosen = senders.most_common(1)[0][0] if senders else None
    if len(senders) > 1 and chosen is not None:
        notes.append(
            Note.method(
                f"messages of {len(senders)} senders; those of system {chosen[0]}, component {chosen[1]} are read"
            )
        )
    packets = [packet for packet in packets if packet[0] == chosen]
    # A payload ends before the zeros at its end.
    sizes = {number: layout.size for number, (_, layout, _, _) in MESSAGES.items()}
    padded = ((number, payload.ljust(sizes[number], b"\0")[: sizes[number]]) for _, number, payload in packets)
    decoded = [(number, MESSAGES[number][1].unpack(payload)) for number, payload in padded]
    clocked = {number for number, (_, _, _, fields) in MESSAGES.items() if fields[0] == CLOCK}
    clock = [1e-3 * values[0] for number, values in decoded if number in clocked]
    starts = boot_starts(np.array(clock)) if clock else [0]
    rows: dict[int, list[tuple[float, ...]]] = {}  # time, boot and values
    ticks, now = 0, None
    for number, values in decoded:
        if number in clocked:
            now = clock[ticks]
            ticks += 1
        # Messages without a clock that follow the same clocked message have one time: only the first is kept.
        several = rows.setdefault(number, [])
        if now is not None and (number in clocked or not several or several[-1][0] != now):
            several.append((now, bisect_right(starts, ticks - 1) - 1, *values))
    topics = []
    for number, several in rows.items():
        name, _, _, labels = MESSAGES[number]
        table = np.array(several, dtype=np.float64).reshape(-1, 2 + len(labels))
        fields = {label: table[:, i] for i, label in enumerate(labels, 2) if not label.startswith("time_")}
        boot = None if len(starts) == 1 else table[:, 1].astype(np.intp)
        if len(table):
            topics.append(Topic(name=name, instance=0, time_s=table[:, 0], fields=fields, boot=boot))
    return topics, notes


def _packets(data: mmap.mmap) -> tuple[list[tuple[tuple[int, int], int, bytes]], int]:
    """Return sender, number and payload of the valid packets of `MESSAGES`, and the number of damaged bytes."""
    packets, at, damaged, magic = [], 0, 0, re.compile(b"[\xfd\xfe]")
    while at < len(data):
        length = packet_length(data, at)
        if length is None or at + length > len(data):
            following = magic.search(data, at + ARRIVAL + 1)
            stop = len(data) if following is None else following.start() - ARRIVAL
            damaged += stop - at
            at = stop
            continue
        packet = data[at + ARRIVAL : at + length]
        if packet[0] == V1:
            head, sender, number = 6, (packet[3], packet[4]), packet[5]
        else:
            head, sender, number = 10, (packet[5], packet[6]), int.from_bytes(packet[7:10], "little")
        if number in MESSAGES:
            end = head + packet[1]
            extra = bytes([MESSAGES[number][2]])
            if checksum(packet[1:end] + extra) == int.from_bytes(packet[end : end + 2], "little"):
                packets.append((sender, number, packet[head:end]))
            else:
                damaged += length
        at += length
    return packets, damaged
