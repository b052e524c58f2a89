"""`bfi report`: the files of a stored result, drawn again."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..documents import identify_from_document
from ..errors import ConfigError
from ..plain import from_plain, member
from ..provenance import Provenance
from .options import tell

if TYPE_CHECKING:
    from ..exhibit import Exhibit

__all__ = ["command"]

GIVE = "give the result.json of a command's --out"
# The kinds that are laid out from their document: module and function that do it, and the schema they know.
EXHIBITS = {
    "detect": ("detect", "detect_exhibit", 1),
    "diagnosability": ("diagnosability", "diagnosability_exhibit", 1),
    "reproduce": ("reproduce.document", "reproduce_exhibit", 1),
    "start-time": ("onset", "onset_exhibit", 1),
}


@click.command("report")
@click.argument("result", metavar="RESULT.json", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder of the files  [default: the folder of RESULT.json]"
)
@click.option("--json", "as_json", is_flag=True, help="Print the document itself, also where stdout is a terminal.")
def command(result: Path, out: Path | None, as_json: bool) -> None:
    """Draw the report, the figures and the tables of a stored RESULT.json ("-" reads stdin)."""
    document = _read(result)
    directory = out if out is not None else result.parent
    if isinstance(document, Mapping) and document.get("kind") in EXHIBITS:
        _draw_exhibit(document, str(result), directory, as_json=as_json)
        return
    from ..output import write_results

    found, provenance = identify_from_document(document, where=str(result))
    write_results(found, provenance, directory)
    tell(f"wrote {directory / 'report.html'}")
    if _as_json(as_json):
        _print(document)
        return
    from rich.console import Console

    from ..tables import print_identify

    print_identify(Console(), found)


def _draw_exhibit(document: Mapping[str, Any], where: str, directory: Path, *, as_json: bool) -> None:
    from ..output import exhibit_files, replace_files

    package, function, schema = EXHIBITS[document["kind"]]
    if document.get("schema") != schema:
        raise ConfigError(
            f"{where}: schema is {document.get('schema')}, this program reads {schema}; run the command again"
        )
    origin = from_plain(Provenance, member(document, "provenance", where=where), where=f"{where}: provenance")
    module = importlib.import_module(f"...{package}", __name__)
    exhibit = _laid_out(getattr(module, function), document, where)
    replace_files(exhibit_files(exhibit, document, origin), directory)
    tell(f"wrote {directory / 'report.html'}")
    if _as_json(as_json):
        _print(document)
        return
    from rich.console import Console

    from ..tables import print_exhibit

    print_exhibit(Console(highlight=False), exhibit)


def _laid_out(lay_out: Callable[[Mapping[str, Any]], Exhibit], document: Mapping[str, Any], where: str) -> Exhibit:
    try:
        return lay_out(document)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise ConfigError(f"{where}: damaged, {error!r}; run bfi {document['kind']} again") from None


def _read(path: Path) -> Any:
    try:
        text = sys.stdin.read() if str(path) == "-" else path.read_text("utf-8")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ConfigError(f"{path}: {reason}; {GIVE}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file; {GIVE}") from None
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: not JSON ({error}); {GIVE}") from None


def _as_json(asked: bool) -> bool:
    return asked or not sys.stdout.isatty()


def _print(document: Mapping[str, Any]) -> None:
    from ..serialize import to_json

    click.echo(to_json(document))
