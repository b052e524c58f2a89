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
from .answered import show
from .options import force_option, series_option, tell

if TYPE_CHECKING:
    from rich.console import Console

    from ..exhibit import Exhibit

__all__ = ["command"]

GIVE = "give the result.json of a command's --out"
# The kinds that are laid out from their document: module and function that do it, and the schema they know.
EXHIBITS = {
    "detect": ("detect", "detect_exhibit", 1),
    "diagnosability": ("diagnosability", "diagnosability_exhibit", 1),
    "reproduce": ("reproduce.catalogue", "reproduce_exhibit", 1),
    "start-time": ("onset", "onset_exhibit", 1),
}


@click.command("report")
@click.argument("result", metavar="RESULT.json", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder of the files  [default: the folder of RESULT.json]"
)
@force_option
@series_option
def command(result: Path, out: Path | None, *, force: bool, as_json: bool, series: bool) -> None:
    """Draw the report, the figures and the tables of a stored RESULT.json ("-" reads stdin)."""
    from ..files import replace_files, same_file

    document = _read(result)
    folder = out if out is not None else result.parent
    is_exhibit = isinstance(document, Mapping) and document.get("kind") in EXHIBITS
    files, draw = (_exhibit if is_exhibit else _identification)(document, str(result))
    # Beside its own result the report is drawn anew; the result itself stays as it is.
    beside = same_file(folder / "result.json", result)
    if beside:
        del files["result.json"]
    replace_files(files, folder, inputs=[result], force=force or beside)
    tell(f"wrote {folder / 'report.html'}")
    show(document, draw, as_json=as_json, series=series)


def _identification(document: Any, where: str) -> tuple[dict[str, bytes], Callable[[Console], None]]:
    from ..output import identify_files
    from ..tables import print_identify

    found, provenance = identify_from_document(document, where=where)
    return identify_files(found, provenance), lambda console: print_identify(console, found)


def _exhibit(document: Mapping[str, Any], where: str) -> tuple[dict[str, bytes], Callable[[Console], None]]:
    from ..output import exhibit_files
    from ..tables import print_exhibit

    package, function, schema = EXHIBITS[document["kind"]]
    if document.get("schema") != schema:
        raise ConfigError(
            f"{where}: schema is {document.get('schema')}, this program reads {schema}; run the command again"
        )
    origin = from_plain(Provenance, member(document, "provenance", where=where), where=f"{where}: provenance")
    module = importlib.import_module(f"...{package}", __name__)
    exhibit = _laid_out(getattr(module, function), document, where)
    return exhibit_files(exhibit, document, origin), lambda console: print_exhibit(console, exhibit)


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
