"""The audit of a dictionary by itself: its signals over a window long enough to show them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..config import Config
from ..dictionary import Dictionary, dead_reason, signals
from ..errors import ConfigError, DictionaryError
from ..faults import Fault
from ..preprocessing.sampling_rate import SAMPLES_PER_CYCLE
from ..preprocessing.window import unusable_atoms
from .comparison import advised, compare, own_channel, sentences
from .definition import Span, fastest_hz, span_of, unit_of, unknown_channels
from .entries import Listing, entries, largest_order, reasons_of, remarks_of
from .result import Audit

__all__ = ["audit"]

FloatArray = NDArray[np.float64]

SAMPLES = 2000
FINE_HZ = 100.0
FINE_VALUES = 2_000_000
DRAWN_PER_CYCLE = 8.0
MOST_ATOMS = 1000
MOST_VALUES = 20_000_000


def audit(dictionary: Dictionary, config: Config, *, duration_s: float | None = None) -> Audit:
    """Audit a dictionary by its definitions and the signals they give.

    Parameters
    ----------
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : its window, its orders and, where that is a number, its rate are used.
    duration_s : length of the window; None for one that shows every fault.

    Raises
    ------
    DictionaryError : no fault shows in the window, or a sample file cannot be used.
    ConfigError : the window is empty, or its end is given twice.
    """
    span, why = _span(dictionary, config, duration_s)
    faults = dictionary.resolved(span.start_s)
    fastest = fastest_hz(faults)
    rate_hz = span.rate_hz or _fine_rate_hz(span.stop_s - span.start_s, len(faults), fastest or 0.0)
    n_samples = max(2, round((span.stop_s - span.start_s) * rate_hz))
    few = len(faults) <= MOST_ATOMS and n_samples * len(faults) <= MOST_VALUES
    time_s = span.start_s + np.arange(n_samples if few else 0) / rate_hz
    channels = list(dict.fromkeys(fault.channel for fault in faults))
    theta = signals(faults, time_s, channels, window_start_s=span.start_s) if few else None
    listing = _listing(dictionary, faults, span, theta=theta, largest_model=largest_order(config))
    signatures = None
    warnings = [
        f"{len(faults)} faults over this window are too many signals to compare; "
        "give a shorter --duration, a lower --rate, or larger steps in the grids"
    ]
    if theta is not None:
        theta = theta[:, :, list(listing.live)]
        names = [listing.names[j] for j in listing.live]
        signatures, alike = compare(names, time_s, own_channel(theta), theta.reshape(-1, len(names)))
        warnings = sentences(signatures, alike)
    return Audit(
        path=dictionary.path,
        relative_to=dictionary.relative_to,
        start_s=span.start_s,
        stop_s=span.stop_s,
        rate_hz=float(rate_hz),
        n_samples=n_samples,
        why=why,
        log_path=None,
        native_rate_hz=None,
        model=None,
        fastest_hz=fastest,
        rate_needed_hz=None if fastest is None else SAMPLES_PER_CYCLE * fastest,
        atoms=entries(listing, signatures, None),
        signatures=signatures,
        notes=(*unknown_channels(faults), *warnings),
    )


def _span(dictionary: Dictionary, config: Config, duration_s: float | None) -> tuple[Span, str]:
    """Return the window and how it came about; `rate_hz` only where it is asked for."""
    from_s, to_s, asked = config.window.from_s, config.window.to_s, config.conditioning.rate_hz
    if duration_s is not None and to_s is not None:
        raise ConfigError(f"--duration: the window ends at {to_s:g} s already; keep --duration or --to")
    if duration_s is not None and not 0.0 < duration_s < np.inf:
        raise ConfigError(f"--duration: must be more than 0 s, got {duration_s:g}; give the length of a window")
    shown = span_of(dictionary.resolved(from_s or 0.0), from_s, from_zero=dictionary.relative_to == "window")
    stop_s, why = shown.stop_s, "until every fault has shown its shape; another length is --duration S"
    if duration_s is not None:
        stop_s, why = shown.start_s + duration_s, "as asked for"
    elif to_s is not None:
        stop_s, why = to_s, "as asked for"
    if stop_s <= shown.start_s:
        raise ConfigError(
            f"--to: the window starts at {shown.start_s:g} s, got {stop_s:g}; give a later --to, or --from"
        )
    return Span(start_s=shown.start_s, stop_s=stop_s, rate_hz=None if isinstance(asked, str) else float(asked)), why


def _fine_rate_hz(duration_s: float, n_atoms: int, fastest_hz: float) -> float:
    """Return a rate that draws every shape, and that of a common recorder where that is not too much work."""
    affordable = min(FINE_HZ, FINE_VALUES / (duration_s * n_atoms))
    return max(SAMPLES / duration_s, DRAWN_PER_CYCLE * fastest_hz, affordable)


def _listing(
    dictionary: Dictionary, faults: tuple[Fault, ...], span: Span, *, theta: FloatArray | None, largest_model: int
) -> Listing:
    names = tuple(fault.name or fault.shape for fault in faults)
    dead = ((j, dead_reason(fault, span.start_s, span.stop_s)) for j, fault in enumerate(faults))
    reasons = {j: reason for j, reason in dead if reason is not None}
    values = None
    if theta is not None:
        values = own_channel(theta)
        rest = [j for j in range(len(faults)) if j not in reasons]
        reasons |= advised(unusable_atoms(theta, names, rest), values)
    reasons = reasons_of(faults, names, reasons)
    live = {j: fault for j, fault in enumerate(faults) if j not in reasons}
    if not live:
        raise DictionaryError(f"{dictionary.path}: no live atom: {reasons[min(reasons)]}")
    n_outputs = len({fault.channel for fault in faults})
    seen = None if values is None else values[:, list(live)]
    remarks = remarks_of(live, span, seen, largest_model=largest_model, n_outputs=n_outputs)
    units = tuple(unit_of(fault.channel) for fault in faults)
    return Listing(faults=faults, names=names, units=units, reasons=reasons, remarks=remarks)
