"""Captions of the figures, as a flight-test report prints them."""

from __future__ import annotations

from collections.abc import Callable

from ..identify.result import IdentifyResult
from ..wording import number

__all__ = ["caption"]


def caption(figure: str, result: IdentifyResult) -> str:
    """Return the caption of one figure of the result.

    Parameters
    ----------
    figure : "outputs", "fault", "magnitudes", "residuals" or "orders".
    """
    return CAPTIONS[figure](result)


def _outputs(result: IdentifyResult) -> str:
    outputs, inputs = ", ".join(result.model.outputs), ", ".join(result.model.inputs)
    return (
        f"Measured {outputs} with the one-step prediction of the final model and the measurement corrected for the "
        f"declared faults; below, {inputs}. {result.log.n_samples} samples at {number(result.model.rate_hz)} Hz, "
        f"{number(result.log.start_s)} to {number(result.log.stop_s)} s on the log's time axis. "
        "Dotted vertical lines: start and end of the declared faults."
    )


def _fault(result: IdentifyResult) -> str:
    known = " The injected fault is known and drawn beneath." if result.truth is not None else ""
    return f"Reconstructed fault on each output with its pointwise 95 % band (1.96 standard deviations).{known}"


def _magnitudes(result: IdentifyResult) -> str:
    return (
        "Magnitude of every dictionary entry with its 95 % interval, in units of its own minimal detectable magnitude: "
        "what would be found with 90 % power at a false-alarm rate of 1 % shared by all entries. Filled squares were "
        "declared; open circles are what the entry would be if it were added. Inside the grey strip nothing could have "
        "been found reliably. The scale is linear up to 1 and logarithmic beyond."
    )


def _residuals(result: IdentifyResult) -> str:
    return (
        "One-step residual of the fault-free model (top; dashed: ±5 robust standard deviations, triangles: samples "
        "beyond them) and of the final model (bottom), and the autocorrelation of the latter with the 95 % band of "
        "white noise. The plain 5-sigma test finds abrupt steps but names no shape and misses slow drifts. "
        "Where the residual of the fault-free model is far outside, its axis is logarithmic beyond ±5 σ."
    )


def _orders(result: IdentifyResult) -> str:
    model, solver = result.model, result.solver
    return (
        "Model-selection criterion over the model order, above its least value, without a fault and with the best set "
        f"of faults; order {model.order} was used. The gap between the curves is the evidence for the faults. "
        f"Condition number of the regressors: {number(solver.condition_number, digits=3)}."
    )


CAPTIONS: dict[str, Callable[[IdentifyResult], str]] = {
    "outputs": _outputs,
    "fault": _fault,
    "magnitudes": _magnitudes,
    "residuals": _residuals,
    "orders": _orders,
}
