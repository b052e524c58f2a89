"""Ordinary causes in a log: what each moves, what it leaves alone, and what the file says of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from made_journeys import made_journey

from bfi_cli.airdata import SEA_LEVEL_PRESSURE, altitude_of
from bfi_cli.commands import cli
from bfi_cli.faults import parse_spec
from bfi_cli.faults.ordinary import Occurrence, parse_occurrence
from bfi_cli.flight.tables import ORDINARY
from bfi_cli.flightlog import FlightLog, inject, read_log, write_log
from bfi_cli.flightlog.ordinary import EDDY_S, INJECTED, RISES_S, SETTLES_S, TURNED_S, WAKE_S
from bfi_cli.jsbsim.ordinary import SIMULATED
from bfi_cli.kernels.low_pass import IDENTITY

AT_S = 420.0
READING = {"clock", "gusts", "wind_shear"}  # mended where the log is read, or part of the noise and of the wind


@pytest.fixture(scope="module")
def journey() -> FlightLog:
    return made_journey(rate_hz=2.0)


def changes(before: FlightLog, after: FlightLog) -> dict[str, np.ndarray]:
    moved = {name: after.channels[name].values - channel.values for name, channel in before.channels.items()}
    return {name: change for name, change in moved.items() if np.nanmax(np.abs(change)) > 0.0}


def with_cause(log: FlightLog, text: str) -> FlightLog:
    return inject(log, ordinary=[parse_occurrence(text, where="", makings=INJECTED)], response=IDENTITY)


def test_a_knob_that_is_turned_moves_the_altitude_alone_by_the_standard_atmosphere(journey: FlightLog) -> None:
    (name, change), *rest = changes(journey, with_cause(journey, f"altimeter_set@{AT_S}:500")).items()
    assert (name, rest) == ("altitude", [])
    turned = journey.time_s >= AT_S + TURNED_S
    expected = altitude_of(np.array(SEA_LEVEL_PRESSURE)) - altitude_of(np.array(SEA_LEVEL_PRESSURE + 500.0))
    np.testing.assert_allclose(change[turned], expected, rtol=1e-9)
    assert not change[journey.time_s < AT_S].any()


def test_a_horizon_erects_with_its_time_constant(journey: FlightLog) -> None:
    moved = changes(journey, with_cause(journey, f"attitude_settles@{AT_S}:0.05"))
    assert moved.keys() == {"pitch"}
    error = np.interp([AT_S + RISES_S, AT_S + RISES_S + SETTLES_S], journey.time_s, moved["pitch"])
    np.testing.assert_allclose(error, [0.05, 0.05 / np.e], rtol=1e-6)


def test_a_wake_moves_what_the_tube_feels_while_it_lasts_and_no_more(journey: FlightLog) -> None:
    moved = changes(journey, with_cause(journey, f"wake@{AT_S}:2"))
    crossed = (journey.time_s >= AT_S) & (journey.time_s < AT_S + WAKE_S)
    assert moved.keys() <= {"tas", "cas", "ias", "mach", "p_total", "q_impact", "tas_rate", "sat"}
    assert not moved["tas"][~crossed].any()
    # Of so many eddies the standard deviation is known to about a part of 1 / sqrt(2 n); three of these on both sides.
    eddies = WAKE_S / max(2.0 * EDDY_S, 1.0 / journey.rate_hz)
    assert np.std(moved["tas"][crossed]) == pytest.approx(2.0, rel=3.0 / np.sqrt(2.0 * eddies))


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_a_clock_that_repeats_and_skips_is_read_as_the_regular_one_it_is(tmp_path: Path, suffix: str) -> None:
    journey = made_journey(rate_hz=1.0)
    faulty = with_cause(journey, f"clock@{AT_S}:5")
    assert np.count_nonzero(np.diff(faulty.time_s) == 0.0) == 5
    write_log(faulty, tmp_path / f"log{suffix}")
    again = read_log(tmp_path / f"log{suffix}")
    np.testing.assert_allclose(again.time_s, journey.time_s, atol=1e-6)
    assert changes(journey, again) == {}


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_what_was_made_is_in_the_truth_of_the_file(journey: FlightLog, tmp_path: Path, suffix: str) -> None:
    fault = parse_spec("bias,channel=pitch,magnitude=0.1,onset_s=500")
    both = inject(with_cause(journey, "wake@420:2"), [fault], response=IDENTITY)
    after = inject(both, ordinary=[Occurrence(cause="attitude_settles", at_s=450.0)], response=IDENTITY)
    write_log(after, tmp_path / f"log{suffix}")
    truth = read_log(tmp_path / f"log{suffix}").truth
    assert truth is not None
    assert truth.ordinary == (
        Occurrence(cause="wake", at_s=420.0, size=2.0),
        Occurrence(cause="attitude_settles", at_s=450.0, size=INJECTED["attitude_settles"].size),
    )
    assert [entry.onset_s for entry in truth.faults] == [500.0]
    # A clean signal lacks the fault and has what is ordinary, whichever came first.
    error = after.channel("pitch").values - truth.clean["pitch"]
    np.testing.assert_allclose(error, np.where(journey.time_s >= 500.0, 0.1, 0.0), atol=1e-12)


@pytest.mark.parametrize(("command", "makings"), [("inject", INJECTED), ("simulate", SIMULATED)])
def test_the_help_lists_every_cause_that_can_be_made_with_its_unit(command: str, makings: dict) -> None:
    shown = " ".join(CliRunner().invoke(cli, [command, "--help"], env={"COLUMNS": "200"}).output.split())
    for name, making in makings.items():
        assert name in shown
        assert making.unit in shown
        assert making.text
        assert making.size != 0.0


def test_what_can_be_made_is_known_to_the_diagnosis() -> None:
    assert ({*INJECTED, *SIMULATED} - READING) <= ORDINARY.keys() | {"wake", "altitude_held"}
