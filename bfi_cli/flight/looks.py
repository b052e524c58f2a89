"""The scans over a whole flight: the parity scan of every window of every length, and that for steps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import cache, partial

import numpy as np

from ..config import Config, merge
from ..engine import in_order
from ..errors import BfiError
from ..flightlog import FlightLog
from ..kernels import ONE_SIDED_90, FloatArray
from ..kernels.progress import Report, silent
from ..model.onset.detection import search_onsets
from ..model.onset.glance import Glance, glance
from ..model.onset.search import OnsetSearch
from ..model.preprocessing.window import TRUSTED, with_inputs_of
from ..threads import one_thread
from .flight import INPUTS, Flight
from .parity import LENGTHS_S, ParityTable, ScanKey, Threshold, WindowScan, table_for, threshold_of
from .parity.windows import Window, windows_in
from .result import Look

# Where a flight shows mostly more than the tables, its thresholds rise. Fewer windows of this length do not say so: a
# fault fills them.
SCALE_S, ENOUGH_WINDOWS = 120.0, 10
# The share of windows that say so: a fault that lasts to the end of a short log is in more than half of them. Both by
# this reasoning; no flight was used to set them.
CALM = 0.25
# Windows of the scan for steps: with a quarter of overlap a step lies 15 s inside of one of them.
GLANCE_S, STEP_S = 120.0, 90.0
# Stretch of a flight too short for these windows that is searched as a whole, s: 60 samples of the analysis at 2 Hz.
SHORTEST_S = 30.0
CHUNK = 4  # windows that a worker takes at once; for the speed only
FEWEST_FOR_WORKERS = 120  # a worker takes as long to start as 60 windows to scan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scanned(Look):
    """A window of the parity scan, with what events and limits are made of beside what is reported.

    Attributes
    ----------
    lacking : by residual that was not used, what the log lacks for it.
    magnitude, sd : by fault, (n_onsets,) of ramps, with what healthy flight shows beyond the noise models.
    declared : by fault, (n_onsets,) the ramps that would be declared with 90 % power, infinite where none would.
    onsets_s : (n_onsets,) of these.
    lasting : faults that began before it, which its statistic leaves out.
    rule : what its statistic is held against.
    """

    lacking: Mapping[str, str]
    onsets_s: FloatArray
    magnitude: Mapping[str, FloatArray]
    sd: Mapping[str, FloatArray]
    declared: Mapping[str, FloatArray]
    lasting: tuple[str, ...]
    rule: Threshold

    @property
    def window(self) -> Window:
        return self.from_s, self.to_s

    @property
    def look(self) -> Look:
        """What is reported of it."""
        return Look(**{field.name: getattr(self, field.name) for field in fields(Look)})


def rate_of(false_alarm: float, n_windows: int) -> float:
    """Return the rate of false alarms of one window, of `n_windows` of its analysis in a flight.

    However they depend on each other, one of them alarms with a probability of at most the sum of their own. Every
    analysis has an equal share of what a healthy flight may have: the parity scan of each length, and that for steps.

    Parameters
    ----------
    false_alarm : of a whole healthy flight.
    """
    return false_alarm / (len(LENGTHS_S) + 1) / max(n_windows, 1)


def key_of(scan: WindowScan, window: Window, *, beside: bool = False) -> ScanKey:
    """Return what the statistic of a window depends on; `beside` whether faults that last are left out of it."""
    return ScanKey(
        residuals=tuple(kind.name for kind in scan.kinds),
        length_s=float(round(window[1] - window[0])),
        knows_zero_lift=scan.constants.knows_zero_lift,
        beside=beside,
    )


def thresholds_of(
    tables: Sequence[ParityTable], rates: Mapping[float, float], suspicions: Mapping[float, float], scale: float
) -> Callable[[ScanKey], Threshold]:
    """Return what gives the threshold of a window by its key.

    Parameters
    ----------
    rates, suspicions : by length of a window, of false alarms and of suspicions.
    """

    @cache
    def threshold(key: ScanKey) -> Threshold:
        nearest = min(LENGTHS_S, key=lambda length_s: abs(length_s - key.length_s))
        rate, suspicion = rates[nearest], suspicions[nearest]
        return threshold_of(tables, key, false_alarm=rate, suspicion=suspicion, scale=scale)

    return threshold


def scan_flight(
    flight: Flight,
    windows: Sequence[Window],
    threshold: Callable[[ScanKey], Threshold],
    *,
    kept: Sequence[Scanned] = (),
    report: Report = silent,
) -> list[Scanned]:
    """Return the scans of windows in their order; those without a residual are left out.

    Parameters
    ----------
    threshold : of a window, see `thresholds_of`.
    kept : scans at the same angle of zero lift, used again where the same faults last.
    """
    done = {(scanned.window, scanned.lasting): scanned for scanned in kept}
    scans = []
    for k, window in enumerate(windows):
        report(k / len(windows))
        lasting = flight.lasting_in(window)
        if (window, lasting) in done:
            scans.append(done[window, lasting])
            continue
        scan = flight.scan(window)
        if scan is None:
            continue
        fault, onset_s = scan.strongest
        magnitude, sd = scan.ratios.weighted(scan.weights)
        level = threshold(key_of(scan, window, beside=bool(lasting)))
        declared = scan.ratios.needed(level.level) + ONE_SIDED_90 * np.sqrt(level.scale) * sd
        scans.append(
            Scanned(
                from_s=window[0],
                to_s=window[1],
                residuals=tuple(kind.name for kind in scan.kinds),
                lacking=scan.lacking,
                statistic=scan.statistic,
                threshold=level.level,
                p_value=level.p_value(scan.statistic),
                fault=fault,
                onset_s=onset_s,
                onsets_s=scan.onsets_s,
                magnitude=dict(zip(scan.faults, magnitude, strict=True)),
                sd=dict(zip(scan.faults, sd, strict=True)),
                declared=dict(zip(scan.faults, declared, strict=True)),
                lasting=lasting,
                rule=level,
            )
        )
    return scans


def scale_of(flight: Flight) -> float:
    """Return by how much a flight shows more than the flights of the tables, at least 1.

    The lower quartile over windows of 120 s of the statistic over the lower quartile of their table. A fault in half of
    the windows does not move it far, so that it does not hide by raising its own threshold; an aircraft or an air that
    is rougher throughout raises them. The whole flight counts, also where a part of it is diagnosed. The angle of zero
    lift is free in every window: a vane that is wrong in half of a flight would make that of the flight wrong in all.
    """
    free, shares = replace(flight, zero_lift=None), []
    for window in windows_in(flight.phases, SCALE_S, step_s=SCALE_S):
        scan = free.scan(window)
        table = None if scan is None else table_for(flight.tables, key_of(scan, window))
        if scan is not None and table is not None:
            shares.append(scan.statistic / max(float(np.quantile(table.statistics, CALM)), 1.0))
    return max(1.0, float(np.quantile(shares, CALM))) if len(shares) >= ENOUGH_WINDOWS else 1.0


def inputs_for(log: FlightLog) -> tuple[str, ...]:
    """Return those of the inputs that the log has and that move."""
    return tuple(
        name
        for name in INPUTS
        if name in log.channels and float(np.ptp(np.nan_to_num(log.channels[name].values))) > 0.0
    )


def glance_at_flight(
    log: FlightLog, windows: Sequence[Window], config: Config, *, workers: int = 1, report: Report = silent
) -> list[tuple[Window, Glance | str | None]]:
    """Return what stands out in every window, None where nothing does, or why it could not be analysed.

    Parameters
    ----------
    config : with inputs and outputs.
    """
    # What stands out is confirmed with the other trusted channels.
    names = dict.fromkeys((*config.inputs, *config.outputs, *(name for name in TRUSTED if name in log.channels)))
    slim = replace(log, channels={name: log.channels[name] for name in names}, truth=None, notes=())
    parts = [slim.window(from_s, to_s) for from_s, to_s in windows]
    whole = merge(config, {"window": {"from_s": None, "to_s": None}})
    answers: list[tuple[Window, Glance | str | None]] = []
    workers = workers if len(parts) >= FEWEST_FOR_WORKERS else 1
    with closing(in_order(partial(_glance_in, config=whole), parts, workers=workers, chunk=CHUNK)) as results:
        for window, (answer, _) in zip(windows, results, strict=True):
            answers.append((window, answer))
            report(len(answers) / len(parts))
    return answers


def search_stretch(log: FlightLog, window: Window, config: Config) -> OnsetSearch | str:
    """Return what `bfi start-time` finds in a stretch of a log, or why it could not be analysed."""
    used = merge(config, {"window": {"from_s": window[0], "to_s": window[1]}})
    try:
        with one_thread():
            return search_onsets(log, with_inputs_of(log, used))
    except BfiError as unusable:
        return str(unusable)


def _glance_in(part: FlightLog, *, config: Config) -> Glance | str | None:
    try:
        return glance(part, config)
    except BfiError as unusable:
        return str(unusable)


def summary_of(glances: Sequence[tuple[Window, Glance | str | None]]) -> Mapping[str, int]:
    """Return how many windows failed for each reason."""
    return Counter(answer for _, answer in glances if isinstance(answer, str))
