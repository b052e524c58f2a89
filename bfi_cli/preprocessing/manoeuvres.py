"""Manoeuvres of a flight that no linear model of one trim follows."""

from __future__ import annotations

from collections.abc import Collection

from ..decision import Evidence, Manoeuvre
from ..flightlog import FlightLog
from ..flightlog.phases import RECOVERY_S, airborne_stretches, phases_of
from ..kernels.runs import left_of

NAMES = ("stall", "parabola")


def manoeuvres_of(log: FlightLog, suspects: Collection[str]) -> Evidence:
    """Return the stalls and parabolas of a log.

    Parameters
    ----------
    suspects : channels that may be faulty, which do not say how the aircraft flies where others do.
    """
    found = [one for one in phases_of(log, suspects=suspects) if one.phase in NAMES]
    return Evidence(
        source="phases",
        manoeuvres=tuple(
            Manoeuvre(name=one.phase, from_s=one.from_s, to_s=one.to_s, beside_s=RECOVERY_S) for one in found
        ),
    )


def modelled_stretches(log: FlightLog, suspects: Collection[str]) -> list[tuple[float, float]]:
    """Return (from_s, to_s) of the stretches of flight that a linear model may follow: without stalls and parabolas."""
    disturbed = [one.reach_s for one in manoeuvres_of(log, suspects).manoeuvres]
    return left_of(airborne_stretches(log, suspects=suspects), disturbed)
