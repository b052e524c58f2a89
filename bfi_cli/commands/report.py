"""`bfi report`: the files of a stored result, drawn again."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ..documents import identify_from_document
from ..errors import ConfigError
from ..result import IdentifyResult
from .options import tell

__all__ = ["command"]


@click.command("report")
@click.argument("result", metavar="RESULT.json", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder of the files  [default: the folder of RESULT.json]"
)
@click.option("--json", "as_json", is_flag=True, help="Print the document itself, also where stdout is a terminal.")
def command(result: Path, out: Path | None, as_json: bool) -> None:
    """Draw the report, the figures and the tables of a stored RESULT.json ("-" reads stdin)."""
    from ..output import write_results

    document = _read(result)
    found, provenance = identify_from_document(document, where=str(result))
    directory = out if out is not None else result.parent
    write_results(found, provenance, directory)
    tell(f"wrote {directory / 'report.html'}")
    _show(document, found, as_json=as_json)


def _read(path: Path) -> Any:
    try:
        text = sys.stdin.read() if str(path) == "-" else path.read_text("utf-8")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ConfigError(f"{path}: {reason}; give the result.json of bfi identify --out") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file; give the result.json of bfi identify --out") from None
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: not JSON ({error}); give the result.json of bfi identify --out") from None


def _show(document: Mapping[str, Any], found: IdentifyResult, *, as_json: bool) -> None:
    if as_json or not sys.stdout.isatty():
        from ..serialize import to_json

        click.echo(to_json(document))
        return
    from rich.console import Console

    from ..tables import print_identify

    print_identify(Console(), found)
