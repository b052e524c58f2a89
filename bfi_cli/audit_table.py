"""An audit as texts: tables on a terminal of 80 columns, CSV files, and the JSON document."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .audit import Audit, AuditedAtom
from .audit.comparison import pairs
from .faults import Fault, fault_to_dict
from .plain import to_plain
from .printable import printable, shortened
from .provenance import Provenance
from .serialize import to_csv
from .shapes import SHAPES
from .wording import number, quantity

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = ["AUDIT_SCHEMA", "audit_document", "audit_tables", "print_audit"]

AUDIT_SCHEMA = 1
MODEL_KEYS = ("inputs", "outputs", "order", "feedthrough", "noise_sd")
MATRIX_ATOMS = 12
MOST_ROWS = 40
MOST_NOTES = 8
MOST_PAIRS = 5
NAME_LETTERS, CHANNEL_LETTERS, MATRIX_LETTERS = 30, 10, 14
KEY_WORDS = {
    "slope": "slope {:g}",
    "frequency_hz": "{:g} Hz",
    "phase_rad": "phase {:.3g} rad",
    "time_constant_s": "time constant {:g} s",
    "duration_s": "duration {:g} s",
}
ATOM_COLUMNS = (
    *("name", "shape", "channel", "onset_s", "offset_s", "live", "minimal_detectable", "unit"),
    *("minimal_physical", "physical_unit", "minimal_peak", "channel_unit", "visible"),
    *("most_coherent_with", "coherence", "note"),
)


def audit_document(audit: Audit, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi dictionary --json`; what is not known or not finite is None."""
    signatures = audit.signatures
    window = {key: getattr(audit, key) for key in ("rate_hz", "n_samples", "start_s", "stop_s")}
    document = {
        "kind": "dictionary",
        "schema": AUDIT_SCHEMA,
        "path": audit.path,
        "relative_to": audit.relative_to,
        "log": None if audit.log_path is None else {"path": audit.log_path, "native_rate_hz": audit.native_rate_hz},
        "window": {**window, "why": audit.why},
        "model": None if audit.model is None else {key: getattr(audit.model, key) for key in MODEL_KEYS},
        "fastest_hz": audit.fastest_hz,
        "rate_needed_hz": audit.rate_needed_hz,
        "atoms": [_atom_entry(atom) for atom in audit.atoms],
        "rank": None if signatures is None else signatures.rank,
        "condition_number": None if signatures is None else signatures.condition_number,
        "coherence": None
        if signatures is None
        else {"atoms": signatures.names, "of": _compared_what(audit), "matrix": signatures.coherence},
        "notes": audit.all_notes,
        "provenance": provenance,
    }
    plain: dict[str, Any] = to_plain(document)
    return plain


def _atom_entry(atom: AuditedAtom) -> dict[str, Any]:
    value, unit = atom.minimal_physical or (None, None)
    return {
        **fault_to_dict(atom.fault),
        "name": atom.name,
        "live": atom.live,
        "note": atom.note,
        "minimal_detectable": atom.minimal_detectable,
        "unit": atom.unit,
        "minimal_physical": None if value is None else {"value": value, "unit": unit},
        "minimal_peak": atom.minimal_peak,
        "channel_unit": atom.channel_unit,
        "visible": atom.visible,
        "most_coherent_with": atom.most_coherent_with,
        "coherence": atom.coherence,
    }


def _compared_what(audit: Audit) -> str:
    return "raw signals" if audit.model is None else "filtered signatures"


def audit_tables(audit: Audit) -> dict[str, bytes]:
    """Return the CSV file of each table by its file name; coherence.csv only where the signals were compared."""
    entries = [_atom_entry(atom) for atom in audit.atoms]
    for entry in entries:
        physical = entry["minimal_physical"] or {"value": None, "unit": None}
        entry |= {"minimal_physical": physical["value"], "physical_unit": physical["unit"]}
    tables = {"atoms.csv": to_csv(ATOM_COLUMNS, ([entry[column] for column in ATOM_COLUMNS] for entry in entries))}
    if audit.signatures is not None:
        names, matrix = audit.signatures.names, to_plain(audit.signatures.coherence)
        rows = ([name, *row] for name, row in zip(names, matrix, strict=True))
        tables["coherence.csv"] = to_csv(("name", *names), rows)
    return tables


def print_audit(console: Console, audit: Audit) -> None:
    """Print the facts, the entries, the coherence and the notes to `console`, at most as wide as it is."""
    from rich.table import Table
    from rich.text import Text

    live = len(audit.live)
    headline = f"{len(audit.atoms)} faults, {live} of them can be looked for"
    console.print(Text(headline, style="bold green" if live == len(audit.atoms) else "bold yellow"))
    grid = Table.grid(padding=(0, 2))
    for name, value in _facts(audit):
        grid.add_row(Text(name, style="dim"), Text(printable(value), overflow="fold"))
    console.print(grid)
    console.print(_atoms_table(audit))
    if len(audit.atoms) > MOST_ROWS:
        console.print(f"   and {len(audit.atoms) - MOST_ROWS} more; all are in --json and --out", highlight=False)
    if audit.signatures is not None and len(audit.signatures.names) > 1:
        console.print(_coherence_table(audit))
    noted = [atom.note for atom in audit.atoms if atom.note is not None]
    cut = (
        [f"{len(noted) - MOST_NOTES} more faults have a note; all are in --json and --out"]
        if noted[MOST_NOTES:]
        else []
    )
    for note in (*noted[:MOST_NOTES], *cut, *audit.notes):
        console.print(Text(printable(f"note: {note}")))


