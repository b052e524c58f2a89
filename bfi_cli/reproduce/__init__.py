"""Published figures and tables, ours beside theirs: each module makes one or a few of them.

A reproduction is a function that takes `Settings` and returns a `ReportContent`; `catalogue.REPRODUCTIONS` names them.
What was published, and what is said of it, stands in YAML files beside the modules; code computes.
"""

from __future__ import annotations

from .record import Settings

__all__ = ["Settings"]
