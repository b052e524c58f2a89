"""Writing: what is read back is what was written, and a file is there whole or not at all."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_logs import made_log, write_text

from bfi_cli.epoch import Epoch
from bfi_cli.errors import ConfigError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject, inspect_log, read_log, write_log
from bfi_cli.flightlog.record import FlightLog, Segment
from bfi_cli.serialization import to_json

UNITS = {"tas": "m/s", "aoa": "rad", "tat": "K", "mach": "1", "wobble x": "", "left/right": "Pa", "time2": "s"}
NUMBERS = st.floats(allow_infinity=True, allow_nan=True)


@st.composite
def logs(draw: st.DrawFn) -> FlightLog:
    n = draw(st.integers(2, 12))
    step = draw(st.lists(st.floats(1e-3, 10.0), min_size=n, max_size=n))
    names = draw(st.lists(st.sampled_from(sorted(UNITS)), min_size=1, unique=True))
    signals = {name: draw(st.lists(NUMBERS, min_size=n, max_size=n)) for name in names}
    log = made_log(np.cumsum(step) - 5.0, UNITS, **signals)
    if draw(st.booleans()):
        log = replace(
            log, segments=(Segment(label='rough; "air"', start_s=0.5, stop_s=draw(st.floats(1, 9)), note="µ"),)
        )
    moments = st.integers(-(10**10), 10**13).map(lambda ms: round(1e-3 * ms, 3))
    dated = st.builds(Epoch, since_1970_s=moments, is_utc=st.booleans())
    of_day = st.sampled_from([Epoch(since_1970_s=s, is_utc=True, is_dated=False) for s in (0.0, 86_399.0)])
    log = replace(log, epoch=draw(st.none() | dated | of_day))
    channel = log.channels[names[0]]
    if draw(st.booleans()) and np.isfinite(channel.values[-1]):
        log = inject(log, [Fault(shape="bias", channel=names[0], magnitude=draw(st.floats(0.1, 9.0)), onset_s=-99.0)])
    return log


@given(log=logs(), suffix=st.sampled_from([".h5", ".csv"]))
def test_round_trip_is_exact(log: FlightLog, suffix: str, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / f"round{suffix}"
    write_log(log, path)
    back = read_log(path)
    np.testing.assert_array_equal(back.time_s, log.time_s)
    assert back.segments == log.segments
    assert back.epoch == log.epoch
    written = {name.replace("/", "_") if suffix == ".h5" else name: c for name, c in log.channels.items()}
    assert set(back.channels) == set(written)
    for name, channel in written.items():
        np.testing.assert_array_equal(back.channels[name].values, channel.values)
        assert back.channels[name].unit == channel.unit
    assert (back.truth is None) == (log.truth is None)
    if log.truth is not None and back.truth is not None:
        names = {channel.name: name for name, channel in written.items()}
        assert back.truth.faults == tuple(replace(fault, channel=names[fault.channel]) for fault in log.truth.faults)
        for clean, was in zip(back.truth.clean.values(), log.truth.clean.values(), strict=True):
            np.testing.assert_array_equal(clean, was)


@given(log=logs())
def test_any_log_can_be_inspected_and_its_report_is_json(log: FlightLog):
    report = json.loads(to_json({"report": inspect_log(log)}))["report"]
    assert [channel["name"] for channel in report["channels"]] == list(log.channels)
    assert sum(channel["n_nan"] for channel in report["channels"]) == sum(
        int(np.count_nonzero(~np.isfinite(channel.values))) for channel in log.channels.values()
    )


@pytest.mark.parametrize("name", ["out.xlsx", "out", "absent/out"])
def test_what_cannot_be_written_is_said_and_leaves_nothing(name: str, tmp_path: Path):
    with pytest.raises(ConfigError, match=r"name the file|cannot be written"):
        write_log(made_log([0.0, 1.0], tas=[1.0, 2.0]), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_an_existing_file_survives_a_failure(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = write_text(tmp_path / f"out{suffix}", "precious")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(f"bfi_cli.flightlog.write._write_{'csv' if suffix == '.csv' else 'hdf5'}", fail)
    with pytest.raises(ConfigError, match="cannot be written, no space left on device"):
        write_log(made_log([0.0, 1.0], tas=[1.0, 2.0]), path)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


def test_the_file_is_readable_like_any_other(tmp_path: Path):
    path = tmp_path / "out.csv"
    write_log(made_log([0.0, 1.0], tas=[1.0, 2.0]), path)
    assert path.stat().st_mode == write_text(tmp_path / "plain", "").stat().st_mode
    assert path.read_text() == "# written by bfi\ntime [s],tas [m/s]\n0.0,1.0\n1.0,2.0\n"
