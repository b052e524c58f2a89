"""Log files that strangers send: data elsewhere, data that are no signal, sizes beyond memory, clocks gone wrong."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from made_tlog import tlog_bytes
from scipy.io import savemat

N = 600
TIME = np.arange(N) / 10.0
TAS = 100.0 + np.sin(TIME)
ELEVATOR = 0.02 * np.cos(3.0 * TIME)


def hdf5(change: Callable[[h5py.File], None], **signals: np.ndarray) -> Callable[[Path], None]:
    """Return what writes an HDF5 log of 60 s and then changes it."""

    def write(path: Path) -> None:
        with h5py.File(path, "w", libver="latest") as file:
            for name, values in ({"time": TIME, "elevator": ELEVATOR, "tas": TAS} | signals).items():
                file[name] = values
            change(file)

    return write


def in_place_of_tas(make: Callable[[h5py.File], object]) -> Callable[[h5py.File], None]:
    """Return what takes the airspeed out and puts something else there."""

    def change(file: h5py.File) -> None:
        del file["tas"]
        made = make(file)
        if made is not None:
            file["tas"] = made

    return change


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(N,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "tas", shape=(N,))
    file.create_virtual_dataset("tas", layout)


def ragged(file: h5py.File) -> None:
    data = file.create_dataset("tas", (N,), dtype=h5py.vlen_dtype(np.float64))
    data[0] = [1.0, 2.0]


def held_in(name: str) -> Callable[[h5py.File], None]:
    """Return what stores a channel of nothing but zeros, far longer than the log."""

    def change(file: h5py.File) -> None:
        n = 300_000_000
        del file[name]
        data = file.create_dataset(name, (n,), dtype="f4", chunks=(2**20,), compression="gzip")
        packed = zlib.compress(bytes(4 * 2**20), 9)
        for at in range(0, n, 2**20):
            data.id.write_direct_chunk((at,), packed)

    return change


def all_held(file: h5py.File) -> None:
    for name in ("time", "elevator", "tas"):
        held_in(name)(file)


def one_chunk(file: h5py.File) -> None:
    file.create_dataset("tas", (2**27,), dtype="f8", chunks=(2**27,), compression="gzip")


def rate(value: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file["time"]
        file.attrs["sample_rate_hz"] = value

    return change


def at_odd(value: float) -> np.ndarray:
    return np.where(np.arange(N) % 2 == 1, value, TIME)


def loop(file: h5py.File) -> None:
    file["tas"], file["cas"] = h5py.SoftLink("/cas"), h5py.SoftLink("/tas")


def nested_loop(file: h5py.File) -> None:
    file["again"] = file["/"]


def clean_elsewhere(file: h5py.File) -> None:
    file.create_group("truth").attrs["faults"] = "[]"
    file["truth/tas_clean"] = h5py.ExternalLink("other.h5", "/tas")


def struct_elsewhere(file: h5py.File) -> None:
    file["tas/data"] = h5py.ExternalLink("other.h5", "/tas")


def unit_elsewhere(file: h5py.File) -> None:
    file["tas/data"] = TAS
    file["tas/units"] = h5py.ExternalLink("other.h5", "/units")


def sparse(file: h5py.File) -> None:
    file["tas/data"], file["tas/ir"] = TAS, np.arange(N)
    file["tas"].attrs["MATLAB_sparse"] = N


def packed_mat(size: int) -> Callable[[Path], None]:
    """Return what writes a MATLAB file with one compressed variable that claims this size."""

    def write(path: Path) -> None:
        savemat(path, {})
        bomb = zlib.compress(struct.pack("<II", 14, size) + bytes(2**20), 9)
        with open(path, "ab") as file:
            file.write(struct.pack("<II", 15, len(bomb)) + bomb)

    return write


def mat(**signals: object) -> Callable[[Path], None]:
    return lambda path: savemat(path, {"time": TIME, "elevator": ELEVATOR} | signals)


def text(content: Callable[[], str]) -> Callable[[Path], None]:
    return lambda path: path.write_text(content())  # type: ignore[return-value]


def sparse_giant(path: Path) -> None:
    path.write_text("# no log\n" * 1000)
    with open(path, "ab") as file:
        file.truncate(3 * 10**9)


def holes(head: bytes, size: int) -> Callable[[Path], None]:
    """Return what writes the first bytes of a log and a hole up to a size, which takes nothing on the disk."""

    def write(path: Path) -> None:
        with open(path, "wb") as file:
            file.write(head)
            file.truncate(size)

    return write


def mcap(*records: tuple[int, bytes], end: bool = True) -> Callable[[Path], None]:
    """Return what writes an MCAP file of records, each a code and a body, and a footer."""
    every = (*records, *([(2, bytes(20))] if end else []))
    whole = b"".join(struct.pack("<BQ", code, len(body)) + body for code, body in every)
    return lambda path: path.write_bytes(b"\x89MCAP0\r\n" + whole + b"\x89MCAP0\r\n") and None


def chunk(compression: str, stated: int, data: bytes) -> tuple[int, bytes]:
    """Return the record of a chunk that states the size of its content."""
    return 6, struct.pack("<QQQII", 0, 0, stated, 0, len(compression)) + compression.encode() + struct.pack(
        "<Q", len(data)
    ) + data


def zstd(size: int) -> bytes:
    """Return a frame of zeros, whose size it does not state: blocks of 2^17 and less, each of one repeated byte."""
    sizes = [2**17] * (size // 2**17) + [size % 2**17]
    blocks = (struct.pack("<I", (n << 3) | 2 | (k + 1 == len(sizes)))[:3] + b"\0" for k, n in enumerate(sizes))
    return b"\x28\xb5\x2f\xfd\x00\x38" + b"".join(blocks)


def lz4(size: int) -> bytes:
    """Return a frame of blocks of zeros."""
    import lz4.frame

    return lz4.frame.compress(bytes(size), store_size=False)


MCAP_CHANNEL = (4, struct.pack("<HHI", 1, 0, 3) + b"air" + struct.pack("<I", 4) + b"json" + struct.pack("<I", 0))


def many_names(path: Path) -> None:
    """Write messages of which each has a number of another name."""
    texts = (json.dumps({f"n{k}": 1.0}).encode() for k in range(10_001))
    mcap(MCAP_CHANNEL, *((5, struct.pack("<HIQQ", 1, 0, k, k) + text) for k, text in enumerate(texts)))(path)


OWN = "a log must hold its own data, copy it into the file"

ODD: dict[str, tuple[Callable[[Path], None], str]] = {
    "external.h5": (
        hdf5(in_place_of_tas(lambda _: h5py.ExternalLink("other.h5", "/tas"))),
        f"external.h5: 'tas' is an external link to 'other.h5:/tas'; {OWN}",
    ),
    "struct.h5": (
        hdf5(in_place_of_tas(struct_elsewhere)),
        f"struct.h5: 'data' is an external link to 'other.h5:/tas'; {OWN}",
    ),
    "unit.h5": (hdf5(in_place_of_tas(unit_elsewhere)), "unit.h5: 'units' is an external link to 'other.h5:/units'"),
    "truth.h5": (hdf5(clean_elsewhere), "truth.h5: 'tas_clean' is an external link to 'other.h5:/tas'"),
    "virtual.h5": (hdf5(in_place_of_tas(virtual)), f"virtual.h5: 'tas' is a virtual dataset of 'other.h5'; {OWN}"),
    "raw.h5": (
        hdf5(in_place_of_tas(lambda f: f.create_dataset("tas", (N,), "f8", external=[("o.raw", 0, 8 * N)]) and None)),
        f"raw.h5: 'tas' keeps its values in another file, 'o.raw'; {OWN}",
    ),
    "dangling.h5": (
        hdf5(in_place_of_tas(lambda _: h5py.SoftLink("/nowhere/tas"))),
        f"dangling.h5: 'tas' is a soft link to '/nowhere/tas', which is not in the file; {OWN}",
    ),
    "loop.h5": (hdf5(in_place_of_tas(loop)), "loop.h5: 'cas' is a loop of soft links, got one to '/tas'"),
    "nested.h5": (hdf5(nested_loop), "nested.h5: 'again' is a group that holds itself; take the link out"),
    "large.h5": (
        hdf5(all_held),
        "large.h5: 3 channels of 300000000 samples need 7.2 GB of memory, the limit is 4 GB; give --from/--to",
    ),
    "one_chunk.h5": (hdf5(in_place_of_tas(one_chunk)), "one_chunk.h5: 'tas' is stored in chunks of 1.1 GB, the limit"),
    "unwritten.h5": (
        hdf5(in_place_of_tas(lambda f: f.create_dataset("tas", (N,), "f8", chunks=(N,)) and None)),
        "unwritten.h5: 'tas' claims 600 samples, more than its 0 bytes in the file can hold; export it again",
    ),
    "complex.h5": (
        hdf5(in_place_of_tas(lambda _: TAS + 1j)),
        "complex.h5: 'tas' holds complex numbers and is left out",
    ),
    "text.h5": (hdf5(in_place_of_tas(lambda _: ["fast"] * N)), "text.h5: 'tas' holds text and is left out"),
    "table.h5": (
        hdf5(in_place_of_tas(lambda _: np.ones((N, 3)))),
        "table.h5: 'tas' is a table of 600 x 3 (2-D) and is left out; the log has: elevator",
    ),
    "ragged.h5": (hdf5(in_place_of_tas(ragged)), "ragged.h5: 'tas' is ragged (rows of different length) and is left"),
    "compound.h5": (
        hdf5(in_place_of_tas(lambda _: np.zeros(N, [("a", "f8"), ("b", "f8")]))),
        "compound.h5: 'tas' is a table of named columns (a, b) and is left out",
    ),
    "reference.h5": (
        hdf5(in_place_of_tas(lambda f: np.array([f["time"].ref] * N, dtype=h5py.ref_dtype))),
        "reference.h5: 'tas' holds references, no numbers and is left out",
    ),
    "null.h5": (hdf5(in_place_of_tas(lambda _: h5py.Empty("f8"))), "null.h5: 'tas' is empty and is left out"),
    "sparse.h5": (hdf5(in_place_of_tas(sparse)), "sparse.h5: 'tas' is a sparse matrix and is left out"),
    "rate_text.h5": (hdf5(rate("fast")), "rate_text.h5: sample_rate_hz is no number, got 'fast'; mend it"),
    "rate_nan.h5": (hdf5(rate(np.nan)), "rate_nan.h5: sample_rate_hz is no rate of a recorder, got nan Hz; mend it"),
    "rate_zero.h5": (hdf5(rate(0)), "rate_zero.h5: sample_rate_hz is no rate of a recorder, got 0 Hz; mend it"),
    "rate_slow.h5": (hdf5(rate(1e-11)), "rate_slow.h5: sample_rate_hz is no rate of a recorder, got 1e-11 Hz; mend it"),
    "time_late.h5": (
        hdf5(lambda _: None, time=TIME + 1.7e15),
        "time_late.h5: 'time' is no time of a flight at sample 0, got 1.7e+15 s; state its unit with --unit time=us",
    ),
    "time_inf.h5": (hdf5(lambda _: None, time=at_odd(np.inf)), "'time' is not a number at sample 1 (300 in all)"),
    "complex.mat": (mat(tas=TAS + 1j), "complex.mat: 'tas' holds complex numbers and is left out"),
    "text.mat": (mat(tas="fast"), "text.mat: 'tas' holds text and is left out"),
    "cell.mat": (mat(tas=np.array([TAS, "a"], dtype=object)), "cell.mat: 'tas' is a cell array and is left out"),
    "table.mat": (mat(tas=np.ones((N, 3))), "table.mat: 'tas' is a table of 600 x 3 (2-D) and is left out"),
    "sparse.mat": (lambda path: _sparse_mat(path), "sparse.mat: 'tas' is a sparse matrix and is left out"),
    "structs.mat": (
        mat(tas=np.array([(1.0,), (2.0,)], dtype=[("a", "f8")])),
        "structs.mat: 'tas' is an array of structs and is left out",
    ),
    "rate.mat": (
        lambda path: savemat(path, {"tas": TAS, "elevator": ELEVATOR, "sample_rate_hz": 1j}),
        "rate.mat: sample_rate_hz is no number, got '1j'; mend it",
    ),
    "bomb.mat": (packed_mat(80), "bomb.mat: damaged or truncated MATLAB file, compressed data are damaged"),
    "giant.mat": (packed_mat(2**32 - 8), "giant.mat: its variables need 4.3 GB of memory, the limit is 4 GB; save"),
    "long_line.csv": (text(lambda: "time,tas\n" + "1" * 10**7), "long_line.csv: line 2 is longer than 1000000 char"),
    "long_header.csv": (text(lambda: "a," * 10**6), "long_header.csv: line 1 is longer than 1000000 characters; write"),
    "wide.csv": (
        text(lambda: ",".join(f"c{i}" for i in range(100_000)) + "\n"),
        "wide.csv: 100000 columns, the limit is 10000; export fewer channels",
    ),
    "holes.mat": (
        holes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\x01IM", 2 * 10**10),
        "holes.mat: its variables need 20.0 GB of memory, the limit is 4 GB; save",
    ),
    "holes.ulg": (
        holes(b"ULog\x01\x12\x35\x01" + bytes(8), 2 * 10**10),
        "holes.ulg: 20.0 GB of messages, the limit is 4 GB; cut the log",
    ),
    "holes.bin": (holes(b"\xa3\x95\x80", 2 * 10**10), "holes.bin: 20.0 GB of messages, the limit is 4 GB; cut the log"),
    "holes.tlog": (
        lambda path: holes(tlog_bytes(), 10**9)(path),
        "holes.tlog: its packets need 12.0 GB of memory, the limit is 4 GB; cut the log",
    ),
    "holes.mcap": (holes(b"\x89MCAP0\r\n", 2 * 10**10), "holes.mcap: damaged or truncated MCAP file, no record begins"),
    "holes.tdms": (holes(b"TDSm", 2 * 10**10), "holes.tdms: damaged or truncated TDMS file, "),
    "holes.h5": (holes(b"\x89HDF\r\n\x1a\n", 2 * 10**10), "holes.h5: damaged or truncated HDF5 file, "),
    "skipped.mcap": (
        holes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 9, 3 * 10**9), 3 * 10**9),
        "skipped.mcap: damaged or truncated MCAP file, a record is cut off; export it again",
    ),
    "unended.mcap": (mcap(end=False), "unended.mcap: damaged or truncated MCAP file, "),
    "stated.mcap": (
        mcap(*[chunk("zstd", 2**28, zstd(2**28))] * 22),
        "stated.mcap: 5.9 GB of messages, the limit is 4 GB; export fewer topics",
    ),
    "chunk.mcap": (
        mcap(chunk("zstd", 6 * 10**9, zstd(2**20))),
        "chunk.mcap: a chunk of 6 GB, the limit is 0.27 GB; export it again in smaller ones",
    ),
    "claims.mcap": (
        mcap(chunk("lz4", 10**8, bytes(1000))),
        "claims.mcap: a chunk claims 100000000 bytes, more than its 1000 bytes of 'lz4' in the file can hold; export",
    ),
    "bomb_zstd.mcap": (
        mcap(chunk("zstd", 1000, zstd(2**30))),
        "bomb_zstd.mcap: damaged or truncated MCAP file, a chunk states 1000 bytes and holds more; export it again",
    ),
    "bomb_lz4.mcap": (
        mcap(chunk("lz4", 1000, lz4(2**26))),
        "bomb_lz4.mcap: damaged or truncated MCAP file, a chunk states 1000 bytes and holds more; export it again",
    ),
    "less.mcap": (
        mcap(chunk("zstd", 2**20, zstd(1000))),
        "less.mcap: a chunk claims 1048576 bytes, more than its 10 bytes of 'zstd' in the file can hold; export it",
    ),
    "names.mcap": (many_names, "names.mcap: 10001 fields, the limit is 10000; export fewer channels"),
    "giant.csv": (sparse_giant, "giant.csv: 3.0 GB of text, the limit is 1 GB (numbers take up to four times as much"),
}


def _sparse_mat(path: Path) -> None:
    from scipy.sparse import csc_array

    mat(tas=csc_array(np.eye(3)))(path)
