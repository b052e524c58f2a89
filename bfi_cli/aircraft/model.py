"""Models of an aircraft: linear about a trimmed flight, of a file too, with its response, or nonlinear."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from ..errors import ConfigError
from ..faults.ordinary import Occurrence
from ..faults.validation import Number, Positive, Rules, Text, validate
from ..flightlog.record import frozen_array
from ..kernels import FloatArray
from ..kernels.progress import Report, silent
from ..notes import Note
from ..quantities.channels import STANDARD
from ..yaml12 import load_yaml

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Discretisation = Literal["zoh", "bilinear", "euler"]
Names = Annotated[tuple[Text, ...], Field(min_length=1)]
Matrix = Annotated[tuple[tuple[Number, ...], ...], Field(min_length=1)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearModel:
    """Deviations x, u, y from a trimmed flight: dx/dt = A x + B u, y = C x + D u.

    Attributes
    ----------
    name, title : the name on the command line, and what it is.
    A, B, C, D : (n_x, n_x), (n_x, n_u), (n_y, n_x), (n_y, n_u), SI and radians.
    states, inputs, outputs : channel names.
    units : of every state, input and output, by name; those of standard channels need not be given.
    trim : trim values of inputs and outputs, by name; zero where absent.
    airspeed_m_s : true airspeed of the trimmed flight.
    source : where the numbers come from.
    manoeuvred : inputs that a manoeuvre moves, all alike; default the first input.

    Raises
    ------
    ValueError : the shapes do not fit the names.
    """

    name: str
    title: str
    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    trim: Mapping[str, float]
    airspeed_m_s: float
    source: str
    manoeuvred: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n_x, n_u, n_y = len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in {"A": (n_x, n_x), "B": (n_x, n_u), "C": (n_y, n_x), "D": (n_y, n_u)}.items():
            matrix = frozen_array(getattr(self, name))
            if matrix.shape != shape:
                raise ValueError(f"{self.name}: {name} has shape {matrix.shape}, the names ask for {shape}")
            object.__setattr__(self, name, matrix)
        object.__setattr__(self, "units", _all_units(self.units, (*self.states, *self.inputs, *self.outputs)))
        object.__setattr__(self, "manoeuvred", self.manoeuvred or self.inputs[:1])


class ModelDocument(Rules):
    """The YAML file of a linear model, in SI and radians."""

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
    """Units of names that are no standard channels; the standard channels are in their SI unit."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """How a nonlinear model is flown; None keeps the start of the model.

    Attributes
    ----------
    tas_m_s, altitude_m : of the level flight that the log begins with.
    wind_m_s : steady wind, to the north and to the east.
    tour : a pilot flies climbs, descents and turns, see `bfi_cli.jsbsim.pilot`.
    ordinary : what happens in it, of `bfi_cli.jsbsim.ordinary.SIMULATED`.
    """

    tas_m_s: float | None = None
    altitude_m: float | None = None
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    tour: bool = False
    ordinary: tuple[Occurrence, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flown:
    """A flight: absolute inputs and outputs, (n_samples, n_u) and (n_samples, n_y); `notes` for the user."""

    inputs: FloatArray
    outputs: FloatArray
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NonlinearModel:
    """An aircraft that is flown from a trimmed flight by its own equations of motion.

    Attributes
    ----------
    name, title : the name on the command line, and what it is.
    inputs, outputs : standard channel names.
    units : of every input and output, by name; those of standard channels need not be given.
    fly : returns the flight from trim for input deviations, (n_samples, n_u), held between samples, at a rate in Hz, in
        gusts, (n_samples, 3) headwind, from the right and upward in m/s, or in calm air (None).
    report : called by `fly` with the part of the flight that is done.
    travel : by input, its largest deflection to either side, in the unit of the input.
    source : where the numbers come from.
    airspeed_m_s : true airspeed of the trimmed flight; None where gusts are not modelled.
    manoeuvred : inputs that a manoeuvre moves, all alike; default the first input.
    ordinary : what happens in a flight, see `FlightPlan`.
    """

    name: str
    title: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    fly: Callable[[FloatArray, float, FloatArray | None, Report], Flown]
    source: str
    airspeed_m_s: float | None = None
    manoeuvred: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    travel: Mapping[str, float] = field(default_factory=dict)
    report: Report = silent
    ordinary: tuple[Occurrence, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "units", _all_units(self.units, (*self.inputs, *self.outputs)))
        object.__setattr__(self, "manoeuvred", self.manoeuvred or self.inputs[:1])


def _all_units(given: Mapping[str, str], names: Iterable[str]) -> dict[str, str]:
    return {name: given[name] if name in given else STANDARD[name].unit for name in names}


def discretise(model: LinearModel, *, rate_hz: float, rule: Discretisation = "zoh") -> Matrices:
    """Return (A, B, C, D) of the difference equation x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k).

    "zoh" is exact for an input held between samples and keeps D. "bilinear" (Tustin, the trapezoidal rule; that of the
    thesis's listing and of its eq. 5-5) lets the input act in the same sample too. "euler" is x + (A x + B u) / rate.
    """
    from scipy.signal import cont2discrete

    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise ValueError(f"the rate must be positive, got {rate_hz:g} Hz")
    A, B, C, D, _ = cont2discrete((model.A, model.B, model.C, model.D), 1.0 / rate_hz, method=rule)
    return A, B, C, D


def propagate(A: FloatArray, drive: FloatArray, *, x0: FloatArray) -> FloatArray:
    """Return x(0..n-1), (n, n_x), of x(k+1) = A x(k) + drive(k), x(0) = x0."""
    x = np.empty((drive.shape[0], A.shape[0]))
    x[:1] = x0
    for k in range(drive.shape[0] - 1):
        x[k + 1] = A @ x[k] + drive[k]
    return x


def response(
    model: LinearModel, u: FloatArray, *, rate_hz: float, rule: Discretisation = "zoh", x0: FloatArray | None = None
) -> FloatArray:
    """Return the outputs' deviations from trim, (n_samples, n_y), for input deviations `u`, (n_samples, n_u).

    The flight starts from the trim, or from the deviations `x0`, (n_x,), of the states.
    """
    u = np.asarray(u, dtype=np.float64)
    if u.ndim != 2 or u.shape[1] != len(model.inputs):
        raise ValueError(f"{model.name}: u has shape {u.shape}, expected (n_samples, {len(model.inputs)})")
    A, B, C, D = discretise(model, rate_hz=rate_hz, rule=rule)
    x = propagate(A, u @ B.T, x0=np.zeros(len(model.states)) if x0 is None else x0)
    return x @ C.T + u @ D.T
