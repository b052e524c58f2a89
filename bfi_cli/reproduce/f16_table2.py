"""Table II of the F-16 diagnosability paper: the index of a faulty gyro before the fault, with it, with twice it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..aircraft.f16 import STATES
from ..kernels.density import Density, gaussian_density, kernel_density, log_density
from ..kernels.divergence import jensen_shannon_montecarlo, jensen_shannon_quadrature
from ..report.content import Drawing, Panel, ReportContent, Span, Table, curve
from .f16_flights import Case, F16Options, Residuals, fly_cases, options_from
from .page import Page, drawing, exhibit, fill, load, table
from .record import Settings

__all__ = ["BANDWIDTHS", "TABLE_2", "Indices", "f16_table2", "indices", "montecarlo"]

FloatArray = NDArray[np.float64]
Row = tuple[str, "Indices", bool]

AXES = ("roll rate", "pitch rate")
WINDOWS = ((0.0, 4.0), (4.0, 12.0), (12.0, 20.0))
FAULTY = {"2 deg/s": WINDOWS[1], "4 deg/s": WINDOWS[2]}
TABLE_2, BANDWIDTHS = (np.array(load("f16_table2")[key]) for key in ("index", "bandwidth"))
"""Published: one row per axis, one column per window."""
INSTANT = 1e-6  # s: a sample at the end of a window belongs to the next one
EARLY = 0.2  # just above the published 0.17 and 0.19 of the window before the fault

SEEDS, QUICK_SEEDS, OTHER_SEEDS = 6, 2, 2
QUICK_STEP_S = 0.05
DRAWS = 2000  # values of each density in eq. 17
POINTS, REACH = 401, 3.0  # of a drawn density: points, and bandwidths beyond the samples
LIMITS = (1e-3, 20.0)


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
    others = [] if settings.quick else [(label, _changed(options, change)) for label, change in page["flights"]]
    n_other = min(n, OTHER_SEEDS)
    cases = [Case(options=options, seed=seed) for seed in seeds]
    cases += [Case(options=changed, seed=seed) for _, changed in others for seed in seeds[:n_other]]
    flights = fly_cases(cases, settings.report)
    own = flights[:n]
    found = indices(own, options)
    # The open choices one at a time: first other readings of the same flights, then other flights. The last entry of a
    # row tells whether its index has the same scale.
    rows: list[Row] = [("as chosen", found, True)]
    for label, change in page["readings"]:
        changed = _changed(options, change)
        if changed != options:
            same_scale = (changed.log_base, changed.halves) == (options.log_base, options.halves)
            rows.append((label, indices(own, changed), same_scale))
    for i, (label, changed) in enumerate(others):
        rows.append((label, indices(flights[n + i * n_other : n + (i + 1) * n_other], changed), True))
    value, error = montecarlo(own[0], options, DRAWS, rng=np.random.default_rng(settings.seed))
    off = np.abs(value - indices(own[:1], _changed(options, {"log_base": "2", "halves": True})).index[0])
    values = {
        "rms": found.rms,
        "worst": found.worst,
        "rises": page["rises"][bool(np.all(np.diff(found.index, axis=2) > 0.0))],
        "o": options,
        "corners": ", ".join(f"{time:g} s {degrees:g} deg" for time, degrees in options.aoa_command),
        "variation": ", ".join(f"{value:+g}" for value in options.variation),
        "gains": ", ".join(f"{k:g}" for k in options.observer_gain),
        "kind": {"kde": "kernels", "gaussian": "Gaussian fit"}[options.reference],
        "halves": "" if options.halves else ", without halves",
        "exponent": "by likelihood" if options.exponent is None else f"{options.exponent:g}",
        "draws": DRAWS,
        "off": np.max(off),
        "errors": np.max(off / error),
        "seeds": ", ".join(map(str, seeds)),
    }
    return exhibit(
        page,
        values,
        rows=_compared(page, found),
        tables=[_choices_table(page, rows), _robust_table(page, rows), table(page, "errata", page["errata"])],
        drawings=_drawings(page, own[0], options),
        notes=() if settings.log is None else (page["no_log"],),
    )


def _changed(options: F16Options, change: dict[str, object]) -> F16Options:
    """Return the options with others, lists of the YAML file as the tuples that options have."""
    update = {key: tuple(value) if isinstance(value, list) else value for key, value in change.items()}
    return options.model_copy(update=update)


def indices(flights: Sequence[Residuals], options: F16Options) -> Indices:
    """Return the indices of sets of four flights by quadrature, eq. 15."""
    scale = (1.0 if options.halves else 2.0) * (1.0 if options.log_base == "2" else np.log(2.0))
    pairs = [
        density_pair(flown, options, axis=axis, window=window)
        for flown in flights
        for axis in range(len(AXES))
        for window in WINDOWS
    ]
    shape = (len(flights), len(AXES), len(WINDOWS))
    return Indices(
        index=scale * np.array([jensen_shannon_quadrature(p, q) for p, q in pairs]).reshape(shape),
        bandwidth=np.array([p.pilot_bandwidth for p, _ in pairs]).reshape(shape),
    )


def montecarlo(
    flown: Residuals, options: F16Options, n: int, *, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return J in bits by n values of each density (eq. 17), and its standard errors, both (2, 3)."""
    found = [
        [
            jensen_shannon_montecarlo(*density_pair(flown, options, axis=axis, window=window), n, rng=rng)
            for window in WINDOWS
        ]
        for axis in range(len(AXES))
    ]
    value, error = np.moveaxis(np.array(found), 2, 0)
    return value, error


