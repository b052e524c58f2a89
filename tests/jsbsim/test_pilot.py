"""The pilot of a simulated flight, on aircraft whose pitch and path follow by first order."""

from __future__ import annotations

import math

import pytest

from bfi_cli.jsbsim.pilot import FOOT, Pilot

STEP_S, TAS_M_S, LAG_S, PATH_S = 0.05, 160.0, 0.5, 2.0


# Pitch rate by all of the elevator's travel, rad/s, of the 737, the F-16 and the C172 of JSBSim.
@pytest.mark.parametrize("effect", [0.16, 0.33, 0.44])
def test_an_altitude_that_is_held_stays_within_a_few_feet(effect: float):
    """In up and down draughts of 0.5 m/s in 20 s; the hold begins in a climb of 5 m/s."""
    pilot = Pilot(tas_m_s=TAS_M_S, pitch_rad=0.0, step_s=STEP_S, tour=False, held_m=1500.0)
    height, path, pitch, rate, heights = 1500.0, 0.03, 0.03, 0.0, []
    for k in range(round(180.0 / STEP_S)):
        climb = TAS_M_S * path + 0.5 * math.sin(2.0 * math.pi * k * STEP_S / 20.0)
        state = {
            "position/h-sl-ft": height / FOOT,
            "velocities/h-dot-fps": climb / FOOT,
            "velocities/thetadot-rad_sec": rate,
            "velocities/vtrue-fps": TAS_M_S / FOOT,
            "attitude/theta-rad": pitch,
            "attitude/phi-rad": 0.0,
            "velocities/p-rad_sec": 0.0,
        }
        elevator = float(pilot.sticks(k * STEP_S, state)[0])
        rate += (-effect * elevator - rate) / LAG_S * STEP_S
        pitch += rate * STEP_S
        path += (pitch - path) / PATH_S * STEP_S
        height += climb * STEP_S
        heights.append(height)
    assert max(abs(height - 1500.0) for height in heights[round(60.0 / STEP_S) :]) < 6.0
