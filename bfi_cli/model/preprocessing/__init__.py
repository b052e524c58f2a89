"""From a log to the regression of an analysis: a window cut, checked, filtered, decimated, scaled and factorised.

`window` gives a `PreparedWindow` in SI units, `regression` the scaled `RegressionData` of it at one rate. Both act
alike on inputs, outputs and dictionary, so that a fault keeps its relation to the signals it acts on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...first_use import import_on_first_use

if TYPE_CHECKING:
    from .defaults import require_one_trim
    from .signals import Purpose, require_one_model, slowest_rate_hz
    from .window import must_resample, with_inputs_of

__all__ = ["Purpose", "must_resample", "require_one_model", "require_one_trim", "slowest_rate_hz", "with_inputs_of"]

__getattr__ = import_on_first_use(
    __name__,
    {
        "defaults": ("require_one_trim",),
        "signals": ("Purpose", "require_one_model", "slowest_rate_hz"),
        "window": ("must_resample", "with_inputs_of"),
    },
)