def density_pair(
    flown: Residuals, options: F16Options, *, axis: int, window: tuple[float, float]
) -> tuple[Density, Density]:
    """Return the density of the residual of a faulty gyro in a window, and that without a fault."""
    faulty = (flown.roll_fault, flown.pitch_fault)[axis][:, axis]
    healthy = (flown.healthy if options.reference_aircraft == "varied" else flown.nominal)[:, axis]
    inside = _in_window(flown.time_s, window)
    normal = healthy if options.reference_window == "whole" else healthy[inside]
    if options.reference == "gaussian":
        q = gaussian_density(normal)
    else:
        q = kernel_density(normal, exponent=options.exponent)
    return kernel_density(faulty[inside], exponent=options.exponent), q


def _in_window(time_s: FloatArray, window: tuple[float, float]) -> NDArray[np.bool_]:
    low, high = window
    return np.asarray((time_s > low - INSTANT) & (time_s < high - INSTANT))


def _compared(page: Page, found: Indices) -> list[Sequence[str]]:
    rows = []
    for row, published, ours in (("index_row", TABLE_2, found.index), ("bandwidth_row", BANDWIDTHS, found.bandwidth)):
        for (i, j), value in np.ndenumerate(published):
            if np.isfinite(value):
                values, (low, high) = ours[:, i, j], WINDOWS[j]
                sd = f" (sd {np.std(values, ddof=1):.3f})" if values.size > 1 else ""
                text = f"{np.mean(values):.3f}{sd}"
                rows.append(fill(page[row], axis=AXES[i], low=low, high=high, published=value, ours=text))
    return rows


def _choices_table(page: Page, rows: Sequence[Row]) -> Table:
    """Return a row per choice, the published values first."""
    body = [("published", *(f"{value:.3f}" for value in TABLE_2.ravel()), "", "")]
    for label, found, _ in rows:
        means = (f"{value:.3f}" for value in found.index.mean(axis=0).ravel())
        body.append((label, *means, f"{found.rms:.3f}", f"{found.worst:.3f}"))
    return table(page, "choices", body)


def _robust_table(page: Page, rows: Sequence[Row]) -> Table:
    """Return in how many of the rows each statement of the paper holds for every set of flights."""
    found = [one for _, one, _ in rows]
    ratio = np.concatenate([one.bandwidth[:, :, 2] / one.bandwidth[:, :, 1] for one in found])
    holds = {
        "rising_first": [one.index[:, :, 1] > one.index[:, :, 0] for one in found],
        "rising_second": [one.index[:, :, 2] > one.index[:, :, 1] for one in found],
        "larger": [one.index[:, 0, 1:] > one.index[:, 1, 1:] for one in found],
        "early": [one.index[:, :, 0] < EARLY for _, one, comparable in rows if comparable],
    }
    shares = {key: f"{sum(bool(np.all(one)) for one in each)} of {len(each)} rows" for key, each in holds.items()}
    ratios = " and ".join(f"{np.min(each):.2f} to {np.max(each):.2f}" for each in ratio.T)
    return table(page, "robust", fill(page["robust"], ratios=ratios, **shares))


def _drawings(page: Page, flown: Residuals, options: F16Options) -> list[Drawing]:
    """Return the figures of one set of flights: manoeuvre, residuals, local bandwidths, densities."""
    t, (times, corners) = flown.time_s, zip(*options.aoa_command, strict=True)
    states = {name: flown.states[:, STATES.index(name)] for name in ("tas", "aoa", "roll", "pitch")}
    angles = [curve(name, t, np.degrees(states[name])) for name in ("aoa", "roll", "pitch")]
    angles.append(curve("aoa, commanded", times, corners, style="dashed"))
    airspeed = (curve("tas", t, states["tas"]),)
    panels: dict[str, list[Panel]] = {
        "f16_manoeuvre": [
            Panel(x_label="time [s]", y_label="angle [deg]", curves=tuple(angles)),
            Panel(x_label="time [s]", y_label="true airspeed [m/s]", curves=airspeed),
        ],
        "f16_residuals": [],
        "f16_bandwidths": [],
        "f16_densities": [],
    }
    for axis, title in enumerate(AXES):
        faulty = (flown.roll_fault, flown.pitch_fault)[axis][:, axis]
        panels["f16_residuals"].append(
            Panel(
                title=title,
                x_label="time [s]",
                y_label="residual [deg/s]",
                curves=(curve("faulty gyro", t, faulty), curve("no fault", t, flown.healthy[:, axis])),
                spans=tuple(Span(label=f"fault of {label}", low=low, high=low) for label, (low, _) in FAULTY.items()),
            )
        )
        pairs = {label: density_pair(flown, options, axis=axis, window=window) for label, window in FAULTY.items()}
        reach = max(float(np.max(np.abs(p.samples) + REACH * p.bandwidths)) for p, _ in pairs.values())
        at = np.linspace(-reach, reach, POINTS)
        bandwidths, densities = [], []
        for label, (p, _) in pairs.items():
            inside = t[_in_window(t, FAULTY[label])]
            fixed = np.full_like(inside, p.pilot_bandwidth)
            bandwidths += [curve(label, inside, p.bandwidths), curve("", inside, fixed, style="dashed")]
            densities.append(curve(f"fault of {label}", at, np.exp(log_density(p, at))))
        reference = next(iter(pairs.values()))[1]
        densities.append(curve("no fault", at, np.exp(log_density(reference, at)), style="dashed"))
        panels["f16_bandwidths"].append(
            Panel(title=title, x_label="time [s]", y_label="bandwidth [deg/s]", curves=tuple(bandwidths))
        )
        panels["f16_densities"].append(
            Panel(
                title=title,
                x_label="residual [deg/s]",
                y_label="density [s/deg]",
                curves=tuple(densities),
                log_y=True,
                y_limits=LIMITS,
            )
        )
    return [drawing(page, name, each) for name, each in panels.items()]
