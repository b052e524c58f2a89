"""The answers of a fleet in the folder of its results, so that a log that did not change is not analysed again.

`store.jsonl` has an answer on each line, appended when the folder of its log is in place, each line whole. Whenever the
work ends, what the store lists is there, and what it does not list is analysed again: nothing is lost, nothing twice.
"""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from ..errors import BfiError, SweepError, reason_of
from ..files import replace_files
from ..provenance import Provenance
from ..serialization import document_of, from_plain, to_json
from .answers import LogAnswer

STORE, SUMMARY, RESULT = "store.jsonl", "summary.json", "result.json"


class Store:
    """The answers that a folder of results has, by the path of the log.

    Attributes
    ----------
    known : answers that are kept, each with the folder of its log in place.
    """

    def __init__(self, out: Path, *, origin: Provenance, inputs: Sequence[str] = (), force: bool = False) -> None:
        """Open the store of a folder, or begin it.

        Parameters
        ----------
        out : folder of the results, made if it does not exist.
        inputs : files that are never replaced.
        force : replace files that this program did not write.

        Raises
        ------
        ConfigError : the folder cannot be written to.
        """
        self._out, self._inputs, self._force = out, tuple(inputs), force
        self.known = _answers(out)
        head = to_json(document_of("fleet", {}, (), origin), indent=None)
        lines = [head, *(to_json(answer, indent=None) for answer in self.known.values())]
        # What is known is written whole, and lines are added to it: a torn last line is gone.
        replace_files({STORE: "".join(f"{line}\n" for line in lines).encode()}, out, inputs=inputs, force=force)
        self._file = (out / STORE).open("a", encoding="utf-8", newline="")

    def add(self, answer: LogAnswer, files: Mapping[str, bytes]) -> None:
        """Write the files of a log to its folder, then its answer to the store.

        Raises
        ------
        ConfigError : a file may not be replaced, or the folder cannot be written to.
        SweepError : the answer cannot be written.
        """
        folder = self._out / answer.folder
        if files:
            for left in folder.glob(".bfi-*"):  # of a run that was killed while it wrote
                shutil.rmtree(left, ignore_errors=True)
            replace_files(files, folder, inputs=(*self._inputs, answer.log), force=self._force)
        try:
            self._file.write(to_json(answer, indent=None) + "\n")
            self._file.flush()
        except OSError as error:
            raise SweepError(f"{self._out}: {reason_of(error)}; make room, then start again: it continues") from None
        self.known[answer.log] = answer

    def document(self, answer: LogAnswer) -> dict[str, Any]:
        """Return the stored document of a log."""
        document: dict[str, Any] = json.loads((self._out / answer.folder / RESULT).read_text("utf-8"))
        return document

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def _answers(out: Path) -> dict[str, LogAnswer]:
    """Return the answers that a folder keeps: of each log the last whose line is whole and whose folder is there."""
    try:
        lines = (out / STORE).read_text("utf-8", errors="replace").splitlines()
    except OSError:
        return {}
    known = {}
    for line in lines:
        with contextlib.suppress(ValueError, BfiError):  # a torn line, or one of another version
            answer = from_plain(LogAnswer, json.loads(line), where=STORE)
            known[answer.log] = answer
    return {log: answer for log, answer in known.items() if answer.error or (out / answer.folder / RESULT).is_file()}
