"""A conditioned record made ready for estimation: live atoms, scales, one triangular factor, feasible orders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..conditioning import Conditioned
from ..config import Config
from ..errors import LogError
from ..kernels.bilinear import Bilinear, bilinear
from ..kernels.covariance import Layout
from ..kernels.lagged import Compressed, compress
from ..kernels.progress import Report, parts, silent

__all__ = ["Study", "feasible_orders", "floor_of", "left_out", "prepare", "study_of"]

FloatArray = NDArray[np.float64]

STILL = 1e-9
DEPENDENT = 1e-7
ROUND_OFF = 1e-10
LEFTOVER = 1e-4
ROWS_PER_REGRESSOR = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Study:
    """What the kernels work on, in scaled units.

    Attributes
    ----------
    conditioned : the record in SI units.
    live : indices of the live atoms in the dictionary; atom j of the study is dictionary entry live[j].
    layout : scaled arrays; data : their triangular factor at the largest order.
    center : (n_outputs,) and unit : (n_outputs,) of the outputs, so that y = center + unit * scaled.
    magnitude_unit : (n_live,) z in SI = magnitude_unit * scaled z.
    orders : orders to choose from.
    floor : smallest standard deviation a prediction error can have, scaled.
    """

    conditioned: Conditioned
    live: tuple[int, ...]
    layout: Layout
    data: Compressed
    center: FloatArray
    unit: FloatArray
    magnitude_unit: FloatArray
    orders: tuple[int, ...]
    floor: float

    @property
    def n_rows(self) -> int:
        return self.data.n_rows

    def problem(self, order: int) -> Bilinear:
        """Return the regression of one order."""
        return bilinear(self.data, order, floor=self.floor)


def study_of(
    path: str,
    conditioned: Conditioned,
    live: Sequence[int],
    config: Config,
    *,
    orders: Sequence[int] | None = None,
    any_order: bool = False,
    report: Report = silent,
) -> Study:
    """Make a conditioned record ready as the configuration says.

    Parameters
    ----------
    path : of the log, for messages.
    live : dictionary entries to look for.
    orders : to choose from; default the configuration's.
    any_order : choose from the configuration's list even where it names one order.
    report : told how far it is.

    Raises
    ------
    LogError : the window has no rows for any order.
    """
    model = config.model
    wanted: int | Sequence[int] = model.orders if any_order or model.order == "auto" else int(model.order)
    widths = (len(config.inputs), len(config.outputs))
    return prepare(
        conditioned,
        live,
        orders=feasible_orders(path, len(conditioned.time_s), orders or wanted, widths),
        feedthrough=config.method == "ml" if model.feedthrough is None else model.feedthrough,
        floor=floor_of(conditioned),
        centred=config.conditioning.detrend == "constant",
        report=report,
    )


def prepare(
    conditioned: Conditioned,
    live: Sequence[int],
    *,
    orders: Sequence[int],
    feedthrough: bool,
    floor: float,
    centred: bool = True,
    report: Report = silent,
) -> Study:
    """Scale a conditioned record and factorise it once."""
    u, _, _ = _standardised(conditioned.u, centred)
    y, center, unit = _standardised(conditioned.y, centred)
    theta = conditioned.theta[:, :, list(live)] / unit[:, None]
    power = np.sqrt(np.mean(np.sum(theta**2, axis=1), axis=0))
    magnitude_unit = 1.0 / np.where(power > 0.0, power, 1.0)
    theta = theta * magnitude_unit
    return Study(
        conditioned=conditioned,
        live=tuple(live),
        layout=Layout(u=u, y=y, theta=theta, first=max(orders), feedthrough=feedthrough),
        data=compress(u, y, theta, order=max(orders), feedthrough=feedthrough, report=report),
        center=center,
        unit=unit,
        magnitude_unit=magnitude_unit,
        orders=tuple(orders),
        floor=floor,
    )


def _standardised(x: FloatArray, centred: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    center = x.mean(axis=0) if centred else np.zeros(x.shape[1])
    unit = np.std(x, axis=0)
    unit = np.where(unit > 0.0, unit, 1.0)
    return (x - center) / unit, center, unit


def floor_of(conditioned: Conditioned) -> float:
    """Return the floor of the prediction error relative to the output's spread.

    Decimation leaves a small predictable remainder even where the full-rate model is exact; below it nothing is noise.
    """
    return ROUND_OFF if conditioned.factor == 1 else LEFTOVER


def feasible_orders(path: str, n_samples: int, wanted: int | Sequence[int], widths: tuple[int, int]) -> tuple[int, ...]:
    """Return the orders the window has rows for.

    Parameters
    ----------
    path : of the log, for messages.
    n_samples : after conditioning.
    wanted : one order (which must fit), or the ones to choose from.
    widths : number of inputs and of outputs.

    Raises
    ------
    LogError : none fits.
    """

    def fits(order: int) -> bool:
        regressors = 1 + widths[0] * (order + 1) + widths[1] * order
        return n_samples - order >= ROWS_PER_REGRESSOR * regressors

    candidates = (wanted,) if isinstance(wanted, int) else tuple(sorted(wanted))
    orders = tuple(order for order in candidates if fits(order))
    if not orders:
        longest = max((order for order in range(1, n_samples) if fits(order)), default=0)
        advice = f"give --order {longest} or less" if longest else "choose a longer window"
        raise LogError(
            f"{path}: order {min(candidates)} needs more than the {n_samples} samples of the window; "
            f"{advice}, a higher --rate or a longer window"
        )
    return orders


def left_out(
    conditioned: Conditioned, names: Sequence[str], indices: Sequence[int], report: Report = silent
) -> dict[int, str]:
    """Return why atoms cannot be told apart from nothing, from a constant, or from earlier atoms (METHOD section 4).

    Parameters
    ----------
    conditioned : the record.
    names : of all dictionary entries.
    indices : the entries to look at; earlier ones are kept.
    report : told how far it is.
    """
    reasons: dict[int, str] = {}
    flat = conditioned.theta.reshape(-1, conditioned.theta.shape[2])
    n_y = conditioned.theta.shape[1]
    basis = np.kron(np.ones((len(conditioned.time_s), 1)), np.eye(n_y)) / np.sqrt(len(conditioned.time_s))
    kept: list[int] = []
    for j, _ in parts(report, indices):
        signal = flat[:, j]
        size = float(np.linalg.norm(signal))
        if size == 0.0:
            reasons[j] = f"'{names[j]}' is zero in the window; move its onset or widen the window"
        elif float(np.max(np.ptp(conditioned.theta[:, :, j], axis=0))) <= STILL * float(np.max(np.abs(signal))):
            reasons[j] = (
                f"'{names[j]}' does not change in the window, as the model's constant does; move its onset inside"
            )
        else:
            rest = signal - basis @ (basis.T @ signal)
            rest -= basis @ (basis.T @ rest)
            if np.linalg.norm(rest) <= DEPENDENT * size:
                reasons[j] = _dependence(flat, names, j, kept)
            else:
                basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
                kept.append(j)
    return reasons


def _dependence(flat: FloatArray, names: Sequence[str], j: int, kept: Sequence[int]) -> str:
    alike = [abs(float(flat[:, j] @ flat[:, i])) / float(np.linalg.norm(flat[:, i])) for i in kept]
    nearest = kept[int(np.argmax(alike))] if kept else j
    if alike and max(alike) >= (1.0 - DEPENDENT) * float(np.linalg.norm(flat[:, j])):
        return f"'{names[j]}' is the same signal as '{names[nearest]}' in the window; only the latter is kept"
    return f"'{names[j]}' is a combination of the entries before it (nearest '{names[nearest]}') in the window"
