"""One thread of linear algebra: more change the bits."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from functools import lru_cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Give linear algebra one thread, from now on or, used as a context, until its end."""
    others = sum(not name.startswith(__package__) for name in sys.modules)
    limited: AbstractContextManager[object] = _libraries(others).limit(limits=1)
    return limited


@lru_cache(maxsize=1)
def _libraries(n_other_modules: int) -> ThreadpoolController:
    """Return the libraries in memory: two milliseconds to look for, and none is added but by an import of others."""
    return ThreadpoolController()
