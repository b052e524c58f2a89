"""The result of the scan over all onsets, the dictionary it proposes, and its comparison with injected faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..dictionary import Dictionary
from ..faults import Decision, Fault, FaultEstimate
from ..identify.result import AgainstTruth
from ..preprocessing.summary import LogSummary, ModelSummary
from ..report.text import instant

__all__ = [
    "CalibrationUse",
    "OnsetFault",
    "OnsetResult",
    "OnsetSeries",
    "ShapeProfile",
    "compare_with_injected",
    "propose_dictionary",
]

FloatArray = NDArray[np.float64]

# What the proposed dictionary is called where a file would be named.
DICTIONARY_NAME = "onset scan"


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationUse:
    """Which null distribution the decision rests on.

    Attributes
    ----------
    source : "shipped", "self", "gaussian", or the path of a table.
    matches : it was made for the settings in use.
    n_windows : fault-free windows, or trials, behind it.
    """

    source: str
    matches: bool
    n_windows: int


@dataclass(frozen=True, slots=True, kw_only=True)
class OnsetFault:
    """One fault; times on the log's axis.

    Attributes
    ----------
    estimate : shape, times, magnitude.
    onset_ci95 : earliest and latest onset that the likelihood profile admits.
    statistic : of its shape, the faults before it taken off.
    p_value : None where no calibration fits.
    """

    estimate: FaultEstimate
    onset_ci95: tuple[float, float]
    statistic: float
    p_value: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShapeProfile:
    """One shape over all onsets, before any fault is taken off; arrays (n_onsets,).

    Attributes
    ----------
    frequency_hz : the best, None where the shape has none.
    threshold : of the statistic, None where the method has none.
    """

    shape: str
    channel: str
    unit: str
    frequency_hz: float | None
    onset_s: FloatArray
    statistic: FloatArray
    magnitude: FloatArray
    sd: FloatArray
    threshold: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnsetSeries:
    """One output along time, arrays (n_samples,) in `unit`.

    Attributes
    ----------
    measured, corrected : conditioned, and less the faults found.
    plain_alarms_s : where the plain 5-sigma test on the residual of the fault-free model fires; plain_sd : its sigma.
    """

    channel: str
    unit: str
    measured: FloatArray
    corrected: FloatArray
    plain_alarms_s: tuple[float, ...]
    plain_sd: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnsetResult:
    """The whole answer of `bfi start-time`.

    Attributes
    ----------
    statistic, threshold : of the shape that stands out most, 2 log of the likelihood ratio.
    p_value : of the largest standardised statistic; None where no calibration fits.
    time_s : (n_samples,) of the series.
    truth : injected faults the log states, times on its axis; None where it states none.
    """

    log: LogSummary
    decision: Decision
    false_alarm: float
    p_value: float | None
    statistic: float
    threshold: float | None
    calibration: CalibrationUse | None
    faults: tuple[OnsetFault, ...]
    model: ModelSummary
    method: str
    profiles: tuple[ShapeProfile, ...]
    time_s: FloatArray
    series: tuple[OnsetSeries, ...]
    truth: tuple[Fault, ...] | None
    notes: tuple[str, ...]


def propose_dictionary(result: OnsetResult) -> Dictionary:
    """Return the faults that the scan declared; where it declared none, every shape of known form at its best onset."""
    atoms = [one.estimate.fault for one in result.faults]
    if not atoms:
        for profile in result.profiles:
            if profile.shape in ("bias", "drift", "sine"):
                onset_s = float(profile.onset_s[profile.statistic.argmax()])
                atoms.append(
                    Fault(
                        shape=profile.shape,
                        channel=profile.channel,
                        onset_s=onset_s,
                        frequency_hz=profile.frequency_hz,
                        name=f"{profile.shape}_{instant(onset_s)}",
                    )
                )
    if len({atom.name for atom in atoms}) < len(atoms):
        atoms = [replace(atom, name=f"{atom.name}_{i}") for i, atom in enumerate(atoms, 1)]
    return Dictionary(atoms=tuple(atoms), relative_to="log", sha256="", path=DICTIONARY_NAME)


def compare_with_injected(
    plain: AgainstTruth, declared: Sequence[FaultEstimate], true: Sequence[Fault], *, tolerance_s: float
) -> AgainstTruth:
    """Compare with the injected faults: one is isolated where a declared one has its shape, its channel and its onset.

    Parameters
    ----------
    plain : the comparison that asks for the very same signal, which an estimated onset or frequency never is.
    tolerance_s : onsets that differ by no more are the same.
    """
    partner: dict[int, int] = {}
    for i, fault in enumerate(true):
        for j, one in enumerate(declared):
            same = (one.fault.shape, one.fault.channel) == (fault.shape, fault.channel)
            if same and abs(one.fault.onset_s - fault.onset_s) <= tolerance_s:
                partner[i] = j
                break
    isolated = set(partner.values())
    missed = tuple(f"{fault.shape}_{instant(fault.onset_s)}" for i, fault in enumerate(true) if i not in partner)
    extra = tuple(one.name for j, one in enumerate(declared) if j not in isolated)
    error = None
    if true and not missed and not extra and len(isolated) == len(true):
        sizes = np.array([[abs(declared[j].magnitude), abs(true[i].magnitude)] for i, j in partner.items()])
        error = float(np.linalg.norm(sizes[:, 0] - sizes[:, 1]) / np.linalg.norm(sizes[:, 1]))
    return replace(plain, isolated=not missed and not extra, false_alarms=extra, missed=missed, magnitude_error=error)
