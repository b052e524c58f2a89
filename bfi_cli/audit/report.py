"""The JSON document and the report of `bfi dictionary`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..faults import fault_to_dict
from ..faults.shapes import SHAPES
from ..kernels import FloatArray
from ..model.preprocessing.signals import SAMPLES_PER_CYCLE
from ..notes import Note
from ..printable import shortened
from ..quantities.text import SI, Units, change, instant, noise_levels, number, with_unit
from ..report.content import Drawing, HeatMap, Panel, ReportContent, Table, curve, notes_of, thinned
from ..serialization import Provenance, document_of, to_plain
from .comparison import pairs
from .entries import Audit

Plain = Mapping[str, Any]

DRAWINGS, TABLES = ("signatures", "coherence", "limits"), ("atoms", "coherence")
MODEL_KEYS = ("inputs", "outputs", "order", "feedthrough", "noise_sd")
# Signatures on a page, and points of each: twice the pixels across a page.
MAX_SIGNATURES, MAX_POINTS = 24, 1000
# Atoms whose coherence is shown as a matrix on a terminal of 80 columns, and as a map on a page; pairs that are listed
# in place of a larger matrix, and notes on atoms.
MATRIX_ATOMS, MAP_ATOMS, MOST_PAIRS, MOST_NOTES = 9, 200, 5, 8
NAME_LETTERS, CHANNEL_LETTERS, MATRIX_LETTERS = 30, 10, 14
# Keys of a shape and their words in a table.
KEY_WORDS = {
    "slope": "slope {:g}/s",
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
ATOM_KEYS = ("name", "live", "note", "minimal_detectable", "unit", "minimal_physical")
MORE_KEYS = ("minimal_peak", "channel_unit", "visible", "most_coherent_with", "coherence")
COHERENCE_CAPTION = (
    "Coherence of every pair of faults, the cosine of the angle between their signatures: 0 fully told apart, 1 not at "
    "all."
)
LIMITS_CAPTION = (
    "Minimal detectable magnitude (90 % power), as the largest error on its output in standard deviations of the "
    "prediction error; to the right in its own unit."
)


def audit_document(audit: Audit, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi dictionary --json`; what is not known or not finite is None.

    `series` holds what is drawn of the first signatures.
    """
    signatures, series = audit.signatures, None
    if signatures is not None:
        drawn = zip(signatures.names[:MAX_SIGNATURES], signatures.values.T, strict=False)
        kept = [(name, values, thinned(values, max_points=MAX_POINTS)) for name, values in drawn]
        series = [{"name": name, "time_s": signatures.time_s[at], "values": values[at]} for name, values, at in kept]
    log = {key: getattr(audit.window, key) for key in ("path", "native_rate_hz")}
    window = {key: getattr(audit.window, key) for key in ("rate_hz", "n_samples", "start_s", "stop_s")}
    atoms = []
    for atom in audit.atoms:
        entry = {**fault_to_dict(atom.fault), **{key: getattr(atom, key) for key in (*ATOM_KEYS, *MORE_KEYS)}}
        if atom.fault.onset_range_s is not None:
            entry["onset_range_s"] = atom.fault.onset_range_s
        if atom.minimal_physical is not None:
            entry["minimal_physical"] = dict(zip(("value", "unit"), atom.minimal_physical, strict=True))
        atoms.append(entry)
    body = to_plain(
        {
            "path": audit.path,
            "relative_to": audit.relative_to,
            "log": None if audit.model is None else log,
            "window": {**window, "why": audit.why},
            "model": None if audit.model is None else {key: getattr(audit.model, key) for key in MODEL_KEYS},
            "fastest_hz": audit.fastest_hz,
            "rate_needed_hz": None if audit.fastest_hz is None else SAMPLES_PER_CYCLE * audit.fastest_hz,
            "atoms": atoms,
            "rank": None if signatures is None else signatures.among.rank,
            "condition_number": None if signatures is None else signatures.among.condition_number,
            "coherence": None
            if signatures is None
            else {
                "atoms": signatures.names,
                "of": "raw signals" if audit.model is None else "filtered signatures",
                "matrix": signatures.coherence,
            },
            "series": series,
        }
    )
    return document_of("dictionary", body, audit.all_notes, provenance)


