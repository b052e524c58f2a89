"""Table II of the F-16 diagnosability paper: flights with a faulty gyro, the index of the fault in three windows.

The paper states neither command, aerodynamic variation, gyro noise, observer, reference window, throttle, exponent nor
the base of its logarithm. Each is an option, whose default comes close to the paper's table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ...aircraft.f16 import STATES, Inversion, Observation, observe
from ...errors import ConfigError
from ...faults.validation import Number, Positive, Rules, validate
from ...kernels import FloatArray
from ...kernels.divergence import (
    Density,
    gaussian_density,
    jensen_shannon_montecarlo,
    jensen_shannon_quadrature,
    kernel_density,
    log_density,
)
from ...report.content import Drawing, Panel, ReportContent, Span, curve
from ...yaml12 import load_yaml
from .page import Page, drawing, fill, load, report_content, table
from .record import Settings

NotNegative = Annotated[Number, Field(ge=0)]
WHERE = "f16-table2"  # what messages about an option name
# The experiment of the paper (eq. 26): s and degrees of the manoeuvre, and what its gyros get.
AOA_COMMAND = ((0.0, 0.0), (1.0, 8.0), (2.0, 8.0), (4.0, 35.0), (5.5, 35.0), (7.5, 6.0), (20.0, 6.0))
ONSET_S, GROWS_S = 4.0, 12.0  # of the fault, eq. 26
AMPLITUDES_DEG_S = (2.0, 4.0)
FREQUENCY_HZ = 1.0
ROLL_RAMP_S = 1.0
SAMPLES = 200  # of the record, 20 s at 10 Hz
KINDS = ("nominal", "healthy", "roll_fault", "pitch_fault")
FAULTY_GYRO = {"roll_fault": 0, "pitch_fault": 1}
INSTANT = 1e-9  # s: a sample at an instant belongs to what begins there
END = 1e-6  # s: a sample at the end of a window belongs to the next one

AXES = ("roll rate", "pitch rate")
WINDOWS = ((0.0, 4.0), (4.0, 12.0), (12.0, 20.0))  # s, those of the paper's table
CELLS = [(axis, window) for axis in range(len(AXES)) for window in WINDOWS]  # of the paper's table
FAULTY = {"2 deg/s": WINDOWS[1], "4 deg/s": WINDOWS[2]}
TABLE_2, BANDWIDTHS = (np.array(load("f16_table2")[key]) for key in ("index", "bandwidth"))
"""Published: one row per axis, one column per window."""
EARLY = 0.2  # just above the published 0.17 and 0.19 of the window before the fault

# Flights of each reading of the paper: as many as a minute takes, and fewer.
SEEDS, QUICK_SEEDS, OTHER_SEEDS = 6, 2, 2
QUICK_STEP_S = 0.05
DRAWS = 2000  # values of each density in eq. 17
POINTS, REACH = 401, 3.0  # of a drawn density: points, and bandwidths beyond the samples
BINS = 10  # of the histogram of a residual: 80 samples, eight to a bin


class F16Options(Rules):
    """Values for what the paper leaves open; the defaults come close to its table."""

    reference: Literal["kde", "gaussian"] = "kde"
    """Density of the fault-free residual: by kernels, or a Gaussian fit, as the paper's conclusion says."""
    reference_window: Literal["whole", "same"] = "whole"
    """Span of the fault-free residual: the whole flight, or the window of the faulty one."""
    reference_aircraft: Literal["varied", "nominal"] = "varied"
    """Aircraft that flies without a fault: with the aerodynamic variation, or without."""
    exponent: NotNegative | None = 0.5
    """a of eq. 22, 0 for one bandwidth everywhere, none for the most likely."""
    log_base: Literal["2", "e"] = "2"
    """Base of the logarithm in eq. 15."""
    halves: bool = True
    """The factors 1/2 of eq. 15, which eq. 17 leaves out."""
    noise_deg_s: NotNegative = 0.05
    """Standard deviation of the gyros, held for 0.1 s."""
    variation: tuple[Number, Number, Number] = (0.10, 0.25, 0.20)
    """Relative changes of Cl, Cm, Cn, eq. 8."""
    observer_gain: tuple[Positive, Positive, Positive] = (9.0, 6.0, 8.0)
    """Gains of the observer for p, q, r, 1/s."""
    observer_rates: Literal["measured", "estimated"] = "measured"
    """Rates at which the observer takes the nominal moments: f2(y) or f2(x-hat)."""
    aoa_command: tuple[tuple[Number, Number], ...] = AOA_COMMAND
    """Corners of the commanded angle of attack: seconds, degrees."""
    roll_deg: Number = 25.0
    """Commanded roll, reached after 1 s."""
    throttle: Annotated[Number, Field(ge=0, le=1)] = 0.9
    """Fixed."""
    nozzle_deg: Annotated[Number, Field(ge=0, le=45)] = 15.0
    """Largest deflection of the thrust-vectoring nozzle."""
    step_s: Annotated[Number, Field(gt=0, le=0.1)] = 0.02
    """Step of the Runge-Kutta integration; the record's step is 0.1 s."""

    @model_validator(mode="after")
    def _has_a_density(self) -> F16Options:
        times = [time for time, _ in self.aoa_command]
        if len(times) < 2 or any(after <= before for before, after in pairwise(times)):
            raise ValueError("aoa_command: needs two corners or more in the order of time; write [[0, 0], [1, 8]]")
        still = self.noise_deg_s == 0.0
        if still and (self.reference_aircraft == "nominal" or not any(self.variation)):
            raise ValueError("noise_deg_s: the fault-free residual is zero and has no density; give some noise")
        return self

    def changed(self, change: Mapping[str, object]) -> F16Options:
        """Return another reading; lists of a YAML file become the tuples that options have."""
        update = {key: tuple(value) if isinstance(value, list) else value for key, value in change.items()}
        return self.model_copy(update=update)


