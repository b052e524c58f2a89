"""Events made up for the tests of what is told beside them."""

from __future__ import annotations

from bfi_cli.decision import State
from bfi_cli.flight.result import Event


def event_of(channel: str, at_s: float, state: State = "suspected") -> Event:
    """Return what a finder says of a channel."""
    return Event(
        **dict.fromkeys(("statistic", "threshold"), 1.0),
        fault=channel,
        among=(channel,),
        channels=(channel,),
        state=state,
        kind="abrupt",
        stages=("parity",),
        shape="bias",
        beyond_tolerance=True,
        onset_s=at_s,
        onset_ci95=(at_s, at_s),
        seen_until_s=at_s,
        window_s=(at_s, at_s),
    )
