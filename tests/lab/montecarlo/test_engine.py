"""The engine: every item once, in order, on one BLAS thread, wherever it runs."""

from __future__ import annotations

import math
import os
import sys
import time

import pytest
from threadpoolctl import threadpool_info

from bfi_cli.engine import in_order
from bfi_cli.errors import SweepError


def test_items_come_in_order_with_their_seconds():
    done = list(in_order(math.factorial, range(23), chunk=4))
    assert [result for result, _ in done] == [math.factorial(n) for n in range(23)]
    assert all(seconds >= 0.0 for _, seconds in done)
    assert list(in_order(math.factorial, [])) == []


def test_seconds_are_those_of_the_item():
    done = [seconds for _, seconds in in_order(time.sleep, [0.0, 0.05, 0.0])]
    assert done[1] >= 0.05 > max(done[0], done[2])


def test_here_on_one_thread_and_only_then():
    before = [pool["num_threads"] for pool in threadpool_info()]
    ((during, _),) = in_order(lambda _: [pool["num_threads"] for pool in threadpool_info()], [0])
    assert set(during) <= {1}
    assert [pool["num_threads"] for pool in threadpool_info()] == before


def test_a_worker_that_dies_is_an_error():
    with pytest.raises(SweepError, match=r"--workers 2: a worker was ended from outside.*--resume"):
        list(in_order(os._exit, [9] * 3, workers=2))


def test_how_to_go_on_is_what_the_caller_says():
    with pytest.raises(SweepError, match=r"for want of memory; start again and fewer --workers$"):
        list(in_order(os._exit, [9] * 3, workers=2, again="start again"))


@pytest.mark.slow
def test_processes_keep_the_order():
    items = [range(3_000_000), range(2), range(1_000_000), range(4)]
    assert [result for result, _ in in_order(sum, items, workers=2, chunk=1)] == [sum(item) for item in items]


@pytest.mark.slow
def test_no_scheduler_answers(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("bfi_cli.engine.CONNECT_S", 0.2)
    with pytest.raises(SweepError, match=r"--scheduler: no Dask scheduler answers, got 'tcp://127\.0\.0\.1:9'"):
        list(in_order(math.factorial, [1], scheduler="tcp://127.0.0.1:9"))


def test_without_distributed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SweepError, match=r"--scheduler: distributed is not installed; pip install"):
        list(in_order(math.factorial, [1], scheduler="tcp://127.0.0.1:9"))
