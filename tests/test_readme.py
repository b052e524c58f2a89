"""Every command and every snippet of the README does what it says."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bfi_cli.config import load_config  # noqa: F401  the snippet's imports are lazy, pydantic's warnings are not
from bfi_cli.dictionary import load_dictionary

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text("utf-8")


def block(marker: str) -> str:
    found = re.search(rf"<!-- {marker} -->\n```sh\n(.*?)```", README, re.DOTALL)
    assert found, f"README.md has no block {marker}"
    return found.group(1)


def snippet(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found
    return found.group(1)


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stand in a folder that has what the README's commands read."""
    for name in ("data", "configs"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_main_job_finds_the_injected_bias(bfi: Callable[..., object], checkout: Path) -> None:
    words = shlex.split(block("main-job").rsplit("&&", 1)[1])
    assert words.pop(0) == "bfi"
    outcome = bfi(*words)
    assert outcome.code == 0, outcome.stderr
    assert outcome.stdout.startswith("FAULT  true airspeed reads 4.00")
    (fault,) = json.loads((checkout / "result" / "result.json").read_text())["faults"]
    assert fault["name"] == "bias_13.8"
    assert fault["ci95"][0] <= 4.0 <= fault["ci95"][1]
    assert (checkout / "result" / "report.html").is_file()


def run(bfi: Callable[..., object], marker: str) -> None:
    for line in block(marker).splitlines():
        words = shlex.split(line)
        assert words.pop(0) == "bfi"
        outcome = bfi(*words)
        assert outcome.code == 0, f"{line}: {outcome.stderr}"


@pytest.mark.slow
def test_the_tour_ends_in_a_report_of_the_fault_of_the_log(bfi: Callable[..., object], checkout: Path) -> None:
    run(bfi, "tour")
    (fault,) = json.loads((checkout / "tour" / "report" / "result.json").read_text())["faults"]
    assert fault["name"] == "bias_tas_40"
    assert fault["ci95"][0] <= -3.0 <= fault["ci95"][1]
    assert (checkout / "tour" / "report" / "report.html").is_file()
    assert (checkout / "tour" / "picture" / "zoom.html").is_file()
    (begun,) = json.loads((checkout / "tour" / "onset" / "result.json").read_text())["faults"]
    assert begun["onset_ci95"][0] <= 140.0 <= begun["onset_ci95"][1]


@pytest.mark.slow
def test_what_comes_after_the_tour(bfi: Callable[..., object], checkout: Path) -> None:
    run(bfi, "more")


def test_completion_knows_the_commands() -> None:
    """What the shell asks for is what the line of the README hands to it."""
    assert "_BFI_COMPLETE=bash_source bfi" in block("completion")
    asked = {**os.environ, "_BFI_COMPLETE": "bash_complete", "COMP_WORDS": "bfi pl", "COMP_CWORD": "1"}
    told = subprocess.run([sys.executable, "-m", "bfi_cli"], env=asked, capture_output=True, text=True, check=False)
    assert told.stdout.split() == ["plain,plot"]
    source = {**os.environ, "_BFI_COMPLETE": "bash_source"}
    script = subprocess.run([sys.executable, "-m", "bfi_cli"], env=source, capture_output=True, text=True, check=False)
    assert "_BFI_COMPLETE=bash_complete" in script.stdout


def test_dictionary_of_the_readme_is_one(tmp_path: Path) -> None:
    path = tmp_path / "dictionary.yaml"
    path.write_text(snippet("yaml"))
    assert len(load_dictionary(path).atoms) == 3 + 2 * 9


def test_python_snippet(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(snippet("python"), "README.md", "exec"), {})
    assert capsys.readouterr().out.startswith("bias_13.8 4.00")


def test_ci_reads_the_same_blocks() -> None:
    script = (ROOT / ".ci" / "run").read_text()
    assert "readme_command tests" in script
    assert "readme_command main-job" in script
    assert "readme_command tour" in script
    assert "pip install" in block("tests")
