"""An ordinary cause is one row: what a table gains, the judge weighs, the document lists and the report says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from made_diagnoses import Diagnoses
from made_journeys import made_journey

from bfi_cli.faults import parse_spec
from bfi_cli.flight.bench import bench_of, place_of
from bfi_cli.flight.judge import causes_of, judge
from bfi_cli.flight.model import flight_model
from bfi_cli.flight.seconds import seconds_of
from bfi_cli.flight.tables import ORDINARY, Cause
from bfi_cli.flightlog import inject
from bfi_cli.kernels.low_pass import IDENTITY

NAME, TEXT, ONSET_S = "platform_settles", "the platform settles", 420.0
PART = ("--from", 360, "--to", 500, "--workers", 1)
PITCH = f"bias,channel=pitch,magnitude=0.03,onset_s={ONSET_S}"


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave one ordinary cause in the table, a new one."""
    for name in tuple(ORDINARY):
        monkeypatch.delitem(ORDINARY, name)
    monkeypatch.setitem(ORDINARY, NAME, Cause(jumps={"pitch_error": 0.05}, unit="rad", text=TEXT, needs=("pitch",)))


@pytest.mark.slow
def test_the_judge_weighs_a_new_cause(added: None) -> None:
    log = inject(made_journey(rate_hz=2.0), [parse_spec(PITCH)], response=IDENTITY)
    seconds = seconds_of(log)
    assert seconds is not None
    model = flight_model(seconds)
    assert model is not None
    bench = bench_of(model)
    place = place_of(bench, ONSET_S, None)
    assert place is not None
    assert causes_of(model) == {NAME: {"pitch_error": 0.05}}
    judgement = judge(bench, ONSET_S, None)
    assert judgement is not None
    assert judgement.cause == NAME
    assert judgement.gain > 0.0
    # Free at a stated time, it is in every hypothesis: nothing is left for a fault of the pitch to gain.
    stated = judge(bench_of(model, causes=[(NAME, ONSET_S)]), ONSET_S, None)
    weights = [found.weight("pitch") for found in (judgement, stated) if found is not None]
    assert all(weight is not None and np.isfinite(weight.margin) for weight in weights)
    assert stated is not None
    assert stated.gain < judgement.gain


@pytest.mark.usefixtures("undrawn")
def test_document_and_report_tell_a_new_cause(added: None, diagnoses: Diagnoses, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("diagnose", diagnoses.log(PITCH), *PART, "--event", f"{NAME}@{ONSET_S}", "--out", out, "--json")
    outcome = diagnoses.bfi(*words)
    assert outcome.code in (0, 10), outcome.stderr
    document = json.loads(outcome.stdout)
    assert {entry["cause"] for entry in document["ordinary"]} == {NAME}
    assert any(entry["stated"] and entry["from_s"] == ONSET_S for entry in document["ordinary"])
    assert TEXT in (out / "report.html").read_text("utf-8")
    assert TEXT in diagnoses.bfi("report", out / "result.json").stdout


def test_a_cause_is_stated_by_its_name_in_the_table(added: None, diagnoses: Diagnoses) -> None:
    outcome = diagnoses.bfi("diagnose", diagnoses.log(""), *PART, "--event", "platform_setles@420")
    assert outcome.code == 2
    assert f"did you mean '{NAME}'?" in outcome.stderr
