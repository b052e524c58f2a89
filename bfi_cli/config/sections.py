"""The sections of a configuration: every key with its default."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    StrictBool,
    Tag,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    field_validator,
    model_validator,
)

from ..dictionary.validation import Number, Positive, Rules, Text, Whole
from ..faults import shown
from ..sample_file import lies_inside
from ..shapes import SCANNED, ScannedShape

__all__ = [
    "STRONG_EVIDENCE",
    "Conditioning",
    "Detect",
    "Diagnosability",
    "Dmae",
    "Model",
    "Names",
    "Natural",
    "PathText",
    "Risro",
    "Selection",
    "StartTime",
    "Window",
    "beside_config",
]

SHAPES_WORDS = f"What to look for: {', '.join(SCANNED)}."


def _word_or_number(value: object) -> str:
    return "<word>" if isinstance(value, str) else "<number>"


def _distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if len(set(values)) < len(values):
        raise ValueError(f"a value stands twice, got {shown(list(values))}; keep one")
    return values


def beside_config(path: str, info: ValidationInfo) -> str:
    """Return a path relative to the file it stands in as one relative to the working directory."""
    return str(Path((info.context or {}).get("folder", "")) / path)


def _inside_config(file: str, info: ValidationInfo) -> str:
    """Return the path as `beside_config` does, of a file that lies in the configuration's folder.

    One that stands in no file is the caller's own and may lie anywhere.
    """
    context, path = info.context or {}, beside_config(file, info)
    try:
        inside = "folder" not in context or lies_inside(Path(path), Path(context["folder"]))
    except ValueError:
        raise ValueError(f"no such file, got {shown(file)}; give a CSV file of time, value") from None
    if not inside and not context.get("allow_outside"):
        problem = f"{shown(file)} lies outside the configuration's folder"
        raise ValueError(f"{problem}; move it there or give --allow-outside")
    return path


def _path(value: object, read: ValidatorFunctionWrapHandler) -> str:
    """Return the name of a file, also one that is no UTF-8 text, which pydantic does not take for a string."""
    if isinstance(value, str) and value != value.encode("utf-8", "ignore").decode("utf-8"):
        return value
    text: str = read(value)
    return text


PathText = Annotated[Text, WrapValidator(_path)]
Natural = Annotated[Whole, Field(ge=1)]
Names = Annotated[tuple[Text, ...], Field(min_length=1), AfterValidator(_distinct)]
Rate = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[Literal["none", "auto"], Tag("<word>")],
    Discriminator(_word_or_number),
]
Order = Annotated[
    Annotated[Natural, Tag("<number>")] | Annotated[Literal["auto"], Tag("<word>")],
    Discriminator(_word_or_number),
]
Size = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[Literal["auto"], Tag("<word>")],
    Discriminator(_word_or_number),
]


# Twice the log Bayes factor of ten to one, 2 log 10, which Jeffreys (1961) calls strong. With the overdispersion it
# took false alarms on 112 fault-free windows of two recorded flights from 14 to 4 %.
STRONG_EVIDENCE = 4.6


class Window(Rules):
    """The part of the log to analyse, s on its own time axis."""

    from_s: Number | None = None
    """Default the start of the log."""
    to_s: Number | None = None
    """Default the end of the log."""

    @model_validator(mode="after")
    def _is_not_empty(self) -> Window:
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError(f"to_s must be after from_s ({self.from_s:g} s), got {self.to_s:g} s")
        return self


class Conditioning(Rules):
    """What happens to inputs, outputs and dictionary alike before the analysis."""

    rate_hz: Rate = "auto"
    """The rate to decimate to; none for the log's own; auto chooses."""
    detrend: Literal["constant", "none"] = "constant"
    """Whether the mean of every signal is taken off."""
    filter: Literal["linear-phase", "causal"] = "linear-phase"
    """The low-pass in front of the decimation; causal lets nothing of a fault appear before its onset."""


class Model(Rules):
    """The VARX model."""

    order: Order = "auto"
    """Number of lags; auto chooses among `orders` together with the faults."""
    orders: Annotated[tuple[Natural, ...], Field(min_length=1), AfterValidator(_distinct)] = (2, 4, 6, 8, 12)
    """The orders to choose from."""
    feedthrough: StrictBool | None = None
    """Whether an input acts in the same sample too; default true, false with the methods risro, risro-as-published."""


class Risro(Rules):
    """Settings of the methods risro and risro-as-published."""

    as_published: StrictBool = False
    """The algorithm to the letter, its slips included, as the method risro-as-published runs it."""
    max_iterations: Natural = 50
    tolerance: Positive = 1e-10
    """Stop at this relative change of the iterate and of the misfit."""
    sparsity: Literal["none", "l1", "lp", "exp-l0"] = "exp-l0"
    """The penalty of the pseudo-measurement stage."""
    alpha: Size = "auto"
    """Steepness of the exponential; auto follows from the criterion, as published it is 1."""
    r: Size = "auto"
    """Variance of a pseudo-measurement; auto follows from the criterion, as published it is 10."""
    p0: Size = "auto"
    """Prior variance of a magnitude in units of its own; auto has no prior beside the data, as published it is 1."""
    updates: Annotated[Whole, Field(ge=0)] = 1
    """Updates per iteration of the published stage; the other is repeated until it settles."""


