"""Nothing of a log, a dictionary, a configuration, a file name or an option runs in a terminal or a browser."""

from __future__ import annotations

import csv
import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.flightlog import read_log
from bfi_cli.printable import printable
from bfi_cli.report.content import Block, Drawing, HeatMap, Lane, Panel, Span, curve
from bfi_cli.report.figures import draw
from bfi_cli.report.style import to_svg
from bfi_cli.serialization import csv_lines, to_json

# A title and a colour of a terminal in both codings, writing direction, a line that is none, HTML, the console's own
# markup and emoji, mathematics without an end. No comma, which ends a key of --fault.
BAD = (
    "\x1b]0;title\x07\x1b[31m\x9b31m\u202e\u2028\r\x7f<script>alert(1)</script><img src=x onerror=alert(1)>\"'>"
    "[bold]x[/bold][link=http://x]:warning:{task}$\\frac{$"
)
LINK = BAD.replace("/", "|")  # HDF5 takes no slash in a name
INPUT, OUTPUT = f"u{LINK}", f"y{LINK}"
T = time_axis(duration_s=40.0, rate_hz=5.0)


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bad name that holds bad files."""
    folder = tmp_path_factory.mktemp("desk") / LINK
    folder.mkdir()
    flight = simulate(
        MODELS["citation"],
        manoeuvre("multisine", T, step_s=1.0),
        rng=np.random.default_rng(0),
        rate_hz=5.0,
        noise_sd={"tas": 0.01},
    )
    with h5py.File(folder / "log.h5", "w") as file:
        columns = {"time": T, INPUT: flight.channel("elevator").values, "elevator": flight.channel("elevator").values}
        columns |= {OUTPUT: flight.channel("tas").values + 1.0 * (T >= 20.0), "tas": flight.channel("tas").values}
        for name, values in columns.items():
            file[name] = values
        file["time"].attrs["units"] = "s"
        file[f"odd{LINK}"] = flight.channel("pitch").values
        file[f"odd{LINK}"].attrs["units"] = BAD
        file[f"text{LINK}"] = "no signal"
        segment = {"label": f"label{BAD}", "t_start": 0, "t_end": 50, "note": f"note{BAD}"}
        file.attrs["segments"] = json.dumps([segment])
        fault = {"shape": "bias", "name": f"truth{BAD}", "channel": OUTPUT, "magnitude": 1.0, "onset_s": 20.0}
        file.create_group("truth").attrs["faults"] = json.dumps([fault])
    atoms = [
        {"name": f"step{BAD}", "shape": "bias", "onset_s": 20.0},
        {"name": f"slope{BAD}", "shape": "drift", "onset_s": 30.0},
        {"name": f"dead{BAD}", "shape": "bias", "onset_s": 300.0},
    ]
    (folder / "d.yaml").write_text(json.dumps({"channel": OUTPUT, "atoms": atoms}))
    analysis = {"model": {"order": 2}, "conditioning": {"rate_hz": "none"}}
    config = {"inputs": [INPUT], "outputs": [OUTPUT], **analysis}
    (folder / "c.yaml").write_text(json.dumps(config))
    sweep = {"record": {"log": "log.h5"}, "dictionary": "d2.yaml", "active": [1], "magnitudes": [2], "trials": 1}
    (folder / "d2.yaml").write_text(json.dumps({"channel": OUTPUT, "atoms": atoms[:2]}))
    settings = {"inputs": [INPUT], "outputs": [OUTPUT], "conditioning": {"rate_hz": "none"}}
    noise = {OUTPUT: [0.01, 0.02]}
    (folder / "m.yaml").write_text(
        json.dumps({**sweep, "noise": noise, "identify": {**settings, "model": {"order": 2}}})
    )
    return folder


@pytest.fixture(params=["--json", "table", pytest.param("drawn", marks=pytest.mark.slow)])
def run(
    request: pytest.FixtureRequest, bfi: Callable, desk: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., object]:
    """Run a command line in the folder as JSON and as tables, and with its figures, and look at all it prints."""
    monkeypatch.chdir(desk)
    monkeypatch.setenv("COLUMNS", "500")
    monkeypatch.setenv("TERM", "dumb")  # no colours of our own
    request.getfixturevalue("unscanned")
    request.getfixturevalue("vectors" if request.param == "drawn" else "undrawn")

    def command(*argv: object, code: int = 0) -> object:
        if request.param == "table":
            monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
            monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
        outcome = bfi(*argv, *([] if request.param == "table" else ["--json"]))
        assert outcome.code == code, outcome.stderr
        check_text(outcome.stdout)
        check_text(outcome.stderr)
        return outcome

    return command


def check_text(text: str, *, also: str = "\n") -> None:
    assert {letter for letter in text if not letter.isprintable()} <= set(also)


def check_files(folder: Path) -> set[str]:
    """Check every text file below a folder, and return the kinds there are."""
    kinds = set()
    for path in (one for one in folder.rglob("*") if one.is_file()):
        kinds.add(path.suffix)
        if path.suffix in (".png", ".h5"):
            continue
        text = path.read_bytes().decode()  # as it is: no line ends translated
        check_text(text, also="\n\xa0" if path.suffix == ".html" else "\n")
        if path.suffix == ".json":
            json.loads(text)
        if path.suffix == ".svg":
            assert not [one for one in ElementTree.fromstring(text).iter() if str(one.tag).endswith("script")]
        if path.suffix == ".html":
            # What was planted stands there as text, or not at all; a page to zoom has its data and one script.
            scripts = ["<script type=", "<script>"] if path.name == "zoom.html" else []
            assert re.findall(r"<script(?: type=|>)?", text) == scripts
            for harmless in ("onerror=alert(1)&gt;", "onerror=alert(1)&gt", r"onerror=alert(1)\u003e"):
                text = text.replace(harmless, "")
            assert "onerror" not in text
            assert text.count("<img") == text.count('<img src="data:image/svg+xml;base64,')
    return kinds


def names_of(value: object) -> Iterator[str]:
    match value:
        case str():
            yield value
        case dict():
            yield from (name for pair in value.items() for one in pair for name in names_of(one))
        case list():
            yield from (name for one in value for name in names_of(one))


@pytest.mark.usefixtures("vectors")
def test_a_figure():
    """Whatever a figure is told, no letter of it is markup: they are drawn, and told again in comments."""
    one, block = curve(BAD, [0.0, 1.0], [1.0, 2.0]), Block(label=BAD, low=0.2, high=0.8, shade="yellow")
    panel = Panel(
        title=BAD,
        x_label=f"{BAD} [s]",
        y_label=BAD,
        curves=(one,),
        levels=((BAD, 1.5),),
        spans=(Span(label=BAD, low=0.2, high=0.4),),
        y_ticks=((BAD, 1.0),),
        side_notes=((BAD, 1.0),),
        bands=(block,),
    )
    lanes = Panel(x_label=BAD, y_label="", curves=(), lanes=(Lane(label=BAD, blocks=(block,)),), x_limits=(0.0, 1.0))
    heat_map = HeatMap(title=BAD, rows=(BAD,), columns=(BAD,), values=(np.array([0.5]),), label=BAD)
    svg = to_svg(draw(Drawing(name="x", caption=BAD, panels=(panel, lanes), heat_maps=(heat_map,)))).decode()
    check_text(svg)
    assert not [one for one in ElementTree.fromstring(svg).iter() if "script" in str(one.tag) or "img" in str(one.tag)]


def test_info(run: Callable, desk: Path):
    printed = run("info", desk / "log.h5").stdout
    if printed.startswith("{"):
        names = set(names_of(json.loads(printed)))
        assert {OUTPUT, f"label{BAD}", f"note{BAD}", str(desk / "log.h5")} <= names
    else:
        for name in (OUTPUT, f"label{BAD}", str(desk / "log.h5")):
            assert printable(name) in printed


@pytest.mark.parametrize("suffix", [".csv", ".h5"])
def test_logs_that_are_written_read_back(run: Callable, tmp_path: Path, suffix: str):
    out, faulty = tmp_path / f"out{LINK}{suffix}", tmp_path / f"faulty{LINK}{suffix}"
    run("convert", "log.h5", "-o", out)
    run("inject", out, "--fault", f"bias,name={BAD},channel=tas,magnitude=1,onset_s=5", "-o", faulty)
    run("info", faulty)
    check_files(tmp_path)
    before, after = read_log("log.h5"), read_log(faulty)
    assert len(after.channels) == len(before.channels)
    assert {fault.channel for fault in after.truth.faults} <= set(after.channels)
    assert [fault.name for fault in after.truth.faults] == [f"truth{BAD}", BAD]
    if suffix == ".h5":
        assert set(after.channels) == set(before.channels)


def test_identify(run: Callable, tmp_path: Path):
    out = tmp_path / f"out{LINK}"
    run("identify", "log.h5", "-c", "c.yaml", "-d", "d.yaml", "--out", out)
    assert check_files(out) == {".json", ".html", ".csv", ".svg", ".png"}
    with open(out / "candidates.csv", newline="") as file:
        next(file)
        assert next(csv.DictReader(file))["name"] == printable(f"step{BAD}")
    assert f"step{BAD}" in set(names_of(json.loads((out / "result.json").read_text())))
    again = tmp_path / "again"
    run("report", out / "result.json", "--out", again)
    assert (again / "report.html").read_bytes() == (out / "report.html").read_bytes()


def test_dictionary(run: Callable, tmp_path: Path):
    run("dictionary", "d.yaml", "--duration", "60", "--out", tmp_path / f"without{LINK}")
    run("dictionary", "d.yaml", "log.h5", "-c", "c.yaml", "--out", tmp_path / "with")
    assert check_files(tmp_path) == {".json", ".html", ".csv", ".svg", ".png"}


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    "line",
    [
        ["start-time", "log.h5", "-c", "c.yaml", "--shape", "bias"],
        ["detect", "log.h5", "--input", INPUT, "--output", OUTPUT, "--output", "tas", "--rate", "none"],
        ["diagnosability", "log.h5", "-c", "c.yaml", "-d", "d.yaml"],
    ],
    ids=lambda line: line[0],
)
def test_analyses(run: Callable, tmp_path: Path, line: list[str]):
    out = tmp_path / f"out{LINK}"
    run(*line, "--out", out)
    assert {".json", ".html", ".csv", ".svg", ".png"} <= check_files(out)


@pytest.mark.usefixtures("undrawn")
def test_a_stored_analysis(run: Callable, tmp_path: Path):
    run("start-time", "log.h5", "-c", "c.yaml", "--shape", "bias", "--out", tmp_path / "out")
    run("report", tmp_path / "out" / "result.json", "--out", tmp_path / "again")
    check_files(tmp_path / "again")


def test_plot(run: Callable, tmp_path: Path):
    out, event = tmp_path / f"out{LINK}", {"fault": BAD, "channels": [OUTPUT], "state": "declared", "onset_s": 20.0}
    stored = {"kind": "diagnose", "schema": 2, "provenance": {"log_sha256": BAD}, "events": [event]}
    Path("events.json").write_text(json.dumps(stored))
    run("plot", "log.h5", "--channel", OUTPUT, "--channel", "tas", "--events", "events.json", "--out", out)
    assert check_files(out) == {".json", ".html", ".csv", ".svg", ".png"}
    data = re.findall(r"<script[^>]*>(.*?)</script>", (out / "zoom.html").read_text(), re.DOTALL)[0]
    assert {printable(OUTPUT), f"{printable(BAD)} ({printable(OUTPUT)})"} <= set(names_of(json.loads(data)))
    run("report", out / "result.json", "--out", tmp_path / "again")
    check_files(tmp_path / "again")


@pytest.mark.first_rows(1)
def test_montecarlo(run: Callable, tmp_path: Path):
    out = tmp_path / f"out{LINK}"
    run("montecarlo", "-c", "m.yaml", "--out", out, "--progress")
    assert {".json", ".csv", ".svg", ".png"} <= check_files(out)
    before = {path.name: path.read_bytes() for path in out.glob("*.csv")}
    assert len(before["trials.csv"].splitlines()) == 2 + 2 * 1
    run("montecarlo", "-c", "m.yaml", "--out", out, "--resume")
    assert {path.name: path.read_bytes() for path in out.glob("*.csv")} == before


@pytest.mark.usefixtures("unscanned", "undrawn")
def test_file_names_that_are_no_text(bfi: Callable, desk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Bytes that are not UTF-8 reach the program as lone surrogates."""
    if sys.getfilesystemencoding() != "utf-8":
        pytest.skip("file names are not UTF-8 here")
    monkeypatch.chdir(tmp_path)
    name = os.fsdecode(b"log\xff\x9b.h5")
    try:
        Path(name).write_bytes((desk / "log.h5").read_bytes())
    except OSError:
        pytest.skip("the file system takes no such name")
    for argv in (["info", name], ["identify", name, "-c", desk / "c.yaml", "-d", desk / "d.yaml", "--out", "out"]):
        outcome = bfi(*argv, "--json")
        assert outcome.code == 0
        check_text(outcome.stdout)
        assert json.loads(outcome.stdout)["log"]["path"] == r"log\xff\x9b.h5"
    check_files(tmp_path / "out")
    assert r"log\xff\x9b.h5" in (tmp_path / "out" / "report.html").read_text()
    for argv in (["info", f"no{name}"], ["identify", "-c", f"no{name}", name]):
        outcome = bfi(*argv)
        assert outcome.code in (2, 3)
        assert r"nolog\xff\x9b.h5" in outcome.stderr


