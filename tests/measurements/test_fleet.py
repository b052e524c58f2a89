"""Many logs: equal to calls on each alone, the same tables however often killed, on a cluster too; what they cost.

python -m pytest tests/measurements/test_fleet.py -m slow -s     BFI_FULL=1 for 200 logs and 10 kills
"""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from bars import FULL, fewest
from made_fleet import flight, flown, make_fleet

from bfi_cli.fleet import LogAnswer, fleet_files, rows_of_constants, trends_of
from bfi_cli.flight.plausibility.constants import constant_errors
from bfi_cli.flightlog import read_log, write_log
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.serialization import provenance, without_series

ROOT = Path(__file__).resolve().parents[2]
N_LOGS, N_BROKEN, N_KILLS = (200, 20, 10) if FULL else (6, 2, 1)
N_ROWS = 10_000
LARGEST_INDEX = 5_000_000  # bytes, at 10 000 logs
LARGEST_WORKER = 400e6  # bytes
CUT_S = 150.0  # of a recorded flight: whole ones take minutes each
LIMIT_S = 3000.0
# m/s, of the error of an airspeed between flights: more than that of the true airspeed by the other air data in four
# flights each of a Citation (0.03) and an SR22T (0.14).
SCATTER = 0.2
# What no log is: empty, text, the first bytes of formats, a table without time.
BROKEN = (
    b"",
    b"no log\n",
    b"\x89HDF\r\n\x1a\n" + bytes(60),
    b"PK\x03\x04",
    b"time,tas\n0,1\n",
    b"ULog\x01\x12\x35\x01",
)


