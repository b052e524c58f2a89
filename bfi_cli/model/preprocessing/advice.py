"""What would answer the kinds of fault that an analysis leaves open: channels to record, or a command that works."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path

from ...config import Config
from ...dictionary import is_shipped
from ...faults import Decision
from ...faults.shapes import Kind
from ...flightlog import FlightLog
from ...flightlog.phases import airborne_stretches
from ...notes import Note
from ...quantities.channels import channel_in_words
from ...quantities.text import instant
from .window import TRUSTED

# FIRST: inputs that shorten the tail of healthy windows most, wherever they are recorded.
FIRST = ("pitch", "longitudinal_acc")
# WIDER_S [s]: by how much a window is begun earlier and ended later; half of that of the shipped tables.
WIDER_S = 60.0


def what_would_help(
    log: FlightLog, config: Config, verdicts: Mapping[Kind, Decision], *, dictionary: str | None = None
) -> Note | None:
    """Return advice on what would answer the kinds that are inconclusive, None where none is.

    Parameters
    ----------
    log : with all its channels.
    config : with the inputs in use.
    dictionary : path of the dictionary of an identification, which may be no file; None of a search over all onsets.
    """
    left = [kind for kind, verdict in verdicts.items() if verdict == "inconclusive"]
    if not left:
        return None
    unused = [name for name in TRUSTED if name not in (*config.inputs, *config.outputs)]
    here = [name for name in unused if name in log.channels]
    missing = [name for name in FIRST if name in unused and name not in log.channels]
    decided = [kind for kind in verdicts if kind not in left]
    wider = _wider(log, config) if "oscillating" in left else ()
    options: tuple[str, ...] = ()
    if here:
        why, options = f"take {', '.join(here)} as inputs too", ("--input", "auto")
    elif wider:
        why, options = "take a longer window", wider
    elif left == ["slow"] and decided:
        why, options = "ask only for what the log can tell", ("--require", ",".join(decided))
    helps = [f"record {' and '.join(channel_in_words(name) for name in missing)}"] if missing else []
    if "oscillating" in left and not wider:
        helps.append("record for longer")
    if "abrupt" in left and not here and not missing:
        helps.append("take a window with less turbulence and a manoeuvre")
    if options:
        helps.append(f"{'or ' if helps else ''}{why}: {_again(log, config, options, dictionary)}")
    return Note.advice(f"for {', '.join(left)} faults: {', '.join(helps)}") if helps else None


def _wider(log: FlightLog, config: Config) -> tuple[str, ...]:
    """Return the options of a longer window within the same flight, none where the log has no more of it."""
    from_s, to_s = log.ends(config.window.from_s, config.window.to_s)
    flown = [(low, high) for low, high in airborne_stretches(log) if low <= from_s and to_s <= high]
    if not flown:
        return ()
    low, high = max(flown[0][0], from_s - WIDER_S), min(flown[0][1], to_s + WIDER_S)
    is_longer = (high - low) - (to_s - from_s) >= WIDER_S
    return ("--from", instant(low), "--to", instant(high)) if is_longer else ()


def _again(log: FlightLog, config: Config, options: tuple[str, ...], dictionary: str | None) -> str:
    """Return the command line that asks anew with other options, these alone for a log that is no file.

    Its configuration, dictionary, outputs and window are those in use.
    """
    if not Path(log.path).is_file():
        return " ".join(options)
    words = ["bfi", "start-time" if dictionary is None else "identify", log.path]
    words += ["--config", config.path] if config.path else []
    words += ["-d", dictionary] if dictionary and (is_shipped(dictionary) or Path(dictionary).is_file()) else []
    if config.outputs != Config().outputs:
        words += [word for name in config.outputs for word in ("--output", name)]
    for option, at_s in (("--from", config.window.from_s), ("--to", config.window.to_s)):
        words += [] if at_s is None or option in options else [option, instant(at_s)]
    return shlex.join([*words, *options])
