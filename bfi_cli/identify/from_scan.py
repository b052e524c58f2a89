"""Identification without a dictionary: the onset scan proposes the faults."""

from __future__ import annotations

from dataclasses import fields, replace

from ..config import Config, merge
from ..dictionary import Dictionary
from ..flightlog import FlightLog
from ..kernels.progress import Progress, unseen
from ..onset import find_onset, propose_dictionary
from ..truth import Comparison, compare_by_onset
from .identify import identify_faults
from .result import IdentifyResult

__all__ = ["identify_from_scan"]

# Samples by which an estimated onset may miss the injected one: one for the estimate, half a one for the resampling.
# Chosen without a tuning record; only the comparison with an injected truth depends on it.
ONSET_SAMPLES = 1.5


def identify_from_scan(
    log: FlightLog, config: Config, progress: Progress = unseen
) -> tuple[IdentifyResult, Dictionary]:
    """Identify the faults that the onset scan proposes, and return them with the dictionary they make.

    Where the scan declares none, the candidates are each shape at its most suspicious onset. The evidence asked for is
    then that of the scan, so that the result says how large each shape would have had to be.

    Raises
    ------
    LogError, ConfigError : see `bfi_cli.onset.find_onset` and `bfi_cli.identify.identify_faults`.
    """
    scanned = find_onset(log, merge(config, {"method": "ml"}), progress)
    dictionary = propose_dictionary(scanned)
    if scanned.faults:
        said = f"no dictionary: {len(scanned.faults)} found by the onset scan; their onsets are taken as known here"
    else:
        highest = max(profile.threshold or 0.0 for profile in scanned.profiles)
        config = merge(config, {"selection.evidence": highest, "method": "ml"})
        said = (
            f"no dictionary: the onset scan finds no fault at a false-alarm rate of {100.0 * scanned.false_alarm:.3g} "
            "%; the candidates are each shape at its most suspicious onset"
        )
    result = identify_faults(log, dictionary, config, progress)
    notes = (said, *scanned.notes, *(note for note in result.notes if note not in scanned.notes))
    truth = result.truth
    if truth is not None:  # it asks for the very same signal, which an estimated onset or frequency never gives
        tolerance_s = ONSET_SAMPLES / result.log.rate_hz
        comparison = compare_by_onset(result.faults, scanned.truth or (), tolerance_s=tolerance_s)
        truth = replace(truth, **{field.name: getattr(comparison, field.name) for field in fields(Comparison)})
    return replace(result, notes=notes, truth=truth), dictionary
