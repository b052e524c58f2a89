"""What a detection is to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..config import Config
from ..errors import ConfigError

__all__ = ["DetectSettings", "Method", "settings_of"]

Method = Literal["auto", "exact", "parity"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectSettings:
    """Settings of `detect_faults`; times on the log's own axis.

    Attributes
    ----------
    inputs, outputs : channels; where empty, those of the log that suit: controls and accelerations, flight data.
    from_s, to_s : window, None for the ends of the log.
    train : healthy time, None for the first third of the window.
    false_alarm : accepted probability that a healthy record of the monitored length raises an alarm.
    rate_hz : a number, "none" for the log's own, "auto" to choose.
    method : "exact" for data without noise, "parity" for measured data, "auto" to choose.
    turns : what a turn does to longitudinal motion is explained by roll and yaw_rate where the log has them.

    Raises
    ------
    ConfigError : a probability outside (0, 1), a healthy time that ends before it starts, a rate that is not positive.
    """

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    from_s: float | None = None
    to_s: float | None = None
    train: tuple[float, float] | None = None
    false_alarm: float = 0.01
    rate_hz: float | Literal["none", "auto"] = "auto"
    method: Method = "auto"
    turns: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.false_alarm < 1.0:
            raise ConfigError(f"--false-alarm: must lie between 0 and 1, got {self.false_alarm:g}; give one like 0.01")
        if self.train is not None and not self.train[0] < self.train[1]:
            raise ConfigError(
                f"--train: must end after it starts, got {self.train[0]:g}:{self.train[1]:g}; give one like 0:8"
            )
        if not isinstance(self.rate_hz, str) and not self.rate_hz > 0.0:
            raise ConfigError(f"--rate: must be a positive number, none or auto, got {self.rate_hz:g}")
        both = sorted(set(self.inputs) & set(self.outputs))
        if both:
            raise ConfigError(f"--output: '{both[0]}' is both an input and an output; keep one")


def settings_of(config: Config) -> DetectSettings:
    """Return the settings a configuration states; inputs and outputs it leaves to their defaults are those of the log.

    Raises
    ------
    ConfigError : see `DetectSettings`.
    """
    given = config.model_fields_set
    return DetectSettings(
        inputs=config.inputs if "inputs" in given else (),
        outputs=config.outputs if "outputs" in given else (),
        from_s=config.window.from_s,
        to_s=config.window.to_s,
        train=config.detect.train,
        false_alarm=config.detect.false_alarm,
        rate_hz=config.conditioning.rate_hz,
        method=config.detect.method,
        turns=config.detect.turns,
    )
