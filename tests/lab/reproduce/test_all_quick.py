"""Every reproduction in its quick form, as one command; BFI_FULL=1 places labels and makes PNG of the figures."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bfi_cli.commands import COMMANDS
from bfi_cli.lab.reproduce import Settings
from bfi_cli.lab.reproduce.catalogue import REPRODUCTIONS, reproduce_content
from bfi_cli.report.content import ReportContent
from bfi_cli.serialization import to_plain

pytestmark = pytest.mark.slow


def test_all_of_them_are_made_and_can_be_drawn_again(
    bfi: Callable[..., Any],
    made: Callable[[str], ReportContent],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
):
    """One of the names that share a function; those that other tests look into are made no second time."""
    if os.environ.get("BFI_FULL") != "1":
        request.getfixturevalue("vectors")

    def run(name: str, settings: Settings) -> ReportContent:
        assert (settings.quick, settings.trials) == (True, 1)
        return made(name)

    monkeypatch.setitem(COMMANDS, "reproduce", "")
    monkeypatch.setattr("bfi_cli.lab.reproduce.catalogue.run", run)
    once = {(entry.module, entry.function): name for name, entry in reversed(REPRODUCTIONS.items())}.values()
    monkeypatch.setattr("bfi_cli.lab.reproduce.catalogue.REPRODUCTIONS", {name: REPRODUCTIONS[name] for name in once})
    done = bfi("reproduce", "all", "--quick", "--trials", 1, "--out", tmp_path, "--json", "--series")
    summary = reproduce_content(json.loads(done.stdout))
    print("\n" + "\n".join(f"{row[0]}: {row[2]}. {row[3]}" for row in summary.tables[0].rows))
    assert done.code == 0, done.stderr
    assert len(summary.tables[0].rows) == len(once)
    for name in once:
        document = json.loads((tmp_path / name / "result.json").read_text())
        content = reproduce_content(document, where=name)
        body = to_plain(content)
        same = body.keys() - {"category", "data"}
        assert {key: body[key] for key in same} == {key: document["exhibit"][key] for key in same}
        assert document["exhibit"]["kicker"] == body["category"]
        assert (tmp_path / name / "report.html").stat().st_size > 1000
        for drawing in content.drawings:
            assert (tmp_path / name / f"{drawing.name}.svg").exists()
            assert (tmp_path / name / f"{drawing.name}.png").exists()
        for table in content.tables:
            assert (tmp_path / name / f"{table.name}.csv").exists()