class Dmae(Rules):
    """Settings of method dmae, double-model adaptive estimation."""

    model: Text | None = None
    """The model of the aircraft, a linear one of `bfi simulate`; its inputs and outputs must be in the log."""
    reference: Literal["trim", "start"] = "trim"
    """What deviations count from: the model's trim, or the mean of the log's first second."""
    process_variance: Annotated[Number, Field(ge=0)] = 4e-6
    """Of every state per sample, in its unit squared."""
    measurement_variance: Mapping[Text, Positive] = Field(default_factory=dict)
    """Output of the model: variance of its noise; default 0.01, of angles and their rates 0.0001."""
    fault_variance: Annotated[Number, Field(ge=0)] = 0.0
    """Of the fault per sample; 0 for a fault that is constant between restarts."""
    adaptive_window: Natural | None = 20
    """Samples over which the variance of the fault follows its innovations; null for not at all, as in the thesis."""


class Selection(Rules):
    """How the active faults are told from the others."""

    criterion: Literal["ebic", "bic"] = "ebic"
    evidence: Annotated[Number, Field(ge=0)] = STRONG_EVIDENCE
    """How far a fault must lower the criterion; twice the log Bayes factor, 4.6 is ten to one, strong (Jeffreys)."""
    max_active: Natural | None = None
    """At most so many faults; default no limit."""
    threshold: Annotated[Positive, Field(lt=1)] | None = None
    """The rule |z| / norm(z) > threshold in place of the criterion."""


class StartTime(Rules):
    """The scan over all onsets."""

    shapes: Annotated[
        tuple[ScannedShape, ...],
        Field(min_length=1, description=SHAPES_WORDS),
        AfterValidator(_distinct),
    ] = ("bias", "drift", "sine")
    samples: Annotated[PathText, AfterValidator(_inside_config)] | None = None
    """CSV of time (s after the onset), value: the shape samples; a file relative to this one."""
    false_alarm: Annotated[Positive, Field(lt=1)] = 0.01
    """Accepted probability of declaring a fault where there is none."""
    calibration: PathText | None = None
    """A table of `bfi calibrate`, self, or gaussian; default the shipped table."""
    ends: StrictBool = False
    """Whether the end of the fault is searched for too."""
    frequency_hz: tuple[Positive, Positive] | None = None
    """[low, high] of the oscillations; default 3 / window length to 0.2 x rate."""

    @model_validator(mode="after")
    def _samples_are_looked_for(self) -> StartTime:
        if self.samples is None and "samples" in self.shapes:
            raise ValueError("the shape samples has no file; give samples a CSV of time, value")
        if self.samples is not None and "samples" not in self.shapes:
            raise ValueError(f"samples names {self.samples}, but shapes has no samples; add it")
        return self

    @model_validator(mode="after")
    def _frequencies_increase(self) -> StartTime:
        if self.frequency_hz is not None and self.frequency_hz[1] <= self.frequency_hz[0]:
            low, high = self.frequency_hz
            raise ValueError(f"frequency_hz must be [low, high], got [{low:g}, {high:g}]")
        return self


class Detect(Rules):
    """The search for a failing channel."""

    train: tuple[Number, Number] | None = None
    """[from, to] of the time known to be healthy, s; default the first third of the window."""
    false_alarm: Annotated[Positive, Field(lt=1)] = 0.01
    """Accepted probability that a healthy record raises an alarm."""
    method: Literal["auto", "exact", "parity"] = "auto"
    """exact for data without noise, parity for measured data."""
    turns: StrictBool = True
    """Whether roll and yaw_rate explain what turns do to longitudinal motion."""

    @field_validator("train")
    @classmethod
    def _healthy_time_is_not_empty(cls, train: tuple[float, float] | None) -> tuple[float, float] | None:
        if train is not None and train[1] <= train[0]:
            first, last = train
            raise ValueError(f"must end after it starts, got {first:g} to {last:g} s; give one like 0 to 8 s")
        return train


class Diagnosability(Rules):
    """How well faults can be seen and told apart: at which magnitudes, and in which flights of a model."""

    magnitude: Positive = 1.0
    """Root mean square of the magnitudes not named below."""
    magnitudes: Mapping[Text, Positive] = Field(default_factory=dict)
    """Name of the dictionary's entry: root mean square of its magnitude."""
    at_limit: StrictBool = False
    """Whether magnitudes count in minimal detectable ones."""
    model: Text | None = None
    """A model of `bfi simulate` to fly in place of a log."""
    manoeuvres: Names = ("3211", "doublet", "multisine")
    """To compare."""
    noise: Mapping[Text, Annotated[Number, Field(ge=0)]] = Field(default_factory=dict)
    """Output of the model: standard deviation of its white noise."""
    amplitude_rad: Positive = 0.035
    """Largest deflection."""
    start_s: Annotated[Number, Field(ge=0)] = 0.2
    """When the manoeuvre starts."""
    step_s: Positive = 1.0
    """Its unit step."""
    duration_s: Positive = 31.72
    """Length of the flight."""
    turbulence_m_s: Annotated[Number, Field(ge=0)] = 0.0
    """Dryden gusts."""
    draws: Natural = 5
    """Of the noise, for each manoeuvre."""
