"""A flight of JSBSim in a separate process, `python -m bfi_cli.jsbsim.flight FOLDER`.

JSBSim writes to stdout, some of its aircraft write files into the working folder, and an aircraft that it cannot read
may end the process. The caller is not affected: it starts this module in a folder that is deleted afterwards. FOLDER
holds `request.json` and, for a flight, `request.npz`; `answer.json` and `answer.npz` are added, and during the flight a
file with the part that is done.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import first_line
from ..kernels import FloatArray
from ..kernels.progress import Report, silent
from ..quantities.channels import FOOT
from .channels import CONTROLS, FLOWN, RECORDED
from .ordinary import FLAPS, SIMULATED
from .pilot import Pilot

# True airspeeds, m/s, from a light aircraft's to a jet's, at which level flight is tried if none is stated.
SPEEDS = (20.0, 30.0, 45.0, 65.0, 90.0, 120.0, 160.0, 200.0, 240.0)
# Wanted angle of attack, rad, in the choice among the speeds at which an aircraft trims: neither slow flight near the
# stall nor a dive at full throttle.
CRUISE_AOA = 0.04
HEADING = 45.0  # degrees; one of 0 would be recorded as 0 and 360 alternately
FULL_THROTTLE = 0.97  # above it a trim has no thrust left to fly a manoeuvre with
# JSBSim's kind of trim (1 with wings and pedals, 0 lengthwise only) and the lever of a propeller's pitch: some aircraft
# have thrust with the one setting of it, some with the other.
ATTEMPTS = ((1, 0.0), (1, 1.0), (0, 0.0))
# The stops of the controls, in parts of their travel, and what of a position is round-off.
LEAST, MOST, ROUND_OFF = np.array([-1.0, -1.0, -1.0, 0.0]), np.ones(4), 1e-9
LEAD_IN_S = 1.0  # flown before the log begins, in calm air, in which fuel flow and forces settle after the trim
INTEGRATION_HZ = 120.0  # at least; JSBSim's own default
# Limits of normal flight, rad: beyond them the aircraft spins or tumbles, outside the tables of most aircraft.
LARGEST_AOA = 0.6
LARGEST_ROLL = 1.4  # 80 degrees
RETRACTABLE = re.compile(r"<\s*retractable\s*>\s*1|retractable\?:\s*yes|RETRACT")


class FlightError(Exception):
    """An error for the user; the caller adds the name of the aircraft."""


def trimmed(name: str, *, tas_m_s: float, altitude_m: float, rate_hz: float) -> Any:
    """Return JSBSim with the aircraft in steady level flight to the northeast, its gear up; None if it does not trim.

    Parameters
    ----------
    tas_m_s, altitude_m : true airspeed, and altitude above the sea.
    rate_hz : of the integration.

    Raises
    ------
    FlightError : the aircraft cannot be read.
    """
    import jsbsim

    quiet: Any = jsbsim.FGJSBBase
    quiet().debug_lvl = 0
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    try:
        readable = fdm.load_model(name)
    except (jsbsim.BaseError, RuntimeError, KeyError) as error:
        raise FlightError(f"JSBSim cannot read this aircraft, {first_line(error)}; give another") from None
    engines = fdm.get_propulsion().get_num_engines() if readable else 0
    if engines == 0:
        raise FlightError("has no engine to fly level with; give another")
    fdm.disable_output()
    fdm.set_dt(1.0 / rate_hz)
    text = (Path(jsbsim.get_default_root_dir()) / "aircraft" / name / f"{name}.xml").read_text("utf-8", "replace")
    if RETRACTABLE.search(text):
        fdm["gear/gear-cmd-norm"] = fdm["gear/gear-pos-norm"] = 0.0
    fdm["ic/h-sl-ft"] = altitude_m / FOOT
    fdm["ic/psi-true-deg"] = HEADING
    fdm["ic/vt-fps"] = tas_m_s / FOOT
    fdm["ic/gamma-deg"] = 0.0
    for kind, fine_pitch in ATTEMPTS:
        try:
            fdm.run_ic()
        except (jsbsim.BaseError, RuntimeError) as error:
            raise FlightError(f"JSBSim cannot fly this aircraft, {first_line(error)}; give another") from None
        for k in range(engines):
            fdm[f"fcs/advance-cmd-norm[{k}]"] = fine_pitch
        fdm["propulsion/set-running"] = -1.0
        # A failed trim leaves the controls anywhere; the next attempt starts from the initial conditions.
        with suppress(jsbsim.BaseError, RuntimeError):
            fdm.do_trim(kind)
            return fdm
    return None


def cruise_airspeed(name: str, *, tas_m_s: float | None, altitude_m: float) -> float:
    """Return the airspeed, m/s, at which the aircraft is trimmed: `tas_m_s`, or a suitable one for None.

    Raises
    ------
    FlightError : the aircraft does not trim.
    """
    best, least_off = None, math.inf
    for speed in SPEEDS if tas_m_s is None else (tas_m_s,):
        fdm = trimmed(name, tas_m_s=speed, altitude_m=altitude_m, rate_hz=INTEGRATION_HZ)
        if fdm is None or (tas_m_s is None and fdm["fcs/throttle-cmd-norm"] > FULL_THROTTLE):
            continue
        off = abs(fdm["aero/alpha-rad"] - CRUISE_AOA)
        if off < least_off:
            best, least_off = speed, off
    if best is not None:
        return best
    if tas_m_s is not None:
        raise FlightError(
            f"does not trim in level flight at {tas_m_s:g} m/s and {altitude_m:g} m; change --tas or leave it out"
        )
    tried = f"{SPEEDS[0]:g} to {SPEEDS[-1]:g} m/s"
    raise FlightError(
        f"does not trim in level flight at {altitude_m:g} m at any of {tried}; give --tas, or change --altitude"
    )


def fly(
    name: str,
    request: Mapping[str, Any],
    sticks: FloatArray,
    gusts: FloatArray,
    report: Report = silent,
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return the positions of the controls, (n, 4), the recorded outputs, (n, n_y), and the controls that hit a stop.

    Outputs are in the order of `channels`.

    Parameters
    ----------
    request : tas_m_s, altitude_m, rate_hz, tour (whether the pilot flies climbs and turns), ordinary (a list of cause,
        at_s and size).
    sticks : (n, 4) added to the trimmed positions of `CONTROLS`, in parts of their travel, held between samples.
    gusts : (n, 3) headwind, gust from the right and upward, m/s, interpolated between samples; (0, 3) for calm air.
    report : called at every sample with the part of the flight that is done.

    Raises
    ------
    FlightError : the aircraft does not trim, or leaves normal flight.
    """
    rate = float(request["rate_hz"])
    steps = max(1, math.ceil(INTEGRATION_HZ / rate))
    tas, altitude = float(request["tas_m_s"]), float(request["altitude_m"])
    fdm = trimmed(name, tas_m_s=tas, altitude_m=altitude, rate_hz=rate * steps)
    if fdm is None:
        raise FlightError(f"does not trim in level flight at {tas:g} m/s and {altitude:g} m; change --tas")
    throttles = range(fdm.get_propulsion().get_num_engines())
    start = np.array([fdm[command] for command in CONTROLS.values()])
    pilot = Pilot(
        tas_m_s=tas, pitch_rad=fdm["attitude/theta-rad"], step_s=1.0 / (rate * steps), tour=bool(request["tour"])
    )
    causes = [(SIMULATED[made["cause"]].act, float(made["at_s"]), float(made["size"])) for made in request["ordinary"]]
    n = len(sticks)
    controls, outputs = np.empty((n, len(CONTROLS))), np.empty((n, len(RECORDED)))
    beyond = np.zeros(len(CONTROLS), dtype=bool)
    for _ in range(round(LEAD_IN_S * rate) * steps):
        _move(fdm, start + pilot.sticks(0.0, fdm), throttles)
        fdm.run()
    for k in range(n):
        report(k / n)
        controls[k], outputs[k] = _read(fdm, throttles)
        aoa, roll = fdm["aero/alpha-rad"], fdm["attitude/phi-rad"]
        flown = pilot.has_landed or abs(aoa) <= LARGEST_AOA  # a wing that stands has no angle of attack
        if not (flown and abs(roll) <= LARGEST_ROLL and np.isfinite(outputs[k]).all()):
            raise FlightError(
                f"leaves normal flight at {k / rate:.3g} s, angle of attack {math.degrees(aoa):.3g} and roll "
                f"{math.degrees(roll):.3g} degrees; give a smaller --amplitude or --turbulence, or another --tas"
            )
        for i in range(steps if k < n - 1 else 0):
            if len(gusts):
                _blow(fdm, gusts[k] + (gusts[k + 1] - gusts[k]) * i / steps)
            time_s = k / rate + i / (rate * steps)
            if causes:
                wind = sum(act(fdm, pilot, time_s - at_s, size) for act, at_s, size in causes if time_s >= at_s)
                fdm["atmosphere/wind-north-fps"] = wind / FOOT
            wanted = start + sticks[k] + pilot.sticks(time_s, fdm)
            beyond |= (wanted < LEAST - ROUND_OFF) | (wanted > MOST + ROUND_OFF)
            _move(fdm, wanted, throttles)
            fdm.run()
    if fdm[FLAPS] and not fdm["fcs/flap-pos-norm"]:
        raise FlightError("has no flaps that move; leave out --ordinary flaps")
    return controls, outputs, tuple(name for name, held in zip(CONTROLS, beyond, strict=True) if held)


