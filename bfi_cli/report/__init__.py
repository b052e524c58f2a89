"""The self-contained HTML report of a result."""

from __future__ import annotations

from .html import render_exhibit, render_report

__all__ = ["render_exhibit", "render_report"]
