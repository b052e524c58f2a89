"""A clock that starts again: boots are told apart from single wrong times, and one of them is read whole."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_dataflash import dataflash_bytes
from made_tlog import tlog_bytes
from noted import texts

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.axis import boot_starts
from bfi_cli.flightlog.rates import in_order
from bfi_cli.flightlog.record import Track


@given(
    boots=st.lists(st.tuples(st.integers(30, 90), st.floats(0.0, 2.0)), min_size=1, max_size=4),
    rate_hz=st.sampled_from([1.0, 5.0, 10.0]),
)
def test_every_boot_of_a_clock_is_found(boots: list[tuple[int, float]], rate_hz: float):
    """Each runs for longer than what a satellite sets a clock back by, and begins near its zero."""
    lengths = [round(seconds * rate_hz) for seconds, _ in boots]
    time_s = np.concatenate([first + np.arange(n) / rate_hz for n, (_, first) in zip(lengths, boots, strict=True)])
    assert boot_starts(time_s) == [0, *np.cumsum(lengths)[:-1].tolist()]


@given(wrong=st.sets(st.integers(0, 299), max_size=2), by=st.sampled_from([-500.0, -3.0, 3.0, 5000.0]))
def test_single_wrong_times_are_no_boot(wrong: set[int], by: float):
    time_s = 100.0 + np.arange(300) / 10.0
    time_s[list(wrong)] += by
    assert boot_starts(time_s) == [0]


def test_times_in_no_order_or_reversed_are_no_boots():
    rng = np.random.default_rng(0)
    assert boot_starts(rng.permutation(1000.0 * np.arange(2000))) == [0]
    assert boot_starts(np.arange(1000.0)[::-1]) == [0]


@given(times=st.lists(st.integers(0, 12), min_size=2, max_size=9))
def test_as_many_samples_as_can_be_are_kept_in_order(times: list[int]):
    """The first 900 are in order, so that few are not."""
    time_s = np.concatenate([np.arange(-900.0, 0.0), times])
    kept, _ = in_order(Track(source="x", channel=None, unit=None, time_s=time_s, values=time_s.copy()))
    assert kept is not None
    assert np.all(np.diff(kept.time_s) > 0.0)
    assert np.array_equal(kept.time_s, kept.values)
    longest = max(n for n in range(1, len(times) + 1) if any(_rises(one) for one in combinations(times, n)))
    assert kept.time_s.size == 900 + longest


def _rises(times: tuple[int, ...]) -> bool:
    return all(a < b for a, b in pairwise(times))


@pytest.mark.parametrize(("make", "name"), [(dataflash_bytes, "a.bin"), (tlog_bytes, "a.tlog")])
def test_two_boots_of_a_recorder_are_each_what_they_are_alone(make, name: str, tmp_path: Path):
    once = make()
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / name).write_bytes(once)
    (tmp_path / name).write_bytes(once + once)
    alone = read_log(tmp_path / "alone" / name)
    for boot in (1, 2):
        log = read_log(tmp_path / name, boot=boot)
        assert np.array_equal(log.time_s, alone.time_s)
        assert log.channels.keys() == alone.channels.keys()
        for key, channel in log.channels.items():
            np.testing.assert_array_equal(channel.values, alone.channels[key].values)
        (note,) = [one for one in texts(log.notes) if "starts again" in one]
        assert f"boot {boot} of 2 is read, as asked for" in note
        assert f"not read: {3 - boot} (" in note
    with pytest.raises(LogError, match=r"--boot 3: the log has 2"):
        read_log(tmp_path / name, boot=3)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
@pytest.mark.parametrize("suffix", ["csv", "h5"])
def test_of_several_boots_that_in_flight_is_read(order: tuple[int, ...], suffix: str, tmp_path: Path):
    """On the ground for longest, a short flight, and the flight."""
    times = [np.arange(900.0), np.arange(60.0), 20.0 + np.arange(300.0)]
    speeds = [np.zeros(900), np.full(60, 20.0), 20.0 + np.sin(0.1 * times[2])]
    time_s, tas = np.concatenate([times[k] for k in order]), np.concatenate([speeds[k] for k in order])
    path = tmp_path / f"a.{suffix}"
    if suffix == "csv":
        np.savetxt(path, np.column_stack([time_s, tas]), delimiter=",", header="time [s],tas [m/s]", comments="")
    else:
        with h5py.File(path, "w") as file:
            for name, values, unit in (("time", time_s, "s"), ("tas", tas, "m/s")):
                file.create_dataset(name, data=values).attrs["units"] = unit
    log = read_log(path)
    assert np.array_equal(log.time_s, times[2])
    np.testing.assert_allclose(log.channels["tas"].values, speeds[2])
    assert "the longest in flight" in texts(log.notes)[0]
    assert read_log(path, boot=order.index(0) + 1).time_s[-1] == 899.0


def test_every_command_that_reads_a_log_takes_a_boot(bfi, tmp_path: Path):
    rows = [(t, 20.0 + k) for k in (0, 1) for t in range(50)]
    (tmp_path / "a.csv").write_text("time [s],tas [m/s]\n" + "".join(f"{t},{v}\n" for t, v in rows))
    assert "boot 2 of 2" in bfi("info", tmp_path / "a.csv", "--boot", 2).stdout
    refused = bfi("info", tmp_path / "a.csv", "--boot", 3)
    assert refused.code == 3
    assert "--boot 3: the log has 2" in refused.stderr
    (tmp_path / "c.yaml").write_text("boot: 1\n")
    assert "boot 1 of 2 is read, as asked for" in bfi("info", tmp_path / "a.csv", "-c", tmp_path / "c.yaml").stdout
