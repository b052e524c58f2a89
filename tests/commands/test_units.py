"""`--units`: what people read changes, what programs read does not."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config, load_config, merge
from bfi_cli.errors import ConfigError

ROOT = Path(__file__).parents[2]
DATA, CONFIGS = ROOT / "data", ROOT / "configs"
BIAS, CLEAN, THESIS = DATA / "citation_bias.h5", DATA / "citation_clean.h5", ROOT / "tests" / "two_entries.yaml"
KNOT = 1852 / 3600
FAST = ("--rate", 5, "--order", 2)
COMMANDS = {
    "info": ("info", BIAS),
    "identify": ("identify", BIAS, "-d", THESIS, *FAST, "--verbose"),
    "start-time": ("start-time", BIAS, "--shape", "bias", *FAST, "--verbose"),
    "detect": ("detect", BIAS, "--verbose"),
    "diagnosability": ("diagnosability", CLEAN, "-d", THESIS, *FAST),
    "dictionary": ("dictionary", THESIS, CLEAN, *FAST),
}
# A number with an SI unit that pilots do not use; accelerations and their rates stay in m/s^2 and m/s^3.
METRIC = re.compile(r"\d (m/s(?!\^)|rad|rad/s|Pa|K)\b")


# A number and its unit in one cell of a table.
IN_A_CELL = re.compile(r"[-+.\de]+ (s|m|m/s|m/s\^2|rad|rad/s|deg|deg/s|kt)")


@pytest.mark.first_rows(1)
@pytest.mark.usefixtures("undrawn", "unscanned")
@pytest.mark.parametrize("name", COMMANDS)
def test_tables_show_knots_and_json_stays_what_it_was(name: str, bfi: Callable, tmp_path: Path):
    command = COMMANDS[name]
    shown = bfi(*command, "--units", "aviation", "--out", tmp_path / "kt")
    plain = bfi(*command, "--out", tmp_path / "si")
    assert (shown.code, plain.code) == (0, 0)
    assert re.search(r"\bkt\b", shown.stdout)
    assert not METRIC.search(shown.stdout)
    assert not re.search(r"\bkt\b", plain.stdout.replace("5 kt", ""))
    assert "m/s" in plain.stdout
    documents = [json.loads((tmp_path / folder / "result.json").read_text()) for folder in ("kt", "si")]
    assert [one.pop("provenance")["command"] for one in documents] != [None, None]
    assert json.dumps(documents[0]) == json.dumps(documents[1])
    tables = sorted(path.name for path in (tmp_path / "si").glob("*.csv"))
    assert tables
    for table in tables:
        assert (tmp_path / "kt" / table).read_bytes() == (tmp_path / "si" / table).read_bytes(), table
        text = (tmp_path / "si" / table).read_text()
        assert "deg" not in text.partition("\n")[2].partition("note")[0], table
        for row in csv.reader(text.splitlines()[1:]):
            assert not [cell for cell in row if IN_A_CELL.fullmatch(cell) or "\n" in cell], table
    page = (tmp_path / "kt" / "report.html").read_text()
    assert re.search(r"\bkt\b", page)


@pytest.mark.slow
@pytest.mark.usefixtures("unscanned")
def test_a_stored_result_is_drawn_in_other_units(bfi: Callable, tmp_path: Path, request: pytest.FixtureRequest):
    made = bfi(*COMMANDS["start-time"], "--units", "aviation", "--out", tmp_path / "kt")
    stored = tmp_path / "si" / "result.json"
    stored.parent.mkdir()
    stored.write_text(bfi(*COMMANDS["start-time"], "--json", "--series").stdout)
    before = stored.read_bytes()
    again = bfi("report", stored, "--units", "aviation")
    assert (again.code, again.stdout) == (0, made.stdout)
    assert stored.read_bytes() == before
    assert (tmp_path / "si" / "outputs.svg").read_bytes() == (tmp_path / "kt" / "outputs.svg").read_bytes()
    for table in (tmp_path / "kt").glob("*.csv"):
        assert (tmp_path / "si" / table.name).read_bytes() == table.read_bytes()
    request.getfixturevalue("undrawn")  # of the last one the table alone is looked at
    in_si = bfi("report", stored)
    assert "4.00" in in_si.stdout
    assert not re.search(r"\d kt\b", in_si.stdout)


@pytest.mark.usefixtures("unscanned")
def test_the_numbers_are_those_of_the_document(bfi: Callable):
    document = json.loads(bfi(*COMMANDS["identify"], "--json").stdout)
    (fault,) = document["faults"]
    table = bfi(*COMMANDS["identify"], "--units", "aviation").stdout
    found = re.search(r"bias_13\.8 +tas +13\.8 s +(\S+) kt +(\S+) to (\S+) kt", table)
    assert found is not None
    in_knots = np.array([fault["magnitude"], *fault["ci95"]]) / KNOT
    np.testing.assert_allclose([float(one) for one in found.groups()], in_knots, atol=0.006)


@pytest.mark.slow
def test_plots_have_knots_feet_and_degrees(bfi: Callable, tmp_path: Path):
    outcome = bfi("plot", BIAS, "--units", "aviation", "--channel", "tas", "--channel", "aoa", "--out", tmp_path / "kt")
    assert outcome.code == 0
    bfi("plot", BIAS, "--channel", "tas", "--channel", "aoa", "--out", tmp_path / "si")
    for name in ("zoom.html", "channels.svg"):
        assert (tmp_path / "kt" / name).read_text() != (tmp_path / "si" / name).read_text()
    assert '"label":["tas","[kt]"]' in (tmp_path / "kt" / "zoom.html").read_text()
    assert '"label":["aoa","[deg]"]' in (tmp_path / "si" / "zoom.html").read_text()
    for name in ("channels_figure.csv", "phases.csv"):
        assert (tmp_path / "kt" / name).read_bytes() == (tmp_path / "si" / name).read_bytes()


def test_what_was_injected_is_told_in_knots_and_the_log_stays_in_si(bfi: Callable, tmp_path: Path):
    faults = ("--fault", "bias,magnitude=4,onset_s=13.8", "--fault", "drift,magnitude=2,slope=0.1,onset_s=20")
    shown = bfi("inject", CLEAN, *faults, "-o", tmp_path / "a.csv", "--units", "aviation")
    plain = bfi("inject", CLEAN, *faults, "-o", tmp_path / "b.csv")
    assert "bias on tas, magnitude 7.775 kt, from 13.8 s" in shown.stdout
    assert "drift on tas, magnitude 2 (0.3888 kt/s), from 20 s" in shown.stdout
    assert "bias on tas, magnitude 4 m/s, from 13.8 s" in plain.stdout
    assert "drift on tas, magnitude 2 (0.2 m/s^2), from 20 s" in plain.stdout
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    converted = bfi("convert", tmp_path / "a.csv", "-o", tmp_path / "c.h5", "--units", "aviation")
    assert "magnitude 7.775 kt" in converted.stdout
    assert "tas [m/s]" in converted.stdout


@pytest.mark.usefixtures("unscanned")
def test_a_drift_is_never_a_bare_multiplier(bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "200")
    (tmp_path / "d.yaml").write_text("atoms: [{shape: drift, name: ramp, slope: 0.23, onset_s: 12}]\n")
    fault = "drift,magnitude=-4,slope=0.23,onset_s=12"
    bfi("inject", CLEAN, "--fault", fault, "-o", tmp_path / "log.h5")
    table = bfi("identify", tmp_path / "log.h5", "-d", tmp_path / "d.yaml", *FAST, "--verbose").stdout
    row = re.search(r"ramp +tas +12 s +(-0\.9\d+) m/s\^2 .* (-[34]\.\d+) x slope 0\.23/s", table)
    assert row is not None
    assert 0.23 * float(row[2]) == pytest.approx(float(row[1]), rel=0.01)
    candidates = table.partition("What was looked for")[2]
    assert re.search(r"ramp +declared +-0\.9\d+ m/s\^2 +\S+ m/s\^2", candidates)


@pytest.mark.parametrize("command", [*COMMANDS.values(), ("convert", BIAS, "-o", "x.h5"), ("plot", BIAS)])
@pytest.mark.parametrize(("word", "hint"), [("aviaton", "did you mean 'aviation'?"), ("feet", "known: si, aviation")])
def test_other_units_are_refused(command: tuple[Any, ...], word: str, hint: str, bfi: Callable):
    outcome = bfi(*command, "--units", word)
    assert (outcome.code, outcome.stdout) == (2, "")
    assert outcome.stderr == f"--units: not one of the choices, got '{word}'; {hint}\n"


def config_of(tmp_path: Path, text: str) -> Config:
    (tmp_path / "c.yaml").write_text(text)
    return load_config(tmp_path / "c.yaml")


@pytest.mark.usefixtures("unscanned")
def test_the_configuration_has_them_too_and_the_command_line_wins(bfi: Callable, tmp_path: Path):
    (tmp_path / "c.yaml").write_text("units: aviation\nmodel: {order: 4}\nconditioning: {rate_hz: 10}\n")
    command = ("identify", BIAS, "-d", THESIS, "-c", tmp_path / "c.yaml")
    assert "kt" in bfi(*command).stdout
    assert "7.78 kt" not in bfi(*command, "--units", "si").stdout


@pytest.mark.parametrize(
    ("text", "shown", "stated"),
    [
        ("units: aviation", "aviation", {}),
        ("units: si", "si", {}),
        ("shown_units: aviation", "aviation", {}),
        ("units: {v: kt}\nshown_units: aviation", "aviation", {"v": "kt"}),
        ("units: {si: kt}", "si", {"si": "kt"}),
        ("units: aviation\nshown_units: aviation", "aviation", {}),
    ],
)
def test_a_word_is_of_what_is_shown_a_mapping_of_the_log(tmp_path: Path, text: str, shown: str, stated: dict[str, str]):
    config = config_of(tmp_path, text)
    assert (config.shown_units, config.units) == (shown, stated)
    merged = merge(config, {"units": {**config.units, "w": "ft"}})
    assert (merged.shown_units, merged.units) == (shown, {**stated, "w": "ft"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("units: aviaton", "units: not a mapping or one of the choices, got 'aviaton'; did you mean 'aviation'?"),
        ("units: 3", "units: must be a mapping of key: value, got 3"),
        ("shown_units: imperial", "shown_units: not one of the choices, got 'imperial'; known: si, aviation"),
        ("units: aviation\nshown_units: si", "units: aviation, but shown_units is 'si'; keep one"),
        ("tolerances: {tas: 5deg}", "tolerances: tas: is in m/s, got '5deg'; give a unit of that kind"),
        ("tolerances: {tas: 5 knts}", "tolerances: tas: unknown unit 'knts'; did you mean"),
        ("tolerances: {tas: kt}", "tolerances: tas: not a number with a unit, got 'kt'; write one like 2.6 or 5kt"),
        ("tolerances: {tas: 1.2.3kt}", "tolerances: tas: not a number with a unit, got '1.2.3kt'"),
        ("tolerances: {tas: -5kt}", "tolerances: tas: must be greater than 0, got '-5kt'"),
    ],
)
def test_what_is_wrong_is_said_by_its_key(tmp_path: Path, text: str, message: str):
    with pytest.raises(ConfigError, match=re.escape(message)):
        config_of(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("5kt", "tas", 5 * KNOT),
        ("5 kt", "tas", 5 * KNOT),
        ("1.5e1ft", "altitude", 15 * 0.3048),
        ("100 ft/min", "altitude_rate", 100 * 0.3048 / 60),
        ("1deg", "aoa", np.pi / 180),
        ("2 degC", "tat", 2.0),  # a difference has no offset
        ("3 hPa", "p_static", 300.0),
        ("0.1 g", "normal_acc", 0.980665),
        ("4 kt", "v_of_ours", 4 * KNOT),
        ("2.6", "tas", 2.6),
    ],
)
def test_a_tolerance_may_state_its_unit(tmp_path: Path, text: str, name: str, value: float):
    assert config_of(tmp_path, f"tolerances: {{{name}: {text}}}").tolerances[name] == pytest.approx(value, rel=1e-14)


@pytest.mark.usefixtures("unscanned")
def test_a_tolerance_on_the_command_line_may_state_its_unit(bfi: Callable):
    told = [
        json.loads(bfi(*COMMANDS["identify"], "--tolerance", f"tas={value}", "--json").stdout)["candidates"]
        for value in ("5kt", repr(5 * KNOT))
    ]
    assert told[0] == told[1]
    wrong = bfi(*COMMANDS["identify"], "--tolerance", "tas=5deg")
    assert (wrong.code, wrong.stderr) == (2, "--tolerance: tas: is in m/s, got '5deg'; give a unit of that kind\n")
    for given, shown in (("-5kt", "'-5kt'"), ("-5", "-5.0")):
        wrong = bfi(*COMMANDS["identify"], "--tolerance", f"tas={given}")
        assert (wrong.code, wrong.stderr) == (2, f"--tolerance: tas: must be greater than 0, got {shown}\n")


def test_a_tolerance_of_what_is_no_output_is_told_where_it_stands(bfi: Callable, tmp_path: Path):
    (tmp_path / "c.yaml").write_text("tolerances: {tsa: 1}\n")
    (tmp_path / "good.yaml").write_text("tolerances: {tas: 1}\n")
    what = "'tsa' is no output of this analysis; did you mean 'tas'?"
    for options, place in (
        (("-c", tmp_path / "c.yaml"), f"{tmp_path / 'c.yaml'}: tolerances.tsa"),
        (("-c", tmp_path / "good.yaml", "--tolerance", "tsa=1"), "--tolerance"),
    ):
        outcome = bfi(*COMMANDS["identify"], *options)
        assert (outcome.code, outcome.stderr) == (2, f"{place}: {what}\n")


def test_detect_and_diagnose_ask_about_values_that_cannot_be(bfi: Callable, tmp_path: Path):
    rng, time_s = np.random.default_rng(0), np.arange(400) / 10.0
    elevator = 3.0 * np.sign(np.sin(time_s))
    tas = 450.0 + np.cumsum(0.01 * elevator) + 0.1 * rng.standard_normal(time_s.size)
    rows = "\n".join(f"{t:.1f},{a:.4f},{e:.1f}" for t, a, e in zip(time_s, tas, elevator, strict=True))
    (tmp_path / "a.csv").write_text(f"time,tas,elevator [rad]\n{rows}\n")
    for command in ("detect", "diagnose"):
        outcome = bfi(command, tmp_path / "a.csv", "--json")
        assert outcome.code == 0
        notes = texts(json.loads(outcome.stdout)["notes"])
        assert any("'tas' reaches 45" in note for note in notes)
        assert any(note.startswith("the log states no unit for tas") for note in notes)


@pytest.mark.realdata
def test_a_diagnosis_of_a_flight_in_knots_and_feet(bfi: Callable, tmp_path: Path, flights: Path):
    fault = "pitot_icing,magnitude=0.003,onset_s=3550,offset_s=3660"
    bfi("inject", flights / "citation_20180312_f1.h5", "--fault", fault, "-o", tmp_path / "a.h5")
    command = ("diagnose", tmp_path / "a.h5", "--from", 3300, "--to", 3900, "--workers", 1)
    shown = bfi(*command, "--units", "aviation", "--out", tmp_path / "kt", "--verbose")
    assert shown.code == 0
    assert re.search(r"pitot tube ices .* error of true airspeed reaches -\d+ kt", " ".join(shown.stdout.split()))
    assert re.search(r"altitude_rate +drift +\S+ ft/min/s +\d+ ft/min", shown.stdout)
    assert re.search(r"tat +bias +\S+ degC", shown.stdout)
    assert not METRIC.search(shown.stdout)
    plain = bfi("report", tmp_path / "kt" / "result.json", "--out", tmp_path / "si")
    assert re.search(r"pitot tube ices .* error of true airspeed reaches -[\d.]+ m/s", " ".join(plain.stdout.split()))
    for path in (tmp_path / "si").glob("*.csv"):
        assert (tmp_path / "kt" / path.name).read_bytes() == path.read_bytes(), path.name
