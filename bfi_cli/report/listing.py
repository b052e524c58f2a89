"""A page with one long table that the reader sorts and filters: one file, nothing fetched."""

from __future__ import annotations

import base64
from dataclasses import dataclass

from ..serialization import Provenance
from .content import Drawing
from .html import page_environment, resource


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """A page with one table.

    Attributes
    ----------
    facts : (name, value) above the table.
    heads : one text per column.
    rows : texts, as many per row as there are heads.
    links : address behind the first cell of each row, "" for none.
    tones : of each row, by which it is marked, "" for none.
    drawing : above the table, None for none.
    """

    title: str
    facts: tuple[tuple[str, str], ...]
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    links: tuple[str, ...]
    tones: tuple[str, ...]
    drawing: Drawing | None = None


def render_listing(listing: Listing, provenance: Provenance) -> str:
    """Return the page as one HTML text without any reference that is not among its links."""
    from .figures import draw
    from .style import to_svg

    figure = "" if listing.drawing is None else base64.b64encode(to_svg(draw(listing.drawing))).decode("ascii")
    template = page_environment().get_template("listing.html.j2")
    return template.render(
        css=resource("report.css"),
        listing=listing,
        rows=list(zip(listing.rows, listing.links, listing.tones, strict=True)),
        figure=figure,
        provenance=provenance,
    )
