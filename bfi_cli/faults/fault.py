"""A fault: its shape, where and when it acts, the signal it adds to a sensor; declared faults against injected ones."""

from __future__ import annotations

import contextlib
import math
import reprlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import DictionaryError, LogError
from ..kernels.atom_signals import Tail
from ..printable import shortened
from ..quantities.channels import STANDARD, change_in_si
from .shapes import KEY_RULES, SHAPES, Shape

__all__ = ["Decision", "Fault", "FaultEstimate", "active_samples", "build_up_s", "course", "did_you_mean"]
__all__ += ["fault_from_dict", "fault_to_dict", "has_channel", "magnitude_unit", "meaning", "parse_spec", "physical"]
__all__ += ["shown", "tail_of", "unit_signal", "unit_signals", "unknown_key"]

FloatArray = NDArray[np.float64]
Decision = Literal["fault", "no_fault", "inconclusive"]

COMMON_KEYS = ("shape", "name", "channel", "magnitude", "onset_s", "offset_s")
TEXT_KEYS = ("shape", "name", "channel", *(key for key, rule in KEY_RULES.items() if rule in ("reference", "file")))
# ONSET_TOLERANCE_SAMPLES [samples]: what an onset computed from a sample's number and rate may differ from its time.
ONSET_TOLERANCE_SAMPLES = 1e-6
# Samples whose steps tell that of a log, here where a millionth of it counts.
STEPS_SEEN = 1001
# SHOWN_LETTERS: letters of a value that a message quotes; with where and what to do it fills three rows of 80 columns.
SHOWN_LETTERS = 120
_ABRIDGED = reprlib.Repr()
_ABRIDGED.maxstring = _ABRIDGED.maxother = 100
_ABRIDGED.maxlevel = 3  # what lies deeper does not fit beside the rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A sensor fault, most often additive, `magnitude * signal(t)`, zero before `onset_s` and from `offset_s` on.

    Times are seconds on the axis the fault was stated on (see `relative_to` of a dictionary). `channel` is "tas" where
    none is given. A fault of a pressure line has none, but for an entry of a dictionary, whose `channel` is the output
    that it is looked for in.

    An entry of a dictionary whose onset is not known is a kind of fault, which is searched: `onset_range_s` are the
    onsets that it may have, infinite where any, and `parameter_range` the frequencies, time constants or durations,
    None where these are stated, or any is looked for. Its `onset_s` means nothing.
    """

    shape: Shape
    channel: str = ""
    magnitude: float = 1.0
    onset_s: float = 0.0
    offset_s: float | None = None
    name: str | None = None
    slope: float | None = None
    frequency_hz: float | None = None
    phase_rad: float = 0.0
    phase_reference: Literal["onset", "window"] = "onset"
    time_constant_s: float | None = None
    duration_s: float | None = None
    file: str | None = None
    cabin_altitude_m: float | None = None
    onset_range_s: tuple[float, float] | None = None
    parameter_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise DictionaryError(f"fault: shape: {_unknown_shape(self.shape)}")
        if not self.channel and has_channel(self.shape):
            object.__setattr__(self, "channel", "tas")

    @property
    def called(self) -> str:
        """Its name, or its shape where it has none."""
        return self.name or self.shape

    @property
    def parameter(self) -> float | None:
        """Its frequency, time constant or duration; None where it has none."""
        return self.frequency_hz or self.time_constant_s or self.duration_s

    def later(self, shift_s: float) -> Fault:
        """Return the fault that begins and ends later by some seconds."""
        return replace(
            self,
            onset_s=self.onset_s + shift_s,
            offset_s=None if self.offset_s is None else self.offset_s + shift_s,
            onset_range_s=self.onset_range_s and (self.onset_range_s[0] + shift_s, self.onset_range_s[1] + shift_s),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultEstimate:
    """A declared fault. `fault` carries shape, channel, times; `magnitude` multiplies its unit signal.

    `sd` and `ci95` are NaN where they are not known, what follows them is None.

    Attributes
    ----------
    onset_ci95 : earliest and latest onset that the log admits; None where the onset was stated.
    statistic : twice the log of the likelihood ratio of the fault, the others in the model; p_value : of that.
    effect : the largest error that it makes on its channel within the window.
    beyond_tolerance : whether that is surely more, or surely no more, than the channel's tolerance.
    among : faults that explain the log about as well.
    source : of the evidence that names it, see `bfi_cli.decision.Evidence`.
    evidence : by source that declares it, the statistic there; None where the source has none.
    """

    name: str
    fault: Fault
    magnitude: float
    unit: str
    physical_value: float
    physical_unit: str
    sd: float
    ci95: tuple[float, float]
    onset_ci95: tuple[float, float] | None = None
    statistic: float | None = None
    p_value: float | None = None
    effect: float | None = None
    beyond_tolerance: bool | None = None
    among: tuple[str, ...] = ()
    source: str = ""
    evidence: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def onset_span_s(self) -> tuple[float, float]:
        """Earliest and latest onset, the one that was stated where there is no interval."""
        return self.onset_ci95 or (self.fault.onset_s, self.fault.onset_s)

    @property
    def physical_scale(self) -> float:
        """What a magnitude of 1 means."""
        return self.physical_value / self.magnitude if self.magnitude else 1.0


def has_channel(shape: Shape) -> bool:
    """Say whether faults of this shape are of one channel; those of a pressure line are of all that follow from it."""
    return SHAPES[shape].acts_on in ("channel", "reading", "held", "course")


def active_samples(fault: Fault, time_s: FloatArray, tolerance_s: float | None = None) -> NDArray[np.bool_]:
    """Return (n_samples,) true from the onset to before the offset, both to within a tolerance, see `time_tolerance_s`.

    Parameters
    ----------
    tolerance_s : where it is known, of several faults on one axis.
    """
    if tolerance_s is None:
        tolerance_s = time_tolerance_s(time_s)
    stop = math.inf if fault.offset_s is None else fault.offset_s
    active: NDArray[np.bool_] = (time_s >= fault.onset_s - tolerance_s) & (time_s < stop - tolerance_s)
    return active


def time_tolerance_s(time_s: FloatArray) -> float:
    """Return 1e-6 of a sample of a time axis, never below its resolution (seconds since 1970 resolve 2e-7 s)."""
    if time_s.size == 0:
        return 0.0
    steps = np.sort(np.diff(time_s[:STEPS_SEEN]))
    step = 0.5 * float(steps[(len(steps) - 1) // 2] + steps[len(steps) // 2]) if steps.size else 0.0  # their median
    return max(ONSET_TOLERANCE_SAMPLES * step, 4.0 * float(np.spacing(np.abs(time_s[[0, -1]]).max())))


def unit_signal(
    fault: Fault, time_s: FloatArray, *, window_start_s: float, tolerance_s: float | None = None
) -> FloatArray:
    """Return (n_samples,) the signal of `fault` at magnitude 1, in the unit the shape implies.

    For a shape that acts on a reading or a pressure that is its course, of which `bfi_cli.flightlog.inject` makes what
    the channels show.

    Parameters
    ----------
    fault : its times on the axis of `time_s`; its own `magnitude` is not applied.
    time_s : (n_samples,) seconds, increasing.
    window_start_s : where the phase of `phase_reference: window` counts from, on the axis of `time_s`.
    tolerance_s : see `active_samples`.

    Raises
    ------
    DictionaryError : a parameter of the shape is missing, or the sample file cannot be used.

    Notes
    -----
    `ramp_hold` and `samples` keep their last value until the offset; `samples` is zero before its first time.
    """
    (signal,) = unit_signals([fault], time_s, window_start_s=window_start_s, tolerance_s=tolerance_s)
    return np.asarray(signal)


def unit_signals(
    faults: Sequence[Fault], time_s: FloatArray, *, window_start_s: float, tolerance_s: float | None = None
) -> FloatArray:
    """Return (n_faults, n_samples) what `unit_signal` does; an oscillation on the window's own time, which an onset
    only switches on, is made once for all onsets.
    """
    time_s = np.asarray(time_s, dtype=np.float64)
    tolerance_s = time_tolerance_s(time_s) if tolerance_s is None else tolerance_s
    signals, running = np.zeros((len(faults), len(time_s))), dict[tuple[Any, ...], FloatArray]()
    # What `active_samples` says, of times in order.
    ends_s = [math.inf if fault.offset_s is None else fault.offset_s for fault in faults]
    edges_s = np.array([[fault.onset_s for fault in faults], ends_s]) - tolerance_s
    edges = np.searchsorted(time_s, edges_s).T.tolist()
    for signal, fault, edge in zip(signals, faults, edges, strict=True):
        active = slice(*edge)
        for key in SHAPES[fault.shape].keys:
            if key.required and getattr(fault, key.name) in (None, ""):
                raise DictionaryError(f"{fault.called}: {_missing(key.name, fault.shape)}")
        parameters = _parameters(fault)
        if parameters.pop("phase_reference", "onset") == "onset":
            since_s = np.maximum(time_s[active] - fault.onset_s, 0.0)
            signal[active] = SHAPES[fault.shape].signal(since_s, **parameters)
            continue
        alike = (fault.shape, *parameters.values())
        if alike not in running:
            running[alike] = SHAPES[fault.shape].signal(time_s - window_start_s, **parameters)
        signal[active] = running[alike][active]
    return signals


def course(fault: Fault, time_s: FloatArray) -> FloatArray:
    """Return (n_samples,) the signal of `fault` as if it did not end, and before its onset what it is there.

    Times and phase count from the onset, as in `unit_signal`.
    """
    parameters = {key: value for key, value in _parameters(fault).items() if key != "phase_reference"}
    return SHAPES[fault.shape].signal(np.maximum(time_s - fault.onset_s, 0.0), **parameters)


def tail_of(fault: Fault, *, window_start_s: float) -> tuple[Tail, float, float] | None:
    """Return what the signal of `fault` is from some time on, the time that it counts from, and the time it holds from.

    None where its shape has no such form. Its offset is not applied.
    """
    parameters = _parameters(fault)
    from_window = parameters.pop("phase_reference", "onset") == "window"
    tail = SHAPES[fault.shape].tail(**parameters)
    return (
        None if tail is None else (tail, window_start_s if from_window else fault.onset_s, fault.onset_s + tail.from_s)
    )


def _parameters(fault: Fault) -> dict[str, Any]:
    return {key.name: getattr(fault, key.name) for key in SHAPES[fault.shape].keys}


def _missing(key: str, shape: str) -> str:
    return f"{key}: missing; a {shape} needs it"


def magnitude_unit(fault: Fault, channel_unit: str) -> str:
    """Return the unit of the magnitude of `fault`, "" where it is a pure number (a drift with a slope)."""
    return SHAPES[fault.shape].magnitude_unit(channel_unit, **_parameters(fault))


def physical(fault: Fault, magnitude: float, channel_unit: str) -> tuple[float, str]:
    """Return what the magnitude means: (value, unit).

    The rate of change of a drift, the value a ramp-hold ends at, otherwise the magnitude itself.
    """
    return SHAPES[fault.shape].physical(magnitude, channel_unit, **_parameters(fault))


def meaning(fault: Fault, channel_unit: str) -> tuple[float, str] | tuple[None, None]:
    """Return what a magnitude of 1 means, for a fault whose magnitude multiplies a slope; (None, None) for others."""
    return (None, None) if fault.slope is None else physical(fault, 1.0, channel_unit)


def build_up_s(fault: Fault) -> float | None:
    """Return the seconds in which a fault reaches nine tenths of its size, None where it grows to the end."""
    return SHAPES[fault.shape].build_up_s(**_parameters(fault))


def fault_to_dict(fault: Fault) -> dict[str, Any]:
    """Return the JSON object of a fault: the common keys and those of its shape, None where absent or meaningless."""
    common = {key: getattr(fault, key) for key in COMMON_KEYS}
    common |= {} if fault.onset_range_s is None else {"onset_s": None}
    left_out = dict.fromkeys(set(COMMON_KEYS) - set(_common_keys(fault.shape)))
    return common | left_out | _parameters(fault)


def _common_keys(shape: str) -> tuple[str, ...]:
    """Return the common keys that a fault of this shape has."""
    absent = set() if has_channel(shape) else {"channel"}
    absent |= set() if SHAPES[shape].has_magnitude else {"magnitude"}
    return tuple(key for key in COMMON_KEYS if key not in absent)


def fault_from_dict(data: Mapping[str, Any], *, where: str = "fault") -> Fault:
    """Return the fault of a JSON object; None counts as absent, sample files are not looked for.

    Raises
    ------
    DictionaryError : all problems in one line, each with its key.
    """
    given = {key: value for key, value in data.items() if value is not None}
    if problems := list(_problems(given)):
        raise DictionaryError(f"{where}: {' | '.join(problems)}")
    fields: dict[str, Any] = {key: value if key in TEXT_KEYS else float(value) for key, value in given.items()}
    return Fault(**fields)


def parse_spec(text: str, *, where: str = "--fault", unit_of: Callable[[str], str] | None = None) -> Fault:
    """Return the fault of a command-line SPEC, "bias,channel=tas,magnitude=4,onset_s=13.8" or "...,magnitude=8kt,...".

    Parameters
    ----------
    unit_of : the SI unit of a log's channel by its name, "" where none is stated, for channels without a standard name.
        Without it a magnitude on one of these may state any unit.

    Raises
    ------
    DictionaryError : all problems in one line, each with its key.
    """
    where = f"{where} {text}"
    first, *rest = [part.strip() for part in text.split(",")]
    given: dict[str, Any] = {}
    for part in (first if "=" in first else f"shape={first}", *rest):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise DictionaryError(f"{where}: expected key=value, got '{part}'; separate the keys by commas")
        if key in given:
            raise DictionaryError(f"{where}: {key}: given twice; keep one")
        given[key] = value
        if key not in TEXT_KEYS:
            with contextlib.suppress(ValueError):  # what is no number is said by its key
                given[key] = float(value)
    if isinstance(given.get("magnitude"), str):
        given["magnitude"] = _magnitude_in_si(given, unit_of, where=f"{where}: magnitude")
    fault = fault_from_dict(given, where=where)
    require_loss(fault, where=where)
    return fault


def require_loss(fault: Fault, *, where: str) -> None:
    """Check that a fault that is stated does not gain what it is said to lose; an estimate may.

    Raises
    ------
    DictionaryError : it does.
    """
    size = fault.magnitude
    if SHAPES[fault.shape].is_loss and size < 0.0:
        raise DictionaryError(f"{where}: magnitude: a loss is positive, got {shown(size)}; write {shown(-size)}")


def _magnitude_in_si(given: Mapping[str, Any], unit_of: Callable[[str], str] | None, *, where: str) -> float | str:
    """Return a magnitude that states its unit, "4kt", as a number in SI; what is no such text as it is.

    Raises
    ------
    DictionaryError : the unit is unknown, or not that of a magnitude of this shape on this channel.
    """
    text = given["magnitude"]
    try:
        value, unit = change_in_si(text)
    except ValueError:
        return str(text)
    except LogError as error:
        raise DictionaryError(f"{where}: {str(error).removeprefix('unit: ')}") from None
    if any(_problems({**given, "magnitude": value})):  # of other keys, which are told instead
        return value
    fault = fault_from_dict({**given, "magnitude": value})
    channel_unit = ""
    if fault.channel in STANDARD:
        channel_unit = STANDARD[fault.channel].unit
    elif magnitude_unit(fault, "m") != magnitude_unit(fault, "K"):
        if unit_of is None:
            return value
        channel_unit = unit_of(fault.channel)
        if not channel_unit:
            hint = f"state it with --unit {fault.channel}=UNIT, or leave the unit out"
            raise DictionaryError(f"{where}: '{fault.channel}' has no unit in the log, got {shown(text)}; {hint}")
    expected = magnitude_unit(fault, channel_unit) or "1"
    if unit != expected:
        is_in = "is a pure number" if expected == "1" else f"is in {expected}"
        hint = "leave the unit out" if expected == "1" else "give a unit of that kind, or none for SI"
        raise DictionaryError(f"{where}: {is_in}, got {shown(text)}; {hint}")
    return value


def _problems(given: Mapping[str, Any]) -> Iterator[str]:
    shape = given.get("shape")
    if not isinstance(shape, str) or shape not in SHAPES:
        yield f"shape: {_unknown_shape(shape)}"
        return
    allowed = (*_common_keys(shape), *(key.name for key in SHAPES[shape].keys))
    for key, value in given.items():
        if key not in allowed:
            yield f"{key}: {unknown_key(key, allowed)}"
        elif problem := _value_problem(key, value):
            yield f"{key}: {problem}, got {shown(value)}"
    yield from (_missing(key.name, shape) for key in SHAPES[shape].keys if key.required and key.name not in given)
    onset, offset = given.get("onset_s", 0.0), given.get("offset_s")
    if not _value_problem("onset_s", onset) and not _value_problem("offset_s", offset) and offset <= onset:
        yield f"offset_s: must be after onset_s ({onset:g} s), got {offset:g} s"


def _unknown_shape(shape: object) -> str:
    return f"unknown shape, got {shown(shape)}{did_you_mean(shape, tuple(SHAPES))}"


def _value_problem(key: str, value: object) -> str | None:
    if key in TEXT_KEYS:
        if not isinstance(value, str) or not value:
            return "must be text"
        is_reference = KEY_RULES.get(key) == "reference"
        return "must be onset or window" if is_reference and value not in ("onset", "window") else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= sys.float_info.max:
        return "must be a finite number"
    if KEY_RULES.get(key) == "positive" and value <= 0:
        return "must be greater than 0"
    return "must not be 0" if KEY_RULES.get(key) == "nonzero" and value == 0 else None


def did_you_mean(word: object, known: Sequence[str]) -> str:
    """Return "; did you mean 'onset_s'?", or "; known: ..." where nothing is close."""
    import difflib

    is_short = isinstance(word, str) and len(word) <= SHOWN_LETTERS
    close = difflib.get_close_matches(str(word), known, n=1, cutoff=0.6) if is_short else []
    return f"; did you mean '{close[0]}'?" if close else f"; known: {', '.join(known)}"


def unknown_key(key: str, known: Sequence[str]) -> str:
    """Return what to say of a key that is not among the `known` ones; a key of another shape is called that."""
    if "shape" in known and key in (*KEY_RULES, *COMMON_KEYS):
        return f"not a key of this shape; known: {', '.join(known)}"
    return f"unknown key{did_you_mean(key, known)}"


def shown(value: object) -> str:
    """Return a value as a message shows it: YAML's words, quoted text, abridged."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return shortened(_ABRIDGED.repr(value), SHOWN_LETTERS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """What was declared against what was injected.

    Attributes
    ----------
    isolated : every injected fault was declared, and nothing else.
    false_alarms : names of the declared faults that were not injected.
    missed : names of the injected faults that were not declared.
    magnitude_error : norm of the error of all magnitudes over the norm of the injected ones, a fault that is absent
        counting 0; None where nothing was injected, or a fault that no declared one could be.
    vaf_fault : by output the variance accounted for of the fault, %; None where there is no fault in the window.
    """

    isolated: bool
    false_alarms: tuple[str, ...]
    missed: tuple[str, ...]
    magnitude_error: float | None
    vaf_fault: Mapping[str, float | None] = field(default_factory=dict)


def compare_faults(
    declared: Mapping[str, float], injected: Mapping[str, float], *, unknown: Sequence[str] = ()
) -> Comparison:
    """Compare magnitudes by name of fault.

    Parameters
    ----------
    declared, injected : magnitude by name of the dictionary's entry.
    unknown : injected faults that are no entry of the dictionary, and so are missed by any answer.
    """
    missed = (*(name for name in injected if name not in declared), *unknown)
    extra = tuple(name for name in declared if name not in injected)
    error = None
    if injected and not unknown:
        difference = [declared.get(name, 0.0) - injected.get(name, 0.0) for name in {**injected, **declared}]
        error = float(np.linalg.norm(difference) / np.linalg.norm(list(injected.values())))
    return Comparison(isolated=not missed and not extra, false_alarms=extra, missed=missed, magnitude_error=error)


def name_of(injected: Fault) -> str:
    """Return the name of an injected fault, or what tells it from the others of the log."""
    on = f", channel={injected.channel}" if injected.channel else ""
    return injected.name or f"{injected.shape}{on}, onset_s={injected.onset_s:g}"


def is_same_fault(first: Fault, second: Fault) -> bool:
    """Say whether two faults have the same definition but for name and magnitude, times on the same axis."""

    def definition(fault: Fault) -> dict[str, Any]:
        # A cabin that no altitude is given of is held at sea level.
        at = {"cabin_altitude_m": fault.cabin_altitude_m or 0.0}
        return {**fault_to_dict(fault), **at, "name": None, "magnitude": None}

    return definition(first) == definition(second)


def compare_by_onset(declared: Sequence[FaultEstimate], injected: Sequence[Fault], *, tolerance_s: float) -> Comparison:
    """Compare faults of which the onset was estimated with injected ones of the same shape, channel and onset.

    Parameters
    ----------
    declared : of different names.
    injected : on the same time axis; signs do not count, since half a period turns that of an oscillation.
    tolerance_s : onsets that differ by no more are the same.
    """
    sizes = {estimate.name: abs(estimate.magnitude) for estimate in declared}
    paired: dict[str, float] = {}
    unknown: list[str] = []
    for fault in injected:
        place = (fault.shape, fault.channel)
        rest = [estimate for estimate in declared if estimate.name not in paired]
        same = [estimate for estimate in rest if (estimate.fault.shape, estimate.fault.channel) == place]
        near = (estimate.name for estimate in same if abs(estimate.fault.onset_s - fault.onset_s) <= tolerance_s)
        if (name := next(near, None)) is not None:
            paired[name] = abs(fault.magnitude)
        else:
            unknown.append(name_of(fault))
    return compare_faults(sizes, paired, unknown=unknown)