def audit_content(document: Plain, units: Units = SI) -> ReportContent:
    """Return the report of a document of `bfi dictionary`, in `units`; its CSV files are in SI."""
    atoms, coherence = document["atoms"], document["coherence"]
    live = [atom for atom in atoms if atom["live"]]
    tables, drawings = [_list_atoms(document, units)], []
    sizes = [atom["minimal_physical"] or {"value": None, "unit": None} for atom in atoms]
    flat = [
        {**atom, "minimal_physical": size["value"], "physical_unit": size["unit"]}
        for atom, size in zip(atoms, sizes, strict=True)
    ]
    data = {"atoms.csv": {column: [atom[column] for atom in flat] for column in ATOM_COLUMNS}}
    if coherence is not None:
        names, matrix = coherence["atoms"], np.array(coherence["matrix"], dtype=np.float64)
        columns = zip(names, coherence["matrix"], strict=True)  # the matrix is symmetric
        data["coherence.csv"] = {"name": list(names), **dict(columns)}
        if len(names) > 1:
            tables.append(_list_coherence(document, names, matrix))
        drawings = [_draw_signatures(document), _draw_coherence(document, names, matrix)]
    if document["model"] is not None:
        drawings.append(_draw_limits(document, live[:MAX_SIGNATURES], units))
    noted = [atom["note"] for atom in atoms if atom["note"] is not None]
    notes, n_atom_notes = notes_of(document, units), len(set(noted))
    more = Note.method(f"{n_atom_notes - MOST_NOTES} more faults have a note; all are in --json and --out")
    return ReportContent(
        category="Audit of a fault dictionary",
        title=str(document["path"]),
        heading="What can be looked for",
        verdict=f"{len(atoms)} faults, {len(live)} of them can be looked for",
        facts=_facts(document, units),
        tables=tuple(tables),
        drawings=tuple(drawings),
        notes=(
            *notes[:n_atom_notes][:MOST_NOTES],
            *([more] if n_atom_notes > MOST_NOTES else []),
            *notes[n_atom_notes:],
        ),
        data=data,
    )


def _facts(document: Plain, units: Units) -> tuple[tuple[str, str], ...]:
    window, model, log = document["window"], document["model"], document["log"]
    span = f"{instant(window['start_s'])} to {instant(window['stop_s'])} s"
    facts = [("Dictionary", f"{document['path']}, times from the start of the {document['relative_to']}")]
    if model is None:
        facts.append(("Window", f"{span}, {window['why']}" if window["n_samples"] else window["why"]))
    else:
        channel_units = {atom["channel"]: atom["channel_unit"] for atom in document["atoms"]}
        noise = noise_levels(model["noise_sd"], units, channel_units)
        facts.append(("Log", f"{log['path']}, {span}, recorded at {number(log['native_rate_hz'])} Hz"))
        facts.append(("Rate", f"{number(window['rate_hz'])} Hz: {window['why']}"))
        facts.append(("Model", f"VARX of order {model['order']} without fault, prediction error SD {noise}"))
    if document["fastest_hz"] is not None:
        needed = f"which needs a rate of {document['rate_needed_hz']:g} Hz or more"
        facts.append(("Fastest", f"{document['fastest_hz']:g} Hz, {needed}"))
    if document["coherence"] is not None:
        condition = document["condition_number"]
        condition_text = "infinite" if condition is None else number(condition, digits=3)
        facts.append(
            ("Independent", f"{document['rank']} {document['coherence']['of']}, condition number {condition_text}")
        )
    return tuple(facts)


def _list_atoms(document: Plain, units: Units) -> Table:
    atoms, on_log = document["atoms"], document["model"] is not None
    channels = len({atom["channel"] for atom in atoms}) > 1
    place = {atom["name"]: j for j, atom in enumerate(atoms, 1)}
    rows = []
    for j, atom in enumerate(atoms, 1):
        row = [str(j), shortened(atom["name"], NAME_LETTERS), _times(atom)]
        if channels:
            row.append(shortened(atom["channel"] or "-", CHANNEL_LETTERS))
        if on_log:
            row.append("" if not atom["live"] else _limit(atom, units) or "-")
        else:
            keys = (key.name for key in SHAPES[atom["shape"]].keys if key.name in KEY_WORDS and atom.get(key.name))
            row.append(", ".join([atom["shape"], *(KEY_WORDS[key].format(atom[key]) for key in keys)]))
        other = atom["most_coherent_with"]
        alike = "-" if other is None else f"{atom['coherence']:.3f} with {place[other]}"
        rows.append((*row, alike if atom["live"] else "left out"))
    heads = ("", "name", "time [s]", *(["channel"] if channels else []), "min. detectable" if on_log else "shape")
    return Table(name="atoms", title="Faults", heads=(*heads, "most like"), rows=tuple(rows))


def _times(atom: Plain) -> str:
    """Return onset and end of a fault, "12 to 20"; of a kind of fault the onsets it may have, "from 5", "any"."""
    if atom["onset_s"] is not None:
        return f"{atom['onset_s']:.6g}" + ("" if atom["offset_s"] is None else f" to {atom['offset_s']:.6g}")
    first, last = atom["onset_range_s"]
    if first is None and last is None:
        return "any"
    if first is None or last is None:
        return f"until {instant(last)}" if first is None else f"from {instant(first)}"
    return f"any in {instant(first)} to {instant(last)}"


