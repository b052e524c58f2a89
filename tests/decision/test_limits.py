"""Limits of what could hide: what may stand in place of a declared fault, and what begins at an uncertain onset."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bfi_cli.decision.candidate import IN_PLACE, Candidate, not_excluded, untested, with_limit_of_scan

EXCLUDED = Candidate(
    name="sine",
    shape="sine",
    channel="tas",
    kind="oscillating",
    state="excluded",
    magnitude=0.1,
    unit="m/s",
    sd=0.1,
    effect=1.0,
    excluded_above=1.0,
    tolerance=3.0,
    channel_unit="m/s",
    onset_s=20.0,
)


def test_what_may_stand_in_place_of_a_declared_fault_is_not_excluded():
    declared, other = replace(EXCLUDED, state="declared"), replace(EXCLUDED, channel="aoa")
    changed = not_excluded([EXCLUDED, declared, other], {("sine", "tas")})
    assert (changed[0].state, changed[0].effect, changed[0].excluded_above) == ("not_seen", None, None)
    assert changed[0].note == IN_PLACE
    assert changed[1:] == (declared, other)
    assert not_excluded([EXCLUDED], set()) == (EXCLUDED,)


@pytest.mark.parametrize(
    ("scanned", "state", "effect"),
    [
        (replace(EXCLUDED, excluded_above=2.0, effect=2.0), "excluded", 2.0),
        (replace(EXCLUDED, state="not_seen", excluded_above=5.0, effect=5.0), "not_seen", 5.0),
        (untested(EXCLUDED), None, None),
        (replace(EXCLUDED, state="not_seen", effect=None, note="not looked for"), "not_seen", None),
        (None, "not_seen", None),
    ],
    ids=["within the tolerance", "beyond it", "too near an end", "not looked for", "not scanned"],
)
def test_an_entry_whose_onset_is_not_exact_is_excluded_by_what_the_scan_excludes(
    scanned: Candidate | None, state: str | None, effect: float | None
):
    bounded = with_limit_of_scan(EXCLUDED, scanned)
    assert (bounded.state, bounded.effect) == (state, effect)
    assert (bounded.note is None) == (effect is not None)
