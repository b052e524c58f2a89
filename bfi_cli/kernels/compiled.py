"""Routines of LAPACK, special functions and `einsum` as they are compiled, without what is imported or done before.

The packages `scipy.linalg` and `scipy.special` import numpy's compiler of Fortran, its tools for tests and all of their
own modules, which takes as long as the analysis of a short log. What is called here are functions of one module of
each. A scipy that lays these out otherwise is imported whole. What numpy does in Python in front of `einsum`
takes longer than most of the small contractions here.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

import scipy

__all__ = ["einsum", "lapack", "part_of_scipy", "special"]


def part_of_scipy(package: str, module: str, whole: str) -> ModuleType:
    """Return a module of a package of scipy, imported without the package.

    Parameters
    ----------
    package : of scipy; module : of it; whole : that which offers the same functions where there is none.
    """
    if f"scipy.{package}" in sys.modules:
        return import_module(whole)
    # The module looks up its neighbours in the package, which stands empty meanwhile.
    empty = ModuleType(f"scipy.{package}")
    empty.__path__ = [f"{folder}/{package}" for folder in scipy.__path__]
    sys.modules[empty.__name__] = empty
    try:
        return import_module(f"scipy.{package}.{module}")
    except ImportError:
        del sys.modules[empty.__name__]
        return import_module(whole)
    finally:
        if sys.modules.get(empty.__name__) is empty:
            del sys.modules[empty.__name__]


if TYPE_CHECKING:
    from numpy import einsum
    from scipy import special
    from scipy.linalg import lapack
else:
    try:
        from numpy._core.multiarray import c_einsum as einsum
    except ImportError:
        from numpy import einsum
    lapack = part_of_scipy("linalg", "_flapack", "scipy.linalg.lapack")
    special = part_of_scipy("special", "_ufuncs", "scipy.special")
