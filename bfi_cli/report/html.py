"""The HTML page of a report: one file, no script, nothing fetched."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from ..printable import printable
from ..serialization import Provenance
from .content import ReportContent

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

# Letters of a cell that is kept on one line.
ONE_LINE_LETTERS = 18


def render_content(content: ReportContent, provenance: Provenance, figures: Mapping[str, bytes]) -> str:
    """Return the content as one HTML text without any reference to another file.

    Parameters
    ----------
    provenance : where the numbers come from.
    figures : SVG bytes by the name of the drawing, in the order of the report.
    """
    captions = {drawing.name: drawing.caption for drawing in content.drawings}
    return (
        page_environment()
        .get_template("report.html.j2")
        .render(
            css=resource("report.css"),
            content=content,
            provenance=(
                ("Command", provenance.command),
                ("Date", provenance.date),
                ("Program", f"bfi {provenance.version}, numpy {provenance.numpy}, scipy {provenance.scipy}"),
                ("Seed", str(provenance.seed)),
                ("Log, sha256", provenance.log_sha256 or "not known"),
                ("Configuration, sha256", provenance.config_sha256 or "none"),
                ("Dictionary, sha256", provenance.dictionary_sha256 or "none"),
            ),
            figures=[(name, base64.b64encode(svg).decode("ascii"), captions[name]) for name, svg in figures.items()],
        )
    )


@cache
def page_environment() -> Environment:
    """Return the environment of this package's templates, in which all text is escaped and made printable."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        autoescape=True,
        finalize=_show,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(resource),
    )
    environment.filters["unbroken"] = _unbroken
    return environment


def _show(value: object) -> object:
    """Make text of a template printable; what is HTML already stays."""
    return printable(value) if isinstance(value, str) and not hasattr(value, "__html__") else value


def _unbroken(text: str) -> Markup:
    """Keep a short text on one line; let a long name break after its underscores."""
    from markupsafe import Markup, escape

    text = printable(text)
    if len(text) <= ONE_LINE_LETTERS:
        return escape(text.replace(" ", "\u00a0"))
    return Markup("_<wbr>").join(escape(part) for part in text.split("_"))


def resource(name: str) -> str:
    """Return the text of a file beside this module."""
    return resources.files(__package__).joinpath(name).read_text("utf-8")
