"""How much of the house one answer goes through: what a newcomer reads who follows it. It may shrink and never grow."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# `identify` on README's log in a fresh process. A file runs where it is imported, and takes part where a function of it
# is called, other than in making its constants; a type is made where its generated constructor runs.
COUNTED = """
import contextlib, inspect, io, json, sys

called, made, importing = set(), set(), 0

def seen(frame, event, _):
    global importing
    code, body = frame.f_code, frame.f_code.co_name == "<module>"
    if body and event in ("call", "return"):
        importing += 1 if event == "call" else -1
    if event != "call":
        return
    if "bfi_cli" in code.co_filename and code.co_flags & inspect.CO_OPTIMIZED and not importing:
        called.add(code.co_filename)
    elif code.co_name == "__init__" and code.co_filename == "<string>":
        kind = type(frame.f_locals.get("self"))
        if kind.__module__.startswith("bfi_cli"):
            made.add(f"{kind.__module__}.{kind.__qualname__}")

from bfi_cli.commands import run_command

sys.setprofile(seen)
with contextlib.redirect_stdout(io.StringIO()):
    code = run_command(["identify", "data/citation_bias.h5", "-d", "configs/thesis_dictionary.yaml", "--json"])
sys.setprofile(None)
imported = {name for name in sys.modules if name.partition(".")[0] == "bfi_cli"}
packages = {name for name in ("scipy.linalg", "scipy.special") if name in sys.modules}
print(json.dumps({
    "code": code, "imported": sorted(imported), "called": sorted(called), "made": sorted(made),
    "packages": sorted(packages),
}))
"""
# What is counted, how much of it there is today, and the most that the house is to have.
COUNTS = (("imported", 102, None), ("called", 79, 80), ("made", 83, 60))
MISSED = pytest.param("made", marks=pytest.mark.xfail(strict=True, reason="83 types are made, several for one concept"))


@cache
def counts() -> dict[str, list[str]]:
    done = subprocess.run([sys.executable, "-c", COUNTED], cwd=ROOT, capture_output=True, text=True, check=True)
    counted = json.loads(done.stdout)
    assert counted.pop("code") == 0
    return counted


@pytest.mark.parametrize(("what", "today"), [row[:2] for row in COUNTS])
def test_an_answer_goes_through_no_more_than_today(what: str, today: int):
    assert len(counts()[what]) <= today, "\n".join(counts()[what])


@pytest.mark.parametrize("what", ["called", MISSED])
def test_an_answer_goes_through_a_house_that_is_read_in_a_day(what: str):
    (most,) = (most for counted, _, most in COUNTS if counted == what)
    assert len(counts()[what]) <= most


def test_an_answer_imports_no_package_that_takes_as_long_as_its_analysis():
    """The routines of LAPACK and the special functions are imported alone."""
    assert counts()["packages"] == []


def test_functions_imported_alone_are_those_of_their_packages():
    program = "from bfi_cli.kernels.compiled import lapack, part_of_scipy, special\n"
    program += "optimize = part_of_scipy('optimize', '_optimize', 'scipy.optimize')\n"
    program += "import scipy.linalg, scipy.optimize, scipy.special, scipy.stats\n"
    program += "assert lapack.dtrtrs is scipy.linalg.lapack.dtrtrs and special.ndtri is scipy.special.ndtri\n"
    program += "assert optimize.fminbound is scipy.optimize.fminbound"
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True)
