"""Oscillations of the airspeeds: lines in the spectrum of what the flight model leaves of them, weighed as sines.

Water in a pitot line swings, and so may a transducer. For minutes no flight swings at one frequency, and where a
velocity over ground is recorded it would swing along. A line proposes a frequency and a time; the likelihood of all
rows says what a sine of that frequency is worth, which airspeeds have it, how large it is, and since when.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..decision import beyond_tolerance
from ..faults.filters import response_of
from ..kernels import TWO_SIDED_95, BoolArray, FloatArray
from ..kernels.bounded_filter import StackRun
from ..kernels.low_pass import IDENTITY, Response
from ..kernels.runs import runs
from .bench import CHECK_S, FAULT_STATES, Bench, Place, place_of, run_place
from .events import FREQUENCY_TOLERANCE
from .flight import Flight
from .judge import WIDE, channel_faults, ordinary_of, with_known
from .naming import channels_of, repeat_advice
from .result import Event
from .tables import AIRSPEED_ROWS, Loads
from .timing import likeliest
from .weight import ALIKE, Ordinary, Weight, against, beside, dispersion

PITOT_WATER, ALONE = "pitot_water", ("tas", "cas", "ias")
# Windows of the spectrum, s, and from one to the next: the lowest frequency has six cycles in one, as wherever an
# oscillation is claimed; the highest is what means over a second show.
WINDOW_S, STEP_S = 120, 30
LOWEST_HZ, HIGHEST_HZ = 6.0 / WINDOW_S, 0.45
BY_HZ = 0.5 / WINDOW_S  # between frequencies: half the width of a line
# Frequencies to each side that a line fills in a window of Hann, and so many of the next ones that tell the noise
# there: what drifts or leaps has power at all low frequencies.
WIDTH, BESIDE = 4, 16
# Times the power of noise, from which on a line is looked at more closely: a sine of two standard deviations of the
# noise has 2^2 / 4 times the number of samples, and two thirds of that in a window of Hann.
PROPOSED = 2.0 / 3.0 * 2.0**2 / 4.0 * WINDOW_S
MEDIAN_POWER = float(np.log(2.0))  # of noise, over its mean: powers are exponentially distributed
LEAST = 0.1  # of that, and of the strongest line of a window, down to which a line is still shown
TINY = 1e-12  # of innovations in standard deviations
KNOWN = 0.9  # share of the samples of a window
WEIGHED_S = 300  # from where a line is seen first, in which it is weighed
SIDE_S = WINDOW_S // 2  # about an onset or an end that is sought
FINER = 41  # frequencies about that of a window


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line of the spectrum.

    Attributes
    ----------
    from_s, to_s : from when to when windows show it.
    power : over that of the noise beside it, in the window that shows it most.
    """

    from_s: float
    to_s: float
    frequency_hz: float
    power: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """What sines of a frequency are worth from a time on.

    Attributes
    ----------
    weights : by fault, the best first, with amplitude and its standard deviation, m/s.
    onset_s, onset_ci95 : of the best; offset_s : None where it lasts.
    """

    frequency_hz: float
    weights: tuple[Weight, ...]
    onset_s: float
    onset_ci95: tuple[float, float]
    offset_s: float | None
    seen_until_s: float


def oscillating_events(flight: Flight, bench: Bench, least: float) -> Iterator[Event]:
    """Yield the oscillations of airspeeds that the record confirms, the strongest line first.

    Each is in the model before the next is weighed: what the bounds of the filter make of it is no other oscillation of
    its channels. What the aircraft itself may do is suspected where it is beyond the tolerance, and else is none.

    Parameters
    ----------
    least : log density by which one must explain the flight better than anything ordinary.
    """
    log = flight.log
    response = response_of(log.filters or (), log.rate_hz)
    weighed: list[Line] = []
    lines = spectral_lines(bench)
    while (line := _strongest(lines, weighed)) is not None:
        weighed.append(line)
        oscillation = oscillation_of(bench, line, rate_hz=log.rate_hz, until_s=flight.to_s, response=response)
        if oscillation is None or oscillation.weights[0].margin <= least:
            continue
        event = _event(flight, bench, oscillation)
        bench = with_known(bench, event)
        lines = spectral_lines(bench)
        if event.state == "declared" or event.beyond_tolerance is not False:
            yield event


def _strongest(lines: Sequence[Line], weighed: Sequence[Line]) -> Line | None:
    """Return the strongest of the lines that are near none of those that are weighed, None where none is left."""
    left = [line for line in lines if not any(_is_near(line, other) for other in weighed)]
    return max(left, key=lambda line: line.power, default=None)


