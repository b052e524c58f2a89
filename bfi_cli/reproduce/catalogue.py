"""Every reproduction by its name, and the JSON document from which its report is drawn again without its data."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from ..errors import ConfigError
from ..faults import did_you_mean, shown
from ..provenance import Provenance
from ..report.content import ReportContent, Table
from ..serialization import from_plain, mapping, member, to_plain
from .record import Settings

REPRODUCE_SCHEMA = 1


class Entry(NamedTuple):
    """A reproduction: what it shows, and the function of a module of this package that makes it.

    Names that share a computation share the function; its content then shows all of their figures.
    """

    title: str
    module: str
    function: str


REPRODUCTIONS = {
    "fir": Entry("Thesis, chapter 3: blind identification of an FIR system", "fir", "fir"),
    "thesis-5-1": Entry("Thesis, figure 5-1: elevator and airspeed", "thesis_data", "thesis_5_1"),
    "thesis-5-2": Entry("Thesis, figure 5-2: the fault dictionary", "thesis_data", "thesis_5_2"),
    "thesis-5-3": Entry("Thesis, figure 5-3: magnitude error, 1 to 7 faults", "sweeps", "thesis_monte_carlo"),
    "thesis-5-4": Entry("Thesis, figure 5-4: isolation, 1 to 7 faults", "sweeps", "thesis_monte_carlo"),
    "thesis-5-5": Entry("Thesis, figure 5-5: a fast sinusoid, beside DMAE", "thesis_cases", "thesis_5_5"),
    "thesis-5-6": Entry("Thesis, figure 5-6: a slow sinusoid, beside DMAE", "thesis_cases", "thesis_5_6"),
    "thesis-5-7": Entry("Thesis, figure 5-7: a bias with a perturbation", "thesis_cases", "thesis_5_7"),
    "thesis-5-8": Entry("Thesis, figure 5-8: the perturbation grows", "thesis_cases", "thesis_5_8"),
    "thesis-5-9": Entry("Thesis, figure 5-9: the order grows", "thesis_cases", "thesis_5_9"),
    "thesis-5-10": Entry("Thesis, figure 5-10: the perturbed bias at order 45", "thesis_cases", "thesis_5_10"),
    "thesis-5-11": Entry("Thesis, figure 5-11: a sinusoid shifted in time", "thesis_cases", "thesis_5_11"),
    "thesis-5-12": Entry("Thesis, figure 5-12: a drift shifted in time", "thesis_cases", "thesis_5_12"),
    "thesis-5-13": Entry("Thesis, figure 5-13: a bias of unknown start", "thesis_onset", "thesis_5_13"),
    "thesis-5-14": Entry("Thesis, figure 5-14: the start of a bias", "thesis_onset", "thesis_5_14"),
    "thesis-5-15": Entry("Thesis, figure 5-15: the start of a drift", "thesis_onset", "thesis_5_15"),
    "thesis-5-16": Entry("Thesis, figure 5-16: the wrong shape", "thesis_onset", "thesis_5_16"),
    "thesis-A-1": Entry("Thesis, figure A-1: magnitude error without sparsity stage", "sweeps", "thesis_a"),
    "thesis-A-2": Entry("Thesis, figure A-2: magnitude error with sparsity stage", "sweeps", "thesis_a"),
    "thesis-A-3": Entry("Thesis, figure A-3: isolation without sparsity stage", "sweeps", "thesis_a"),
    "thesis-A-4": Entry("Thesis, figure A-4: isolation with sparsity stage", "sweeps", "thesis_a"),
    "isolation-noise": Entry("Isolation against noise, the thesis's rule and ours", "sweeps", "isolation_noise"),
    "sparsity": Entry("Does sparsity help? Rules that choose the faults", "sparsity", "sparsity"),
    "thesis-table-2-1": Entry("Thesis, table 2-1: pitot faults as signals", "thesis_data", "thesis_table_2_1"),
    "thesis-table-5-1": Entry("Thesis, table 5-1: flight data", "thesis_data", "thesis_5_1"),
    "thesis-table-5-2": Entry("Thesis, table 5-2: the fault dictionary", "thesis_data", "thesis_5_2"),
    "f16-table1": Entry("F-16 diagnosability, table I: initial state", "f16_table2", "f16_table2"),
    "f16-table2": Entry("F-16 diagnosability, table II", "f16_table2", "f16_table2"),
    "f16-1": Entry("F-16 diagnosability, figure 1: residuals", "f16_table2", "f16_table2"),
    "f16-2": Entry("F-16 diagnosability, figure 2: bandwidths", "f16_table2", "f16_table2"),
    "f16-3": Entry("F-16 diagnosability, figure 3: densities", "f16_table2", "f16_table2"),
    "hankel-b747": Entry("Hankel null space, Boeing 747, figure 1", "hankel_b747", "hankel_b747"),
}


# Figures and tables of the papers that have no page, and why.
ABSENT = {
    "thesis-2-1": "a drawing of a pitot tube with nothing to compute",
    "thesis-2-2": "a block diagram of DMAE with nothing to compute",
    "thesis-table-B-1": "a list of the thesis's MATLAB files",
}


def find(name: str) -> str:
    """Return the name as it is listed, whatever its case.

    Raises
    ------
    ConfigError : there is none, or the paper's figure is none that can be computed.
    """
    known = {one.lower(): one for one in (*REPRODUCTIONS, *ABSENT)}
    if name.lower() not in known:
        raise ConfigError(
            f"reproduce: no such figure, got '{name}'{did_you_mean(name, (*REPRODUCTIONS, 'all', 'list'))}"
        )
    name = known[name.lower()]
    if name in ABSENT:
        raise ConfigError(f"reproduce: {name} has no page, it is {ABSENT[name]}; give one of bfi reproduce list")
    return name


def run(name: str, settings: Settings) -> ReportContent:
    """Make a reproduction.

    Raises
    ------
    ConfigError : there is none of that name.
    LogError, DictionaryError : the log of the settings cannot be used for it.
    """
    entry = REPRODUCTIONS[find(name)]
    module = importlib.import_module(f"{__package__}.{entry.module}")
    make: Callable[[Settings], ReportContent] = getattr(module, entry.function)
    return make(settings)


def reproduce_document(name: str, content: ReportContent, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi reproduce NAME --json`.

    Parameters
    ----------
    name : of the reproduction, "all" or "list".
    """
    body = to_plain(content)
    body["kicker"] = body.pop("category")  # as schema 1 calls it
    del body["data"]
    return {
        "kind": "reproduce",
        "schema": REPRODUCE_SCHEMA,
        "name": name,
        "exhibit": body,
        "notes": list(content.notes),
        "provenance": to_plain(provenance),
    }


