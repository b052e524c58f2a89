"""Messages with clocks of their own on one time base, and the folders of `ulog2csv`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_px4 import START_S, pitch, px4_topics, tas, write_ulog2csv
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.quality import is_uniform
from bfi_cli.flightlog.rates import in_order, mean_rate, one_base
from bfi_cli.flightlog.record import Track
from bfi_cli.flightlog.topics import RECORDERS, Topic, completed, maps_of, tracks_of
from bfi_cli.kernels.quantisation import find_quantum


def track(time_s, values, *, channel: str | None = "tas", source: str = "", **more) -> Track:
    return Track(
        source=source or channel or "x",
        channel=channel,
        unit=None,
        time_s=np.asarray(time_s, float),
        values=np.asarray(values, float),
        **more,
    )


def columns(*tracks: Track) -> dict[str, np.ndarray]:
    return {column.source: column.values for column in one_base("a.log", tracks).columns}


@given(rate_hz=st.floats(0.5, 200.0), start=st.floats(0.0, 1e5), slope=st.floats(-5.0, 5.0), fast=st.integers(1, 12))
def test_a_straight_line_stays_one_at_every_rate(rate_hz: float, start: float, slope: float, fast: int):
    """Interpolation and a symmetric low-pass of unit gain reproduce a line away from its ends."""
    t = start + np.arange(100) / rate_hz
    u = start + 0.3 / rate_hz + np.arange(100 * fast) / (fast * rate_hz)
    of = columns(track(t, 10.0 + slope * (t - start)), track(u, slope * (u - start), channel="pitch"))
    inner = slice(4, -4)
    line = slope * (of["time"] - start)
    np.testing.assert_allclose(of["tas"][inner], 10.0 + line[inner], atol=1e-6 * (1.0 + np.abs(line).max()))
    np.testing.assert_allclose(of["pitch"][inner], line[inner], atol=1e-6 * (1.0 + np.abs(line).max()))
    assert is_uniform(of["time"])


def test_the_airspeed_itself_is_not_touched_where_its_clock_is_even():
    t = np.arange(300) / 5.0
    x = np.random.default_rng(0).normal(size=t.size)
    of = columns(track(t, x))
    np.testing.assert_allclose(of["time"], t, atol=1e-9)
    np.testing.assert_allclose(of["tas"], x, atol=1e-9)


def test_a_faster_signal_is_low_passed_and_not_aliased():
    t, u = np.arange(300) / 5.0, np.arange(3000) / 50.0
    alias = columns(track(t, t), track(u, np.sin(2.0 * np.pi * 9.9 * u), channel="pitch"))["pitch"]
    passed = columns(track(t, t), track(u, np.sin(2.0 * np.pi * 0.2 * u), channel="pitch"))["pitch"]
    assert np.abs(alias[5:-5]).max() < 0.01
    np.testing.assert_allclose(passed[5:-5], np.sin(2.0 * np.pi * 0.2 * t)[5:-5], atol=0.02)


def test_a_slower_signal_is_held_and_said_so():
    t, u = np.arange(300) / 10.0, np.arange(30) / 1.0
    made = one_base("a.log", [track(t, t), track(u, u**2, channel="wind_north", source="wind.n")])
    held = next(column for column in made.columns if column.source == "wind.n")
    np.testing.assert_array_equal(held.values[:250], np.floor(t[:250] + 1e-9) ** 2)
    assert held.rate_hz == pytest.approx(1.0)
    assert any("held between their samples: wind_north (1 Hz)" in note for note in texts(made.notes))


def test_a_gap_of_the_base_has_no_samples():
    t = np.concatenate([np.arange(100), np.arange(150, 300)]) / 5.0
    time_s = columns(track(t, t))["time"]
    assert not np.any((time_s > 19.9) & (time_s < 29.9))
    assert time_s.size == t.size


@pytest.mark.parametrize("rate_hz", [1.0, 5.0, 50.0])
def test_a_gap_of_another_signal_is_missing_and_not_bridged(rate_hz: float):
    """Where the gap begins and ends, at most the patience of the slower clock is filled."""
    t, u = np.arange(500) / 5.0, np.arange(round(100.0 * rate_hz)) / rate_hz
    u = u[(u < 40.0) | (u > 60.0)]
    other = columns(track(t, t), track(u, np.where(u < 50.0, 0.0, 1.0), channel="pitch"))["pitch"]
    assert np.isnan(other[(t > 40.0 + 1.8 / rate_hz) & (t < 60.0 - 0.01)]).all()
    outside = ((t < 39.0) & (t > 1.0)) | ((t > 61.0) & (t < 98.0))
    assert set(np.round(other[outside], 12)) == {0.0, 1.0}


def test_an_angle_passes_the_end_of_its_range():
    t, u = np.arange(300) / 5.0, np.arange(3000) / 50.0
    turning = 3.0 + 0.1 * u
    wrapped = (turning + np.pi) % (2.0 * np.pi) - np.pi
    yaw = columns(track(t, t), track(u, wrapped, channel="yaw", turn=2.0 * np.pi))["yaw"][4:-4]
    assert np.abs(yaw).max() <= np.pi
    np.testing.assert_allclose(np.exp(1j * yaw), np.exp(1j * (3.0 + 0.1 * t[4:-4])), atol=1e-6)


def test_a_signal_that_comes_late_is_missing_before_and_one_a_little_late_shortens_the_log():
    t = np.arange(500) / 5.0
    late = track(t[250:], t[250:], channel="pitch")
    little = track(t[5:], t[5:], channel="roll")
    made = one_base("a.log", [track(t, t), late, little])
    of = {column.source: column.values for column in made.columns}
    assert of["time"][0] == pytest.approx(1.0)
    assert np.isnan(of["pitch"][: 250 - 6]).all()
    assert np.isfinite(of["roll"]).all()
    assert any("missing at the start of the log, until: pitch (50 s)" in note for note in texts(made.notes))
    assert any("starts at 1 s, 1 s after its first signal" in note for note in texts(made.notes))


@pytest.mark.parametrize("burst", [1, 3, 5])
def test_the_rate_is_the_mean_one_also_where_messages_come_in_bursts(burst: int):
    """The median step of bursts says hundreds of Hz."""
    t = np.repeat(np.arange(200) * burst / 4.0, burst) + np.tile(np.arange(burst) * 0.002, 200)
    assert mean_rate(t) == pytest.approx(4.0, rel=0.02)


def test_odd_steps_do_not_change_the_rate_of_a_regular_clock():
    t = np.concatenate([np.arange(300) * 0.2, 59.9 + np.arange(300) * 0.2])
    assert mean_rate(t) == pytest.approx(5.0, rel=1e-9)


@given(wrong=st.lists(st.integers(2, 197), max_size=2, unique=True), by=st.floats(-1e3, 1e3))
def test_samples_out_of_order_are_left_out_and_the_rest_is_right(wrong: list[int], by: float):
    t = np.arange(200) / 10.0
    shifted = t.copy()
    shifted[wrong] += by
    kept, _ = in_order(track(shifted, 3.0 * t))
    if kept is not None:
        assert np.all(np.diff(kept.time_s) > 0.0)
        assert len(wrong) > 1 or kept.time_s.size >= 198


def test_a_clock_that_runs_backwards_often_is_refused():
    kept, why = in_order(track(np.tile(np.arange(10.0), 20), np.ones(200)))
    assert kept is None
    assert "the clock runs backwards" in (why or "")
    with pytest.raises(LogError, match=r"a\.log: no channels"):
        one_base("a.log", [track([1.0], [2.0])])


def test_euler_angles_are_those_of_the_rotation():
    from scipy.spatial.transform import Rotation

    turn = Rotation.random(50, random_state=np.random.default_rng(0))
    x, y, z, w = turn.as_quat().T
    topic = completed(
        Topic(name="a", instance=0, time_s=np.arange(50.0), fields={f"q[{i}]": q for i, q in enumerate((w, x, y, z))})
    )
    yaw, pitch_, roll = turn.as_euler("ZYX").T
    for name, angle in (("yaw", yaw), ("pitch", pitch_), ("roll", roll)):
        np.testing.assert_allclose(topic.fields[name], angle, atol=1e-12)


def test_every_map_is_of_a_known_channel_and_unit():
    from bfi_cli.quantities.channels import STANDARD, si_unit

    for row in (row for recorder in RECORDERS for row in maps_of(recorder) if row.channel):
        assert si_unit(row.unit) in (STANDARD[row.channel].unit, "1"), row


def test_the_second_sensor_of_a_kind_is_a_channel_of_its_own():
    t = np.arange(50) / 5.0
    fields = {"airspeed": "true_airspeed_m_s", "vehicle_air_data": "baro_pressure_pa", "vehicle_local_position": "vz"}
    topics = [
        Topic(name=name, instance=i, time_s=t, fields={field: np.full(50, 20.0 + i)})
        for name, field in fields.items()
        for i in (2, 0)
    ]
    assert [(one.channel, one.source) for one in tracks_of("px4", topics, ())] == [
        ("tas", "airspeed.true_airspeed_m_s"),
        ("tas_2", "airspeed_2.true_airspeed_m_s"),
        ("p_static", "vehicle_air_data.baro_pressure_pa"),
        ("p_static_2", "vehicle_air_data_2.baro_pressure_pa"),
        # Cores of one filter are no sensors.
        ("gps_altitude_rate", "vehicle_local_position.vz"),
        ("gps_altitude_rate", "vehicle_local_position_2.vz"),
    ]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_ulog2csv(tmp_path / "flight", px4_topics())


def test_a_folder_of_ulog2csv(folder: Path):
    log = read_log(folder)
    t = log.time_s
    assert log.rate_hz == pytest.approx(5.0)
    assert START_S <= t[0] < START_S + 0.5
    assert set(log.channels) >= {"tas", "ias", "pitch", "roll", "yaw", "longitudinal_acc", "normal_acc", "elevator"}
    assert log.channels["tas"].source == "airspeed_validated.true_airspeed_m_s"
    np.testing.assert_allclose(log.channels["tas"].values, tas(t), atol=1e-5)
    inner = slice(4, -4)
    np.testing.assert_allclose(log.channels["pitch"].values[inner], pitch(t)[inner], atol=1e-3)
    np.testing.assert_allclose(
        log.channels["longitudinal_acc"].values, 9.80665 * np.sin(log.channels["pitch"].values), atol=2e-3
    )
    np.testing.assert_allclose(log.channels["normal_acc"].values, 0.0, atol=1e-5)
    np.testing.assert_allclose(log.channels["elevator"].values[inner], -0.3 * np.sin(1.3 * t)[inner], atol=0.003)
    assert log.channels["pitch"].own_rate_hz == pytest.approx(50.0)
    assert "wind_east" not in log.channels
    notes = " ".join(texts(log.notes))
    assert "battery_status; take a field of one with --channel NAME=topic.field" in notes
    assert "'airspeed_wind.windspeed_east': left out with 0 samples that are numbers" in notes
    assert "'airspeed.true_airspeed_m_s' is a second tas" in notes


def test_jitter_is_said_and_the_base_made_uniform(tmp_path: Path):
    log = read_log(write_ulog2csv(tmp_path / "flight", px4_topics(jitter=0.2)))
    assert is_uniform(log.time_s)
    np.testing.assert_allclose(log.channels["tas"].values, tas(log.time_s), atol=0.01)
    assert any("were made uniform" in note for note in texts(log.notes))


def test_any_field_can_be_mapped_and_the_mapped_airspeed_gives_the_base(folder: Path):
    log = read_log(folder, channel_map={"gear": "battery_status.nav_state", "tas": "airspeed.true_airspeed_m_s"})
    assert set(log.channels["gear"].values) == {1.0}
    assert log.rate_hz == pytest.approx(1.0)
    assert log.channels["tas"].source == "airspeed.true_airspeed_m_s"


def test_two_logs_in_a_folder_are_told_apart(folder: Path):
    write_ulog2csv(folder, px4_topics(rate_hz=2.0), log="other_day")
    with pytest.raises(LogError, match="several groups: flight, other_day; give one of them with --group"):
        read_log(folder)
    assert read_log(folder, group="other_day").rate_hz == pytest.approx(2.0)


def test_the_digest_is_that_of_the_files(folder: Path):
    first = read_log(folder).sha256
    assert read_log(folder).sha256 == first
    with open(folder / "flight_airspeed_0.csv", "a") as file:
        file.write("170000000,20.0\n")
    assert read_log(folder).sha256 != first


def test_a_topic_without_samples_and_a_damaged_cell_are_named(folder: Path):
    (folder / "flight_airspeed_wind_0.csv").write_text("timestamp,windspeed_north\n")
    assert any("topics without samples are left out: airspeed_wind" in note for note in texts(read_log(folder).notes))
    damaged = folder / "flight_airspeed_0.csv"
    damaged.write_text(damaged.read_text()[:-6] + "x.y\n")
    notes = texts(read_log(folder).notes)
    assert any(re.match(r"flight_airspeed_0\.csv: '.*': 1 cell is not a number, the first '.*x\.y'", n) for n in notes)


def test_one_file_of_a_folder_has_all_its_fields(folder: Path):
    log = read_log(folder / "flight_vehicle_attitude_0.csv")
    assert log.rate_hz == pytest.approx(50.0)
    assert {"pitch", "roll", "yaw", "vehicle_attitude.q[0]"} <= set(log.channels)
    np.testing.assert_allclose(log.channels["pitch"].values, pitch(log.time_s), atol=1e-6)


def test_a_folder_of_other_things_is_refused(tmp_path: Path):
    with pytest.raises(LogError, match="is a directory without files of ulog2csv"):
        read_log(tmp_path)
    write_ulog2csv(tmp_path, {("battery_status", 0): px4_topics()["battery_status", 0]})
    with pytest.raises(LogError, match="no topic with channels in the names of its files"):
        read_log(tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("unscanned")
def test_info_identify_and_inject_take_a_folder(bfi, folder: Path, tmp_path: Path):
    document = json.loads(bfi("info", folder, "--json").stdout)
    rates = {channel["name"]: channel["own_rate_hz"] for channel in document["channels"]}
    assert (rates["tas"], rates["pitch"], rates["wind_north"]) == (5.0, 50.0, 1.0)
    assert "own rate" in bfi("info", folder).stdout
    fault = "bias,channel=tas,magnitude=-3,onset_s=130"
    assert bfi("inject", folder, "--fault", fault, "-o", tmp_path / "faulty.h5").code == 0
    (tmp_path / "d.yaml").write_text("atoms:\n  - {shape: bias, onset_s: 130}\n")
    argv = ["-d", tmp_path / "d.yaml", "--input", "pitch", "--input", "longitudinal_acc", "--order", 2, "--json"]
    answer = bfi("identify", tmp_path / "faulty.h5", *argv)
    assert answer.code == 0
    assert json.loads(answer.stdout)["faults"][0]["magnitude"] == pytest.approx(-3.0, abs=0.1)
    assert bfi("identify", folder, *argv).code == 0


@pytest.mark.parametrize(
    ("step", "unit"),
    [(0.02, None), (1.0, None), (5.0, None), (20.0, "ms"), (200.0, "ms"), (20_000.0, "us"), (1e6, "us")],
)
def test_the_unit_of_time_follows_from_its_step(step: float, unit: str | None, tmp_path: Path):
    rows = "".join(f"{step * k!r},{100.0 + k!r}\n" for k in range(50))
    (tmp_path / "a.csv").write_text("timestamp,speed\n" + rows)
    log = read_log(tmp_path / "a.csv")
    scale = {None: 1.0, "ms": 1e-3, "us": 1e-6}[unit]
    assert log.rate_hz == pytest.approx(1.0 / (step * scale))
    assert [note for note in texts(log.notes) if "are taken for" in note] == [
        note for note in texts(log.notes) if unit and f"taken for {unit} (" in note
    ]


@pytest.mark.parametrize("step", [2000.0, 1e13])
def test_a_step_that_suits_two_units_is_refused(step: float, tmp_path: Path):
    rows = "".join(f"{step * k!r},{100.0 + k!r}\n" for k in range(50))
    (tmp_path / "a.csv").write_text("timestamp,speed\n" + rows)
    with pytest.raises(LogError, match="'timestamp' states no unit, and its steps of"):
        read_log(tmp_path / "a.csv")
    assert read_log(tmp_path / "a.csv", unit_map={"timestamp": "ns"}).n_samples == 50


@given(
    rate_hz=st.sampled_from([3.0, 7.0, 15.0, 30.0, 60.0]), decimals=st.sampled_from([2, 3]), start=st.floats(0.0, 1e4)
)
def test_times_rounded_to_decimals_are_made_even(rate_hz: float, decimals: int, start: float, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "rounded.csv"
    t = start + np.arange(200) / rate_hz
    path.write_text("time,tas\n" + "".join(f"{one:.{decimals}f},{k % 7}\n" for k, one in enumerate(t)))
    log = read_log(path)
    if not is_uniform(np.round(t, decimals)):
        assert is_uniform(log.time_s)
        assert any("are rounded to" in note for note in texts(log.notes))
    np.testing.assert_allclose(log.time_s, t, atol=1.01 * 10.0**-decimals)


def written(path: Path, t: np.ndarray) -> np.ndarray:
    """Return the times that are read of times written with two decimals."""
    path.write_text("time,tas\n" + "".join(f"{one:.2f},{k % 7}\n" for k, one in enumerate(t)))
    return read_log(path).time_s


def test_jitter_beyond_rounding_and_a_gap_stay(tmp_path: Path):
    t = np.arange(200) / 30.0
    jitter = t + 0.01 * np.random.default_rng(0).uniform(-1, 1, t.size)
    np.testing.assert_array_equal(written(tmp_path / "a.csv", jitter), np.round(jitter, 2))
    gap = np.where(t > 3.0, t + 0.31, t)
    read = written(tmp_path / "b.csv", gap)
    np.testing.assert_allclose(read, gap, atol=0.01)
    steps = 30.0 * np.diff(read)
    np.testing.assert_allclose(np.delete(steps, 90), 1.0, rtol=1e-3)
    assert 10.0 < steps[90] < 10.6


@pytest.mark.realdata
def test_the_recorded_flight(flights: Path):
    """Against the files themselves, read by numpy; the airspeed's clock has two half steps in 970 s."""
    log = read_log(flights / "px4_flight3")
    assert log.rate_hz == pytest.approx(5.0, rel=1e-4)
    raw = np.genfromtxt(flights / "px4_flight3/flight3_airspeed_validated_0.csv", delimiter=",", names=True)
    at = np.interp(log.time_s, raw["timestamp"] * 1e-6, raw["true_airspeed_m_s"])
    assert np.max(np.abs(log.channels["tas"].values - at)) < 1e-3
    attitude = np.genfromtxt(flights / "px4_flight3/flight3_vehicle_attitude_0.csv", delimiter=",", names=True)
    w, x, y, z = (attitude[f"q{i}"] for i in range(4))
    theta = np.interp(log.time_s, attitude["timestamp"] * 1e-6, np.arcsin(2.0 * (w * y - x * z)))
    flying = (log.time_s > 1100.0) & (log.time_s < 1394.0)
    assert np.sqrt(np.mean((log.channels["pitch"].values - theta)[flying] ** 2)) < 0.01
    rates = {name: channel.own_rate_hz for name, channel in log.channels.items()}
    assert rates["pitch_rate"] == pytest.approx(50.0, rel=1e-3)
    assert rates["q_impact"] == pytest.approx(1.0, rel=1e-3)
    assert {"velocity_north", "velocity_east", "elevator", "throttle", "altitude"} <= set(log.channels)


