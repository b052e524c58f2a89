"""From when the times of a log count, in every format that has a clock."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from made_layouts import igc
from made_tdms import write_tdms
from noted import texts

from bfi_cli.epoch import DAY_S, Epoch
from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.raw import ReadRequest
from bfi_cli.flightlog.topics import Recorder, Topic, log_of_topics

N = 40
T = np.arange(N) / 4.0
TAS = 90.0 + np.sin(T)
MAY_S = DAY_S * 19_844  # 2024-05-01
NOON_S = 43_200.0


def csv_of(stamp: str) -> Callable[[Path], None]:
    """Return the writer of a CSV log with stamps and airspeeds; "{}" of a stamp is the second of the minute."""

    def write(path: Path) -> None:
        head = "date,when,tas [m/s]" if stamp.count(",") else "when,tas [m/s]"
        rows = (f"{stamp.format(t)},{tas}" for t, tas in zip(T, TAS, strict=True))
        path.write_text("\n".join([head, *rows]) + "\n")

    return write


def hdf5_from(first_s: float) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file["time"], file["tas"] = first_s + T, TAS

    return write


def rate_alone(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["tas"] = TAS
        file.attrs["sample_rate_hz"] = 4.0


def mcap_of(*topics: str, own_time_s: float | None = None) -> Callable[[Path], None]:
    """Return the writer of an MCAP log; with a field `time` from `own_time_s` on, if that is given."""

    def write(path: Path) -> None:
        writer = pytest.importorskip("mcap.writer")
        with path.open("wb") as file:
            made = writer.Writer(file)
            made.start()
            schema = made.register_schema(name="air", encoding="jsonschema", data=b"{}")
            channels = {name: made.register_channel(name, "json", schema) for name in topics}
            for t, tas in zip(T, TAS, strict=True):
                moment = round(1e9 * (MAY_S + NOON_S + t))
                for name, channel in channels.items():
                    message = {name: tas} if own_time_s is None else {name: tas, "time": own_time_s + t}
                    made.add_message(channel, moment, json.dumps(message).encode(), moment)
            made.finish()

    return write


def tdms(path: Path) -> None:
    write_tdms(path, TAS, 0.01 * TAS)


def igc_file(path: Path) -> None:
    igc(path)


def igc_without_date(path: Path) -> None:
    igc(path)
    path.write_text("".join(line for line in path.read_text().splitlines(True) if not line.startswith("HFDTE")))


IN_UTC = Epoch(since_1970_s=MAY_S, is_utc=True)
UNSTATED = Epoch(since_1970_s=MAY_S, is_utc=False)
NO_DAY = Epoch(since_1970_s=0.0, is_utc=False, is_dated=False)
UNIX = Epoch(since_1970_s=0.0, is_utc=True)


@pytest.mark.parametrize(
    ("write", "first_s", "epoch"),
    [
        (csv_of("2024-05-01T12:00:{:05.2f}Z"), NOON_S, IN_UTC),
        (csv_of("2024-05-01T14:00:{:05.2f}+02:00"), NOON_S, IN_UTC),
        (csv_of("2024-05-01 12:00:{:05.2f}"), NOON_S, UNSTATED),
        (csv_of("2024-05-01,12:00:{:05.2f}"), NOON_S, UNSTATED),
        (csv_of("12:00:{:05.2f}"), NOON_S, NO_DAY),
        (igc_file, DAY_S - 99.5, IN_UTC),
        (igc_without_date, DAY_S - 99.5, Epoch(since_1970_s=0.0, is_utc=True, is_dated=False)),
        (tdms, NOON_S + 0.25, IN_UTC),
        (mcap_of("tas"), NOON_S, IN_UTC),
        (mcap_of("tas", "pitch"), NOON_S, IN_UTC),
        (mcap_of("tas", own_time_s=7.0), 7.0, None),
        (mcap_of("tas", own_time_s=MAY_S + NOON_S), MAY_S + NOON_S, UNIX),
        (hdf5_from(0.0), 0.0, None),
        (hdf5_from(MAY_S + NOON_S), MAY_S + NOON_S, UNIX),
        (rate_alone, 0.0, None),
    ],
)
def test_the_moment_from_which_times_count(
    write: Callable[[Path], None], first_s: float, epoch: Epoch | None, tmp_path: Path
):
    path = tmp_path / "log"
    write(path)
    log = read_log(path)
    assert log.time_s[0] == pytest.approx(first_s, abs=1e-6)
    assert log.epoch == epoch
    midnights = [text for text in texts(log.notes) if "midnight" in text]
    zone = " UTC" if epoch == IN_UTC else ""
    assert midnights == ([f"time counts from midnight of 2024-05-01{zone}"] if epoch in (IN_UTC, UNSTATED) else [])


def test_another_time_axis_than_the_clock_has_none(tmp_path: Path):
    path = tmp_path / "log.csv"
    rows = (f"12:00:{t:05.2f},{t},{tas}" for t, tas in zip(T, TAS, strict=True))
    path.write_text("\n".join(["when,elapsed [s],tas [m/s]", *rows]) + "\n")
    assert read_log(path).epoch == NO_DAY
    assert read_log(path, channel_map={"time": "elapsed"}).epoch is None


def test_a_part_of_a_log_counts_from_the_same_midnight(tmp_path: Path):
    path = tmp_path / "log.csv"
    csv_of("2024-05-01T12:00:{:05.2f}Z")(path)
    log = read_log(path)
    assert log.window(NOON_S + 2.0, NOON_S + 5.0).epoch == IN_UTC
    assert read_log(path, from_s=NOON_S + 2.0).epoch == IN_UTC


def test_a_message_has_every_digit_of_an_axis_since_1970(tmp_path: Path):
    path = tmp_path / "log.h5"
    hdf5_from(MAY_S + NOON_S)(path)
    with pytest.raises(
        LogError, match=r"between 7 s and 8 s, the log runs from 1714564800 s to 1714564809.75 s; change"
    ):
        read_log(path).window(7.0, 8.0)


def test_a_clock_that_another_program_states_is_no_midnight(tmp_path: Path):
    path = tmp_path / "log.h5"
    hdf5_from(0.0)(path)
    with h5py.File(path, "r+") as file:
        file.attrs["clock"] = "internal, 10 MHz"
    assert read_log(path).epoch is None


@pytest.mark.parametrize(
    ("head", "stamp", "epoch"),
    [
        ("when", "2024-05-01T12:00:{:05.2f}Z", Epoch(since_1970_s=MAY_S + NOON_S - 7.0, is_utc=True)),
        ("date,when", "2024-05-01,12:00:{:05.2f}", Epoch(since_1970_s=MAY_S + NOON_S - 7.0, is_utc=False)),
        ("when", "12:00:{:05.2f}", Epoch(since_1970_s=NOON_S - 7.0, is_utc=False, is_dated=False)),
        ("when", "2024-05-01T12:00:00Z", None),  # a clock that stands still
    ],
)
def test_a_clock_beside_a_time_axis_of_seconds(head: str, stamp: str, epoch: Epoch | None, tmp_path: Path):
    path = tmp_path / "log.csv"
    rows = (f"{stamp.format(t)},{7.0 + t},{tas}" for t, tas in zip(T, TAS, strict=True))
    path.write_text("\n".join([f"{head},time [s],tas [m/s]", *rows]) + "\n")
    log = read_log(path)
    assert log.time_s[0] == 7.0
    assert log.epoch == epoch
    assert epoch is None or epoch.time_of_day(7.0) == "12:00:00"


@pytest.mark.parametrize(
    ("recorder", "name", "fields"),
    [
        ("px4", "vehicle_gps_position", {"time_utc_usec": 1e6 * (MAY_S + NOON_S + T), "vel_m_s": TAS}),
        ("mavlink", "SYSTEM_TIME", {"unix_usec": 1e6 * (MAY_S + NOON_S + T)}),
        ("ardupilot", "GPS", {"GWk": np.full(N, 2312), "GMS": 1e3 * (302_418.0 + T), "Spd": TAS}),
    ],
)
def test_autopilots_have_the_clock_of_their_receiver(recorder: Recorder, name: str, fields: dict[str, np.ndarray]):
    """Once the receiver has it: before, it writes zeros."""
    fields = {key: np.where(np.arange(N) < 5, 0.0, values) for key, values in fields.items()}
    speeds = {"px4": "airspeed.true_airspeed_m_s", "mavlink": "VFR_HUD.airspeed", "ardupilot": "ARSP.Airspeed"}
    topic, field = speeds[recorder].split(".")
    topics = [
        Topic(name=name, instance=0, time_s=20.0 + T, fields=fields),
        Topic(name=topic, instance=0, time_s=20.0 + T, fields={field: TAS}),
    ]
    raw = log_of_topics("log", recorder, topics, ReadRequest())
    expected = Epoch(since_1970_s=MAY_S + NOON_S - 20.0, is_utc=True)
    assert {column.epoch for column in raw.columns} == {expected}
    assert {column.epoch for column in log_of_topics("log", recorder, topics[1:], ReadRequest()).columns} == {None}