def many_logs(folder: Path, flights: Path | None, n: int, n_broken: int) -> list[Path]:
    """Write logs: cuts of recorded flights with a shifted clock, simulated ones, and broken ones; return the paths."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    recorded = sorted(flights.glob("*.h5")) if flights is not None else []
    for k in range(n - n_broken):
        path = recorded[k // 2 % len(recorded)] if recorded and k % 2 else None
        if path is None:
            (folder / f"{k:03d}_made.csv").write_text(flight(seed=k))
            continue
        log = read_log(path)
        first, last = max(airborne_stretches(log), key=lambda one: one[1] - one[0])
        from_s = float(rng.uniform(first, max(first, last - CUT_S)))
        part = log.window(from_s, min(from_s + CUT_S, last))
        write_log(part, folder / f"{k:03d}_{path.stem}.h5")
    for k in range(n_broken):
        (folder / f"{k:03d}_broken.csv").write_bytes(BROKEN[k % len(BROKEN)] + b"\n" * (k // len(BROKEN)))
    return sorted(folder.iterdir())


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "bfi_cli", "diagnose", *map(str, words)]


ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def run(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*words), env=ENVIRONMENT, capture_output=True, text=True, check=False)


def plain(document: dict) -> dict:
    """Return a document without its series and what tells one run from another."""
    return {**without_series(document), "provenance": {**document["provenance"], "command": "", "date": ""}}


def results(out: Path) -> dict[str, object]:
    """Return the tables of a fleet, and by folder the document of each log."""
    tables = {path.name: path.read_bytes() for path in out.iterdir() if re.match(r"(flights|events)\.", path.name)}
    assert len(tables) == 2
    return tables | {path.parent.name: plain(json.loads(path.read_text("utf-8"))) for path in out.glob("*/result.json")}


@dataclass
class Watch:
    """The largest memory of workers, bytes."""

    peaks: dict[int, float] = field(default_factory=dict)


@contextmanager
def watched(parent: int) -> Iterator[Watch]:
    """Watch the workers of a process while the block runs."""
    watch, over = Watch(), threading.Event()

    def look() -> None:
        while not over.wait(0.2):
            for path in Path("/proc").glob("[0-9]*"):
                with suppress(OSError, ValueError, IndexError):
                    if int((path / "stat").read_text().rpartition(")")[2].split()[1]) == parent:
                        peak = re.search(r"VmHWM:\s+(\d+) kB", (path / "status").read_text())
                        if peak:
                            watch.peaks[int(path.name)] = 1024.0 * float(peak[1])

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield watch
    finally:
        over.set()
        thread.join()


@pytest.mark.slow
def test_equal_to_calls_on_each_log_alone(bfi: Callable, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = ROOT.parent / "shared" / "flights"
    logs = many_logs(tmp_path / "logs", folder if folder.is_dir() else None, N_LOGS, N_BROKEN)
    listed = tmp_path / "all.jsonl"
    seconds = {}
    for workers in (1, 2) if FULL else (2,):
        begun = time.monotonic()
        words = command(tmp_path / "logs", "--workers", workers, "--jsonl", listed, "--out", tmp_path / str(workers))
        process = subprocess.Popen(words, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        with watched(process.pid) as watch:
            errors = process.communicate(timeout=LIMIT_S)[1]
        seconds[workers] = time.monotonic() - begun
        assert process.returncode == 0
        assert f"{N_BROKEN} of {len(logs)} logs could not be read" in errors
    peak = max(watch.peaks.values())
    with capsys.disabled():
        print(f"{len(logs)} logs, {N_BROKEN} broken; seconds by workers {seconds}; largest worker {peak / 1e6:.0f} MB")
    assert peak <= LARGEST_WORKER
    documents = [json.loads(line) for line in listed.read_text("utf-8").splitlines()]
    assert [one["log"]["path"] for one in documents] == list(map(str, logs))
    for path, document in zip(logs, documents, strict=True):
        alone = bfi("diagnose", path, "--workers", 1, "--json")
        if document["kind"] == "unread":
            assert (alone.code, alone.stderr) == (3, document["error"] + "\n")
        else:
            assert plain(document) == plain(json.loads(alone.stdout)), path
    if FULL:
        assert results(tmp_path / "1") == results(tmp_path / "2")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    """Return a folder of logs, and what one worker that nobody disturbs makes of them."""
    folder = tmp_path_factory.mktemp("whole")
    make_fleet(folder / "logs", N_LOGS // 2, N_BROKEN)
    assert run(folder / "logs", "--workers", 1, "--out", folder / "out").returncode == 0
    return folder / "logs", results(folder / "out")


@pytest.mark.slow
def test_killed_at_random_moments_and_continued(whole: tuple[Path, dict[str, object]], tmp_path: Path):
    logs, undisturbed = whole
    out, moments = tmp_path / "killed", random.Random(0)
    done = []
    for wanted in sorted(moments.sample(range(1, N_LOGS // 2), N_KILLS)):
        process = subprocess.Popen(
            command(logs, "--workers", 2, "--out", out),
            env=ENVIRONMENT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        until = time.monotonic() + LIMIT_S
        while len(list(out.glob("*/result.json"))) < wanted:
            assert process.poll() is None
            assert time.monotonic() < until
            time.sleep(moments.uniform(0.0, 0.1))
        process.send_signal(signal.SIGKILL)
        process.wait()
        done.append(len(list(out.glob("*/result.json"))))
    assert run(logs, "--workers", 2, "--out", out).returncode == 0
    print(f"answers at {N_KILLS} kills: {done} of {N_LOGS // 2}")
    assert results(out) == undisturbed
    assert not list(out.glob("*/.bfi-*"))
    lines = (out / "store.jsonl").read_text("utf-8").splitlines()[1:]
    assert len(lines) == len({json.loads(line)["log"] for line in lines}) == N_LOGS // 2 + N_BROKEN


@pytest.mark.slow
def test_a_cluster_of_two_workers_of_which_one_is_killed(whole: tuple[Path, dict[str, object]], tmp_path: Path):
    distributed = pytest.importorskip("distributed")
    (logs, undisturbed), out = whole, tmp_path / "cluster"
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        words = command(logs, "--scheduler", cluster.scheduler_address, "--out", out)
        process = subprocess.Popen(words, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        until = time.monotonic() + LIMIT_S
        while process.poll() is None and not list(out.glob("*/result.json")):
            assert time.monotonic() < until
            time.sleep(0.05)
        os.kill(pids[0], signal.SIGKILL)
        errors = process.communicate(timeout=LIMIT_S)[1]
    assert process.returncode == 0, errors
    assert results(out) == undisturbed


def flights_of(seed: int, n: int, growth_m_s: float) -> list[LogAnswer]:
    """Return the flights of an aircraft whose airspeed errs by `growth_m_s` more in each, and by what else there is.

    Gusts of 0.7 m/s, a wind of each flight, in a tenth of them another fault, of 3 m/s, and a scatter of SCATTER.
    """
    rng = np.random.default_rng(seed)
    made = []
    for k in range(n):
        other = SCATTER * rng.normal() + 3.0 * rng.choice([-1.0, 1.0]) * (rng.uniform() < 0.1)
        log = flown(error_m_s=growth_m_s * k + other, gust_m_s=0.7, seed=1000 * seed + k)
        constants = rows_of_constants(constant_errors(log))
        made.append(LogAnswer(log="", folder="", key="", sha256="", aircraft="N1", flight={}, constants=constants))
    return made


@pytest.mark.slow
def test_a_position_error_that_grows_is_told_by_flight_20_and_none_where_none_does():
    n = 100 if FULL else 4
    told = [trends_of(flights_of(seed, 20, 0.05)) for seed in range(n)]
    right = [next(one for one in trends if (one.channel, one.by) == ("tas", "circles")) for trends in told]
    found = sum(one.is_declared for one in right)
    covered = sum(one.ci95[0] <= 0.05 <= one.ci95[1] for one in right)
    false = sum(any(one.is_declared for one in trends_of(flights_of(1000 + seed, 40, 0.0))) for seed in range(n))
    slopes = np.quantile([one.slope for one in right], [0.25, 0.5, 0.75])
    print(f"{n} aircraft: found {found}, intervals that hold {covered}, slopes {slopes.round(3)}; false {false} of {n}")
    assert FULL or (found, covered, false) == (n, n, 0)  # of these every answer is known
    assert found >= fewest(n, 0.9)
    assert covered >= fewest(n, 0.95)
    assert n - false >= fewest(n, 0.95)


def answers(n: int) -> Sequence[LogAnswer]:
    """Return simulated answers with texts of usual lengths: a third with a fault, a few that could not be read."""
    rng = np.random.default_rng(0)
    made = []
    for k in range(n):
        log = f"archive/2026/aircraft_{k % 40:02d}/flight_{k:06d}_recorder.h5"
        same = {"log": log, "folder": f"flight_{k:06d}_recorder", "key": f"{k:064x}", "sha256": f"{k:064x}"}
        if k % 50 == 0:
            made.append(LogAnswer(**same, error=f"{log}: the file is empty; copy or export it again", flight={}))
            continue
        onset_s, size = float(rng.uniform(0.0, 5000.0)), float(rng.normal())
        event = {"state": "declared", "fault": "tas", "shape": "drift", "onset_s": onset_s, "magnitude": size}
        span = {"start_s": 0.0, "stop_s": 5000.0, "n_samples": 50_000, "rate_hz": 10.0, "flight_s": 4500.0}
        is_fault = k % 3 == 0
        text = f"pitot icing from {onset_s:.6g} s, {size:.4g} 1/s, tas {size:.3g} m/s"
        made.append(
            LogAnswer(
                **same,
                decision="fault" if is_fault else "inconclusive",
                state="fault" if is_fault else "cannot_tell",
                rank=0 if is_fault else 3,
                summary=text if is_fault else "x" * 90,
                hidden="static leak lagged_bias 43 m",
                flight={**span, "declared": int(is_fault), **(event if is_fault else {}), "could_hide": "x" * 30},
                rows=(event,) * is_fault,
            )
        )
    return made


@pytest.mark.slow
def test_what_ten_thousand_logs_cost_beside_their_analysis():
    made = answers(N_ROWS)
    begun = time.process_time()
    files = fleet_files("diagnose", made, provenance(log_sha256=""))
    seconds = time.process_time() - begun
    sizes = {name: len(content) for name, content in files.items()}
    print(f"{N_ROWS} logs: {1e3 * seconds / N_ROWS:.3f} ms a log for tables and index; bytes {sizes}")
    assert sizes["index.html"] <= LARGEST_INDEX
