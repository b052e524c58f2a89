"""What the F-16 diagnosability paper leaves open, each an option; the defaults are those that come close to its table.

The paper states neither command, aerodynamic variation, gyro noise, observer, reference window, throttle, exponent nor
the base of its logarithm.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from ..dictionary.validation import Number, Positive, Rules, validated
from ..errors import ConfigError
from ..yaml12 import load_yaml

__all__ = ["F16Options", "options_from"]

NotNegative = Annotated[Number, Field(ge=0)]
WHERE = "f16-table2"
AOA_COMMAND = ((0.0, 0.0), (1.0, 8.0), (2.0, 8.0), (4.0, 35.0), (5.5, 35.0), (7.5, 6.0), (20.0, 6.0))


class F16Options(Rules):
    """One reading of the experiment."""

    reference: Literal["kde", "gaussian"] = "kde"
    """Density of the fault-free residual: by kernels, or a Gaussian fit, as the paper's conclusion says."""
    reference_window: Literal["whole", "same"] = "whole"
    """Of the fault-free residual: the whole flight, or the window of the faulty one."""
    reference_aircraft: Literal["varied", "nominal"] = "varied"
    """That flies without a fault: with the aerodynamic variation, or without."""
    exponent: NotNegative | None = 0.5
    """a of eq. 22, 0 for one bandwidth everywhere, none for the most likely."""
    log_base: Literal["2", "e"] = "2"
    """Of eq. 15."""
    halves: bool = True
    """The factors 1/2 of eq. 15, which eq. 17 leaves out."""
    noise_deg_s: NotNegative = 0.05
    """Standard deviation of the gyros, held for 0.1 s."""
    variation: tuple[Number, Number, Number] = (0.10, 0.25, 0.20)
    """Relative changes of Cl, Cm, Cn, eq. 8."""
    observer_gain: tuple[Positive, Positive, Positive] = (9.0, 6.0, 8.0)
    """Of p, q, r, 1/s."""
    observer_rates: Literal["measured", "estimated"] = "measured"
    """At which the observer takes the nominal moments: f2(y) or f2(x-hat)."""
    aoa_command: tuple[tuple[Number, Number], ...] = AOA_COMMAND
    """Corners of the commanded angle of attack: seconds, degrees."""
    roll_deg: Number = 25.0
    """Commanded roll, reached after 1 s."""
    throttle: Annotated[Number, Field(ge=0, le=1)] = 0.9
    """Fixed."""
    nozzle_deg: Annotated[Number, Field(ge=0, le=45)] = 15.0
    """Largest deflection of the thrust-vectoring nozzle."""
    step_s: Annotated[Number, Field(gt=0, le=0.1)] = 0.02
    """Of the Runge-Kutta integration; the record's step is 0.1 s."""

    @model_validator(mode="after")
    def _has_a_density(self) -> F16Options:
        times = [time for time, _ in self.aoa_command]
        if len(times) < 2 or any(after <= before for before, after in pairwise(times)):
            raise ValueError("aoa_command: needs two corners or more in the order of time; write [[0, 0], [1, 8]]")
        still = self.noise_deg_s == 0.0
        if still and (self.reference_aircraft == "nominal" or not any(self.variation)):
            raise ValueError("noise_deg_s: the fault-free residual is zero and has no density; give some noise")
        return self


def options_from(assignments: Sequence[str]) -> F16Options:
    """Return the options of texts like "noise_deg_s=0.03" or "variation=[0.3, 0.3, 0.3]"; the rest as by default.

    Raises
    ------
    ConfigError : there is no such option, or it cannot have this value.
    """
    given: dict[str, object] = {}
    for text in assignments:
        name, equals, value = text.partition("=")
        if not equals:
            raise ConfigError(f"{WHERE}: expected KEY=VALUE, got '{text}'; write noise_deg_s=0.03")
        read = load_yaml(value, where=f"{WHERE}: {name.strip()}")
        given[name.strip()] = str(read) if name.strip() == "log_base" else read
    return validated(F16Options, given, where=WHERE, error=ConfigError)
