"""The outcome of a search over all onsets, from which answers are made."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ...decision import Candidate, Evidence
from ...faults import Fault
from ...faults.shapes import Shape
from ...quantities.text import instant
from ..result import ModelSummary, noise_of
from .decision import Rule
from .estimate import Estimate, subtract_faults
from .scan import HypothesisScan, Peak
from .scan_record import ScanRecord


@dataclass(frozen=True, kw_only=True, eq=False)
class OnsetSearch:
    """The outcome of a search over all onsets.

    Attributes
    ----------
    record : the window; scan : of its outputs as measured.
    estimates : the faults that are subtracted; evidence : these in SI, and what became of every shape.
    order : of the model without the faults; series_order : of that of the outputs as measured, which may hold faults.
    rule : that decided; highest, p_value : the peak that stands out most, and the p-value of it. None where the
        method has no test.
    covered_s : first and last onset for which the claims hold, None where the method makes no claim.
    entry_claims : what became of the entries that were asked for, in their order.
    rivals : shape and channel of what may stand in place of a declared fault.
    """

    method: str
    record: ScanRecord
    scan: HypothesisScan
    estimates: tuple[Estimate, ...]
    evidence: Evidence
    order: int
    series_order: int
    rule: Rule | None = None
    highest: Peak | None = None
    p_value: float | None = None
    covered_s: tuple[float, float] | None = None
    entry_claims: tuple[Candidate, ...] = ()
    rivals: frozenset[tuple[Shape, str]] = frozenset()

    @cached_property
    def peaks(self) -> tuple[Peak, ...]:
        """The best peak of every shape."""
        return tuple(self.scan.of(shape) for shape in dict.fromkeys(peak.form.shape for peak in self.scan.peaks))

    @cached_property
    def model(self) -> ModelSummary:
        """The model without the faults."""
        settings, scan, several = self.record.settings, self.scan, len(self.scan.orders) > 1
        error = self.record.without_fault(subtract_faults(self.record.y, *self.estimates), self.order).error
        return ModelSummary(
            order=self.order,
            rate_hz=settings.rate_hz,
            feedthrough=self.record.layout.feedthrough,
            inputs=settings.inputs,
            outputs=settings.outputs,
            noise_sd=noise_of(error * self.record.unit, settings.outputs),
            orders=tuple(scan.orders) if several else (),
            criterion_no_fault=tuple(scan.without_fault) if several else (),
            criterion_best=tuple(scan.with_fault) if several else (),
        )

    @property
    def likeliest(self) -> tuple[Fault, ...]:
        """Every shape of known form at its best onset, on the axis of the log, whether it stands out or not."""
        return tuple(
            Fault(
                shape=peak.form.shape,
                channel=self.record.output(peak.form.output)[0],
                onset_s=self.record.onset_s(peak.onset),
                frequency_hz=peak.form.frequency_hz,
                name=f"{peak.form.shape}_{instant(self.record.onset_s(peak.onset))}",
            )
            for peak in self.peaks
            if peak.form.shape != "samples"
        )
