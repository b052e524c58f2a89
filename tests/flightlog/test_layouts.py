"""Layouts of recorders are read as typed: names, units, conventions, time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_layouts import KT, LAYOUTS, N, g1000, skyview, xplane
from noted import texts

from bfi_cli.channels import STANDARD
from bfi_cli.flightlog import read_log

LOW_PASSED = {"pitch", "radio_altitude"}  # recorded faster than the airspeed


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_layout_is_read_as_typed(tmp_path: Path, layout: str):
    expected = LAYOUTS[layout](tmp_path / "log")
    log = read_log(tmp_path / "log")
    for name, values in expected.items():
        got = log.time_s if name == "time" else log.channel(name).values
        np.testing.assert_allclose(got, np.broadcast_to(values, got.shape), rtol=1e-9, atol=1e-8, err_msg=name)
    recorded = {name for name, channel in log.channels.items() if name in STANDARD and not channel.derived_from}
    assert recorded - expected.keys() == (LOW_PASSED if layout == "dashlink" else set())


def test_a_stated_unit_wins_over_that_of_the_table(tmp_path: Path):
    skyview(tmp_path / "log.csv")
    text = (tmp_path / "log.csv").read_text().replace("True Airspeed (knots)", "True Airspeed (km/h)")
    (tmp_path / "log.csv").write_text(text)
    tas = read_log(tmp_path / "log.csv").channels["tas"].values
    (tmp_path / "log.csv").write_text(text.replace("True Airspeed (km/h)", "True Airspeed"))
    np.testing.assert_allclose(read_log(tmp_path / "log.csv").channels["tas"].values, tas * 3.6 * KT, rtol=1e-12)


def test_an_option_wins_over_a_table(tmp_path: Path):
    xplane(tmp_path / "Data.txt")
    log = read_log(tmp_path / "Data.txt", channel_map={"time": "_real,_time", "cas": "_Vind,_kias"})
    assert log.time_s[0] == 7.0
    np.testing.assert_array_equal(log.channels["cas"].values, read_log(tmp_path / "Data.txt").channels["ias"].values)


def test_a_garmin_log_without_its_first_line_is_one(tmp_path: Path):
    g1000(tmp_path / "log.csv")
    lines = (tmp_path / "log.csv").read_text().splitlines(keepends=True)
    whole = read_log(tmp_path / "log.csv")
    (tmp_path / "log.csv").write_text("".join(lines[2:]))
    log = read_log(tmp_path / "log.csv")
    np.testing.assert_allclose(log.channels["tas"].values, whole.channels["tas"].values)
    assert log.n_samples == N


def test_what_the_file_does_not_name_keeps_its_name_or_is_left_out_with_a_note(tmp_path: Path):
    LAYOUTS["g3x"](tmp_path / "log.csv")
    log = read_log(tmp_path / "log.csv")
    assert "'COM1': 3 cells are not a number, the first '123.075 RX' in line 4: left out" in texts(log.notes)
    assert "aoa" not in log.channels
    assert "GPS Time of Week" in log.channels
