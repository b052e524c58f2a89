"""The signals of a file as read, under their own names and units, and the checks that all formats share."""

from __future__ import annotations

import contextlib
import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..epoch import Epoch
from ..errors import DictionaryError, LogError, first_line
from ..faults import Fault, fault_from_dict, fault_to_dict
from ..faults.filters import Filter, filters_from_json, filters_to_json
from ..notes import Note
from ..quantities.channels import STANDARD, NameMatch, match_name, si_unit, to_si
from .record import FlightLog, Segment, Track

if TYPE_CHECKING:
    from ..faults.ordinary import Occurrence

FloatArray = NDArray[np.float64]
# First and last time of the wanted window, None for an end of the log.
Span = tuple[float | None, float | None]
T = TypeVar("T")

# Limit of a log's channels as float64, bytes: assembling holds them twice, which fits into 8 GB.
LARGEST = 4 * 10**9
# Limit of a chunk of HDF5 or MCAP, bytes: it is unpacked whole. Writers that choose its size take up to 4 MiB.
LARGEST_CHUNK = 2**28
BESIDE_TIME = "holds dates or times beside the time axis"
# Angles that wrap around.
ANGLES = frozenset({"roll", "yaw", "longitude", "track", "magnetic_track"})
# Discrete states: held from sample to sample, never interpolated or filtered.
FLAGS = frozenset({"valid_airspeed", "hover", "gear"})
# Limit of the channels of a file; the largest recorders have about 4000 parameters.
MOST_CHANNELS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadRequest:
    """What the user states about a file, see `read.read_log`."""

    group: str | None = None
    channel_map: Mapping[str, str] = field(default_factory=dict)
    unit_map: Mapping[str, str] = field(default_factory=dict)
    span: Span = (None, None)
    sample_rate_hz: float | None = None
    columns: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()

    @property
    def sources(self) -> tuple[str, ...]:
        """Names in the file that the options mention; these signals are read even if they are no standard channels."""
        return (*self.channel_map.values(), *self.unit_map, *self.keep)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawLog:
    """One file as read, from `first_sample` on.

    Attributes
    ----------
    columns : of one length and time axis, or with separate clocks, which `rates.on_one_clock` merges.
    faults : the injected faults of /truth, None without /truth; clean : by channel the signals without them;
        ordinary : the ordinary causes of /truth.
    left_out : by name why an array is no channel, "holds text", and behind a semicolon the remedy.
    boots : the parts between restarts of the clock, where the format states them.
    """

    columns: Sequence[Track]
    sample_rate_hz: float | None = None
    first_sample: int = 0
    segments: tuple[Segment, ...] = ()
    filters: tuple[Filter, ...] | None = None
    faults: tuple[Fault, ...] | None = None
    ordinary: tuple[Occurrence, ...] = ()
    clean: Mapping[str, Track] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    boots: tuple[RawLog, ...] = ()


def by_precedence(columns: Sequence[Track], asked: ReadRequest) -> list[tuple[Track, NameMatch | None]]:
    """Pair columns with their standard names; of several columns for one name the preferred comes first."""
    wanted = {source: name for name, source in asked.channel_map.items()}

    def pairs() -> Iterator[tuple[Track, NameMatch | None]]:
        for column in {column.source: column for column in columns}.values():
            match = match_name(column.source)
            if column.channel is not None:
                match = NameMatch(name=column.channel, unit=None, rank=0) if column.channel else None
            if column.source in wanted:
                match = NameMatch(name=wanted[column.source], unit=match.unit if match else None, rank=-1)
            yield column, match

    return sorted(pairs(), key=lambda pair: pair[1].rank if pair[1] else 9)


# Why a column is a channel, by the rank of its match.
BY_RANK = {
    -1: "as --channel states",
    0: "the standard name",
    1: "the standard name but for case",
    2: "an alias",
    3: "an alias with a unit behind it",
}


def why_matched(column: Track, match: NameMatch | None) -> str:
    """Return why a column is the channel that it matches, or why it is no standard channel."""
    if match is None:
        return column.why or "no known name"
    return BY_RANK[match.rank] if match.rank < 0 else column.why or BY_RANK[match.rank]


def unit_source(column: Track, match: NameMatch | None, asked: ReadRequest) -> str:
    """Return where the unit of a column is stated, see `unit_of`; "" for nowhere."""
    if asked.unit_map.get(column.source) or (match is not None and asked.unit_map.get(match.name)):
        return "--unit"
    if column.unit is not None:
        return column.unit_from
    return "its name" if match is not None and match.unit is not None else ""


def unit_of(column: Track, match: NameMatch | None, asked: ReadRequest) -> str | None:
    """Return the unit of a column: stated by the user, else by the file, else by its name ("tas_kt")."""
    given = asked.unit_map.get(column.source) or (asked.unit_map.get(match.name) if match else None)
    return given or (column.unit if column.unit is not None else match.unit if match else None)


