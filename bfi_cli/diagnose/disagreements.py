"""Airspeeds that say "ground" in flight, or "flight" on the ground, against the other signs of the log."""

from __future__ import annotations

from collections.abc import Sequence

from ..channels import STANDARD
from ..flightlog.phases import Disagreement
from ..parity import Finding
from .events import Draft
from .flight import Flight
from .naming import channels_of

# Seconds to both sides of the onset: the smoothing of the airspeeds.
ONSET_S = 5.0
# Seconds beside the stretch that are shown.
AROUND_S = 60.0


def drafts_of_disagreements(flight: Flight, held: Sequence[Draft]) -> list[Draft]:
    """Return the airspeeds that are overruled as faults: one alone by itself, all together as one of their line.

    Parameters
    ----------
    held : what the pressure lines show; where that names the line too it is the better description.
    """
    together: dict[tuple[float, float], list[Disagreement]] = {}
    found = []
    for one in flight.disagreements:
        if one.to_s <= flight.from_s or one.from_s >= flight.to_s:
            continue
        if one.alone:
            found.append(_draft(flight, one, (one.channel,), (one.channel,)))
        else:
            together.setdefault((one.from_s, one.to_s), []).append(one)
    for (from_s, to_s), those in together.items():
        if not any(draft.from_s < to_s and draft.until_s > from_s for draft in held):
            alone = () if len(those) > 1 or "p_total" in flight.recorded else (those[0].channel,)
            among = (*alone, "pitot_leak", "pitot_blocked")
            found.append(_draft(flight, those[0], among, channels_of("q_impact", flight.recorded)))
    return found


def _draft(flight: Flight, one: Disagreement, among: tuple[str, ...], channels: tuple[str, ...]) -> Draft:
    """Return one stretch as a fault, without an end: an airspeed that may be that of a flight again may still err."""
    finding = Finding(
        fault=among[0],
        among=among,
        channels=channels,
        stage="sensors",
        shape="bias" if among[0] in STANDARD else among[0],
        unit=STANDARD[one.channel].unit if among[0] in STANDARD else "",
        onset_s=one.from_s,
        # What falls slowly has begun before it says "ground".
        onset_ci95=(one.from_s - one.least_s - ONSET_S, one.latest_s + ONSET_S),
        statistic=one.to_s - one.from_s,
        threshold=one.least_s,
        doubt="" if one.certain else "no more signs of the log tell of flight than of the ground",
        effect={} if one.error is None else {one.channel: abs(one.error)},
    )
    window = (max(flight.from_s, one.from_s - AROUND_S), min(flight.to_s, one.to_s + AROUND_S))
    return Draft(finding=finding, window=window, until_s=min(flight.to_s, one.to_s))
