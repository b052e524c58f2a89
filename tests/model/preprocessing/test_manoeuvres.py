"""Stalls and parabolas, in which a model of one trim declares nothing and no threshold is counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.flightlog import Channel, FlightLog
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.onset import windows_of
from bfi_cli.model.preprocessing.defaults import manoeuvres_of, modelled_stretches

UNITS = {"tas": "m/s", "altitude": "m", "pitch": "rad", "aoa": "rad"}


@pytest.fixture(scope="module")
def log() -> FlightLog:
    """Return ten minutes of cruise at 5 Hz with a stall at 300 s: the incidence rises to 15 degrees, the nose falls."""
    time_s = np.arange(0.0, 600.0, 0.2)
    incidence = np.interp(time_s, [200.0, 280.0, 300.0, 304.0, 330.0], [0.05, 0.2, np.radians(15.0), 0.1, 0.05])
    fallen = np.interp(time_s, [300.0, 304.0, 330.0], [0.0, -0.3, 0.0])
    values = {
        "tas": np.interp(time_s, [200.0, 280.0, 300.0, 304.0, 330.0], [100.0, 60.0, 50.0, 55.0, 100.0]),
        "altitude": np.full(time_s.size, 3000.0),
        "pitch": incidence + fallen,
        "aoa": incidence,
    }
    channels = {
        name: Channel(name=name, values=frozen_array(one), unit=UNITS[name], source=name)
        for name, one in values.items()
    }
    return FlightLog(path="made", time_s=frozen_array(time_s), channels=channels, filters=())


def test_a_stall_is_a_manoeuvre_that_reaches_beyond_itself(log: FlightLog):
    (stall,) = manoeuvres_of(log, ()).manoeuvres
    assert stall.name == "stall"
    assert 280.0 < stall.from_s < 300.0 < stall.to_s < 310.0
    assert stall.reach_s == (stall.from_s - stall.beside_s, stall.to_s + stall.beside_s)
    (before, after) = modelled_stretches(log, ())
    assert (before[1], after[0]) == stall.reach_s


def test_a_flight_without_one_has_none(log: FlightLog):
    calm = log.window(0.0, 190.0)
    assert manoeuvres_of(calm, ()).manoeuvres == ()
    assert len(modelled_stretches(calm, ())) == 1


def test_no_window_of_a_calibration_has_one(log: FlightLog):
    windows = windows_of(log, Config(), length_s=60.0, step_s=30.0)
    (stall,) = manoeuvres_of(log, ()).manoeuvres
    assert len(windows) > 8
    assert all(to_s <= stall.reach_s[0] or from_s >= stall.reach_s[1] for from_s, to_s in windows)


def test_a_suspect_attitude_tells_no_stall(log: FlightLog):
    """Where the pitch may be wrong, its fall may be the fault itself."""
    assert manoeuvres_of(log, ("pitch",)).manoeuvres == ()
    without = replace(log, channels={name: one for name, one in log.channels.items() if name != "pitch"})
    assert manoeuvres_of(without, ()).manoeuvres == ()
    assert len(windows_of(log, merge(Config(), {"outputs": ("pitch",)}), length_s=60.0, step_s=30.0)) > 17
