"""The figure of the largest hidden errors: of many candidates those that say most."""

from __future__ import annotations

from bfi_cli.decision import Candidate
from bfi_cli.report.claims import MOST_ROWS, hidden_drawing


def step(name: str, effect: float | None) -> Candidate:
    return Candidate(
        name=name,
        shape="bias",
        channel="tas",
        kind="abrupt",
        state="not_seen" if effect is None else "excluded",
        magnitude=0.0,
        unit="m/s",
        sd=0.1,
        effect=effect,
        tolerance=2.6,
        channel_unit="m/s",
    )


def test_the_worst_that_has_a_limit_stands_beside_one_that_has_none():
    many = [step(f"b{k}", 0.1 * k) for k in range(MOST_ROWS + 3)]
    alone, with_none = (hidden_drawing(one)[0].panels[0] for one in (many, [*many, step("late", None)]))
    assert [name for name, _ in alone.y_ticks] == [f"b{MOST_ROWS + 2}"]
    assert [name for name, _ in with_none.y_ticks] == [f"b{MOST_ROWS + 2}", "late"]
    assert [text for text, _ in with_none.side_notes] == ["1.4 m/s", "any size"]


def test_an_error_beyond_what_an_airspeed_holds_is_one_of_any_size():
    (drawing,) = hidden_drawing([step("small", 0.4), step("vast", 1455.0)])
    (panel,) = drawing.panels
    assert [text for text, _ in panel.side_notes] == ["0.4 m/s", "any size"]
    assert panel.x_limits is not None
    assert panel.x_limits[1] < 100.0
