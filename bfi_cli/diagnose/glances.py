"""The scan for steps and oscillations over the flight, its windows on all cores."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial

import numpy as np

from ..config import Config, merge
from ..engine import in_order
from ..errors import BfiError
from ..flightlog import FlightLog
from ..kernels.progress import Report, silent
from ..onset.glance import Glance, glance
from ..parity.windows import Window
from ..preprocessing.window import TRUSTED

# Windows of this length and step: with a quarter of overlap a step lies 15 s inside of one of them.
GLANCE_S, STEP_S = 120.0, 90.0
# The inputs of the shipped tables: the surface, and what bounds the airspeed whatever the surface does.
INPUTS = ("elevator", "pitch", "longitudinal_acc")
CHUNK = 4  # windows that a worker takes at once; for the speed only
FEWEST_FOR_WORKERS = 8  # a worker takes a second to start


def inputs_for(log: FlightLog) -> tuple[str, ...]:
    """Return those of the inputs that the log has and that move."""
    return tuple(
        name
        for name in INPUTS
        if name in log.channels and float(np.ptp(np.nan_to_num(log.channels[name].values))) > 0.0
    )


def glance_at_flight(
    log: FlightLog, windows: Sequence[Window], config: Config, *, workers: int = 1, report: Report = silent
) -> list[tuple[Window, Glance | str]]:
    """Return what stands out in every window, or why it could not be analysed.

    Parameters
    ----------
    config : with inputs and outputs.
    """
    # What stands out is confirmed with the other trusted channels.
    names = dict.fromkeys((*config.inputs, *config.outputs, *(name for name in TRUSTED if name in log.channels)))
    slim = replace(log, channels={name: log.channels[name] for name in names}, truth=None, notes=())
    parts = [slim.window(from_s, to_s) for from_s, to_s in windows]
    whole = merge(config, {"window": {"from_s": None, "to_s": None}})
    found: list[tuple[Window, Glance | str]] = []
    workers = workers if len(parts) >= FEWEST_FOR_WORKERS else 1
    with closing(in_order(partial(_glance_in, config=whole), parts, workers=workers, chunk=CHUNK)) as results:
        for window, (answer, _) in zip(windows, results, strict=True):
            found.append((window, answer))
            report(len(found) / len(parts))
    return found


def _glance_in(part: FlightLog, *, config: Config) -> Glance | str:
    try:
        return glance(part, config)
    except BfiError as unusable:
        return str(unusable)


def summary_of(found: Sequence[tuple[Window, Glance | str]]) -> Mapping[str, int]:
    """Return how many windows failed for each reason."""
    return Counter(answer for _, answer in found if isinstance(answer, str))
