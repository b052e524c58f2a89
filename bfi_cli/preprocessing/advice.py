"""What would let an inconclusive window tell: inputs that the log has or lacks, and what may be left unanswered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..config import Config
from ..errors import LogError
from ..faults import Decision, Fault
from ..flightlog import FlightLog
from ..flightlog.phases import phases_of
from ..flightlog.quality import advice_on_windows
from ..notes import Note
from ..shapes import Kind
from .window import TRUSTED

__all__ = ["require_one_trim", "what_would_help"]

# Each has a trim of its own; take-off and landing are too short to hold a dictionary.
TRIMS = ("climb", "cruise", "descent", "approach")

# Of the trusted inputs those that shorten the tail of healthy windows most, wherever they are recorded.
FIRST = ("pitch", "longitudinal_acc")


def require_one_trim(window: FlightLog, faults: Sequence[Fault], config: Config) -> None:
    """Refuse a long window that goes on, after the last onset of a dictionary, for phases as long as all its onsets.

    A model of one trim describes one of them, and what it leaves of the others looks like a fault.

    Parameters
    ----------
    faults : of the dictionary, on the axis of the window.

    Raises
    ------
    LogError : naming windows to take.
    """
    if (advice := advice_on_windows(window, whole=False)) is None:
        return
    start_s, stop_s = float(window.time_s[0]), float(window.time_s[-1])
    last_s = max((one.onset_s for one in faults if start_s <= one.onset_s <= stop_s), default=start_s)
    later = [
        one.phase
        for one in phases_of(window, suspects=config.outputs)
        if one.phase in TRIMS and one.from_s > last_s and one.to_s - one.from_s > last_s - start_s
    ]
    if later:
        raise LogError(
            f"{window.path}: {advice}; after {last_s:.6g} s, where the last entry of the dictionary begins, come "
            f"{len(later)} phases ({', '.join(dict.fromkeys(later))}) that a model of one trim does not describe; give "
            "--from and --to within one of them"
        )


def what_would_help(log: FlightLog, config: Config, verdicts: Mapping[Kind, Decision]) -> Note | None:
    """Return advice on what would answer the kinds that are inconclusive, None where none is.

    Parameters
    ----------
    log : with all its channels.
    config : with the inputs in use.
    """
    left = [kind for kind, verdict in verdicts.items() if verdict == "inconclusive"]
    if not left:
        return None
    unused = [name for name in TRUSTED if name not in (*config.inputs, *config.outputs)]
    here = [name for name in unused if name in log.channels]
    missing = [name for name in FIRST if name in unused and name not in log.channels]
    said = []
    if any(name in here for name in FIRST):
        said.append("add " + " ".join(f"--input {name}" for name in FIRST if name in here))
    elif here:
        said.append("try --input auto, which adds " + ", ".join(here))
    if missing:
        said.append(f"record {' and '.join(missing)}")
    if "oscillating" in left:
        said.append("choose a longer window")
    if "abrupt" in left and not here and not missing:
        said.append("choose a window with less turbulence and a manoeuvre")
    decided = [kind for kind in verdicts if kind not in left]
    if left == ["slow"] and decided:
        said.append(f"or ask only for what the log can tell (--require {','.join(decided)})")
    return Note.advice(f"what would help with {', '.join(left)} faults: {'; '.join(said)}") if said else None
