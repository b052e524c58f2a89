"""Trials that share a record share its factorisation: a fault added to the record recombines columns of the factor.

This holds for the published method on one record without added noise, at the record's own rate. The scaled problem of
the faulty record then follows from that of the clean one: centre and scale of the output alone depend on the fault.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..errors import BfiError
from ..identify.published import declared, solve
from ..kernels.lagged import Compressed, with_fault
from ..study import Study, study_of, take_in
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
    study : of the clean record.
    y : (n_samples,), theta : (n_samples, n_atoms) in SI.
    centred : whether the mean is taken off.
    """

    names: tuple[str, ...]
    study: Study
    y: FloatArray
    theta: FloatArray
    centred: bool


@lru_cache(maxsize=KEPT_FACTORS)
def shared_record(setting: Setting) -> SharedRecord | None:
    """Return the factorised record of a setting; None where its trials must be solved one by one."""
    config = setting.config
    asked = config.method == "risro" and config.conditioning.rate_hz == "none" and config.model.order != "auto"
    silent = all(sd == 0.0 for _, sd in setting.noise)
    if not (asked and silent and is_shared(setting) and len(config.outputs) == 1):
        return None
    try:
        intake = take_in(record_of(setting, np.random.default_rng(0)), setting.dictionary, config)
        study = study_of(intake.log.path, intake.conditioned, intake.live, config)
    except BfiError:
        return None
    if intake.reasons:
        return None
    return SharedRecord(
        names=intake.names,
        study=study,
        y=intake.conditioned.y[:, 0],
        theta=intake.conditioned.theta[:, 0],
        centred=config.conditioning.detrend == "constant",
    )


def declared_magnitudes(shared: SharedRecord, truth: FloatArray, setting: Setting) -> FloatArray:
    """Return (n_atoms,) the magnitudes that the published rule declares, 0 where it declares none.

    Parameters
    ----------
    truth : (n_atoms,) magnitudes of the faults in the record.
    """
    data, magnitude_unit = _faulty(shared, truth)
    solution = solve(data, setting.config)
    z = solution.z * magnitude_unit
    return np.where(declared(solution, z, setting.config), z, 0.0)


def _faulty(shared: SharedRecord, truth: FloatArray) -> tuple[Compressed, FloatArray]:
    """Return the factor of the faulty record, scaled as it would be by itself, and its unit of magnitudes."""
    study = shared.study
    y = shared.y + shared.theta @ truth
    unit = float(np.std(y)) or 1.0
    center = float(y.mean()) if shared.centred else 0.0
    before = float(study.unit[0])
    data = with_fault(study.data, truth / study.magnitude_unit)
    R, columns = data.R.copy(order="F"), data.columns
    shift = R[:, columns.ones] * ((float(study.center[0]) - center) / unit)
    for place in (columns.y_lags, columns.y):
        R[:, place] = R[:, place] * (before / unit) + shift
    R.setflags(write=False)
    norms = np.linalg.norm(R, axis=0)
    scales = np.where(norms > np.finfo(float).eps * norms.max(), norms, 1.0)
    return replace(data, R=R, scales=scales), study.magnitude_unit * (unit / before)
