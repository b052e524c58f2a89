"""The tables on a terminal."""

import io
from dataclasses import replace

import pytest
from made_results import fault_result, two_output_result
from noted import texts
from rich.console import Console

from bfi_cli.model.report import identify_content
from bfi_cli.notes import Note
from bfi_cli.report.terminal import MAX_ROWS, print_content


def printed(result, width=80, *, terminal=None):
    file = io.StringIO()
    console = Console(file=file, width=width, color_system=None, force_terminal=terminal)
    print_content(identify_content(result), console)
    return file.getvalue()


@pytest.mark.parametrize("width", [80, 120])
def test_no_line_is_wider_than_the_terminal(result, width):
    assert max(map(len, printed(result, width).splitlines())) <= width


def test_the_verdict_comes_first_and_the_notes_are_there(result):
    text = " ".join(printed(result, 400).split())
    assert text.startswith(" ".join(identify_content(result).screen.first.split()))
    assert all(note in text for note in texts(result.notes))


def test_numbers_are_never_cut_at_80_columns():
    text = printed(two_output_result())
    assert "without room for: 95 % interval, until, shape, sd" in text
    assert text.count("0.033 m/s") == 2
    assert printed(two_output_result(), 84).count("3.989 to 4.017 m/s") == 2


def test_names_are_not_markup():
    made = fault_result(channel="[bold]tas[/bold]:warning:")
    made = replace(made, notes=(Note.limit("[link=x]see[/link]"),))
    text = printed(made, 200)
    assert "[bold]tas[/bold]:warning:" in text
    assert "[link=x]see[/link]" in text


def test_a_large_dictionary_is_cut_and_counted_on_a_terminal_only():
    made = fault_result()
    quiet = tuple(replace(made.candidates[1], name=f"drift_{i}") for i in range(300))
    many = replace(made, candidates=(*quiet, made.candidates[0]))
    text = printed(many, terminal=True)
    assert f"and {301 - MAX_ROWS} more" in text
    assert text.index(" bias_13.8 ") < text.index("drift_0 "), "what was declared comes first"
    assert "drift_299" not in text
    assert "drift_299" in printed(many)
