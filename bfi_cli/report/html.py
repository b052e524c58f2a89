"""The template filled with a result: one file, no script, nothing fetched."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from importlib import resources
from typing import TYPE_CHECKING

from .. import rows
from ..exhibit import Exhibit
from ..identify.result import IdentifyResult
from ..printable import printable
from ..provenance import Provenance
from ..wording import verdict
from .captions import caption

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

__all__ = ["render_exhibit", "render_report"]

ONE_LINE_LETTERS = 18
HEADINGS = {"fault": "Fault found", "no_fault": "No fault found", "not_identifiable": "Not identifiable"}


def render_report(result: IdentifyResult, provenance: Provenance, figures: Mapping[str, bytes]) -> str:
    """Return the report as one HTML text that refers to nothing outside itself.

    Parameters
    ----------
    result : what was found.
    provenance : where it comes from.
    figures : SVG bytes by the name of the figure ("outputs", "fault", ...), in the order of the report.
    """
    return _template("report.html.j2").render(
        css=_file("report.css"),
        decision=result.decision,
        heading=HEADINGS[result.decision],
        verdict=verdict(result),
        log_path=result.log.path,
        summary=rows.summary_rows(result),
        faults=rows.fault_rows(result),
        candidates=rows.candidate_rows(result),
        residuals=rows.residual_rows(result),
        truth=rows.truth_rows(result),
        notes=result.notes,
        model=rows.model_rows(result),
        provenance=rows.provenance_rows(provenance),
        figures=[_figure(name, svg, caption(name, result)) for name, svg in figures.items()],
    )


def render_exhibit(exhibit: Exhibit, provenance: Provenance, figures: Mapping[str, bytes]) -> str:
    """Return the report of an exhibit as one HTML text that refers to nothing outside itself.

    Parameters
    ----------
    provenance : where it comes from.
    figures : SVG bytes by the name of the drawing, in the order of the report.
    """
    captions = {drawing.name: drawing.caption for drawing in exhibit.drawings}
    return _template("exhibit.html.j2").render(
        css=_file("report.css"),
        exhibit=exhibit,
        provenance=rows.provenance_rows(provenance),
        figures=[_figure(name, svg, captions[name]) for name, svg in figures.items()],
    )


def _figure(name: str, svg: bytes, text: str) -> dict[str, str]:
    data = base64.b64encode(svg).decode("ascii")
    return {"name": name, "src": f"data:image/svg+xml;base64,{data}", "caption": text}


def _template(name: str) -> Template:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(_file),
    )
    environment.filters["unbroken"] = _unbroken
    return environment.get_template(name)


def _shown(value: object) -> object:
    """Make text of a template printable; what is HTML already stays."""
    return printable(value) if isinstance(value, str) and not hasattr(value, "__html__") else value


def _unbroken(text: str) -> Markup:
    """Keep a short text on one line; let a long name break after its underscores."""
    from markupsafe import Markup, escape

    text = printable(text)
    if len(text) <= ONE_LINE_LETTERS:
        return escape(text.replace(" ", "\u00a0"))
    return Markup("_<wbr>").join(escape(part) for part in text.split("_"))


def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text("utf-8")
