"""MAVLink telemetry logs: check sum, both versions, bursts, damage, and a log of a simulation.

The numbers of that log were compared once with pymavlink, which is no dependency: equal in every field that is read.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_tlog import packet, tlog_bytes
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.phases import phases_of
from bfi_cli.flightlog.tlog import checksum, read_tlog_topics


def test_the_check_sum_is_that_of_the_catalogue():
    """CRC-16/MCRF4XX of "123456789" is 0x6F91 in the catalogue of parametrised CRC algorithms."""
    assert checksum(b"123456789") == 0x6F91


@pytest.mark.parametrize("version", [1, 2])
def test_the_flight_that_was_written(version: int, tmp_path: Path):
    (tmp_path / "a.bin").write_bytes(tlog_bytes(version=version))
    log = read_log(tmp_path / "a.bin")
    assert log.rate_hz == pytest.approx(4.0)
    t, inner = log.time_s - 5.0, slice(4, -4)
    np.testing.assert_allclose(log.channels["ias"].values[inner], (20.0 + 2.0 * np.sin(0.5 * t))[inner], atol=1e-5)
    np.testing.assert_allclose(log.channels["pitch"].values[inner], 0.1 * np.sin(0.8 * t)[inner], atol=2e-3)
    assert log.channels["throttle"].values[3] == pytest.approx(0.5)
    assert log.channels["pitch"].own_rate_hz == pytest.approx(8.0)


def test_a_signature_and_another_sender_are_passed_over(tmp_path: Path):
    other = packet(0.0, "ATTITUDE", 1, *[9.0] * 6, system=7)
    signed = packet(41.0, "ATTITUDE", 46_000, 0.0, 0.5, 3.0, 0.0, 0.0, 0.0, signed=True)
    (tmp_path / "a").write_bytes(other + tlog_bytes() + signed + other)
    topics, notes = read_tlog_topics(str(tmp_path / "a"))
    attitude = next(one for one in topics if one.name == "ATTITUDE")
    assert attitude.fields["pitch"][-1] == 0.5
    assert not np.any(attitude.fields["pitch"] == 9.0)
    assert texts(notes) == ["messages of 2 senders; those of system 1, component 1 are read"]


def test_a_wrong_check_sum_is_skipped_and_said(tmp_path: Path):
    whole = bytearray(tlog_bytes())
    whole[len(whole) // 2 : len(whole) // 2 + 4] = b"\xff\xff\xff\xff"
    (tmp_path / "a").write_bytes(whole)
    topics, notes = read_tlog_topics(str(tmp_path / "a"))
    assert "bytes are damaged or cut off" in notes[0].text
    assert sum(one.time_s.size for one in topics) >= 478


@given(data=st.data())
def test_a_damaged_telemetry_log_is_read_or_refused(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.getbasetemp() / "damaged.tlog"
    whole = bytearray(tlog_bytes(length_s=10.0))
    for _ in range(data.draw(st.integers(0, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(whole[: data.draw(st.integers(1, len(whole)))])
    try:
        log = read_log(path)
    except LogError:
        return
    assert log.n_samples >= 2


@pytest.mark.realdata
def test_a_log_of_a_simulation(flights: Path):
    """Counts as pymavlink has them. By the times of arrival the median step says 111 Hz."""
    path = flights / "reader_samples" / "vtol.tlog"
    topics, notes = read_tlog_topics(str(path))
    sizes = {one.name: one.time_s.size for one in topics}
    assert notes == []
    assert (sizes["ATTITUDE"], sizes["GLOBAL_POSITION_INT"], sizes["SCALED_PRESSURE"]) == (888, 807, 794)
    log = read_log(path)
    assert log.rate_hz == pytest.approx(4.3, rel=0.05)
    assert log.channels["ias"].values.max() == pytest.approx(28.0, abs=0.2)
    flown = [one for one in phases_of(log) if one.phase in ("hover", "cruise")]
    assert [one.phase for one in flown] == ["hover", "cruise", "cruise", "cruise", "hover"]
    # The mode of a quadplane is one of hovering before it lifts off and after it has landed.
    assert (flown[0].from_s, flown[-1].to_s) == (pytest.approx(636.0, abs=1.0), pytest.approx(775.0, abs=1.0))


def test_a_quadplane_tells_its_hover(tmp_path: Path):
    """Of a heartbeat ArduPlane's modes 17 to 23; the heartbeat of a ground station is no second sender."""
    (tmp_path / "a").write_bytes(tlog_bytes(hovers_s=10.0))
    log = read_log(tmp_path / "a")
    hover = log.channel("hover").values
    assert set(hover[np.isfinite(hover)]) == {0.0, 1.0}
    assert log.time_s[np.flatnonzero(hover == 1.0)[-1]] == pytest.approx(15.0, abs=1.1)
    assert not any("senders" in text for text in texts(log.notes))