def options_from(assignments: Sequence[str]) -> F16Options:
    """Return the options of texts like "noise_deg_s=0.03" or "variation=[0.3, 0.3, 0.3]"; the rest as by default.

    Raises
    ------
    ConfigError : there is no such option, or it cannot have this value.
    """
    given: dict[str, object] = {}
    for text in assignments:
        name, equals, value = text.partition("=")
        if not equals:
            raise ConfigError(f"{WHERE}: expected KEY=VALUE, got '{text}'; write noise_deg_s=0.03")
        read = load_yaml(value, where=f"{WHERE}: {name.strip()}")
        given[name.strip()] = str(read) if name.strip() == "log_base" else read
    return validate(F16Options, given, where=WHERE, error=ConfigError)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One set of four flights."""

    options: F16Options
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residuals:
    """The residuals of a set of four flights.

    Attributes
    ----------
    time_s : (m,).
    nominal, healthy, roll_fault, pitch_fault : (m, 3) residuals of p, q, r, deg/s; all but the first with the
        aerodynamic variation.
    states : (m, 13) of the healthy flight.
    """

    time_s: FloatArray
    nominal: FloatArray
    healthy: FloatArray
    roll_fault: FloatArray
    pitch_fault: FloatArray
    states: FloatArray

    def faulty(self, axis: int) -> FloatArray:
        """Return (m,) the residual of an axis in the flight in which its gyro is faulty."""
        return (self.roll_fault, self.pitch_fault)[axis][:, axis]


def fly_cases(cases: Sequence[Case], report: Callable[[int, int], None] | None = None) -> list[Residuals]:
    """Fly all cases, those that share an aircraft at once, and return their residuals in the order of `cases`.

    Parameters
    ----------
    report : called with the number of samples flown, and of all.
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, case in enumerate(cases):
        o = case.options
        groups.setdefault((o.observer_rates, o.throttle, o.nozzle_deg, o.step_s), []).append(i)
    flown: dict[int, Residuals] = {}
    for number, members in enumerate(groups.values()):
        before, total = number * SAMPLES, len(groups) * SAMPLES
        progress = None if report is None else lambda done, _all, first=before, of=total: report(first + done, of)
        flown.update(zip(members, _fly([cases[i] for i in members], progress), strict=True))
    return [flown[i] for i in range(len(cases))]


