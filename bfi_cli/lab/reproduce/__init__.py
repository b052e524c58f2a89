"""Published figures and tables, ours beside theirs: each module makes one or a few of them.

A reproduction is a function that takes `Settings` and returns a `ReportContent`; `catalogue.REPRODUCTIONS` names them.
The published values and the texts of the pages are in YAML files beside the modules.
"""

from __future__ import annotations

from .record import Settings

__all__ = ["Settings"]
