"""The configuration of an analysis: every key with its default, checked whole, never changed after."""

# Annotations are no text here, each of which pydantic would evaluate on the way to every answer.

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    PrivateAttr,
    StrictBool,
    Tag,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    WrapValidator,
    field_validator,
    model_validator,
)

from ..decision import KINDS
from ..dictionary import Dictionary, DictionaryDocument, expand, is_shipped, load_dictionary
from ..errors import ConfigError, LogError
from ..faults import did_you_mean, shown
from ..faults.shapes import SCANNED, Kind, ScannedShape
from ..faults.validation import Deferred, Number, Positive, Rules, Text, Whole, editor_schema, path_beside, validate
from ..methods import METHODS
from ..quantities.channels import STANDARD, change_in_si
from ..quantities.text import UnitsName
from ..yaml12 import load_yaml, read_text

__all__ = ["STRONG_EVIDENCE", "Config", "Detect", "Diagnosability", "DictionarySource", "Natural", "StartTime"]
__all__ += ["json_schema", "load_config", "merge"]

# JSON schemas, for editors, of keys with more than one kind of value.
UNITS_SCHEMA = {
    "anyOf": [
        {"type": "object", "additionalProperties": {"type": "string", "minLength": 1}},
        {"enum": list(get_args(UnitsName))},
    ]
}
TOLERANCES_SCHEMA = {
    "type": "object",
    "additionalProperties": {"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "string", "minLength": 2}]},
}


def _distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if len(set(values)) < len(values):
        raise ValueError(f"a value stands twice, got {shown(list(values))}; keep one")
    return values


def _dictionary_of_config(path: str, info: ValidationInfo) -> str:
    """Return the path of a dictionary, relative to its configuration, or the name of a shipped one as it is."""
    beside = str(Path((info.context or {}).get("folder", "")) / path)
    return path if is_shipped(path) and not Path(beside).is_file() else beside


def _path(value: object, read: ValidatorFunctionWrapHandler) -> str:
    """Return the name of a file; pydantic refuses names that are no UTF-8 text, which are passed on here."""
    if isinstance(value, str) and value != value.encode("utf-8", "ignore").decode("utf-8"):
        return value
    text: str = read(value)
    return text


def _in_si(tolerances: Any) -> Any:
    """Return tolerances with a unit, "5kt", as numbers in SI; all other values unchanged, for validation."""
    if not isinstance(tolerances, Mapping):
        return tolerances
    return {name: _tolerance(name, value) if isinstance(value, str) else value for name, value in tolerances.items()}


def _tolerance(name: str, text: str) -> float:
    try:
        size, unit = change_in_si(text)
    except ValueError:
        what = f"{name}: not a number with a unit, got {shown(text)}"
        raise ValueError(f"{what}; write one like 2.6 or 5kt") from None
    except LogError as error:
        raise ValueError(f"{name}: {str(error).removeprefix('unit: ')}") from None
    if name in STANDARD and unit != STANDARD[name].unit:
        raise ValueError(f"{name}: is in {STANDARD[name].unit}, got {shown(text)}; give a unit of that kind")
    if not size > 0.0:
        raise ValueError(f"{name}: must be greater than 0, got {shown(text)}")
    return size


PathText = Annotated[Text, WrapValidator(_path)]
SampleFile = Annotated[PathText, AfterValidator(lambda file, info: path_beside(file, info, "configuration"))]
Natural = Annotated[Whole, Field(ge=1)]
Tolerances = Annotated[Mapping[Text, Positive], BeforeValidator(_in_si), WithJsonSchema(TOLERANCES_SCHEMA)]
Names = Annotated[tuple[Text, ...], Field(min_length=1), AfterValidator(_distinct)]
WORD_OR_NUMBER = Discriminator(lambda value: "<word>" if isinstance(value, str) else "<number>")
Rate = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[Literal["none", "auto"], Tag("<word>")], WORD_OR_NUMBER
]
Size = Annotated[Annotated[Positive, Tag("<number>")] | Annotated[Literal["auto"], Tag("<word>")], WORD_OR_NUMBER]
Order = Annotated[Annotated[Natural, Tag("<number>")] | Annotated[Literal["auto"], Tag("<word>")], WORD_OR_NUMBER]

# Twice the log Bayes factor of ten to one, 2 log 10, which Jeffreys (1961) calls strong. With the overdispersion it
# took false alarms on 112 fault-free windows of two recorded flights from 14 to 4 %.
STRONG_EVIDENCE = 4.6


class Window(Rules):
    """The part of the log to analyse, s on its own time axis."""

    from_s: Number | None = None
    """Start of the window; default the start of the log."""
    to_s: Number | None = None
    """End of the window; default the end of the log."""

    @model_validator(mode="after")
    def _is_not_empty(self) -> Self:
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError(f"to_s must be after from_s ({self.from_s:g} s), got {self.to_s:g} s; give a later one")
        return self


