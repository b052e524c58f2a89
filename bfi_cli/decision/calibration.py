"""Tables of the onset scan's statistic on fault-free records, and the thresholds and p-values they give.

On real flights the statistic of a fault-free window is far larger than white noise would make it, so its distribution
is counted, not derived (docs/theory.md, 10.2 and 10.3). Shapes differ in it: each is divided by the mean of its own
largest 15 %, the largest of the quotients is the statistic of the window, and above the 85 % quantile of that its
distribution is taken to fall exponentially, at a rate that few windows tell only roughly.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigError
from ..kernels import FloatArray
from ..kernels.whiteness import ExcessTail
from ..notes import Note, unique
from ..serialization import SCHEMA, Provenance, check_schema, from_plain, mapping, member, to_json
from ..yaml12 import read_text

# A million windows of three shapes, decades of flight: 20 letters for each number.
MAX_BYTES = 64_000_000
# With fewer there is at most a handful of windows above the quantile from which the tail is estimated.
FEWEST_WINDOWS = 20
# Quantile at which the tail begins (docs/theory.md, 10.3): of a hundred windows fifteen lie in the tail.
TAIL = 0.85
# Half of the largest of ten independent chi-square variables of one degree of freedom lie below 3.3; windows have many
# more onsets than that, but scans of other analyses subtract what they cost. Numbers all equal to rounding are none.
LEAST_STATISTIC, SAME = 0.1, 1e-9
# Relative: rates differ by a clock's error, windows by what the filter drops at their ends, edges by how well jumps
# show them.
TOLERANCES = {"rate_hz": 0.01, "duration_s": 0.1, "native_rate_hz": 0.01, "recorder_hz": 0.1}
WORDS = {
    "rate_hz": "rate",
    "duration_s": "window length",
    "orders": "order",
    "feedthrough": "feedthrough",
    "inputs": "inputs",
    "outputs": "outputs",
    "shapes": "shapes",
    "ends": "search for ends",
    "frequency_hz": "frequencies",
    "native_rate_hz": "recorded rate",
    "recorder_hz": "recorder's edge",
    "variance": "weighting of samples",
    "samples": "sampled shape",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """What the distribution of the statistic depends on.

    Attributes
    ----------
    rate_hz, duration_s : of a window after conditioning.
    orders : those to choose from; one if it was given.
    shapes : looked for.
    ends : whether the end was searched for too.
    frequency_hz : [low, high] of the oscillations, None for the default, which the window's length and rate fix.
    native_rate_hz : of the log as it was recorded; recorder_hz : edge of its recorder's low-pass, None where there is
        none or none is known.
    variance : "running" where samples are weighted by the running size of the prediction error.
    samples : sha256 of the file of a sampled shape.
    """

    rate_hz: float
    duration_s: float
    orders: tuple[int, ...]
    feedthrough: bool
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    shapes: tuple[str, ...]
    ends: bool = False
    frequency_hz: tuple[float, float] | None = None
    native_rate_hz: float | None = None
    recorder_hz: float | None = None
    variance: str = "constant"
    samples: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibrationTable:
    """The statistic on windows without a fault.

    Attributes
    ----------
    settings : of the scans.
    statistics : by shape, (n_windows,) its largest over onsets and channels.
    logs : names of what the windows were cut from.
    n_unusable : windows that could not be analysed.
    """

    settings: CalibrationSettings
    statistics: Mapping[str, FloatArray]
    logs: tuple[str, ...]
    n_unusable: int = 0

    @property
    def n_windows(self) -> int:
        """Windows counted."""
        return min((len(values) for values in self.statistics.values()), default=0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Null:
    """The distribution of the standardised statistic without a fault.

    Attributes
    ----------
    scale : by shape, the mean of what lies above its 85 % quantile. One from the body of the distribution, as the
        median and a quantile give it, lets the tail of the shape with the heaviest one set the thresholds of all.
    maxima : (n_windows,) the largest over shapes, increasing.
    tail : of the maxima, above their 85 % quantile.
    """

    scale: Mapping[str, float]
    maxima: FloatArray
    tail: ExcessTail

    def standardised(self, shape: str, statistic: float) -> float:
        """Return the statistic of a shape in units common to all shapes."""
        return statistic / self.scale[shape]

    @property
    def rarest(self) -> float:
        """The smallest probability that the windows can have shown, 1 / (n + 1) of n."""
        return 1.0 / (len(self.maxima) + 1)

    def p_value(self, standardised: float) -> float:
        """Return the probability that a window without a fault reaches this largest standardised statistic.

        It is never less than `rarest`: where it is that, it is a bound.
        """
        if standardised > self.tail.start:
            return max(self.tail.probability(standardised), self.rarest)
        reached = len(self.maxima) - int(np.searchsorted(self.maxima, standardised))
        return max(self.tail.share, (reached + 1) * self.rarest)

    def threshold(self, shape: str, false_alarm: float) -> float:
        """Return the statistic of a shape above which it is a fault; the rate counts all shapes together.

        A rate below `rarest` is extrapolated along the tail.
        """
        if false_alarm < self.tail.share:
            level = self.tail.level(false_alarm)
        else:
            level = float(np.quantile(self.maxima, 1.0 - false_alarm))
        return self.scale[shape] * level


def null_of(table: CalibrationTable, shapes: Sequence[str]) -> Null:
    """Return the distribution for some of the shapes of a table.

    Raises
    ------
    ConfigError : the table lacks one of the shapes, or holds too few windows.
    """
    missing = [shape for shape in shapes if shape not in table.statistics]
    if missing:
        has = ", ".join(table.statistics)
        raise ConfigError(f"--calibration: no {missing[0]} in the table, it has: {has}; make one with bfi calibrate")
    if table.n_windows < FEWEST_WINDOWS:
        raise ConfigError(
            f"--calibration: {table.n_windows} windows without a fault, fewer than {FEWEST_WINDOWS}; "
            "give more or longer logs, or shorter windows"
        )
    return null_from({shape: table.statistics[shape] for shape in shapes})


def null_from(statistics: Mapping[str, FloatArray]) -> Null:
    """Return the distribution of statistics, (n_windows,) by shape, of windows without a fault."""
    values = np.stack(list(statistics.values()))
    scale = np.array([np.mean(sample[sample >= np.quantile(sample, TAIL)]) for sample in values])
    scale = np.maximum(scale, np.finfo(float).eps)
    maxima = np.sort((values / scale[:, None]).max(axis=0))
    start = float(np.quantile(maxima, TAIL))
    above = maxima[maxima > start] - start
    excess = float(np.mean(above)) if above.size else np.finfo(float).eps
    tail = ExcessTail(start=start, mean=excess, k=max(1, above.size), share=1.0 - TAIL)
    return Null(scale=dict(zip(statistics, scale.tolist(), strict=True)), maxima=maxima, tail=tail)


def differences(table: CalibrationTable, settings: CalibrationSettings) -> tuple[str, ...]:
    """Return in what a table was made otherwise than `settings`, as "rate 2 instead of 10"; empty where it fits.

    A table of more shapes fits fewer.
    """
    notes = []
    for name, words in WORDS.items():
        ours, theirs = getattr(settings, name), getattr(table.settings, name)
        if name in TOLERANCES and ours is not None and theirs is not None:
            alike = abs(ours - theirs) <= TOLERANCES[name] * ours
        elif name in ("inputs", "outputs"):
            alike = set(ours) == set(theirs)
        else:
            alike = set(ours) <= set(theirs) if name == "shapes" else ours == theirs
        if not alike:
            notes.append(f"{words} {_shown(theirs)} instead of {_shown(ours)}")
    return tuple(notes)


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return "/".join(map(_shown, value))
    return f"{value:.4g}" if isinstance(value, float) else "default" if value is None else str(value)


def nearest(tables: Sequence[CalibrationTable], settings: CalibrationSettings) -> CalibrationTable | None:
    """Return the table that differs in the fewest things and then the least in rate; None where none has all shapes."""
    able = [table for table in tables if set(settings.shapes) <= set(table.statistics)]

    def distance(table: CalibrationTable) -> tuple[int, float]:
        return len(differences(table, settings)), abs(np.log(table.settings.rate_hz / settings.rate_hz))

    return min(able, key=distance, default=None)


def join_tables(tables: Sequence[CalibrationTable], table: CalibrationTable) -> tuple[CalibrationTable, ...]:
    """Return the tables with one more; its windows join those of a table of the same settings."""
    same = [
        other for other in tables if not differences(other, table.settings) and not differences(table, other.settings)
    ]
    others = [other for other in tables if other not in same]
    for other in same:
        table = CalibrationTable(
            settings=other.settings,
            statistics={shape: np.concatenate([x, table.statistics[shape]]) for shape, x in other.statistics.items()},
            logs=tuple(dict.fromkeys((*other.logs, *table.logs))),
            n_unusable=other.n_unusable + table.n_unusable,
        )
    return (*others, table)


def save_tables(
    tables: Sequence[CalibrationTable], provenance: Provenance, notes: Sequence[Note] = (), *, air_data: object = None
) -> str:
    """Return the JSON text of tables, and of the air data of the aircraft where it is given."""
    document = {"kind": "calibration", "schema": SCHEMA, "tables": list(tables)}
    more = {} if air_data is None else {"air_data": air_data}
    written = json.loads(to_json({**document, **more}))
    return to_json({**document, **more, "digest": _digest(written), "notes": unique(notes), "provenance": provenance})


def _digest(document: Mapping[str, Any]) -> str:
    """Return what tells that nobody has changed a number of the tables of a document."""
    held = {key: document.get(key) for key in ("tables", "air_data")}
    return hashlib.sha256(json.dumps(held, sort_keys=True).encode()).hexdigest()


def check_calibration(document: Mapping[str, Any], *, where: str) -> tuple[CalibrationTable, ...]:
    """Return the tables of the onset scan in a document of `bfi calibrate`, its key and its numbers checked.

    Raises
    ------
    ConfigError : it is of another schema, or holds what no scan counts.
    """
    check_schema(document, where=where)
    tables = from_plain(tuple[CalibrationTable, ...], member(document, "tables", where=where), where=f"{where}: tables")
    check_digest(document, where=where)
    for k, table in enumerate(tables):
        if wrong := _wrong_with(table):
            raise ConfigError(f"{where}: tables[{k}]: {wrong}; run bfi calibrate again")
    return tables


def check_digest(document: Mapping[str, Any], *, where: str) -> None:
    """Check that a document of `bfi calibrate` holds the numbers that were written; earlier versions do not say.

    Raises
    ------
    ConfigError : it does not.
    """
    if "digest" in document and document["digest"] != _digest(document):
        raise ConfigError(f"{where}: its tables are not those that were written; run bfi calibrate again")


def _wrong_with(table: CalibrationTable) -> str | None:
    """Return in what the key of a table, or its numbers, make no sense."""
    settings = table.settings
    for name in ("rate_hz", "duration_s", "native_rate_hz", "recorder_hz"):
        value = getattr(settings, name)
        if value is not None and not (np.isfinite(value) and value > 0.0):
            return f"settings.{name} is {value}, not a positive number"
    if not settings.orders or min(settings.orders) < 1:
        return f"settings.orders is {list(settings.orders)}, not orders of a model"
    for name in ("inputs", "outputs", "shapes"):
        if not getattr(settings, name):
            return f"settings.{name} is empty"
    if set(settings.shapes) != set(table.statistics):
        has = ", ".join(table.statistics) or "nothing"
        return f"settings.shapes is {', '.join(settings.shapes)}, but the statistics are of {has}"
    counts = {len(values) for values in table.statistics.values()}
    if len(counts) > 1:
        return f"the shapes have {' and '.join(map(str, sorted(counts)))} windows, not as many each"
    for shape, values in table.statistics.items():
        if wrong := wrong_statistics(values):
            return f"statistics.{shape}: {wrong}"
    return None


def wrong_statistics(values: FloatArray) -> str | None:
    """Return why numbers are no statistics of windows, each the largest of many likelihood ratios; None if they may be.

    Twice the logarithm of a likelihood ratio is not negative, and the largest of many is not nothing, nor always the
    same.
    """
    if values.ndim != 1 or not np.isfinite(values).all():
        return "not all of them are numbers"
    if np.any(values < 0.0):
        return f"{float(values.min()):.4g} is negative, which no likelihood ratio is"
    if values.size >= FEWEST_WINDOWS and float(np.ptp(values)) <= SAME * float(values.max(initial=0.0)):
        return f"all of them are {float(values[0]):.4g}"
    if values.size and float(np.median(values)) < LEAST_STATISTIC:
        return f"their median is {float(np.median(values)):.4g}, less than white noise alone gives"
    return None


def calibration_document(path: str | Path) -> Mapping[str, Any]:
    """Return what a file made by `bfi calibrate` holds.

    Raises
    ------
    ConfigError : it cannot be read, or is something else.
    """
    where = str(path)
    try:
        document = mapping(json.loads(read_text(Path(path), error=ConfigError, most_bytes=MAX_BYTES)), where=where)
    except json.JSONDecodeError as problem:
        raise ConfigError(f"{where}: not JSON ({problem.msg.lower()}); give a file of bfi calibrate") from None
    if (kind := document.get("kind")) != "calibration":
        raise ConfigError(f"{where}: kind is '{kind}', not 'calibration'; give a file of bfi calibrate")
    return document


def load_tables(path: str | Path) -> tuple[CalibrationTable, ...]:
    """Return the tables of the onset scan in a file made by `bfi calibrate`.

    Raises
    ------
    ConfigError : it cannot be read, is something else, or is of another schema.
    """
    return check_calibration(calibration_document(path), where=str(path))
