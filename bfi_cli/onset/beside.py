"""The scan over all onsets beside an analysis that states them: what it sees there, and the limits that it lends.

An entry of a dictionary that begins a second before or after the fault has little in common with it: the signature of a
step is a few samples long. Where onsets are known to a tolerance only, the identification tries each entry within it,
and what could have been missed is told by the scan, which looks at all of them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ..config import Config, merge
from ..errors import ConfigError, LogError
from ..faults import Fault
from ..flightlog import FlightLog
from ..kernels.progress import Progress, unseen
from ..preprocessing.window import must_resample
from ..shapes import Kind
from .detection import search_onsets
from .result import OnsetResult

__all__ = ["scan_beside", "why_not_scanned"]

# A longer record, counted at the rate that is asked for or at 10 Hz, would take minutes.
MOST_SAMPLES, FASTEST_HZ = 20_000, 10.0


def scan_beside(
    window: FlightLog,
    config: Config,
    entries: Sequence[Fault],
    progress: Progress = unseen,
    *,
    kinds: Sequence[Fault] = (),
    claims: Collection[Kind],
    as_measured: FlightLog | None,
) -> OnsetResult | str:
    """Search all onsets of a window beside entries of a dictionary that state theirs, or return why not.

    The calibration is a table that fits or the nearest one: windows of the log itself would take longer than the
    analysis beside which this is done.

    Parameters
    ----------
    window : of the log, less the faults that are known; as_measured : the same with them, None where none is known.
    entries : of the dictionary, on the axis of the window.
    kinds : entries whose onsets are searched; without them every kind is.
    claims : the kinds of fault of which limits are sought, as the dictionary has none of them.
    """
    try:
        known = [name for name in (*config.inputs, *config.outputs) if name in window.channels]
        must_resample(window, known, config.conditioning.rate_hz)
        scanning = merge(config, {"method": "ml", "model.feedthrough": config.feedthrough})
        if config.start_time.calibration == "self":
            scan = scanning.start_time.model_copy(update={"calibration": None})
            scanning = scanning.model_copy(update={"start_time": scan})
        return search_onsets(
            window, scanning, progress, kinds=kinds, entries=entries, claims=claims, as_measured=as_measured
        )
    except (ConfigError, LogError) as problem:
        return f"not scanned for other onsets: {problem}"


def why_not_scanned(window: FlightLog, config: Config, *, exact: bool) -> str | None:
    """Return why a window is not scanned beside an analysis, as far as its length tells; None where it may be."""
    if exact:
        return "not scanned for other onsets: the model explains the log to round-off"
    asked = config.conditioning.rate_hz
    rate_hz = asked if not isinstance(asked, str) else min(window.rate_hz, FASTEST_HZ)
    n_samples = round(window.n_samples / window.rate_hz * (window.rate_hz if asked == "none" else rate_hz))
    if n_samples > MOST_SAMPLES:
        return f"not scanned for other onsets: {n_samples} samples are more than {MOST_SAMPLES}; cut the window"
    return None