CELL = f"time,elevator,tas\n0,0,1\n1,0,{BAD}\n".replace("\r", "").replace("\u2028", "")
NAME = BAD.replace("\r", "").replace("\u2028", "").replace('"', "")
UNIT = BAD.translate(dict.fromkeys(map(ord, '\r\u2028"[]')))
HEADER = f"time,{NAME},{NAME}\n0,0,1\n1,0,1\n"
BAD_YAML = json.dumps(BAD)
LINES: dict[str, tuple[list[str], str, int]] = {
    "cell": (["info", "x", "--channel", "tas=tas"], CELL, 3),
    "header": (["info", "x", "--channel", f"tas={NAME}"], HEADER, 3),
    "unit": (["info", "x", "--channel", "tas=tas"], f"time,tas [{UNIT}]\n0,1\n1,1\n", 3),
    "faults": (["info", "x"], f"# faults: [{json.dumps({BAD: BAD})}]\ntime,tas\n0,1\n1,1\n", 3),
    "segments": (["info", "x"], f"# segments: [{json.dumps({BAD: BAD})}]\ntime,tas\n0,1\n1,1\n", 3),
    "yaml key": (["identify", "log.h5", "-c", "x"], f"{BAD_YAML}: 1\n", 2),
    "yaml value": (["identify", "log.h5", "-c", "x"], f"method: {BAD_YAML}\n", 2),
    "yaml twice": (["identify", "log.h5", "-c", "x"], f"{BAD_YAML}: 1\n{BAD_YAML}: 2\n", 2),
    "yaml tag": (["identify", "log.h5", "-c", "x"], "a: !<%1B%C2%9B31m%E2%80%AE> b\n", 2),
    "yaml raw": (["identify", "log.h5", "-c", "x"], f"a: {BAD}\n", 2),
    "yaml right to left": (["identify", "log.h5", "-c", "x"], "a\u202e\u2028: *\u202eb\n", 2),
    "yaml unit": (["identify", "log.h5", "-c", "x"], f"units: {{tas: {BAD_YAML}}}\n", 2),
    "yaml name": (["identify", "log.h5", "-c", "x"], f"inputs: [{BAD_YAML}]\noutputs: [{BAD_YAML}]\n", 2),
    "atom key": (["dictionary", "x"], f"atoms: [{{shape: bias, {BAD_YAML}: 1}}]\n", 2),
    "atom shape": (["dictionary", "x"], f"atoms: [{{shape: {BAD_YAML}}}]\n", 2),
    "atom twice": (
        ["dictionary", "x"],
        f"atoms: [{{shape: bias, name: {BAD_YAML}}}, {{shape: bias, name: {BAD_YAML}}}]\n",
        2,
    ),
    "atom dead": (
        ["identify", "log.h5", "-c", "c.yaml", "-d", "x"],
        f"atoms: [{{shape: bias, onset_s: 300, name: {BAD_YAML}}}]\n",
        2,
    ),
    "sample file": (["dictionary", "x"], f"atoms: [{{shape: samples, file: {BAD_YAML}}}]\n", 2),
    "sample file outside": (["dictionary", "x"], f'atoms: [{{shape: samples, file: "/{BAD_YAML[1:]}}}]\n', 2),
    "sweep": (["montecarlo", "-c", "x"], f"record: {{model: {BAD_YAML}}}\ndictionary: d.yaml\nactive: 1\n", 2),
    "result": (["report", "x"], json.dumps({"kind": BAD}), 2),
    "result member": (["report", "x"], json.dumps({"kind": "identify", "schema": BAD}), 2),
    "no json": (["report", "x"], BAD, 2),
    "calibration": (["start-time", "log.h5", "-c", "c.yaml", "--calibration", "x"], json.dumps({"kind": BAD}), 2),
    "command": ([BAD], "", 2),
    "option": (["info", f"--{BAD}"], "", 2),
    "argument": (["start-time", "log.h5", BAD], "", 2),
    "log": (["info", BAD], "", 3),
    "config": (["identify", "log.h5", "-c", BAD], "", 2),
    "dictionary": (["identify", "log.h5", "-d", BAD], "", 2),
    "input": (["identify", "log.h5", "-d", "d.yaml", "--input", BAD], "", 3),
    "channel": (["info", "log.h5", "--channel", f"tas={BAD}"], "", 3),
    "channel pair": (["info", "log.h5", "--channel", BAD.replace("=", "")], "", 2),
    "unit option": (["info", "log.h5", "--unit", f"tas={BAD}"], "", 2),
    "group": (["info", "log.h5", "--group", BAD], "", 3),
    "plotted channel": (["plot", "log.h5", "--channel", BAD.replace("=", ""), "--json"], "", 3),
    "events": (["plot", "log.h5", "--events", "x", "--json"], json.dumps({"kind": BAD}), 2),
    "events of": (["plot", "log.h5", "--events", BAD, "--json"], "", 2),
    "number": (["info", "log.h5", "--from", BAD], "", 2),
    "rate": (["identify", "log.h5", "-d", "d.yaml", "--rate", BAD], "", 2),
    "band": (["start-time", "log.h5", "--frequency", BAD], "", 2),
    "method": (["start-time", "log.h5", "--method", BAD], "", 2),
    "shape": (["start-time", "log.h5", "--shape", BAD], "", 2),
    "samples": (["start-time", "log.h5", "--shape", "samples", "--samples", BAD], "", 2),
    "spec": (["inject", "log.h5", "--fault", BAD, "-o", "new.h5"], "", 2),
    "spec value": (["inject", "log.h5", "--fault", f"bias,magnitude={BAD}", "-o", "new.h5"], "", 2),
    "spec channel": (["inject", "log.h5", "--fault", f"bias,channel={BAD}", "-o", "new.h5"], "", 3),
    "out": (["convert", "log.h5", "-o", BAD], "", 2),
    "out of results": (["identify", "log.h5", "-c", "c.yaml", "-d", "d.yaml", "--out", f"log.h5/{BAD}"], "", 2),
    "model": (["simulate", BAD, "-o", "new.h5"], "", 2),
    "noise": (["simulate", "citation", "-o", "new.h5", "--noise", f"{BAD}=1"], "", 2),
    "manoeuvre": (["simulate", "citation", "-o", "new.h5", "--manoeuvre", BAD], "", 2),
    "reproduction": (["reproduce", BAD], "", 2),
    "set": (["reproduce", "f16-table2", "--set", BAD], "", 2),
}


