"""Flights of aircraft of JSBSim that no constant was chosen on: `python stranger_flights.py NAME SEED FILE`.

Each flight is drawn from its seed: a take-off where the aircraft can, then climbs, turns, changes of speed, flaps, an
approach and a landing, in wind that changes with height, gusts and air that is not the standard one. What is written is
the truth at 25 Hz in SI; what a recorder makes of it is `stranger_trials`'. JSBSim may end its process, so that each
flight has one of its own.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bfi_cli.aircraft import Dryden
from bfi_cli.aircraft.simulate import dryden_gusts
from bfi_cli.jsbsim.channels import CONTROLS, RECORDED
from bfi_cli.jsbsim.flight import FlightError, cruise_airspeed, trimmed
from bfi_cli.jsbsim.ordinary import FLAPS
from bfi_cli.jsbsim.pilot import (
    FLARE_M,
    PITCH_DAMPING,
    PITCH_GAIN,
    PITCH_RANGE,
    PITCH_TRIM,
    ROLL_DAMPING,
    ROLL_GAIN,
    Leg,
    Pilot,
)
from bfi_cli.quantities.channels import FOOT, G

FloatArray = NDArray[np.float64]

RATE_HZ, STEPS = 25.0, 4  # integration at 100 Hz, the pilot at 50 Hz
TAXI_S, LONGEST_ROLL_S, STOPPED_S = 15.0, 75.0, 20.0
SETTLES = 50  # samples after which the air is that of the day
RUNWAY_M = 120.0
# Parts of the airspeed of cruise: rotation, climb out, approach.
ROTATES, CLIMBS_OUT, APPROACHES = 0.72, 0.85, 0.75
SLOW_GAIN, FAST_GAIN = 0.04, 0.3  # rad of pitch per rad of climb angle that is short, per s and at once
EXTRA = {
    "gps_altitude": ("position/h-sl-ft", FOOT),
    "latitude": ("position/lat-geod-deg", 1.0),
    "longitude": ("position/long-gc-deg", 1.0),
    "flaps": ("fcs/flap-pos-norm", 1.0),
    "elevator": ("fcs/elevator-pos-rad", 1.0),
    "on_ground": ("gear/wow", 1.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Part(Leg):
    """A leg with flaps."""

    flaps: float = 0.0


@dataclass(slots=True, kw_only=True, eq=False)
class Traveller(Pilot):
    """A pilot who takes off and flies parts drawn at random."""

    parts: tuple[Part, ...]
    rotates_m_s: float
    rolls: bool
    begins_s: float = 0.0
    lifted_s: float | None = None
    heading: float = 0.0
    over: bool = False
    flaps: float = 0.0

    def sticks(self, time_s: float, fdm: Any) -> FloatArray:
        """Return the controls beside those of trim; on the runway these are flown by hand."""
        if not self.rolls:
            return Pilot.sticks(self, time_s, fdm)
        added = np.zeros(4)
        speed = float(fdm["velocities/vtrue-fps"]) * FOOT
        added[3] = -1.0 if time_s < TAXI_S else 1.0
        brakes = 1.0 if time_s < TAXI_S else 0.0
        fdm["fcs/left-brake-cmd-norm"] = fdm["fcs/right-brake-cmd-norm"] = brakes
        off = math.remainder(self.heading - float(fdm["attitude/psi-rad"]), 2.0 * math.pi)
        fdm["fcs/steer-cmd-norm"] = min(max(3.0 * off, -0.5), 0.5)
        added[1] = ROLL_GAIN * -float(fdm["attitude/phi-rad"]) - ROLL_DAMPING * float(fdm["velocities/p-rad_sec"])
        if speed > self.rotates_m_s:
            wanted = self.pitch_rad + 0.1
            added[0] = -1.5 * (wanted - float(fdm["attitude/theta-rad"])) + 0.5 * float(
                fdm["velocities/thetadot-rad_sec"]
            )
        if not fdm["gear/wow"] and float(fdm["position/h-agl-ft"]) * FOOT > 15.0:
            self.rolls, self.begins_s, self.lifted_s = False, time_s, time_s
            self.climb = self.pitch_shift = 0.08
        return added

    def _elevator(self, fdm: Any) -> float:
        """Return the elevator for the climb that is wanted, without the hunting of a fast autopilot."""
        short = self.climb - float(fdm["velocities/h-dot-fps"]) * FOOT / self.tas_m_s
        self.pitch_shift = min(max(self.pitch_shift + SLOW_GAIN * short * self.step_s, -PITCH_RANGE), PITCH_RANGE)
        low = self.pitch_rad + self.climb + self.pitch_shift + FAST_GAIN * short - float(fdm["attitude/theta-rad"])
        self.elevator_trim = min(max(self.elevator_trim - PITCH_TRIM * low * self.step_s, -0.5), 0.5)
        return -PITCH_GAIN * low + PITCH_DAMPING * float(fdm["velocities/thetadot-rad_sec"]) + self.elevator_trim

    def _throttle(self, fdm: Any) -> float:
        """Return the throttle for the speed that is wanted, idle in the flare: no aircraft floats along its runway."""
        flares = self.runway_m is not None and float(fdm["position/h-agl-ft"]) * FOOT < FLARE_M
        return -1.0 if flares else Pilot._throttle(self, fdm)

    def _plan(self, time_s: float) -> None:
        ends_s = np.cumsum([part.duration_s for part in self.parts])
        k = int(np.searchsorted(ends_s, time_s - self.begins_s, side="right"))
        self.over = k == len(self.parts)
        part = self.parts[min(k, len(self.parts) - 1)]
        self._turn_to(part)
        self.flaps = part.flaps


def parts_of(rng: np.random.Generator, *, takes_off: bool) -> tuple[Part, ...]:
    """Return the parts of a flight, about 11 minutes, before its approach."""
    steep = float(rng.uniform(0.03, 0.06))
    parts = [Part(duration_s=float(rng.uniform(50.0, 90.0)), climb_rad=steep, speed=CLIMBS_OUT)] if takes_off else []
    parts.append(Part(duration_s=float(rng.uniform(20.0, 60.0))))
    for kind in rng.permutation(["climb", "descent", "left", "right", "fast", "slow", "level", "circle", "spiral"]):
        length_s, bank = float(rng.uniform(25.0, 75.0)), float(rng.uniform(0.2, 0.5))
        slope = float(rng.uniform(0.02, 0.05))
        parts.append(
            {
                "climb": Part(duration_s=length_s, climb_rad=slope, speed=0.92),
                "descent": Part(duration_s=length_s, climb_rad=-slope),
                "left": Part(duration_s=0.5 * length_s, bank_rad=-bank),
                "right": Part(duration_s=0.5 * length_s, bank_rad=bank),
                "fast": Part(duration_s=length_s, speed=float(rng.uniform(1.05, 1.12))),
                "slow": Part(duration_s=length_s, speed=float(rng.uniform(0.85, 0.93))),
                "level": Part(duration_s=length_s),
                "circle": Part(duration_s=1.5 * length_s, bank_rad=bank),
                "spiral": Part(duration_s=length_s, bank_rad=-bank, climb_rad=0.6 * slope, speed=0.95),
            }[str(kind)]
        )
        parts.append(Part(duration_s=float(rng.uniform(10.0, 40.0))))
    flaps = float(rng.choice([0.25, 0.5]))
    parts.append(Part(duration_s=40.0, speed=APPROACHES + 0.1))
    parts.append(Part(duration_s=50.0, speed=APPROACHES, flaps=flaps))
    return tuple(parts)


def fly(name: str, seed: int, *, takes_off: bool) -> dict[str, FloatArray]:
    """Return the truth of a flight by channel, 25 Hz, SI.

    Raises
    ------
    FlightError : the aircraft does not trim, or leaves normal flight.
    """
    rng = np.random.default_rng([seed, *name.encode()])
    altitude_m = float(rng.uniform(700.0, 1500.0))
    cruise = cruise_airspeed(name, tas_m_s=None, altitude_m=altitude_m) * float(rng.uniform(0.95, 1.08))
    parts = parts_of(rng, takes_off=takes_off)
    air = {
        "atmosphere/delta-T": float(rng.uniform(-12.0, 15.0)) * 1.8,
        "atmosphere/P-sl-psf": 2116.22 * (1.0 + float(rng.uniform(-0.015, 0.015))),
    }
    wind = rng.uniform(-7.0, 7.0, 2)
    shear = rng.uniform(-0.008, 0.008, 2)  # 1/s
    sigma = float(rng.choice([0.2, 0.6, 1.2]))
    fdm = trimmed(name, tas_m_s=cruise, altitude_m=altitude_m, rate_hz=RATE_HZ * STEPS)
    if fdm is None:
        raise FlightError(f"does not trim at {cruise:.0f} m/s")
    pitch, throttles = float(fdm["attitude/theta-rad"]), range(fdm.get_propulsion().get_num_engines())
    start = np.array([fdm[command] for command in CONTROLS.values()])
    pilot = Traveller(
        tas_m_s=cruise,
        pitch_rad=pitch,
        step_s=2.0 / (RATE_HZ * STEPS),
        tour=True,
        parts=parts,
        rotates_m_s=ROTATES * cruise,
        rolls=takes_off,
        heading=math.radians(45.0),
    )
    if takes_off:
        _stand_on_runway(fdm)
    for key, value in air.items():
        fdm[key] = value
    total_s = sum(part.duration_s for part in parts) + 500.0
    n = round(total_s * RATE_HZ)
    gusts = dryden_gusts(Dryden(sigma_m_s=sigma), n, airspeed_m_s=cruise, rate_hz=RATE_HZ, rng=rng)
    across = dryden_gusts(Dryden(sigma_m_s=sigma), n, airspeed_m_s=cruise, rate_hz=RATE_HZ, rng=rng)[:, 1]
    sources = [
        *((channel.name, channel.property, channel.scale) for channel in RECORDED),
        *((k, *v) for k, v in EXTRA.items()),
    ]
    kept = np.full((n, len(sources)), np.nan)
    stopped, flaps = 0, 0.0
    runway_m = RUNWAY_M if takes_off else None
    last = n
    for k in range(n):
        kept[k] = _read(fdm, sources, throttles)
        _refuse_wild(fdm, pilot, k / RATE_HZ)
        if pilot.over and pilot.runway_m is None:
            height = float(fdm["position/h-sl-ft"]) * FOOT
            pilot.runway_m = runway_m if runway_m is not None and height - runway_m < 400.0 else height - 180.0
            fdm["position/terrain-elevation-asl-ft"] = pilot.runway_m / FOOT
            fdm["gear/gear-cmd-norm"] = 1.0
        speed = float(fdm["velocities/vtrue-fps"]) * FOOT
        stopped += pilot.has_landed and speed < 0.15 * cruise
        if stopped > STOPPED_S * RATE_HZ or (takes_off and pilot.rolls and k > (TAXI_S + LONGEST_ROLL_S) * RATE_HZ):
            last = k
            break
        flies = not pilot.rolls and not pilot.has_landed
        _blow(fdm, wind, shear, flies * np.array([gusts[k, 0], across[k], gusts[k, 1]]), flies=flies)
        for i in range(STEPS):
            if i % 2 == 0:
                added = pilot.sticks((k + i / STEPS) / RATE_HZ, fdm)
                positions = np.clip(start + added, [-1.0, -1.0, -1.0, 0.0], 1.0)
                for command, position in zip(list(CONTROLS.values())[:3], positions[:3], strict=True):
                    fdm[command] = float(position)
                for engine in throttles:
                    fdm[f"{CONTROLS['throttle']}[{engine}]"] = float(positions[3])
            fdm.run()
        if not pilot.rolls:
            flaps = pilot.flaps or flaps
            fdm[FLAPS] = flaps
        if pilot.lifted_s is not None and k / RATE_HZ > pilot.lifted_s + 10.0 and pilot.runway_m is None:
            fdm["gear/gear-cmd-norm"] = 0.0
    if takes_off and pilot.rolls:
        raise FlightError("does not leave the runway")
    truth = {name: kept[SETTLES:last, j] for j, (name, _, _) in enumerate(sources)}
    truth["normal_acc"] = truth["normal_acc"] - G
    truth["landed"] = np.array([float(pilot.has_landed)])
    return truth


def _blow(fdm: Any, wind: FloatArray, shear: FloatArray, gust: FloatArray, *, flies: bool) -> None:
    """Set wind, which grows with height, and a gust (headwind, from the right, upward), both calm on the ground."""
    above_m = max(float(fdm["position/h-agl-ft"]) * FOOT, 0.0)
    share = min(above_m / 150.0, 1.0) if flies else 0.0
    blows = share * (wind + shear * above_m)
    heading = float(fdm["attitude/psi-rad"])
    along, side, up = -share * gust
    fdm["atmosphere/wind-north-fps"] = float(blows[0]) / FOOT
    fdm["atmosphere/wind-east-fps"] = float(blows[1]) / FOOT
    fdm["atmosphere/gust-north-fps"] = (along * math.cos(heading) - side * math.sin(heading)) / FOOT
    fdm["atmosphere/gust-east-fps"] = (along * math.sin(heading) + side * math.cos(heading)) / FOOT
    fdm["atmosphere/gust-down-fps"] = float(up) / FOOT


def _stand_on_runway(fdm: Any) -> None:
    fdm["ic/terrain-elevation-ft"] = RUNWAY_M / FOOT
    fdm["gear/gear-cmd-norm"] = fdm["gear/gear-pos-norm"] = 1.0
    fdm["ic/vt-fps"] = 0.0
    fdm["ic/h-agl-ft"] = 8.0
    fdm["ic/gamma-deg"] = fdm["ic/theta-deg"] = fdm["ic/alpha-deg"] = 0.0
    fdm.run_ic()
    fdm["propulsion/set-running"] = -1.0
    fdm["fcs/left-brake-cmd-norm"] = fdm["fcs/right-brake-cmd-norm"] = 1.0
    for engine in range(fdm.get_propulsion().get_num_engines()):
        fdm[f"fcs/throttle-cmd-norm[{engine}]"] = 0.0
    for _ in range(round(5.0 * RATE_HZ * STEPS)):
        fdm.run()


def _read(fdm: Any, sources: list[tuple[str, str, float]], engines: range) -> FloatArray:
    values = []
    for name, source, scale in sources:
        if name == "fuel_flow":
            values.append(sum(fdm[f"propulsion/engine[{k}]/{source}"] for k in engines) * scale)
        elif source.startswith("forces/"):
            values.append(fdm[source] * scale / fdm["inertia/mass-slugs"])
        else:
            values.append(fdm[source] * scale)
    return np.array(values)


def _refuse_wild(fdm: Any, pilot: Traveller, time_s: float) -> None:
    aoa, roll = float(fdm["aero/alpha-rad"]), float(fdm["attitude/phi-rad"])
    flies = not (pilot.rolls or pilot.has_landed)
    if not math.isfinite(roll) or abs(roll) > 1.3 or (flies and abs(aoa) > 0.45):
        raise FlightError(f"leaves normal flight at {time_s:.0f} s: angle of attack {aoa:.2f}, roll {roll:.2f} rad")


def flown(name: str, seed: int, folder: Path) -> Mapping[str, FloatArray] | str:
    """Return the truth of a flight, flown once and kept in a folder, or why it cannot be flown."""
    file, refusal = folder / f"{name}_{seed}.npz", folder / f"{name}_{seed}.txt"
    if not file.is_file() and not refusal.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        words = [sys.executable, str(Path(__file__).resolve()), name, str(seed), str(file.resolve())]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        if not file.is_file():
            refusal.write_text((done.stderr.strip().splitlines() or ["ended"])[-1])
    if refusal.is_file():
        return refusal.read_text()
    with np.load(file) as stored:
        return {key: stored[key] for key in stored.files}


def main(name: str, seed: int, file: Path) -> None:
    """Write a flight, from the runway where the aircraft leaves it, else from level flight."""
    truth: dict[str, FloatArray] = {}
    with suppress(FlightError):
        truth = fly(name, seed, takes_off=True)
    takes_off = bool(truth)
    truth = truth or fly(name, seed, takes_off=False)
    small = {key: x if key in ("latitude", "longitude") else x.astype(np.float32) for key, x in truth.items()}
    part = file.with_suffix(f".{os.getpid()}.npz")
    np.savez_compressed(part, **small, took_off=np.array([float(takes_off)]))
    part.rename(file)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]))