def _move(fdm: Any, sticks: FloatArray, engines: range) -> None:
    """Move the controls to the wanted positions, within their stops."""
    positions = np.clip(sticks, LEAST, MOST)
    for position, command in zip(positions[:3], CONTROLS.values(), strict=False):
        fdm[command] = float(position)
    for engine in engines:
        fdm[f"{CONTROLS['throttle']}[{engine}]"] = float(positions[3])


def _blow(fdm: Any, gust: FloatArray) -> None:
    """Set a gust (headwind, from the right, upward) in the axes of the earth, by the aircraft's heading."""
    along, across, heading = -float(gust[0]) / FOOT, -float(gust[1]) / FOOT, fdm["attitude/psi-rad"]
    fdm["atmosphere/gust-north-fps"] = along * math.cos(heading) - across * math.sin(heading)
    fdm["atmosphere/gust-east-fps"] = along * math.sin(heading) + across * math.cos(heading)
    fdm["atmosphere/gust-down-fps"] = -float(gust[2]) / FOOT


def _read(fdm: Any, engines: range) -> tuple[FloatArray, FloatArray]:
    # The right aileron, positive trailing edge down, or minus the left one if only that has a property.
    aileron = fdm["fcs/right-aileron-pos-rad"] or -fdm["fcs/left-aileron-pos-rad"]
    surfaces = [fdm["fcs/elevator-pos-rad"], aileron, fdm["fcs/rudder-pos-rad"], fdm["fcs/throttle-pos-norm"]]
    values = []
    for channel in RECORDED:
        if channel.per_engine:
            value = sum(fdm[f"propulsion/engine[{k}]/{channel.property}"] for k in engines)
        else:
            value = fdm[channel.property]
        if channel.per_mass:
            value /= fdm["inertia/mass-slugs"]
        values.append(value * channel.scale + channel.offset)
    return np.array(surfaces), np.array(values)


