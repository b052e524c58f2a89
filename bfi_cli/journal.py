"""Entries of long work in a file of a folder of results, a line of JSON each, so that stopped work continues."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from .errors import SweepError, reason_of
from .files import replace_files
from .serialization import to_json


class Journal:
    """A file to which entries are appended as they come, each line whole whenever the work ends."""

    def __init__(
        self,
        path: Path,
        head: Mapping[str, Any],
        entries: Iterable[object] = (),
        *,
        inputs: Sequence[str] = (),
        force: bool = False,
    ) -> None:
        """Write the file with what is known, whole, so that a torn last line is gone.

        Parameters
        ----------
        path : in the folder of results, which is made if it does not exist.
        head : a document without entries, the first line: what the work is of.
        entries : that are known, dataclasses or plain data.
        inputs : files that are never replaced; force : replace a file that this program did not write.

        Raises
        ------
        ConfigError : the folder cannot be written to.
        """
        self._folder = path.parent
        lines = [to_json(line, indent=None) for line in (head, *entries)]
        content = "".join(f"{line}\n" for line in lines).encode()
        replace_files({path.name: content}, path.parent, inputs=inputs, force=force)
        self._file = path.open("a", encoding="utf-8", newline="")

    def add(self, entry: object) -> None:
        """Append an entry and hand it to the operating system.

        Raises
        ------
        SweepError : it cannot be written.
        """
        try:
            self._file.write(to_json(entry, indent=None) + "\n")
            self._file.flush()
        except OSError as error:
            message = f"{self._folder}: {reason_of(error)}; make room, then start again: it continues"
            raise SweepError(message) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def lines_of_journal(path: Path) -> list[Any]:
    """Return the lines of a journal that are whole, the head first; nothing where there is none."""
    try:
        lines = path.read_text("utf-8", errors="replace").splitlines()
    except OSError:
        return []
    whole = []
    for line in lines:
        with contextlib.suppress(ValueError):
            whole.append(json.loads(line))
    return whole