def _limit(atom: Plain, units: Units) -> str | None:
    """Return the minimal detectable magnitude, with its meaning if it multiplies a slope; None if not known."""
    if atom["minimal_physical"] is None:
        return None
    value, unit = atom["minimal_physical"]["value"], atom["minimal_physical"]["unit"]
    meaning = change(value, units.of(unit, channel=atom["channel"], channel_unit=atom["channel_unit"]))
    if value == atom["minimal_detectable"]:
        return meaning
    shown = units.of(atom["unit"], channel=atom["channel"], channel_unit=atom["channel_unit"])
    multiplier = number(shown.change(atom["minimal_detectable"]), digits=2)
    return f"{with_unit(multiplier, shown.unit or 'x slope')} ({meaning})"


def _list_coherence(document: Plain, names: Sequence[str], matrix: FloatArray) -> Table:
    title = f"oherence of the {document['coherence']['of']}"
    if len(names) > MATRIX_ATOMS:
        rows: tuple[tuple[str, ...], ...] = tuple(
            (f"{value:.3f}", shortened(a, 30), shortened(b, 30)) for a, b, value in pairs(names, matrix)[:MOST_PAIRS]
        )
        return Table(name="coherence", title=f"Highest c{title}", heads=("coherence", "of", "and"), rows=rows)
    place = {atom["name"]: str(j) for j, atom in enumerate(document["atoms"], 1)}
    numbers = [place[name] for name in names]
    rows = tuple(
        (
            numbers[j],
            shortened(names[j], MATRIX_LETTERS),
            *(_two_decimals(matrix[j, i]) if i <= j else "" for i in range(len(names))),
        )
        for j in range(len(names))
    )
    return Table(name="coherence", title=f"C{title}", heads=("", "", *numbers), rows=rows)


def _two_decimals(value: float) -> str:
    """Return two decimals without the zero before them; only a value of 1 within round-off reads 1."""
    if value != value:
        return "-"
    return "1" if value > 1.0 - 1e-9 else f"{min(value, 0.99):.2f}".removeprefix("0")


def _draw_signatures(document: Plain) -> Drawing:
    """Draw the signals of the first atoms below each other, each to its own scale, as one curve with gaps."""
    series, n = document["series"], len(document["coherence"]["atoms"])
    x: list[FloatArray] = []
    y: list[FloatArray] = []
    for row, atom in enumerate(series):
        values = np.array(atom["values"], dtype=np.float64)
        peak = float(np.max(np.abs(values), initial=0.0)) or 1.0
        x += [np.array(atom["time_s"], dtype=np.float64), np.array([np.nan])]
        y += [row - 0.45 * values / peak, np.array([np.nan])]
    on_log = document["model"] is not None
    what = "Filtered signatures, off the model's regressors," if on_log else "Raw signals"
    panel = Panel(
        title=f"first {len(series)} of {n}" if len(series) < n else "",
        x_label="time [s]",
        y_label="dictionary entry",
        curves=(curve("", np.concatenate(x), np.concatenate(y)),),
        x_limits=(document["window"]["start_s"], document["window"]["stop_s"]),
        y_limits=(len(series) - 0.4, -0.6),
        y_ticks=_rows([atom["name"] for atom in series]),
        height=_height(len(series)),
    )
    caption = f"{what} of the faults that can be looked for, each to its own scale."
    return Drawing(name="signatures", caption=caption, panels=(panel,))


def _rows(names: Sequence[str]) -> tuple[tuple[str, float], ...]:
    return tuple((name, float(row)) for row, name in enumerate(names))


def _height(rows: int) -> float:
    """Return the height of a panel with so many rows of names."""
    return 0.25 + 0.11 * max(rows, 4)


def _draw_coherence(document: Plain, names: Sequence[str], matrix: FloatArray) -> Drawing:
    n = min(len(names), MAP_ATOMS)
    title = f"Coherence of the {document['coherence']['of']}"
    heat_map = HeatMap(
        title=f"{title}, first {n} of {len(names)}" if n < len(names) else title,
        rows=tuple(names[:n]),
        columns=tuple(names[:n]),
        values=tuple(matrix[:n, :n]),
        label="coherence [-]",
    )
    return Drawing(name="coherence", caption=COHERENCE_CAPTION, heat_maps=(heat_map,))


def _draw_limits(document: Plain, atoms: Sequence[Plain], units: Units) -> Drawing:
    noise = document["model"]["noise_sd"]
    sizes = []
    for atom in atoms:
        sd = noise.get(atom["channel"]) or 0.0
        sizes.append(atom["minimal_peak"] / sd if atom["minimal_peak"] and sd > 0.0 else math.nan)
    panel = Panel(
        x_label="largest excursion / prediction error SD [-]",
        y_label="dictionary entry",
        curves=(curve("", sizes, np.arange(len(sizes), dtype=np.float64), style="points"),),
        log_x=True,
        y_limits=(len(atoms) - 0.4, -0.6),
        y_ticks=_rows([atom["name"] for atom in atoms]),
        side_notes=tuple((_limit(atom, units) or "nothing is seen", float(row)) for row, atom in enumerate(atoms)),
        height=_height(len(atoms)),
    )
    return Drawing(name="limits", caption=LIMITS_CAPTION, panels=(panel,))
