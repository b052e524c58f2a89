"""The models by the name the command line knows them by."""

from __future__ import annotations

from ..errors import ConfigError
from ..faults import did_you_mean
from .citation import CITATION, CITATION_SHORT_PERIOD
from .linear import LinearModel

__all__ = ["MODELS", "find_model"]

MODELS = {model.name: model for model in (CITATION, CITATION_SHORT_PERIOD)}


def find_model(name: str) -> LinearModel:
    """Return the model called `name`.

    Raises
    ------
    ConfigError : there is none.
    """
    if name not in MODELS:
        raise ConfigError(f"simulate: no such model, got '{name}'{did_you_mean(name, tuple(MODELS))}")
    return MODELS[name]