def claimed(tracks: Sequence[Track], asked: ReadRequest) -> list[Track]:
    """Return signals with the standard channel of each, see `by_precedence`, and the full turn of angles that wrap."""
    made = []
    for track, match in by_precedence(tracks, asked):
        channel, unit, turn = match.name if match else track.channel, unit_of(track, match, asked), None
        if channel in ANGLES:
            turn = 2.0 * math.pi / (float(to_si(1.0, unit)[0]) if unit and si_unit(unit) == "rad" else 1.0)
        why, unit_from = why_matched(track, match), unit_source(track, match, replace(asked, unit_map={}))
        unit = track.unit or (match.unit if match else None)
        made.append(replace(track, channel=channel, unit=unit, turn=turn, why=why, unit_from=unit_from))
    return made


def fits(name: str, unit: str | None) -> bool:
    """Say whether a standard channel can have a unit; an unknown unit, or none, always fits."""
    known = si_unit(unit) if unit else None
    return known is None or known in (STANDARD[name].unit, "1") or STANDARD[name].unit == "1"


def time_column(columns: Sequence[Track], asked: ReadRequest) -> Track | None:
    """Return the column that is the time axis, with its unit; None where there is none."""
    for column, match in by_precedence(columns, asked):
        if match is not None and match.name == "time":
            stated = unit_of(column, match, asked)
            if match.rank < 0 or fits("time", stated):
                return replace(column, unit=stated)
    return None


def unlike(kind: str, shape: tuple[int, ...]) -> str | None:
    """Return why an array of this numpy kind and shape is no signal; None of a vector, a row or a column of numbers."""
    if kind in "SU":
        return "holds text"
    if 0 in shape:
        return "is empty"
    if kind not in "fiub":
        return "holds complex numbers" if kind == "c" else "holds no numbers"
    long = sum(n > 1 for n in shape)
    if long == 0:
        return "is a single number"
    table = f"is a table of {' x '.join(map(str, shape))} ({len(shape)}-D)"
    return None if long == 1 else f"{table}; give each column a dataset of its own"


def unlike_time(name: str, n: int, n_times: int) -> str:
    """Return why a channel of so many samples is left out of a log of another number of times."""
    return f"has {n} samples, the time axis {n_times},; keep it with --keep {name}"


def most_common(lengths: Iterable[int]) -> int:
    """Return the length that most channels have, of several the longest."""
    counts = Counter(lengths)
    return max(counts, key=lambda length: (counts[length], length))


def different_length(path: str, name: str, n: int, n_times: int) -> LogError:
    """Return the error of a channel that does not fit the time axis."""
    return LogError(
        f"{path}: '{name}' has {n} samples, the time axis {n_times}; give all one time axis, or spread it with "
        f"--keep {name}"
    )


def require_few(path: str, count: int, what: str) -> None:
    """Check the number of channels, columns or variables of a file, which `what` names.

    Raises
    ------
    LogError : more than `MOST_CHANNELS`.
    """
    if count > MOST_CHANNELS:
        raise LogError(f"{path}: {count} {what}, the limit is {MOST_CHANNELS}; export fewer channels")


def require_memory(path: str, n_bytes: float, what: str, advice: str) -> None:
    """Check that `what` fits into memory.

    Raises
    ------
    LogError : more bytes than `LARGEST`.
    """
    if n_bytes > LARGEST:
        limit = f"the limit is {LARGEST / 1e9:.0f} GB"
        raise LogError(f"{path}: {what} need {n_bytes / 1e9:.1f} GB of memory, {limit}; {advice}")


def require_size(path: str, n_bytes: int, advice: str) -> None:
    """Check the size of the messages of a file, before any is read.

    Raises
    ------
    LogError : more bytes than `LARGEST`. The file system of a recorder's card has no larger files (FAT32: 4 GiB).
    """
    if n_bytes > LARGEST:
        raise LogError(f"{path}: {n_bytes / 1e9:.1f} GB of messages, the limit is {LARGEST / 1e9:.0f} GB; {advice}")


@contextlib.contextmanager
def parsing(path: str, what: str, advice: str = "export it again") -> Iterator[None]:
    """Report any exception of another library's parser as damage of the file.

    Raises
    ------
    LogError : the parser failed.
    """
    try:
        yield
    except (LogError, MemoryError):
        raise
    except Exception as error:
        raise LogError(f"{path}: damaged or truncated {what}, {first_line(error)}; {advice}") from None


def number_of(stated: object) -> float | None:
    """Return a number that a file states, None for anything else."""
    return float(stated) if isinstance(stated, int | float | np.integer | np.floating) else None


def rate_of(path: str, stated: object) -> float:
    """Return the sample_rate_hz that a file states.

    Raises
    ------
    LogError : `stated` is no number.
    """
    if (rate_hz := number_of(stated)) is None:
        raise LogError(f"{path}: sample_rate_hz is no number, got {str(stated)[:40]!r}; mend it")
    return rate_hz


