"""Answers of command lines as they are stored, and what differs between two of them."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import platform
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
from command_lines import FILES, LINES, ROOT, ROUNDED
from threadpoolctl import threadpool_limits

from bfi_cli.commands import run_command

STORED = Path(__file__).parent / "answers"
# Digits of stored numbers.
DIGITS = 12
# [relative]: largest difference of numbers that count as equal, of one processor and one version of the libraries.
NUMBERS = 1e-9
# [relative]: the same of others. Without AVX2, statistics of a scan changed by up to 8e-4, which an optimum found to a
# tolerance leaves open, and nothing else by more than 1e-9.
ELSEWHERE = 1e-2
# Numbers below it count as zero: residuals of what is solved exactly.
ZERO = 1e-12
# Keys that are left out at any depth: they say when, how fast and by which version an answer was made.
LEFT_OUT = ("provenance", "schema", "seconds")
# Keys that are left out where they are null, as of most logs.
NULL_LEFT_OUT = ("clock",)
# By which keys the entries of a list are known, so that one more entry is one difference; else they go by position.
NAMES = (("name",), ("text",), ("fault", "shape", "channel", "bounds", "holds_in", "grows_on"))
# Letters of a value in a list of differences.
LONGEST = 160


@dataclass(frozen=True, slots=True)
class Difference:
    """A value of an answer that is another one.

    Attributes
    ----------
    where : path of keys in the answer; before, after : as shown, "nothing" for a key that is absent.
    """

    where: str
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.where}: {self.before} -> {self.after}"


def answer(name: str, folder: Path) -> dict[str, Any]:
    """Return the answer of a command line, and by what it was computed.

    It is the exit code, the line on stderr, and the document, None without one.

    Parameters
    ----------
    name : of the command line; folder : where the files are that it reads, made if they are missing.
    """
    for file in ("data", "configs"):
        if not (folder / file).exists():
            (folder / file).symlink_to(ROOT / file)
    words = shlex.split(LINES[name])
    _make(words, folder)
    code, stdout, stderr = _run(words, folder)
    document = plain(json.loads(stdout)) if stdout else None
    return {"arithmetic": arithmetic(), "code": code, "stderr": stderr, "document": document}


@cache
def arithmetic() -> str:
    """Return on what the last digits depend: versions of the libraries, and how this processor rounds.

    Kernels of linear algebra go by the caches of a processor too, which no name of it tells: a sum, a product and a
    factorisation as they come out here stand for them.
    """
    x = np.sin(np.arange(2.0e4)).reshape(400, 50)
    with threadpool_limits(1):
        made = [np.exp(x), x.T @ x, np.linalg.qr(x, mode="r"), scipy.linalg.solve_triangular(np.tri(50) + x[:50], x.T)]
        made.append(np.fft.rfft(x[:, 0]))
    rounded = hashlib.sha256(b"".join(np.ascontiguousarray(values).tobytes() for values in made)).hexdigest()[:8]
    return f"{platform.machine()} {rounded}, numpy {np.__version__}, scipy {scipy.__version__}"


def _make(words: Sequence[str], folder: Path) -> None:
    """Write those files of a command line that are missing."""
    for word in words:
        how, path = FILES.get(word), folder / word
        if how is None or path.exists():
            continue
        if isinstance(how, str):
            line = [*shlex.split(how), "-o", word]
            _make(line[:-1], folder)
            code, _, stderr = _run(line, folder)
            if code:
                raise RuntimeError(f"bfi {shlex.join(line)}: exit code {code}, {stderr}")
        else:
            how(path)


def _run(words: Sequence[str], folder: Path) -> tuple[int, str, str]:
    """Run a command line of bfi in a folder and return its exit code, stdout and stderr."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        code = run_command(words)
    return code, stdout.getvalue(), stderr.getvalue()


