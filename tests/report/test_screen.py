"""The first screen: the headline, lines of a closed list, and how many parts they have no room for."""

from __future__ import annotations

from dataclasses import replace

import pytest
from made_results import fault_result, inconclusive_result, no_fault_result, two_output_result
from screens import check_screen, screen

from bfi_cli.faults import Fault
from bfi_cli.faults.shapes import SHAPES
from bfi_cli.model.report import identify_content
from bfi_cli.notes import Note
from bfi_cli.quantities.text import AVIATION, SI
from bfi_cli.report.first_screen import candidate_lines, estimate_in_words


@pytest.mark.parametrize("width", [100, 120])
def test_a_screen_keeps_the_bar(result, width: int):
    content = identify_content(result)
    check_screen(screen(content, width), content)


@pytest.mark.parametrize("width", [100, 120])
def test_a_large_answer_is_one_screen(width: int):
    made = fault_result()
    quiet = tuple(replace(made.candidates[1], name=f"drift_{i}", state="not_seen", effect=1.0 + i) for i in range(300))
    words = "a sentence of a limit that goes on for more than a line of a terminal, and then some more" * 2
    kinds = (Note.method, Note.advice, Note.limit)
    notes = [kinds[i % 3](f"{i} {words}") for i in range(60)]
    content = identify_content(replace(made, candidates=(*made.candidates, *quiet), notes=tuple(notes)))
    lines = screen(content, width)
    check_screen(lines, content)
    assert "; 19 more: --verbose" in " ".join(lines)


@pytest.mark.parametrize(
    ("made", "state", "channel", "text"),
    [
        (fault_result, "fault", "tas", "true airspeed reads 4.00 m/s too high from 13.8 s (size, 95 %: 3.99 to 4.02)"),
        (two_output_result, "fault", "tas", "true airspeed reads 4.00 m/s too high from 113.8 to 125 s (size, 95 %: "),
        (no_fault_result, "no_fault_found", "", "in this window"),
        (inconclusive_result, "cannot_tell", "tas", "steps of any size could hide"),
    ],
)
def test_the_headline(made, state: str, channel: str, text: str):
    headline = identify_content(made()).screen
    assert (headline.state, headline.channel) == (state, channel)
    assert headline.text.startswith(text)


def test_a_second_fault_stands_below_the_first():
    lines = identify_content(two_output_result()).screen.lines
    assert lines["Also"] == (
        "rate of climb oscillates by 4.00 m/s at 1.15 Hz from 113.8 s (size, 95 %: 3.99 to 4.02) "
        "[sine_altitude_rate_13.8]",
    )


def test_a_fault_within_its_tolerance_says_so():
    made = fault_result()
    small = replace(made.faults[0], beyond_tolerance=False)
    text = identify_content(replace(made, faults=(small,))).verdict
    assert text.endswith(", within its tolerance of 2.6 m/s")


def test_what_is_ruled_out_possible_and_not_checked():
    made = no_fault_result()
    sized = replace(made.candidates[0], kind="abrupt", state="excluded", tolerance=1.0, channel_unit="m/s", effect=0.3)
    other = replace(sized, channel="cas", effect=0.5)
    assert candidate_lines([sized], SI) == {
        "Ruled out": ["steps above 0.3 m/s"],
        "Still possible": [],
        "Not checked": ["oscillations", "slow errors"],
    }
    assert candidate_lines([sized, other], SI)["Ruled out"] == ["steps of calibrated airspeed above 0.5 m/s"]
    assert candidate_lines([replace(sized, state="declared"), other], AVIATION)["Ruled out"] == [
        "other steps of calibrated airspeed above 0.97 kt"
    ]
    open_ones = [
        replace(sized, state="not_seen", effect=2.0),
        replace(sized, kind="slow", state="not_seen", effect=None),
    ]
    assert candidate_lines(open_ones, SI)["Still possible"] == ["a step of up to 2 m/s", "a slow error of any size"]
    searched = replace(sized, onsets_checked=((4.0, 29.4),))
    assert "faults that start before 4 s or after 29.4 s" in candidate_lines([searched], SI)["Not checked"]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_a_sentence(shape: str):
    """With its size where it has one, and without."""
    entry = SHAPES[shape]
    keys = {key.name: "x.csv" if key.rule == "file" else 2.0 for key in entry.keys if key.required}
    fault = Fault(shape=shape, channel="" if entry.lines else "tas", onset_s=12.0, **keys)
    made = replace(fault_result().faults[0], fault=fault, physical_value=-2.0, magnitude=-2.0, ci95=(-2.1, -1.9))
    sized = estimate_in_words(made, SI, "", None)
    assert " from 12 s" in sized
    assert "{" not in sized
    assert entry.says or entry.plainly
    assert ("(size, 95 %: " in sized) == (entry.has_magnitude or entry.acts_on == "course")
    if entry.lines is None:
        assert sized.startswith("true airspeed ")


def test_a_drift_is_told_by_its_physical_rate():
    made = replace(
        fault_result().faults[0],
        fault=Fault(shape="drift", channel="tas", slope=-0.23, onset_s=7.93),
        magnitude=4.0,
        unit="",
        ci95=(3.6, 4.4),
        physical_value=-0.92,
        physical_unit="m/s^2",
    )
    assert estimate_in_words(made, SI, "", None) == (
        "true airspeed drifts down by 0.92 m/s^2 from 7.93 s (size, 95 %: 0.83 to 1.01)"
    )
