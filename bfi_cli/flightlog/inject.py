"""Add known faults to a log and keep the truth beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import DictionaryError
from ..faults import Fault, active_samples
from ..filters import recorded_signal
from ..kernels.low_pass import IDENTITY, Response
from .record import FlightLog, Truth, frozen_array

__all__ = ["inject"]


def inject(log: FlightLog, faults: Sequence[Fault], *, response: Response = IDENTITY) -> FlightLog:
    """Return `log` with `faults` added to their channels, in that order, and the truth extended by them.

    Times of the faults are on the log's own time axis; a `phase_reference` of "window" counts from its first sample.
    Injecting into a log that carries faults already keeps these; the clean signals stay those before the first one.
    `notes` names a fault that has neither onset nor end in the log.

    Parameters
    ----------
    response : of the recorder, through which a fault of the aircraft went; see `bfi_cli.filters.response_of`.

    Raises
    ------
    LogError : the log has no such channel.
    DictionaryError : a fault is zero at every sample of the log, or its signal cannot be made.
    """
    start_s, stop_s = float(log.time_s[0]), float(log.time_s[-1])
    for declared in faults:
        channel = log.channel(declared.channel)
        fault = replace(declared, channel=channel.name)
        if fault.phase_reference != "onset" and fault.frequency_hz is not None:
            # Counted from the onset, so that the truth stays true where the log is cut.
            phase = fault.phase_rad + 2.0 * math.pi * fault.frequency_hz * (fault.onset_s - start_s)
            fault = replace(fault, phase_reference="onset", phase_rad=phase % (2.0 * math.pi))
        name = fault.name or fault.shape
        added = fault.magnitude * recorded_signal(fault, log.time_s, response, window_start_s=start_s)
        if not np.any(added):
            until = "" if fault.offset_s is None else f" until {fault.offset_s:g} s"
            raise DictionaryError(
                f"{log.path}: fault '{name}': never active in the log, got magnitude {fault.magnitude:g} from "
                f"{fault.onset_s:g} s{until}, the log runs from {start_s:g} s to {stop_s:g} s; "
                "change onset, offset or magnitude"
            )
        before, notes = log.truth or Truth(faults=()), log.notes
        if active_samples(fault, log.time_s).all():
            notes += (
                f"fault '{name}' on {fault.channel} acts at every sample of the log; "
                "with neither onset nor end in it, it can pass for the aircraft's own motion",
            )
        faulty = replace(channel, values=frozen_array(channel.values + added))
        truth = Truth(faults=(*before.faults, fault), clean={channel.name: channel.values, **before.clean})
        channels = {**log.channels, channel.name: faulty}
        log = replace(log, channels=channels, truth=truth, sha256="", notes=notes)
    return log
