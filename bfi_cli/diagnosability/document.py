"""The JSON document of `bfi diagnosability`."""

from __future__ import annotations

from typing import Any

from ..plain import to_plain
from ..provenance import Provenance
from .result import DiagnosabilityResult

__all__ = ["DIAGNOSABILITY_SCHEMA", "diagnosability_document"]

DIAGNOSABILITY_SCHEMA = 1
ORDER_KEYS = ("orders", "criterion_no_fault", "criterion_best")


def diagnosability_document(result: DiagnosabilityResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi diagnosability --json`; what is not known or not finite is None.

    `between` has a row and a column for each of `atoms`, `information` is the curve all bits are read from.
    """
    whole = to_plain(result)
    for key in ORDER_KEYS:
        whole["model"].pop(key)
    information = {
        "deviations": whole.pop("deviations"),
        "bits": whole.pop("bits"),
        "limit_deviations": whole.pop("limit_deviations"),
    }
    notes = whole.pop("notes")
    return {
        "kind": "diagnosability",
        "schema": DIAGNOSABILITY_SCHEMA,
        **whole,
        "information": information,
        "notes": notes,
        "provenance": to_plain(provenance),
    }
