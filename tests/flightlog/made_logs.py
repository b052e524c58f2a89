"""Logs and log files made up for the tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import ArrayLike

from bfi_cli.flightlog.record import Channel, FlightLog, frozen_array


def made_log(time_s: ArrayLike, units: Mapping[str, str] | None = None, **signals: ArrayLike) -> FlightLog:
    """Return a log of these signals, in m/s where `units` does not say otherwise."""
    units = units or {}
    channels = {
        name: Channel(name=name, values=frozen_array(values), unit=units.get(name, "m/s"), source=name)
        for name, values in signals.items()
    }
    return FlightLog(path="made.h5", time_s=frozen_array(time_s), channels=channels)


def write_hdf5(path: Path, group: str | None = None, **signals: ArrayLike) -> Path:
    """Write datasets without units into the root or a group of an HDF5 file."""
    with h5py.File(path, "a") as file:
        node = file if group is None else file.require_group(group)
        for name, values in signals.items():
            node[name] = np.asarray(values)
    return path


def write_text(path: Path, text: str) -> Path:
    """Write text and return the path."""
    path.write_text(text, encoding="utf-8")
    return path
