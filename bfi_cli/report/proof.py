"""What the limits of an answer are worth on its own log, in documents and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..decision import Proof
from ..quantities.display_units import SI, Units
from ..quantities.text import change
from ..serialization import mapping, member
from .content import Table

HEADS = ("kind", "channel", "size", "found", "of")
TITLE = "Faults of the stated limits, added to this log one at a time"


def with_proof_entries(body: Mapping[str, Any], proofs: Sequence[Proof]) -> dict[str, Any]:
    """Return the body of a document with the entries `proved`, without them where nothing was proved."""
    entries = [
        {
            "kind": proof.kind,
            "channel": proof.channel,
            "size": proof.size,
            "unit": proof.unit,
            "found": proof.n_seen,
            "of": proof.n_added,
        }
        for proof in proofs
    ]
    rest = {key: value for key, value in body.items() if key != "proved"}
    return {**rest, "proved": entries} if entries else rest


def with_plain_proofs(document: Mapping[str, Any], *, where: str) -> dict[str, Any]:
    """Return a document with its entries `proved` as plain data of `Proof`, the inverse of `with_proof_entries`.

    Raises
    ------
    ConfigError : an entry is damaged.
    """
    entries = enumerate(document.get("proved", ()))
    plain = [
        {
            **mapping(entry, where=f"{where}: proved[{i}]"),
            "n_seen": member(entry, "found", where=f"{where}: proved[{i}]"),
            "n_added": member(entry, "of", where=f"{where}: proved[{i}]"),
        }
        for i, entry in entries
    ]
    return {**document, "proved": plain}


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
