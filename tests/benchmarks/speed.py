"""Processor time of whole commands beside that of 0.1.0 and 0.2.0, paired in one run.

    python -m tests.benchmarks.speed                     # three rounds of all rows but those of a day
    python -m tests.benchmarks.speed --rounds 1 --rows readme
    python -m tests.benchmarks.speed --rows day --limit 1200

Worktrees of both commits are made in a temporary folder. In each round every row is run by every version, one directly
after the other, so that a busy machine slows all of them alike; a time is that of the child process and all of its
children, user and system. Modules are compiled in a round before, as those of an installed version are. A ratio is the
median over the rounds, with the least and the largest beside it.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
FLIGHTS = ROOT.parent / "shared" / "flights"
COMMITS = {"0.1.0": "eace9160", "0.2.0": "687f02ae"}
NOW = "now"
# Steps of m/s that the log of the dictionaries holds, and the entries of each dictionary that they are: parts of it.
STEPS = {1 / 8: 1.5, 33 / 80: -2.2, 51 / 80: 0.8, 7 / 8: 2.9}
FIRST_S, SPAN_S = 6.0, 106.0
IDENTIFY_README = ("identify", "data/citation_bias.h5", "-d", "configs/thesis_dictionary.yaml")


@dataclass(frozen=True, kw_only=True)
class Row:
    """A command that is timed: its words, files of the temporary folder as `TMP/name`.

    Attributes
    ----------
    against : the version, or the row of this version, whose time the bar is a share of.
    bar : largest ratio.
    megabytes : largest resident memory of one process, None where no bar is on it.
    program : what the interpreter is asked to run; the words of a command follow.
    """

    words: tuple[str, ...]
    against: str
    bar: float
    megabytes: float | None = None
    program: tuple[str, ...] = ("-m", "bfi_cli")


ROWS = {
    "import of the library": Row(words=(), program=("-c", "import bfi_cli.analysis"), against="0.2.0", bar=0.5),
    "identify, readme, --json": Row(words=(*IDENTIFY_README, "--json"), against="0.1.0", bar=0.7),
    "identify, readme, report": Row(words=(*IDENTIFY_README, "--out", "TMP/report"), against="0.1.0", bar=1.2),
    "start-time, readme": Row(words=("start-time", "data/citation_bias.h5", "--json"), against="0.2.0", bar=0.25),
    "identify, px4, airdata": Row(
        words=("identify", "data/px4_bias.ulg", "-d", "airdata", "--json"), against="0.2.0", bar=0.25
    ),
    "start-time, 120 s at 2 Hz": Row(words=("start-time", "TMP/120s.h5", "--json"), against="0.2.0", bar=1.0),
    "start-time, 80 min at 2 Hz": Row(
        words=("start-time", "TMP/80min.h5", "--json"), against="start-time, 120 s at 2 Hz", bar=30.0
    ),
    "80 entries": Row(words=("identify", "TMP/steps.h5", "-d", "TMP/80.yaml", "--json"), against="0.2.0", bar=0.3),
    "400 entries": Row(words=("identify", "TMP/steps.h5", "-d", "TMP/400.yaml", "--json"), against="80 entries", bar=2),
    "2000 entries": Row(
        words=("identify", "TMP/steps.h5", "-d", "TMP/2000.yaml", "--json"), against="80 entries", bar=4
    ),
    "diagnose, 80 min at 10 Hz": Row(
        words=("diagnose", "FLIGHTS/citation_20180312_f1.h5", "--json"), against="0.2.0", bar=0.25, megabytes=300
    ),
    **{
        f"day at 100 Hz, {words[0]}": Row(
            words=(words[0], "TMP/day.h5", *words[1:]), against="0.2.0", bar=1.0, megabytes=1000
        )
        for words in (
            ("info", "--json"),
            ("plot", "--out", "TMP/plot"),
            ("convert", "-o", "TMP/converted.h5", "--force"),
            ("diagnose", "--json"),
            ("identify", "-d", "thesis", "--json"),
        )
    },
}


@dataclass(frozen=True, kw_only=True)
class Usage:
    """What a process took: seconds of processors, megabytes at most; whether it ended with an answer."""

    seconds: float
    megabytes: float
    answered: bool


@contextmanager
def worktree(commit: str) -> Iterator[Path]:
    """Yield a folder that holds a commit."""
    with tempfile.TemporaryDirectory() as folder:
        git = ("git", "-C", str(ROOT), "worktree")
        subprocess.run((*git, "add", "--quiet", "--detach", folder, commit), check=True)
        try:
            yield Path(folder)
        finally:
            subprocess.run((*git, "remove", "--force", folder), check=True)


def usage_of(tree: Path, row: Row, files: Path, limit_s: int) -> Usage:
    """Run a command of a tree and return what it took; it is ended after `limit_s` seconds of a processor."""
    places = {"TMP/": f"{files}/", "FLIGHTS/": f"{FLIGHTS}/"}
    words = list(row.words)
    for place, folder in places.items():
        words = [word.replace(place, folder) for word in words]
    process = subprocess.Popen(
        [sys.executable, *row.program, *words],
        cwd=tree,
        env={
            **os.environ,
            "PYTHONPATH": str(tree),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONDONTWRITEBYTECODE": "",
            "PYTHONPYCACHEPREFIX": str(files / "compiled"),
        },
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s)),
    )
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Usage(
        seconds=usage.ru_utime + usage.ru_stime, megabytes=usage.ru_maxrss / 1e3, answered=process.returncode == 0
    )


def make_files(folder: Path, day: bool) -> None:
    """Write the logs and the dictionaries of the rows."""

    def bfi(*words: str) -> None:
        subprocess.run([sys.executable, "-m", "bfi_cli", *words], cwd=ROOT, check=True, capture_output=True)

    flown = ("simulate", "citation", "--manoeuvre", "multisine", "--noise", "tas=0.02", "--seed", "80")
    for name, duration_s, rate_hz in (("120s", 120, 2), ("80min", 4800, 2), ("healthy", 120, 20)):
        bfi(*flown, "--duration", str(duration_s), "--rate", str(rate_hz), "-o", str(folder / f"{name}.h5"))
    faults = [f"bias,channel=tas,magnitude={z},onset_s={FIRST_S + SPAN_S * part}" for part, z in STEPS.items()]
    words = ("inject", str(folder / "healthy.h5"), *(word for fault in faults for word in ("--fault", fault)))
    bfi(*words, "-o", str(folder / "steps.h5"))
    for n in (80, 400, 2000):
        atoms = [{"name": f"step_{k}", "shape": "bias", "onset_s": FIRST_S + SPAN_S * k / n} for k in range(n)]
        (folder / f"{n}.yaml").write_text(yaml.safe_dump({"channel": "tas", "atoms": atoms}))
    if day:
        sys.path.insert(0, str(Path(__file__).parent))
        from test_long_records import write_day

        write_day(folder / "day.h5")


def table(times: dict[str, dict[str, list[Usage]]]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield f"{'what':30} {'0.1.0':>8} {'0.2.0':>8} {'now':>8}  ratio (least to largest) of              bar"
    for name, of_versions in times.items():
        row, now = ROWS[name], of_versions[NOW]
        base = of_versions.get(row.against) or times.get(row.against, {}).get(NOW)
        shown = []
        for version in (*COMMITS, NOW):
            usages = of_versions.get(version, [])
            seconds = f"{statistics.median(one.seconds for one in usages):.2f}" if usages else "-"
            shown.append(("" if all(one.answered for one in usages) else ">") + seconds)
        line = f"{name:30} " + " ".join(f"{one:>8}" for one in shown)
        if base is not None:
            ratios = [mine.seconds / other.seconds for mine, other in zip(now, base, strict=True)]
            middle = statistics.median(ratios)
            met = middle <= row.bar and all(one.answered for one in now)
            line += f"  {middle:.2f} ({min(ratios):.2f} to {max(ratios):.2f}) of {row.against}"
            line += f", bar {row.bar:g}: {'met' if met else 'missed'}"
        if row.megabytes is not None:
            line += f"; {max(one.megabytes for one in now):.0f} MB, bar {row.megabytes:g}"
        yield line


def main() -> None:
    """Time the rows and print the table; exit with 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rows", default="", help="only rows whose name holds this; those of a day only if named")
    parser.add_argument("--versions", nargs="*", default=list(COMMITS), choices=list(COMMITS))
    parser.add_argument("--limit", type=int, default=120, help="seconds of a processor after which a command is ended")
    asked = parser.parse_args()
    names = [name for name in ROWS if asked.rows in name and (name.startswith("day") <= asked.rows.startswith("day"))]
    names = [name for name in names if FLIGHTS.is_dir() or "FLIGHTS" not in " ".join(ROWS[name].words)]
    names = [name for name in ROWS if name in names or name in {ROWS[n].against for n in names}]
    times: dict[str, dict[str, list[Usage]]] = {}
    with ExitStack() as stack:
        files = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        trees = {version: stack.enter_context(worktree(COMMITS[version])) for version in asked.versions}
        trees[NOW] = ROOT
        make_files(files, any(name.startswith("day") for name in names))
        for tree in trees.values():
            for compiling in ("import of the library", "identify, readme, report"):
                usage_of(tree, ROWS[compiling], files, asked.limit)
        for turn in range(asked.rounds):
            for name in names:
                wanted = [version for version in trees if version in (NOW, "0.2.0", ROWS[name].against)]
                for version in wanted:
                    usage = usage_of(trees[version], ROWS[name], files, asked.limit)
                    times.setdefault(name, {}).setdefault(version, []).append(usage)
            print(f"round {turn + 1} of {asked.rounds}", file=sys.stderr)
    lines = list(table(times))
    print("\n".join(lines))
    raise SystemExit(any("missed" in line for line in lines))


if __name__ == "__main__":
    main()
