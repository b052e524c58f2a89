"""The result of an identification: frozen data, from which table, JSON, CSV, figures and report are made.

Its JSON document is that of the contract: plain data, and back to redraw a stored result.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..decision import KINDS, Candidate, Proof
from ..decision.implausible import Implausible
from ..epoch import Epoch
from ..errors import ConfigError
from ..faults import Decision, Fault, FaultEstimate
from ..faults.fault import Comparison
from ..faults.shapes import SHAPES, Kind
from ..kernels import FloatArray
from ..notes import Note
from ..quantities.channels import Conversion
from ..quantities.text import Units, instant, number
from ..report.first_screen import window_screen
from ..report.presented import Presented
from ..serialization import Provenance, document_of, document_of_kind, from_plain, mapping, member, to_plain


@dataclass(frozen=True, slots=True, kw_only=True)
class LogSummary:
    """The analysed window: `rate_hz` and `n_samples` are those of the analysis, times are on the log's own axis.

    `clock` is the moment from which they count, see `Epoch.iso`; None for a log without a clock.
    """

    path: str
    rate_hz: float
    n_samples: int
    start_s: float
    stop_s: float
    native_rate_hz: float
    clock: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSummary:
    """The model behind a result; `orders` and `criterion_...` are the order selection curve, empty for one order."""

    order: int
    rate_hz: float
    feedthrough: bool
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    noise_sd: Mapping[str, float]
    orders: tuple[int, ...] = ()
    criterion_no_fault: tuple[float, ...] = ()
    criterion_best: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanSummary:
    """What the scan over all onsets says of the same window.

    Attributes
    ----------
    decision : None where it was not made.
    faults : its declared faults in words.
    note : whether it agrees, or why it was not made.
    """

    decision: Decision | None
    verdicts: Mapping[Kind, Decision]
    faults: tuple[str, ...]
    note: str

    @classmethod
    def not_made(cls, why: str) -> ScanSummary:
        """Return what there is to say where the scan was not made."""
        return cls(decision=None, verdicts=dict.fromkeys(KINDS, "inconclusive"), faults=(), note=why)


@dataclass(frozen=True, slots=True, kw_only=True)
class SparsityRun:
    """The sparsity stage from one start: its steps, whether they settled, and the supports that it visited in turn."""

    order: int
    start: str
    iterations: int
    converged: bool
    supports: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SparsitySummary:
    """The sparsity stage of an answer.

    Attributes
    ----------
    kind, alpha, r : the penalty, its steepness (None for "l1" and "lp") and the variance of a pseudo-measurement.
    updates : of the published stage that changed the magnitudes; None for the other.
    runs : of the other stage, two for every order.
    set_to_zero : what the published rule would declare of RISRO's magnitudes, and the stage leaves out.
    """

    kind: str
    alpha: float | None
    r: float
    updates: int | None
    runs: tuple[SparsityRun, ...]
    set_to_zero: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverSummary:
    """How the result was computed: `method` is its name in the registry, `termination` a sentence."""

    method: str
    termination: str
    iterations: int
    condition_number: float
    sparsity: SparsitySummary | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputSeries:
    """One output over the analysed window, all (n_samples,) on `IdentifyResult.time_s`, absolute (not centred).

    `fault_sd` is the standard deviation of `fault`. What follows from other signals is made of them: of a day at 100 Hz
    each takes 70 MB.
    The first samples of `predicted` and of the prediction error, as many as the largest order tried, are NaN.
    """

    channel: str
    unit: str
    measured: FloatArray
    fault: FloatArray
    fault_sd: FloatArray
    prediction_error: FloatArray
    plain_residual: FloatArray
    true_fault: FloatArray | None

    @property
    def corrected(self) -> FloatArray:
        """The measurement without the fault."""
        return self.measured - self.fault

    @property
    def predicted(self) -> FloatArray:
        """The one-step prediction of the measurement."""
        return self.measured - self.prediction_error


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResidualSummary:
    """Whiteness of the final prediction error and the plain 5-sigma test of the fault-free model, per output.

    Attributes
    ----------
    channel : output.
    lags, autocorrelation : of the final prediction error, lag 0 excluded; band is +-1.96/sqrt(n).
    ljung_box_p : p-value of the whiteness test.
    plain_alarms_s : times at which the fault-free model's one-step residual exceeds five robust standard deviations.
    """

    channel: str
    lags: tuple[int, ...]
    autocorrelation: tuple[float, ...]
    band: float
    ljung_box_p: float
    plain_alarms_s: tuple[float, ...]
    plain_sd: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class IdentifyResult(Presented):
    """The whole result of `bfi identify`.

    Attributes
    ----------
    verdicts : on each kind of fault.
    candidates : every entry of the dictionary; without one the declared faults, and every other shape of the scan.
    summary : what the log says of the kinds of which no fault is declared.
    scan : what the scan over all onsets says of the same window.
    proved : what the limits are worth on this log; empty where that was not asked for.
    """

    makers = ("model.report", "identify_content")

    log: LogSummary
    decision: Decision
    verdicts: Mapping[Kind, Decision]
    summary: str
    scan: ScanSummary
    faults: tuple[FaultEstimate, ...]
    candidates: tuple[Candidate, ...]
    model: ModelSummary
    vaf_output: Mapping[str, float]
    solver: SolverSummary
    notes: tuple[Note, ...]
    time_s: FloatArray
    inputs: Mapping[str, FloatArray]
    input_units: Mapping[str, str]
    outputs: tuple[OutputSeries, ...]
    residuals: tuple[ResidualSummary, ...]
    truth: Comparison | None
    plausibility: tuple[Implausible, ...] = ()
    proved: tuple[Proof, ...] = ()

    @property
    def channel_units(self) -> dict[str, str]:
        """Units of the outputs."""
        return {series.channel: series.unit for series in self.outputs}

    @property
    def is_trusted(self) -> bool:
        """Whether the log could tell."""
        return self.decision != "inconclusive"


# Keys of an entry from the fault; name and magnitude are those of the estimate.
FAULT_KEYS = tuple(
    field.name for field in fields(Fault) if field.name not in ("name", "magnitude", "onset_range_s", "parameter_range")
)
ENDS = {"ci95": ("ci95_low", "ci95_high"), "onset_ci95": ("onset_low_s", "onset_high_s")}


def fault_entry(estimate: FaultEstimate, keys: Sequence[str] = FAULT_KEYS) -> dict[str, Any]:
    """Return the entry of a document; `keys` are those of the fault, an interval without both ends is None."""
    entry = to_plain(estimate)
    fault = entry.pop("fault")
    if SHAPES[fault["shape"]].kind != "oscillating":
        fault["phase_rad"] = fault["phase_reference"] = None
    for key in ENDS:
        if entry[key] is not None and None in entry[key]:
            entry[key] = None
    physical = {key: entry.pop(f"physical_{key}") for key in ("value", "unit")}
    return {**entry, "physical": physical, **{key: fault[key] for key in keys}}


def plain_estimate(entry: object, *, where: str) -> dict[str, Any]:
    """Return the plain `FaultEstimate` of an entry of a document, the inverse of `fault_entry`.

    Raises
    ------
    ConfigError : a key is missing.
    """
    plain = mapping(entry, where=where)
    fault = {key: plain[key] for key in FAULT_KEYS if plain.get(key) is not None}
    return {
        **plain,
        "fault": {**fault, "name": member(plain, "name", where=where)},
        "ci95": member(plain, "ci95", where=where) or [None, None],
        "physical_value": member(plain, "physical.value", where=where),
        "physical_unit": member(plain, "physical.unit", where=where),
    }


def meaning(estimate: FaultEstimate, units: Units, channel_unit: str) -> tuple[float, Conversion]:
    """Return the physical value of a magnitude of 1, in the unit that is shown, and that unit."""
    shown = units.of(estimate.physical_unit, channel=estimate.fault.channel, channel_unit=channel_unit)
    return estimate.physical_scale / shown.factor, shown


def kind_in_words(shape: str, frequency_hz: float | None) -> str:
    """Return "2.25 Hz sine"."""
    label = SHAPES[shape].label
    return label if frequency_hz is None else f"{number(frequency_hz)} Hz {label}"


def until(fault: Fault) -> str:
    """Return " to 20 s", "" of a fault that lasts."""
    return "" if fault.offset_s is None else f" to {instant(fault.offset_s)} s"


def half(ends: tuple[float, float] | None) -> float:
    """Return half the width of an interval, NaN for None."""
    return math.nan if ends is None else 0.5 * (ends[1] - ends[0])


def fault_columns(faults: Sequence[FaultEstimate], names: Sequence[str]) -> dict[str, list[Any]]:
    """Return columns of estimates, of their faults and of the ends of their intervals, by name."""
    ends = {end: (key, i) for key, pair in ENDS.items() for i, end in enumerate(pair)}

    def cell(estimate: FaultEstimate, name: str) -> Any:
        if name not in ends:
            return getattr(estimate if hasattr(estimate, name) else estimate.fault, name)
        key, i = ends[name]
        both = getattr(estimate, key)
        return None if both is None else both[i]

    return {name: [cell(estimate, name) for estimate in faults] for name in names}


def log_summary(
    path: str, time_s: FloatArray, *, rate_hz: float, native_rate_hz: float, epoch: Epoch | None
) -> LogSummary:
    """Return the summary of a window with the samples `time_s` at the rate of the analysis."""
    return LogSummary(
        path=path,
        rate_hz=rate_hz,
        n_samples=len(time_s),
        start_s=float(time_s[0]),
        stop_s=float(time_s[-1]),
        native_rate_hz=native_rate_hz,
        clock=None if epoch is None else epoch.iso,
    )


def noise_of(error: FloatArray, outputs: Sequence[str]) -> dict[str, float]:
    """Return by output the standard deviation of the prediction error of a model, (n_rows, n_outputs)."""
    squares = [np.sum(error[k : k + AT_ONCE] ** 2, axis=0) for k in range(0, len(error), AT_ONCE)]
    return dict(zip(outputs, np.sqrt(np.sum(squares, axis=0) / len(error)).tolist(), strict=True))


# Rows whose squares are taken at once, for memory.
AT_ONCE = 262_144
# Samples of the series of a document, more than any figure shows: 80 minutes at 10 Hz. Chosen for its size, 10 MB.
MOST_SAMPLES = 50_000
GIVE = "give the result.json of bfi identify --out"
# Series of an output that the document has beside those it is made of.
DERIVED = ("corrected", "predicted")
ORDER_KEYS = ("orders", "criterion_no_fault", "criterion_best")


def identify_document(result: IdentifyResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi identify --json`; numbers that are not finite are None.

    `order_selection`, `residuals`, `truth` and `series` hold what the figures of the report are drawn from; of a very
    long record `series` has every k-th sample.
    """
    thinned = _thinned(result)
    whole = to_plain(thinned)
    whole["outputs"] = [
        {**entry, **{key: to_plain(getattr(series, key)) for key in DERIVED}}
        for entry, series in zip(whole["outputs"], thinned.outputs, strict=True)
    ]
    truth = whole["truth"]
    vaf_fault = None if truth is None else truth.pop("vaf_fault")
    curve = {key: whole["model"].pop(key) for key in ORDER_KEYS}
    body = {
        "log": whole["log"],
        "decision": whole["decision"],
        "headline": window_screen(result, channel_units=result.channel_units).headline,
        "verdicts": whole["verdicts"],
        "summary": whole["summary"],
        "plausibility": whole["plausibility"],
        "scan": whole["scan"],
        "faults": [fault_entry(estimate) for estimate in result.faults],
        "candidates": whole["candidates"],
        "model": whole["model"],
        "vaf": {"output": whole["vaf_output"], "fault": vaf_fault},
        "solver": whole["solver"],
        "order_selection": curve,
        "residuals": whole["residuals"],
        "truth": truth,
        "series": {key: whole[key] for key in ("time_s", "inputs", "input_units", "outputs")},
        **({"proved": whole["proved"]} if result.proved else {}),
    }
    return document_of("identify", body, thinned.notes, provenance)


