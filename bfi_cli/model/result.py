"""The result of an identification: frozen data, from which table, JSON, CSV, figures and report are made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..decision import Candidate, Proof
from ..decision.implausible import Implausible
from ..faults import Decision, FaultEstimate
from ..faults.shapes import Kind
from ..faults.truth import Comparison
from ..kernels import FloatArray
from ..notes import Note
from ..report.presented import Presented
from .preprocessing.summary import LogSummary, ModelSummary


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
    def is_trusted(self) -> bool:
        """Whether the log could tell."""
        return self.decision != "inconclusive"
