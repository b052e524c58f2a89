"""A fleet from its logs to their answers, in the order of the logs, on the one engine."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..engine import in_order
from .answers import LogAnswer
from .logs import FleetLog
from .store import Store

AGAIN = "start again, with the same --out to continue,"


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A log to analyse; `known_key` is that of the answer that is kept of it, "" for none."""

    log: FleetLog
    known_key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a worker makes of a log.

    Attributes
    ----------
    answer : None where the log did not change, so that the answer that is kept is right.
    document : on one line of JSON without its series, "" where it is not wanted.
    files : of its folder by name, empty where none are wanted.
    """

    answer: LogAnswer | None = None
    document: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)


def key_of(settings: str, log_sha256: str) -> str:
    """Return the digest of what an answer rests on: the settings, in which the version is, and the log's bytes."""
    return hashlib.sha256(f"{settings} {log_sha256}".encode()).hexdigest()


def run_fleet(
    analyse: Callable[[Task], Outcome],
    logs: Sequence[FleetLog],
    *,
    store: Store | None = None,
    workers: int = 1,
    scheduler: str | None = None,
) -> Generator[tuple[LogAnswer, str], None, None]:
    """Yield the answer on every log, and its document where `analyse` made it anew, in the order of the logs.

    Parameters
    ----------
    analyse : pickled where there are several workers.
    store : keeps the answers as they come, and knows those of before.
    workers, scheduler : see `bfi_cli.engine.in_order`.

    Raises
    ------
    SweepError : see `bfi_cli.engine.in_order`.
    ConfigError : a file of the results may not be replaced.
    """
    known = {} if store is None else dict(store.known)
    # An answer in another folder than that of the log is made again.
    keys = {(path, answer.folder): answer.key for path, answer in known.items()}
    tasks = [Task(log=log, known_key=keys.get((log.path, log.folder), "")) for log in logs]
    # A log a chunk: an interruption waits for no second one, and files in memory are those of a few logs.
    results = in_order(analyse, tasks, workers=workers, scheduler=scheduler, chunk=1, again=AGAIN)
    try:
        for log, (outcome, _) in zip(logs, results, strict=True):
            answer = known[log.path] if outcome.answer is None else outcome.answer
            if store is not None and outcome.answer is not None:
                store.keep(answer, outcome.files)
            yield replace(answer, aircraft=log.aircraft or answer.aircraft), outcome.document
    finally:
        results.close()
