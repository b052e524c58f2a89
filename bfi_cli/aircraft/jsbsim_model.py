"""The aircraft of JSBSim as models that fly from a trim: `jsbsim:c172p` and any other that trims in level flight."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from typing import Any

import numpy as np

from ..airdata import HIGHEST
from ..errors import ConfigError
from ..jsbsim import CONTROLS, OUTPUTS, run
from ..kernels import FloatArray
from ..kernels.progress import Report, silent
from ..notes import Note
from .model import FlightPlan, Flown, NonlinearModel

PREFIX = "jsbsim:"
ALTITUDE_M = 1500.0  # where light aircraft fly and jets can
# Default amplitude of a manoeuvre as a share of the stick's travel: 0.02 to 0.04 rad of elevator, 0.1 to 0.4 g, as the
# 0.035 rad of the other models.
STICK = 0.08
SHOWN = 5  # close names


def jsbsim_model(name: str, plan: FlightPlan) -> NonlinearModel:
    """Return an aircraft of JSBSim, trimmed as the plan states; its inputs are shares of the sticks' travel.

    Without an airspeed in the plan a suitable one is sought; the default altitude is 1500 m.

    Raises
    ------
    ConfigError : JSBSim is not installed, has no such aircraft, or it does not trim.
    """
    who = f"{PREFIX}{name}"
    known = _names()
    if name not in known:
        close = difflib.get_close_matches(name.lower(), [aircraft.lower() for aircraft in known], n=SHOWN, cutoff=0.5)
        spelt = [next(aircraft for aircraft in known if aircraft.lower() == match) for match in close]
        hint = f"did you mean {' or '.join(map(repr, spelt))}?" if spelt else f"known: {', '.join(known)}"
        raise ConfigError(f"jsbsim: no such aircraft, got '{name}'; {hint}")
    altitude = ALTITUDE_M if plan.altitude_m is None else plan.altitude_m
    if not 0.0 < altitude <= HIGHEST:
        raise ConfigError(
            f"{who}: the altitude must lie above 0 and up to {HIGHEST:g} m, got {altitude:g} m; change it"
        )
    if not np.isfinite([0.0 if plan.tas_m_s is None else plan.tas_m_s, *plan.wind_m_s]).all():
        raise ConfigError(f"{who}: airspeed and wind must be numbers, got {plan.tas_m_s} and {plan.wind_m_s} m/s")
    tas = _airspeed(name, plan.tas_m_s, altitude)
    made = [asdict(occurrence) for occurrence in plan.ordinary]
    start = {
        "do": "fly",
        "name": name,
        "tas_m_s": tas,
        "altitude_m": altitude,
        "tour": plan.tour,
        "ordinary": made,
    }

    def fly(deviations: FloatArray, rate_hz: float, gusts: FloatArray | None, report: Report = silent) -> Flown:
        """Return the flight in gusts and in the plan's wind."""
        still = np.zeros((0, 3)) if gusts is None else gusts
        answer, flown = run(who, {**start, "rate_hz": rate_hz}, {"sticks": deviations, "gusts": still}, report)
        outputs = flown["outputs"].copy()
        # A uniform steady wind adds to the velocity over the ground.
        for channel, blowing in zip(("velocity_north", "velocity_east"), plan.wind_m_s, strict=True):
            outputs[:, OUTPUTS.index(channel)] += blowing
        return Flown(inputs=flown["controls"], outputs=outputs, notes=_notes(deviations, flown, answer["stops"]))

    return NonlinearModel(
        name=who,
        title=f"{name} of JSBSim, from level flight at {tas:g} m/s and {altitude:g} m",
        inputs=CONTROLS,
        outputs=OUTPUTS,
        fly=fly,
        source="JSBSim, an open-source flight dynamics model, and the aircraft that it brings",
        airspeed_m_s=tas,
        travel={"elevator": 1.0, "throttle": 1.0},
        ordinary=plan.ordinary,
    )


def _notes(deviations: FloatArray, flown: Mapping[str, FloatArray], stops: Sequence[str]) -> tuple[Note, ...]:
    notes = [Note.limit(f"{name} is held at its stop") for name in stops]
    if np.ptp(deviations[:, 0]) and not np.ptp(flown["controls"][:, 0]):
        still = "'elevator' stands still: of this aircraft JSBSim states no deflection of it in radians"
        notes.append(Note.limit(still))
    return tuple(notes)


@cache
def _names() -> tuple[str, ...]:
    answer, _ = run("jsbsim", {"do": "names"})
    return tuple(answer["names"])


@cache
def _airspeed(name: str, tas_m_s: float | None, altitude_m: float) -> float:
    """Return the airspeed at which the aircraft trims, m/s."""
    request: dict[str, Any] = {"do": "cruise", "name": name, "tas_m_s": tas_m_s, "altitude_m": altitude_m}
    answer, _ = run(f"{PREFIX}{name}", request)
    return float(answer["tas_m_s"])