def reproduce_content(document: Mapping[str, Any], *, where: str = "reproduce") -> ReportContent:
    """Return the content of a document, the inverse of `reproduce_document`.

    Raises
    ------
    ConfigError : a key is missing, or a value is of another kind.
    """
    body = mapping(member(document, "exhibit", where=where), where=f"{where}: exhibit")
    whole = {**body, "category": member(document, "exhibit.kicker", where=where), "data": {}}
    content = from_plain(ReportContent, whole, where=f"{where}: exhibit")
    for name in [one.name for one in content.drawings] + [one.name for one in content.tables]:
        if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
            raise ConfigError(f"{where}: exhibit: {shown(name)} is no name of a file; run the command again")
    return content


def summary_content(made: Sequence[tuple[str, ReportContent | Exception]]) -> ReportContent:
    """Return the summary of several reproductions, each by its name; an error stands for one that could not be made."""
    failed = [name for name, one in made if isinstance(one, Exception)]
    rows = tuple(
        (name, REPRODUCTIONS[name].title, "not made", str(one))
        if isinstance(one, Exception)
        else (name, REPRODUCTIONS[name].title, one.heading, one.verdict)
        for name, one in made
    )
    several = f"{len(made) - len(failed)} of {len(made)} figures and tables"
    return ReportContent(
        category="Reproductions",
        title="Published figures and tables, ours beside theirs",
        heading=f"{len(made) - len(failed)} made",
        verdict=f"Made {several}" + (f"; not {', '.join(failed)}." if failed else "."),
        tables=(Table(name="summary", title="Summary", heads=("name", "what", "outcome", "in a sentence"), rows=rows),),
    )


def list_content() -> ReportContent:
    """Return the names there are."""
    rows = tuple((name, entry.title) for name, entry in REPRODUCTIONS.items())
    return ReportContent(
        category="Reproductions",
        title="Published figures and tables, ours beside theirs",
        heading=f"{len(rows)} figures and tables",
        verdict="bfi reproduce NAME makes one of these, bfi reproduce all every one.",
        tables=(
            Table(name="reproductions", title="Names", heads=("name", "what"), rows=rows),
            Table(
                name="absent", title="Without a page", heads=("figure or table", "it is"), rows=tuple(ABSENT.items())
            ),
        ),
    )