def _written_to(file: Path) -> Report:
    """Return a function that writes the part that is done to a file, at every percent."""
    percent = 0

    def write(done: float) -> None:
        nonlocal percent
        if int(100.0 * done) > percent:
            percent = int(100.0 * done)
            file.write_text(f"{done:.4f}", encoding="ascii")

    return write


def main(folder: Path) -> None:
    """Answer the request in `folder`."""
    request = json.loads((folder / "request.json").read_text(encoding="utf-8"))
    answer: dict[str, Any]
    try:
        if request["do"] == "names":
            import jsbsim

            known = (Path(jsbsim.get_default_root_dir()) / "aircraft").iterdir()
            answer = {
                "names": sorted(aircraft.name for aircraft in known if (aircraft / f"{aircraft.name}.xml").is_file())
            }
        elif request["do"] == "cruise":
            wanted = {"tas_m_s": request["tas_m_s"], "altitude_m": request["altitude_m"]}
            answer = {"tas_m_s": cruise_airspeed(request["name"], **wanted)}
        else:
            with np.load(folder / "request.npz") as arrays:
                report = _written_to(folder / FLOWN)
                controls, outputs, stops = fly(request["name"], request, arrays["sticks"], arrays["gusts"], report)
            np.savez(folder / "answer.npz", controls=controls, outputs=outputs)
            answer = {"stops": stops}
    except FlightError as error:
        answer = {"error": str(error)}
    (folder / "answer.json").write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