def plain(value: Any) -> Any:
    """Return a value of a JSON document as it is stored: numbers with DIGITS digits, without the keys left out."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items() if not _is_left_out(key, entry)}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(entry) for entry in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _is_left_out(key: str, value: Any) -> bool:
    return key in LEFT_OUT or (key in NULL_LEFT_OUT and value is None)


def stored(name: str) -> dict[str, Any]:
    """Return the stored answer of a command line."""
    before: dict[str, Any] = json.loads((STORED / f"{name}.json").read_text("utf-8"))
    return before


def store(name: str, after: Mapping[str, Any]) -> None:
    """Store an answer, each key of its document on a line of its own."""
    lines = {key: _text(value) for key, value in after.items()}
    if after["document"] is not None:
        body = ",\n  ".join(f"{_text(key)}: {_text(value)}" for key, value in after["document"].items())
        lines["document"] = f"{{\n  {body}\n }}"
    STORED.mkdir(exist_ok=True)
    text = ",\n ".join(f"{_text(key)}: {value}" for key, value in lines.items())
    (STORED / f"{name}.json").write_text(f"{{\n {text}\n}}\n", "utf-8")


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def differences_from_stored(name: str, after: Mapping[str, Any], *, within: float | None = None) -> list[Difference]:
    """Return what differs from the stored answer of a command line.

    Parameters
    ----------
    after : its answer now.
    within : see `differences`; None for NUMBERS, or ELSEWHERE where the stored answer was computed by others.
    """
    before = stored(name)
    if within is None:
        elsewhere = before["arithmetic"] != after["arithmetic"]
        if elsewhere and name in ROUNDED:
            return list(differences(decisive(before), decisive(after)))
        within = ELSEWHERE if elsewhere else NUMBERS
    return list(differences(before, {**after, "arithmetic": before["arithmetic"]}, within=within))


def decisive(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return of an answer what it decides: code, decision, verdicts, and the names, channels and states of faults."""
    document = answer["document"] or {}
    faults = [*document.get("faults", ()), *document.get("events", ())]
    return {
        "code": answer["code"],
        "stderr": answer["stderr"],
        "keys": sorted(document),
        "decision": document.get("decision"),
        "verdicts": document.get("verdicts"),
        "faults": [[fault.get(key) for key in ("name", "fault", "channel", "state", "shape")] for fault in faults],
    }


def differences(before: Any, after: Any, where: str = "", *, within: float = NUMBERS) -> Iterator[Difference]:
    """Give what differs between two values of JSON, key by key; a list of numbers is one difference.

    Parameters
    ----------
    where : path of the values; within : largest relative difference of numbers that are equal.
    """
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for key in [*before, *(key for key in after if key not in before)]:
            path = f"{where}.{key}" if where else str(key)
            if key not in after:
                yield Difference(path, _shown(before[key]), "nothing")
            elif key not in before:
                yield Difference(path, "nothing", _shown(after[key]))
            else:
                yield from differences(before[key], after[key], path, within=within)
    elif isinstance(before, list) and isinstance(after, list):
        yield from _between_lists(before, after, where, within)
    elif not _equal(before, after, within):
        yield Difference(where, _shown(before), _shown(after))


def _between_lists(before: list[Any], after: list[Any], where: str, within: float) -> Iterator[Difference]:
    numbers = all(_is_number(entry) for entry in (*before, *after))
    if numbers and len(before) == len(after):
        pairs = [pair for pair in zip(before, after, strict=True) if not _equal(*pair, within)]
        if pairs:
            most = max(abs(a - b) / max(abs(a), abs(b)) for a, b in pairs)
            count = f"{len(pairs)} of {len(before)} numbers, by up to {most:.2g} of them"
            yield Difference(f"{where} ({count})", _shown(before), _shown(after))
    elif numbers:
        yield Difference(where, _shown(before), _shown(after))
    else:
        yield from (
            Difference(f"{where}{inner.where}", inner.before, inner.after)
            for inner in differences(*_by_name(before, after), within=within)
        )


def _by_name(before: list[Any], after: list[Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the entries of two lists by their names where they have such, else by position."""
    for keys in NAMES:
        old, new = _named(before, keys), _named(after, keys)
        if old is not None and new is not None:
            return old, new
    positions = [{f"[{k}]": entry for k, entry in enumerate(entries)} for entries in (before, after)]
    return positions[0], positions[1]


def _named(entries: list[Any], keys: Sequence[str]) -> dict[str, Any] | None:
    """Return entries by their values of some keys, None where an entry lacks one or two are alike."""
    if not all(isinstance(entry, Mapping) and all(key in entry for key in keys) for entry in entries):
        return None
    named = {f"[{' '.join(str(entry[key]) for key in keys)}]": entry for entry in entries}
    return named if len(named) == len(entries) else None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _equal(before: Any, after: Any, within: float) -> bool:
    if _is_number(before) and _is_number(after):
        return math.isclose(before, after, rel_tol=within, abs_tol=ZERO)
    return type(before) is type(after) and bool(before == after)


def _shown(value: Any) -> str:
    text = _text(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."
