"""`bfi report`: the files of a stored document, drawn again."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import ConfigError
from ..quantities.text import IN_FILES, UNITS
from ..report.consistency import contradiction_of
from ..serialization import Provenance, document_of_kind, from_plain, member, read_json
from .options import with_options
from .output import note, show

if TYPE_CHECKING:
    from ..quantities.text import Units
    from ..report.content import ReportContent

GIVE = "give the result.json of a command's --out, or what its --json --series printed"
# Module and function that make the content of each kind of document.
KINDS = {
    "calibration": ("report.calibration", "calibration_content"),
    "compare": ("lab.compare", "compare_content"),
    "convert": ("report.log", "log_content"),
    "detect": ("detection", "detect_content"),
    "diagnosability": ("diagnosability", "diagnosability_content"),
    "diagnose": ("flight", "diagnose_content"),
    "dictionary": ("audit", "audit_content"),
    "identify": ("model.report", "content_of_document"),
    "info": ("report.log", "info_content"),
    "inject": ("report.log", "log_content"),
    "montecarlo": ("lab.montecarlo", "montecarlo_content"),
    "plot": ("report.log_plots", "plot_content"),
    "reproduce": ("lab.reproduce.catalogue", "reproduce_content"),
    "simulate": ("report.log", "log_content"),
    "start-time": ("model.onset", "onset_content"),
}
STORED = {"montecarlo": "summary.json"}
# Documents whose report is made from the document itself. The others are read back into their result, which names the
# place of any damage.
NOT_READ_BACK = ("dictionary",)
# Documents of shares, counts and published numbers, which are shown in one unit.
WITHOUT_UNITS = ("calibration", "montecarlo", "reproduce")


@click.command("report")
@click.argument("result", metavar="RESULT.json", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder of the files  [default: the folder of RESULT.json]"
)
@with_options("units", "force", "as_json", "series")
def command(result: Path, out: Path | None, *, units: str | None, force: bool, as_json: bool, series: bool) -> None:
    """Draw the report, the figures and the tables of a stored RESULT.json ("-" reads stdin), in any units.

    With --json, and without --out, nothing is drawn: the document goes to stdout.
    """
    from ..files import replace_files, same_file
    from ..report.files import content_files

    document, where = read_json(result, give=GIVE), str(result)
    content = _content(document, where, UNITS[units or "si"])
    origin = from_plain(Provenance, member(document, "provenance", where=where), where=f"{where}: provenance")
    if out is not None or not as_json:
        stored, folder = STORED.get(document["kind"], "result.json"), result.parent if out is None else out
        plain = _content(document, where, IN_FILES)
        files = content_files(content, document, origin, plain=plain, stored=stored)
        # In the folder of the result only the report is drawn anew; the result stays as it is.
        beside = same_file(folder / stored, result)
        if beside:
            del files[stored]
        replace_files(files, folder, inputs=[result], force=force or beside)
        note(f"wrote {folder / 'report.html'}")
    show(document, content, as_json=as_json, series=series)


def _content(document: object, where: str, units: Units) -> ReportContent:
    """Return the report of a document.

    Raises
    ------
    ConfigError : the document is damaged, or of an unknown kind or schema.
    """
    document = document_of_kind(document, KINDS, where=where, give=GIVE, wanted=f"known: {', '.join(KINDS)}")
    kind = document["kind"]
    module, function = KINDS[kind]
    member(document, "provenance", where=where)
    make = getattr(importlib.import_module(f"...{module}", __name__), function)
    try:
        shown = () if kind in WITHOUT_UNITS else (units,)
        if kind == "calibration" and document.get("air_data"):
            from ..flight.parity.calibration import air_data_in

            air_data_in(document, where=where)
        content: ReportContent = make(document, *shown, **({} if kind in NOT_READ_BACK else {"where": where}))
        wrong = contradiction_of(document)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise ConfigError(f"{where}: damaged, {error!r}; run bfi {kind} again") from None
    if wrong is not None:
        raise ConfigError(f"{where}: contradicts itself, {wrong}; run bfi {kind} again")
    return content
