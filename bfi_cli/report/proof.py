"""What the limits of an answer are worth on its own log, as a table."""

from __future__ import annotations

from collections.abc import Sequence

from ..decision import Proof
from ..quantities.text import SI, Units, change
from .content import Table

HEADS = ("kind", "channel", "size", "found", "of")
TITLE = "Faults of the stated limits, added to this log one at a time"


def proof_tables(proofs: Sequence[Proof], units: Units = SI) -> tuple[Table, ...]:
    """Return the table of the proofs; () without any."""
    rows = tuple(
        (
            proof.kind,
            proof.channel,
            change(proof.size, units.of(proof.unit, channel=proof.channel)),
            str(proof.n_seen),
            str(proof.n_added),
        )
        for proof in proofs
    )
    return (Table(name="proved", title=TITLE, heads=HEADS, rows=rows),) if rows else ()
