"""One fault reconstructed three ways: the published method, DMAE, and ours (figures 5-5, 5-6, 5-10 to 5-12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..aircraft.citation import CITATION
from ..config import Config
from ..faults import unit_signal
from ..flightlog import FlightLog
from ..identify import identify_faults
from ..identify.dmae import DmaeResult, DmaeSettings, Reference, dmae
from ..onset import find_onset
from ..onset.result import OnsetFault
from ..wording import interval, number
from .answer import declared
from .record import thesis_dictionary
from .settings import Settings
from .thesis_solutions import LISTING, SETTLED, Solved, solved, vaf
from .thesis_threshold import scanning

__all__ = [
    "Reconstruction",
    "by_default",
    "by_dmae",
    "by_published",
    "by_scan",
    "dated",
]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reconstruction:
    """A fault as one method sees it.

    Attributes
    ----------
    time_s, fault : (n_samples,) of the method's own rate, m/s.
    vaf_fault, vaf_output : equation 5-2 in %, the output about its mean.
    found : what is declared, in a few words.
    """

    label: str
    time_s: FloatArray
    fault: FloatArray
    vaf_fault: float
    vaf_output: float
    found: str


def by_published(log: FlightLog, order: int, *, as_listed: bool = False) -> Reconstruction:
    """Return the published method at an order, settled or as its listing runs.

    Raises
    ------
    LogError, ExcitationError, DictionaryError : see `solved`.
    """
    (one,) = solved(log, [order], LISTING if as_listed else SETTLED)
    return Reconstruction(
        label=f"published, s = {order}" + (", as listed" if as_listed else ""),
        time_s=log.time_s,
        fault=one.fault,
        vaf_fault=one.vaf_fault,
        vaf_output=one.vaf_output,
        found=_sizes(one),
    )


def _sizes(one: Solved) -> str:
    z = dict(zip((str(atom.name) for atom in thesis_dictionary().atoms), one.z.tolist(), strict=True))
    return ", ".join(f"{name} {number(z[name], digits=3)}" for name in one.names) or "none"


def by_default(log: FlightLog) -> Reconstruction:
    """Return what `bfi identify` finds by itself.

    Raises
    ------
    LogError, ExcitationError, DictionaryError : see `identify_faults`.
    """
    answer = identify_faults(log, thesis_dictionary(), Config())
    accounted = answer.truth.vaf_fault["tas"] if answer.truth is not None else None
    return Reconstruction(
        label="ours",
        time_s=answer.time_s,
        fault=answer.outputs[0].fault,
        vaf_fault=accounted or 0.0,
        vaf_output=max(0.0, answer.vaf_output["tas"]),
        found=declared(answer),
    )


def by_dmae(log: FlightLog, filters: DmaeSettings, settings: Settings, *, label: str = "DMAE") -> Reconstruction:
    """Return what double-model adaptive estimation makes of a log.

    Parameters
    ----------
    settings : whether the log is the model's own or another aircraft's.

    Raises
    ------
    LogError : the log lacks elevator or tas, or its rate is not uniform.
    """
    assert log.truth is not None
    reference: Reference = "trim" if settings.log is None else "start"
    found = dmae(log, CITATION, reference=reference, settings=filters)
    clean = log.truth.clean[log.channel("tas").name]
    measured = found.measured
    told = found.estimate[:, 0] + found.fault
    return Reconstruction(
        label=label,
        time_s=found.time_s,
        fault=found.fault,
        vaf_fault=vaf(measured - clean, found.fault),
        vaf_output=vaf(measured - measured.mean(), told - measured.mean()),
        found=_alarm(found),
    )


def _alarm(found: DmaeResult) -> str:
    return "no fault" if found.onset_s is None else f"a fault from {found.onset_s:.5g} s"


def by_scan(log: FlightLog, settings: Settings, *, shapes: Sequence[str]) -> Reconstruction:
    """Return what `bfi start-time` finds at 10 Hz without a dictionary, see `scanning`.

    Raises
    ------
    LogError, ExcitationError : see `find_onset`.
    """
    assert log.truth is not None
    with scanning(settings, shapes) as config:
        answer = find_onset(log, config)
    fault = np.zeros(log.n_samples)
    for one in answer.faults:
        signal = unit_signal(one.estimate.fault, log.time_s, window_start_s=float(log.time_s[0]))
        fault += one.estimate.magnitude * signal
    channel = log.channel("tas")
    left = float(answer.model.noise_sd["tas"]) ** 2 / float(np.var(channel.values))
    return Reconstruction(
        label="ours, scan",
        time_s=log.time_s,
        fault=fault,
        vaf_fault=vaf(channel.values - log.truth.clean[channel.name], fault),
        vaf_output=max(0.0, 100.0 * (1.0 - left)),
        found="; ".join(map(dated, answer.faults)) or "none",
    )


def dated(one: OnsetFault) -> str:
    """Return a fault of a scan in words: "drift of 0.25 m/s^2 from 16 s (15.99 to 16.01 s)"."""
    fault = one.estimate.fault
    shape = fault.shape if fault.frequency_hz is None else f"{fault.frequency_hz:.4g} Hz {fault.shape}"
    size = f"{number(one.estimate.magnitude, digits=3)} {one.estimate.unit}".rstrip()
    return f"{shape} of {size} from {fault.onset_s:.5g} s ({interval(one.onset_ci95)} s)"
