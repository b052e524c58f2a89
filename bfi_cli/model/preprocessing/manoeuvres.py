"""Manoeuvres of a flight that no linear model of one trim follows."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ...decision import Evidence, Manoeuvre
from ...flightlog import FlightLog
from ...flightlog.phases import RECOVERY_S, Phase, airborne_phases, phases_of
from ...kernels.runs import left_of

NAMES = ("stall", "parabola")


def manoeuvres_of(log: FlightLog, suspects: Collection[str]) -> Evidence:
    """Return the stalls and parabolas of a log.

    Parameters
    ----------
    suspects : channels that may be faulty, which do not say how the aircraft flies where others do.
    """
    return Evidence(source="phases", manoeuvres=_manoeuvres(phases_of(log, suspects=suspects)))


def modelled_stretches(log: FlightLog, suspects: Collection[str]) -> list[tuple[float, float]]:
    """Return (from_s, to_s) of the stretches of flight that a linear model may follow: without stalls and parabolas."""
    phases = phases_of(log, suspects=suspects)
    return left_of(airborne_phases(phases), [manoeuvre.reach_s for manoeuvre in _manoeuvres(phases)])


def _manoeuvres(phases: Sequence[Phase]) -> tuple[Manoeuvre, ...]:
    return tuple(
        Manoeuvre(name=phase.phase, from_s=phase.from_s, to_s=phase.to_s, beside_s=RECOVERY_S)
        for phase in phases
        if phase.phase in NAMES
    )
