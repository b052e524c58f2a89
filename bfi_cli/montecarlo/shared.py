"""Trials that share a record share its factorisation: a fault added to the record recombines columns of the factor.

This holds for the published method on one record without added noise, at the record's own rate. The scaled problem of
the faulty record then follows from that of the clean one: centre and scale of the output alone depend on the fault.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import BfiError
from ..identify.risro import declared
from ..preprocessing.rank_one import decides_by_rule, solve
from ..preprocessing.regression import RegressionData
from ..preprocessing.window import prepare_window, regression_of
from .flight import is_shared, record_of
from .scenarios import Setting

__all__ = ["SharedRecord", "declared_magnitudes", "shared_record"]

FloatArray = NDArray[np.float64]

KEPT_FACTORS = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SharedRecord:
    """A clean record, factorised.

    Attributes
    ----------
    names : of the atoms, all of which the window shows.
    regression : of the clean record.
    """

    names: tuple[str, ...]
    regression: RegressionData


@lru_cache(maxsize=KEPT_FACTORS)
def shared_record(setting: Setting) -> SharedRecord | None:
    """Return the factorised record of a setting; None where its trials must be solved one by one."""
    config = setting.config
    published = config.method in ("risro", "risro-as-published") and decides_by_rule(config)
    asked = published and config.conditioning.rate_hz == "none" and config.model.order != "auto"
    silent = all(sd == 0.0 for _, sd in setting.noise)
    if not (asked and silent and is_shared(setting) and len(config.outputs) == 1):
        return None
    try:
        window = prepare_window(record_of(setting, np.random.default_rng(0)), setting.dictionary, config)
        regression = regression_of(window, config)
    except BfiError:
        return None
    return None if window.reasons else SharedRecord(names=window.names, regression=regression)


def declared_magnitudes(shared: SharedRecord, truth: FloatArray, setting: Setting) -> FloatArray:
    """Return (n_atoms,) the magnitudes that the published rule declares, 0 where it declares none.

    Parameters
    ----------
    truth : (n_atoms,) magnitudes of the faults in the record.
    """
    faulty = shared.regression.with_fault(truth)
    solution = solve(faulty.data, setting.config)
    z = solution.z * faulty.magnitude_unit
    return np.where(declared(solution, z, setting.config), z, 0.0)