def _fly(cases: Sequence[Case], report: Callable[[int, int], None] | None) -> list[Residuals]:
    """Fly the four flights of every case, one column each."""
    o = cases[0].options
    gains, variation = (
        np.repeat(np.array([getattr(case.options, key) for case in cases]).T, len(KINDS), axis=1)
        for key in ("observer_gain", "variation")
    )
    variation[:, :: len(KINDS)] = 0.0
    faulty = np.zeros_like(variation)
    for kind, gyro in FAULTY_GYRO.items():
        faulty[gyro, KINDS.index(kind) :: len(KINDS)] = 1.0
    noise = []  # (m, 3, 4) rad/s; a seed gives the same noise but for its size
    for case in cases:
        rng = np.random.default_rng(case.seed)
        noise.append(np.radians(case.options.noise_deg_s) * rng.standard_normal((SAMPLES, 3, len(KINDS))))
    flown = observe(
        Observation(
            command=_command([case.options for case in cases]),
            observer_gain=gains,
            from_measured=o.observer_rates == "measured",
            inversion=Inversion(nozzle_limit=float(np.radians(o.nozzle_deg))),
            throttle=o.throttle,
            step_s=o.step_s,
        ),
        variation=variation,
        noise=np.concatenate(noise, axis=2),
        fault=lambda t: fault_deg_s(t) * np.radians(faulty),
        report=report,
    )
    residuals = []
    for first in range(0, len(cases) * len(KINDS), len(KINDS)):
        columns = {kind: first + i for i, kind in enumerate(KINDS)}
        of = {kind: np.degrees(flown.residual[:, :, column]) for kind, column in columns.items()}
        residuals.append(Residuals(time_s=flown.time_s, states=flown.states[:, :, columns["healthy"]], **of))
    return residuals


def fault_deg_s(t: float) -> float:
    """Return f(t) of eq. 26: a sine of 1 Hz, called a bias there."""
    if t < ONSET_S - INSTANT:
        return 0.0
    amplitude = AMPLITUDES_DEG_S[int(t > GROWS_S - INSTANT)]
    return float(amplitude * np.sin(2.0 * np.pi * FREQUENCY_HZ * t))


def _command(options: Sequence[F16Options]) -> Callable[[float], FloatArray]:
    """Return the commanded aoa, sideslip and roll, (3, n) rad, as a function of time; equal curves are one look-up."""
    curves = list(dict.fromkeys(reading.aoa_command for reading in options))
    which = np.repeat([curves.index(reading.aoa_command) for reading in options], len(KINDS))
    rolls = np.repeat(np.radians([reading.roll_deg for reading in options]), len(KINDS))
    corners = [np.array(curve).T for curve in curves]

    def at(t: float) -> FloatArray:
        aoa = np.radians([float(np.interp(t, times, degrees)) for times, degrees in corners])[which]
        return np.array([aoa, np.zeros_like(aoa), rolls * min(t / ROLL_RAMP_S, 1.0)])

    return at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Indices:
    """One row per set of flights, axis and window: FD, and the bandwidth of eq. 24 in deg/s, (n, 2, 3)."""

    index: FloatArray
    bandwidth: FloatArray

    @property
    def rms(self) -> float:
        """Root mean square difference of the mean index to table II."""
        return float(np.sqrt(np.mean((self.index.mean(axis=0) - TABLE_2) ** 2)))

    @property
    def worst(self) -> float:
        """Largest difference of the mean index to table II."""
        return float(np.max(np.abs(self.index.mean(axis=0) - TABLE_2)))


