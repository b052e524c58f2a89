"""The open choices of the F-16 experiment changed one at a time, and what of table II survives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..exhibit import Table
from .f16_flights import Case, Residuals
from .f16_indices import TABLE_2, Indices, indices
from .f16_options import F16Options

__all__ = ["Alternative", "alternatives_table", "flown_alternatives", "other_flights", "other_readings", "robust_table"]

READINGS: tuple[tuple[str, dict[str, object]], ...] = (
    ("reference: kernels", {"reference": "kde"}),
    ("reference: Gaussian fit", {"reference": "gaussian"}),
    ("reference: same window", {"reference_window": "same"}),
    ("reference: nominal aircraft", {"reference_aircraft": "nominal"}),
    ("base e", {"log_base": "e"}),
    ("base e, no halves (eq. 17)", {"log_base": "e", "halves": False}),
    ("base 2, no halves", {"halves": False}),
    ("exponent 0", {"exponent": 0.0}),
    ("exponent by likelihood", {"exponent": None}),
)
FLIGHTS: tuple[tuple[str, dict[str, object]], ...] = (
    ("noise 0.02 deg/s", {"noise_deg_s": 0.02}),
    ("noise 0.1 deg/s", {"noise_deg_s": 0.1}),
    ("roll 0 deg", {"roll_deg": 0.0}),
    ("roll 60 deg", {"roll_deg": 60.0}),
    ("variation -0.10, -0.25, -0.20", {"variation": (-0.10, -0.25, -0.20)}),
    ("variation 0.3, roll 10 deg, noise 0.03", {"variation": (0.3, 0.3, 0.3), "roll_deg": 10.0, "noise_deg_s": 0.03}),
    ("observer gain 10", {"observer_gain": (10.0, 10.0, 10.0)}),
)
HEADS = ("choice", "roll 0-4", "4-12", "12-20 s", "pitch 0-4", "4-12", "12-20 s", "RMS", "worst")
EARLY = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alternative:
    """One row: what was changed, and the indices; `comparable` is false where the index has another scale."""

    label: str
    found: Indices
    comparable: bool = True


def other_flights(options: F16Options, seeds: Sequence[int]) -> list[Case]:
    """Return the flights that the alternatives need, all seeds of one after another."""
    return [Case(options=_changed(options, change), seed=seed) for _, change in FLIGHTS for seed in seeds]


def flown_alternatives(options: F16Options, flights: Sequence[Residuals], n_seeds: int) -> list[Alternative]:
    """Return the indices of `other_flights`."""
    groups = (flights[first : first + n_seeds] for first in range(0, len(flights), n_seeds))
    return [
        Alternative(label=label, found=indices(group, _changed(options, change)))
        for (label, change), group in zip(FLIGHTS, groups, strict=True)
    ]


def other_readings(options: F16Options, flights: Sequence[Residuals]) -> list[Alternative]:
    """Return the indices of the same flights read in other ways."""
    found = []
    for label, change in READINGS:
        changed = _changed(options, change)
        if changed != options:
            same_scale = (changed.log_base, changed.halves) == (options.log_base, options.halves)
            found.append(Alternative(label=label, found=indices(flights, changed), comparable=same_scale))
    return found


def alternatives_table(rows: Sequence[Alternative]) -> Table:
    """Return a row per alternative, the published values first."""
    body = [("published", *_numbers(TABLE_2), "", "")]
    body += [
        (one.label, *_numbers(one.found.index.mean(axis=0)), f"{one.found.rms:.3f}", f"{one.found.worst:.3f}")
        for one in rows
    ]
    return Table(name="choices", title="Other choices, one at a time", heads=HEADS, rows=tuple(body))


def robust_table(rows: Sequence[Alternative]) -> Table:
    """Return in how many of the rows each statement of the paper holds for every set of flights."""
    rising = [np.diff(one.found.index, axis=2) > 0.0 for one in rows]
    larger = [one.found.index[:, 0, 1:] > one.found.index[:, 1, 1:] for one in rows]
    early = [one.found.index[:, :, 0] < EARLY for one in rows if one.comparable]
    ratio = np.concatenate([one.found.bandwidth[:, :, 2] / one.found.bandwidth[:, :, 1] for one in rows])
    body = (
        ("FD(0-4) < FD(4-12), both axes", _share([one[:, :, 0] for one in rising])),
        ("FD(4-12) < FD(12-20), both axes", _share([one[:, :, 1] for one in rising])),
        ("roll above pitch after 4 s", _share(larger)),
        (f"FD(0-4) < {EARLY:g}, both axes", _share(early)),
        (
            "bandwidth ratio 12-20 to 4-12 s, published 2.21 and 1.98",
            f"{np.min(ratio[:, 0]):.2f} to {np.max(ratio[:, 0]):.2f} and "
            f"{np.min(ratio[:, 1]):.2f} to {np.max(ratio[:, 1]):.2f}",
        ),
    )
    heads = ("statement of the paper", "holds in")
    return Table(name="robust", title="What does not hang on the open choices", heads=heads, rows=body)


def _changed(options: F16Options, change: dict[str, object]) -> F16Options:
    return options.model_copy(update=change)


def _share(rows: Sequence[NDArray[np.bool_]]) -> str:
    return f"{sum(bool(np.all(one)) for one in rows)} of {len(rows)} rows"


def _numbers(values: NDArray[np.float64]) -> tuple[str, ...]:
    return tuple(f"{value:.3f}" for value in np.ravel(values))
