"""Results in Python: what they print, draw and tabulate is what their report holds."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from bfi_cli import Config, detect, diagnose, identify, merge, read_log, start_time
from bfi_cli.errors import ConfigError
from bfi_cli.report.presented import Presented

DATA = Path(__file__).parents[2] / "data"
ASKED = {"conditioning.rate_hz": 4.0, "model.order": 2}


@pytest.fixture(scope="module", params=[start_time, identify, diagnose, detect], ids=lambda call: call.__name__)
def result(request: pytest.FixtureRequest) -> Presented:
    call: Callable = request.param
    log = "citation_clean.h5" if call is diagnose else "citation_bias.h5"
    config = merge(Config(), ASKED) if call in (start_time, identify) else Config()
    if call is detect:
        config = merge(config, {"detect.train": (0.0, 10.0)})
    shown: Presented = call(read_log(DATA / log), config=config)
    return shown


def test_a_result_prints_its_first_screen(result: Presented):
    screen = result.report().screen
    assert screen is not None
    lines = repr(result).splitlines()
    assert lines[0].startswith(screen.head.upper())
    assert len(lines) <= 12
    assert all(len(line) <= 100 for line in lines)
    page = result._repr_html_()
    assert page.startswith("<pre>")
    assert page.count("<table>") == len(result.report().tables)


def test_its_figures_and_tables_are_those_of_the_report(result: Presented, monkeypatch: pytest.MonkeyPatch):
    content = result.report()
    assert len(result.plot(content.drawings[-1].name).axes) >= 1
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))
    name = next(iter(content.data))
    columns = result.to_dataframe(name.removesuffix(".csv"))
    assert result.to_dataframe().keys() == columns.keys()
    assert len({len(column) for column in columns.values()}) == 1


@pytest.mark.parametrize(("call", "what"), [("plot", "figure"), ("to_dataframe", "table")])
def test_a_name_that_is_none_is_refused_with_those_that_are(result: Presented, call: str, what: str):
    with pytest.raises(ConfigError, match=f"{what}: the report has no nonesuch; it has: "):
        getattr(result, call)("nonesuch")


def test_without_pandas_it_is_said_what_to_install(result: Presented, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ConfigError, match="pip install pandas"):
        result.to_dataframe()
