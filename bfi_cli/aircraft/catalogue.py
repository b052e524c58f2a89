"""The models by the name the command line knows them by."""

from __future__ import annotations

from ..errors import ConfigError
from ..faults import did_you_mean
from .b747 import B747
from .citation import CITATION, CITATION_SHORT_PERIOD
from .f16 import F16
from .linear import LinearModel
from .nonlinear import NonlinearModel

__all__ = ["MODELS", "find_model"]

MODELS: dict[str, LinearModel | NonlinearModel] = {
    model.name: model for model in (CITATION, CITATION_SHORT_PERIOD, B747, F16)
}


def find_model(name: str) -> LinearModel | NonlinearModel:
    """Return the model called `name`.

    Raises
    ------
    ConfigError : there is none.
    """
    if name not in MODELS:
        raise ConfigError(f"simulate: no such model, got '{name}'{did_you_mean(name, tuple(MODELS))}")
    return MODELS[name]
