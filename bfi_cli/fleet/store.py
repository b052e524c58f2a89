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
from typing import Any

from ..errors import BfiError
from ..files import replace_files
from ..journal import Journal, lines_of_journal
from ..serialization import Provenance, document_of, from_plain
from .answers import LogAnswer

STORE, SUMMARY, RESULT = "store.jsonl", "summary.json", "result.json"


class Store(Journal):
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
        head = document_of("fleet", {}, (), origin)
        super().__init__(out / STORE, head, self.known.values(), inputs=inputs, force=force)

    def keep(self, answer: LogAnswer, files: Mapping[str, bytes]) -> None:
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
        self.add(answer)
        self.known[answer.log] = answer

    def document(self, answer: LogAnswer) -> dict[str, Any]:
        """Return the stored document of a log."""
        document: dict[str, Any] = json.loads((self._out / answer.folder / RESULT).read_text("utf-8"))
        return document


def _answers(out: Path) -> dict[str, LogAnswer]:
    """Return the answers that a folder keeps: of each log the last whose line is whole and whose folder is there."""
    known = {}
    for line in lines_of_journal(out / STORE):
        with contextlib.suppress(BfiError):  # the head, or an answer of another version
            answer = from_plain(LogAnswer, line, where=STORE)
            known[answer.log] = answer
    return {log: answer for log, answer in known.items() if answer.error or (out / answer.folder / RESULT).is_file()}
