"""`bfi diagnose`, run as a user runs it, on a journey with one fault or none."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_diagnoses import FROM_S, ONSET_S, PART, TO_S, Diagnoses
from screens import check_screen, screen

from bfi_cli.config import Config
from bfi_cli.flight import diagnose_content, diagnose_flight, looks
from bfi_cli.flightlog import FlightLog, write_log

ICING = f"pitot_icing,magnitude=0.0025,onset_s={ONSET_S}"
DRIFT = f"drift,channel=tas,magnitude=0.1,onset_s={ONSET_S}"
BLOCKED = f"pitot_blocked,onset_s={ONSET_S},offset_s=520"
VANE = f"drift,channel=aoa,magnitude=0.0007,onset_s={ONSET_S}"
AIRSPEEDS = {"tas", "cas", "mach", "sat"}

# The contract of `bfi diagnose --json`, and what was added to it.
KEYS = {"kind", "schema", "decision", "events", "limits", "phases", "windows", "missing", "notes", "provenance"}
MORE = {"log", "verdicts", "summary", "false_alarm", "zero_lift_rad", "zero_lift_from", "deviations", "unwatched"}
MORE |= {"plausibility", "ordinary", "headline"}
EVENT_KEYS = {"fault", "among", "channels", "state", "shape", "magnitude", "unit", "ci95", "effect", "onset_s"}
EVENT_KEYS |= {"onset_ci95", "offset_s", "p_value", "evidence"}
EVENT_MORE = {"kind", "stages", "constant_s", "frequency_hz", "sd", "seen_until_s", "window_s", "statistic"}
EVENT_MORE |= {"threshold", "note", "repeat", "beyond_tolerance", "count", "times_s", "duration_s"}
EVENT_MORE |= {"margin", "refuted_by"}
LIMIT_KEYS = {"fault", "shape", "excluded_above", "unit", "effect", "within_tolerance", "from_s", "to_s"}
LIMIT_MORE = {"channel", "effect_unit", "tolerance", "bounds", "holds_in", "grows_on"}
LIMIT_MORE |= {"seen_above", "seen_effect", "seen_within_s"}
FIGURES = {"timeline", "limits", "event_1"}


def test_the_keys_are_those_of_the_contract(diagnoses: Diagnoses):
    document = diagnoses.of(ICING)
    assert document.keys() == KEYS | MORE
    assert (document["kind"], document["schema"]) == ("diagnose", 4)
    (event,) = document["events"]
    assert (event["fault"], event["among"]) == ("pitot_icing", ["pitot_icing"])
    assert event.keys() == EVENT_KEYS | EVENT_MORE
    assert all(one.keys() == LIMIT_KEYS | LIMIT_MORE for one in document["limits"])
    assert all(one.keys() == {"phase", "from_s", "to_s"} for one in document["phases"])
    assert document["log"]["start_s"] == pytest.approx(FROM_S)


@pytest.mark.slow
def test_a_healthy_flight_has_no_event(diagnoses: Diagnoses):
    document = diagnoses.of("")
    assert document["events"] == []
    assert document["decision"] != "fault"
    assert all(one["statistic"] <= one["threshold"] for one in document["windows"])
    assert document["zero_lift_rad"] == pytest.approx(np.radians(-1.2), abs=np.radians(0.05))


# Of figures alone.
NO_SERIES: dict[str, object] = {key: [] for key in ("time_s", "strips", "limit_courses", "courses")}
NO_SERIES |= {key: {} for key in ("measured", "corrected", "units")}


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("fault", [ICING, ""])
def test_a_healthy_and_a_faulty_flight_are_one_screen(diagnoses: Diagnoses, fault: str):
    content = diagnose_content({**diagnoses.of(fault), "series": NO_SERIES})
    check_screen(screen(content), content)


def test_a_course_is_shown_with_its_time_constant(diagnoses: Diagnoses):
    document = {**diagnoses.of(ICING), "series": NO_SERIES}
    document["events"] = [{**document["events"][0], "shape": "lagged_bias", "constant_s": 3.0}]
    events = next(one for one in diagnose_content(document).tables if one.name == "events")
    assert events.rows[0][4].startswith("lagged_bias ")
    assert events.rows[0][4].endswith(") over 3 s")


def test_icing_is_told_from_a_fault_of_one_airspeed(diagnoses: Diagnoses):
    (event,) = diagnoses.of(ICING)["events"]
    assert (event["fault"], event["among"]) == ("pitot_icing", ["pitot_icing"])
    assert (event["state"], event["kind"], event["shape"]) == ("declared", "slow", "drift")
    assert set(event["channels"]) == AIRSPEEDS
    low, high = event["ci95"]
    assert low < 0.0025 < high
    assert high - low < 0.001
    assert (event["unit"], event["offset_s"]) == ("1/s", None)
    assert event["onset_ci95"][0] <= ONSET_S <= event["onset_ci95"][1]
    assert event["effect"]["tas"] < -5.0
    # The lift and the ground see the airspeed; the climb angle hardly does.
    assert event["evidence"]["lift"] > event["evidence"]["climb"]
    assert event["evidence"]["ground_speed"] > 10.0
    assert event["statistic"] > event["threshold"]


@pytest.mark.slow
def test_a_drift_of_tas_alone_is_read_off_the_relations(diagnoses: Diagnoses):
    (event,) = diagnoses.of(DRIFT)["events"]
    assert (event["fault"], event["among"], event["channels"]) == ("tas", ["tas"], ["tas"])
    assert event["stages"][0] == "static relations"
    assert event["magnitude"] == pytest.approx(0.1, rel=0.02)
    assert event["unit"] == "m/s^2"
    assert event["onset_s"] == pytest.approx(ONSET_S, abs=3.0)


@pytest.mark.slow
def test_a_blocked_pitot_tube_is_held_until_it_is_free(diagnoses: Diagnoses):
    document = diagnoses.of(BLOCKED)
    (event,) = document["events"]
    assert (event["fault"], event["among"]) == ("pitot_blocked", ["pitot_blocked"])
    assert (event["magnitude"], event["ci95"], event["stages"][0]) == (None, None, "holds")
    assert set(event["channels"]) == AIRSPEEDS
    assert event["onset_s"] == pytest.approx(ONSET_S, abs=2.0)
    assert event["offset_s"] == pytest.approx(520.0, abs=2.0)
    assert document["verdicts"]["slow"] == document["decision"] == "fault"


@pytest.mark.slow
def test_a_vane_that_drifts_is_named(diagnoses: Diagnoses):
    (event,) = diagnoses.of(VANE)["events"]
    assert (event["fault"], event["channels"]) == ("aoa", ["aoa"])
    assert event["magnitude"] == pytest.approx(0.0007, rel=0.1)
    assert event["onset_s"] == pytest.approx(ONSET_S, abs=5.0)
    assert event["evidence"]["ground_speed"] == 0.0


def test_windows_lie_in_the_part_and_a_fault_tells_no_zero_lift(diagnoses: Diagnoses):
    document = diagnoses.of(ICING)
    assert all(FROM_S - 1e-6 <= one["from_s"] < one["to_s"] <= TO_S + 1e-6 for one in document["windows"])
    # Flight outside of the part, and before the fault, is too short to tell it.
    assert (document["zero_lift_rad"], document["zero_lift_from"]) == (None, "free in every window")


@pytest.mark.slow
def test_exit_codes(diagnoses: Diagnoses):
    """One short part each: 10 where a fault is declared, 4 where the log cannot tell and that matters, 0 else."""
    short = ("--from", 400, "--to", 560, "--workers", 1)
    assert diagnoses.bfi("diagnose", diagnoses.log(DRIFT), *short, "--fail-on", "fault").code == 10
    assert diagnoses.bfi("diagnose", diagnoses.log(DRIFT), *short, "--strict").code == 0
    assert diagnoses.bfi("diagnose", diagnoses.log(""), *short, "--strict", "--fail-on", "fault").code == 4
    assert diagnoses.bfi("diagnose", diagnoses.log(""), *short).code == 0


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_the_files(diagnoses: Diagnoses, tmp_path: Path):
    part = ("--from", 300, "--to", 600, "--workers", 1)
    outcome = diagnoses.bfi("diagnose", diagnoses.log(ICING), *part, "--out", tmp_path / "a", "--progress")
    assert outcome.code == 0
    assert "FAULT  pitot tube ices and loses " in outcome.stdout
    names = {path.name for path in (tmp_path / "a").iterdir()}
    tables = {f"{name}.csv" for name in ("events", "limits", "agreement", "unwatched", "phases")}
    assert names == {"result.json", "report.html", "zoom.html"} | tables | {
        name for figure in FIGURES for name in (f"{figure}.png", f"{figure}.svg", f"{figure}_figure.csv")
    }
    stored = json.loads((tmp_path / "a" / "result.json").read_text("utf-8"))
    assert {"measured", "corrected", "strips", "limit_courses", "courses"} <= stored["series"].keys()
    written = (tmp_path / "a" / "events.csv").read_text("utf-8").splitlines()
    assert written[0] == "# written by bfi"
    (row,) = csv.DictReader(written[1:])
    (event,) = stored["events"]
    assert (row["fault"], row["state"], row["shape"]) == (event["fault"], event["state"], event["shape"])
    assert float(row["onset_s"]) == pytest.approx(event["onset_s"])
    assert [float(part) for part in row["onset_ci95"].split()] == pytest.approx(event["onset_ci95"])

    # Drawn again from the stored result, every file is the same.
    again = diagnoses.bfi("report", tmp_path / "a" / "result.json", "--out", tmp_path / "b")
    assert again.code == 0
    for name in names:
        assert (tmp_path / "b" / name).read_bytes() == (tmp_path / "a" / name).read_bytes(), name


@pytest.mark.slow
def test_corrected_airspeed_is_what_was_flown(journey: FlightLog, diagnoses: Diagnoses, tmp_path: Path):
    outcome = diagnoses.bfi("diagnose", diagnoses.log(ICING), *PART, "--workers", 1, "--json", "--series")
    document = json.loads(outcome.stdout)
    series = document["series"]
    seconds = np.array(series["time_s"])
    corrected = np.array([np.nan if one is None else one for one in series["corrected"]["tas"]])
    known = np.isfinite(corrected)
    assert np.flatnonzero(known).size > 60
    assert seconds[known].min() >= document["events"][0]["onset_s"] - 1.0
    flown = np.interp(seconds, journey.time_s, journey.channels["tas"].values)
    measured = np.array(series["measured"]["tas"])
    assert np.abs(measured - flown)[known].max() > 15.0
    assert np.abs(corrected - flown)[known].max() < 1.5
    (course,) = series["courses"]
    free, low, high = (np.array(course[key]) for key in ("free", "low", "high"))
    after = np.maximum(np.array(course["time_s"]) - ONSET_S, 0.0)
    assert np.all((low <= free) & (free <= high))
    assert np.abs(free - 0.0025 * after).max() < 0.05


@pytest.mark.slow
def test_a_calibration_of_the_aircraft(journey: FlightLog, diagnoses: Diagnoses, tmp_path: Path):
    table = tmp_path / "own.json"
    made = diagnoses.bfi("calibrate", diagnoses.folder / "healthy.h5", "-o", table)
    assert made.code == 0, made.stderr
    stored = json.loads(table.read_text("utf-8"))
    assert stored["air_data"]["zero_lift_rad"] == pytest.approx(np.radians(-1.2), abs=np.radians(0.05))
    part = ("--from", 400, "--to", 560, "--workers", 1, "--json")
    outcome = diagnoses.bfi("diagnose", diagnoses.log(ICING), *part, "--calibration", table)
    document = json.loads(outcome.stdout)
    assert document["zero_lift_rad"] == stored["air_data"]["zero_lift_rad"]
    assert document["zero_lift_from"] == str(table)
    assert [event["fault"] for event in document["events"]] == ["pitot_icing"]


def test_something_is_shown_before_the_work_begins():
    class Begun(Exception):
        pass

    def stop(stage: str, done: float) -> None:
        raise Begun(stage)

    # Nothing has looked at the log by then.
    with pytest.raises(Begun, match="phases of the flight"):
        diagnose_flight(None, Config(), progress=stop)


@pytest.mark.slow
def test_every_stage_of_the_work_is_told(journey: FlightLog):
    told: dict[str, list[float]] = {}
    config = Config.model_validate({"window": {"from_s": 400.0, "to_s": 560.0}})
    log = replace(journey, channels={name: one for name, one in journey.channels.items() if name != "elevator"})
    diagnose_flight(log, config, progress=lambda stage, done: told.setdefault(stage, []).append(done))
    assert list(told) == ["phases of the flight", "static relations", "lift and inertia"]
    assert all(done == sorted(done) and 0.0 <= done[0] <= done[-1] <= 1.0 for done in told.values())


@pytest.mark.slow
def test_numbers_do_not_depend_on_the_workers(
    journey: FlightLog, bfi: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(looks, "FEWEST_FOR_WORKERS", 1)
    path, part = tmp_path / "steered.h5", ("--from", 300, "--to", 600)
    write_log(journey, path)
    documents = [
        json.loads(bfi("diagnose", path, *part, "--workers", workers, "--json", "--series").stdout)
        for workers in (1, 2)
    ]
    for document in documents:
        document.pop("provenance")
    assert documents[0] == documents[1]
    assert documents[0]["events"] == []
    assert not any("not looked for" in sentence for sentence in documents[0]["missing"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "named"),
    [
        (f"static_blocked,onset_s={ONSET_S},offset_s=520", "static_blocked"),
        (f"drift,channel=pitch,magnitude=0.001,onset_s={ONSET_S}", "pitch"),
        (f"bias,channel=tas,magnitude=3,onset_s={ONSET_S}", "tas"),
        (f"scale,channel=cas,magnitude=0.05,onset_s={ONSET_S}", "cas"),
    ],
)
def test_other_faults_are_named(diagnoses: Diagnoses, fault: str, named: str):
    document = diagnoses.of(fault)
    assert document["decision"] == "fault"
    assert named in document["events"][0]["among"]
    assert document["events"][0]["onset_s"] == pytest.approx(ONSET_S, abs=6.0)