def _is_near(line: Line, other: Line) -> bool:
    """Return whether two lines are of one frequency: what comes and goes is the same oscillation."""
    return abs(line.frequency_hz - other.frequency_hz) < 2.0 / WINDOW_S


def is_same_oscillation(event: Event, other: Event) -> bool:
    """Return whether two events are oscillations of one frequency, at one time."""
    if event.frequency_hz is None or other.frequency_hz is None:
        return False
    near = abs(event.frequency_hz - other.frequency_hz) <= FREQUENCY_TOLERANCE * other.frequency_hz
    return near and event.onset_s < other.seen_until_s and other.onset_s < event.seen_until_s


def _event(flight: Flight, bench: Bench, oscillation: Oscillation) -> Event:
    best = oscillation.weights[0]
    window_s = (oscillation.onset_ci95[0], oscillation.seen_until_s)
    sd = best.sd or 0.0
    channels = channels_of(best.fault, flight.recorded)
    inside = (bench.model.time_s >= window_s[0]) & (bench.model.time_s < window_s[1])
    share = float(np.mean(bench.model.coefficients.cas_share[inside]))
    shares = {"tas": 1.0, "cas": share, "ias": share} if best.fault == PITOT_WATER else {best.fault: 1.0}
    effect = {name: best.size * shares[name] for name in channels if name in shares}
    tolerances = {name: flight.tolerance(name, window_s) for name in effect}
    beyond = [effect[name] / best.size / tolerance for name, tolerance in tolerances.items() if tolerance]
    among = tuple(weight.fault for weight in oscillation.weights if weight.margin >= best.margin - ALIKE)
    held = bool({"velocity_north", "ground_speed"} & {*bench.model.rows}) or PITOT_WATER not in among
    return Event(
        fault=best.fault,
        among=among,
        channels=channels,
        state="declared" if held else "suspected",
        kind="oscillating",
        stages=("flight model",),
        shape="sine",
        constant_s=None,
        frequency_hz=oscillation.frequency_hz,
        magnitude=best.size,
        unit="m/s",
        sd=sd,
        ci95=(best.size - TWO_SIDED_95 * sd, best.size + TWO_SIDED_95 * sd),
        effect=effect,
        beyond_tolerance=beyond_tolerance(max(beyond) * best.size, best.size, sd, 1.0) if beyond else None,
        onset_s=oscillation.onset_s,
        onset_ci95=oscillation.onset_ci95,
        offset_s=oscillation.offset_s,
        seen_until_s=oscillation.seen_until_s,
        window_s=window_s,
        statistic=best.margin,
        threshold=0.0,
        p_value=None,
        evidence=best.shares,
        note="" if held else "without a ground speed the aircraft itself may swing",
        repeat=repeat_advice(among),
        margin=best.margin,
    )


def spectral_lines(bench: Bench) -> tuple[Line, ...]:
    """Return the lines in the spectra of what the model leaves of each airspeed, the strongest of each window.

    A line lasts until a window in flight hardly shows it.
    """
    model, frequencies_hz = bench.model, np.arange(LOWEST_HZ, HIGHEST_HZ, BY_HZ)
    waves = np.hanning(WINDOW_S) * np.exp(-2j * np.pi * np.outer(frequencies_hz, np.arange(WINDOW_S)))
    apart = np.abs(np.subtract.outer(np.arange(frequencies_hz.size), np.arange(frequencies_hz.size)))
    beside_each = np.argsort(np.where(apart < WIDTH, apart.max() + 1, apart), axis=1, kind="stable")[:, :BESIDE]
    rows = [model.row(name) for name in AIRSPEED_ROWS if name in model.rows]
    lines: list[Line] = []
    lasting: Line | None = None
    for start, end in runs(model.frame.airborne):
        for first in range(start + CHECK_S, end - WINDOW_S + 1, STEP_S):
            part = bench.innovation[first : first + WINDOW_S, rows]
            part = part[:, _is_known(part)]
            if not part.size:
                continue
            power = np.abs(waves @ np.nan_to_num(part - np.nanmean(part, axis=0))) ** 2
            noise = np.median(power[beside_each], axis=1) / MEDIAN_POWER
            share = (power / np.maximum(noise, TINY)).max(axis=1)
            best, to_s = int(np.argmax(share)), float(model.time_s[first]) + WINDOW_S
            if lasting is not None:
                same = np.abs(frequencies_hz - lasting.frequency_hz) < 1.0 / WINDOW_S
                if share[same].max() > LEAST * max(PROPOSED, share.max()):
                    lasting = replace(lasting, to_s=to_s, power=max(lasting.power, float(share[same].max())))
                    continue
                lines.append(lasting)
                lasting = None
            if share[best] > PROPOSED:
                lasting = Line(
                    from_s=to_s - WINDOW_S,
                    to_s=to_s,
                    frequency_hz=float(frequencies_hz[best]),
                    power=float(share[best]),
                )
    return _joined(lines if lasting is None else [*lines, lasting])


