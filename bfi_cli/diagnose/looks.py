"""The scans over a whole flight: the parity scan of every window of every length, and that for steps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..config import Config, merge
from ..engine import in_order
from ..errors import BfiError
from ..flightlog import FlightLog
from ..kernels.progress import Report, silent
from ..onset.glance import Glance, glance
from ..parity import LENGTHS_S, ParityTable, ScanKey, Threshold, WindowScan, table_for, threshold_of
from ..parity.windows import Window, windows_in
from ..preprocessing.window import TRUSTED
from .flight import INPUTS, Flight
from .result import Look

FloatArray = NDArray[np.float64]

# Where a flight shows mostly more than the tables, its thresholds rise. Fewer windows of this length do not say so: a
# fault fills them.
SCALE_S, ENOUGH_WINDOWS = 120.0, 10
# The share of windows that say so: a fault that lasts to the end of a short log is in more than half of them. Both by
# this reasoning; no flight was used to set them.
CALM = 0.25
# Windows of the scan for steps: with a quarter of overlap a step lies 15 s inside of one of them.
GLANCE_S, STEP_S = 120.0, 90.0
CHUNK = 4  # windows that a worker takes at once; for the speed only
FEWEST_FOR_WORKERS = 8  # a worker takes a second to start


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scanned:
    """One window scanned.

    Attributes
    ----------
    statistic, fault, onset_s : the largest ratio, and where it is.
    magnitude, sd : by fault, (n_onsets,) of ramps, with what healthy flight shows beyond the noise models.
    onsets_s : (n_onsets,) of these.
    lasting : faults that began before it, which its statistic leaves out.
    """

    from_s: float
    to_s: float
    residuals: tuple[str, ...]
    lacking: Mapping[str, str]
    knows_zero_lift: bool
    statistic: float
    fault: str
    onset_s: float
    onsets_s: FloatArray
    magnitude: Mapping[str, FloatArray]
    sd: Mapping[str, FloatArray]
    lasting: tuple[str, ...]

    @property
    def length_s(self) -> float:
        return self.to_s - self.from_s

    @property
    def key(self) -> ScanKey:
        """What its statistic depends on."""
        return ScanKey(
            residuals=self.residuals,
            length_s=float(round(self.length_s)),
            knows_zero_lift=self.knows_zero_lift,
            beside=bool(self.lasting),
        )


def rate_of(false_alarm: float, n_windows: int) -> float:
    """Return the rate of false alarms of one window, of `n_windows` of its analysis in a flight.

    However they depend on each other, one of them alarms with a probability of at most the sum of their own. Every
    analysis has an equal share of what a healthy flight may have: the parity scan of each length, and that for steps.

    Parameters
    ----------
    false_alarm : of a whole healthy flight.
    """
    return false_alarm / (len(LENGTHS_S) + 1) / max(n_windows, 1)


def scan_flight(
    flight: Flight, windows: Sequence[Window], *, kept: Sequence[Scanned] = (), report: Report = silent
) -> list[Scanned]:
    """Return the scans of windows in their order; those without a residual are left out.

    Parameters
    ----------
    kept : scans at the same angle of zero lift, used again where the same faults last.
    """
    done = {(one.from_s, one.to_s, one.lasting): one for one in kept}
    found = []
    for k, window in enumerate(windows):
        report(k / len(windows))
        lasting = flight.lasting_in(window)
        if (*window, lasting) in done:
            found.append(done[*window, lasting])
            continue
        scan = flight.scan(window)
        if scan is not None:
            found.append(_reduced(scan, *window, lasting=lasting))
    return found


def _reduced(scan: WindowScan, from_s: float, to_s: float, *, lasting: tuple[str, ...]) -> Scanned:
    best = max(scan.ratios, key=lambda fault: float(scan.ratios[fault].ratio.max()))
    estimates = {fault: one.weighted(scan.weights) for fault, one in scan.ratios.items()}
    return Scanned(
        from_s=from_s,
        to_s=to_s,
        residuals=tuple(kind.name for kind in scan.kinds),
        lacking=scan.lacking,
        knows_zero_lift=scan.constants.knows_zero_lift,
        statistic=scan.statistic,
        fault=best,
        onset_s=float(scan.onsets_s[int(np.argmax(scan.ratios[best].ratio))]),
        onsets_s=scan.onsets_s,
        magnitude={fault: magnitude for fault, (magnitude, _) in estimates.items()},
        sd={fault: sd for fault, (_, sd) in estimates.items()},
        lasting=lasting,
    )


def scale_of(flight: Flight) -> float:
    """Return by how much a flight shows more than the flights of the tables, at least 1.

    The lower quartile over windows of 120 s of the statistic over the lower quartile of their table. A fault in half of
    the windows does not move it far, so that it does not hide by raising its own threshold; an aircraft or an air that
    is rougher throughout raises them. The whole flight counts, also where a part of it is diagnosed. The angle of zero
    lift is free in every window: a vane that is wrong in half of a flight would make that of the flight wrong in all.
    """
    free = replace(flight, zero_lift=None)
    shares = []
    for one in scan_flight(free, windows_in(flight.phases, SCALE_S, step_s=SCALE_S)):
        table = table_for(flight.tables, replace(one.key, beside=False))
        if table is not None:
            shares.append(one.statistic / max(float(np.quantile(table.statistics, CALM)), 1.0))
    return max(1.0, float(np.quantile(shares, CALM))) if len(shares) >= ENOUGH_WINDOWS else 1.0


def look_at(
    scanned: Sequence[Scanned],
    tables: Sequence[ParityTable],
    *,
    rates: Mapping[float, float],
    suspicions: Mapping[float, float],
    scale: float,
) -> Iterator[tuple[Scanned, Threshold, Look]]:
    """Yield every window with its threshold and what is reported of it.

    Parameters
    ----------
    rates, suspicions : by length of a window, of false alarms and of suspicions.
    """
    cache: dict[ScanKey, Threshold] = {}
    for one in scanned:
        key = one.key
        if key not in cache:
            nearest = min(LENGTHS_S, key=lambda length_s: abs(length_s - one.length_s))
            rate, suspicion = rates[nearest], suspicions[nearest]
            cache[key] = threshold_of(tables, key, false_alarm=rate, suspicion=suspicion, scale=scale)
        threshold = cache[key]
        yield (
            one,
            threshold,
            Look(
                from_s=one.from_s,
                to_s=one.to_s,
                residuals=one.residuals,
                statistic=one.statistic,
                threshold=threshold.level,
                p_value=threshold.p_value(one.statistic),
                fault=one.fault,
                onset_s=one.onset_s,
            ),
        )


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
