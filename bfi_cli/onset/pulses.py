"""Faults between the conditioned samples: profiles over any start, end and frequency, the filter's smear included.

The scans of the kernels know onsets on samples, and with an end only sharp edges; what that costs is small for finding
a fault and large for measuring an oscillation, whose phase starts at its onset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels import onset_shapes
from ..kernels.onset_scan import scan_shape
from ..kernels.onset_tables import Scan
from ..kernels.progress import Step
from .record import ScanRecord
from .shapes import Form, Place, signal

__all__ = ["Fine", "phases", "pulses", "step_s", "within"]

FloatArray = NDArray[np.float64]

MOST_PHASES = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fine:
    """A profile over onsets between the conditioned samples, `step_s` apart near its maximum."""

    places: tuple[Place, ...]
    onset_s: FloatArray
    z: FloatArray
    sd: FloatArray
    statistic: FloatArray
    step_s: float

    @property
    def best(self) -> int:
        """Index of the largest statistic."""
        return int(np.argmax(self.statistic))


def phases(record: ScanRecord, most: int = MOST_PHASES) -> range:
    """Return the phases, see `shapes.waveform`, at most so many."""
    factor = record.sampling.factor
    return range(0, -factor, -max(1, -(-factor // most)))


def step_s(record: ScanRecord) -> float:
    """Return the time between two neighbouring phases."""
    return -phases(record).step / record.sampling.factor / record.sampling.rate_hz


def pulses(record: ScanRecord, scan: Scan, form: Form, spans: Sequence[tuple[Place, Place | None]], step: Step) -> Fine:
    """Return the profile over starts and ends, in the order given; the starts are its places. Each is a step."""
    sampling = record.sampling
    found = []
    for start, end in spans:
        step()
        first = start[0] - sampling.lead
        samples = np.zeros(sampling.n_samples)
        samples[: sampling.n_samples - first] = signal(form, sampling, start, end)[first:]
        found.append(scan_shape(scan, onset_shapes.sampled(samples), np.array([first])))
    z, sd, statistic = (np.array([getattr(one, name)[0] for one in found]) for name in ("z", "sd", "statistic"))
    places = tuple(start for start, _ in spans)
    onset_s = np.array([record.onset_s(*place) for place in places])
    return Fine(places=places, onset_s=onset_s, z=z, sd=sd, statistic=statistic, step_s=step_s(record))


def within(record: ScanRecord, scan: Scan, places: Sequence[Place]) -> list[Place]:
    """Return the places at which a scan allows an onset, in the order of time."""
    lead, s = record.sampling.lead, scan.order
    kept = [place for place in places if s + lead <= place[0] < scan.n_samples - s]
    return sorted(kept, key=lambda place: record.onset_s(*place))