def choose_group(path: str, wanted: str | None, groups: Sequence[str], *, has_signals: bool) -> str | None:
    """Return the group (or struct) to read: the wanted group, None for the root, or the only group.

    Raises
    ------
    LogError : the wanted group does not exist, or no group of several is wanted, or nothing holds signals.
    """
    listed = ", ".join(groups) or "none"
    if wanted is not None:
        if wanted.strip("/") not in groups:
            raise LogError(f"{path}: no group '{wanted}'; the file has: {listed}; give one of them with --group")
        return wanted.strip("/")
    if has_signals:
        return None
    if len(groups) > 1:
        raise LogError(f"{path}: several groups: {listed}; give one of them with --group")
    if not groups:
        raise LogError(f"{path}: no signals, got no array of more than one number; give a log with a channel each")
    return groups[0]


# What a file states of a log beside its channels, each a text under its key: in HDF5 an attribute, the last two of the
# group `truth`; in CSV a comment `# KEY: TEXT`.
ATTRIBUTES, TRUTH_KEYS = ("filters", "clock", "segments"), ("faults", "ordinary")
KEYS = (*ATTRIBUTES, *TRUTH_KEYS)


def annotations_of(log: FlightLog, names: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of a log by key, those of which it has any.

    Parameters
    ----------
    names : of its channels in the file.
    """
    texts = {}
    if log.filters is not None:
        texts["filters"] = filters_to_json(log.filters)
    if log.epoch is not None:
        texts["clock"] = log.epoch.iso
    if log.segments:
        entries = [{"label": s.label, "t_start": s.start_s, "t_end": s.stop_s, "note": s.note} for s in log.segments]
        texts["segments"] = json.dumps(entries)
    if log.truth is not None:
        faults = (replace(fault, channel=names.get(fault.channel, fault.channel)) for fault in log.truth.faults)
        known = [{key: value for key, value in fault_to_dict(fault).items() if value is not None} for fault in faults]
        texts["faults"] = json.dumps(known)
        if log.truth.ordinary:
            texts["ordinary"] = json.dumps([asdict(occurrence) for occurrence in log.truth.ordinary])
    return texts


def annotated(log: RawLog, texts: Mapping[str, str], *, where: str, truth: str = "") -> RawLog:
    """Return a log as read with what its file states of it.

    Parameters
    ----------
    texts : by key; without faults the log carries no truth.
    where : the file, and truth : the place in it of the truth, for messages.

    Raises
    ------
    LogError : a text is not what its key asks for.
    """
    columns = log.columns
    try:
        epoch = Epoch.from_iso(texts.get("clock", "").strip())
        columns = [replace(column, epoch=epoch) if column.source == "time" else column for column in columns]
    except ValueError:  # an attribute of another program
        pass
    has_truth = "faults" in texts

    def entries(key: str, make: Callable[..., T], needs: str, **given: str) -> tuple[T, ...]:
        at = f"{where}: {truth * (key in TRUTH_KEYS)}{key}"
        return _entries(texts.get(key) or "[]", at, partial(make, **given), needs)

    fault_place = f"{where}: {truth}faults"
    return replace(
        log,
        columns=columns,
        segments=entries("segments", _segment, "a segment needs the numbers t_start and t_end"),
        filters=filters_from_json(texts["filters"], where=f"{where}: filters") if "filters" in texts else None,
        faults=entries("faults", fault_from_dict, "a fault needs a shape", where=fault_place) if has_truth else None,
        ordinary=entries("ordinary", _occurrence, "it needs cause, and the numbers at_s and size") if has_truth else (),
    )


def _segment(entry: Mapping[str, Any]) -> Segment:
    words = {key: str(entry.get(key, "")) for key in ("label", "note")}
    return Segment(start_s=float(entry["t_start"]), stop_s=float(entry["t_end"]), **words)


def _occurrence(entry: Mapping[str, Any]) -> Occurrence:
    from ..faults.ordinary import Occurrence

    return Occurrence(cause=str(entry["cause"]), at_s=float(entry["at_s"]), size=float(entry["size"]))


def _entries(text: str, where: str, make: Callable[[Mapping[str, Any]], T], needs: str) -> tuple[T, ...]:
    """Return what is made of each object of a JSON list."""
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise LogError(f"{where}: not JSON, {first_line(error)}; mend the file") from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise LogError(f"{where}: not a JSON list of objects; mend the file")
    made = []
    for entry in entries:
        try:
            made.append(make(entry))
        except DictionaryError as error:
            raise LogError(str(error)) from None
        except (KeyError, TypeError, ValueError, OverflowError):
            raise LogError(f"{where}: {needs}, got {str(entry)[:80]}; mend the file") from None
    return tuple(made)
