"""Published figures and tables, ours beside theirs: each module makes one or a few of them.

A reproduction is a function that takes `Settings` and returns an `Exhibit`; `catalogue.REPRODUCTIONS` names them.
"""

from __future__ import annotations

from .settings import Settings, comparison

__all__ = ["Settings", "comparison"]
