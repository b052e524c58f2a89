"""HDF5 logs, and MATLAB v7.3 files, which are HDF5 with transposed arrays and structs as groups.

The look-ups of h5py (`in`, `get`, `[]`) follow every link, also into other files. Therefore the kind of each link is
checked before it is followed, and storage, kind and size of a dataset before its values are read.
"""

from __future__ import annotations

import contextlib
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import LogError
from ..notes import Note
from ..quantities.channels import si_unit, to_si
from ..quantities.text import instant
from . import raw
from .raw import ATTRIBUTES, LARGEST, LARGEST_CHUNK, TRUTH_KEYS, FloatArray, RawLog, ReadRequest, annotated
from .record import CLEAN, Track, nothing_between

if TYPE_CHECKING:
    import h5py

TRUTH = "truth"
LONGEST_UNIT = 80  # characters of MATLAB's text, which is an array of numbers like any other
# Bytes up to which a log is read whole even if a window is wanted, so that filters and the clocks of held channels use
# the samples around it. A day at 100 Hz in 14 channels.
WHOLE = 10**9
# Bytes up to which all channels are read at once; a channel of a larger log is read when an analysis needs it.
READ_AT_ONCE = 2 * 10**8
MOST_LINKS = 100  # followed for one name; a log needs one or two, a loop never ends
MOST_PACKED = 1032  # deflate, the tightest of HDF5's usual filters, packs at most as many bytes into one
LARGEST_ATTRIBUTE = 2**24  # bytes; a unit takes ten, a list of a thousand segments 100 000
DAMAGED = ("HDF5 file", "copy or export it again")
# WRITTEN: the library's errors where a file's writer has locked it or marked it open (superblock 3, SWMR).
WRITTEN = ("unable to lock file", "file is already open for write")
# Attributes of a parameter of FlightDataAccessor, and its name of the calibrated airspeed.
FREQUENCY, OFFSET, COMPUTED = "frequency", "supf_offset", "Airspeed"
OWN_DATA = "a log must hold its own data, copy it into the file"


# A signal that is not read yet, and the dataset with its values.
_Signal = tuple[Track, "h5py.Dataset"]


def _values(data: h5py.Dataset, rows: slice) -> FloatArray:
    """Return the samples of these rows, along the only axis that is longer than 1."""
    place = tuple(rows if n > 1 else 0 for n in data.shape)
    return np.ravel(data[place]).astype(np.float64, copy=False)


def _read_later(path: str, track: Track, data: h5py.Dataset, rows: slice) -> Track:
    """Return these rows of a signal, which are read from its file when they are asked for."""
    place = data.name

    def read(rows: slice) -> FloatArray:
        with _opened(path) as file:  # which may also have changed since
            return _values(file[place], rows)

    return replace(track, read=read, rows=slice(rows.start, min(rows.stop, data.size)))


def read_hdf5(path: str, asked: ReadRequest) -> RawLog:
    """Read an HDF5 or MATLAB v7.3 log; of a large log only the samples in and beside the wanted window.

    Raises
    ------
    LogError : truncated or damaged, being written, no signals, no such group, data in other files, more than memory
        holds.
    """
    with _opened(path) as file:
        return _read(path, file, asked)


@contextlib.contextmanager
def _opened(path: str) -> Iterator[h5py.File]:
    """Open a file to read it; what fails while it is open is damage of the file.

    Raises
    ------
    LogError : damaged, or another process writes it.
    """
    import h5py

    with raw.parsing(path, *DAMAGED):
        try:
            file = h5py.File(path, "r")
        except OSError as error:
            if any(words in str(error) for words in WRITTEN):
                raise LogError(
                    f"{path}: is being written by another program, or that has ended without closing it; close it there"
                    f", or mend the file with h5clear -s {path}"
                ) from None
            raise
        with file:
            yield file


