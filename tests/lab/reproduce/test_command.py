"""`bfi reproduce`: the list, one figure, all of them, complaints."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bfi_cli.flightlog import read_log, write_log
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.lab.reproduce import catalogue
from bfi_cli.lab.reproduce.catalogue import REPRODUCTIONS, reproduce_content

DATA = Path(__file__).parents[3] / "data"
Run = Callable[..., Any]
JSON = ("--json", "--series")


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave two reproductions, one of them under two names."""
    first = REPRODUCTIONS["thesis-5-1"]
    kept = {"thesis-5-1": first, "thesis-5-1-again": first, "thesis-5-13": REPRODUCTIONS["thesis-5-13"]}
    monkeypatch.setattr(catalogue, "REPRODUCTIONS", kept)
    monkeypatch.setattr("bfi_cli.lab.reproduce.catalogue.REPRODUCTIONS", kept)


@pytest.mark.parametrize("words", [(), ("list",)])
def test_without_a_name_the_names_are_listed(words: tuple[str, ...], bfi: Run):
    done = bfi("reproduce", *words, *JSON)
    document = json.loads(done.stdout)
    assert (done.code, document["name"]) == (0, "list")
    assert [row[0] for row in reproduce_content(document).tables[0].rows] == list(REPRODUCTIONS)


@pytest.mark.slow
def test_a_figure_is_written_with_everything_that_draws_it_again(bfi: Run, tmp_path: Path):
    done = bfi("reproduce", "fir", "--quick", "--trials", 1, "--seed", 3, "--out", tmp_path / "fir", *JSON)
    assert done.code == 0, done.stderr
    document = json.loads(done.stdout)
    assert document == json.loads((tmp_path / "fir/result.json").read_text())
    assert document["provenance"]["seed"] == 3
    names = {path.name for path in (tmp_path / "fir").iterdir()}
    assert {"report.html", "fir_condition.svg", "fir_condition.png", "fir_noise.svg", "comparison.csv"} <= names
    assert "1 per point, seed 3" in dict(reproduce_content(document).facts)["Trials"]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_content_and_another_another(bfi: Run):
    first, again, other = (
        json.loads(bfi("reproduce", "fir", "--quick", "--trials", 1, "--seed", seed, *JSON).stdout)["exhibit"]
        for seed in (1, 1, 2)
    )
    assert first == again
    assert first["drawings"] != other["drawings"]


def test_an_error_of_a_trial_names_the_log_of_the_user(bfi: Run, tmp_path: Path):
    log = read_log(DATA / "citation_clean.h5")
    values = log.channel("tas").values.copy()
    values[1500:1600] = np.nan  # longer than what is interpolated
    tas = replace(log.channel("tas"), values=frozen_array(values))
    write_log(replace(log, channels={**log.channels, "tas": tas}), tmp_path / "holes.h5")
    done = bfi("reproduce", "thesis-5-3", "--quick", "--trials", 1, "--log", tmp_path / "holes.h5", *JSON)
    notes = [note["text"] for note in json.loads(done.stdout)["notes"]]
    (failed,) = [note for note in notes if "failed" in note]
    assert f"the first: {tmp_path / 'holes.h5'}: 'tas' is not a number at sample 1500" in failed


def test_a_log_takes_the_place_of_the_simulated_record(bfi: Run):
    done = bfi("reproduce", "thesis-5-1", "--log", DATA / "citation_clean.h5", "--from", 0, "--to", 20, *JSON)
    document = json.loads(done.stdout)
    assert done.code == 0, done.stderr
    assert len(document["provenance"]["log_sha256"]) == 64
    ours = {row[0]: row[2] for row in reproduce_content(document).tables[0].rows}
    assert ours["samples"] == "2000"


@pytest.mark.slow
@pytest.mark.usefixtures("few")
def test_all_makes_each_in_a_folder_of_its_own_and_names_what_a_log_does_not_allow(bfi: Run, tmp_path: Path):
    """The first ten seconds end before the fault of figure 5-13."""
    log = ("--log", DATA / "citation_clean.h5", "--to", 10)
    done = bfi("reproduce", "all", "--quick", *log, "--out", tmp_path, *JSON)
    assert done.code == 2
    rows = reproduce_content(json.loads(done.stdout)).tables[0].rows
    assert [row[0] for row in rows] == ["thesis-5-1", "thesis-5-1-again", "thesis-5-13"]
    assert [row[2] == "not made" for row in rows] == [False, False, True]
    for name in ("thesis-5-1", "thesis-5-1-again"):
        assert json.loads((tmp_path / name / "result.json").read_text())["name"] == name
    assert not (tmp_path / "thesis-5-13").exists()
    assert (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("thesis-5-33",), 2, "did you mean 'thesis-5-3'"),
        (("fir", "--from", "3"), 2, "--from: is about the record of --log, and there is none; give --log FILE"),
        (("fir", "--trials", "0"), 2, "--trials"),
        (("thesis-5-1", "--log", "no.h5"), 3, "no.h5"),
        (("thesis-5-1", "--log", DATA / "citation_bias.h5"), 3, "give the fault-free one"),
        (
            ("benchmark", "--quick", "--log", DATA / "citation_clean.h5"),
            3,
            "citation_clean.h5: 31.72 s are less than the 60 s of a trial",
        ),
    ],
)
def test_what_the_user_can_mend_is_one_line(words: tuple[object, ...], code: int, message: str, bfi: Run):
    done = bfi("reproduce", *words)
    assert (done.code, done.stdout) == (code, "")
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
