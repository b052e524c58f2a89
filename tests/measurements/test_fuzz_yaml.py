"""What damaged YAML does to the loaders and to the command line: a line that says so, or a right answer."""

from __future__ import annotations

import json
import os
import random
import resource
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from trials import sized

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import load_config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import BfiError
from bfi_cli.flightlog import write_log
from bfi_cli.lab.montecarlo import load_sweep

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
FILES: dict[str, Callable[[Path], object]] = {
    "example.yaml": load_config,
    "thesis_dictionary.yaml": load_dictionary,
    "airdata_dictionary.yaml": load_dictionary,
    "montecarlo_thesis.yaml": load_sweep,
}
MUTATIONS = sized(500, 0.3)
LONGEST_LINE = 4000
MOST_MEMORY = 1_000_000_000
SPECIALS = (
    *(
        "&a ",
        "*a",
        "!!int ",
        "!!binary ",
        "!x ",
        "<<: *a",
        "- ",
        "? ",
        ": ",
        "|\n",
        ">\n",
        "%YAML 1.1\n",
        "---\n",
        "...\n",
    ),
    *("{", "}", "[", "]", "#", '"', "'", "\t", "\0", "\x85", "\u2028", "\ufeff", "\U0001f600", "null", "~", "true"),
    *(
        ".inf",
        "-.inf",
        ".nan",
        "1e999",
        "-0",
        "0x" + "f" * 5000,
        "9" * 5000,
        "1e5000",
        "-1",
        "0",
        "1e-320",
        '"\\ud800"',
    ),
    *("[" * 2000, "{a: " * 500, "x" * 100_000, '"\\UFFFFFFFF"', "2001-01-01", "12:30:00", "../../../etc/passwd"),
    "&x [1, 1, 1, 1, 1, 1, 1, 1, 1]\nb: &y [*x, *x, *x, *x, *x, *x, *x, *x]\nc: &z [*y, *y, *y, *y, *y, *y, *y, *y]\n",
)


def mutated(content: bytes, rng: random.Random) -> bytes:
    """Return the bytes with one to three changes."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        at = rng.randrange(len(content) + 1)
        end = min(len(content), at + rng.choice((1, 2, 8, 40)))
        match rng.randrange(6):
            case 0:
                content = content[:at] + bytes([rng.randrange(256)]) + content[at + 1 :]
            case 1:
                content = content[:at] + content[end:]
            case 2:
                content = content[:end] + content[at:end] * rng.choice((1, 3, 50)) + content[end:]
            case 3:
                words = content.split(b" ")
                i, j = rng.randrange(len(words)), rng.randrange(len(words))
                words[i], words[j] = words[j], words[i]
                content = b" ".join(words)
            case 4:
                content = content[:at] + rng.choice(SPECIALS).encode() + content[at:]
            case _:  # in place of a value
                lines = content.split(b"\n")
                i = rng.randrange(len(lines))
                key, colon, _ = lines[i].partition(b": ")
                lines[i] = key + colon + rng.choice(SPECIALS).encode()
                content = b"\n".join(lines)
    return content


def said_well(line: str) -> bool:
    """Return whether a message is one line of the house form."""
    return "\n" not in line and ": " in line and ("; " in line or "must " in line) and len(line) <= LONGEST_LINE


@pytest.mark.parametrize("name", FILES)
def test_loaders(name: str, tmp_path: Path):
    rng = random.Random(f"loaders {name}")
    content = (ROOT / "configs" / name).read_bytes()
    for other in FILES:
        (tmp_path / other).write_bytes((ROOT / "configs" / other).read_bytes())
    path = tmp_path / "damaged.yaml"
    outcomes: Counter[str] = Counter()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for n in range(MUTATIONS):
        path.write_bytes(mutated(content, rng))
        try:
            FILES[name](path)
        except BfiError as error:
            outcomes["refused" if said_well(str(error)) else f"{n}: {error}"] += 1
        except Exception as error:
            outcomes[f"{n}: {error!r}"] += 1
        else:
            outcomes["read"] += 1
    print(f"\n{name}: {dict(outcomes)} of {MUTATIONS}")
    assert set(outcomes) == {"refused", "read"}
    assert 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) < MOST_MEMORY


# One process for all command lines of a file: its peak is that of the worst.
RUN = """
import contextlib, io, json, sys
from bfi_cli.commands import run_command
done = []
for argv in json.load(sys.stdin):
    printed, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
        code = run_command(argv)
    done.append([code, printed.getvalue(), said.getvalue()])
with open("/proc/self/status") as status:  # that of `getrusage` includes the program which started this one
    print(json.dumps([done, next(int(line.split()[1]) for line in status if line.startswith("VmHWM"))]))
"""


@pytest.mark.parametrize("name", ["example.yaml", "thesis_dictionary.yaml", "airdata_dictionary.yaml"])
def test_command_line(name: str, tmp_path: Path):
    """The whole program: exit 0, 2, 3 or 4, one line or an answer, bounded memory."""
    rng = random.Random(f"commands {name}")
    content = (ROOT / "configs" / name).read_bytes()
    log = tmp_path / "log.csv"
    for other in FILES:
        (tmp_path / other).write_bytes((ROOT / "configs" / other).read_bytes())
    time_s = time_axis(duration_s=31.72, rate_hz=20.0)
    elevator = manoeuvre("3211", time_s)
    rng_of_noise = np.random.default_rng(0)
    write_log(simulate(MODELS["citation"], elevator, rng=rng_of_noise, noise_sd={"tas": 0.01}, rate_hz=20.0), log)
    log.write_text(log.read_text().replace("tas [m/s]", "my_airspeed"))  # as the configuration calls it
    lines = []
    for n in range(MUTATIONS // 10):
        (tmp_path / f"{n}.yaml").write_bytes(mutated(content, rng))
        of_config = ["identify", "log.csv", "-c", f"{n}.yaml", "-d", "thesis_dictionary.yaml", "--json"]
        lines.append(["dictionary", f"{n}.yaml", "--json"] if "dictionary" in name else of_config)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", RUN]
    finished = subprocess.run(
        command, cwd=tmp_path, env=environment, input=json.dumps(lines), capture_output=True, text=True, check=True
    )
    done, peak = json.loads(finished.stdout)
    outcomes: Counter[int] = Counter()
    wrong = []
    for argv, (code, printed, said) in zip(lines, done, strict=True):
        outcomes[code] += 1
        if code in (2, 3):
            fine = printed == "" and said_well(said.removesuffix("\n")) and said[:-1].isprintable()
        else:
            fine = code in (0, 4) and json.loads(printed)["kind"] == argv[0] and said == ""
        wrong += [] if fine else [(argv, code, said[:500])]
    print(f"\n{name}: exit codes {dict(sorted(outcomes.items()))}, at most {1.024e-3 * peak:.0f} MB")
    assert wrong == []
    assert outcomes[2] > 0
    assert outcomes[0] > 0
    assert 1024 * peak < MOST_MEMORY