def _read(path: str, file: h5py.File, asked: ReadRequest) -> RawLog:
    import h5py

    root = dict(_members(path, file))
    truth = root.pop(TRUTH, None)
    signals, unlike = _signals(path, root)
    groups = [
        name
        for name, node in root.items()
        if isinstance(node, h5py.Group) and name not in signals and name not in unlike and not name.startswith("#")
    ]
    chosen = raw.choose_group(path, asked.group, groups, has_signals=bool(signals))
    node = file if chosen is None else root[chosen]
    if chosen is not None:
        signals, unlike = _signals(path, dict(_members(path, node, (file,))))
    if signals and all(FREQUENCY in data.parent.attrs for _, data in signals.values()):
        return _log_of_parameters(path, signals, unlike)
    rates = [_rate(path, name, data) for name, (_, data) in signals.items()]
    if rates and all(rate is not None for rate in rates):
        return _log_of_rates(path, signals, [rate for rate in rates if rate is not None], unlike)
    clean: dict[str, _Signal] = {}
    if isinstance(truth, h5py.Group):
        injected, _ = _signals(path, dict(_members(path, truth, (file,))))
        clean = {name.removesuffix(CLEAN): signal for name, signal in injected.items() if name.endswith(CLEAN)}

    def stated(name: str) -> Any:
        """Return an attribute of the group, else of the file; None where neither has it."""
        return next((_attribute(group, name) for group in (node, file) if name in group.attrs), None)

    rate = asked.sample_rate_hz
    if rate is None and any("sample_rate_hz" in group.attrs for group in (node, file)):
        rate = raw.rate_of(path, stated("sample_rate_hz"))
    rows, n, notes = _rows(path, signals, list(clean.values()), rate, asked)
    is_large = 8 * sum(data.size for _, data in signals.values()) > READ_AT_ONCE
    columns = []
    for name, (track, data) in signals.items():
        if n in (None, data.size):
            columns.append(_read_later(path, track, data, rows) if is_large else track.part(rows).here())
        elif name in asked.keep:  # as `read_log` spreads a channel of another number of samples
            values = _values(data, slice(0, data.size))
            spread = np.interp(np.arange(rows.start, rows.stop), np.arange(values.size) * (n / values.size), values)
            columns.append(Track(source=name, values=spread, unit=track.unit))
        else:
            unlike[name] = raw.unlike_time(name, data.size, n)
    texts = {key: _text(stated(key)) for key in ATTRIBUTES if any(key in group.attrs for group in (node, file))}
    if isinstance(truth, h5py.Group):
        texts |= {key: _text(_attribute(truth, key)) for key in TRUTH_KEYS}
    log = RawLog(
        columns=columns,
        sample_rate_hz=rate,
        first_sample=rows.start,
        clean={name: track.part(rows).here() for name, (track, _) in clean.items()},
        notes=notes,
        left_out=unlike,
    )
    return annotated(log, texts, where=path, truth="/truth ")


def _log_of_parameters(path: str, signals: Mapping[str, _Signal], unlike: Mapping[str, str]) -> RawLog:
    """Return the log of parameters with separate rates and offsets, as FlightDataAccessor stores them (`hdf_file`).

    Each parameter is a group with the samples in `data`, marks of the invalid samples in `mask`, and the attributes
    `frequency`, Hz, `supf_offset`, s, and `units`.
    """
    raw.require_memory(path, 16 * sum(data.size for _, data in signals.values()), "its parameters", "export fewer")
    tracks = []
    for name, (track, data) in signals.items():
        _require_readable(path, name, data)
        group = data.parent
        rate_hz, offset_s = (
            _number(path, name, group, key, default) for key, default in ((FREQUENCY, None), (OFFSET, 0.0))
        )
        if not 0.0 < rate_hz < np.inf or not np.isfinite(offset_s):
            raise LogError(f"{path}: '{name}' has a frequency of {rate_hz:g} Hz, from {offset_s:g} s; mend the file")
        values = np.array(track.here().values)
        mask = _member(path, group, "mask")
        if mask is not None and getattr(mask, "shape", None) == data.shape and mask.dtype.kind in "biu":
            _require_readable(path, f"{name}/mask", mask)
            values[np.ravel(mask[()]) != 0] = np.nan
        unit = _text(_attribute(group, "units")).strip()
        stated = track.unit or (unit if si_unit(unit) is not None else None)
        time_s = offset_s + np.arange(values.size) / rate_hz
        channel = "cas" if name == COMPUTED else None
        why = "by the name of FlightDataAccessor" if channel else ""
        tracks.append(Track(source=name, values=values, unit=stated, time_s=time_s, channel=channel, why=why))
    return RawLog(columns=tracks, left_out=unlike)


