"""A sweep as it is written in YAML: a record, noise, a dictionary, and what varies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, ValidationInfo, model_validator

from ...aircraft import MANOEUVRES, MODELS
from ...config import Config, DictionarySource, Natural
from ...dictionary import Interval, NumberOrInterval
from ...errors import DictionaryError
from ...faults import Fault, did_you_mean, fault_from_dict, require_loss
from ...faults.shapes import SHAPES
from ...faults.validation import Number, Positive, Rules, Text, Whole, editor_schema
from ..compare import PEERS, Peer, program_peer


def _listed(value: object) -> object:
    """One value stands for a list of it."""
    return value if isinstance(value, list | tuple) else (value,)


def _log_or_model(value: object) -> str:
    if isinstance(value, Mapping):
        return "<log>" if "log" in value else "<model>"
    return "<log>" if isinstance(value, RecordedLog) else "<model>"


def _beside_sweep(path: str, info: ValidationInfo) -> str:
    return str((Path((info.context or {}).get("folder", "")) / path).resolve())


def _known(what: str, names: Iterable[str]) -> AfterValidator:
    """Return the check that a text is one of some names."""

    def check(name: str) -> str:
        if name not in names:
            raise ValueError(f"no such {what}, got '{name}'{did_you_mean(name, tuple(names))}")
        return name

    return AfterValidator(check)


def _no_zero(values: tuple[float, ...]) -> tuple[float, ...]:
    if 0 in values:
        raise ValueError("0 is no fault; leave it out, or add 0 to active")
    return values


NotNegative = Annotated[Number, Field(ge=0)]
Count = Annotated[Whole, Field(ge=0)]


class Span(Rules):
    """All whole numbers from low to high, both included."""

    low: Whole
    high: Whole

    @model_validator(mode="after")
    def _is_not_empty(self) -> Span:
        if self.high < self.low:
            raise ValueError(f"high must be at least low ({self.low}), got {self.high}")
        _no_zero(tuple(range(self.low, self.high + 1)))
        return self


class FlownModel(Rules):
    """A simulated flight, as `bfi simulate` makes it; gusts are drawn anew in every trial."""

    model: Annotated[Text, _known("model", MODELS)]
    """citation, citation-short-period."""
    manoeuvre: Annotated[Text, _known("manoeuvre", MANOEUVRES)] = "3211"
    """3211, 3211-pairs, doublet, multisine, none."""
    amplitude_rad: Positive = 0.035
    start_s: Number = 0.2
    step_s: Positive = 1.0
    duration_s: Positive = 31.72
    rate_hz: Positive = 100.0
    discretisation: Literal["zoh", "bilinear"] = "zoh"
    turbulence_m_s: NotNegative = 0.0
    """Intensity of Dryden gusts."""

    @property
    def label(self) -> str:
        """What a scenario calls it."""
        return f"{self.model}-{self.manoeuvre}"


class RecordedLog(Rules):
    """A recorded flight, or a part of it."""

    log: Annotated[Text, AfterValidator(_beside_sweep)]
    """A file, relative to this one."""
    group: Text | None = None
    """HDF5 group or MATLAB struct that holds the channels."""
    from_s: Number | None = None
    to_s: Number | None = None
    length_s: Positive | None = None
    """A window of that length, drawn in every trial from that part; default the whole part in each."""

    @property
    def label(self) -> str:
        """What a scenario calls it."""
        return Path(self.log).stem


class InjectedFault(Rules):
    """A fault that every trial of a scenario has, of any shape that `bfi inject` knows; times as the dictionary's."""

    shape: Annotated[Text, _known("shape", [name for name, shape in SHAPES.items() if shape.acts_on != "course"])]
    """bias, drift, scale, pitot_blocked, pitot_icing, ..."""
    name: Text | None = None
    """What results call it; default the entry of the dictionary that it is, else its shape."""
    channel: Text | None = None
    """The faulty channel; default tas. A fault of a pressure line has none."""
    magnitude: Number | None = None
    onset_s: NumberOrInterval | None = None
    """When it begins, s, or {from, to}: drawn between them in every trial; default from 10 to 90 % of the window."""
    offset_s: Number | None = None
    """When it recovers; default never."""
    onset_spread_s: NotNegative = 0.0
    """The fault begins, and ends, up to so many seconds before or after: drawn in every trial."""
    right: Annotated[tuple[Text, ...], BeforeValidator(_listed)] | None = None
    """Entries of the dictionary any of which is the right answer; default those that are this fault."""
    slope: Number | None = None
    frequency_hz: Positive | None = None
    phase_rad: Number | None = None
    time_constant_s: Positive | None = None
    duration_s: Positive | None = None
    cabin_altitude_m: Number | None = None

    @model_validator(mode="after")
    def _is_a_fault(self) -> InjectedFault:
        try:
            require_loss(self.fault(), where="fault")
        except DictionaryError as problem:
            raise ValueError(str(problem).removeprefix("fault: ")) from None
        return self

    def fault(self) -> Fault:
        """Return the fault, times as stated; one whose onset is drawn has the `onset_range_s` that it is drawn from.

        Raises
        ------
        DictionaryError : it is none.
        """
        given = self.model_dump(exclude={"right", "onset_s", "onset_spread_s"}, exclude_none=True)
        if self.onset_s is not None and not isinstance(self.onset_s, Interval):
            return fault_from_dict({**given, "onset_s": self.onset_s})
        for key in ("offset_s", "onset_spread_s"):
            if getattr(self, key):
                raise DictionaryError(f"{key}: goes with an onset that is stated; give onset_s, or leave {key} out")
        return replace(fault_from_dict(given), onset_range_s=(self.onset_s or Interval()).ends())


