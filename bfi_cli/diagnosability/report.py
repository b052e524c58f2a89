"""The JSON document and the report of `bfi diagnosability`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..kernels import FloatArray
from ..printable import shortened
from ..quantities.text import SI, Units, instant, noise_levels, number, quantity
from ..report.clock import with_clock
from ..report.content import Drawing, HeatMap, Panel, ReportContent, Table, curve, shown_notes
from ..serialization import Provenance, document_of, from_plain, mapping, member, to_plain
from .assess import DiagnosabilityResult, DiagnosedAtom, ManoeuvreScore

ORDER_KEYS = ("orders", "criterion_no_fault", "criterion_best")
# Letters of a name, rows of a map and curves of a panel on a page; range of bits in which curves are drawn.
NAME_LETTERS, MOST_IN_MAP, MOST_CURVES = 24, 30, 8
SHOWN_BITS = (0.01, 0.99)
MAP_CAPTION = (
    "Jensen-Shannon divergence of the prediction errors, fault against no fault and fault against fault, in bits: 1 "
    "for two that are always told apart, 0 for two that never are."
)
CURVE_CAPTION = (
    "How well the window tells the fault from no fault (1 bit: always), against the root mean square of its magnitude. "
    "Dashed: at the minimal detectable magnitude."
)
MANOEUVRE_CAPTION = (
    "How well each manoeuvre tells each fault from no fault (1 bit: always). First column: how well it tells a fault "
    "from the most similar other one, in the mean over the faults."
)
ATOM_HEADS = (
    *("fault", "magnitude", "divergence, bit", "minimal detectable", "most like", "told apart, bit"),
    *("in one sample, bit", "note"),
)
FAULT_COLUMNS = (
    *("name", "channel", "magnitude", "unit", "physical_scale", "physical_unit", "divergence_bits"),
    *("minimal_detectable", "most_like", "apart_bits", "sample_bits", "note"),
)
MANOEUVRE_HEADS = ("manoeuvre", "told, bit", "standard error", "weakest fault", "its bits", "note")


def diagnosability_document(result: DiagnosabilityResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi diagnosability --json`; what is not known or not finite is None.

    `between` has a row and a column for each of `atoms`; `information` is the curve of bits over deviations.
    """
    body = to_plain(result)
    for key in ORDER_KEYS:
        body["model"].pop(key)
    information = {key: body.pop(key) for key in ("deviations", "bits", "limit_deviations")}
    return document_of("diagnosability", {**body, "information": information}, result.notes, provenance)


def diagnosability_content(document: Mapping[str, Any], units: Units = SI, *, where: str = "result") -> ReportContent:
    """Return the report of a document of `bfi diagnosability`, in `units`; its CSV files are in SI.

    Raises
    ------
    ConfigError : the document, named by `where`, is damaged.
    """
    information = mapping(member(document, "information", where=where), where=f"{where}: information")
    rows_of = member(document, "between", where=where)
    result = from_plain(DiagnosabilityResult, {**document, **information, "between": []}, where=where)
    between = np.array(rows_of, dtype=np.float64).reshape(len(result.atoms), -1)
    stored = sorted(result.atoms, key=_rank)
    result = replace(result, atoms=tuple(_in_units(atom, units) for atom in result.atoms))
    best, atoms, manoeuvres = result.best, result.atoms, result.manoeuvres
    live = [j for j, atom in enumerate(atoms) if atom.divergence_bits is not None]
    names = tuple(_short(atoms[j].name) for j in live)

    ranked = sorted(atoms, key=_rank)
    rows = tuple(
        (
            atom.name,
            quantity(atom.magnitude, atom.unit),
            number(atom.divergence_bits, digits=3),
            quantity(atom.minimal_detectable, atom.unit),
            atom.most_like or "-",
            number(atom.apart_bits, digits=3),
            number(atom.sample_bits, digits=2),
            atom.note or "",
        )
        for atom in ranked
    )
    tables, drawings = [Table(name="faults", title="Faults, easiest to see first", heads=ATOM_HEADS, rows=rows)], []
    if 0 < len(live) <= MOST_IN_MAP:
        bits = ([atoms[j].divergence_bits, *between[j, live]] for j in live)
        heat_map = HeatMap(
            title="Fault against no fault, and against each other fault",
            rows=names,
            columns=("no fault", *names),
            values=tuple(map(_numbers, bits)),
            label="divergence [bit]",
        )
        drawings.append(Drawing(name="divergence", caption=MAP_CAPTION, heat_maps=(heat_map,)))
    if live:
        drawings.append(_curves(result, live))
    if manoeuvres:
        table, drawing = _manoeuvres(manoeuvres, live[:MOST_IN_MAP], names[:MOST_IN_MAP])
        tables.append(table)
        drawings.append(drawing)
    content = ReportContent(
        category="Diagnosability",
        title=result.log.path,
        heading="What could be diagnosed" if best is None else f"Best manoeuvre: {best}",
        verdict=_verdict(result, live),
        facts=_facts(result, units),
        tables=tuple(tables),
        drawings=tuple(drawings),
        notes=shown_notes(result.notes, units),
        data={"faults.csv": {key: [getattr(atom, key) for atom in stored] for key in FAULT_COLUMNS}},
    )
    return with_clock(content, result.log.clock, start_s=result.log.start_s, stop_s=result.log.stop_s)


