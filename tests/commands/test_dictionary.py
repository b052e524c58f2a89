"""`bfi dictionary`: the document, the tables, the files, the exit codes."""

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from noted import texts

from bfi_cli.audit import audit_content, audit_dictionary, audit_document, audit_on_log
from bfi_cli.config import Config
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import read_log
from bfi_cli.report.figures import draw
from bfi_cli.report.style import to_png, to_svg
from bfi_cli.serialization import provenance

ROOT = Path(__file__).parents[2]
THESIS, AIRDATA = ROOT / "configs" / "thesis_dictionary.yaml", ROOT / "configs" / "airdata_dictionary.yaml"
BIAS = ROOT / "data" / "citation_bias.h5"
ANSI = re.compile(r"\x1b\[[0-9;]*m")

MANY = {
    "relative_to": "window",
    "channel": "tas",
    "grids": [{"name": "step", "shape": "bias", "onset_s": {"start": 5, "stop": 30, "step": 1}}],
}
FLAWED = """
channel: tas
relative_to: window
atoms:
  - {name: good, shape: bias, onset_s: 10}
  - {name: twin, shape: bias, onset_s: 10}
  - {name: dead, shape: drift, onset_s: 500}
  - {name: constant, shape: bias, onset_s: 0}
"""


@pytest.fixture
def flawed(tmp_path: Path) -> Path:
    path = tmp_path / "flawed.yaml"
    path.write_text(FLAWED)
    return path


@pytest.fixture
def terminal(bfi, monkeypatch: pytest.MonkeyPatch):
    """Run the command as on a terminal of 80 columns and return its lines."""

    def run(*argv: object) -> list[str]:
        monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
        monkeypatch.setenv("COLUMNS", "80")
        monkeypatch.setenv("TERM", "dumb")
        outcome = bfi("dictionary", *argv)
        assert (outcome.code, outcome.stderr) == (0, "")
        return ANSI.sub("", outcome.stdout).splitlines()

    return run


def lines_of(path: Path) -> list[str]:
    first, *lines = path.read_text().splitlines(keepends=True)
    assert first == "# written by bfi\n"
    return lines


def document(bfi, *argv):
    outcome = bfi("dictionary", *argv, "--json")
    assert (outcome.code, outcome.stderr) == (0, "")
    assert "NaN" not in outcome.stdout
    return json.loads(outcome.stdout)


def test_the_document_on_a_log(bfi):
    found = document(bfi, THESIS, BIAS, "--order", 4)
    assert (found["kind"], found["schema"], found["log"]["path"]) == ("dictionary", 4, str(BIAS))
    assert (found["model"]["order"], found["window"]["rate_hz"]) == (4, 10.0)
    assert (found["fastest_hz"], found["rate_needed_hz"], found["rank"]) == (2.25, 9.0, 7)
    assert 1.0 <= found["condition_number"] < 100.0
    matrix = np.array(found["coherence"]["matrix"])
    np.testing.assert_array_equal(np.diag(matrix), 1.0)
    assert found["coherence"]["of"] == "filtered signatures"
    keys = {"name", "shape", "channel", "live", "note", "minimal_detectable", "unit", "most_coherent_with", "coherence"}
    drift = found["atoms"][5]
    assert keys <= set(drift)
    assert (drift["name"], drift["slope"], drift["unit"]) == ("drift_7.93", 0.23, "")
    assert drift["minimal_physical"]["value"] == pytest.approx(0.23 * drift["minimal_detectable"])
    assert drift["minimal_physical"]["unit"] == "m/s^2"
    assert len(found["provenance"]["log_sha256"]) == len(found["provenance"]["dictionary_sha256"]) == 64


def test_the_document_without_a_log(bfi):
    found = document(bfi, THESIS)
    assert (found["log"], found["model"], found["coherence"]["of"]) == (None, None, "raw signals")
    assert "--duration S" in found["window"]["why"]
    assert all(atom["live"] and atom["minimal_detectable"] is None for atom in found["atoms"])
    assert document(bfi, THESIS, "--duration", 40)["window"]["stop_s"] == 40.0


@pytest.mark.parametrize("log", [(), (BIAS,)], ids=["alone", "on a log"])
def test_flawed_entries_are_named(bfi, flawed: Path, log):
    found = document(bfi, flawed, *log)
    assert [(atom["name"], atom["live"]) for atom in found["atoms"]] == [
        ("good", True),
        ("twin", False),
        ("dead", log == ()),
        ("constant", False),
    ]
    notes = " ".join(texts(found["notes"]))
    assert "'twin' is defined as 'good' is" in notes
    assert "'constant' does not change in the window" in notes
    assert ("'dead' starts at 500 s, after the window ends" in notes) == (log != ())


@pytest.mark.parametrize("argv", [(THESIS,), (THESIS, BIAS), (AIRDATA, BIAS, "--order", 4, "--rate", 5)], ids=str)
def test_a_terminal_of_80_columns_holds_the_tables(terminal, argv):
    lines = terminal(*argv)
    assert max(map(len, lines)) <= 80
    text = " ".join(lines)
    assert "can be looked for" in text
    assert ("oherence of the" in text and "condition number" in text) == (argv[0] == THESIS)


def test_the_tables_name_what_is_left_out(terminal, flawed: Path):
    text = " ".join(terminal(flawed, BIAS))
    assert text.startswith("4 faults, 1 of them can be looked for")
    assert text.count("left out") == 3
    assert "Note         'twin' is defined as 'good' is" in text


