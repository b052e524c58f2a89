"""Many independent calls of one function: here, on processes, or on a Dask cluster, with the same results in any case.

Every worker has one BLAS thread, for more change the bits; results come in the order of the items.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import cache
from itertools import islice
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from typing import Any, Protocol, TypeVar

from .errors import SweepError
from .threads import one_thread

T = TypeVar("T")
R = TypeVar("R")

# Items sent to a worker at a time, and chunks under way per worker: enough that none waits for the next, and few enough
# that an interruption, which loses those under way, loses little. Chosen without a tuning record.
CHUNK, AHEAD = 10, 4
# Seconds in which a Dask scheduler must answer.
CONNECT_S = 10
# Seconds between two looks of a worker whether its parent is still there to read what it sends.
LOOK_S = 0.1

# Held by a worker while it does not work: it sends a result then, or waits for the next items.
_resting = threading.Lock()


class _Future(Protocol):
    def result(self) -> Any: ...


def in_order(
    work: Callable[[T], R],
    items: Sequence[T],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    chunk: int = CHUNK,
    again: str = "continue with --resume",
) -> Generator[tuple[R, float], None, None]:
    """Yield `work(item)` and the seconds it took, in the order of the items.

    Parameters
    ----------
    work : a function of a module; it, the items and the results are pickled where there are several workers.
    workers : processes of this machine; 1 stays in this one.
    scheduler : address of a Dask scheduler, which then has the workers.
    chunk : items sent to a worker at a time.
    again : how to go on, for the message about a worker that died.

    Raises
    ------
    SweepError : a worker died, the cluster cannot be reached, or `distributed` is not installed.
    """
    chunks = [items[start : start + chunk] for start in range(0, len(items), chunk)]
    if scheduler is not None:
        return _on_dask(work, chunks, scheduler, again)
    return _here(work, items) if workers == 1 else _on_processes(work, chunks, workers, again)


def _here(work: Callable[[T], R], items: Sequence[T]) -> Generator[tuple[R, float], None, None]:
    with one_thread():
        yield from _timed(work, items)


def _on_processes(
    work: Callable[[T], R], chunks: Sequence[Sequence[T]], workers: int, again: str
) -> Generator[tuple[R, float], None, None]:
    context = get_context("spawn")
    # Nothing is written to this pipe: it ends when this process closes its end, or is no more, and the workers with it.
    ending, alive = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, context, initializer=_begin_worker, initargs=(ending,))
    try:
        yield from _ordered(lambda chunk: pool.submit(_in_process, work, chunk), chunks, AHEAD * workers)
    except BrokenProcessPool:
        raise SweepError(
            f"--workers {workers}: a worker was ended from outside, perhaps for want of memory; {again} and "
            "fewer --workers"
        ) from None
    except BaseException:
        # What is under way is nobody's any more.
        alive.close()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        alive.close()
        ending.close()


def _begin_worker(ending: Connection) -> None:
    """Leave interrupts to the parent, and end when it does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _resting.acquire()
    threading.Thread(target=_end_with_parent, args=(ending,), daemon=True).start()


def _end_with_parent(ending: Connection) -> None:
    """End the worker amid its work, but not amid a result: a parent that lives would wait for the rest of it forever.

    A worker that rests is ended by its pool.
    """
    with suppress(EOFError, OSError):
        ending.recv_bytes()
    parent = parent_process()
    while not _resting.acquire(timeout=LOOK_S) and parent is not None and parent.is_alive():
        pass
    os._exit(1)


def _in_process(work: Callable[[T], R], items: Sequence[T]) -> list[tuple[R, float]]:
    _resting.release()
    try:
        return _in_worker(work, items)
    finally:
        _resting.acquire()


def _on_dask(
    work: Callable[[T], R], chunks: Sequence[Sequence[T]], scheduler: str, again: str
) -> Generator[tuple[R, float], None, None]:
    try:
        import distributed
    except ImportError:
        raise SweepError("--scheduler: distributed is not installed; pip install 'bfi-cli[cluster]'") from None
    dask: Any = distributed
    try:
        client = dask.Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        why = " ".join(str(error).split())[:100] or type(error).__name__
        raise SweepError(
            f"--scheduler: no Dask scheduler answers, got '{scheduler}' ({why}); give one such as tcp://host:8786"
        ) from None
    with client:
        ahead = AHEAD * max(sum(client.nthreads().values()), 1)
        try:
            yield from _ordered(lambda chunk: client.submit(_in_worker, work, chunk, pure=False), chunks, ahead)
        except dask.KilledWorker:
            raise SweepError(
                f"--scheduler {scheduler}: a part of the work killed its workers, perhaps for want of memory; {again} "
                "and larger workers"
            ) from None


def _ordered(
    submit: Callable[[Sequence[T]], _Future], chunks: Sequence[Sequence[T]], ahead: int
) -> Iterator[tuple[Any, float]]:
    """Keep `ahead` chunks under way and yield from the oldest."""
    waiting = iter(chunks)
    under_way = deque(map(submit, islice(waiting, ahead)))
    while under_way:
        done = under_way.popleft().result()
        under_way.extend(map(submit, islice(waiting, 1)))
        yield from done


def _in_worker(work: Callable[[T], R], items: Sequence[T]) -> list[tuple[R, float]]:
    _one_thread()
    return list(_timed(work, items))


@cache
def _one_thread() -> None:
    """Limit BLAS for good: tasks of one process may overlap, so that none may give the threads back."""
    one_thread()


def _timed(work: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[R, float]]:
    for item in items:
        start = time.perf_counter()
        result = work(item)
        yield result, time.perf_counter() - start
