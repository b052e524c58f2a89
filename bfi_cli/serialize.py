"""JSON text of a document."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from .plain import to_plain

__all__ = ["to_json"]


def to_json(document: Mapping[str, Any]) -> str:
    """Return a document as JSON text; dataclasses and arrays become objects and lists, NaN and infinities null."""
    return json.dumps(to_plain(document), indent=1, ensure_ascii=False, allow_nan=False)