@pytest.mark.realdata
@pytest.mark.parametrize("onset_s", [1220])  # test_px4_flight has more
def test_a_bias_added_to_the_recorded_flight_is_found(bfi, flights: Path, tmp_path: Path, onset_s: int):
    """In flight the log runs from 1100 to 1394 s; the approach is left out. No shipped table fits 5 Hz and a drone."""
    fault = f"bias,channel=tas,magnitude=-3,onset_s={onset_s}"
    assert bfi("inject", flights / "px4_flight3", "--fault", fault, "-o", tmp_path / "faulty.h5").code == 0
    window = ("--from", 1105, "--to", 1375, "--input", "pitch", "--input", "longitudinal_acc")
    answer = bfi("start-time", tmp_path / "faulty.h5", *window, "--calibration", "gaussian", "--json")
    found = json.loads(answer.stdout)["faults"]
    near = [one for one in found if abs(one["onset_s"] - onset_s) <= 0.5]
    assert [one["shape"] for one in near] == ["bias"]
    assert near[0]["magnitude"] == pytest.approx(-3.0, abs=0.6)


@pytest.mark.parametrize(
    ("fields", "hover"),
    [
        ({"vehicle_vtol_state": [0, 1, 2, 3, 4]}, [0.0, 0.5, 0.5, 1.0, 0.0]),
        ({"vtol_state": [3, 4]}, [1.0, 0.0]),
        ({"vtol_in_rw_mode": [1, 1, 0], "vtol_in_trans_mode": [0, 1, 0]}, [1.0, 0.5, 0.0]),
        ({"vehicle_type": [1, 2, 2], "in_transition_mode": [0, 1, 0], "is_vtol": [1, 1, 1]}, [1.0, 0.5, 0.0]),
        ({"vehicle_type": [1, 1], "in_transition_mode": [0, 0], "is_vtol": [0, 0]}, None),  # a multicopter
        ({"vehicle_type": [2, 2], "in_transition_mode": [0, 0], "is_vtol": [0, 0]}, None),  # a fixed wing
        ({"custom_mode": [10, 17, 20, 24], "type": [1] * 4, "autopilot": [3] * 4}, [0.0, 1.0, 1.0, 0.0]),
        ({"custom_mode": [17, 20], "type": [2] * 2, "autopilot": [3] * 2}, None),  # ArduCopter's modes are others
    ],
)
def test_the_states_of_a_vtol_tell_what_carries_it(fields: dict[str, list[int]], hover: list[float] | None):
    n = len(next(iter(fields.values())))
    values = {name: np.array(one) for name, one in fields.items()}
    made = completed(Topic(name="status", instance=0, time_s=np.arange(n, dtype=float), fields=values)).fields
    assert (None if "hover" not in made else made["hover"].tolist()) == hover


def test_a_signal_that_is_low_passed_to_the_clock_of_the_log_keeps_its_steps():
    """An airliner's vane, 8 Hz in steps of 0.25 degrees, beside an airspeed of 1 Hz: no level of it is left."""
    slow, fast = np.arange(120.0), np.arange(960.0) / 8.0
    angle = np.round((4.0 + 2.0 * np.sin(0.3 * fast)) / 0.25) * 0.25
    speed = track(slow, 70.0 + np.sin(slow))
    log = one_base("a.log", [speed, track(fast, angle, channel="aoa")])
    by_source = {column.source: column for column in log.columns}
    assert find_quantum(by_source["aoa"].values) is None
    assert by_source["aoa"].step == pytest.approx(0.25)
    assert one_base("a.log", [speed, track(slow, angle[::8], channel="aoa")]).columns[2].step == pytest.approx(0.25)
