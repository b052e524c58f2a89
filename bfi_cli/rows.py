"""The rows of the tables of an identification, as texts: the same on a terminal and in the report."""

from __future__ import annotations

from .faults import Fault, FaultEstimate
from .identify.methods import METHODS
from .identify.result import Candidate, IdentifyResult
from .provenance import Provenance
from .wording import interval, number, quantity, shortened

__all__ = [
    "candidate_rows",
    "fault_rows",
    "model_rows",
    "provenance_rows",
    "residual_rows",
    "summary_rows",
    "truth_rows",
]

Row = tuple[str, ...]
WHITE_ABOVE = 0.01
NAME_LETTERS = 40


def summary_rows(result: IdentifyResult) -> list[Row]:
    """Return what was analysed, as (name, value)."""
    log = result.log
    duration = log.stop_s - log.start_s
    return [
        ("Window", f"{number(log.start_s)} to {number(log.stop_s)} s ({number(duration)} s, {log.n_samples} samples)"),
        ("Rate", f"{number(log.rate_hz)} Hz (recorded at {number(log.native_rate_hz)} Hz)"),
        ("Inputs", ", ".join(result.model.inputs) or "none"),
        ("Outputs", ", ".join(result.model.outputs)),
        ("Dictionary", f"{len(result.candidates)} candidates, {len(result.faults)} declared"),
    ]


def fault_rows(result: IdentifyResult) -> list[Row]:
    """Return name, shape, channel, when, magnitude, 95 % interval, standard deviation, physical value per fault."""
    return [_fault_row(estimate) for estimate in result.faults]


def _fault_row(estimate: FaultEstimate) -> Row:
    fault, spread = estimate.fault, 1.96 * estimate.sd
    return (
        shortened(estimate.name, NAME_LETTERS),
        fault.shape if fault.frequency_hz is None else f"{fault.shape}, {fault.frequency_hz:.4g} Hz",
        fault.channel,
        _when(fault),
        _with_unit(number(estimate.magnitude, spread=spread, extra=1), estimate.unit),
        interval(estimate.ci95, extra=1),
        number(estimate.sd, digits=2),
        _with_unit(number(estimate.physical_value), estimate.physical_unit),
    )


def _when(fault: Fault) -> str:
    until = "" if fault.offset_s is None else f" to {fault.offset_s:.6g}"
    return f"{fault.onset_s:.6g}{until} s"


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}".rstrip()


def candidate_rows(result: IdentifyResult) -> list[tuple[bool, Row]]:
    """Return (declared, (name, channel, magnitude, sd, minimal detectable, note)) per dictionary entry."""
    return [(candidate.active, _candidate_row(candidate)) for candidate in result.candidates]


def _candidate_row(candidate: Candidate) -> Row:
    spread = None if candidate.sd is None else 1.96 * candidate.sd
    magnitude = number(candidate.magnitude, spread=spread, extra=1)
    return (
        shortened(candidate.name, NAME_LETTERS),
        candidate.channel,
        magnitude if magnitude == "-" else _with_unit(magnitude, candidate.unit),
        number(candidate.sd, digits=2),
        quantity(candidate.minimal_detectable, candidate.unit),
        candidate.note or "",
    )


def residual_rows(result: IdentifyResult) -> list[Row]:
    """Return output, noise sd, VAF, whiteness, plain 5-sigma alarms and their first time per output."""
    units = {series.channel: series.unit for series in result.outputs}
    return [
        (
            summary.channel,
            quantity(result.model.noise_sd.get(summary.channel), units.get(summary.channel, "")),
            _with_unit(number(result.vaf_output.get(summary.channel)), "%"),
            _whiteness(summary.ljung_box_p),
            quantity(5.0 * summary.plain_sd, units.get(summary.channel, "")),
            _alarms(summary.plain_alarms_s),
        )
        for summary in result.residuals
    ]


def _whiteness(p: float) -> str:
    if p != p:
        return "-"
    return f"p = {number(p, digits=2)}" + ("" if p >= WHITE_ABOVE else ", not white: structure is left")


def _alarms(alarms_s: tuple[float, ...]) -> str:
    return f"{len(alarms_s)}, first at {number(min(alarms_s), digits=6)} s" if alarms_s else "none"


def truth_rows(result: IdentifyResult) -> list[Row]:
    """Return the comparison with the injected truth as (name, value), empty where there is none."""
    truth = result.truth
    if truth is None:
        return []
    error = truth.magnitude_error
    return [
        ("Isolation", "exactly the injected faults" if truth.isolated else "not the injected faults"),
        ("False alarms", ", ".join(truth.false_alarms) or "none"),
        ("Missed", ", ".join(truth.missed) or "none"),
        ("Relative magnitude error", "-" if error is None else f"{number(100.0 * error, digits=2)} %"),
        *((f"VAF of the fault on {name}", _percent(value)) for name, value in truth.vaf_fault.items()),
    ]


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{number(value, digits=5)} %"


def model_rows(result: IdentifyResult) -> list[Row]:
    """Return model and solver as (name, value)."""
    model, solver = result.model, result.solver
    return [
        ("Model", f"VARX of order {model.order} at {number(model.rate_hz)} Hz"),
        ("Inputs act", "in the same sample too" if model.feedthrough else "from the next sample on"),
        ("Orders tried", ", ".join(map(str, model.orders)) or "none, the order was given"),
        ("Method", METHODS[solver.method].summary if solver.method in METHODS else solver.method),
        ("Termination", f"{solver.termination} ({solver.iterations} iterations)"),
        ("Condition number", number(solver.condition_number, digits=3)),
    ]


def provenance_rows(provenance: Provenance) -> list[Row]:
    """Return where the numbers come from, as (name, value)."""
    return [
        ("Command", provenance.command),
        ("Date", provenance.date),
        ("Program", f"bfi {provenance.version}, numpy {provenance.numpy}, scipy {provenance.scipy}"),
        ("Seed", str(provenance.seed)),
        ("Log, sha256", provenance.log_sha256 or "not known"),
        ("Configuration, sha256", provenance.config_sha256 or "none"),
        ("Dictionary, sha256", provenance.dictionary_sha256 or "none"),
    ]