def _rate(path: str, name: str, data: h5py.Dataset) -> float | None:
    """Return the rate, Hz, that MATLAB's struct of a signal states in its field `Rate`; None where it states none."""
    is_struct = str(data.name).endswith(f"/{name}/data")
    rate = _member(path, data.parent, "Rate") if is_struct else None
    if rate is None or getattr(rate, "size", 0) != 1 or rate.dtype.kind not in "fiu":
        return None
    _require_readable(path, f"{name}/Rate", rate)
    stated = float(np.ravel(rate[()])[0])
    return stated if 0.0 < stated < np.inf else None


def _log_of_rates(
    path: str, signals: Mapping[str, _Signal], rates: Sequence[float], unlike: Mapping[str, str]
) -> RawLog:
    """Return the log of MATLAB's structs with separate rates, which begin together, as `matlab.read_matlab` does."""
    raw.require_memory(path, 16 * sum(data.size for _, data in signals.values()), "its parameters", "export fewer")
    from .layouts import with_channels  # and with it the tables of all recorders

    tracks = []
    for (name, (track, data)), rate_hz in zip(signals.items(), rates, strict=True):
        _require_readable(path, name, data)
        tracks.append(replace(track.here(), time_s=np.arange(data.size) / rate_hz))
    return RawLog(columns=with_channels(tracks, "dashlink"), left_out=unlike)


def _number(path: str, name: str, node: h5py.Group, key: str, default: float | None) -> float:
    stated = _attribute(node, key) if key in node.attrs else default
    if (number := raw.number_of(stated)) is None:
        raise LogError(f"{path}: '{name}' has no number as {key}, got {_text(stated)[:40]!r}; mend the file")
    return number


def _signals(path: str, children: Mapping[str, Any]) -> tuple[dict[str, _Signal], dict[str, str]]:
    """Return the signals of a group, and why the other datasets are none, by name.

    A signal is a dataset itself, or a struct with the fields `data` and `units`.
    """
    import h5py

    signals, unlike = {}, {}
    for name, child in children.items():
        is_struct = isinstance(child, h5py.Group)
        data = _member(path, child, "data") if is_struct else child
        if not isinstance(data, h5py.Dataset):
            continue
        why = "is a sparse matrix" if is_struct and "MATLAB_sparse" in child.attrs else _unfit(data)
        if why is not None:
            unlike[name] = why
            continue
        unit = _text(_attribute(data, "units")) or _text(_attribute(data, "unit"))
        fields = ("units", "Units") if is_struct and not unit else ()
        units: Any = next((member for key in fields if (member := _member(path, child, key)) is not None), None)
        is_stated = isinstance(units, h5py.Dataset) and "MATLAB_empty" not in units.attrs
        if is_stated and units.size and units.size <= LONGEST_UNIT:
            if units.dtype.kind in "iu":
                unit = "".join(chr(int(code)) for code in np.ravel(units[()]) if 0 < code <= 0xFFFF).strip()
            elif _is_text(units):
                unit = _text(np.ravel(units[()])[0]).strip()
        rows = slice(0, data.size)
        track = Track(source=name, unit=unit or None, read=partial(_values, data), rows=rows)
        signals[name] = track, data
    return signals, unlike


