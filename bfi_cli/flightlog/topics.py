"""Which fields of a recorder's messages, or columns of its tables, are channels, and under which names.

One table, `recorders.txt`, serves every recorder, those whose messages have separate clocks and those that write tables
(`layouts`); signs and conventions are those of `bfi_cli.quantities.channels`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from ..epoch import Epoch, epoch_of_clock, utc_of_gps
from ..errors import LogError
from ..notes import Note
from ..quantities.channels import DEGREE, REPEATED, STANDARD
from .raw import FloatArray, RawLog, ReadRequest
from .record import Track

Recorder = Literal[
    "px4", "ardupilot", "mavlink", "garmin", "dynon", "xplane", "inav", "flightgear", "igc", "dashlink", "sidpac"
]
# Fields that hold UTC: microseconds since 1970 (PX4, and SYSTEM_TIME of MAVLink), or weeks and ms of GPS (ArduPilot).
UTC = frozenset({"time_utc_usec", "unix_usec", "GWk", "GMS"})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Topic:
    """The messages of one kind: times in seconds, and (n_messages,) values of each field in the recorder's unit.

    Attributes
    ----------
    name : of the kind; instance : number of the sensor that sent the messages, 0 for the first.
    boot : (n_messages,) number of restarts of the recorder's clock before each message, None where there is none.
    """

    name: str
    instance: int
    time_s: FloatArray
    fields: Mapping[str, NDArray[np.number]]
    boot: NDArray[np.intp] | None = None

    def part(self, keep: NDArray[np.bool_]) -> Topic:
        """Return the messages where `keep` is true."""
        fields = {name: values[keep] for name, values in self.fields.items()}
        boot = None if self.boot is None else self.boot[keep]
        return replace(self, time_s=self.time_s[keep], fields=fields, boot=boot)

    @property
    def label(self) -> str:
        """The prefix of a field's name: "airspeed", "airspeed_1" for the second sensor."""
        return self.name if self.instance == 0 else f"{self.name}_{self.instance}"


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """A field of a topic that is a standard channel: `scale * value + offset` is it, in `unit`.

    `channel` is "" of a field that is none, though another recorder's channel has its name.
    """

    topic: str
    field: str
    channel: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0


# Quantities whose topics have an instance for each sensor; instances of attitude and climb are cores of one estimator.
SENSED = frozenset(REPEATED) - {"pitch", "roll", "yaw", "altitude_rate", "gps_altitude_rate"}
# By recorder its name, and the rows of its table.
RECORDERS: dict[Recorder, str] = {}
_MAPS: dict[Recorder, list[ChannelMap]] = {}
for _line in Path(__file__).with_name("recorders.txt").read_text("utf-8").splitlines():
    _place, *_words = _line.split() or ["#"]
    if _place.startswith("["):
        _recorder = cast(Recorder, _place.strip("[]"))
        RECORDERS[_recorder], _MAPS[_recorder] = " ".join(_words), []
    elif _place != "#":
        _channel, _unit, *_numbers = _words
        _topic, _, _field = _place.partition(".")
        _scales = (float(Fraction(_number)) for _number in _numbers)
        _MAPS[_recorder].append(ChannelMap(_topic, _field, _channel.strip("-"), _unit, *_scales))


def maps_of(recorder: Recorder) -> tuple[ChannelMap, ...]:
    """Return the fields of a recorder that are standard channels, the better source of a channel first."""
    return tuple(_MAPS[recorder])


def fields_of(recorder: Recorder) -> dict[str, tuple[str, ...]]:
    """Return the fields to read of a recorder's topics, by topic."""
    fields: dict[str, tuple[str, ...]] = {}
    for row in _MAPS[recorder]:
        fields[row.topic] = (*fields.get(row.topic, ()), row.field)
    return fields


def topics_of(sources: Iterable[str]) -> set[str]:
    """Return the topics of fields `topic.field`, each also without the number of a sensor behind its name."""
    labels = {source.partition(".")[0] for source in sources if "." in source}
    return labels | {re.sub(r"_\d+$", "", label) for label in labels}


def notes_on(damaged: int, empty: Sequence[str] = ()) -> list[Note]:
    """Return the notes on a file with `damaged` bytes and `empty` topics, none where it has neither."""
    notes = [Note.limit(f"{damaged} bytes are damaged or cut off and were skipped")] if damaged else []
    if empty:
        notes.append(Note.method(f"topics without samples are left out: {', '.join(dict.fromkeys(empty))}"))
    return notes


def completed(topic: Topic) -> Topic:
    """Return a topic with further fields that follow from its fields.

    `roll`, `pitch` and `yaw`, rad, sequence 3-2-1, from the quaternion `q[0..3]`, scalar first, body to
    north-east-down; `VelN` and `VelE` from the speed `Spd` on the course `GCrs`, degrees from north; `hover` from the
    state of a VTOL.
    """
    made: dict[str, NDArray[np.number]] = {}
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        if all(f"q[{i}]" in topic.fields for i in range(4)):
            q = np.array([topic.fields[f"q[{i}]"] for i in range(4)], dtype=np.float64)
            w, x, y, z = q / np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
            made |= {
                "roll": np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x**2 + y**2)),
                "pitch": np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
                "yaw": np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)),
            }
        if {"Spd", "GCrs"} <= topic.fields.keys():
            course = DEGREE * np.asarray(topic.fields["GCrs"], dtype=np.float64)
            made |= {"VelN": topic.fields["Spd"] * np.cos(course), "VelE": topic.fields["Spd"] * np.sin(course)}
        hover = _hover_of(topic)
        if hover is not None and hover.any():
            made["hover"] = hover
    return replace(topic, fields={**topic.fields, **made})


