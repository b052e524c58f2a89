"""The files of `--out`: everything is made first, then written aside, then moved into place."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from .documents import identify_document
from .errors import ConfigError
from .exhibit import Drawing, Exhibit
from .identify.result import IdentifyResult
from .provenance import Provenance
from .serialize import to_csv

__all__ = ["exhibit_files", "identify_files", "replace_files", "write_results"]

FAULT_COLUMNS = (
    *("name", "shape", "channel", "magnitude", "unit", "sd", "ci95_low", "ci95_high"),
    *("physical_value", "physical_unit", "onset_s", "offset_s", "frequency_hz"),
)
CANDIDATE_COLUMNS = ("name", "channel", "active", "magnitude", "unit", "sd", "minimal_detectable", "note")
DRAWING_COLUMNS = ("panel", "curve", "x", "y", "low", "high")
SERIES = ("measured", "corrected", "predicted", "fault", "fault_sd", "prediction_error", "plain_residual", "true_fault")


def write_results(result: IdentifyResult, provenance: Provenance, directory: Path) -> tuple[Path, ...]:
    """Write result.json, report.html, the figures (PNG, SVG) and the tables (CSV) of an identification.

    Parameters
    ----------
    directory : made if it does not exist; files of the same names are replaced, others left alone.

    Returns
    -------
    The files, result.json last.

    Raises
    ------
    ConfigError : the directory cannot be written to.
    """
    return replace_files(identify_files(result, provenance), directory)


def identify_files(result: IdentifyResult, provenance: Provenance) -> dict[str, bytes]:
    """Return the content of every file of `bfi identify --out` by its name, result.json last."""
    from .plots import FIGURES, to_png, to_svg
    from .report import render_report
    from .serialize import to_json

    files: dict[str, bytes] = {}
    vectors: dict[str, bytes] = {}
    for name, plot in FIGURES.items():
        figure = plot(result)
        vectors[name] = files[f"{name}.svg"] = to_svg(figure)
        files[f"{name}.png"] = to_png(figure)
    files |= {name: text.encode() for name, text in _tables(result).items()}
    files["report.html"] = render_report(result, provenance, vectors).encode()
    files["result.json"] = to_json(identify_document(result, provenance)).encode() + b"\n"
    return files


def exhibit_files(exhibit: Exhibit, document: Mapping[str, Any], origin: Provenance) -> dict[str, bytes]:
    """Return the content of every file of an exhibit by its name: figures, tables, report.html, result.json last.

    Parameters
    ----------
    document : what becomes result.json.
    """
    from .plots.exhibit import draw
    from .plots.style import to_png, to_svg
    from .report import render_exhibit
    from .serialize import to_json

    files: dict[str, bytes] = {}
    vectors: dict[str, bytes] = {}
    for drawing in exhibit.drawings:
        figure = draw(drawing)
        vectors[drawing.name] = files[f"{drawing.name}.svg"] = to_svg(figure)
        files[f"{drawing.name}.png"] = to_png(figure)
        files[f"{drawing.name}_figure.csv"] = to_csv([DRAWING_COLUMNS, *_points(drawing)]).encode()
    files |= {f"{table.name}.csv": to_csv([table.heads, *table.rows]).encode() for table in exhibit.tables}
    files["report.html"] = render_exhibit(exhibit, origin, vectors).encode()
    files["result.json"] = to_json(document).encode() + b"\n"
    return files


def _points(drawing: Drawing) -> Iterable[Sequence[object]]:
    for panel in drawing.panels:
        for one in panel.curves:
            nothing = [None] * one.x.size
            low, high = (nothing if ends is None else ends.tolist() for ends in (one.low, one.high))
            for point in zip(one.x.tolist(), one.y.tolist(), low, high, strict=True):
                yield (panel.title or panel.y_label, one.label, *point)
    for heat_map in drawing.heat_maps:
        for row, values in zip(heat_map.rows, heat_map.values, strict=True):
            for column, value in zip(heat_map.columns, values.tolist(), strict=True):
                yield (heat_map.title, row, column, value, None, None)


def _tables(result: IdentifyResult) -> dict[str, str]:
    orders = zip(result.model.orders, result.model.criterion_no_fault, result.model.criterion_best, strict=True)
    candidates = ([getattr(candidate, column) for column in CANDIDATE_COLUMNS] for candidate in result.candidates)
    series = _series(result)
    samples = zip(*(values.tolist() for values in series.values()), strict=True)
    return {
        "faults.csv": to_csv([FAULT_COLUMNS, *_faults(result)]),
        "candidates.csv": to_csv([CANDIDATE_COLUMNS, *candidates]),
        "orders.csv": to_csv([("order", "criterion_no_fault", "criterion_best"), *orders]),
        "series.csv": to_csv(chain([tuple(series)], samples)),
    }


def _faults(result: IdentifyResult) -> Iterable[Sequence[object]]:
    for estimate in result.faults:
        fault = estimate.fault
        size = (estimate.magnitude, estimate.unit, estimate.sd, *estimate.ci95)
        physical = (estimate.physical_value, estimate.physical_unit)
        when = (fault.onset_s, fault.offset_s, fault.frequency_hz)
        yield (estimate.name, fault.shape, fault.channel, *size, *physical, *when)


def _series(result: IdentifyResult) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    columns = {"time [s]": result.time_s}
    columns |= {_column(name, result.input_units.get(name, "")): values for name, values in result.inputs.items()}
    for series in result.outputs:
        for kind in SERIES:
            values = getattr(series, kind)
            if values is not None:
                columns[_column(f"{series.channel}_{kind}", series.unit)] = values
    return columns


def _column(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def replace_files(files: Mapping[str, bytes], directory: Path) -> tuple[Path, ...]:
    """Write `files` beside their places, then move all of them there: an interruption leaves the old ones.

    Raises
    ------
    ConfigError : the directory cannot be made or written to.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".bfi-", dir=directory) as aside:
            for name, content in files.items():
                (Path(aside) / name).write_bytes(content)
            _move_all(list(files), Path(aside), directory)
    except OSError as error:
        raise ConfigError(f"{directory}: {(error.strerror or str(error)).lower()}; give another --out") from error
    return tuple(directory / name for name in files)


def _move_all(names: Sequence[str], aside: Path, directory: Path) -> None:
    try:
        for name in names:
            os.replace(aside / name, directory / name)
    except KeyboardInterrupt:
        for name in names:
            if (aside / name).exists():
                os.replace(aside / name, directory / name)
        raise
