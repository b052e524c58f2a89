"""From what an analysis found to a named fault: fits of the parity scan, and peaks of the scan for steps."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from ..airdata import DEPENDS_ON, IMPACT_SOURCES
from ..faults.shapes import SHAPES
from ..model.onset.glance import Glance
from ..model.onset.search import OnsetSearch
from ..quantities.channels import channel_in_words, quantity_of
from .parity import FaultByOnset, Finding, Record, Threshold, WindowScan, effects
from .parity.record import STATIC_LEAK, hypotheses

# s, to both sides of an onset of the scan, which stands on the samples of its analysis at 2 Hz.
ONSET_STEP_S = 0.5


def hypothesis_of(fault: str) -> tuple[str, float]:
    """Return the hypothesis of the parity scan that a fault is, and its sign: icing is a loss of impact pressure."""
    return ("q_impact", -1.0) if fault == "pitot_icing" else (fault, 1.0)


def fault_name(fit: FaultByOnset) -> str:
    """Return what a hypothesis of the parity scan is called: a loss of impact pressure is icing of the pitot tube."""
    if fit.fault.fault == "q_impact" and fit.magnitude < 0.0:
        return "pitot_icing"
    return fit.fault.fault


def names_of(fits: Sequence[FaultByOnset], record: Record) -> tuple[str, ...]:
    """Return the names of faults that explain a window about as well.

    A log with one airspeed cannot tell a fault of its channel from one of the pitot line: a loss may be icing.
    """
    names: list[str] = []
    alone = not any(hypothesis.fault == "q_impact" for hypothesis in hypotheses(record))
    for fit in fits:
        names.append(fault_name(fit))
        if alone and fit.fault.fault == record.airspeed and fit.magnitude < 0.0:
            names.append("pitot_icing")
    return tuple(dict.fromkeys(names))


def hypotheses_of(finding: Finding) -> tuple[str, ...]:
    """Return the hypotheses of the parity scan that a finding names: all faults of the pitot line are one of these."""
    names = (
        "q_impact" if name != STATIC_LEAK and (SHAPES.get(name) or name == "q_impact") else name
        for name in finding.among
    )
    return tuple(dict.fromkeys(names))


def channels_of(fault: str, recorded: Collection[str]) -> tuple[str, ...]:
    """Return the recorded channels that a fault makes wrong."""
    if fault in SHAPES or fault == "q_impact":
        line = "p_static" if fault.startswith("static") else "p_total"
        return tuple(name for name in DEPENDS_ON if name in recorded and line in DEPENDS_ON[name])
    if fault == "ground_speed":
        return tuple(name for name in ("velocity_north", "velocity_east", "latitude", "longitude") if name in recorded)
    return (fault,)


def finding_of_fit(
    fits: Sequence[FaultByOnset], record: Record, threshold: Threshold, recorded: Collection[str], scan: WindowScan
) -> Finding:
    """Return the finding of a window that the parity scan declares.

    Parameters
    ----------
    fits : from `explain`, the best first.
    recorded : channels of the log.
    """
    fit = fits[0]
    name, among = fault_name(fit), names_of(fits, record)
    _, sign = hypothesis_of(name)
    errors = {fault_name(other): effects(record, other) for other in reversed(fits)}
    error = abs(errors[name].get(name, 0.0))
    others = errors.keys() & set(recorded) - {name} if error else set()
    rivals = {other: sizes[other] for other, sizes in errors.items() if other in others and other in sizes}
    return Finding(
        fault=name,
        among=among,
        rivals={other: abs(size) / error for other, size in rivals.items()},
        channels=channels_of(name, recorded),
        stage="parity",
        shape=fit.shape,
        constant_s=fit.constant_s,
        magnitude=sign * fit.magnitude,
        sd=fit.sd,
        unit=SHAPES[fit.shape].magnitude_unit(fit.fault.unit, slope=None) or "1",
        effect={channel: size for channel, size in errors[name].items() if channel in recorded},
        onset_s=fit.onset_s,
        onset_ci95=fit.onset_ci95,
        statistic=scan.statistic,
        threshold=threshold.level,
        p_value=threshold.p_value(scan.statistic),
        evidence={kind: round(part, 2) for kind, part in fit.parts.items()},
    )


def finding_of_glance(glance: Glance, recorded: Collection[str], *, relations: bool, unit: str) -> Finding:
    """Return the finding of a window in which a step or an oscillation of the airspeed stands out.

    Parameters
    ----------
    relations : whether the airspeed agrees with Mach number or calibrated airspeed in the window, so that what errs is
        the pressure that all are computed from.
    """
    among = _names_of_scan(glance.shape, glance.channel, recorded, relations=relations)
    return Finding(
        fault=among[0],
        among=among,
        channels=channels_of(among[0], recorded),
        stage="scan",
        shape=glance.shape,
        frequency_hz=glance.frequency_hz,
        magnitude=glance.magnitude,
        sd=glance.sd,
        unit=SHAPES[glance.shape].magnitude_unit(unit, slope=None),
        effect={glance.channel: glance.magnitude},
        onset_s=glance.onset_s,
        onset_ci95=(glance.onset_s - ONSET_STEP_S, glance.onset_s + ONSET_STEP_S),
        statistic=glance.statistic,
        threshold=glance.threshold,
        p_value=glance.p_value,
        evidence={"steps and oscillations": round(glance.statistic, 2)},
        doubt=glance.doubt,
    )


def findings_of_search(
    search: OnsetSearch, output: str, recorded: Collection[str], *, relations: bool
) -> Iterator[Finding]:
    """Yield the findings of a stretch that is searched as a whole: all that it declares but what grows on.

    Parameters
    ----------
    output : the airspeed; relations : as of `finding_of_glance`.
    """
    for estimate in search.evidence.faults:
        fault = estimate.fault
        if fault.shape == "drift" or search.rule is None or estimate.statistic is None:
            continue
        among = _names_of_scan(fault.shape, output, recorded, relations=relations)
        size = (
            estimate.magnitude if estimate.effect is None else float(np.copysign(estimate.effect, estimate.magnitude))
        )
        yield Finding(
            fault=among[0],
            among=among,
            channels=channels_of(among[0], recorded),
            stage="scan",
            shape=fault.shape,
            constant_s=fault.time_constant_s or fault.duration_s,
            frequency_hz=fault.frequency_hz,
            magnitude=estimate.magnitude,
            sd=estimate.sd,
            unit=estimate.unit,
            effect={output: size},
            onset_s=fault.onset_s,
            onset_ci95=estimate.onset_span_s,
            statistic=estimate.statistic,
            threshold=search.rule.threshold(fault.shape),
            p_value=estimate.p_value,
            evidence={"steps and oscillations": round(estimate.statistic, 2)},
        )


def _names_of_scan(shape: str, output: str, recorded: Collection[str], *, relations: bool) -> tuple[str, ...]:
    """Return what may err where an airspeed steps or swings: itself, or the pressure that all are computed from."""
    others = [name for name in IMPACT_SOURCES if name in recorded and name != output]
    line = "pitot_water" if SHAPES[shape].kind == "oscillating" else "q_impact"
    return (line,) if relations and others else (output, line)


def contradicted(relations: Mapping[str, bool]) -> tuple[str, ...]:
    """Return the faults of single channels that intact static relations contradict.

    Parameters
    ----------
    relations : by channel that stands in a static relation, whether all of these are intact.
    """
    return tuple(name for name, intact in relations.items() if intact and name in ("tas", "cas", "ias", "mach"))


# By the line that fails, the pressure of which a second sensor would tell it.
LINE_READS = {"pitot": "impact pressure", "static": "static pressure"}
# What a repeated flight should record or fly, where one of each pair cannot be told from the other.
REPEATS: tuple[tuple[frozenset[str], str], ...] = (
    (
        frozenset({"aoa", "normal_acc"}),
        "a second angle-of-attack vane, or pitch attitude and rate of climb, tells aoa from normal_acc",
    ),
    (
        frozenset({"tas", "pitot_icing"}),
        "calibrated airspeed or Mach number beside the true airspeed tells its computation from the pitot line",
    ),
    (
        frozenset({"tas", "ground_speed"}),
        "circles in a constant wind, with angle of attack and accelerations, tell the airspeed from the ground speed",
    ),
    (
        frozenset({"tas", "normal_acc"}),
        "ground velocity, or calibrated airspeed and Mach number, tell the airspeed from the accelerometer",
    ),
    (
        frozenset({"pitch", "altitude_rate"}),
        "an inertial rate of climb, or a level acceleration, tells pitch from altitude_rate",
    ),
)


def repeat_advice(among: Collection[str]) -> str:
    """Return what a repeated flight should record to tell the faults of a set apart, "" for a set of one."""
    if len(among) < 2:
        return ""
    for pair, words in REPEATS:
        if pair <= set(among):
            return words
    further = "third" if len({quantity_of(name) for name in among}) == 1 else "second"
    sensed = sorted({LINE_READS.get(name.partition("_")[0], channel_in_words(name)) for name in among})
    return f"a {further}, independent sensor of {' or '.join(sensed[:3])} tells them apart"


def vote_against(finding: Finding, recorded: Collection[str]) -> str:
    """Return which sensors agree with each other and not with the one that errs, "" for less than two."""
    others = [name for name in recorded if name != finding.fault and quantity_of(name) == quantity_of(finding.fault)]
    pairs = [finding.evidence.get(f"{name} - {other}", np.inf) for name, other in combinations(others, 2)]
    if len(finding.among) > 1 or not pairs or max(pairs) >= finding.threshold:
        return ""
    return f"{', '.join(others[:-1])} and {others[-1]} agree with each other and not with it"