@pytest.mark.parametrize("name", LINES)
def test_error_lines(bfi: Callable, desk: Path, monkeypatch: pytest.MonkeyPatch, name: str):
    monkeypatch.chdir(desk)
    argv, content, code = LINES[name]
    Path("x").write_text(content, encoding="utf-8", newline="")
    outcome = bfi(*argv)
    assert (outcome.code, outcome.stdout) == (code, ""), outcome.stderr
    assert outcome.stderr.endswith("\n")
    assert outcome.stderr[:-1].isprintable()
    assert len(outcome.stderr) < 2000
    assert not Path("new.h5").exists()


def test_markup_in_a_name_is_shown_not_run(bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "200")
    names = ("[red]x[/red]z", "[link=http://x]y[/link]z", ":warning:", "[/]")
    log = tmp_path / "log.csv"
    log.write_text(f"time,tas,{','.join(names)}\n" + "".join(f"{t},{t % 3},1,2,3,4\n" for t in range(9)))
    monkeypatch.setenv("TERM", "dumb")
    printed = bfi("info", log).stdout
    for name in names:
        assert name in printed


def test_json_decodes_to_what_it_was():
    document = {BAD: [BAD, "\ud800", os.fsdecode(b"\xff"), "\U000e0001\U0001f600", "é°µ速\xa0"]}
    for indent in (1, None):
        text = to_json(document, indent=indent)
        check_text(text)
        # A lone surrogate is no text that a file of UTF-8 can hold: it is shown by its code.
        shown = {BAD: [BAD, r"\ud800", r"\xff", "\U000e0001\U0001f600", "é°µ速\xa0"]}
        assert json.loads(text) == shown
        assert "é°µ速" in text


def test_csv_has_a_line_for_each_row():
    text = csv_lines([[BAD, "a\nb", 1.5, None, float("nan"), True]])
    check_text(text)
    (row,) = csv.reader(text.splitlines())
    assert row == [printable(BAD), r"a\nb", "1.5", "", "", "true"]
