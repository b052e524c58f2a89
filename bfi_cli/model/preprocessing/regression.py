"""The regression of an analysis: signals of a window at one rate, scaled and compressed to one triangular factor."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...config import Config, Selection
from ...errors import LogError
from ...kernels import FloatArray
from ...kernels.atom_signals import powers, some_of, standardised
from ...kernels.covariance import FitRows, Layout, unfold_own
from ...kernels.lagged import Compressed, EarlierRows, restrict, with_fault, with_scaled_outputs
from ...kernels.model_selection import Penalty
from ...kernels.progress import Report, StoppingRule, silent
from ...kernels.risro_varx import SparseStage, VarxSolution, risro_varx
from ...kernels.runs import running_weights
from ...kernels.variable_projection import Fit, ProjectedRegression, fit_magnitudes, project_inputs, with_unit_root
from ...kernels.whiteness import effective_rows
from .signals import EXACT, Signals

# Smallest standard deviation of a prediction error, over that of the output: round-off at the log's own rate, and what
# decimation leaves unpredicted even of a record that a VARX explains exactly. Smaller errors are no noise.
ROUND_OFF = 1e-10
DECIMATION_REMAINDER = 1e-4
# Seconds on each side over which the size of the prediction error is taken: gusts last tens of seconds. A window whose
# running deviation spreads by less than this factor, as white noise's does, is left unweighted.
RUNNING_S, UNEQUAL = 10.0, 2.0
# With fewer rows per coefficient the model fits the noise of a short window rather than the dynamics.
ROWS_PER_REGRESSOR = 2.0
# Stretches of rows over which the slope of a signal by its output is averaged; it changes slowly.
MOST_SLOPES = 512


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RegressionData:
    """The regression that the kernels solve, in scaled units.

    Attributes
    ----------
    signals : the same in SI units, without those of the dictionary.
    atoms : the dictionary entries that may act; atom j of the regression is entry atoms[j].
    layout : scaled arrays; data : their triangular factor at the largest order.
    center : (n_outputs,) and unit : (n_outputs,) of the outputs, so that y = center + unit * scaled.
    magnitude_unit : (n_atoms,) z in SI = magnitude_unit * scaled z.
    orders : to choose from.
    floor : smallest standard deviation a prediction error can have, scaled.
    centred : whether the mean of the signals is taken off.
    """

    signals: Signals
    atoms: tuple[int, ...]
    layout: Layout
    data: Compressed
    center: FloatArray
    unit: FloatArray
    magnitude_unit: FloatArray
    orders: tuple[int, ...]
    floor: float
    centred: bool
    _problems: dict[int, ProjectedRegression] = field(init=False, repr=False, default_factory=dict)
    _fits: dict[tuple[int, tuple[int, ...], bool], Fit] = field(init=False, repr=False, default_factory=dict)

    @property
    def n_rows(self) -> int:
        """Rows of the regression, those of earlier records too: all orders are fitted on those of the largest."""
        return self.data.n_rows

    def effective_rows(self, error: FloatArray, n_free: float = 0.0) -> float:
        """Return how many independent rows there are, where those of the record have a prediction error.

        Parameters
        ----------
        n_free : coefficients of an output, twice of which are the least.
        """
        return min(max(effective_rows(error) * self.n_rows / len(error), 2.0 * n_free), float(self.n_rows))

    def penalty(self, rules: Selection, n_candidates: int, n_effective: float | None = None) -> Penalty:
        """Return the criterion of a selection among some atoms, every row of which counts where none is told."""
        return Penalty(
            n_rows=self.n_rows,
            n_effective=float(self.n_rows) if n_effective is None else n_effective,
            n_candidates=n_candidates,
            evidence=rules.evidence,
            extended=rules.criterion == "ebic",
        )

    @property
    def rows_s(self) -> FloatArray:
        """Times of the rows of the record."""
        return self.signals.time_s[self.layout.first :]

    def problem(self, order: int) -> ProjectedRegression:
        """Return the regression of one order, made at the first call."""
        if order not in self._problems:
            problem = project_inputs(self.at_order(order), order, floor=self.floor)
            self._problems[order] = replace(problem, scaling=self.scaling, slopes=self.slopes)
        return self._problems[order]

    def fitted(self, order: int, atoms: Sequence[int], start: FloatArray, *, unit_root: bool = False) -> Fit:
        """Return the fit of a support at an order, made from `start` at the first call.

        Parameters
        ----------
        unit_root : of the model that holds a root at 1.
        """
        key = order, tuple(atoms), unit_root
        if key not in self._fits:
            problem = self.problem(order)
            self._fits[key] = fit_magnitudes(with_unit_root(problem) if unit_root else problem, key[1], start)
        return self._fits[key]

    @property
    def scaling(self) -> dict[int, tuple[int, float]]:
        """Rows of the atoms whose signal is the output itself, see `ProjectedRegression.scaling`."""
        atoms = [j for j, entry in enumerate(self.atoms) if entry in self.signals.scaling]
        rows = np.count_nonzero(self.layout.theta[self.layout.first :, :, list(atoms)], axis=(0, 1)).tolist()
        return {j: (n, float(self.magnitude_unit[j])) for j, n in zip(atoms, rows, strict=True)}

    def without_record(self) -> RegressionData:
        """Return the regression without what only its factorisation needs, which a long record has much of."""
        left = replace(self, layout=replace(self.layout, weights=None))
        left._problems.update(self._problems)
        return left

    @property
    def slopes(self) -> tuple[dict[int, FloatArray], FloatArray] | None:
        """Slopes of the atoms whose signal changes with the outputs, where one is no output itself; else None."""
        if not {*self.atoms} & self.signals.slopes.keys():
            return None
        theta, first = self.layout.theta, self.layout.first
        n_rows, n_outputs = self.layout.y.shape[0] - first, self.layout.y.shape[1]
        blocks = np.array_split(np.arange(n_rows), min(n_rows, MOST_SLOPES))
        starts = np.array([block[0] for block in blocks])
        rows = np.tile(np.array([float(len(block)) for block in blocks])[:, None], (1, n_outputs))
        mean_slopes = {}
        for j, entry in enumerate(self.atoms):
            if entry in self.signals.slopes:
                slope = self.signals.slopes[entry][first:]
            elif entry in self.signals.scaling:
                slope = (theta[first:, :, j] != 0.0).astype(float)
            else:
                continue
            means = np.add.reduceat(slope, starts, axis=0) / rows
            mean_slopes[j] = (means * self.magnitude_unit[j]).ravel()
        return mean_slopes, rows.ravel()

    def at_order(self, order: int) -> Compressed:
        """Return the factor of one order."""
        return restrict(self.data, order=order)

    def unfold(self, fit: Fit) -> FitRows:
        """Return a fit row by row, with the signatures of its support."""
        return unfold_own(self.layout, fit)

    def with_dictionary(
        self,
        theta: FloatArray,
        atoms: Sequence[int],
        report: Report = silent,
        *,
        slopes: Mapping[int, FloatArray],
        same: Collection[int] = (),
    ) -> RegressionData:
        """Return the regression of the same record with other signals.

        Parameters
        ----------
        theta : (n_samples, n_outputs, n_entries) in SI units, of all entries; atoms : those that may act.
        report : receives the progress.
        slopes : of the signals, see `Signals.slopes`.
        same : atoms whose signals are as before, of whose supports the fits are kept.
        """
        scaled, magnitude_unit = _scaled_signals(theta, atoms, self.unit)
        layout = self.layout.with_signals(scaled)
        other = replace(
            self,
            signals=replace(self.signals, slopes=slopes),
            atoms=tuple(atoms),
            layout=layout,
            data=layout.factor(report),
            magnitude_unit=magnitude_unit,
        )
        other._fits.update((key, fit) for key, fit in self._fits.items() if {*fit.atoms} <= {*same})
        return other

    def with_fault(self, magnitudes: FloatArray) -> RegressionData:
        """Return the regression of the same record with the fault ``theta @ magnitudes`` added to its outputs.

        No factorisation is needed: the fault adds columns of the factor to those of the outputs, and the new centre
        and scale of the outputs combine these with the column of ones. `signals` stay those without the fault.

        Parameters
        ----------
        magnitudes : (n_atoms,) in SI units; each atom acts on one output.
        """
        z, earlier = magnitudes / self.magnitude_unit, self.layout.earlier
        faulty = self.layout.y + (self.layout.theta.reshape(-1, z.size) @ z).reshape(self.layout.y.shape)
        y, center, unit = standardised(self.center + self.unit * faulty, centred=self.centred)
        outputs = np.zeros(len(z), dtype=np.intp)
        outputs[[atom for _, atom in self.data.columns.signals]] = [output for output, _ in self.data.columns.signals]
        scale, shift = self.unit / unit, (self.center - center) / unit
        return replace(
            self,
            layout=replace(self.layout, y=y, earlier=earlier and earlier.scaled(scale)),
            data=with_scaled_outputs(with_fault(self.data, z), scale, shift),
            center=center,
            unit=unit,
            magnitude_unit=self.magnitude_unit / scale[outputs],
        )


def build_regression(
    signals: Signals,
    atoms: Sequence[int],
    config: Config,
    *,
    orders: Sequence[int] | None = None,
    report: Report = silent,
) -> RegressionData:
    """Scale the signals as the configuration says and factorise them once, for every order and every fault.

    Parameters
    ----------
    atoms : dictionary entries to look for.
    orders : to choose from; default the configuration's.
    report : receives the progress.

    Raises
    ------
    LogError : the window has no rows for any order.
    """
    model, n_inputs, n_outputs = config.model, signals.u.shape[1], signals.y.shape[1]
    wanted = orders or (model.orders if model.order == "auto" else (model.order,))
    orders = feasible_orders(signals.path, len(signals.time_s), wanted, n_inputs=n_inputs, n_outputs=n_outputs)
    centred = config.conditioning.detrend == "constant"
    (u, _, u_unit), (y, center, unit) = (standardised(x, centred=centred) for x in (signals.u, signals.y))
    theta, magnitude_unit = _scaled_signals(signals.theta, atoms, unit)
    floor = ROUND_OFF if signals.factor == 1 else DECIMATION_REMAINDER
    layout = Layout(u=u, y=y, theta=theta, first=max(orders), feedthrough=config.feedthrough)
    is_even = config.conditioning.variance != "running" or as_published(config)
    if not is_even:
        layout = _evened(layout, floor, signals.rate_hz)
    if signals.earlier:
        units = np.concatenate([u_unit, unit])
        earlier = [_earlier_rows(record, layout, units, floor, is_even=is_even) for record in signals.earlier]
        layout = replace(layout, earlier=EarlierRows.together(earlier))
    return RegressionData(
        signals=replace(signals, theta=np.empty((*signals.y.shape, 0))),
        atoms=tuple(atoms),
        layout=layout,
        data=layout.factor(report),
        center=center,
        unit=unit,
        magnitude_unit=magnitude_unit,
        orders=orders,
        floor=floor,
        centred=centred,
    )


def fault_free_fits(regression: RegressionData, config: Config, n_candidates: int) -> tuple[list[Fit], Penalty]:
    """Return the fits without fault terms at every order, scored, and the penalty with the effective rows of the best.

    Parameters
    ----------
    n_candidates : entries of the dictionary that could be declared.
    """
    fits = [fit_magnitudes(regression.problem(order), ()) for order in regression.orders]
    return scored_by(regression, fits, regression.penalty(config.selection, n_candidates))


def scored_by(regression: RegressionData, fits: Sequence[Fit], penalty: Penalty) -> tuple[list[Fit], Penalty]:
    """Return fits scored by a criterion with the effective rows of the best of them, and that criterion."""
    best = min(fits, key=penalty.criterion)
    free = best.n_parameters / regression.layout.y.shape[1]
    effective = regression.effective_rows(regression.unfold(best).weighted_error, free)
    penalty = replace(penalty, n_effective=effective)
    return [penalty.scored(fit) for fit in fits], penalty


def _scaled_signals(theta: FloatArray, atoms: Sequence[int], unit: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the signals of some entries over the unit of their output, of unit power, and the divisor's inverse."""
    scaled = some_of(theta, atoms) / unit[:, None]
    power = powers(scaled)
    magnitude_unit = 1.0 / np.where(power > 0.0, power, 1.0)
    scaled *= magnitude_unit
    return scaled, magnitude_unit


