"""The low-pass filters that a log went through, recorder first: what they make of a fault.

A fault that hit the aircraft before the recorder went through all of them, as the recorded motion did. A sharp signal
beside a filtered one is another fault: it is found less often, and its magnitude is wrong (docs/theory.md, 7.4).
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..kernels.low_pass import IDENTITY, Kind, Response, decimated, low_pass
from .fault import Fault, unit_signals

FloatArray = NDArray[np.float64]

# Edges that the spectra of one recorded flight give to each kind, relative to a Gaussian's (1.57 and 1.49 Hz to 0.89).
EQUIVALENT: dict[Kind, float] = {"gaussian": 1.0, "fir": 1.77, "butterworth": 1.67, "causal": 1.35, "sinc": 1.77}
# Shares of these edges that are tried: spectra of steepening motion give too low an edge, of noisy channels too high.
LIKELY: dict[Kind, tuple[float, ...]] = {"gaussian": (0.7, 0.85, 1.0, 1.2), "fir": (0.65, 0.8, 1.0, 1.2)}
# Standard deviation of a magnitude, as a share of it, by what lies between the responses that are tried for a recorder
# that is uncertain. With it 88 to 99 % of intervals held on recorded flights whose faults went through other recorders.
BETWEEN_RECORDERS = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """A low-pass filter that every channel of a log went through.

    Attributes
    ----------
    kind : of its shape, see `bfi_cli.kernels.low_pass`.
    edge_hz : frequency of gain one half.
    rate_hz : of the samples it was applied to.
    stage : the recorder, or a conversion of the file.
    source : how it is known, as words for the reader.
    uncertain : whether kind and edge are a guess, as from spectra.
    """

    kind: Kind
    edge_hz: float
    rate_hz: float
    stage: Literal["recorder", "convert"] = "recorder"
    source: str = "stated in the file"
    uncertain: bool = False


def filters_to_json(filters: Sequence[Filter]) -> str:
    """Return the JSON list of `{kind, edge_hz, rate_hz, stage, source, uncertain}`."""
    return json.dumps([asdict(low_pass) for low_pass in filters])


def filters_from_json(text: str, *, where: str) -> tuple[Filter, ...]:
    """Read the JSON list of `{kind, edge_hz, rate_hz}`; `stage` is the recorder where it is not given.

    Raises
    ------
    LogError : it is not such a list.
    """
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError):
        entries = None
    if not isinstance(entries, list):
        raise LogError(f"{where}: not a JSON list of filters; mend the file")
    filters = []
    for entry in entries:
        given = entry if isinstance(entry, dict) else {}
        kind, source = cast("Kind", given.get("kind")), given.get("source")
        sizes = (given.get("edge_hz", math.nan), given.get("rate_hz", math.nan))
        if kind not in get_args(Kind) or not all(
            type(size) in (int, float) and 0.0 < size < math.inf for size in sizes
        ):
            raise LogError(
                f"{where}: a filter needs a kind ({', '.join(get_args(Kind))}) and positive numbers edge_hz and "
                f"rate_hz, got {str(entry)[:80]}; mend the file"
            )
        filters.append(
            Filter(
                kind=kind,
                edge_hz=given["edge_hz"],
                rate_hz=given["rate_hz"],
                stage="convert" if given.get("stage") == "convert" else "recorder",
                source=source if isinstance(source, str) else "stated in the file",
                uncertain=given.get("uncertain") is True,
            )
        )
    return tuple(filters)


def recorder_low_passes(filters: Sequence[Filter]) -> list[Filter]:
    """Return the filters of the recorder, without those of conversions."""
    return [low_pass for low_pass in filters if low_pass.stage == "recorder"]


def response_of(filters: Sequence[Filter], rate_hz: float) -> Response:
    """Return what the filters make of a signal on the samples of a log of this rate."""
    response = IDENTITY
    for applied in filters:
        factor = max(1, round(applied.rate_hz / rate_hz))
        response = response.then(decimated(low_pass(applied.kind, applied.edge_hz, rate_hz * factor), factor))
    return response


def alternatives(filters: Sequence[Filter]) -> list[tuple[Filter, ...]]:
    """Return the chains with other low-passes in place of one that is uncertain; empty where every one is known.

    The others are Gaussian and windowed sinc filters, as steep as recorders are, around the edges that the same spectra
    give them.
    """
    return [
        (
            *filters[:i],
            replace(guess, kind=kind, edge_hz=share * EQUIVALENT[kind] * (guess.edge_hz / EQUIVALENT[guess.kind])),
            *filters[i + 1 :],
        )
        for i, guess in enumerate(filters)
        if guess.uncertain
        for kind, shares in LIKELY.items()
        for share in shares
    ]


def recorded_signal(
    fault: Fault, time_s: FloatArray, response: Response = IDENTITY, *, window_start_s: float
) -> FloatArray:
    """Return (n_samples,) the signal of a fault at magnitude 1 as the log shows it, see `recorded_signals`."""
    return recorded_signals([fault], time_s, response, window_start_s=window_start_s)[:, 0]


def recorded_signals(
    faults: Sequence[Fault], time_s: FloatArray, response: Response = IDENTITY, *, window_start_s: float
) -> FloatArray:
    """Return (n_samples, n_faults) the signals of faults at magnitude 1 as a log shows them; see `faults.unit_signal`.

    Parameters
    ----------
    time_s : (n_samples,) seconds, at equal steps where the log went through filters.
    response : of the filters, see `response_of`.
    """
    filtered = not response.changes_nothing and len(time_s) >= 2
    if filtered:
        step = float(np.median(np.diff(time_s)))
        before, after = step * np.arange(response.after, 0, -1), step * np.arange(1, response.before + 1)
        time_s = np.concatenate([time_s[0] - before, time_s, time_s[-1] + after])
    made = unit_signals(faults, time_s, window_start_s=window_start_s)
    return response.filtered(made.T) if filtered else made.T