def _none_one_or_several(value: object) -> str:
    return "<none>" if value is None else "<list>" if isinstance(value, list | tuple) else "<fault>"


# Faults of a trial: none, one, or several at once.
InjectedFaults = Annotated[
    Annotated[InjectedFault, Tag("<fault>")]
    | Annotated[tuple[InjectedFault, ...], Field(min_length=1), Tag("<list>")]
    | Annotated[None, Tag("<none>")],
    Discriminator(_none_one_or_several),
]
RecordSource = Annotated[
    Annotated[FlownModel, Tag("<model>")] | Annotated[RecordedLog, Tag("<log>")], Discriminator(_log_or_model)
]
Magnitudes = Annotated[
    Annotated[Span, Tag("<mapping>")]
    | Annotated[tuple[Number, ...], Field(min_length=1), AfterValidator(_no_zero), Tag("<list>")],
    Discriminator(lambda value: "<mapping>" if isinstance(value, Mapping | Span) else "<list>"),
]
Some = Field(min_length=1)


class ComparedRules(Rules):
    """Methods of bfi compare, each of which meets the same trials."""

    methods: Annotated[tuple[Annotated[Text, _known("method", PEERS)], ...], BeforeValidator(_listed)] = ()
    """Names as bfi compare lists them; one or several."""
    programs: Mapping[Text, Annotated[Text, AfterValidator(_beside_sweep)]] = Field(default_factory=dict)
    """Name: executable of a method of your own, relative to this file (docs/benchmark.md)."""
    timeout_s: Positive = 60.0
    """Seconds after which a program of a trial is stopped."""
    false_alarm: Annotated[Number, Field(gt=0, lt=1)] = 0.05
    """Share of the trials without a fault at which the scores of all methods are compared."""

    @model_validator(mode="after")
    def _has_some(self) -> ComparedRules:
        if not (self.methods or self.programs):
            raise ValueError("no method, got none; name some in methods")
        for name in self.programs:
            if name in PEERS:
                raise ValueError(f"programs: '{name}' is a method of this program; choose another name")
        return self

    @property
    def peers(self) -> dict[str, Peer]:
        """The methods by name."""
        programs = {name: program_peer(path, self.timeout_s) for name, path in self.programs.items()}
        return {**{name: PEERS[name] for name in self.methods}, **programs}


class SweepRules(Rules):
    """Configuration of bfi montecarlo: every combination of what is a list is a scenario."""

    record: Annotated[tuple[RecordSource, ...], Some, BeforeValidator(_listed)]
    """What the faults are added to: a model that flies, or a log; one or several."""
    dictionary: Annotated[tuple[DictionarySource, ...], Some, BeforeValidator(_listed)]
    """The faults that are drawn, and looked for; one or several."""
    noise: Mapping[Text, Annotated[tuple[NotNegative, ...], Some, BeforeValidator(_listed)]] = Field(
        default_factory=dict
    )
    """Channel: standard deviation of white noise added to it, in its unit; one or several."""
    active: Annotated[tuple[Count, ...], Some, BeforeValidator(_listed)]
    """How many faults of the dictionary act at once; one or several."""
    inject: Annotated[tuple[InjectedFaults, ...], Some, BeforeValidator(_listed)] = (None,)
    """Faults that are in every trial beside those drawn, whether the dictionary has them or not; each entry of the list
    is null, a fault, or a list of faults that act together, and makes a scenario of its own."""
    magnitudes: Magnitudes = Span(low=1, high=10)
    """What the magnitude of each is drawn from: {low, high} or a list."""
    trials: Natural = 100
    """Per scenario."""
    seed: Count = 0
    workers: Natural = 1
    """Processes of this machine."""
    scheduler: Text | None = None
    """Address of a Dask scheduler, which then has the workers."""
    compare: ComparedRules | None = None
    """Methods to run in place of bfi identify, each a scenario of its own."""
    identify: Config = Config()
    """Settings of all scenarios, keys as in the configuration of an analysis."""
    grid: Mapping[Text, Annotated[tuple[Any, ...], Some, BeforeValidator(_listed)]] = Field(default_factory=dict)
    """Dotted key of such a setting, as model.order: its values."""

    @model_validator(mode="after")
    def _one_dictionary(self) -> SweepRules:
        if self.identify.dictionary is not None or "dictionary" in self.grid:
            raise ValueError("a dictionary stands in identify or grid; name it at the top, as dictionary")
        return self

    @property
    def injections(self) -> tuple[tuple[InjectedFault, ...], ...]:
        """The faults that are in every trial, of each scenario."""
        return tuple(() if entry is None else entry if isinstance(entry, tuple) else (entry,) for entry in self.inject)

    @property
    def sizes(self) -> tuple[float, ...]:
        """The magnitudes to draw from."""
        if isinstance(self.magnitudes, Span):
            return tuple(float(z) for z in range(self.magnitudes.low, self.magnitudes.high + 1))
        return self.magnitudes


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of a sweep's YAML, for editors."""
    return editor_schema(SweepRules, "bfi sweep")