def _evened(layout: Layout, floor: float, rate_hz: float) -> Layout:
    """Return the record with rows weighted inversely to the running size of their prediction error without a fault.

    It is left as it is where that size does not change, and where the error is round-off, which has no gusts.
    """
    plain = layout.with_signals(layout.theta[:, :, []])
    data = plain.factor()
    fit = fit_magnitudes(project_inputs(data, layout.first, floor=floor), ())
    error = unfold_own(plain, fit).error
    if float(np.abs(error).max()) < EXACT:
        return layout
    weights = running_weights(error, round(RUNNING_S * rate_hz))
    if weights.max() < UNEQUAL * weights.min():
        return layout
    return layout.with_weights(np.concatenate([np.ones(layout.first), weights]))


def _earlier_rows(earlier: Signals, layout: Layout, units: FloatArray, floor: float, *, is_even: bool) -> EarlierRows:
    """Return the lagged rows of another record in the units of a layout.

    Parameters
    ----------
    units : (n_inputs + n_outputs,) that the layout is scaled by.
    is_even : gusts that come and go within the record do not count.

    Raises
    ------
    LogError : the record has no rows for the order of the layout.
    """
    n_inputs = layout.u.shape[1]
    try:
        feasible_orders(
            earlier.path, len(earlier.time_s), [layout.first], n_inputs=n_inputs, n_outputs=layout.y.shape[1]
        )
    except LogError as problem:
        raise LogError(f"--together: {problem}") from None
    z = np.hstack([earlier.u, earlier.y])
    z = (z - z.mean(axis=0)) / units
    u, y = z[:, :n_inputs], z[:, n_inputs:]
    other = Layout(u=u, y=y, theta=np.empty((*y.shape, 0)), first=layout.first, feedthrough=layout.feedthrough)
    if not is_even:
        other = _evened(other, floor, earlier.rate_hz)
    weights = np.ones(len(y)) if other.weights is None else other.weights
    other = other.with_weights(earlier.weight * weights)
    return EarlierRows.of(other.factor())