class Recorder(Rules):
    """The low-pass of the recorder, which faults of the aircraft went through as its motion did."""

    edge_hz: Rate = "auto"
    """Frequency of gain one half; none for no filter; auto for what the log states or shows."""
    kind: Literal["auto", "gaussian", "fir", "butterworth", "causal"] = "auto"
    """Its shape; auto for what the log states or shows, a Gaussian where only the edge is known."""


class Conditioning(Rules):
    """What happens to inputs, outputs and dictionary alike before the analysis."""

    rate_hz: Rate = "auto"
    """The rate to decimate to; none for the log's own; auto chooses."""
    detrend: Literal["constant", "none"] = "constant"
    """Whether the mean of every signal is taken off."""
    variance: Literal["running", "constant"] = "running"
    """Whether samples count by the running size of the prediction error around them, where gusts make it unequal."""
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
    """Variance of the process noise of every state per sample, in its unit squared."""
    measurement_variance: Mapping[Text, Positive] = Field(default_factory=dict)
    """Output of the model: variance of its noise; default 0.01, of angles and their rates 0.0001."""
    fault_variance: Annotated[Number, Field(ge=0)] = 0.0
    """Variance of the fault's random walk per sample; 0 for a fault that is constant between restarts."""
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
        Field(min_length=1, description=f"What to look for: {', '.join(SCANNED)}."),
        AfterValidator(_distinct),
    ] = ("bias", "drift", "sine")
    samples: SampleFile | None = None
    """CSV of time (s after the onset), value: the shape samples; a file relative to this one."""
    false_alarm: Annotated[Positive, Field(lt=1)] = 0.01
    """Accepted probability of declaring a fault where there is none."""
    calibration: PathText | None = None
    """A table of `bfi calibrate`, self, gaussian, or auto (default): a shipped table that fits, else the log itself."""
    ends: StrictBool = False
    """Whether the end of the fault is searched for too."""
    frequency_hz: tuple[Positive, Positive] | None = None
    """[low, high] of the oscillations; default 3 / window length to 0.2 x rate."""

    @model_validator(mode="after")
    def _samples_are_looked_for(self) -> Self:
        if self.samples is None and "samples" in self.shapes:
            raise ValueError("the shape samples has no file; give samples a CSV of time, value")
        if self.samples is not None and "samples" not in self.shapes:
            raise ValueError(f"samples names {self.samples}, but shapes has no samples; add it")
        return self

    @model_validator(mode="after")
    def _frequencies_increase(self) -> Self:
        if self.frequency_hz is not None and self.frequency_hz[1] <= self.frequency_hz[0]:
            low, high = self.frequency_hz
            raise ValueError(f"frequency_hz must be [low, high], got [{low:g}, {high:g}]")
        return self


class Detect(Rules):
    """The search for a failing channel."""

    train: tuple[Number, Number] | None = None
    """[from, to] of the time known to be healthy, s; default the first third of the flight in the window."""
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


class KnownCause(Rules):
    """An ordinary cause that the engineer knows of."""

    cause: Text
    """By its name in `ordinary` of the answer: flaps, altimeter_set, wind, ..."""
    at_s: Number
    """When it acted, on the log's own time axis."""


class Diagnose(Rules):
    """The diagnosis of a whole flight."""

    false_alarm: Annotated[Positive, Field(lt=1)] = 0.05
    """Accepted probability of a false alarm in a whole healthy flight, over all windows and analyses."""
    calibration: PathText | None = None
    """A file of `bfi calibrate` with the air data of the aircraft; default the shipped tables and the flight itself."""
    judge: StrictBool = True
    """Whether events are weighed in one likelihood of all channels, against ordinary causes and other faults."""
    events: tuple[KnownCause, ...] = ()
    """What is known to have happened: ordinary causes that act at their times, whatever else does."""


class Diagnosability(Rules):
    """How well faults can be seen and told apart: at which magnitudes, and in which flights of a model."""

    magnitude: Positive = 1.0
    """Root mean square of the magnitudes not named below."""
    magnitudes: Mapping[Text, Positive] = Field(default_factory=dict)
    """Name of the dictionary's entry: root mean square of its magnitude."""
    at_limit: StrictBool = False
    """Whether magnitudes are multiples of the minimal detectable magnitude."""
    model: Text | None = None
    """A model of `bfi simulate` to fly in place of a log."""
    manoeuvres: Names = ("3211", "doublet", "multisine")
    """Manoeuvres to compare."""
    noise: Mapping[Text, Annotated[Number, Field(ge=0)]] = Field(default_factory=dict)
    """Output of the model: standard deviation of its white noise."""
    amplitude_rad: Positive = 0.035
    """Largest deflection of the manoeuvre."""
    start_s: Annotated[Number, Field(ge=0)] = 0.2
    """When the manoeuvre starts."""
    step_s: Positive = 1.0
    """The manoeuvre's unit step."""
    duration_s: Positive = 31.72
    """Length of the flight."""
    turbulence_m_s: Annotated[Number, Field(ge=0)] = 0.0
    """Intensity of the Dryden gusts."""
    draws: Natural = 5
    """Draws of the noise for each manoeuvre."""