def _joined(lines: Sequence[Line]) -> tuple[Line, ...]:
    """Return lines with those of one frequency as one."""
    joined: list[Line] = []
    for line in lines:
        same = next((k for k, other in enumerate(joined) if _is_near(line, other)), None)
        if same is None:
            joined.append(line)
        else:
            joined[same] = replace(joined[same], to_s=line.to_s, power=max(joined[same].power, line.power))
    return tuple(joined)


def _measured(place: Place) -> list[str]:
    """Return the airspeeds that are known from the onset on."""
    model = place.bench.model
    names = [name for name in AIRSPEED_ROWS if name in model.rows]
    known = _is_known(place.bench.innovation[place.first + place.onset : place.end, [*map(model.row, names)]])
    return [name for name, is_known in zip(names, known, strict=True) if is_known]


def _is_known(innovation: FloatArray) -> BoolArray:
    """Return (n_rows,) whether a row is measured in most of some seconds, (n, n_rows)."""
    return np.asarray(np.isfinite(innovation).mean(axis=0) >= KNOWN)


def oscillation_of(
    bench: Bench, line: Line, *, rate_hz: float, until_s: float, response: Response = IDENTITY
) -> Oscillation | None:
    """Return what sines of a line are worth; None where it is not flown for long enough before.

    Parameters
    ----------
    rate_hz : of the log, of whose samples a second is the mean; response : of its recorder.
    until_s : end of the part that is diagnosed.
    """
    time_s, airborne = bench.model.time_s, bench.model.frame.airborne
    at_s = line.from_s + SIDE_S
    earlier_s = int(np.clip(at_s - time_s[min(bench.checks)] - CHECK_S, 0, SIDE_S + STEP_S))
    shown_s = max(line.to_s - WINDOW_S, at_s + SIDE_S)
    place = place_of(bench, at_s, None, min(until_s, shown_s, at_s + WEIGHED_S), earlier_s=earlier_s)
    if place is None or not _measured(place):
        return None
    sines = _sines(place, line.frequency_hz, rate_hz, response)
    onsets = range(place.onset - earlier_s, min(place.onset + SIDE_S, place.n - SIDE_S) + 1)
    # 1. Which airspeeds swing.
    about = sines.weights([(name, onset, place.n) for onset in onsets[::SIDE_S] for name in sines.faults])
    fault = max(about, key=lambda weight: weight.margin).fault
    # 2. Since when, and what each is worth from then on.
    peak, first, last = likeliest(len(onsets), lambda some: sines.weights([(fault, onsets[k], place.n) for k in some]))
    onset = onsets[peak]
    weights = sorted(
        sines.weights([(name, onset, place.n) for name in sines.faults]), key=lambda weight: -weight.margin
    )
    start_s, first_s = time_s[place.first], float(time_s[place.first + onsets[first]] - 1.5)
    if first == 0:
        # On the ground, or in the window before, it is not seen.
        flown = np.flatnonzero(airborne[: place.first])
        first_s = min(first_s, float(time_s[flown[-1]]) if flown.size else time_s[0]) - WINDOW_S
    return Oscillation(
        frequency_hz=sines.frequency_hz,
        weights=tuple(weights),
        onset_s=float(start_s + onset - 0.5),
        onset_ci95=(first_s, float(start_s + onsets[last] + 1.5)),
        seen_until_s=line.to_s,
        offset_s=_end(bench, line, sines, fault) if line.to_s < min(until_s, time_s[airborne][-1]) - WINDOW_S else None,
    )


def _end(bench: Bench, line: Line, sines: Sines, fault: str) -> float | None:
    """Return when an oscillation ends that no window shows after a line; None where that is not flown."""
    earlier_s = min(2 * WINDOW_S, int(line.to_s - line.from_s))
    place = place_of(bench, line.to_s, None, line.to_s + WINDOW_S, earlier_s=earlier_s)
    if place is None:
        return None
    lasting = replace(sines, place=place, ordinary=ordinary_of(place), shocks=np.zeros_like(place.Q))
    ends = range(place.onset - WINDOW_S, min(place.onset + STEP_S, place.n) + 1)
    peak, _, _ = likeliest(len(ends), lambda some: lasting.weights([(fault, 0, ends[k]) for k in some]))
    return float(bench.model.time_s[place.first + min(ends[peak], place.n - 1)] - 0.5)