def _thinned(result: IdentifyResult) -> IdentifyResult:
    """Return the result with every k-th sample of series that are longer than a document holds, and a note on it."""
    n = len(result.time_s)
    k = -(-n // MOST_SAMPLES)
    if k <= 1:
        return result
    outputs = []
    for series in result.outputs:
        values = {field.name: getattr(series, field.name) for field in fields(series)}
        arrays: dict[str, Any] = {key: value[::k] for key, value in values.items() if isinstance(value, np.ndarray)}
        outputs.append(replace(series, **arrays))
    return replace(
        result,
        time_s=result.time_s[::k],
        inputs={name: values[::k] for name, values in result.inputs.items()},
        outputs=tuple(outputs),
        notes=(*result.notes, Note.method(f"the series of this document hold every {k}th of {n} samples")),
    )


def identify_from_document(document: object, *, where: str = "result") -> tuple[IdentifyResult, Provenance]:
    """Return the result a document was made from: the inverse of `identify_document`.

    Parameters
    ----------
    document : parsed JSON.
    where : the file, for messages.

    Raises
    ------
    ConfigError : it is no `identify` document, has another schema, or is damaged.
    """
    whole = document_of_kind(document, ("identify",), where=where, give=GIVE, wanted="not 'identify'")
    faults = from_plain(tuple[Any, ...], member(whole, "faults", where=where), where=f"{where}: faults")
    series = dict(_mapping_at(whole, "series", where))
    if isinstance(series.get("outputs"), list):  # made of the others
        series["outputs"] = [
            {key: value for key, value in entry.items() if key not in DERIVED} if isinstance(entry, dict) else entry
            for entry in series["outputs"]
        ]
    truth = member(whole, "truth", where=where)
    if truth is not None:
        truth = {**_mapping_at(whole, "truth", where), "vaf_fault": member(whole, "vaf.fault", where=where)}
    flat = {
        **whole,
        **series,
        "faults": [plain_estimate(entry, where=f"{where}: faults[{i}]") for i, entry in enumerate(faults)],
        "model": {**_mapping_at(whole, "model", where), **_mapping_at(whole, "order_selection", where)},
        "vaf_output": member(whole, "vaf.output", where=where),
        "truth": truth,
    }
    result = from_plain(IdentifyResult, flat, where=where)
    _check_lengths(result, where)
    return result, from_plain(Provenance, member(whole, "provenance", where=where), where=f"{where}: provenance")


def _mapping_at(document: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    return mapping(member(document, key, where=where), where=f"{where}: {key}")


def _check_lengths(result: IdentifyResult, where: str) -> None:
    n, n_orders = result.time_s.size, len(result.model.orders)
    sizes = [(f"series.inputs.{name}", values.size, n) for name, values in result.inputs.items()]
    for i, series in enumerate(result.outputs):
        arrays = {field.name: getattr(series, field.name) for field in fields(series)}
        signals = {key: values for key, values in arrays.items() if isinstance(values, np.ndarray)}
        sizes += [(f"series.outputs[{i}].{key}", values.size, n) for key, values in signals.items()]
    sizes += [(f"order_selection.{key}", len(getattr(result.model, key)), n_orders) for key in ORDER_KEYS]
    sizes += [
        (f"residuals of {residual.channel}", len(residual.autocorrelation), len(residual.lags))
        for residual in result.residuals
    ]
    for key, size, expected in sizes:
        if size != expected:
            raise ConfigError(f"{where}: {key}: {size} numbers instead of {expected}; write the file again")
    if n < 2 or not result.outputs:
        raise ConfigError(f"{where}: series: {n} samples of {len(result.outputs)} outputs; write the file again")
