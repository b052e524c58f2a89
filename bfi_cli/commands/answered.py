"""The answer of a command: files where a folder is given, a table on a terminal, a JSON document otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import tell

if TYPE_CHECKING:
    from ..exhibit import Exhibit
    from ..provenance import Provenance

__all__ = ["give"]


def give(
    exhibit: Exhibit,
    document: Mapping[str, Any],
    *,
    origin: Provenance,
    out: Path | None,
    as_json: bool,
    extra: Mapping[str, bytes] | None = None,
) -> None:
    """Write the files of an answer to `out`, if given, and print the answer.

    Parameters
    ----------
    exhibit, document : the same answer, laid out and as JSON.
    origin : its provenance.
    extra : further files by name; they win over those of the exhibit, as a table in full precision does.
    """
    if out is not None:
        from ..output import exhibit_files, replace_files

        replace_files({**exhibit_files(exhibit, document, origin), **(extra or {})}, out)
        tell(f"wrote {out / 'report.html'}")
    if as_json:
        from ..serialize import to_json

        click.echo(to_json(document))
        return
    from rich.console import Console

    from ..tables import print_exhibit

    print_exhibit(Console(highlight=False), exhibit)
