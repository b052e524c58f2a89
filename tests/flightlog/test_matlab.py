"""The check before MATLAB v5 files are parsed: what scipy writes passes, what contradicts itself does not."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat
from scipy.sparse import csc_array

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.matlab import unpacked_size, variables

LEAVES = st.one_of(
    st.floats(),
    st.text("abc xyz", max_size=5),
    st.lists(st.integers(0, 255), max_size=6).map(lambda x: np.array(x, dtype=np.uint8)),
    st.lists(st.floats(), max_size=6).map(np.array),
    st.just(np.ones((2, 3), dtype=complex)),
)
NAMES = st.text("abcdef", min_size=1, max_size=8)
VALUES = st.recursive(LEAVES, lambda inner: st.dictionaries(NAMES, inner, min_size=1, max_size=3), max_leaves=6)


def saved(written: dict[str, Any], *, compressed: bool = False) -> bytes:
    file = io.BytesIO()
    savemat(file, written, do_compression=compressed)
    return file.getvalue()


@given(written=st.dictionaries(NAMES, VALUES, min_size=1, max_size=4), compressed=st.booleans())
def test_what_is_saved_passes(written: dict[str, Any], compressed: bool):
    found = variables(saved(written, compressed=compressed))
    assert {variable.name: variable.unlike for variable in found} == dict.fromkeys(written)


def test_what_has_another_length_is_left_out_with_its_reason(tmp_path: Path):
    path = tmp_path / "flight.mat"
    time_s = np.arange(50) / 10.0
    savemat(
        path, {"time": time_s, "tas": 90.0 + time_s, "elevator": time_s, "pitch": time_s, "aoa": np.ones(7), "g": 9.8}
    )
    log = read_log(path)
    assert set(log.channels) == {"tas", "elevator", "pitch"}
    assert any("'aoa' has 7 samples, the time axis 50, and is left out" in note.text for note in log.notes)
    with pytest.raises(LogError, match=r"'aoa' has 7 samples, the time axis 50, and is left out; the log has: "):
        log.channel("aoa")
    with pytest.raises(LogError, match=r"'aoa' has 7 samples, the time axis 50; give all one time axis"):
        read_log(path, channel_map={"sideslip": "aoa"})


def test_classes_without_signals_are_told_apart():
    file = saved({"tas": np.ones(3), "matrix": csc_array(np.eye(3)), "inside": {"matrix": csc_array(np.eye(2))}})
    assert {variable.name: variable.unlike for variable in variables(file)} == {
        "tas": None,
        "matrix": "is a sparse matrix",
        "inside": "has a part that is a sparse matrix",
    }


@given(cut=st.integers(1, 200), compressed=st.booleans())
def test_a_truncated_file_does_not_pass(cut: int, compressed: bool):
    file = saved({"tas": np.arange(50.0)}, compressed=compressed)
    with pytest.raises(ValueError, match=r"bytes|cut off|damaged|lacks"):
        variables(file[:-cut])


def test_a_size_that_the_data_do_not_have_does_not_pass():
    file = saved({"tas": np.arange(50.0)[None, :]})
    shape = struct.pack("<ii", 1, 50)
    assert file.count(shape) == 1
    with pytest.raises(ValueError, match="an array of 5000 numbers has 400 bytes"):
        variables(file.replace(shape, struct.pack("<ii", 1, 5000)))


def test_what_is_compressed_is_unpacked_no_further_than_it_claims():
    """A bomb: 8 MB of zeros behind a tag that claims 80 bytes."""
    bomb = zlib.compress(struct.pack("<II", 14, 80) + bytes(2**23), 9)
    file = saved({}) + struct.pack("<II", 15, len(bomb)) + bomb
    assert unpacked_size(file) == 80
    with pytest.raises(ValueError, match="they claim 80 bytes and hold others"):
        variables(file)


def test_the_size_unpacked_is_told_without_unpacking():
    written = {"tas": np.zeros(10**6), "aoa": np.zeros(10**5)}
    assert unpacked_size(saved(written, compressed=True)) == unpacked_size(saved(written))
    assert sum(variable.count for variable in variables(saved(written))) == 1_100_000
