"""A page with one long table that the reader sorts and filters: one file, nothing fetched."""

from __future__ import annotations

from dataclasses import dataclass

from ..provenance import Provenance
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
    tones : of each row, by which its third column is coloured, "" for none.
    """

    title: str
    facts: tuple[tuple[str, str], ...]
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    links: tuple[str, ...]
    tones: tuple[str, ...]


def render_listing(listing: Listing, provenance: Provenance) -> str:
    """Return the page as one HTML text without any reference that is not among its links."""
    template = page_environment().get_template("listing.html.j2")
    return template.render(
        css=resource("report.css"),
        listing=listing,
        rows=list(zip(listing.rows, listing.links, listing.tones, strict=True)),
        provenance=provenance,
    )
