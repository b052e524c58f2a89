"""What ordinarily happens at a time of a flight: `CAUSE@S[:SIZE]` of the command line, an object of `/truth`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from ..errors import ConfigError, LogError
from ..quantities.channels import change_in_si
from .fault import did_you_mean, shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Making:
    """How large an ordinary cause is made, and what its size is.

    Attributes
    ----------
    text : what happens, and what `size` means, as `--help` says it.
    size, unit : the default, and its SI unit.
    """

    text: str
    size: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Occurrence:
    """An ordinary cause at a time, s; `size` is None where it is stated and not made."""

    cause: str
    at_s: float
    size: float | None = None


def parse_occurrence(text: str, *, where: str, makings: Mapping[str, Making] | None = None) -> Occurrence:
    """Return the cause of "flaps@4780", or of a table that makes it, "altimeter_set@4780:5hPa" with a size too.

    Parameters
    ----------
    where : the option, for messages.
    makings : by cause how it is made; None where it is stated, and its name is compared with what the log may hold.

    Raises
    ------
    ConfigError : no cause and time, a cause that is not in the table, or a size in another unit.
    """
    cause, _, rest = (part.strip() for part in text.partition("@"))
    at, colon, amount = (part.strip() for part in rest.partition(":"))
    try:
        at_s = float(at)
        if not cause or (colon and makings is None):
            raise ValueError
    except ValueError:
        what = "a cause and its time" if makings is None else "a cause, its time and perhaps its size"
        like = "flaps@4780" if makings is None else f"{next(iter(makings))}@4780"
        raise ConfigError(
            f"{where}: not {what}, got {shown(text)}; write one like {like}, in the log's seconds"
        ) from None
    if makings is None:
        return Occurrence(cause=cause, at_s=at_s)
    if cause not in makings:
        raise ConfigError(f"{where}: cannot be made, got {shown(cause)}{did_you_mean(cause, list(makings))}")
    if not isfinite(at_s):
        raise ConfigError(f"{where} {text}: the time must be finite, got {at_s:g}; give one of the log's seconds")
    making = makings[cause]
    return Occurrence(
        cause=cause, at_s=at_s, size=_size(amount, making, where=f"{where} {text}") if colon else making.size
    )


def _size(text: str, making: Making, *, where: str) -> float:
    """Return a size in SI; one without a unit is in SI."""
    like = f"write one like {making.size:g} {making.unit}".rstrip()
    try:
        size, unit = float(text), making.unit
    except ValueError:
        try:
            size, unit = change_in_si(text)
        except ValueError:
            raise ConfigError(f"{where}: the size is no number, got {shown(text)}; {like}") from None
        except LogError as error:
            raise ConfigError(f"{where}: {str(error).removeprefix('unit: ')}") from None
    if unit != making.unit:
        raise ConfigError(f"{where}: the size is in {making.unit or 'no unit'}, got {shown(text)}; {like}")
    if not isfinite(size) or size == 0.0:
        raise ConfigError(f"{where}: the size must be finite and not 0, got {size:g}; {like}")
    return size
