"""The tables of a fleet: Parquet where pyarrow is installed, else CSV; the same for any number of workers."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from ..serialization import to_csv
from .answers import LogAnswer
from .trends import FleetTrend, trend_rows

# Columns of every table, and by analysis those of `flights` and of the second table with its name.
LOG_COLUMNS: Mapping[str, type] = {"log": str, "aircraft": str}
SPAN: Mapping[str, type] = {
    **dict.fromkeys(("since_1970_s", "start_s", "stop_s"), float),
    "n_samples": int,
    **dict.fromkeys(("rate_hz", "flight_s"), float),
}
SIZE: Mapping[str, type] = {"magnitude": float, "unit": str, "low": float, "high": float}
FLIGHTS: Mapping[str, Mapping[str, type]] = {
    "diagnose": {
        **SPAN,
        **dict.fromkeys(("decision", "state", "abrupt", "oscillating", "slow"), str),
        **dict.fromkeys(("declared", "suspected", "deviations", "ordinary", "contradictions"), int),
        "fault": str,
        "shape": str,
        "onset_s": float,
        "onset_clock": str,
        **SIZE,
        "could_hide": str,
    },
    "info": {
        **SPAN,
        "uniform": bool,
        **dict.fromkeys(("channels", "gaps", "defects", "contradictions"), int),
    },
}
SECOND: Mapping[str, tuple[str, Mapping[str, type]]] = {
    "diagnose": (
        "events",
        {
            **dict.fromkeys(("state", "fault", "among", "channels", "kind", "shape"), str),
            **SIZE,
            "onset_s": float,
            "onset_clock": str,
            **dict.fromkeys(("onset_low_s", "onset_high_s", "offset_s", "frequency_hz"), float),
            **dict.fromkeys(("statistic", "threshold", "p_value", "margin"), float),
            "beyond_tolerance": bool,
            "effect_channel": str,
            "effect": float,
            "count": int,
        },
    ),
    "info": ("channels", {**dict.fromkeys(("name", "unit", "source"), str), "min": float, "max": float, "n_nan": int}),
}

CONSTANTS: Mapping[str, type] = {
    **dict.fromkeys(("channel", "by", "unit"), str),
    **dict.fromkeys(("value", "low", "high"), float),
}
TRENDS: Mapping[str, type] = {
    **dict.fromkeys(("aircraft", "channel", "by", "unit"), str),
    "n_flights": int,
    "declared": bool,
    **dict.fromkeys(("slope", "low", "high", "p_value", "first", "last"), float),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetTable:
    """A table with typed columns; a cell is None where nothing is known."""

    name: str
    columns: Mapping[str, type]
    rows: Sequence[Mapping[str, Any]]


def columns_of_answers(kind: str) -> tuple[str, ...]:
    """Return the names of all that is kept of an answer: one with others is no answer of this version."""
    return (*(column.name for column in fields(LogAnswer)), *FLIGHTS[kind], *SECOND[kind][1], *CONSTANTS)


def tables_of(
    kind: str, answers: Iterable[LogAnswer], trends: Sequence[FleetTrend] | None = None
) -> tuple[FleetTable, ...]:
    """Return the tables of the answers of an analysis, in their order.

    Parameters
    ----------
    trends : of aircraft, a table too, None where they are not asked for.
    """
    flights, rows, constants = [], [], []
    for answer in answers:
        log_cells = {"log": answer.log, "aircraft": answer.aircraft or None}
        flights.append({**log_cells, "sha256": answer.sha256 or None, "error": answer.error or None, **answer.flight})
        rows += [{**log_cells, **row} for row in answer.rows]
        constants += [{**log_cells, **row} for row in answer.constants]
    name, columns = SECOND[kind]
    return (
        FleetTable(name="flights", columns={**LOG_COLUMNS, "sha256": str, "error": str, **FLIGHTS[kind]}, rows=flights),
        FleetTable(name=name, columns={**LOG_COLUMNS, **columns}, rows=rows),
        *(
            (FleetTable(name="constants", columns={**LOG_COLUMNS, **CONSTANTS}, rows=constants),)
            if kind == "diagnose"
            else ()
        ),
        *(() if trends is None else (FleetTable(name="trends", columns=TRENDS, rows=trend_rows(trends)),)),
    )


def table_names(kind: str) -> dict[str, str]:
    """Return the names of all files of tables as they are written here, each with that of the other format."""
    ends = (".parquet", ".csv") if _pyarrow() is not None else (".csv", ".parquet")
    names = ("flights", SECOND[kind][0], *(("constants", "trends") if kind == "diagnose" else ()))
    return {f"{name}{ends[0]}": f"{name}{ends[1]}" for name in names}


def table_file(table: FleetTable) -> tuple[str, bytes]:
    """Return name and bytes of the file of a table, Parquet where pyarrow is installed."""
    pyarrow = _pyarrow()
    if pyarrow is None:
        rows = ([row.get(name) for name in table.columns] for row in table.rows)
        return f"{table.name}.csv", to_csv(tuple(table.columns), rows)
    from pyarrow import parquet

    kinds = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64(), bool: pyarrow.bool_()}
    columns = {
        name: pyarrow.array([None if row.get(name) is None else kind(row[name]) for row in table.rows], kinds[kind])
        for name, kind in table.columns.items()
    }
    file = io.BytesIO()
    parquet.write_table(pyarrow.table(columns), file)
    return f"{table.name}.parquet", file.getvalue()


def _pyarrow() -> Any:
    """Return the library, None where it is not installed."""
    try:
        import pyarrow
    except ImportError:
        return None
    return pyarrow
