"""The columns of a file as read, under their own names and units, and the checks that all formats share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..faults import Fault
from ..filters import Filter
from .record import Segment

# Bytes of a log's channels as float64. It is held twice while it is put together: what a computer of 8 GB has.
LARGEST = 4 * 10**9
# Channels of a file. The largest recorders have about 4000 parameters.
MOST_CHANNELS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawColumn:
    """One column of a file: (n_samples,) values in the file's own unit, None where it states none.

    Attributes
    ----------
    channel : the standard name that the format gives it, None where its own name tells.
    rate_hz : of the signal where the file has it at a rate of its own, None otherwise.
    read : of a column that is left in its file, whose `values` are empty: the values of rows; rows : those that it has.
    """

    source: str
    values: NDArray[np.float64]
    unit: str | None = None
    channel: str | None = None
    rate_hz: float | None = None
    read: Callable[[slice], NDArray[np.float64]] | None = None
    rows: slice | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawLog:
    """One file as read, from `first_sample` on.

    Attributes
    ----------
    faults : None where it carries no truth; `clean` is by channel.
    boots : the parts of a file whose clock starts again, of a format that tells them itself.
    """

    columns: Sequence[RawColumn]
    sample_rate_hz: float | None = None
    first_sample: int = 0
    segments: tuple[Segment, ...] = ()
    filters: tuple[Filter, ...] | None = None
    faults: tuple[Fault, ...] | None = None
    clean: Mapping[str, RawColumn] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    boots: tuple[RawLog, ...] = ()


# The wanted window, None for an end of the log; and the function that finds the time axis among columns without values.
Span = tuple[float | None, float | None]
TimeOf = Callable[[Sequence[RawColumn]], RawColumn | None]


def is_signal(shape: Sequence[int]) -> bool:
    """Say whether an array of this shape is one signal: a vector, a row or a column of more than one sample."""
    return len(shape) >= 1 and max(shape) > 1 and sum(n > 1 for n in shape) == 1


def unfit_kind(kind: str, shape: tuple[int, ...]) -> str:
    """Return why an array of this numpy kind and shape is no signal."""
    if kind in "SU":
        return "holds text"
    if 0 in shape:
        return "is empty"
    if kind == "c":
        return "holds complex numbers"
    if kind not in "fiub":
        return "holds no numbers"
    if max(shape, default=1) == 1:
        return "is a single number"
    return f"is a table of {' x '.join(map(str, shape))} ({len(shape)}-D)"


def left_out(name: str, why: str) -> str:
    """Return the note on an array that is no channel; `why` is "holds text", "is a table of 600 x 3 (2-D)"."""
    advice = "; give each column a dataset of its own" if why.startswith("is a table") else ""
    return f"'{name}' {why} and is left out{advice}"


def different_length(path: str, name: str, n: int, n_times: int) -> LogError:
    """Return the error of a channel that does not fit the time axis."""
    return LogError(f"{path}: '{name}' has {n} samples, the time axis {n_times}; give all one time axis")


def require_few(path: str, count: int, what: str) -> None:
    """Check that a file has no more channels, or columns or variables, than a recorder writes; `what` names them.

    Raises
    ------
    LogError : it has.
    """
    if count > MOST_CHANNELS:
        raise LogError(f"{path}: {count} {what}, the limit is {MOST_CHANNELS}; export fewer channels")


def rate_of(path: str, stated: object) -> float:
    """Return the sample_rate_hz that a file states.

    Raises
    ------
    LogError : it is no number.
    """
    if not isinstance(stated, int | float | np.integer | np.floating):
        raise LogError(f"{path}: sample_rate_hz is no number, got {str(stated)[:40]!r}; mend it")
    return float(stated)


def choose_group(path: str, wanted: str | None, groups: Sequence[str], *, has_signals: bool) -> str | None:
    """Return the group (or struct) to read: the wanted one, None for the root, or the only one there is.

    Raises
    ------
    LogError : the wanted one does not exist, or there are several and none is wanted.
    """
    listed = ", ".join(groups) or "none"
    if wanted is not None:
        if wanted.strip("/") not in groups:
            raise LogError(f"{path}: no group '{wanted}'; the file has: {listed}; give one of them with --group")
        return wanted.strip("/")
    if has_signals:
        return None
    if len(groups) > 1:
        raise LogError(f"{path}: several groups: {listed}; give one of them with --group")
    if not groups:
        raise LogError(f"{path}: no signals, got no array of more than one number; give a log with a channel each")
    return groups[0]