def _hover_of(topic: Topic) -> FloatArray | None:
    """Return (n_messages,) 1 where the rotors of a VTOL carry it, 0.5 in transition, else 0; None where nothing tells.

    PX4: `vehicle_vtol_state` (1.14 on) and `vtol_state` of MAVLink are MAV_VTOL_STATE: 1 and 2 transition, 3 hover,
    4 flight on the wing; before, two flags; a `vehicle_type` of 1 is one carried by rotors. ArduPlane: modes 17 to 23
    (QSTABILIZE to QACRO); a quadplane writes QTUN while its rotors carry it, and only then.
    """
    fields = topic.fields
    for name in ("vehicle_vtol_state", "vtol_state"):
        if name in fields:
            return np.select([fields[name] == 3, np.isin(fields[name], (1, 2))], [1.0, 0.5], 0.0)
    for hovers, changes in (("vtol_in_rw_mode", "vtol_in_trans_mode"), ("vehicle_type", "in_transition_mode")):
        if {hovers, changes} <= fields.keys():
            is_vtol = fields.get("is_vtol", np.ones(1)) != 0
            return np.where(is_vtol, np.select([fields[changes] != 0, fields[hovers] == 1], [0.5, 1.0], 0.0), 0.0)
    if {"custom_mode", "type", "autopilot"} <= fields.keys():
        is_plane = (fields["autopilot"] == 3) & np.isin(fields["type"], (1, *range(19, 26)))
        return np.where(is_plane & (fields["custom_mode"] >= 17) & (fields["custom_mode"] <= 23), 1.0, 0.0)
    return np.ones(topic.time_s.size) if topic.name == "QTUN" else None


def _epoch_of(topics: Sequence[Topic]) -> Epoch | None:
    """Return from when the times of the messages count, as a satellite receiver tells it; None where none does."""
    for topic in topics:
        fields = {name: np.asarray(values, dtype=np.float64) for name, values in topic.fields.items() if name in UTC}
        if microseconds := fields.keys() & {"time_utc_usec", "unix_usec"}:
            moments_s = 1e-6 * fields[microseconds.pop()]
        elif {"GWk", "GMS"} <= fields.keys():
            moments_s = utc_of_gps(fields["GWk"], 1e-3 * fields["GMS"])
        else:
            continue
        if (epoch := epoch_of_clock(moments_s, topic.time_s, is_utc=True, is_dated=True)) is not None:
            return epoch
    return None


def tracks_of(recorder: Recorder, topics: Sequence[Topic], wanted: Sequence[str]) -> list[Track]:
    """Return the signals of a log; of several sources of a channel the preferred comes first.

    The second sensor of `tas` is `tas_2`.

    Parameters
    ----------
    wanted : further fields, as `topic.field`, that become signals under that name.
    """

    def mapped() -> Iterator[Track]:
        for row in _MAPS[recorder]:
            sources = [topic for topic in topics if topic.name == row.topic and row.field in topic.fields]
            for number, topic in enumerate(sorted(sources, key=lambda topic: topic.instance), start=1):
                further = f"{row.channel}_{number}"
                is_sensor = number > 1 and row.channel in SENSED and further in STANDARD
                with np.errstate(over="ignore", invalid="ignore"):
                    values = row.scale * np.asarray(topic.fields[row.field], dtype=np.float64) + row.offset
                yield Track(
                    source=f"{topic.label}.{row.field}",
                    channel=further if is_sensor else row.channel,
                    unit=row.unit,
                    time_s=topic.time_s,
                    values=values,
                    why=f"by the table of {RECORDERS[recorder]}",
                    unit_from=f"table of {RECORDERS[recorder]}",
                )

    tracks = list(mapped())
    have = {track.source for track in tracks}
    for topic in topics:
        for name, values in topic.fields.items():
            source = f"{topic.label}.{name}"
            if source in wanted and source not in have:
                tracks.append(Track(source=source, time_s=topic.time_s, values=np.asarray(values, dtype=np.float64)))
    return tracks


def log_of_topics(
    path: str,
    recorder: Recorder,
    topics: Sequence[Topic],
    asked: ReadRequest,
    *,
    more: Sequence[str] = (),
    notes: Sequence[Note] = (),
) -> RawLog:
    """Return the log of a recorder whose messages have separate clocks.

    Parameters
    ----------
    more : fields, as `topic.field`, that become signals beside the channels and the fields in `asked`.
    notes : on the topics.

    Raises
    ------
    LogError : no signals.
    """
    parts = [topics]
    boots = sorted({int(k) for topic in topics if topic.boot is not None for k in np.unique(topic.boot)})
    if len(boots) > 1:
        parts = [[t if t.boot is None else t.part(t.boot == boot) for t in topics] for boot in boots]
        parts = [[topic for topic in part if topic.time_s.size > 1] for part in parts]
    wanted = (*asked.sources, *more)
    logs = []
    for part in parts:
        epoch = _epoch_of(part)
        tracks = tracks_of(recorder, [completed(topic) for topic in part], wanted)
        if tracks:
            logs.append(RawLog(columns=[replace(track, epoch=epoch) for track in tracks], notes=tuple(notes)))
    if not logs:
        has = ", ".join(topic.label for topic in topics) or "none"
        raise LogError(f"{path}: no channels in its messages ({has}); give a log that was recorded in flight")
    return logs[0] if len(parts) == 1 else replace(logs[0], boots=tuple(logs))