def _manoeuvres(scores: Sequence[ManoeuvreScore], shown: Sequence[int], names: Sequence[str]) -> tuple[Table, Drawing]:
    """Return the table of the manoeuvres, and the map of their bits over the entries that are shown."""
    rows = tuple(
        (
            score.name,
            number(score.bits, spread=score.standard_error, extra=1),
            number(score.standard_error, digits=1),
            score.weakest or "-",
            number(score.weakest_bits, digits=2),
            score.problem or "",
        )
        for score in scores
    )
    flown = [score for score in scores if score.bits is not None]
    heat_map = HeatMap(
        title="Manoeuvres, best first",
        rows=tuple(_short(score.name) for score in flown),
        columns=("told apart, mean", *names),
        values=tuple(_numbers([score.bits, *(score.divergence_bits[j] for j in shown)]) for score in flown),
        label="divergence [bit]",
    )
    return (
        Table(name="manoeuvres", title="Manoeuvres, best first", heads=MANOEUVRE_HEADS, rows=rows),
        Drawing(name="manoeuvres", caption=MANOEUVRE_CAPTION, heat_maps=(heat_map,)),
    )


def _facts(result: DiagnosabilityResult, units: Units) -> tuple[tuple[str, str], ...]:
    log, model, atoms = result.log, result.model, result.atoms
    channel_units = {atom.channel: atom.channel_unit for atom in atoms}
    sizes = "multiples of the minimal detectable ones" if result.in_limits else "as given"
    facts = [
        ("Window", f"{instant(log.start_s)} to {instant(log.stop_s)} s, {log.n_samples} samples"),
        ("Rate", f"{number(log.rate_hz)} Hz (recorded at {number(log.native_rate_hz)} Hz)"),
        ("Model", f"VARX of order {model.order}, inputs {', '.join(model.inputs) or 'none'}"),
        ("Prediction error", noise_levels(model.noise_sd, units, channel_units)),
        ("Dictionary", f"{result.dictionary}, {len(atoms)} faults"),
        ("Magnitudes", f"root mean squares, {sizes}"),
    ]
    drawn = () if result.best is None else (("Draws of the noise", str(result.draws)),)
    return (*facts, *drawn)


def _rank(atom: DiagnosedAtom) -> tuple[bool, float]:
    """Return the sort key of entries, the easiest to see first."""
    return atom.divergence_bits is None, -(atom.divergence_bits or 0.0)


def _in_units(atom: DiagnosedAtom, units: Units) -> DiagnosedAtom:
    """Return an entry with the meaning of its magnitudes, in the unit that is shown."""
    scale = atom.physical_scale
    scale, unit = (1.0, atom.unit) if scale is None else (abs(scale), atom.physical_unit or "")
    shown = units.of(unit, channel=atom.channel, channel_unit=atom.channel_unit)
    magnitude, limit = (
        None if size is None else shown.change(scale * size) for size in (atom.magnitude, atom.minimal_detectable)
    )
    return replace(atom, magnitude=magnitude, minimal_detectable=limit, unit=shown.unit)


def _verdict(result: DiagnosabilityResult, live: Sequence[int]) -> str:
    atoms = [result.atoms[j] for j in live]
    if not atoms:
        return "No fault of the dictionary could be assessed."
    hardest = max(atoms, key=_rank)
    limit = quantity(hardest.minimal_detectable, hardest.unit)
    sentences = [f"Hardest to see: {_bits(hardest, 'divergence_bits')}, detected from {limit} on."]
    likely = [atom for atom in atoms if atom.apart_bits is not None]
    if likely:
        alike = min(likely, key=lambda atom: atom.apart_bits or 0.0)
        sentences.append(
            f"Hardest to tell from another: {_bits(alike, 'apart_bits')} against {_short(alike.most_like or '-')}."
        )
    if result.best is not None:
        score = result.manoeuvres[0]
        sentences.insert(0, f"Of {len(result.manoeuvres)} manoeuvres {_short(score.name)} tells most.")
    return " ".join(sentences)


def _bits(atom: DiagnosedAtom, key: str) -> str:
    size = quantity(atom.magnitude, atom.unit)
    return f"{_short(atom.name)} of {size} ({number(getattr(atom, key), digits=2)} bit)"


def _short(name: str) -> str:
    return shortened(name, NAME_LETTERS)


def _curves(result: DiagnosabilityResult, live: Sequence[int]) -> Drawing:
    """Draw the curve of each fault, hardest first, over the magnitudes where it rises."""
    deviations, bits = result.deviations, result.bits
    shown = (bits > SHOWN_BITS[0]) & (bits < SHOWN_BITS[1])
    atoms = [(atom, limit) for j in live if (limit := (atom := result.atoms[j]).minimal_detectable) is not None]
    hardest = sorted(atoms, key=lambda pair: pair[0].divergence_bits or 0.0)[:MOST_CURVES]
    at_deviations = result.limit_deviations
    at_limit = float(np.interp(at_deviations, deviations, bits))
    panels = []
    for unit in dict.fromkeys(atom.unit for atom, _ in hardest):
        sds = [(atom.name, limit / at_deviations) for atom, limit in hardest if atom.unit == unit]
        panels.append(
            Panel(
                x_label=f"magnitude [{unit or '-'}]",
                y_label="divergence [bit]",
                curves=tuple(curve(_short(name), deviations[shown] * sd, bits[shown]) for name, sd in sds),
                log_x=True,
                levels=(("minimal detectable", at_limit),),
                y_limits=(0.0, 1.0),
            )
        )
    return Drawing(name="information", caption=CURVE_CAPTION, panels=tuple(panels))


def _numbers(values: Sequence[float | None]) -> FloatArray:
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)
