"""Flights as LabVIEW would have recorded them, written by npTDMS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

START = np.datetime64("2024-05-01T12:00:00.250")


def write_tdms(
    path: Path,
    tas: np.ndarray,
    elevator: np.ndarray,
    *,
    rate_hz: tuple[float, float] = (10.0, 10.0),
    segments: int = 1,
    text: bool = False,
) -> Path:
    """Write airspeed in kt and elevator in deg as waveforms, each at its rate, in so many segments."""
    nptdms = pytest.importorskip("nptdms")
    channels = {
        "TAS": (tas / (1852.0 / 3600.0), "kt", rate_hz[0]),
        "elevator": (np.rad2deg(elevator), "deg", rate_hz[1]),
    }
    with nptdms.TdmsWriter(str(path)) as writer:
        for k in range(segments):
            parts = [
                waveform("flight", name, np.array_split(values, segments)[k], unit, rate)
                for name, (values, unit, rate) in channels.items()
            ]
            if text:
                parts.append(nptdms.ChannelObject("flight", "remark", ["take-off", "landing"]))
            writer.write_segment(parts)
    return path


def waveform(group: str, name: str, values: np.ndarray, unit: str, rate_hz: float, start: np.datetime64 = START):
    """Return a channel object with the properties of a waveform."""
    nptdms = pytest.importorskip("nptdms")
    properties = {"wf_increment": 1.0 / rate_hz, "wf_start_offset": 0.0, "wf_start_time": start, "unit_string": unit}
    return nptdms.ChannelObject(group, name, values, properties=properties)