def _rows(
    path: str, signals: Mapping[str, _Signal], clean: list[_Signal], rate: float | None, asked: ReadRequest
) -> tuple[slice, int | None, tuple[Note, ...]]:
    """Return the rows to read, the length of the time axis if these are a part of it, else None, and a note on that.

    All rows are read up to `LARGEST` bytes, or `WHOLE` bytes if a window is wanted; of a larger log those of the window
    and one more on either side, found by bisection of the time axis.
    """
    every = [*signals.values(), *clean]
    for track, data in every:
        _require_readable(path, track.source, data)
    sizes, whole = [data.size for _, data in every] or [0], asked.span == (None, None)
    if 8 * sum(sizes) <= (LARGEST if whole else WHOLE):
        return slice(0, max(sizes)), None, ()
    if whole:
        what = f"{len(every)} channels of {max(sizes)} samples"
        raw.require_memory(path, 8 * sum(sizes), what, "give --from/--to for a part of it")
    time = raw.time_column([track for track, _ in signals.values()], asked)
    n = raw.most_common(sizes) if time is None else signals[time.source][1].size
    wanted = {*asked.sources} - {*asked.keep}
    for k, (track, data) in enumerate(every):
        if data.size != n and (k >= len(signals) or track.source in wanted):
            raise raw.different_length(path, track.source, data.size, n)
    if time is None and not (rate is not None and 0.0 < rate < np.inf):
        return slice(0, 2), n, ()  # too few to matter: without a time axis the log is refused later, and by name

    def at(k: int) -> float:
        if time is None:
            return k / float(rate or 1.0)
        return float(to_si(time.part(slice(k, k + 1)).here().values, time.unit or "", where=path)[0][0])

    first, last = at(0), at(n - 1)
    if not first < last:
        source = "sample_rate_hz" if time is None else time.source
        raise LogError(
            f"{path}: '{source}' does not increase, got {instant(first)} s at sample 0 and {instant(last)} s at sample "
            f"{n - 1}; sort or mend the time axis"
        )
    start = first if asked.span[0] is None else asked.span[0]
    stop = np.inf if asked.span[1] is None else asked.span[1]
    rounding = 1e-6 * (last - first) / n  # as `FlightLog.window` has it
    begin, end = (bisect_left(range(n), time_s - rounding, key=at) for time_s in (start, stop))
    if end - begin < 2:
        raise nothing_between(path, (start, stop), (first, last))
    rows = slice(max(begin - 1, 0), min(end + 1, n))
    count = rows.stop - rows.start
    what = f"{len(every)} channels of {count} samples"
    raw.require_memory(path, 8 * len(every) * count, what, "shorten the window")
    return rows, n, (Note.method(f"of {n} samples only {count} were read, those around the window"),)