@pytest.mark.usefixtures("undrawn")
def test_the_files_hold_what_the_document_says(bfi, tmp_path: Path):
    out = tmp_path / "out"
    found = document(bfi, THESIS, BIAS, "--out", out, "--series")
    figures = {
        f"{name}{end}" for name in ("signatures", "coherence", "limits") for end in (".svg", ".png", "_figure.csv")
    }
    assert {path.name for path in out.iterdir()} == {
        *figures,
        "atoms.csv",
        "coherence.csv",
        "report.html",
        "result.json",
    }
    assert json.loads((out / "result.json").read_text()) == found
    atoms = list(csv.DictReader(lines_of(out / "atoms.csv")))
    assert [atom["name"] for atom in atoms] == [atom["name"] for atom in found["atoms"]]
    assert float(atoms[5]["minimal_physical"]) == found["atoms"][5]["minimal_physical"]["value"]
    assert atoms[0]["live"] == "true"
    rows = list(csv.reader(lines_of(out / "coherence.csv")))
    np.testing.assert_array_equal(np.array([row[1:] for row in rows[1:]], dtype=float), found["coherence"]["matrix"])


@pytest.mark.parametrize(
    ("argv", "code", "message"),
    [
        (["absent.yaml"], 2, "absent.yaml: cannot be read"),
        (["BROKEN"], 2, "unknown key 'onset'"),
        ([THESIS, "absent.h5"], 3, "absent.h5: no such file"),
        ([THESIS, ""], 3, "no such file; give the path of a log"),
        ([THESIS, BIAS, "--output", "nothing"], 3, "no channel 'nothing'"),
        ([THESIS, BIAS, "--from", 20, "--to", 20.2, "--input", "elevator"], 3, "does not move"),
        ([THESIS, BIAS, "--output", "pitch"], 2, "no live atom"),
        ([THESIS, BIAS, "--duration", 3], 2, "give --from and --to"),
        ([THESIS, BIAS, "--rate", "fast"], 2, "--rate"),
        ([THESIS, "--order", 4], 2, "--order is about a log"),
        ([THESIS, "--duration", 0.1], 2, "no live atom: 'sine_2.25' starts at 0.2 s"),
        ([THESIS, "--duration", "nan"], 2, "--duration"),
        ([], 2, "FILE"),
        ([""], 2, "the name FILE is empty"),
    ],
)
def test_what_the_user_can_mend_is_one_line(bfi, tmp_path: Path, argv, code: int, message: str):
    broken = tmp_path / "broken.yaml"
    broken.write_text("atoms: [{shape: bias, onset: 3}]")
    outcome = bfi("dictionary", *(broken if word == "BROKEN" else word for word in argv))
    assert (outcome.code, outcome.stdout) == (code, "")
    assert message in outcome.stderr.replace("onset: unknown key", "unknown key 'onset'")
    assert outcome.stderr.count("\n") == 1


def content_of(source: Path | dict, *, on_log: bool):
    entries = load_dictionary(source, where="many.yaml" if isinstance(source, dict) else None)
    found = audit_on_log(read_log(BIAS), entries, Config()) if on_log else audit_dictionary(entries, Config())
    return audit_content(audit_document(found, provenance(log_sha256="")))


@pytest.mark.slow
@pytest.mark.parametrize(("source", "on_log"), [(THESIS, False), (MANY, True)], ids=["few alone", "many on a log"])
def test_the_figures_are_whole(source: Path | dict, on_log: bool):
    drawings = content_of(source, on_log=on_log).drawings
    assert [drawing.name for drawing in drawings] == ["signatures", "coherence", *(["limits"] if on_log else [])]
    for drawing in drawings:
        figure = draw(drawing)
        for axes in figure.axes:
            if not axes.images and axes.get_label() != "<colorbar>":
                assert axes.get_ylabel() == "dictionary entry"
                assert axes.get_xlabel().endswith("]")
        pixels = imread(io.BytesIO(to_png(figure)))[..., :3]
        assert all(np.all(edge == 1.0) for edge in (pixels[:2], pixels[-2:], pixels[:, :2], pixels[:, -2:]))
        assert to_svg(draw(drawing)) == to_svg(figure)


def test_the_signatures_are_drawn_in_the_rows_of_their_names():
    panel = content_of(THESIS, on_log=False).drawings[0].panels[0]
    (drawn,) = panel.curves
    gaps = np.flatnonzero(np.isnan(drawn.x))
    assert len(gaps) == len(panel.y_ticks) == 7
    for (_, row), part in zip(panel.y_ticks, np.split(drawn.y, gaps + 1), strict=False):
        assert np.nanmax(np.abs(part - row)) == pytest.approx(0.45)


def test_few_atoms_have_their_coherence_written_into_the_map():
    few, many = (draw(content_of(path, on_log=False).drawings[1]).axes[0] for path in (THESIS, MANY))
    assert len(few.texts) == 49
    assert len(many.texts) == 0
    assert len(many.get_yticks()) <= 24


@pytest.mark.usefixtures("undrawn")
def test_the_report_is_drawn_again_from_the_document(bfi, tmp_path: Path):
    out, again = tmp_path / "out", tmp_path / "again"
    assert bfi("dictionary", THESIS, BIAS, "--out", out).code == 0
    assert bfi("report", out / "result.json", "--out", again).code == 0
    assert {path.name: path.read_bytes() for path in again.iterdir()} == {
        path.name: path.read_bytes() for path in out.iterdir()
    }
