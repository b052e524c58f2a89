"""Add known faults to a log and keep the truth beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import DictionaryError
from ..faults import Fault, active_samples, unit_signal
from .record import FlightLog, Truth, frozen_array

__all__ = ["inject"]


def inject(log: FlightLog, faults: Sequence[Fault]) -> FlightLog:
    """Return `log` with `faults` added to their channels, in that order, and the truth extended by them.

    Times of the faults are on the log's own time axis; a `phase_reference` of "window" counts from its first sample.
    Injecting into a log that carries faults already keeps these; the clean signals stay those before the first one.
    `notes` names a fault that has neither onset nor end in the log.

    Raises
    ------
    LogError : the log has no such channel.
    DictionaryError : a fault is zero at every sample of the log, or its signal cannot be made.
    """
    for fault in faults:
        log = _with_fault(log, fault)
    return log


def _with_fault(log: FlightLog, fault: Fault) -> FlightLog:
    channel = log.channel(fault.channel)
    fault = _from_onset(replace(fault, channel=channel.name), float(log.time_s[0]))
    added = fault.magnitude * unit_signal(fault, log.time_s, window_start_s=float(log.time_s[0]))
    if not np.any(added):
        raise DictionaryError(_never_active(log, fault))
    before = log.truth or Truth(faults=())
    truth = Truth(faults=(*before.faults, fault), clean={channel.name: channel.values, **before.clean})
    faulty = replace(channel, values=frozen_array(channel.values + added))
    channels = {**log.channels, channel.name: faulty}
    return replace(log, channels=channels, truth=truth, sha256="", notes=(*log.notes, *_remarks(log, fault)))


def _from_onset(fault: Fault, start_s: float) -> Fault:
    """Count the phase from the onset, so that the truth stays true where the log is cut."""
    if fault.phase_reference == "onset" or fault.frequency_hz is None:
        return fault
    phase = fault.phase_rad + 2.0 * math.pi * fault.frequency_hz * (fault.onset_s - start_s)
    return replace(fault, phase_reference="onset", phase_rad=phase % (2.0 * math.pi))


def _remarks(log: FlightLog, fault: Fault) -> tuple[str, ...]:
    if not active_samples(fault, log.time_s).all():
        return ()
    return (
        f"fault '{fault.name or fault.shape}' on {fault.channel} acts at every sample of the log; "
        "with neither onset nor end in it, it can pass for the aircraft's own motion",
    )


def _never_active(log: FlightLog, fault: Fault) -> str:
    until = "" if fault.offset_s is None else f" until {fault.offset_s:g} s"
    return (
        f"{log.path}: fault '{fault.name or fault.shape}': never active in the log, got magnitude {fault.magnitude:g} "
        f"from {fault.onset_s:g} s{until}, the log runs from {log.time_s[0]:g} s to {log.time_s[-1]:g} s; "
        "change onset, offset or magnitude"
    )
