"""MCAP logs, by the writer of the package mcap: one topic, several at rates of their own, what is no log."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log, write_log

writer = pytest.importorskip("mcap.writer")
KNOT, START_S = 1852.0 / 3600.0, 1_700_000_000.0


def speed(time_s):
    return 150.0 + 5.0 * np.sin(0.5 * time_s)


def written(path: Path, topics: dict[str, tuple[float, dict]], *, encoding: str = "json") -> Path:
    """Write 30 s of topics, each (rate, {field: function of time}), as messages since the epoch."""
    with path.open("wb") as file:
        made = writer.Writer(file)
        made.start()
        for name, (rate_hz, fields) in topics.items():
            properties = {field: {"type": "number", "unit": "kt"} for field in fields if "airspeed" in field}
            data = json.dumps({"type": "object", "properties": properties}).encode()
            schema = made.register_schema(name=name, encoding="jsonschema", data=data)
            channel = made.register_channel(topic=name, message_encoding=encoding, schema_id=schema)
            for k in range(round(30.0 * rate_hz)):
                message = {field: of(k / rate_hz) for field, of in fields.items()} | {"frame": "body"}
                moment = round(1e9 * (START_S + k / rate_hz))
                made.add_message(channel, moment, json.dumps(message).encode(), moment)
        made.finish()
    return path


def test_topics_of_several_rates_come_on_the_clock_of_the_airspeed(tmp_path: Path):
    topics = {
        "/air": (10.0, {"true_airspeed": speed, "aoa [deg]": lambda t: 2.0 + 0.1 * t}),
        "/controls": (5.0, {"elevator": lambda t: 0.01 * np.cos(t)}),
    }
    log = read_log(written(tmp_path / "log.mcap", topics))
    assert {"tas", "aoa", "elevator"} <= log.channels.keys()
    assert log.rate_hz == pytest.approx(10.0)
    since_s = log.time_s - START_S % 86_400.0
    np.testing.assert_allclose(log.channel("tas").values, KNOT * speed(since_s), rtol=1e-6)
    assert any("midnight of 2023-11-14" in note.text for note in log.notes)
    assert set(read_log(tmp_path / "log.mcap", group="air").channels) == {"tas", "aoa"}


def test_what_is_written_is_read_again(tmp_path: Path):
    first = read_log(written(tmp_path / "a.mcap", {"log": (10.0, {"airspeed_true": speed})}))
    write_log(first, tmp_path / "b.mcap")
    again = read_log(tmp_path / "b.mcap")
    np.testing.assert_allclose(again.time_s, first.time_s, atol=1e-6)
    np.testing.assert_array_equal(again.channel("tas").values, first.channel("tas").values)
    assert again.channel("tas").unit == "m/s"


def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path):
    path = written(tmp_path / "ros.mcap", {"imu": (10.0, {"x": speed})}, encoding="cdr")
    with pytest.raises(LogError, match="no signals"):
        read_log(path)
    path = written(tmp_path / "cut.mcap", {"air": (10.0, {"tas": speed})})
    path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(LogError, match=r"cut\.mcap: damaged or truncated MCAP file, .*; export it again"):
        read_log(path)
    with pytest.raises(LogError, match=r"no group 'gps'; the file has: air"):
        read_log(written(tmp_path / "air.mcap", {"air": (10.0, {"tas": speed})}), group="gps")
