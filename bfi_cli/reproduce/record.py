"""What reproductions of the thesis start from: its record, or what stands in for it, and its dictionary."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..aircraft import find_model, manoeuvre, simulate, time_axis
from ..dictionary import Dictionary, load_dictionary
from ..errors import LogError
from ..flightlog import FlightLog
from .settings import Settings

__all__ = ["FOLDER", "stand_in", "thesis_dictionary", "thesis_record"]

FOLDER = Path(__file__).parent
NOT_PUBLIC = (
    "The flight record of the thesis is not public: in its place stands a simulated 3-2-1-1 of the linear Citation "
    "model that it prints (equation 5-4), with as many samples at the same rate; --log takes any other record."
)


def thesis_record(settings: Settings) -> FlightLog:
    """Return the log of the settings, or without one 3172 samples at 100 Hz of the linear Citation, free of noise.

    Raises
    ------
    LogError : the log carries injected faults, or lacks elevator or tas.
    """
    log = settings.log
    if log is None:
        time_s = time_axis(duration_s=31.72, rate_hz=100.0)
        return simulate(find_model("citation"), manoeuvre("3211", time_s), rng=np.random.default_rng(0), rate_hz=100.0)
    if log.truth is not None and log.truth.faults:
        raise LogError(
            f"{log.path}: --log: a reproduction adds its own faults, got a log with {len(log.truth.faults)} injected; "
            "give the fault-free one"
        )
    log.signals(("elevator", "tas"))
    return log


def thesis_dictionary() -> Dictionary:
    """Return the seven signals of table 5-2."""
    return load_dictionary(FOLDER / "thesis_dictionary.yaml")


def stand_in(settings: Settings) -> tuple[str, ...]:
    """Return the note that the record is not the thesis's own, none where the user gave a log."""
    return (NOT_PUBLIC,) if settings.log is None else ()