def longest_order(n_samples: int, *, n_inputs: int, n_outputs: int) -> int:
    """Return the highest order that a window of so many samples has rows for, 0 for none."""
    # order + ROWS_PER_REGRESSOR (1 + n_inputs (order + 1) + n_outputs order) samples at least.
    left = n_samples - ROWS_PER_REGRESSOR * (1 + n_inputs)
    return max(0, int(left // (1 + ROWS_PER_REGRESSOR * (n_inputs + n_outputs))))


def feasible_orders(
    path: str, n_samples: int, wanted: Sequence[int], *, n_inputs: int, n_outputs: int
) -> tuple[int, ...]:
    """Return those of the wanted orders that the window has rows for, ascending.

    Raises
    ------
    LogError : it has rows for none; `path` of the log is for the message.
    """
    longest = longest_order(n_samples, n_inputs=n_inputs, n_outputs=n_outputs)
    orders = tuple(order for order in sorted(wanted) if order <= longest)
    if not orders:
        advice = f"give --order {longest} or less" if longest else "choose a longer window"
        raise LogError(
            f"{path}: order {min(wanted)} needs more than the {n_samples} samples of the window; "
            f"{advice}, a higher --rate or a longer window"
        )
    return orders


def solve(data: Compressed, config: Config) -> VarxSolution:
    """Solve the regression of one order, with the published stage where the thesis is followed to the letter."""
    return risro_varx(data, settings=stopping_of(config), as_published=as_published(config), sparse=stage_of(config))


def stage_of(config: Config) -> SparseStage:
    """Return the settings of the sparsity stage."""
    rules = config.risro
    alpha, r, p0 = (None if size == "auto" else size for size in (rules.alpha, rules.r, rules.p0))
    return SparseStage(kind=rules.sparsity, alpha=alpha, r=r, p0=p0, updates=rules.updates)


def stopping_of(config: Config) -> StoppingRule:
    """Return when RISRO stops."""
    return StoppingRule(max_iterations=config.risro.max_iterations, tolerance=config.risro.tolerance)


def as_published(config: Config) -> bool:
    """Say whether the thesis is followed to the letter."""
    return config.risro.as_published or config.method == "risro-as-published"


def decides_by_rule(config: Config) -> bool:
    """Say whether the thesis's rule declares the faults, instead of the stage and the criterion."""
    return as_published(config) or config.risro.sparsity == "none" or config.selection.threshold is not None
