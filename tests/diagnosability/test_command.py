"""`bfi diagnosability`: a log, a model, files, complaints."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bfi_cli.config import Config, merge
from bfi_cli.diagnosability import assess_manoeuvres

ROOT = Path(__file__).parents[2]
BIAS = ROOT / "data" / "citation_bias.h5"
THESIS = ROOT / "configs" / "thesis_dictionary.yaml"
FLOWN = ("--model", "citation", "-d", THESIS, "--draws", 1)


@pytest.mark.usefixtures("undrawn")
def test_a_log(bfi, tmp_path: Path):
    outcome = bfi("diagnosability", BIAS, "-d", THESIS, "--magnitude", 0.5, "--out", tmp_path / "out", "--json")
    document = json.loads(outcome.stdout)
    assert (outcome.code, outcome.stderr) == (0, "")
    assert (document["kind"], len(document["atoms"]), document["draws"]) == ("diagnosability", 7, 1)
    assert {atom["magnitude"] for atom in document["atoms"]} == {0.5}
    assert len(document["provenance"]["log_sha256"]) == len(document["provenance"]["dictionary_sha256"]) == 64
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"result.json", "report.html", "faults.csv", "divergence.svg", "divergence.png"} <= written
    assert json.loads((tmp_path / "out" / "result.json").read_text()) == document


@pytest.mark.slow
def test_a_model(bfi, thesis):
    words = ("--manoeuvre", "doublet", "--manoeuvre", "none", "--noise", "tas=0.05", "--at-limit", "--seed", 3)
    outcome = bfi("diagnosability", *FLOWN, *words, "--amplitude", 0.05, "--magnitude", "bias_13.8=2", "--json")
    document = json.loads(outcome.stdout)
    assert (outcome.code, outcome.stderr) == (0, "")
    stated = {"model": "citation", "manoeuvres": ["doublet"], "noise": {"tas": 0.05}, "amplitude_rad": 0.05, "draws": 1}
    config = merge(Config(), {"seed": 3, **{f"diagnosability.{key}": value for key, value in stated.items()}})
    (expected,) = assess_manoeuvres(thesis, config).manoeuvres
    best, unusable = document["manoeuvres"]
    assert (document["best"], document["in_limits"], unusable["bits"]) == ("doublet", True, None)
    assert best["minimal_detectable"] == pytest.approx(expected.minimal_detectable, rel=1e-12)
    sizes = [atom["magnitude"] / atom["minimal_detectable"] for atom in document["atoms"]]
    assert sizes == pytest.approx([2.0 if atom["name"] == "bias_13.8" else 1.0 for atom in document["atoms"]])


@pytest.mark.slow
def test_the_configuration_names_dictionary_and_window(bfi, tmp_path: Path):
    config = tmp_path / "c.yaml"
    config.write_text(f"dictionary: {THESIS}\nwindow: {{from_s: 2, to_s: 25}}\nmodel: {{order: 4}}\n")
    document = json.loads(bfi("diagnosability", BIAS, "-c", config, "--json").stdout)
    assert document["model"]["order"] == 4
    assert 2.0 <= document["log"]["start_s"] < document["log"]["stop_s"] < 25.0


@pytest.mark.slow
def test_every_key_of_the_configuration_acts(bfi, tmp_path):
    file = tmp_path / "c.yaml"
    file.write_text(
        f"dictionary: {THESIS}\nseed: 3\n"
        "diagnosability: {model: citation, manoeuvres: [doublet], noise: {tas: 0.01}, "
        "magnitude: 0.5, magnitudes: {bias_6.35: 2}, at_limit: true, amplitude_rad: 0.02, start_s: 1.0, step_s: 0.8, "
        "duration_s: 25, turbulence_m_s: 0.1, draws: 1}\n"
    )
    flight = ("--amplitude", 0.02, "--start", 1, "--step", 0.8, "--duration", 25, "--turbulence", 0.1, "--draws", 1)
    sizes = ("--magnitude", 0.5, "--magnitude", "bias_6.35=2", "--at-limit", "--seed", 3)
    words = ("-d", THESIS, "--model", "citation", "--manoeuvre", "doublet", "--noise", "tas=0.01", *flight, *sizes)
    by_file, by_options = (
        json.loads(bfi("diagnosability", *given, "--json").stdout) for given in (("-c", file), words)
    )
    for one in (by_file, by_options):
        del one["provenance"]
    assert by_file == by_options


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ((), 2, "bfi diagnosability: needs a LOG or a --model, got nothing; give one of the two"),
        ((BIAS, *FLOWN), 2, "bfi diagnosability: needs a LOG or a --model, got both; give one of the two"),
        ((BIAS, "-d", THESIS, "--noise", "tas=1"), 2, "--noise is about the flight of a model; give --model in place"),
        ((BIAS, "-d", THESIS, "--draws", 2), 2, "--draws is about the flight of a model"),
        ((BIAS,), 2, "--dictionary: no dictionary given; name one"),
        ((BIAS, "-d", THESIS, "--magnitude", "x"), 2, "--magnitude: expected Z|NAME=Z, got 'x'; write --magnitude 0.5"),
        ((BIAS, "-d", THESIS, "--magnitude", "=3"), 2, "--magnitude: expected Z|NAME=Z, got '=3'"),
        (
            (BIAS, "-d", THESIS, "--magnitude", 1, "--magnitude", 2),
            2,
            "--magnitude: 'all' is given twice, as '1' and '2'",
        ),
        ((BIAS, "-d", THESIS, "--magnitude", "bias=2"), 2, "got 'bias'; did you mean 'bias_6.35'?"),
        ((*FLOWN, "--noise", 0.1), 2, "--noise: expected NAME=SD, got '0.1'; write --noise tas=0.01"),
        ((*FLOWN, "--noise", "tas=1", "--noise", "tas=2"), 2, "--noise: 'tas' is given twice"),
        ((*FLOWN, "--manoeuvre", "none"), 3, "citation: 'elevator' does not move"),
        (("missing.h5", "-d", THESIS), 3, "missing.h5"),
    ],
)
def test_complaints(bfi, words, code, message):
    outcome = bfi("diagnosability", *words)
    assert (outcome.code, outcome.stdout) == (code, "")
    assert outcome.stderr.count("\n") == 1
    assert message in outcome.stderr