def f16_table2(settings: Settings, options: F16Options | None = None) -> ReportContent:
    """Return table II, ours beside the published one: mean and standard deviation over seeds of the gyro noise.

    Parameters
    ----------
    options : the reading of what the paper leaves open; None for the one that comes close.
    """
    page = load("f16_table2")
    if options is None:
        options = options_from([*([f"step_s={QUICK_STEP_S}"] if settings.quick else []), *settings.choices])
    n = max(1, settings.trials_or(SEEDS, QUICK_SEEDS))
    seeds = [settings.seed + i for i in range(n)]
    others = [] if settings.quick else [(label, options.changed(change)) for label, change in page["flights"]]
    n_other = min(n, OTHER_SEEDS)
    wanted = [*((options, seed) for seed in seeds), *((other, seed) for _, other in others for seed in seeds[:n_other])]
    flights = fly_cases([Case(options=each, seed=seed) for each, seed in wanted], settings.report)
    chosen_flights = flights[:n]
    chosen = indices(chosen_flights, options)
    # The open choices one at a time: first other readings of the same flights, then other flights. The index of the
    # readings in `comparable` has the same scale.
    rows, comparable = {"as chosen": chosen}, {"as chosen": chosen}
    for label, change in page["readings"]:
        other = options.changed(change)
        if other != options:
            rows[label] = indices(chosen_flights, other)
            if (other.log_base, other.halves) == (options.log_base, options.halves):
                comparable[label] = rows[label]
    for i, (label, other) in enumerate(others):
        at = n + i * n_other
        rows[label] = comparable[label] = indices(flights[at : at + n_other], other)
    means = np.array([row.index.mean(axis=0) for row in comparable.values()])
    smallest, largest = means.min(axis=0), means.max(axis=0)
    value, error = montecarlo(chosen_flights[0], options, DRAWS, rng=np.random.default_rng(settings.seed))
    off = np.abs(value - indices(chosen_flights[:1], options.changed({"log_base": "2", "halves": True})).index[0])
    values = {
        "rms": chosen.rms,
        "worst": chosen.worst,
        "rises": page["rises"][bool(np.all(np.diff(chosen.index, axis=2) > 0.0))],
        "n_readings": len(comparable) - 1,
        "moves": float(np.max(np.abs(means - means[0]))),
        "rms_range": " to ".join(f"{end([row.rms for row in comparable.values()]):.3f}" for end in (min, max)),
        **_words(options),
        "draws": DRAWS,
        "off": np.max(off),
        "errors": np.max(off / error),
        "seeds": ", ".join(map(str, seeds)),
    }
    start = dict(zip(STATES, chosen_flights[0].states[0], strict=True))
    initial = [
        (label, f"{printed} (table I)", ", ".join(f"{start[name]:g}" for name in names))
        for label, printed, names in page["initial"]
    ]
    return report_content(
        page,
        values,
        records=_compared(page, chosen),
        tables=[
            table(page, "choices", _choices(rows, smallest, largest)),
            table(page, "robust", _robust(page, rows, comparable)),
            table(page, "errata", page["errata"]),
            table(page, "initial", initial),
        ],
        drawings=_drawings(page, chosen_flights[0], options),
        notes=() if settings.log is None else (page["no_log"],),
    )


def _words(options: F16Options) -> dict[str, object]:
    """Return the options in the words of the page's facts."""
    return {
        "o": options,
        "corners": ", ".join(f"{time:g} s {degrees:g} deg" for time, degrees in options.aoa_command),
        "variation": ", ".join(f"{value:+g}" for value in options.variation),
        "gains": ", ".join(f"{k:g}" for k in options.observer_gain),
        "kind": {"kde": "kernels", "gaussian": "Gaussian fit"}[options.reference],
        "halves": "" if options.halves else ", without halves",
        "exponent": "by likelihood" if options.exponent is None else f"{options.exponent:g}",
    }


