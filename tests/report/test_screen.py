"""The first screen: the sentence, the faults, what could hide, three notes, and where the rest is."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_results import fault_result, no_fault_result
from screens import check_screen, screen

from bfi_cli.model.report import identify_content
from bfi_cli.notes import Note


@pytest.mark.parametrize("width", [100, 120])
def test_a_screen_keeps_the_bar(result, width: int):
    content = identify_content(result)
    check_screen(screen(content, width), content)


@pytest.mark.parametrize("width", [80, 120])
def test_a_large_answer_is_one_screen(width: int):
    made = fault_result()
    quiet = tuple(replace(made.candidates[1], name=f"drift_{i}", state="not_seen", effect=1.0 + i) for i in range(300))
    words = (
        "a sentence of a limit that goes on for more than a line of a terminal of eighty columns, and then some more"
    )
    kinds = (Note.method, Note.advice, Note.limit)
    notes = [kinds[i % 3](f"{i} {words}") for i in range(60)]
    content = identify_content(replace(made, candidates=(*made.candidates, *quiet), notes=tuple(notes)))
    lines = screen(content, width)
    check_screen(lines, content)
    assert "57 more notes" in lines[-1]
    assert not any("drift_0 " in line for line in lines)
    assert any(line.startswith("drift_299 ") for line in lines), "the largest beside its tolerance stands first"


def test_what_could_be_of_any_size_comes_first_and_what_was_not_looked_for_is_no_row():
    made = no_fault_result()
    sized = replace(made.candidates[0], state="not_seen", tolerance=1.0, channel_unit="m/s")
    named = {"small": 0.5, "large": 3.0, "any": None}
    candidates = [replace(sized, name=name, effect=effect) for name, effect in named.items()]
    left_out = replace(sized, name="left out", state=None)
    rows = identify_content(replace(made, candidates=(*candidates, left_out))).screen.hidden.rows
    assert [row[0] for row in rows] == ["any", "large", "small"]
    assert [row[2] for row in rows] == ["any", "3 m/s", "0.5 m/s"]


def test_a_long_fault_loses_what_stands_in_brackets_and_no_number_is_cut():
    content = identify_content(fault_result())
    onset = "from 13.80 s"
    fault = f"a 0.551 Hz oscillation of 4.004 m/s (95 % interval 3.995 to 4.013) on aoa_left {onset}"
    lines = screen(replace(content, screen=replace(content.screen, faults=(f"{fault} (13.79 to 13.81 s)", "b"))), 120)
    assert lines[1:3] == [f"  {fault}", "  b"]
