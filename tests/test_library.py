"""What Python gives is what the command gives: each call, on the sample logs, by both roads."""

from __future__ import annotations

import importlib
import json
import pkgutil
import types
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import bfi_cli
from bfi_cli import Config, merge, read_log, write_log
from bfi_cli.detection import detect_document
from bfi_cli.flight import diagnose_document
from bfi_cli.lab.compare import PEERS, compare_document
from bfi_cli.model.onset import onset_document
from bfi_cli.model.result import identify_document
from bfi_cli.serialization import provenance, to_json

DATA = Path(__file__).parents[1] / "data"
THESIS = Path(__file__).parents[1] / "configs" / "thesis_dictionary.yaml"
QUICK = {"conditioning.rate_hz": 4.0, "model.order": 2}
QUICKLY = ("--rate", "4", "--order", "2")
DOCUMENTS: dict[str, Callable[..., Any]] = {
    "compare": compare_document,
    "detect": detect_document,
    "diagnose": diagnose_document,
    "identify": identify_document,
    "start-time": onset_document,
}
BIAS, PEER = DATA / "citation_bias.csv", "arx-residual"
ROADS = {
    ("identify", BIAS, "-d", THESIS, *QUICKLY): partial(
        bfi_cli.identify, dictionary=THESIS, config=merge(Config(), QUICK)
    ),
    ("start-time", BIAS, *QUICKLY): partial(bfi_cli.start_time, config=merge(Config(), QUICK)),
    ("diagnose", DATA / "citation_clean.h5", "--workers", "1"): bfi_cli.diagnose,
    ("detect", BIAS): bfi_cli.detect,
    ("compare", BIAS, "-d", THESIS, "--only", PEER): partial(
        bfi_cli.compare, dictionary=THESIS, peers={PEER: PEERS[PEER]}
    ),
    ("identify", DATA / "citation_clean.h5", "-d", "airdata", *QUICKLY): partial(
        bfi_cli.identify, dictionary="airdata", config=merge(Config(), QUICK)
    ),
    ("identify", DATA / "citation_two_faults.h5", *QUICKLY): partial(bfi_cli.identify, config=merge(Config(), QUICK)),
    ("diagnose", BIAS, "--workers", "1"): bfi_cli.diagnose,
    ("diagnose", DATA / "px4_bias.ulg", "--workers", "1"): bfi_cli.diagnose,
}


@pytest.mark.first_rows(5)
@pytest.mark.parametrize("words", ROADS, ids=lambda words: f"{words[0]} {words[1].name}")
def test_a_call_gives_the_document_of_its_command(bfi: Any, words: tuple[Any, ...]) -> None:
    result = ROADS[words](read_log(words[1]))
    document = DOCUMENTS[words[0]](result, provenance(log_sha256=""))
    called, commanded = json.loads(to_json(document)), json.loads(bfi(*words, "--json", "--series").stdout)
    for one in (called, commanded):
        assert one.pop("provenance")
        for outcome in one.get("outcomes", ()):
            assert outcome.pop("seconds") >= 0.0
    assert called == commanded


@pytest.mark.parametrize(
    ("words", "settings"),
    [
        ((), {}),
        (
            ("--duration", 5, "--noise", "tas=0.01", "--seed", 3),
            {"duration_s": 5.0, "noise_sd": {"tas": 0.01}, "seed": 3},
        ),
    ],
    ids=["defaults", "noise"],
)
def test_a_simulation_is_that_of_the_command(bfi: Any, tmp_path: Path, words: tuple[Any, ...], settings: Any) -> None:
    assert bfi("simulate", "citation", "-o", tmp_path / "log.csv", *words).code == 0
    write_log(bfi_cli.simulate("citation", **settings), tmp_path / "called.csv")
    assert (tmp_path / "called.csv").read_text() == (tmp_path / "log.csv").read_text()


def test_what_the_command_prints_on_the_way_is_told() -> None:
    sentences: list[str] = []
    config = merge(Config(), {**QUICK, "start_time.shapes": ["bias"]})
    log = read_log(DATA / "px4_bias.ulg")
    without = replace(log, channels={name: one for name, one in log.channels.items() if name != "elevator"})
    result = bfi_cli.start_time(without, config, tell=sentences.append)
    assert any("elevator" in sentence for sentence in sentences)
    assert {*sentences} <= {note.text for note in result.notes}


def test_no_package_hides_a_call() -> None:
    for module in pkgutil.walk_packages(bfi_cli.__path__, "bfi_cli."):
        if module.name != "bfi_cli.__main__":
            importlib.import_module(module.name)
    replaced = {*bfi_cli._REPLACED, "__version__"}
    for name in {*bfi_cli.__all__} - replaced:
        assert callable(getattr(bfi_cli, name)), name
        assert not isinstance(getattr(bfi_cli, name), types.ModuleType), name


@pytest.mark.parametrize(("name", "instead"), bfi_cli._REPLACED.items())
def test_a_replaced_name_warns_and_names_what_takes_its_place(name: str, instead: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"call bfi_cli.{instead}"):
        assert callable(getattr(bfi_cli, name))
