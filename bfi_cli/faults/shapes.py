"""The shapes of faults, one entry each: its keys, its signal, its units and its words.

All lists of shapes (in the JSON of a fault, the dictionary's YAML and its schema, the shapes that the scan can look
for, help texts and labels) are made from the entries of `SHAPES`. Most shapes add a signal to one channel; `scale` adds
a share of the channel's reading, `frozen` holds the reading, and a fault of a pressure line moves every channel that
follows from its pressure.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import DictionaryError, reason_of
from ..kernels.atom_signals import Tail
from ..kernels.onset import waveform as waveforms
from ..quantities.channels import per_second

FloatArray = NDArray[np.float64]
Rule = Literal["number", "positive", "nonzero", "reference", "file"]
Kind = Literal["abrupt", "oscillating", "slow"]
# The key of a kind of fault that may be an interval, or left out for any; those in s.
CONSTANTS = ("time_constant_s", "duration_s")
PARAMETERS = ("frequency_hz", *CONSTANTS)
# Two hours at 100 Hz, 25 letters each line.
MAX_BYTES = 20_000_000


def lies_inside(path: Path, folder: Path) -> bool:
    """Return whether a file lies in a folder or below it, links followed; the file need not exist."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def sample_bytes(path: str) -> bytes:
    """Return the content of a sample file.

    Raises
    ------
    DictionaryError : the file cannot be read, or is larger than `MAX_BYTES`.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise _unreadable(path, reason_of(error)) from None
    if len(content) > MAX_BYTES:
        raise _unreadable(path, f"larger than {MAX_BYTES / 1e6:g} MB")
    return content


def read_samples(path: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (n,) times, increasing, and (n,) values; a first line that holds no numbers is a header.

    Raises
    ------
    DictionaryError : the file cannot be read, or holds no samples. Its content is not quoted: a stranger's dictionary
        may name any file of this machine.
    """
    try:
        lines = sample_bytes(path).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise _unreadable(path, "not a text file") from None
    rows: list[tuple[int, list[float]]] = []
    for i, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            row = [float(field) for field in line.replace(";", ",").split(",")]
        except ValueError:
            row = []
        rows.append((i, row if len(row) == 2 and all(map(math.isfinite, row)) else []))
    if rows and not rows[0][1]:
        del rows[0]
    for i, row in rows:
        if not row:
            raise DictionaryError(f"{path}: line {i}: not two finite numbers; each line is time in s, value")
    table = np.array([row for _, row in rows], dtype=np.float64).reshape(-1, 2)
    if len(table) == 0 or not np.all(np.diff(table[:, 0]) > 0):
        raise DictionaryError(f"{path}: times do not increase from line to line; sort the samples by time")
    return table[:, 0], table[:, 1]