def _compared(page: Page, chosen: Indices) -> list[dict[str, object]]:
    """Return every published index and bandwidth beside ours, the mean over the sets of flights."""
    compared: list[dict[str, object]] = []
    for name, published, ours in (("index", TABLE_2, chosen.index), ("bandwidth", BANDWIDTHS, chosen.bandwidth)):
        for (i, j), number in np.ndenumerate(published):
            if np.isfinite(number):
                quantity = fill(page["quantities"][name], axis=AXES[i], low=WINDOWS[j][0], high=WINDOWS[j][1])
                sd = f" (sd {np.std(ours[:, i, j], ddof=1):.3f})" if len(ours) > 1 else ""
                place, text = page["places"][name], f"{np.mean(ours[:, i, j]):.3f}{sd}"
                compared.append({"quantity": quantity, "published": number, "place": place, "ours": text})
    return compared


def _choices(rows: Mapping[str, Indices], smallest: FloatArray, largest: FloatArray) -> list[tuple[str, ...]]:
    """Return the mean index of every reading of the paper, (2, 3), and the ends of those with its scale."""
    means = {"published": TABLE_2, **{label: each.index.mean(axis=0) for label, each in rows.items()}}
    means |= {"smallest, same scale": smallest, "largest, same scale": largest}
    off = {label: (f"{each.rms:.3f}", f"{each.worst:.3f}") for label, each in rows.items()}
    return [
        (label, *(f"{index:.3f}" for index in mean.ravel()), *off.get(label, ("", ""))) for label, mean in means.items()
    ]


def _robust(page: Page, rows: Mapping[str, Indices], comparable: Mapping[str, Indices]) -> list[tuple[str, ...]]:
    """Return in how many of the rows each statement of the paper holds for every set of flights."""
    holds = {
        "rising_first": [row.index[:, :, 1] > row.index[:, :, 0] for row in rows.values()],
        "rising_second": [row.index[:, :, 2] > row.index[:, :, 1] for row in rows.values()],
        "larger": [row.index[:, 0, 1:] > row.index[:, 1, 1:] for row in rows.values()],
        "early": [row.index[:, :, 0] < EARLY for row in comparable.values()],
    }
    shares = {key: f"{sum(bool(np.all(row)) for row in each)} of {len(each)} rows" for key, each in holds.items()}
    ratio = np.concatenate([row.bandwidth[:, :, 2] / row.bandwidth[:, :, 1] for row in rows.values()])
    ratios = " and ".join(f"{np.min(each):.2f} to {np.max(each):.2f}" for each in ratio.T)
    return list(fill(page["robust"], ratios=ratios, **shares))


def indices(flights: Sequence[Residuals], options: F16Options) -> Indices:
    """Return the indices of sets of four flights by quadrature, eq. 15."""
    scale = (1.0 if options.halves else 2.0) * (1.0 if options.log_base == "2" else np.log(2.0))
    pairs = [density_pair(flown, options, axis=axis, window=window) for flown in flights for axis, window in CELLS]
    shape = (len(flights), len(AXES), len(WINDOWS))
    return Indices(
        index=scale * np.array([jensen_shannon_quadrature(p, q) for p, q in pairs]).reshape(shape),
        bandwidth=np.array([p.pilot_bandwidth for p, _ in pairs]).reshape(shape),
    )


