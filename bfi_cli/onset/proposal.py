"""The dictionary that a scan proposes, and how near what was identified of it comes to the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..dictionary import Dictionary
from ..faults import Fault, FaultEstimate
from ..identify.result import AgainstTruth
from ..wording import instant
from .result import OnsetResult, ShapeProfile

__all__ = ["NAME", "compared", "proposed"]

NAME = "onset scan"


def proposed(result: OnsetResult) -> Dictionary:
    """Return the faults that the scan declared; where it declared none, every shape of known form at its best onset."""
    atoms = tuple(one.estimate.fault for one in result.faults) or tuple(
        _strongest(profile) for profile in result.profiles if profile.shape in ("bias", "drift", "sine")
    )
    names = [atom.name for atom in atoms]
    if len(set(names)) < len(names):
        atoms = tuple(_numbered(atom, i) for i, atom in enumerate(atoms, 1))
    return Dictionary(atoms=atoms, relative_to="log", sha256="", path=NAME)


def _strongest(profile: ShapeProfile) -> Fault:
    onset_s = float(profile.onset_s[profile.statistic.argmax()])
    return Fault(
        shape=profile.shape,
        channel=profile.channel,
        onset_s=onset_s,
        frequency_hz=profile.frequency_hz,
        name=f"{profile.shape}_{instant(onset_s)}",
    )


def _numbered(atom: Fault, i: int) -> Fault:
    return replace(atom, name=f"{atom.name}_{i}")


def compared(
    plain: AgainstTruth, declared: Sequence[FaultEstimate], true: Sequence[Fault], *, tolerance_s: float
) -> AgainstTruth:
    """Compare with the injected faults: one is found where a declared one has its shape, its channel and its onset.

    Parameters
    ----------
    plain : the comparison that asks for the very same signal, which an estimated onset or frequency never is.
    tolerance_s : onsets that differ by no more are the same.
    """
    partner = {i: _partner(fault, declared, tolerance_s) for i, fault in enumerate(true)}
    found = {j for j in partner.values() if j is not None}
    missed = tuple(f"{fault.shape}_{instant(fault.onset_s)}" for i, fault in enumerate(true) if partner[i] is None)
    extra = tuple(one.name for j, one in enumerate(declared) if j not in found)
    error = None
    if true and not missed and not extra and len(found) == len(true):
        sizes = np.array(
            [[abs(declared[j].magnitude), abs(true[i].magnitude)] for i, j in partner.items() if j is not None]
        )
        error = float(np.linalg.norm(sizes[:, 0] - sizes[:, 1]) / np.linalg.norm(sizes[:, 1]))
    return replace(plain, isolated=not missed and not extra, false_alarms=extra, missed=missed, magnitude_error=error)


def _partner(fault: Fault, declared: Sequence[FaultEstimate], tolerance_s: float) -> int | None:
    for j, one in enumerate(declared):
        same = (one.fault.shape, one.fault.channel) == (fault.shape, fault.channel)
        if same and abs(one.fault.onset_s - fault.onset_s) <= tolerance_s:
            return j
    return None
