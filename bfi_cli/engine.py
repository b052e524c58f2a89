"""Many independent calls of one function: here, on processes, or on a Dask cluster, with the same results in any case.

Every worker has one BLAS thread, for more change the bits; results come in the order of the items.
"""

from __future__ import annotations

import signal
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from itertools import islice
from multiprocessing import get_context
from typing import Any, Protocol, TypeVar

from threadpoolctl import threadpool_limits

from .errors import SweepError

T = TypeVar("T")
R = TypeVar("R")

# Items sent to a worker at a time, and chunks under way per worker: enough that none waits for the next, and few enough
# that an interruption, which waits for those under way, comes soon. Chosen without a tuning record.
CHUNK, AHEAD = 10, 4
# Seconds in which a Dask scheduler must answer.
CONNECT_S = 10


class _Future(Protocol):
    def result(self) -> Any: ...


def in_order(
    work: Callable[[T], R], items: Sequence[T], *, workers: int = 1, scheduler: str | None = None, chunk: int = CHUNK
) -> Generator[tuple[R, float], None, None]:
    """Yield `work(item)` and the seconds it took, in the order of the items.

    Parameters
    ----------
    work : a function of a module; it, the items and the results are pickled where there are several workers.
    workers : processes of this machine; 1 stays in this one.
    scheduler : address of a Dask scheduler, which then has the workers.
    chunk : items sent to a worker at a time; an interruption waits for those under way.

    Raises
    ------
    SweepError : a worker died, the cluster cannot be reached, or `distributed` is not installed.
    """
    chunks = [items[start : start + chunk] for start in range(0, len(items), chunk)]
    if scheduler is not None:
        return _on_dask(work, chunks, scheduler)
    return _here(work, items) if workers == 1 else _on_processes(work, chunks, workers)


def _here(work: Callable[[T], R], items: Sequence[T]) -> Generator[tuple[R, float], None, None]:
    with threadpool_limits(1):
        yield from _timed(work, items)


def _on_processes(
    work: Callable[[T], R], chunks: Sequence[Sequence[T]], workers: int
) -> Generator[tuple[R, float], None, None]:
    # Interrupts are left to the parent.
    ignored = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(workers, get_context("spawn"), initializer=signal.signal, initargs=ignored)
    try:
        yield from _ordered(lambda chunk: pool.submit(_in_worker, work, chunk), chunks, AHEAD * workers)
    except BrokenProcessPool:
        raise SweepError(
            f"--workers {workers}: a worker was ended from outside, perhaps for want of memory; continue with "
            "--resume and fewer --workers"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


def _on_dask(
    work: Callable[[T], R], chunks: Sequence[Sequence[T]], scheduler: str
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
                f"--scheduler {scheduler}: a part of the sweep killed its workers, perhaps for want of memory; "
                "continue with --resume and larger workers"
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
    threadpool_limits(1)


def _timed(work: Callable[[T], R], items: Sequence[T]) -> Iterator[tuple[R, float]]:
    for item in items:
        start = time.perf_counter()
        result = work(item)
        yield result, time.perf_counter() - start
