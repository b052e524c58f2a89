"""The parameter of the autopilot that mends the scale of an airspeed, for the recorder that wrote the log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ...decision.implausible import Implausible, Setting
from ...errors import LogError
from ...flightlog import FlightLog
from ...flightlog.formats import parameters_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """How a parameter enters an airspeed.

    Attributes
    ----------
    topic : of the log, from which the airspeed is taken.
    names : of the parameter, of the first sensor and of the second; of several spellings the log lists one.
    power : the airspeed is in proportion to the parameter to the power of 1 / power.
    applied : channels of that topic in which the present value is; in the others it would be 1.
    """

    topic: str
    names: tuple[tuple[str, ...], ...]
    power: int
    applied: tuple[str, ...]


# ArduPilot, AP_Airspeed: sqrt(pressure * ARSPD_RATIO) is the airspeed. PX4, airspeed_selector_main: ASPD_SCALE_1 (of
# firmware before 1.13 ASPD_SCALE) is calibrated over indicated airspeed, and is in what follows from the calibrated.
SCALES = (
    Scale(topic="ARSP", names=(("ARSPD_RATIO",), ("ARSPD2_RATIO",)), power=2, applied=("ias", "cas", "tas")),
    Scale(
        topic="airspeed_validated",
        names=(("ASPD_SCALE_1", "ASPD_SCALE"),),
        power=1,
        applied=("cas", "tas"),
    ),
    Scale(topic="airspeed", names=(("ASPD_SCALE_1", "ASPD_SCALE"), ("ASPD_SCALE_2",)), power=1, applied=()),
)
AIRSPEEDS = ("tas", "cas", "ias")
DIGITS = 4  # of a setting that is printed: an autopilot's own calibration states as many


def with_settings(log: FlightLog, findings: tuple[Implausible, ...]) -> tuple[Implausible, ...]:
    """Return findings, those about the scale of an airspeed with the parameter to set where the log lists it."""
    if not any(_is_about_airspeed(finding) for finding in findings):
        return findings
    try:
        parameters = parameters_of(log.path)
    except LogError:
        return findings
    return tuple(
        with_setting(log, finding, parameters) if _is_about_airspeed(finding) else finding for finding in findings
    )


def with_setting(log: FlightLog, finding: Implausible, parameters: Mapping[str, float]) -> Implausible:
    """Return a finding about the scale of an airspeed with the parameter that mends it, if it is among `parameters`."""
    (channel,) = finding.channels
    topic, _, _ = log.channels[channel].source.partition(".")
    for scale in SCALES:
        if topic != scale.topic and not topic.startswith(f"{scale.topic}_"):
            continue
        sensor = 0 if topic == scale.topic else _number(topic.removeprefix(f"{scale.topic}_"))
        names = scale.names[sensor] if sensor is not None and sensor < len(scale.names) else ()
        name = next((name for name in names if name in parameters), None)
        if name is not None:
            setting = _setting(finding, name, parameters[name], scale, is_applied=channel in scale.applied)
            return replace(finding, setting=setting, advice=sentence_of_setting(setting))
    return finding


def sentence_of_setting(setting: Setting) -> str:
    """Return what to set, to which value, and what it is now: "set ARSPD_RATIO to 2.205 (2.1 to 2.31), now 2"."""
    between = "" if setting.ci95 is None else f" ({' to '.join(f'{end:.{DIGITS}g}' for end in setting.ci95)})"
    return f"set {setting.name} to {setting.value:.{DIGITS}g}{between}, now {setting.present:.{DIGITS}g}"


def _is_about_airspeed(finding: Implausible) -> bool:
    return (
        finding.what == "scale"
        and not finding.rivals
        and len(finding.channels) == 1
        and finding.channels[0] in AIRSPEEDS
    )


def _setting(finding: Implausible, name: str, present: float, scale: Scale, *, is_applied: bool) -> Setting:
    factor = present if is_applied else 1.0

    def value(by: float) -> float:
        return float(factor * by**scale.power)

    ends = finding.factor_ci95
    return Setting(
        name=name,
        present=present,
        value=value(finding.factor),
        ci95=None if ends is None else (value(ends[0]), value(ends[1])),
    )


def _number(text: str) -> int | None:
    return int(text) if text.isdecimal() else None
