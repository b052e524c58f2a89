"""HDF5 of FlightDataAccessor: a group for each parameter, at a rate and an offset of its own, written by h5py alone."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from bfi_cli.errors import LogError
from bfi_cli.flightlog import read_log

KNOT, DURATION_S = 1852.0 / 3600.0, 60.0


def speed_kt(time_s):
    return 160.0 + 8.0 * np.sin(0.4 * time_s)


def written(path: Path, **changed: object) -> Path:
    """Write a flight; `changed` replaces attributes of the airspeed."""
    with h5py.File(path, "w") as file:
        file.attrs["version"] = 2
        series = file.create_group("series")
        for name, rate_hz, offset_s, unit, signal in (
            ("Airspeed True", 4.0, 0.125, "kt", speed_kt),
            ("Airspeed", 4.0, 0.0, "kt", lambda t: speed_kt(t) - 20.0),
            ("Altitude STD", 1.0, 0.5, "ft", lambda t: 5000.0 + 10.0 * t),
            ("Acceleration Normal", 8.0, 0.0, "g", lambda t: 1.0 + 0.05 * np.sin(t)),
            ("Elevator", 4.0, 0.0, "deg", lambda t: 2.0 * np.sin(t)),
            ("Gear Down", 1.0, 0.0, "", lambda t: np.zeros_like(t)),
        ):
            time_s = offset_s + np.arange(round(DURATION_S * rate_hz)) / rate_hz
            parameter = series.create_group(name)
            parameter["data"] = signal(time_s).astype(np.float32)
            parameter["mask"] = np.zeros(time_s.size, dtype=bool)
            parameter.attrs.update({"frequency": rate_hz, "supf_offset": offset_s, "units": unit})
        masked = series["Airspeed True"]["mask"]
        masked[100:104] = True
        series["Airspeed True"].attrs.update(changed)
    return path


def test_parameters_come_on_the_clock_of_the_airspeed_with_units_names_and_masks(tmp_path: Path):
    log = read_log(written(tmp_path / "flight.hdf5"))
    assert {"tas", "cas", "altitude", "normal_acc", "elevator", "Gear Down"} <= log.channels.keys()
    assert log.rate_hz == pytest.approx(4.0)
    tas = log.channel("tas").values
    np.testing.assert_allclose(tas, KNOT * speed_kt(log.time_s), rtol=1e-5)
    # Where the airspeed is masked there are no samples.
    assert np.diff(log.time_s).max() == pytest.approx(1.25)
    height = log.channel("altitude").values
    known = np.isfinite(height)
    held_s = np.floor(log.time_s[known] - 0.5) + 0.5
    np.testing.assert_allclose(height[known], 0.3048 * (5000.0 + 10.0 * held_s), rtol=1e-6)
    assert log.channel("normal_acc").unit == "m/s^2"


def test_the_steps_of_a_parameter_are_those_of_its_own_rate_in_the_unit_of_the_channel(tmp_path: Path):
    path = written(tmp_path / "flight.hdf5")
    with h5py.File(path, "a") as file:
        force = file["series/Acceleration Normal/data"]
        force[...] = np.round(force[...] / 0.004) * 0.004
    log = read_log(path)
    channel = log.channel("normal_acc")
    assert channel.step is None
    assert channel.plateau_step(log.rate_hz) == pytest.approx(0.004 * 9.80665, rel=1e-4)
    assert log.window(0.0, 30.0).channel("normal_acc").own_step == channel.own_step


def test_the_clock_of_another_airspeed_is_taken_where_it_is_asked_for(tmp_path: Path):
    log = read_log(written(tmp_path / "flight.hdf5"), channel_map={"tas": "Airspeed"})
    known = np.isfinite(log.channel("tas").values)
    np.testing.assert_allclose(log.channel("tas").values[known], KNOT * (speed_kt(log.time_s[known]) - 20.0), rtol=1e-5)


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        ({"frequency": 0.0}, "'Airspeed True' has a frequency of 0 Hz, from 0.125 s; mend the file"),
        ({"frequency": np.nan}, "'Airspeed True' has a frequency of nan Hz"),
        ({"frequency": "fast"}, "'Airspeed True' has no number as frequency, got 'fast'; mend the file"),
        ({"supf_offset": np.inf}, "'Airspeed True' has a frequency of 4 Hz, from inf s"),
    ],
)
def test_what_is_no_clock_is_refused(tmp_path: Path, changed: dict, complaint: str):
    with pytest.raises(LogError) as refusal:
        read_log(written(tmp_path / "flight.hdf5", **changed))
    assert complaint in str(refusal.value)
    assert "\n" not in str(refusal.value)
