"""`bfi identify` on the logs of the repository: the injected truth comes out, and every option does what it says."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from noted import texts

from bfi_cli.decision import Evidence, Manoeuvre
from bfi_cli.flightlog import read_log
from bfi_cli.yaml12 import load_yaml

ROOT = Path(__file__).parents[2]
DATA, CONFIGS = ROOT / "data", ROOT / "configs"
BIAS, TWO, CLEAN = DATA / "citation_bias.h5", DATA / "citation_two_faults.h5", DATA / "citation_clean.h5"
FAULTS = CONFIGS / "thesis_dictionary.yaml"
FEW = ROOT / "tests" / "two_entries.yaml"
MAGNITUDE = {"bias_13.8": 4.0, "sine_1.15": 2.0}
KNOT, DEGREE = 1852.0 / 3600.0, np.pi / 180.0


@pytest.fixture
def identify(bfi: Callable) -> Callable[..., dict[str, Any]]:
    """Run the command, which must succeed without a word on stderr, and return its document."""

    def run(*argv: object, code: int = 0) -> dict[str, Any]:
        outcome = bfi("identify", *argv, "--json", "--series")
        assert (outcome.code, outcome.stderr) == (code, "")
        assert "NaN" not in outcome.stdout
        document: dict[str, Any] = json.loads(outcome.stdout)
        return document

    return run


@pytest.fixture(scope="module")
def once() -> Callable[[str, Callable[[], Any]], Any]:
    """Return a function that keeps what a run gave, by a name: the reference of several tests is made once."""
    made: dict[str, Any] = {}

    def give(name: str, make: Callable[[], Any]) -> Any:
        if name not in made:
            made[name] = make()
        return made[name]

    return give


def at(document: Mapping[str, Any], path: str) -> Any:
    value: Any = document
    for key in path.split("."):
        value = value[key]
    return value


def names(document: Mapping[str, Any]) -> list[str]:
    return [fault["name"] for fault in document["faults"]]


@pytest.mark.first_rows(2)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize(
    ("log", "faults"),
    [
        (BIAS, ["bias_13.8"]),
        (DATA / "citation_bias.csv", ["bias_13.8"]),
        (TWO, ["bias_13.8", "sine_1.15"]),
        (CLEAN, []),
    ],
    ids=lambda value: value.name if isinstance(value, Path) else "",
)
def test_the_injected_truth_comes_out(identify: Callable, once: Callable, log: Path, faults: list[str]):
    document = once(log.name, lambda: identify(log, "-d", FAULTS, "--order", 4))
    assert document["decision"] == ("fault" if faults else "inconclusive")
    assert sorted(names(document)) == faults
    for fault in document["faults"]:
        low, high = fault["ci95"]
        assert low < MAGNITUDE[fault["name"]] < high
        assert fault["unit"] == fault["physical"]["unit"] == "m/s"
        assert fault["physical"]["value"] == fault["magnitude"]
    declared = {one["name"] for one in document["candidates"] if one["state"] == "declared"}
    assert declared == set(faults)
    assert len(document["candidates"]) == 7


@pytest.mark.usefixtures("unscanned")
def test_the_log_s_own_truth_is_compared_with(identify: Callable, once: Callable):
    document = once(TWO.name, lambda: identify(TWO, "-d", FAULTS, "--order", 4))
    assert document["truth"]["isolated"]
    assert (document["truth"]["false_alarms"], document["truth"]["missed"]) == ([], [])
    assert document["vaf"]["fault"]["tas"] > 99.9


@pytest.mark.usefixtures("unscanned")
def test_a_log_without_a_truth_is_compared_with_none(identify: Callable, once: Callable):
    text = DATA / "citation_bias.csv"
    assert once(text.name, lambda: identify(text, "-d", FAULTS, "--order", 4))["vaf"]["fault"] is None


CONTRACT = {
    "": "kind schema log decision faults candidates model vaf solver notes provenance",
    "log": "path rate_hz n_samples start_s stop_s",
    "faults.0": "name shape channel magnitude unit physical sd ci95 onset_s offset_s frequency_hz phase_rad "
    "time_constant_s duration_s",
    "faults.0.physical": "value unit",
    "candidates.0": "name state magnitude sd minimal_detectable excluded_above effect note",
    "model": "order rate_hz inputs outputs noise_sd",
    "vaf": "output fault",
    "solver": "method termination iterations condition_number",
    "provenance": "version log_sha256 config_sha256 dictionary_sha256 seed numpy scipy command date",
}


@pytest.mark.usefixtures("unscanned")
def test_the_document_of_the_contract(identify: Callable, once: Callable):
    document = once(BIAS.name, lambda: identify(BIAS, "-d", FAULTS, "--order", 4))
    for path, keys in CONTRACT.items():
        part: Any = document
        for key in filter(None, path.split(".")):
            part = part[int(key)] if key.isdigit() else part[key]
        assert set(keys.split()) <= set(part), path
    assert (document["kind"], document["schema"]) == ("identify", 4)
    assert document["provenance"]["command"] == f"bfi identify {BIAS} -d {FAULTS} --order 4 --json --series"
    assert document["provenance"]["log_sha256"] == read_log(BIAS).sha256


@pytest.mark.usefixtures("unscanned")
def test_absent_sizes_are_null(identify: Callable, tmp_path: Path):
    path = tmp_path / "d.yaml"
    path.write_text("atoms:\n- {name: late, shape: bias, onset_s: 99}\n- {name: live, shape: bias, onset_s: 13.8}\n")
    late, live = identify(BIAS, "-d", path, "--order", 4)["candidates"]
    assert late["note"].startswith("'late' starts at 99 s, after the window ends")
    assert (late["magnitude"], late["sd"], late["minimal_detectable"]) == (None, None, None)
    assert live["note"] is None
    assert live["minimal_detectable"] > 0.0


# Key of the configuration, text of a file that sets it, what the document then says; on the log with two faults.
EFFECTS: tuple[tuple[str, str, str, Any], ...] = (
    ("inputs", "inputs: [pitch_rate]", "model.inputs", ["pitch_rate"]),
    ("outputs", "outputs: [tas, aoa]", "model.outputs", ["tas", "aoa"]),
    ("channels", "channels: {pitch: aoa}\ninputs: [pitch]", "model.inputs", ["pitch"]),
    ("units", "units: {tas: kt}", "faults", lambda faults: abs(faults[0]["magnitude"] - 4.0 * KNOT) < 0.01),
    ("window.from_s", "window: {from_s: 2}", "log.start_s", lambda start: 2.0 <= start < 2.5),
    ("window.to_s", "window: {to_s: 28}", "log.stop_s", lambda stop: 27.5 < stop <= 28.0),
    ("tolerances.tas", "tolerances: {tas: 0.5}", "candidates", lambda c: c[0]["tolerance"] == 0.5),
    ("onset_tolerance_s", "onset_tolerance_s: 0", "candidates", lambda c: c[0]["minimal_detectable"] < 0.1),
    (
        "require",
        "require: [slow]\nselection: {evidence: 1e4}\nwindow: {to_s: 12}",
        "decision",
        "inconclusive",
    ),
    ("recorder.edge_hz", "recorder: {edge_hz: 3}", "notes", lambda notes: "gain one half at 3 Hz" in str(notes)),
    ("recorder.kind", "recorder: {edge_hz: 3, kind: fir}", "notes", lambda notes: "(fir, gain" in str(notes)),
    ("conditioning.variance", "conditioning: {variance: constant}", "decision", "fault"),
    ("conditioning.rate_hz", "conditioning: {rate_hz: 5}", "log.rate_hz", 5.0),
    ("conditioning.detrend", "conditioning: {detrend: none}", "decision", "fault"),
    ("conditioning.filter", "conditioning: {filter: causal}", "log.start_s", lambda start: start > 0.3),
    ("model.order", "model: {order: 5}", "model.order", 5),
    ("model.orders", "model: {orders: [3, 7]}", "order_selection.orders", [3, 7]),
    ("model.feedthrough", "model: {feedthrough: false}", "model.feedthrough", False),
    ("method", "method: risro", "solver.method", "risro"),
    ("risro.as_published", "method: risro\nrisro: {as_published: true}", "solver.method", "risro"),
    ("risro.max_iterations", "method: risro\nrisro: {max_iterations: 2, tolerance: 1e-300}", "solver.iterations", 2),
    ("risro.tolerance", "method: risro\nrisro: {tolerance: 1e9}", "solver.iterations", lambda n: n <= 2),
    ("dmae.model", "method: dmae\ndmae: {model: citation}\nwindow: {to_s: 16}", "solver.method", "dmae"),
    ("selection.max_active", "selection: {max_active: 1}", "faults", lambda faults: len(faults) == 1),
    ("selection.evidence", "selection: {evidence: 1e4}", "faults", []),
    ("selection.criterion", "selection: {criterion: bic}", "decision", "fault"),
    ("selection.threshold", "method: risro\nselection: {threshold: 0.99}", "faults", lambda faults: len(faults) < 2),
    (
        "dictionary",
        "dictionary: {atoms: [{name: x, shape: bias, onset_s: 13.8}]}",
        "candidates",
        lambda c: c[0]["name"] == "x",
    ),
    ("seed", "seed: 7", "provenance.seed", 7),
)
OF_OTHERS = ("start_time.", "detect.", "diagnosability.", "diagnose.", "calibrate.", "audit.")
DMAE = (
    "reference: start",
    "process_variance: 1e-3",
    "measurement_variance: {tas: 1.0}",
    "fault_variance: 1.0",
    "adaptive_window: null",
)
# Those change the magnitudes that the published method finds.
SPARSITY = ("sparsity: none", "alpha: 9.0", "r: 1e-3", "p0: 1e3", "updates: 9")


@pytest.mark.first_rows(5)
@pytest.mark.parametrize(("key", "text", "path", "expected"), EFFECTS, ids=[effect[0] for effect in EFFECTS])
def test_a_key_of_the_configuration(
    identify: Callable, request: pytest.FixtureRequest, tmp_path: Path, key: str, text: str, path: str, expected: Any
):
    request.getfixturevalue("unscanned")
    file = tmp_path / "c.yaml"
    file.write_text(text if key == "dictionary" else f"{text}\ndictionary: {FEW}\n")
    order = () if key.startswith("model.") else ("--order", 4)  # the search for one takes half of the time
    found = at(identify(TWO, "-c", file, *order), path)
    assert expected(found) if callable(expected) else found == expected


@pytest.mark.first_rows(2)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("i", range(len(SPARSITY)), ids=[text.partition(":")[0] for text in SPARSITY])
def test_a_key_of_the_sparsity_stage(identify: Callable, once: Callable, tmp_path: Path, i: int):
    file = tmp_path / "c.yaml"

    def magnitudes(*settings: str) -> list[float]:
        fixed = "method: risro-as-published\nmodel: {order: 4}\nconditioning: {rate_hz: 10}"
        file.write_text(f"{fixed}\ndictionary: {FAULTS}\nrisro: {{{', '.join(settings)}}}\n")
        return [candidate["magnitude"] for candidate in identify(TWO, "-c", file)["candidates"]]

    assert magnitudes(SPARSITY[i]) != once("risro-as-published", magnitudes)


@pytest.mark.first_rows(1)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("text", ["sparsity: l1", "alpha: 0.1", "r: 10.0", "p0: 0.01"])
def test_a_key_of_the_derived_stage_changes_where_it_goes(
    identify: Callable, once: Callable, tmp_path: Path, text: str
):
    file = tmp_path / "c.yaml"

    def went(*settings: str) -> list[tuple[int, list[list[str]]]]:
        fixed = "method: risro\nmodel: {order: 4}\nconditioning: {rate_hz: 10}"
        file.write_text(f"{fixed}\ndictionary: {FAULTS}\nrisro: {{{', '.join(settings)}}}\n")
        return [(run["iterations"], run["supports"]) for run in identify(TWO, "-c", file)["solver"]["sparsity"]["runs"]]

    assert went(text) != once("risro", went)


@pytest.mark.first_rows(2)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("kind", ["none", "l1", "lp", "exp-l0"])
def test_the_option_of_the_stage(identify: Callable, kind: str):
    document = identify(TWO, "-d", FAULTS, "--method", "risro", "--order", "6", "--rate", "10", "--sparsity", kind)
    told = document["solver"]["sparsity"]
    assert (told and told["kind"]) == (None if kind == "none" else kind)
    assert set(MAGNITUDE) <= {fault["name"] for fault in document["faults"]}


@pytest.mark.usefixtures("unscanned")
def test_strict_refuses_an_answer_of_a_solver_that_did_not_converge(identify: Callable, tmp_path: Path):
    file = tmp_path / "c.yaml"
    file.write_text(
        f"method: risro\nstrict: true\ndictionary: {FEW}\n"
        "risro: {sparsity: none, max_iterations: 2, tolerance: 1e-300}\n"
    )
    document = identify(TWO, "-c", file, code=4)
    assert document["decision"] == "inconclusive"
    assert {fault["ci95"] for fault in document["faults"]} == {None}


@pytest.mark.slow
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("text", DMAE, ids=[text.partition(":")[0] for text in DMAE])
def test_a_key_of_the_double_model_estimator(identify: Callable, once: Callable, tmp_path: Path, text: str):
    file = tmp_path / "c.yaml"

    def noise(*settings: str) -> dict[str, float]:
        keys = ", ".join(("model: citation", *settings))
        window = "window: {from_s: 1, to_s: 14.5}\nconditioning: {rate_hz: 5}"
        file.write_text(f"method: dmae\n{window}\ndictionary: {FEW}\ndmae: {{{keys}}}\n")
        return identify(TWO, "-c", file)["model"]["noise_sd"]

    # The variance of the fault is a start only where the filter adapts it.
    first = ["adaptive_window: null"] if text.startswith("fault_variance") else []
    assert noise(*first, text) != once(f"dmae {first}", lambda: noise(*first))


@pytest.mark.usefixtures("unscanned")
def test_strict_and_fail_on_in_a_configuration(identify: Callable, tmp_path: Path):
    file = tmp_path / "c.yaml"
    file.write_text(f"fail_on: fault\ndictionary: {FEW}\n")
    identify(BIAS, "-c", file, code=10)
    file.write_text("strict: true\ndictionary: {atoms: [{shape: drift, onset_s: 0}]}\n")
    identify(CLEAN, "-c", file, code=4)


def keys(document: Mapping[str, Any], above: str = "") -> set[str]:
    found: set[str] = set()
    for key, value in document.items():
        nested = isinstance(value, dict) and f"{above}{key}" not in ("channels", "units", "dictionary")
        found |= keys(value, f"{above}{key}.") if nested else {f"{above}{key}"}
    return found


def test_no_key_of_the_example_is_forgotten():
    here = {effect[0] for effect in EFFECTS} | {f"risro.{text.partition(':')[0]}" for text in SPARSITY}
    here |= {f"dmae.{text.partition(':')[0]}" for text in DMAE}
    others = {key for key in keys(load_yaml(CONFIGS / "example.yaml")) if not key.startswith(OF_OTHERS)}
    # Those of reading are in tests/flightlog/test_filling.py, the units that are shown in tests/commands/test_units.py.
    assert others <= here | {
        "strict",
        "fail_on",
        "group",
        "sample_rate_hz",
        "columns",
        "keep",
        "fill_s",
        "fix_units",
        "boot",
        "shown_units",
    }


@pytest.mark.usefixtures("unscanned")
def test_the_example_runs_as_it_stands(identify: Callable, tmp_path: Path):
    log = as_csv(tmp_path / "log.csv", "time,elevator [rad],my_airspeed", tas=1.0 / KNOT)
    document = identify(log, "-c", CONFIGS / "example.yaml")
    assert names(document) == ["bias_13.8"]
    assert document["faults"][0]["magnitude"] == pytest.approx(4.0, abs=0.02)
    assert document["provenance"]["config_sha256"] is not None


@pytest.mark.usefixtures("unscanned")
def test_a_dictionary_is_relative_to_the_configuration(
    identify: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "settings").mkdir()
    (tmp_path / "settings" / "faults.yaml").write_text(FEW.read_text())
    (tmp_path / "settings" / "c.yaml").write_text("dictionary: faults.yaml\n")
    monkeypatch.chdir(tmp_path)
    assert names(identify(BIAS, "-c", "settings/c.yaml")) == ["bias_13.8"]


@pytest.mark.usefixtures("unscanned")
def test_the_command_line_wins(identify: Callable, tmp_path: Path):
    (tmp_path / "c.yaml").write_text(
        "outputs: [aoa]\nseed: 1\nmodel: {order: 3, feedthrough: false}\nconditioning: {rate_hz: 5}\nfail_on: fault\n"
        "window: {from_s: 3, to_s: 20}\nmethod: risro\ndictionary: {atoms: [{shape: bias, channel: aoa, onset_s: 4}]}\n"
    )
    document = identify(
        *(BIAS, "-c", tmp_path / "c.yaml", "-d", FEW, "--output", "tas", "--seed", 2, "--order", 6, "--rate", 10),
        *("--feedthrough", "--from", 0, "--to", 31, "--method", "ml"),
        code=10,
    )
    found = [at(document, path) for path in ("model.outputs", "provenance.seed", "model.order", "model.feedthrough")]
    assert found == [["tas"], 2, 6, True]
    assert (document["log"]["rate_hz"], document["solver"]["method"]) == (10.0, "ml")
    assert document["log"]["start_s"] < 1.0
    assert document["log"]["stop_s"] > 30.0
    assert names(document) == ["bias_13.8"]


@pytest.mark.usefixtures("unscanned")
def test_what_the_command_line_leaves_out_stays(identify: Callable, tmp_path: Path):
    log = as_csv(tmp_path / "log.csv", "time,elevator [rad],my_airspeed", tas=1.0 / KNOT)
    text = "channels: {tas: my_airspeed}\nunits: {my_airspeed: kt}\nmodel: {order: 3}\n"
    (tmp_path / "c.yaml").write_text(f"{text}dictionary: {FEW}\n")
    document = identify(log, "-c", tmp_path / "c.yaml", "--unit", "elevator=rad")
    assert document["model"]["order"] == 3
    assert document["faults"][0]["magnitude"] == pytest.approx(4.0, abs=0.02)


def as_csv(path: Path, header: str, *, tas: float = 1.0, elevator: float = 1.0) -> Path:
    """Write time, elevator and airspeed of the log with the bias, scaled, under a header of choice."""
    log = read_log(BIAS)
    columns = (log.time_s, elevator * log.channel("elevator").values, tas * log.channel("tas").values)
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


@pytest.mark.first_rows(1)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize(
    ("header", "options"),
    [
        ("t [s],de [deg],vtas [kt]", []),
        ("time_s,delta_e_deg,true_airspeed_kt", []),
        ("time,de,Dadc1_tas", ["--unit", "Dadc1_tas=kt", "--unit", "de=deg"]),
        ("time,de,Dadc1_tas", ["--unit", "tas=kt", "--unit", "elevator=deg"]),
        ("time,stick,speed", ["--channel", "tas=speed", "--channel", "elevator=stick", "--unit", "speed=kt"]),
    ],
)
def test_names_and_units_of_other_recorders(
    identify: Callable, once: Callable, tmp_path: Path, header: str, options: list[str]
):
    scale = 1.0 if "stick" in header else 1.0 / DEGREE
    log = as_csv(tmp_path / "log.csv", header, tas=1.0 / KNOT, elevator=scale)
    document = identify(log, "-d", FEW, "--order", 4, *options)
    plain = once("plain", lambda: identify(BIAS, "-d", FEW, "--order", 4, "--input", "elevator"))
    assert (document["model"]["inputs"], document["model"]["outputs"]) == (["elevator"], ["tas"])
    assert document["faults"][0]["magnitude"] == pytest.approx(plain["faults"][0]["magnitude"], rel=1e-6)
    assert document["faults"][0]["unit"] == "m/s"


@pytest.mark.usefixtures("unscanned")
def test_a_window_moves_the_faults_of_a_dictionary_relative_to_it(identify: Callable, tmp_path: Path):
    path = tmp_path / "d.yaml"
    found = []
    for reference, onset in (("log", 13.8), ("window", 11.8)):
        path.write_text(f"relative_to: {reference}\natoms: [{{name: x, shape: bias, onset_s: {onset}}}]\n")
        document = identify(BIAS, "-d", path, "--from", 2, "--to", 29, "--order", 4, "--rate", 10)
        assert 2.0 <= document["log"]["start_s"] < document["log"]["stop_s"] < 29.0
        found.append((document["faults"][0]["onset_s"], document["faults"][0]["magnitude"]))
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert found[0] == (13.8, pytest.approx(4.0, abs=0.05))


@pytest.mark.first_rows(2)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize(("rate", "rate_hz"), [("auto", 10.0), ("20", 20.0), ("7.5", 7.5), ("none", 100.0)])
def test_rate(identify: Callable, rate: str, rate_hz: float):
    assert identify(BIAS, "-d", FEW, "--rate", rate, "--order", 2)["log"]["rate_hz"] == pytest.approx(rate_hz)


@pytest.mark.usefixtures("unscanned")
def test_the_seed_repeats_the_numbers(identify: Callable):
    one, same = (identify(TWO, "-d", FEW, "--rate", 5, "--order", 2, "--seed", 3) for _ in range(2))
    assert one["provenance"].pop("date") <= same["provenance"].pop("date")
    assert one == same
    assert one["provenance"]["seed"] == 3


TABLES = ("faults", "candidates", "residuals", "truth", "orders", "series")
FILES = {"result.json", "report.html", *(f"{name}.csv" for name in TABLES)}


@pytest.mark.usefixtures("unscanned", "undrawn")
def test_out_writes_everything_and_report_draws_it_again(bfi: Callable, identify: Callable, tmp_path: Path):
    document = identify(TWO, "-d", FEW, "--rate", 10, "--order", 4, "--out", tmp_path / "deep" / "out")
    files = {path.name: path.read_bytes() for path in (tmp_path / "deep" / "out").iterdir()}
    figures = {Path(name).stem for name in files if name.endswith(".png")}
    assert set(files) >= FILES
    assert len(figures) >= 3
    assert set(files) == FILES | {f"{name}{suffix}" for name in figures for suffix in (".png", ".svg", "_figure.csv")}
    assert json.loads(files["result.json"]) == document
    assert b"http://" not in files["report.html"].replace(b"http://www.w3.org", b"")
    assert files["faults.csv"].count(b"\n") == 4

    outcome = bfi("report", tmp_path / "deep" / "out" / "result.json", "--out", tmp_path / "again")
    assert (outcome.code, outcome.stderr) == (0, "")
    assert {path.name: path.read_bytes() for path in (tmp_path / "again").iterdir()} == files


def test_without_a_dictionary_the_scan_proposes_the_faults(identify: Callable):
    document = identify(BIAS, "--rate", 5, "--order", 2)
    (fault,) = document["faults"]
    assert fault["shape"] == "bias"
    assert fault["onset_s"] == pytest.approx(13.8, abs=0.011)
    assert fault["magnitude"] == pytest.approx(4.0, abs=0.02)
    assert document["truth"]["isolated"] is True
    assert any("no dictionary: 1 declared by the search over all onsets" in text for text in texts(document["notes"]))


def test_what_the_conclusion_only_suspects_stays_in_the_corrected_signal(
    identify: Callable, monkeypatch: pytest.MonkeyPatch
):
    stall = Manoeuvre(name="stall", from_s=12.0, to_s=15.0, beside_s=2.0)
    flown = Evidence(source="phases", manoeuvres=(stall,))
    monkeypatch.setattr("bfi_cli.model.identify.manoeuvres_of", lambda *_: flown)
    document = identify(BIAS, "--rate", 5, "--order", 2)
    (output,) = document["series"]["outputs"]
    assert (document["decision"], document["faults"]) == ("inconclusive", [])
    assert document["truth"]["missed"] == ["bias_13.8"]
    assert output["corrected"] == output["measured"]
    assert any("within 2 s of a stall" in text for text in texts(document["notes"]))


def test_without_a_dictionary_and_without_a_fault_the_limits_of_the_scan_are_shown(identify: Callable):
    document = identify(CLEAN, "--rate", 5, "--order", 2)
    assert (document["decision"], document["faults"]) == ("inconclusive", [])
    limit = {one["name"]: one["minimal_detectable_scan"] for one in document["candidates"]}
    assert {"bias", "drift", "sine"} <= set(limit)
    assert 0.01 < limit["bias"] < 0.5
    assert any("the search over all onsets declares none" in text for text in texts(document["notes"]))


def test_where_the_window_is_not_scanned_onsets_known_to_a_tolerance_exclude_nothing(
    identify: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("bfi_cli.analysis.MOST_SAMPLES", 10)
    known, exact = (identify(CLEAN, "-d", FEW, "--rate", 10, "--onset-tolerance", t) for t in (1, 0))
    assert known["scan"]["decision"] is None
    assert "not scanned for other onsets" in known["scan"]["note"]
    assert {one["state"] for one in known["candidates"]} == {"not_seen"}
    assert set(known["verdicts"].values()) == {"inconclusive"}
    assert "excluded" in {one["state"] for one in exact["candidates"]}
