"""One look at a window: does the scan over all onsets see a fault, without limits, refinement or further faults."""

from __future__ import annotations

from dataclasses import dataclass

from ...config import Config
from ...flightlog import FlightLog
from ...threads import one_thread
from .decision import shipped_rule
from .estimate import as_scanned
from .rivals import unconfirmed
from .scan import may_exceed, scan_hypotheses
from .scan_record import prepare_record

# Shapes that windows of minutes show better by other relations than by a model of the airspeed.
GROWING = ("drift",)


@dataclass(frozen=True, slots=True, kw_only=True)
class Glance:
    """What is declared in a window, as it stands out most.

    Attributes
    ----------
    shape, channel, magnitude, sd, unit, onset_s, frequency_hz : as the scan has them, on its grid of onsets.
    statistic, threshold : of its shape; p_value is None where no shipped table fits the settings.
    doubt : a sentence where the other trusted channels of the log explain it, else "".
    """

    shape: str
    channel: str
    magnitude: float
    sd: float
    onset_s: float
    frequency_hz: float | None
    statistic: float
    threshold: float
    p_value: float | None
    doubt: str = ""


def glance(log: FlightLog, config: Config) -> Glance | None:
    """Return what is declared and stands out most in the window of the configuration; None where it is no abrupt fault.

    The threshold is that of the shipped table which fits, or of the nearest, with a wider tail. What stands out is
    confirmed as `bfi start-time` does it: with all trusted channels of the log as inputs, too.

    Parameters
    ----------
    log : with all its channels, of which the inputs of the configuration are looked at first.

    Raises
    ------
    LogError, ExcitationError : the window cannot be analysed.
    ConfigError : no table has these shapes.
    """
    with one_thread():
        record = prepare_record(log, config)
        rule = shipped_rule(record, config)
        abrupt = [shape for shape in rule.shapes if shape not in GROWING]
        if not may_exceed(record, record.y, {shape: rule.threshold(shape) for shape in abrupt}):
            return None
        scan = scan_hypotheses(record, record.y)
        significant = rule.significant(scan)
        if not significant or significant[0].form.shape in GROWING:
            return None
        peak = significant[0]
        doubts = unconfirmed(log, record, [as_scanned(record, peak)], config, order=scan.order)
    best = peak.profile.best
    return Glance(
        shape=peak.form.shape,
        channel=config.outputs[0],
        magnitude=float(peak.profile.z[best]),
        sd=float(peak.profile.sd[best]),
        onset_s=record.onset_s(peak.onset),
        frequency_hz=peak.form.frequency_hz,
        statistic=peak.statistic,
        threshold=rule.threshold(peak.form.shape),
        p_value=rule.highest(scan)[1],
        doubt=doubts.get(0, ""),
    )