def _unreadable(path: str, reason: str) -> DictionaryError:
    return DictionaryError(f"{path}: cannot read the samples, {reason}; give a CSV file of time, value")


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A key of a shape, beside the keys of every fault.

    Attributes
    ----------
    rule : its values: a number, a number greater than 0, a number other than 0, "onset" or "window", or a CSV file.
    description : for editors, where name and unit do not say enough.
    """

    name: str
    rule: Rule
    required: bool = False
    description: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultShape:
    """The definition of a shape.

    Attributes
    ----------
    signal : from the seconds since the onset (since the start of the window where `phase_reference` says so) and the
        keys of the shape by name, the signal of magnitude 1.
    formula : the signal in words, for tables and editors.
    kind : of fault, for verdicts: abrupt (it reaches a size and stays near it), oscillating, slow (it grows).
    build_up_s : from its keys, the time in which it reaches nine tenths of its final size, None without a final size. A
        fault that builds up slowly resembles a change of thrust, configuration or wind.
    label : its name in sentences.
    tail : from its keys, the form of its signal from some time on, None where that is no `Tail`.
    keys : its keys beside those of every fault, in the order of JSON and messages.
    course : of magnitude 1 over the seconds since the onset, negative before it, and its time constant or duration, as
        relations between channels follow it; None where they do not.
    is_scanned : whether `bfi start-time` can look for it.
    waveform : from the number of samples, their rate, frequency, time constant or duration, and phase, what the scan
        looks for; None for the samples of `signal`.
    stands_out_as : the shape that the scan sees in it and that is named afterwards: a lag or a ramp stands out as the
        step that it becomes, whatever oscillates as a sine. "" for itself.
    claimed_s : time constants or durations that a claim about steps covers, by its longest, since what builds up faster
        stands out more. The same answers in 340 runs on two recorded flights with ramps of 5 s beside; with 10 s alone
        a ramp over 12.3 s of 2.4 tolerances was excluded.
    magnitude_unit : from the channel's unit and the keys, the unit of the magnitude; "" for a pure number.
    physical : from the magnitude, the channel's unit and the keys, the physical meaning: value and unit.
    acts_on : the channel, to which magnitude x signal is added; its reading, of which that share is added, or which
        is held; the pressure of a line, of which `lines` makes another, and which is no channel that a fault could
        name; or a channel, to which a course is added that nobody knows and an analysis estimates: the signal is where
        it acts.
    has_magnitude : whether it has one; without, it is whole.
    says : what it does in a sentence behind its channel, with its {size}, the {side} ("high") or {way} ("up") of its
        sign, its {frequency} and {seconds}; a fault of a line needs no subject.
    plainly : the same where its size is not known, "" for its label.
    lines : from static and total pressure (n_samples,), the same at the onset, the cabin's pressure, Pa, and
        magnitude x signal (n_samples,), the static and total pressure that the instruments get.
    loss : of a line that still follows the pressure outside, 1 or -1: loss x magnitude x signal is the share of it that
        the line has lost. None where nothing is left that tells the pressure outside, as in a trapped line.
    """

    signal: Callable[..., FloatArray]
    formula: str
    kind: Kind
    label: str
    build_up_s: Callable[..., float | None] = lambda **_: 0.0
    tail: Callable[..., Tail | None] = lambda **_: None
    keys: tuple[Key, ...] = ()
    course: Callable[[FloatArray, float], FloatArray] | None = None
    is_scanned: bool = False
    waveform: Callable[[int, float, float, float], waveforms.Waveform] | None = None
    stands_out_as: str = ""
    claimed_s: tuple[float, ...] = ()
    magnitude_unit: Callable[..., str] = lambda channel_unit, **_: channel_unit
    physical: Callable[..., tuple[float, str]] = lambda magnitude, channel_unit, **_: (magnitude, channel_unit)
    acts_on: Literal["channel", "reading", "held", "p_static", "p_total", "course"] = "channel"
    has_magnitude: bool = True
    says: str = ""
    plainly: str = ""
    lines: Callable[..., tuple[FloatArray, FloatArray]] | None = None
    loss: float | None = None

    @property
    def parameter(self) -> str | None:
        """Its frequency, time constant or duration, by the name of its key; None where it has none."""
        return next((key.name for key in self.keys if key.name in PARAMETERS), None)

    @property
    def is_loss(self) -> bool:
        """Whether its magnitude says what a line loses, and is stated without a sign."""
        return self.has_magnitude and self.loss == 1.0


def _ones(elapsed_s: FloatArray) -> FloatArray:
    return np.ones_like(elapsed_s)


def _samples(elapsed_s: FloatArray, *, file: str) -> FloatArray:
    """Return the values between the points of the file: 0 before the first time, the last value after the last."""
    time_s, value = read_samples(file)
    return np.interp(elapsed_s, time_s, value, left=0.0)


def _samples_tail(*, file: str) -> Tail:
    time_s, value = read_samples(file)
    return Tail(from_s=float(time_s[-1]), level=float(value[-1]))


def _oscillation_tail(phase_rad: float, frequency_hz: float) -> Tail:
    return Tail(amplitude=complex(np.exp(1j * phase_rad)), exponent=2j * np.pi * frequency_hz)


def _angle(since_s: FloatArray, frequency_hz: float, phase_rad: float) -> FloatArray:
    return 2.0 * np.pi * frequency_hz * since_s + phase_rad


def _relaxing(elapsed_s: FloatArray, *, time_constant_s: float) -> FloatArray:
    return np.asarray(-np.expm1(-elapsed_s / time_constant_s))


def _towards(pressure: FloatArray, other: FloatArray | float, amount: FloatArray) -> FloatArray:
    return pressure + amount * (other - pressure)


LN_10 = 2.302585092994046  # time constants until an exponential is within a tenth of its end
FREQUENCY = Key(name="frequency_hz", rule="positive", required=True)
TIME_CONSTANT = Key(name="time_constant_s", rule="positive", required=True)
OSCILLATION_KEYS = (
    FREQUENCY,
    Key(name="phase_rad", rule="number"),
    Key(
        name="phase_reference",
        rule="reference",
        description="Where the phase counts from: the onset (default) or the start of the window.",
    ),
)
# What entries have in common. The magnitude of a share, of a reading or of a pressure, is a pure number; that of a
# fault of a line is whole, unless its entry says otherwise.
GROWING: dict[str, Any] = {"kind": "slow", "build_up_s": lambda **_: None}
SHARE: dict[str, Any] = {
    "kind": "slow",
    "magnitude_unit": lambda channel_unit, **_: "",
    "physical": lambda magnitude, channel_unit, **_: (magnitude, "1"),
}
PITOT: dict[str, Any] = {**SHARE, "acts_on": "p_total", "has_magnitude": False}
STATIC: dict[str, Any] = {**SHARE, "acts_on": "p_static", "has_magnitude": False}

SHAPES: Mapping[str, FaultShape] = {
    "bias": FaultShape(
        signal=np.ones_like,
        formula="1 from the onset.",
        kind="abrupt",
        label="bias",
        says="reads {size} too {side}",
        tail=lambda: Tail(level=1.0),
        is_scanned=True,
        course=lambda t, _: np.clip(t + 0.5, 0.0, 1.0),  # of a sample, the part after the onset
        waveform=lambda n, rate_hz, *_: waveforms.bias(n),
    ),
    "drift": FaultShape(
        signal=lambda elapsed_s, *, slope: (1.0 if slope is None else slope) * elapsed_s,
        formula="slope x (t - onset).",
        **GROWING,
        label="drift",
        says="drifts {way} by {size}",
        tail=lambda *, slope: Tail(rate=1.0 if slope is None else slope),
        keys=(
            Key(
                name="slope",
                rule="nonzero",
                description="Per second; default 1, and the magnitude then has the channel's unit per second.",
            ),
        ),
        is_scanned=True,
        course=lambda t, _: np.maximum(t, 0.0),
        waveform=lambda n, rate_hz, *_: waveforms.drift(n, step_s=1.0 / rate_hz),
        magnitude_unit=lambda channel_unit, *, slope: per_second(channel_unit) if slope is None else "",
        physical=lambda magnitude, channel_unit, *, slope: (
            magnitude * (1.0 if slope is None else slope),
            per_second(channel_unit),
        ),
    ),
    "sine": FaultShape(
        signal=lambda since_s, *, frequency_hz, phase_rad: np.sin(_angle(since_s, frequency_hz, phase_rad)),
        formula="sin(2 pi f (t - t0) + phase).",
        kind="oscillating",
        label="sine",
        says="oscillates by {size}{frequency}",
        tail=lambda *, frequency_hz, phase_rad: _oscillation_tail(phase_rad - 0.5 * np.pi, frequency_hz),
        keys=OSCILLATION_KEYS,
        is_scanned=True,
        waveform=lambda n, rate_hz, frequency_hz, phase_rad: waveforms.sine(
            n, angle=2.0 * np.pi * frequency_hz / rate_hz, phase=phase_rad
        ),
    ),
    "cosine": FaultShape(
        signal=lambda since_s, *, frequency_hz, phase_rad: np.cos(_angle(since_s, frequency_hz, phase_rad)),
        formula="cos(2 pi f (t - t0) + phase).",
        kind="oscillating",
        label="cosine",
        says="oscillates by {size}{frequency}",
        tail=lambda *, frequency_hz, phase_rad: _oscillation_tail(phase_rad, frequency_hz),
        keys=OSCILLATION_KEYS,
        stands_out_as="sine",
    ),
    "square": FaultShape(
        signal=lambda since_s, *, frequency_hz, phase_rad: np.where(
            (_angle(since_s, frequency_hz, phase_rad) / np.pi) % 2.0 < 1.0, 1.0, -1.0
        ),
        formula="The sign of sin(2 pi f (t - t0) + phase), 1 where that is 0.",
        kind="oscillating",
        label="square wave",
        says="jumps to and fro by {size}{frequency}",
        keys=OSCILLATION_KEYS,
    ),
    "lagged_bias": FaultShape(
        signal=_relaxing,
        formula="1 - exp(-(t - onset) / time constant).",
        kind="abrupt",
        label="lagged bias",
        says="reads {size} too {side} after a lag of {seconds}",
        build_up_s=lambda *, time_constant_s: LN_10 * time_constant_s,
        tail=lambda *, time_constant_s: Tail(level=1.0, amplitude=-1.0, exponent=-1.0 / time_constant_s),
        keys=(TIME_CONSTANT,),
        is_scanned=True,
        course=lambda t, seconds: -np.expm1(-np.maximum(t, 0.0) / seconds),
        waveform=lambda n, rate_hz, seconds, _: waveforms.lagged_bias(n, constant=seconds * rate_hz),
        stands_out_as="bias",
        claimed_s=(5.0,),
    ),
    "ramp_hold": FaultShape(
        signal=lambda elapsed_s, *, slope, duration_s: (
            (1.0 / duration_s if slope is None else slope) * np.minimum(elapsed_s, duration_s)
        ),
        formula="slope x min(t - onset, duration).",
        kind="abrupt",
        label="ramp and hold",
        says="reads {size} too {side} after a ramp of {seconds}",
        build_up_s=lambda *, slope, duration_s: 0.9 * duration_s,
        tail=lambda *, slope, duration_s: Tail(from_s=duration_s, level=1.0 if slope is None else slope * duration_s),
        keys=(
            Key(name="slope", rule="nonzero", description="Per second; default 1 / duration, so that it ends at 1."),
            Key(name="duration_s", rule="positive", required=True),
        ),
        is_scanned=True,
        course=lambda t, seconds: np.clip(t / seconds, 0.0, 1.0),
        waveform=lambda n, rate_hz, seconds, _: waveforms.ramp_hold(n, duration=seconds * rate_hz),
        stands_out_as="bias",
        claimed_s=(10.0, 13.0),
        physical=lambda magnitude, channel_unit, *, slope, duration_s: (
            magnitude if slope is None else magnitude * slope * duration_s,
            channel_unit,
        ),
    ),
    "decaying_bias": FaultShape(
        signal=lambda elapsed_s, *, time_constant_s: np.exp(-elapsed_s / time_constant_s),
        formula="exp(-(t - onset) / time constant).",
        kind="abrupt",
        label="decaying bias",
        says="jumps {size} too {side} and returns within about {seconds}",
        tail=lambda *, time_constant_s: Tail(amplitude=1.0, exponent=-1.0 / time_constant_s),
        keys=(TIME_CONSTANT,),
    ),
    "samples": FaultShape(
        signal=_samples,
        formula="The values of a CSV file.",
        **GROWING,  # it may be, and nothing says it is not
        label="sampled shape",
        says="errs by {size} times the stated course",
        tail=_samples_tail,
        keys=(
            Key(
                name="file",
                rule="file",
                required=True,
                description="CSV of time (s after the onset), value; relative to this file.",
            ),
        ),
        is_scanned=True,
    ),
    "free": FaultShape(
        signal=_ones,
        formula="Any smooth course from the onset, which bfi identify estimates.",
        **GROWING,  # of an abrupt one there is nothing smooth to estimate but its step
        label="fault of unknown shape",
        says="errs by up to {size}, its shape unknown,",
        plainly="errs by an unknown course",
        acts_on="course",
        has_magnitude=False,
    ),
    "scale": FaultShape(
        signal=_ones,
        formula="The channel's own reading.",
        **SHARE,  # slow, since it shows as the reading changes
        label="scale error",
        says="reads {size} too {side}",
        acts_on="reading",
    ),
    "frozen": FaultShape(
        signal=_ones,
        formula="The channel keeps its reading at the onset.",
        kind="slow",  # its error grows as the reading should have changed
        build_up_s=lambda **_: None,
        label="frozen sensor",
        plainly="stays still",
        acts_on="held",
        has_magnitude=False,
    ),
    "pitot_blocked": FaultShape(
        signal=_ones,
        formula="p_total keeps its value at the onset (tube and drain blocked).",
        label="blocked pitot tube",
        plainly="pitot tube blocked",
        **PITOT,
        lines=lambda static, total, *, first, cabin, amount: (static, _towards(total, first[1], amount)),
    ),
    "pitot_leak": FaultShape(
        signal=_relaxing,
        formula="p_total goes to p_static as 1 - exp(-(t - onset) / time constant) (tube blocked, drain open).",
        label="leaking pitot line",
        plainly="pitot line leaks",
        keys=(TIME_CONSTANT,),
        **PITOT,
        lines=lambda static, total, *, first, cabin, amount: (static, _towards(total, static, amount)),
        loss=1.0,
    ),
    "pitot_icing": FaultShape(
        signal=lambda elapsed_s: elapsed_s,
        formula="q_impact loses its part magnitude x (t - onset), at most all of it.",
        kind="slow",
        label="icing pitot tube",
        says="pitot tube ices and loses {size} of its impact pressure",
        plainly="pitot tube ices",
        magnitude_unit=lambda channel_unit, **_: "1/s",
        physical=lambda magnitude, channel_unit, **_: (magnitude, "1/s"),
        acts_on="p_total",
        lines=lambda static, total, *, first, cabin, amount: (
            static,
            _towards(total, static, np.minimum(amount, 1.0)),
        ),
        loss=1.0,
    ),
    "pitot_water": FaultShape(
        signal=lambda since_s, *, frequency_hz: np.sin(_angle(since_s, frequency_hz, 0.0)),
        formula="q_impact gains its part magnitude x sin(2 pi f (t - onset)).",
        label="water in the pitot line",
        says="water in the pitot line moves the impact pressure by {size}{frequency}",
        plainly="water in the pitot line",
        keys=(FREQUENCY,),
        stands_out_as="sine",
        **{**PITOT, "kind": "oscillating", "has_magnitude": True},
        lines=lambda static, total, *, first, cabin, amount: (static, _towards(total, static, -amount)),
        loss=-1.0,
    ),
    "static_blocked": FaultShape(
        signal=_ones,
        formula="p_static keeps its value at the onset.",
        label="blocked static port",
        plainly="static port blocked",
        **STATIC,
        lines=lambda static, total, *, first, cabin, amount: (_towards(static, first[0], amount), total),
    ),
    "static_leak": FaultShape(
        signal=lambda elapsed_s, *, time_constant_s, cabin_altitude_m: _relaxing(
            elapsed_s, time_constant_s=time_constant_s
        ),
        formula="p_static goes to the cabin's pressure as 1 - exp(-(t - onset) / time constant).",
        label="leaking static line",
        plainly="static line leaks",
        keys=(
            TIME_CONSTANT,
            Key(
                name="cabin_altitude_m",
                rule="number",
                description="The pressure altitude that the cabin is held at, m; default 0, sea level.",
            ),
        ),
        **STATIC,
        lines=lambda static, total, *, first, cabin, amount: (_towards(static, cabin, amount), total),
        loss=1.0,
    ),
}
# Those whose signal is the same whatever the log shows. A dictionary holds them, and those that depend on the reading
# of a channel, on pressures that the log still tells, or are estimated; a trapped line leaves no trace of the pressure
# that its signal would need, nor a frozen sensor of its reading.
ADDITIVE: tuple[str, ...] = tuple(name for name, shape in SHAPES.items() if shape.acts_on == "channel")
LINE_SHAPES: tuple[str, ...] = tuple(name for name, shape in SHAPES.items() if shape.lines is not None)
IN_DICTIONARY: tuple[str, ...] = tuple(
    name
    for name, shape in SHAPES.items()
    if (shape.lines is None or shape.loss is not None) and shape.acts_on != "held"
)
SCANNED: tuple[str, ...] = tuple(name for name, shape in SHAPES.items() if shape.is_scanned)
SCANNED_AS: Mapping[str, str] = {name: SHAPES[name].stands_out_as for name in SCANNED if SHAPES[name].stands_out_as}
# Those that a dictionary may hold as a kind of fault, without an onset: what the scan over all onsets looks for, and
# faults of a pressure line, which relations between channels show.
SEARCHED: tuple[str, ...] = tuple(
    name for name in IN_DICTIONARY if (SHAPES[name].is_scanned and name != "samples") or name in LINE_SHAPES
)
# A key means the same in every shape that has it; only its description may differ.
KEY_RULES: Mapping[str, Rule] = {key.name: key.rule for shape in SHAPES.values() for key in shape.keys}


def scanned_shape(shape: str) -> str | None:
    """Return the shape by which a scan looks for a fault of this one; None where it has no such shape."""
    return shape if SHAPES[shape].is_scanned else SHAPES[shape].stands_out_as or None


if TYPE_CHECKING:  # a type checker does not run the table; an unknown name is refused where a fault is made
    Shape = str
    ScannedShape = str
else:
    Shape = Literal[tuple(SHAPES)]
    ScannedShape = Literal[SCANNED]
