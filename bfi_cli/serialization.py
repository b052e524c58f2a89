"""Dataclasses to plain data (as JSON can hold) and back by their annotations; documents, their provenance, tables."""

from __future__ import annotations

import io
import json
import math
import shlex
import sys
import types
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
import scipy

from . import __version__
from .errors import ConfigError, reason_of
from .files import MARK
from .notes import Note, unique
from .printable import printable, valid_text


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Program, inputs, libraries, command line and date behind the numbers of a document."""

    version: str
    log_sha256: str
    config_sha256: str | None
    dictionary_sha256: str | None
    seed: int
    numpy: str
    scipy: str
    command: str
    date: str


def provenance(
    *,
    log_sha256: str,
    config_sha256: str | None = None,
    dictionary_sha256: str | None = None,
    seed: int = 0,
) -> Provenance:
    """Return the record of program, inputs, libraries, command line and date (UTC) of a result.

    Parameters
    ----------
    log_sha256 : digest of the log, "" for one made in memory.
    config_sha256, dictionary_sha256 : None where the command was given none.
    seed : of the random steps.
    """
    return Provenance(
        version=__version__,
        log_sha256=log_sha256,
        config_sha256=config_sha256,
        dictionary_sha256=dictionary_sha256,
        seed=seed,
        numpy=np.__version__,
        scipy=scipy.__version__,
        command=shlex.join(["bfi", *sys.argv[1:]]),
        date=datetime.now(UTC).isoformat(timespec="seconds"),
    )


T = TypeVar("T")
DAMAGED = "the file is damaged or of another program, write it again"
# Schema of the documents: since 3 notes have kinds, since 4 `altitude` is the pressure altitude alone.
SCHEMA = 4
# The oldest schema that is still read, by kind of document; 1 of any other kind.
OLDEST_READ = {"detect": 2, "diagnose": 2, "identify": 2, "montecarlo": 2, "start-time": 2}
# By kind of document, the key of the list of faults that the analysis declares.
DECLARED = {"identify": "faults", "start-time": "faults", "detect": "alarms", "diagnose": "events"}
# Keys of what has an entry per sample or onset: gigabytes for a day at 100 Hz. A reproduction has drawings in it.
SERIES = ("series", "profile", "drawings")


def document_of(kind: str, body: Mapping[str, Any], notes: Iterable[Note], provenance: Provenance) -> dict[str, Any]:
    """Return the document of a plain body: kind and schema before it, the notes, each once, and provenance after it."""
    ends = {"notes": to_plain(unique(notes)), "provenance": to_plain(provenance)}
    return {"kind": kind, "schema": SCHEMA, **body, **ends}


def to_plain(value: object) -> Any:
    """Return `value` as dicts, lists, strings, numbers and None; numbers that are not finite become None.

    Parameters
    ----------
    value : a dataclass, mapping, sequence, array, scalar or None, nested to any depth.
    """
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, str):
        return valid_text(value)
    if isinstance(value, np.ndarray):
        plain = value.astype(object)
        plain[~np.isfinite(value)] = None
        return plain.tolist()
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        return {_key(field): to_plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict | Mapping):
        return {valid_text(str(key)): to_plain(entry) for key, entry in value.items()}
    return [to_plain(entry) for entry in value] if isinstance(value, Sequence) else value


def from_plain(kind: type[T], value: object, *, where: str) -> T:
    """Return `value` as `kind`, the inverse of `to_plain`; unknown keys are ignored, null in place of a number is NaN.

    Parameters
    ----------
    kind : a dataclass, or any annotation its fields use (float, tuple, Mapping, Literal, optional, array).
    value : plain data.
    where : file and key, for messages.

    Raises
    ------
    ConfigError : a key is missing, or a value is of another kind.
    """
    read: T = _read(kind, value, where)
    return read


def _key(field: Field[Any]) -> str:
    """Return the key of a document that holds a field: its name, where no other is given."""
    key: str = field.metadata.get("key", field.name)
    return key


def mapping(value: object, *, where: str) -> Mapping[str, Any]:
    """Return `value`, which must be a mapping.

    Raises
    ------
    ConfigError : `value` is no mapping.
    """
    return value if isinstance(value, Mapping) else _fail("a mapping", value, where)


def member(document: object, path: str, *, where: str) -> Any:
    """Return the value at a dotted `path` of nested mappings.

    Raises
    ------
    ConfigError : a key is missing, or a value on the way is no mapping.
    """
    value: Any = document
    for key in path.split("."):
        if key not in mapping(value, where=where):
            raise ConfigError(f"{where}: no key '{key}'; {DAMAGED}")
        value, where = value[key], _below(where, key)
    return value


def read_json(path: str | Path, *, give: str) -> Any:
    """Return what a JSON file holds, or stdin where its name is "-".

    Parameters
    ----------
    give : what to give instead, for messages.

    Raises
    ------
    ConfigError : the file cannot be read, or is no JSON.
    """
    try:
        text = sys.stdin.read() if str(path) == "-" else Path(path).read_text("utf-8")
        return json.loads(text)
    except OSError as error:
        raise ConfigError(f"{path}: {reason_of(error)}; {give}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file; {give}") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: not JSON ({error}); {give}") from None


def document_of_kind(
    document: object, kinds: Collection[str], *, where: str, give: str, wanted: str
) -> Mapping[str, Any]:
    """Return a document, which must be of one of some kinds.

    Parameters
    ----------
    give, wanted : for messages, the remedy, and the complaint about the kind.

    Raises
    ------
    ConfigError : the document has another kind, no kind, or another schema.
    """
    if not isinstance(document, Mapping) or "kind" not in document:
        raise ConfigError(f"{where}: not a result of this program, it has no 'kind'; {give}")
    if not isinstance(document["kind"], str) or document["kind"] not in kinds:
        raise ConfigError(f"{where}: kind is '{document['kind']}', {wanted}; {give}")
    check_schema(document, where=where)
    return document


def check_schema(document: Mapping[str, Any], *, where: str) -> None:
    """Check that this program reads the schema of a document of a known kind.

    Raises
    ------
    ConfigError : another schema.
    """
    schema, kind = document.get("schema"), document["kind"]
    if type(schema) is not int or not OLDEST_READ.get(kind, 1) <= schema <= SCHEMA:
        raise ConfigError(
            f"{where}: schema is {schema}, this program reads {SCHEMA}; run bfi {kind} again, or use the version that "
            "wrote the file"
        )


def _below(where: str, key: str) -> str:
    return f"{where}.{key}" if ": " in where else f"{where}: {key}"


def _read(kind: Any, value: Any, where: str) -> Any:
    origin, kinds = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin in (Union, types.UnionType):
        inner = next(entry for entry in kinds if entry is not types.NoneType)
        return None if value is None else _read(inner, value, where)
    if origin is Literal:
        return value if value in kinds else _fail(" or ".join(map(repr, kinds)), value, where)
    if origin is tuple:
        if not isinstance(value, list):
            return _fail("a list", value, where)
        kinds = kinds[:1] * len(value) if kinds[-1] is Ellipsis else kinds
        if len(kinds) != len(value):
            return _fail(f"{len(kinds)} entries", value, where)
        return tuple(_read(entry, value[i], f"{where}[{i}]") for i, entry in enumerate(kinds))
    if origin is Mapping:
        return {key: _read(kinds[1], entry, _below(where, key)) for key, entry in mapping(value, where=where).items()}
    if origin is np.ndarray:
        return _read_array(value, where)
    if kind is Note and isinstance(value, str):  # of documents before schema 3
        return Note.method(value)
    if isinstance(kind, type) and is_dataclass(kind):
        hints, given = _hints(kind), mapping(value, where=where)
        required = {
            field.name for field in fields(kind) if field.default is MISSING and field.default_factory is MISSING
        }
        keys = {field.name: _key(field) for field in fields(kind) if field.name in required or _key(field) in given}
        read = {
            name: _read(hints[name], member(given, key, where=where), _below(where, key)) for name, key in keys.items()
        }
        return kind(**read)
    if kind is float and (value is None or (isinstance(value, int | float) and not isinstance(value, bool))):
        return math.nan if value is None else float(value)
    words = {float: "a number", int: "an integer", bool: "true or false", str: "a text"}
    return value if type(value) is kind else _fail(words[kind], value, where)


def _read_array(value: Any, where: str) -> np.ndarray[Any, Any]:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty((0, 0))
    if array.ndim != 1:
        _fail("a list of numbers", value, where)
    array.setflags(write=False)
    return array


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def _fail(expected: str, value: Any, where: str) -> Any:
    shown = repr(value)
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    raise ConfigError(f"{where}: not {expected}, got {shown}; {DAMAGED}")


def to_json(document: object, *, indent: int | None = 1, ascii_only: bool = False) -> str:
    r"""Return a document as JSON text; dataclasses and arrays become objects and lists, NaN and infinities null.

    Letters of any script stand as they are, what is not printable as `\u001b`: the text can be shown, and reads back
    as it was.

    Parameters
    ----------
    indent : None for everything on one line without blanks.
    ascii_only : escape letters of other scripts too.
    """
    separators = (",", ":") if indent is None else None
    text = json.dumps(
        to_plain(document), indent=indent, separators=separators, ensure_ascii=ascii_only, allow_nan=False
    )
    if text.isascii() and "\x7f" not in text:  # JSON itself escapes the other controls; most documents end here
        return text
    return text.translate({ord(c): json.dumps(c)[1:-1] for c in set(text) if c != "\n" and not c.isprintable()})


def without_series(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document without its `SERIES`, which have an entry per sample or onset."""
    return {
        key: without_series(value) if key == "exhibit" else value
        for key, value in document.items()
        if key not in SERIES
    }


def to_csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    """Return the CSV file of a table; its first line says that this program wrote it."""
    return f"{MARK}\n{csv_lines([columns])}{csv_lines(rows)}".encode()


def csv_lines(rows: Iterable[Sequence[object]]) -> str:
    """Return rows of cells as CSV text; None and numbers that are not finite are empty, text is made printable."""
    import csv

    def cell(value: object) -> object:
        if isinstance(value, bool):
            return str(value).lower()
        if isinstance(value, float) and not math.isfinite(value):
            return None
        return printable(value) if isinstance(value, str) else value

    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([cell(value) for value in row] for row in rows)
    return text.getvalue()
