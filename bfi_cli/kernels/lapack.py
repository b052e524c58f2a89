"""The routines of LAPACK as scipy holds them, without what else an import of `scipy.linalg` brings along.

That takes a tenth of a second, as long as the analysis of a short log.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from types import ModuleType

import scipy

COMPILED, PUBLIC = "scipy.linalg._flapack", "scipy.linalg.lapack"


def _routines() -> ModuleType:
    """Return the compiled module, or the public one where that is already imported or lies elsewhere."""
    spec = PathFinder.find_spec(COMPILED, [f"{folder}/linalg" for folder in scipy.__path__])
    if COMPILED in sys.modules or spec is None or spec.loader is None:
        return import_module(PUBLIC)
    module = sys.modules[COMPILED] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


lapack = _routines()
