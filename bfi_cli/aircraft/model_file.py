"""A linear aircraft model of a YAML file: names, matrices, trim; in SI and radians."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from ..channels import STANDARD
from ..errors import ConfigError
from ..validation import Number, Positive, Rules, Text, validate
from ..yaml12 import load_yaml
from .model import LinearModel

Names = Annotated[tuple[Text, ...], Field(min_length=1)]
Matrix = Annotated[tuple[tuple[Number, ...], ...], Field(min_length=1)]


class ModelDocument(Rules):
    """Deviations from a trimmed flight: dx/dt = A x + B u, y = C x + D u."""

    name: Text
    title: str = ""
    source: str = ""
    airspeed_m_s: Positive
    """True airspeed of the trimmed flight."""
    states: Names
    inputs: Names
    outputs: Names | None = None
    """Default the states."""
    units: Mapping[str, Text] = {}
    """Of names that are no standard channels; the standard channels are in their SI unit."""
    trim: Mapping[str, Number] = {}
    """Value of a state, input or output in the trimmed flight; 0 where it is not given."""
    A: Matrix
    B: Matrix
    C: Matrix | None = None
    """Default a row per output that picks the state of that name."""
    D: Matrix | None = None
    """Default zero."""

    @property
    def output_names(self) -> tuple[str, ...]:
        """The outputs, or the states where the document names no outputs."""
        return self.outputs or self.states

    @model_validator(mode="after")
    def _fits_together(self) -> ModelDocument:
        outputs = self.output_names
        for key, listed in {"states": self.states, "inputs": self.inputs, "outputs": outputs}.items():
            if len(set(listed)) < len(listed):
                raise ValueError(f"{key}: a name stands twice; keep one")
        n_x, n_u, n_y = len(self.states), len(self.inputs), len(outputs)
        for key, shape in {"A": (n_x, n_x), "B": (n_x, n_u), "C": (n_y, n_x), "D": (n_y, n_u)}.items():
            rows = getattr(self, key)
            if rows is not None and [len(row) for row in rows] != [shape[1]] * shape[0]:
                raise ValueError(
                    f"{key}: the names ask for {shape[0]} rows of {shape[1]}, got {len(rows)} of "
                    f"{' or '.join(map(str, sorted({len(row) for row in rows})))}; write one list per row"
                )
        hidden = [name for name in outputs if name not in self.states]
        if self.C is None and hidden:
            raise ValueError(f"C: missing, and output '{hidden[0]}' is no state; add C")
        names = dict.fromkeys((*self.states, *self.inputs, *outputs))
        for name in self.inputs:
            if name in outputs:
                raise ValueError(f"inputs: '{name}' is an output too; rename one")
        for key in ("units", "trim"):
            for name in getattr(self, key):
                if name not in names:
                    raise ValueError(f"{key}: '{name}' is no state, input or output; use one of {', '.join(names)}")
        for name in names:
            given, standard = self.units.get(name), STANDARD.get(name)
            if given is None and standard is None:
                raise ValueError(f"units: '{name}' is no standard channel; add its unit")
            if standard is not None and given not in (None, standard.unit):
                raise ValueError(
                    f"units: '{name}' is in {standard.unit} in a model, got '{given}'; convert the matrices"
                )
        return self


def load_model(path: str | Path) -> LinearModel:
    """Return the model of a YAML file.

    Raises
    ------
    ConfigError : the file cannot be read, or everything that is wrong with it, in one line.
    """
    document = validate(ModelDocument, load_yaml(Path(path)), where=str(path), error=ConfigError)
    states, outputs = document.states, document.output_names
    selection = np.array([[float(state == output) for state in states] for output in outputs])
    return LinearModel(
        name=document.name,
        title=document.title or document.name,
        A=np.array(document.A),
        B=np.array(document.B),
        C=selection if document.C is None else np.array(document.C),
        D=np.zeros((len(outputs), len(document.inputs))) if document.D is None else np.array(document.D),
        states=states,
        inputs=document.inputs,
        outputs=outputs,
        units=document.units,
        trim=dict(document.trim),
        airspeed_m_s=document.airspeed_m_s,
        source=document.source or str(path),
    )
