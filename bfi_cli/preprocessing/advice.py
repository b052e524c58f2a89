"""What would let an inconclusive window tell: inputs that the log has or lacks, and what may be left unanswered."""

from __future__ import annotations

from collections.abc import Mapping

from ..config import Config
from ..faults import Decision
from ..flightlog import FlightLog
from ..shapes import Kind
from .window import TRUSTED

__all__ = ["what_would_help"]

# Of the trusted inputs those that shorten the tail of healthy windows most, wherever they are recorded.
FIRST = ("pitch", "longitudinal_acc")


def what_would_help(log: FlightLog, config: Config, verdicts: Mapping[Kind, Decision]) -> str | None:
    """Return a sentence on what would answer the kinds that are inconclusive, None where none is.

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
    return f"what would help with {', '.join(left)} faults: {'; '.join(said)}" if said else None
