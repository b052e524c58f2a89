"""What identify and start-time say of the windows of `window_trials`, as it is stored, and what differs.

The window and its fault are stored beside the answers, so that another way to draw them poses no other questions.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from locked_answers import Difference, differences, plain
from window_trials import answers, posed

from bfi_cli.model.onset import onset_document
from bfi_cli.model.result import identify_document
from bfi_cli.serialization import provenance

STORED = Path(__file__).parent / "windows.jsonl"
# [standard deviations]: largest difference of two estimates that count as equal: a tenth of what they leave open.
ESTIMATES = 0.1
# Standard deviations between the ends of an interval that holds 95 %.
CI95_WIDTH = 2 * 1.96
COMMANDS = ("identify", "start-time")
SIZES = ("magnitude", "sd", "effect")
FAULT_KEYS = ("name", "shape", "source", "among", "beyond_tolerance", "onset_s", "onset_ci95", *SIZES)
LIMIT_KEYS = ("name", "state", "excluded_above", "onsets_checked", *SIZES)


def window_answers(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a window with the answers of both commands as they are stored."""
    identified, searched = answers(*posed(row))
    origin = provenance(log_sha256="")
    documents = (identify_document(identified, origin), onset_document(searched, origin))
    known = {key: value for key, value in row.items() if key not in COMMANDS}
    return known | {name: stored_part(answer) for name, answer in zip(COMMANDS, documents, strict=True)}


def stored_part(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is stored of a document: decision, verdicts, faults and limits."""
    part: dict[str, Any] = plain(
        {
            "decision": document["decision"],
            "verdicts": document["verdicts"],
            "faults": [{key: fault.get(key) for key in FAULT_KEYS} for fault in document["faults"]],
            "candidates": [{key: limit.get(key) for key in LIMIT_KEYS} for limit in document["candidates"]],
        }
    )
    return part


def stored_windows() -> dict[int, dict[str, Any]]:
    """Return the stored windows by number."""
    rows = [json.loads(line) for line in STORED.read_text("utf-8").splitlines()] if STORED.exists() else []
    return {row["number"]: row for row in rows}


def store_windows(rows: Mapping[int, Mapping[str, Any]]) -> None:
    """Store windows, each on a line of its own."""
    lines = [json.dumps(rows[number], separators=(",", ":")) for number in sorted(rows)]
    STORED.write_text("".join(f"{line}\n" for line in lines), "utf-8")


def differences_of_window(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[Difference]:
    """Give what differs between the answers to a window: words at all, estimates by more than ESTIMATES."""
    for command in COMMANDS:
        old, new = before[command], after[command]
        for key in ("decision", "verdicts"):
            yield from differences(old[key], new[key], f"{command}.{key}")
        for key in ("faults", "candidates"):
            former, present = dict(_counted(old[key])), dict(_counted(new[key]))
            if former.keys() != present.keys():
                yield Difference(f"{command}.{key}", json.dumps([*former]), json.dumps([*present]))
            for name in (name for name in former if name in present):
                yield from _between_estimates(former[name], present[name], f"{command}.{key}[{name}]")


def _counted(records: list[dict[str, Any]]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Give records by name, later ones of a name with their number."""
    names = [record["name"] for record in records]
    for k, record in enumerate(records):
        again = names[:k].count(record["name"])
        yield (f"{record['name']} {again + 1}" if again else record["name"]), record


def _between_estimates(old: Mapping[str, Any], new: Mapping[str, Any], where: str) -> Iterator[Difference]:
    """Give what differs between two estimates of a fault or a limit."""
    allowed = _sd_by_key(old)
    for key in old:
        if (sd := allowed.get(key)) is None or not _near(old[key], new[key], ESTIMATES * sd):
            yield from differences(old[key], new[key], f"{where}.{key}")


def _sd_by_key(record: Mapping[str, Any]) -> dict[str, float]:
    """Return the standard deviation of each number of a record that has one."""
    sds: dict[str, float] = {}
    limit = record.get("excluded_above")
    # A limit that states none is taken for two of them.
    sd = record["sd"] if limit is None or record["sd"] is not None else limit / (0.5 * CI95_WIDTH)
    if sd is not None:
        sds |= dict.fromkeys(("magnitude", "sd", "excluded_above"), sd)
        if record["effect"] is not None and (size := limit or record["magnitude"]):
            sds["effect"] = abs(record["effect"] / size) * sd
    if record.get("onset_ci95") is not None:
        first, last = record["onset_ci95"]
        sds |= dict.fromkeys(("onset_s", "onset_ci95"), (last - first) / CI95_WIDTH)
    return sds


def _near(old: Any, new: Any, most: float) -> bool:
    """Say whether two numbers, or the numbers of two lists, differ by `most` at most."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return all(_near(a, b, most) for a, b in zip(old, new, strict=True))
    numbers = isinstance(old, int | float) and isinstance(new, int | float)
    return numbers and abs(old - new) <= most
