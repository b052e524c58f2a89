"""Values that no aircraft shows, which mostly have another unit than the log says: asked about, not refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..channels import STANDARD
from .record import Channel, FlightLog

__all__ = ["doubt_about", "doubts_about"]

SURFACES = ("elevator", "aileron", "rudder", "stabiliser", "elevator_trim", "flaps")
# What nothing but a rocket exceeds, in the unit of `channels.STANDARD`, and the unit that the values may rather have.
# Surfaces stop at half a radian, fully extended flaps at 0.8 rad; the fastest jets reach 700 m/s, those with the
# recorders that are read here no 400; no wing flies at 1 rad, and a pitch attitude ends at pi / 2 by definition.
LIMITS = {
    **dict.fromkeys(SURFACES, (1.0, "deg")),
    **dict.fromkeys(("tas", "cas", "ias", "ground_speed"), (400.0, "km/h or kt")),
    **dict.fromkeys(("aoa", "sideslip", "flight_path_angle"), (1.0, "deg")),
    **dict.fromkeys(("pitch", "latitude"), (1.6, "deg")),
    **dict.fromkeys(("roll", "yaw", "longitude"), (6.3, "deg")),
    **dict.fromkeys(("pitch_rate", "roll_rate", "yaw_rate"), (10.0, "deg/s")),
    **dict.fromkeys(("tat", "sat"), (400.0, "degF")),
    "p_static": (110_000.0, "another unit"),
    "altitude": (30_000.0, "ft"),
}
# Temperatures of the air below it are none in kelvin.
COLDEST_K = 150.0
# Of the samples: single spikes are no unit.
USUAL = 0.99


def doubts_about(log: FlightLog, names: Sequence[str]) -> tuple[str, ...]:
    """Return a question for each of the channels whose values cannot be, or whose unit nobody has stated.

    Parameters
    ----------
    names : standard names, or names in the file; those that the log lacks are passed over.
    """
    here = [log.channel(name) for name in dict.fromkeys(names) if _has(log, name)]
    questions = [question for channel in here if (question := doubt_about(channel)) is not None]
    bare = [c.name for c in here if c.source_unit is None and c.name in STANDARD and STANDARD[c.name].unit != "1"]
    if bare:
        assumed = ", ".join(f"{name} ({STANDARD[name].unit})" for name in bare)
        questions.append(f"the log states no unit for {assumed}: is the one in brackets right? --unit NAME=UNIT")
    return tuple(questions)


def _has(log: FlightLog, name: str) -> bool:
    return name in log.channels or any(channel.source == name for channel in log.channels.values())


def doubt_about(channel: Channel) -> str | None:
    """Return a question about a channel whose usual values no aircraft shows, None where they can be."""
    name = channel.name
    if name not in LIMITS or channel.unit not in (STANDARD[name].unit, ""):
        return None
    values = channel.values
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    limit, rather = LIMITS[name]
    reached = float(np.quantile(np.abs(finite), USUAL, overwrite_input=True))
    unit, ask = STANDARD[name].unit, f"--unit {channel.source}=UNIT states another"
    if reached > limit:
        return f"'{name}' reaches {reached:.3g} {unit}, which no aircraft does: is it in {rather}? {ask}"
    if unit == "K" and reached < COLDEST_K:
        return f"'{name}' stays below {reached:.3g} K, which no air does: is it in degC? {ask}"
    return None