def _members(path: str, node: h5py.Group, inside: tuple[h5py.Group, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Yield name and object of every member of a group; `inside` are the groups that hold it.

    Raises
    ------
    LogError : a link leads into another file or to nothing, or a member is a group that holds this one.
    """
    raw.require_few(path, len(node), "members of a group")
    for name in node:
        yield name, _member(path, node, name, inside)


def _member(path: str, node: h5py.Group, name: str, inside: tuple[h5py.Group, ...] = ()) -> Any:
    """Return the member of a group by its name, None where there is none.

    Raises
    ------
    LogError : as `_members`.
    """
    import h5py

    child = _followed(path, node, name, [])
    if isinstance(child, h5py.Group) and any(child == group for group in (node, *inside)):
        raise LogError(f"{path}: '{name}' is a group that holds itself; take the link out of the file")
    return child


def _followed(path: str, node: h5py.Group, name: str, trail: list[str]) -> Any:
    """Return the member of a group; `trail` is the names of the soft links that lead to it, to which more are added."""
    import h5py

    key, links = name.encode("utf-8", "surrogateescape"), node.id.links
    if not links.exists(key):
        return None
    asked, kind = (trail or [name])[0], links.get_info(key).type
    if kind == h5py.h5l.TYPE_HARD:
        child = node[name]
        if isinstance(child, h5py.Dataset):
            created = child.id.get_create_plist()
            if created.get_layout() == h5py.h5d.VIRTUAL:
                other = created.get_virtual_filename(0) if created.get_virtual_count() else "nothing"
                raise LogError(f"{path}: '{asked}' is a virtual dataset of '{other}'; {OWN_DATA}")
            if created.get_external_count():
                other = created.get_external(0)[0].decode("utf-8", "replace")
                raise LogError(f"{path}: '{asked}' keeps its values in another file, '{other}'; {OWN_DATA}")
        return child
    if kind == h5py.h5l.TYPE_EXTERNAL:
        other = ":".join(part.decode("utf-8", "replace") for part in links.get_val(key))
        raise LogError(f"{path}: '{asked}' is an external link to '{other}'; {OWN_DATA}")
    if kind != h5py.h5l.TYPE_SOFT:
        raise LogError(f"{path}: '{asked}' is a link of another program's kind; {OWN_DATA}")
    trail.append(name)
    target = links.get_val(key).decode("utf-8", "surrogateescape")
    if len(trail) > MOST_LINKS:
        raise LogError(f"{path}: '{asked}' is a loop of soft links, got one to '{target}'; {OWN_DATA}")
    here: Any = node.file if target.startswith("/") else node
    for part in target.split("/"):
        if part not in ("", "."):
            here = _followed(path, here, part, trail) if isinstance(here, h5py.Group) else None
    if here is None:
        raise LogError(f"{path}: '{asked}' is a soft link to '{target}', which is not in the file; {OWN_DATA}")
    return here


def _unfit(child: h5py.Dataset) -> str | None:
    """Return why a dataset is no signal, None where it is one."""
    import h5py

    if "MATLAB_sparse" in child.attrs:
        return "is a sparse matrix"
    if "MATLAB_empty" in child.attrs or child.shape is None or 0 in child.shape:
        return "is empty"
    if _text(_attribute(child, "MATLAB_class")) == "cell":
        return "is a cell array"
    try:
        dtype = child.dtype
    except TypeError:
        return "holds no numbers (a type of its own)"
    if _is_text(child):
        return "holds text"
    if h5py.check_vlen_dtype(dtype) is not None:
        return "is ragged (rows of different length)"
    if dtype.kind == "c" or dtype.names == ("real", "imag"):
        return "holds complex numbers"
    if dtype.names:
        return f"is a table of named columns ({', '.join(dtype.names[:5])})"
    if h5py.check_ref_dtype(dtype):
        return "holds references, no numbers"
    return raw.unlike(dtype.kind, child.shape)


def _is_text(data: h5py.Dataset) -> bool:
    """Say whether a dataset holds text; MATLAB stores text as numbers."""
    import h5py

    is_string = h5py.check_string_dtype(data.dtype) is not None or data.dtype.kind == "S"
    return is_string or _text(_attribute(data, "MATLAB_class")) == "char"


def _require_readable(path: str, name: str, data: h5py.Dataset) -> None:
    """Check that the stored bytes of a dataset can hold its samples, and that its chunks are small enough to read.

    Raises
    ------
    LogError : chunks above `LARGEST_CHUNK`, or more samples than the stored bytes can hold.
    """
    chunk = int(np.prod(data.chunks or (0,), dtype=object)) * data.dtype.itemsize
    if chunk > LARGEST_CHUNK:
        raise LogError(
            f"{path}: '{name}' is stored in chunks of {chunk / 1e9:.2g} GB, the limit is "
            f"{LARGEST_CHUNK / 1e9:.2g} GB; store it in smaller ones (h5repack does)"
        )
    stored = data.id.get_storage_size()
    if data.nbytes > MOST_PACKED * stored:
        raise LogError(
            f"{path}: '{name}' claims {data.size} samples, more than its {stored} bytes in the file can hold; "
            "export it again"
        )


def _attribute(node: Any, name: str) -> str | bytes | float | np.number[Any] | None:
    """Return the first value of an attribute, None where there is none or it is neither text nor a number."""
    if name not in node.attrs:
        return None
    try:
        if node.attrs.get_id(name).get_storage_size() > LARGEST_ATTRIBUTE:
            return None
        value = np.ravel(node.attrs[name])
    except (TypeError, ValueError, RuntimeError):  # empty, or of a type that numpy does not have
        return None
    first = value[0] if value.size else None
    return first if isinstance(first, str | bytes | int | float | np.number) else None


def _text(value: str | bytes | float | np.number[Any] | None) -> str:
    """Return an attribute as text, "" where there is none."""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return "" if value is None else str(value)