def _sines(place: Place, near_hz: float, rate_hz: float, response: Response) -> Sines:
    """Return the sines of about a frequency in the airspeeds of a place, beside the best without one."""
    airspeeds = _measured(place)
    ordinary = ordinary_of(place)
    frequency_hz = _frequency(place, airspeeds, near_hz)
    shares = {"cas": place.bench.model.coefficients.cas_share}
    alone = {
        name: loads
        for name, loads in channel_faults(place.bench.model).items()
        if name in ALONE and {*loads} <= {*airspeeds}
    }
    n = max(1.0, float(np.round(rate_hz)))
    mean = float(np.sin(np.pi * frequency_hz) / (n * np.sin(np.pi * frequency_hz / n)))
    return Sines(
        place=place,
        ordinary=ordinary,
        frequency_hz=frequency_hz,
        faults=alone | {PITOT_WATER: {name: shares.get(name, 1.0) for name in airspeeds}},
        share=mean * response.gain(frequency_hz / rate_hz),
        shocks=beside(place, ordinary, airspeeds),
    )


def _frequency(place: Place, airspeeds: Sequence[str], near_hz: float) -> float:
    """Return where about a frequency the power of what the model leaves of some airspeeds is largest."""
    rows = [place.bench.model.row(name) for name in airspeeds]
    left = place.bench.innovation[place.first + place.onset : place.end, rows]
    left = np.nan_to_num(left - np.nanmean(left, axis=0))
    frequencies_hz = np.maximum(near_hz + np.linspace(-1.0, 1.0, FINER) / WINDOW_S, LOWEST_HZ)
    waves = np.exp(-2j * np.pi * np.outer(frequencies_hz, np.arange(len(left))))
    return float(frequencies_hz[int(np.argmax(np.max(np.abs(waves @ left), axis=1)))])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sines:
    """Sines of a frequency in the airspeeds of a place.

    Attributes
    ----------
    faults : by name what a sine of 1 makes of each row: of each airspeed alone, and of the line that all have.
    share : amplitude that the recorder and the means over the samples of a second leave of a sine of 1.
    shocks : (n, n_states) variances of the jumps beside it.
    """

    place: Place
    ordinary: Ordinary
    frequency_hz: float
    faults: Mapping[str, Loads]
    share: float
    shocks: FloatArray

    def weights(self, hypotheses: Sequence[tuple[str, int, int]]) -> tuple[Weight, ...]:
        """Return what faults are worth that begin and end at some seconds of the place."""
        place, model = self.place, self.place.bench.model
        extra = np.zeros((place.n, len(hypotheses), len(model.rows), FAULT_STATES))
        seconds = np.arange(place.n)
        phase = 2.0 * np.pi * self.frequency_hz * seconds
        # The first state of a fault grows by the second; of a cosine and a sine neither does.
        waves = self.share * np.column_stack([np.cos(phase), np.sin(phase) - seconds * np.cos(phase)])
        for h, (name, onset, end) in enumerate(hypotheses):
            lasts = (seconds >= onset) & (seconds < end)
            for row, load in self.faults[name].items():
                at = np.asarray(load)[place.part] if np.ndim(load) else np.full(place.n, load)
                extra[:, h, model.row(row)] = waves * (at * lasts)[:, None]
        start = np.full((len(hypotheses), FAULT_STATES), WIDE["tas"])
        run = run_place(place, shocks=self.shocks[:, None], extra=extra, extra_start=start)
        return tuple(
            self._weight(run, h, place.at(onset, end), name) for h, (name, onset, end) in enumerate(hypotheses)
        )

    def _weight(self, run: StackRun, h: int, place: Place, name: str) -> Weight:
        margin, shares = against(place, self.ordinary, run.log_density[:, h])
        grown = np.array([[1.0, -float(place.n)], [0.0, 1.0]])
        parts = grown @ run.final_mean[h, -FAULT_STATES:]
        covariance = grown @ run.final_covariance[h, -FAULT_STATES:, -FAULT_STATES:] @ grown.T
        size = float(np.hypot(*parts))
        along = parts / max(size, TINY)
        wide = dispersion(place, run.innovation[:, h], list(self.faults[name]))
        sd = float(np.sqrt(wide * along @ covariance @ along))
        # A sine of many standard deviations is worth half their square: what else it is worth it owes to the freedom
        # that it has where it begins.
        margin = min(margin, 0.5 * (size / sd) ** 2)
        return Weight(
            fault=name,
            margin=margin,
            shares=shares,
            size=size,
            sd=sd,
            dispersion=wide,
        )