def _facts(audit: Audit) -> list[tuple[str, str]]:
    span = f"{audit.start_s:.4g} to {audit.stop_s:.4g} s"
    facts = [("Dictionary", f"{audit.path}, times from the start of the {audit.relative_to}")]
    if audit.model is None:
        facts.append(("Window", f"{span}, {audit.why}"))
    else:
        noise = ", ".join(f"{name} {number(sd, digits=2)}" for name, sd in audit.model.noise_sd.items())
        facts.append(("Log", f"{audit.log_path}, {span}, recorded at {number(audit.native_rate_hz)} Hz"))
        facts.append(("Rate", f"{number(audit.rate_hz)} Hz: {audit.why}"))
        facts.append(("Model", f"VARX of order {audit.model.order} without fault, prediction error SD {noise}"))
    if audit.fastest_hz is not None:
        facts.append(("Fastest", f"{audit.fastest_hz:g} Hz, which needs a rate of {audit.rate_needed_hz:g} Hz or more"))
    if audit.signatures is not None:
        condition = number(audit.signatures.condition_number, digits=3).replace("-", "infinite")
        facts.append(("Independent", f"{audit.signatures.rank} {_compared_what(audit)}, condition number {condition}"))
    return facts


def _atoms_table(audit: Audit) -> Table:
    channels = len({atom.fault.channel for atom in audit.atoms}) > 1
    heads = ["", "name", *(["channel"] if channels else []), "time [s]"]
    heads += ["shape" if audit.model is None else "min. detectable", "most like"]
    place = {atom.name: j for j, atom in enumerate(audit.atoms, 1)}
    body = []
    for j, atom in enumerate(audit.atoms[:MOST_ROWS], 1):
        until = "" if atom.fault.offset_s is None else f" to {atom.fault.offset_s:.6g}"
        row = [str(j), shortened(atom.name, NAME_LETTERS), f"{atom.fault.onset_s:.6g}{until}"]
        row += [_shape(atom.fault) if audit.model is None else _smallest(atom), _likeness(atom, place)]
        body.append([*row[:2], *([shortened(atom.fault.channel, CHANNEL_LETTERS)] if channels else []), *row[2:]])
    return _table("faults", heads, body)


def _smallest(atom: AuditedAtom) -> str:
    if atom.minimal_physical is None:
        return "-" if atom.live else ""
    size, meaning = quantity(atom.minimal_detectable, atom.unit), quantity(*atom.minimal_physical)
    return size if size == meaning else f"{size} ({meaning})"


def _likeness(atom: AuditedAtom, place: Mapping[str, int]) -> str:
    if not atom.live:
        return "left out"
    return "-" if atom.most_coherent_with is None else f"{atom.coherence:.3f} with {place[atom.most_coherent_with]}"


def _shape(fault: Fault) -> str:
    keys = [key.name for key in SHAPES[fault.shape].keys if key.name in KEY_WORDS and getattr(fault, key.name)]
    return ", ".join([fault.shape, *(KEY_WORDS[key].format(getattr(fault, key)) for key in keys)])


def _coherence_table(audit: Audit) -> Table:
    signatures = audit.signatures
    assert signatures is not None
    title = f"coherence of the {_compared_what(audit)}"
    names, n = signatures.names, len(signatures.names)
    if n > MATRIX_ATOMS:
        rows = [[f"{value:.3f}", shortened(a, 30), shortened(b, 30)] for a, b, value in pairs(signatures)[:MOST_PAIRS]]
        return _table(f"highest {title}", ["", "", ""], rows)
    numbers = [str(j) for j, atom in enumerate(audit.atoms, 1) if atom.live]
    body = [
        [numbers[j], shortened(names[j], MATRIX_LETTERS), *(_short(signatures.coherence[j, i]) for i in range(j + 1))]
        for j in range(n)
    ]
    padded = [row + [""] * (n + 2 - len(row)) for row in body]
    return _table(title, ["", "", *numbers], padded, padding=(0, 1, 0, 0))


def _short(value: float) -> str:
    """Two decimals without the zero before them; only what is 1 to round-off reads 1."""
    if value != value:
        return "-"
    return "1" if value > 1.0 - 1e-9 else f"{min(value, 0.99):.2f}".removeprefix("0")


def _table(
    title: str,
    heads: Sequence[str],
    body: Iterable[Sequence[str]],
    *,
    padding: tuple[int, int, int, int] = (0, 1, 0, 1),
) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    look: dict[str, Any] = {"title_justify": "left", "title_style": "bold", "padding": padding}
    table = Table(title=title, box=box.SIMPLE_HEAD, pad_edge=False, **look)
    for head in heads:
        table.add_column(head, overflow="fold", no_wrap=head != "shape")
    for row in body:
        table.add_row(*(Text(printable(cell)) for cell in row))
    return table