def montecarlo(
    flown: Residuals, options: F16Options, n: int, *, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return J in bits by n values of each density (eq. 17), and its standard errors, both (2, 3)."""
    pairs = (density_pair(flown, options, axis=axis, window=window) for axis, window in CELLS)
    drawn = np.array([jensen_shannon_montecarlo(p, q, n, rng=rng) for p, q in pairs])
    value, error = drawn.T.reshape(2, len(AXES), len(WINDOWS))
    return value, error


def density_pair(
    flown: Residuals, options: F16Options, *, axis: int, window: tuple[float, float]
) -> tuple[Density, Density]:
    """Return the density of the residual of a faulty gyro in a window, and that without a fault."""
    normal = (flown.healthy if options.reference_aircraft == "varied" else flown.nominal)[:, axis]
    inside = _in_window(flown.time_s, window)
    if options.reference_window == "same":
        normal = normal[inside]
    if options.reference == "gaussian":
        q = gaussian_density(normal)
    else:
        q = kernel_density(normal, exponent=options.exponent)
    return kernel_density(flown.faulty(axis)[inside], exponent=options.exponent), q


def _in_window(time_s: FloatArray, window: tuple[float, float]) -> NDArray[np.bool_]:
    low, high = window
    return np.asarray((time_s > low - END) & (time_s < high - END))


def _drawings(page: Page, flown: Residuals, options: F16Options) -> list[Drawing]:
    """Return the figures of one set of flights: manoeuvre, residuals, local bandwidths, densities."""
    t, (times, corners) = flown.time_s, zip(*options.aoa_command, strict=True)
    states = {name: flown.states[:, STATES.index(name)] for name in ("tas", "aoa", "roll", "pitch")}
    angles = [curve(name, t, np.degrees(states[name])) for name in ("aoa", "roll", "pitch")]
    angles.append(curve("aoa, commanded", times, corners, style="dashed"))
    airspeed = (curve("tas", t, states["tas"]),)
    manoeuvre = [
        Panel(x_label="time [s]", y_label="angle [deg]", curves=tuple(angles)),
        Panel(x_label="time [s]", y_label="true airspeed [m/s]", curves=airspeed),
    ]
    residuals, bandwidths, densities = [], [], []
    for axis, title in enumerate(AXES):
        shown = (curve("faulty gyro", t, flown.faulty(axis)), curve("no fault", t, flown.healthy[:, axis]))
        spans = tuple(Span(label=f"fault of {label}", low=low, high=low) for label, (low, _) in FAULTY.items())
        residuals.append(Panel(title=title, x_label="time [s]", y_label="residual [deg/s]", curves=shown, spans=spans))
        local = []
        for label, window in FAULTY.items():
            p, q = density_pair(flown, options, axis=axis, window=window)
            inside = t[_in_window(t, window)]
            fixed = np.full_like(inside, p.pilot_bandwidth)
            local += [curve(label, inside, p.bandwidths), curve("", inside, fixed, style="dashed")]
            reach = float(np.max(np.abs(p.samples) + REACH * p.bandwidths))
            at = np.linspace(-reach, reach, POINTS)
            same = kernel_density(p.samples, exponent=0.0)
            share, edges = np.histogram(p.samples, bins=BINS, density=True)
            densities.append(
                Panel(
                    title=f"{title}, fault of {label}",
                    x_label="residual [deg/s]",
                    y_label="density [s/deg]",
                    curves=(
                        curve("data", np.append(edges[0], edges), np.concatenate([[0.0], share, [0.0]]), style="steps"),
                        curve("adaptive bandwidth", at, np.exp(log_density(p, at))),
                        curve("fixed bandwidth", at, np.exp(log_density(same, at)), style="dashed"),
                        curve("no fault", at, np.exp(log_density(q, at)), style="dotted"),
                    ),
                    y_limits=(0.0, 1.25 * float(max(share.max(), np.exp(log_density(p, at)).max()))),
                )
            )
        bandwidths.append(Panel(title=title, x_label="time [s]", y_label="bandwidth [deg/s]", curves=tuple(local)))
    return [
        drawing(page, "f16_manoeuvre", manoeuvre),
        drawing(page, "f16_residuals", residuals),
        drawing(page, "f16_bandwidths", bandwidths),
        drawing(page, "f16_densities", densities, across=2),
    ]