class Calibrate(Rules):
    """The windows of a calibration."""

    length_s: Positive | None = None
    """Length of a window; default 120 s, or the whole of a shorter log."""
    step_s: Positive | None = None
    """Time between the starts of windows; default half a window."""


class AuditOfDictionary(Rules):
    """The audit of a dictionary."""

    duration_s: Number | None = None
    """Length of the window without a log; default one that shows every fault."""


def _registered(name: str) -> str:
    if name not in METHODS:
        raise ValueError(f"not one of the choices, got {shown(name)}{did_you_mean(name, list(METHODS))}")
    return name


DictionarySource = Annotated[
    Annotated[PathText, AfterValidator(_dictionary_of_config), Tag("<path>")]
    | Annotated[
        Deferred[DictionaryDocument],
        AfterValidator(lambda document: expand(document) and document),  # which refuses what no fault can be made of
        Tag("<document>"),
    ],
    Discriminator(lambda value: "<path>" if isinstance(value, str | Path) else "<document>"),
]


class Config(Rules):
    """Configuration of bfi."""

    inputs: Names = ("elevator",)
    """The inputs, by standard channel name."""
    outputs: Names = ("tas",)
    """The sensors that may be faulty."""
    channels: Mapping[Text, Text] = Field(default_factory=dict)
    """Standard name: name in the log."""
    units: Annotated[Mapping[Text, Text], WithJsonSchema(UNITS_SCHEMA)] = Field(default_factory=dict)
    """Name in the log: the unit it does not state. A word, si or aviation, is the same as shown_units."""
    group: Text | None = None
    """HDF5 group or MATLAB struct that holds the channels."""
    sample_rate_hz: Positive | None = None
    """Samples per second of a log that has no time axis."""
    columns: Annotated[tuple[Text, ...], AfterValidator(_distinct)] = ()
    """Names of the columns of a table of numbers that has no header line; default those of its header."""
    keep: Annotated[tuple[Text, ...], AfterValidator(_distinct)] = ()
    """Channels of another number of samples than the time axis, taken as even over the same time."""
    fill_s: Positive | None = None
    """Stretches of missing samples (NaN) up to this long, s, are interpolated; default none."""
    fix_units: StrictBool = False
    """Whether channels are read in the unit and with the sign that the others show, where that is certain."""
    boot: Natural | None = None
    """Which part of a log whose clock starts again, counted from 1; default the one with the longest flight."""
    shown_units: UnitsName = "si"
    """Units of tables, figures and reports; JSON, CSV and logs stay SI."""
    window: Deferred[Window] = Window.model_construct()
    tolerances: Tolerances = Field(default_factory=dict)
    """Output: the largest error that may stay unseen, SI or with a unit as 5kt; default by the channel."""
    onset_tolerance_s: Annotated[Number, Field(ge=0)] = 1.0
    """How well the onsets of the dictionary are known, s: what can be detected is stated for the worst within it."""
    require: Annotated[tuple[Kind, ...], Field(min_length=1), AfterValidator(_distinct)] = KINDS
    """The kinds of fault that must be excluded for the decision no_fault; default all."""
    recorder: Deferred[Recorder] = Recorder.model_construct()
    conditioning: Deferred[Conditioning] = Conditioning.model_construct()
    model: Deferred[Model] = Model.model_construct()
    method: Annotated[Text, AfterValidator(_registered)] = "ml"
    """How faults are identified: ml, maximum likelihood, or another registered method, see bfi identify --help."""
    risro: Deferred[Risro] = Risro.model_construct()
    dmae: Deferred[Dmae] = Dmae.model_construct()
    selection: Deferred[Selection] = Selection.model_construct()
    dictionary: DictionarySource | None = None
    """A file, relative to this one, or the dictionary itself."""
    start_time: Deferred[StartTime] = StartTime.model_construct()
    calibrate: Deferred[Calibrate] = Calibrate.model_construct()
    detect: Deferred[Detect] = Detect.model_construct()
    diagnose: Deferred[Diagnose] = Diagnose.model_construct()
    diagnosability: Deferred[Diagnosability] = Diagnosability.model_construct()
    audit: Deferred[AuditOfDictionary] = AuditOfDictionary.model_construct()
    seed: Annotated[Whole, Field(ge=0)] = 0
    strict: StrictBool = False
    """Whether an answer that cannot be trusted is exit code 4."""
    fail_on: Literal["fault", "deviation"] | None = None
    """Exit code 10 when a fault is declared; deviation: also when an error within its tolerance is."""

    _path: str | None = PrivateAttr(default=None)
    _sha256: str | None = PrivateAttr(default=None)
    _flags: Mapping[str, str] = PrivateAttr(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _units_by_a_word_are_shown(cls, data: Any) -> Any:
        if not isinstance(data, Mapping) or not isinstance(data.get("units"), str):
            return data
        word, named = data["units"], get_args(UnitsName)
        if word not in named:
            what = f"units: not a mapping or one of the choices, got {shown(word)}{did_you_mean(word, named)}"
            raise ValueError(what)
        if data.get("shown_units", word) != word:
            raise ValueError(f"units: {word}, but shown_units is {shown(data['shown_units'])}; keep one")
        return {**{key: value for key, value in data.items() if key != "units"}, "shown_units": word}

    @model_validator(mode="after")
    def _inputs_are_not_outputs(self) -> Self:
        for name in self.inputs:
            if name in self.outputs:
                raise ValueError(f"'{name}' is both an input and an output; keep one")
        return self

    @property
    def feedthrough(self) -> bool:
        """Whether an input acts in the same sample too, as asked for or as the method has it."""
        return METHODS[self.method].feedthrough if self.model.feedthrough is None else self.model.feedthrough

    @property
    def default_channel(self) -> str:
        """Channel of the entries of a dictionary without a channel: tas, or the first output if tas is none."""
        return "tas" if "tas" in self.outputs else self.outputs[0]

    @property
    def path(self) -> str | None:
        """The file it was read from, None for the defaults."""
        return self._path

    @property
    def sha256(self) -> str | None:
        """Digest of the file, None for the defaults."""
        return self._sha256

    def place(self, key: str) -> str:
        """Return the place of a key's value, for messages: an option, or file and key."""
        return self._flags.get(key) or (f"{self._path}: {key}" if self._path else key)

    def load_dictionary(self, *, allow_outside: bool = False) -> Dictionary | None:
        """Return the dictionary the configuration names or holds, None where there is none.

        Entries without a channel act on the dictionary's channel, by default on `default_channel`.

        Parameters
        ----------
        allow_outside : the sample files of a dictionary may lie outside its folder.

        Raises
        ------
        DictionaryError : see `bfi_cli.dictionary.load_dictionary`.
        """
        if self.dictionary is None:
            return None
        channel = self.default_channel
        if isinstance(self.dictionary, str):
            return load_dictionary(self.dictionary, allow_outside=allow_outside, channel=channel)
        return load_dictionary(self.dictionary, where=f"{self.path or 'configuration'}: dictionary", channel=channel)


def load_config(path: str | Path, *, allow_outside: bool = False) -> Config:
    """Return the configuration of a YAML file; an empty file is the defaults.

    Parameters
    ----------
    allow_outside : sample files may lie outside the file's folder.

    Raises
    ------
    ConfigError : all complaints in one line.
    """
    path = Path(path)
    data = load_yaml(read_text(path, error=ConfigError), where=str(path), error=ConfigError)
    context = {"folder": path.parent, "allow_outside": allow_outside}
    config = validate(Config, {} if data is None else data, where=str(path), error=ConfigError, context=context)
    return _with_origin(config, str(path), hashlib.sha256(path.read_bytes()).hexdigest())


def merge(
    config: Config,
    overrides: Mapping[str, Any],
    *,
    where: str = "command line",
    flags: Mapping[str, str] | None = None,
) -> Config:
    """Return the configuration with its values replaced by those of the command line.

    Parameters
    ----------
    overrides : value by dotted path ("model.order"); None means not given. Paths are relative to the working directory.
    flags : by dotted path the option of the command line that a value came with, see `Config.place`.

    Raises
    ------
    ConfigError : all complaints about the values, by the rules of the file, in one line.
    """
    data = config.model_dump(exclude_unset=True)
    for dotted, value in overrides.items():
        if value is not None:
            *parents, key = dotted.split(".")
            section = data
            for parent in parents:
                below = section.get(parent)
                section[parent] = dict(below) if isinstance(below, Mapping) else {}
                section = section[parent]
            section[key] = value
    merged = _with_origin(validate(Config, data, where=where, error=ConfigError), config.path, config.sha256)
    merged._flags = {**config._flags, **(flags or {})}
    return merged


def _with_origin(config: Config, path: str | None, sha256: str | None) -> Config:
    config._path, config._sha256 = path, sha256
    return config


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of the configuration's YAML, for editors."""
    return editor_schema(Config, "bfi configuration")
