"""`bfi identify LOG EARLIER... --together`: what other records add, whom they may not mislead, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.flightlog import FlightLog, inject, write_log

pytestmark = pytest.mark.usefixtures("unscanned")
CONFIG = merge(Config(), {"onset_tolerance_s": 0.0, "window.from_s": 5.0, "window.to_s": 15.0})
DICTIONARY = load_dictionary({"channel": "tas", "atoms": [{"name": "drift", "shape": "drift", "onset_s": 10.0}]})
DRIFT = Fault(shape="drift", channel="tas", onset_s=10.0, magnitude=0.3)


def flown(seed: int, *, stroke: float = 1.0, noise: float = 0.02) -> FlightLog:
    """Return a flight of the Citation; `stroke` turns the elevator's effect into that of another aircraft."""
    time_s, rng = time_axis(duration_s=31.72, rate_hz=100.0), np.random.default_rng(seed)
    log = simulate(find_model("citation"), manoeuvre("3211", time_s), rng=rng, rate_hz=100.0, noise_sd={"tas": noise})
    channels = dict(log.channels)
    channels["elevator"] = replace(channels["elevator"], values=stroke * channels["elevator"].values)
    return replace(log, path=f"flight {seed}", channels=channels)


FAULTY, HEALTHY = inject(flown(1), [DRIFT]), flown(1)
EARLIER = (flown(2), flown(3), flown(4))


@cache
def asked(log: FlightLog, *earlier: FlightLog):
    return identify(replace(log, earlier=earlier), DICTIONARY, CONFIG)[0]


@pytest.mark.slow
def test_a_short_window_that_is_silent_alone_tells_the_fault_with_earlier_flights():
    alone, together = asked(FAULTY), asked(FAULTY, *EARLIER)
    assert alone.decision == "inconclusive"
    (fault,) = together.faults
    low, high = fault.ci95
    assert low < DRIFT.magnitude < high
    assert high - low < 0.3
    assert asked(HEALTHY, *EARLIER).candidates[0].excluded_above < 0.5 * asked(HEALTHY).candidates[0].excluded_above


@pytest.mark.slow
def test_their_order_does_not_matter():
    one, other = asked(FAULTY, *EARLIER), asked(FAULTY, *EARLIER[::-1])
    assert one.faults[0].magnitude == pytest.approx(other.faults[0].magnitude, rel=1e-9)
    np.testing.assert_allclose(one.faults[0].ci95, other.faults[0].ci95, rtol=1e-9)


@pytest.mark.slow
def test_a_flight_of_another_aircraft_is_left_out_and_named():
    strange = flown(5, stroke=-1.0)
    alone, together = asked(FAULTY), asked(FAULTY, strange)
    assert any("left out of --together: flight 5" in one.text and one.kind == "limit" for one in together.notes)
    assert together.decision == alone.decision
    both = asked(FAULTY, EARLIER[0], strange)
    assert both.faults[0].magnitude == pytest.approx(asked(FAULTY, EARLIER[0]).faults[0].magnitude, rel=1e-6)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(("magnitude", "noise"), [(0.5, 0.05), (4.0, 0.005)])
def test_a_step_in_the_log_or_noise_of_another_size_does_not_make_the_models_differ(magnitude: float, noise: float):
    step = Fault(shape="bias", channel="tas", onset_s=12.0, magnitude=magnitude, name="step")
    steps = load_dictionary({"channel": "tas", "atoms": [{"name": "step", "shape": "bias", "onset_s": 12.0}]})
    log = replace(inject(HEALTHY, [step]), earlier=(flown(2, noise=noise),))
    result = identify(log, steps, CONFIG)[0]
    assert not any("left out of --together" in one.text for one in result.notes)
    low, high = result.faults[0].ci95
    assert low < magnitude < high


def test_a_fault_in_an_earlier_flight_does_not_pass_as_its_motion():
    ill = inject(flown(6), [Fault(shape="bias", channel="tas", onset_s=12.0, magnitude=4.0)])
    together = asked(HEALTHY, ill)
    assert together.decision != "fault"
    assert any("left out of --together" in one.text for one in together.notes)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["EARLIER"], 2, "add --together"),
        (["--together"], 2, "no further log is given"),
        (["missing.h5", "--together"], 3, "missing.h5: no such file"),
        (["EARLIER@4:x", "--together"], 3, "no such file"),
        (["EARLIER@40:50", "--together"], 3, "between 40 s and 50 s"),
        (["EARLIER@5:6", "--together"], 3, "--together: "),
        (["EARLIER", "--together", "--method", "dmae", "--model", "citation"], 2, "learns none"),
        (["SLOW", "--together"], 3, "give --rate"),
    ],
)
def test_what_cannot_be_taken_together_is_refused_in_one_line(
    bfi, tmp_path: Path, words: list[str], code: int, said: str
):
    log, earlier, slow = (str(tmp_path / name) for name in ("log.h5", "earlier.h5", "slow.h5"))
    for path, flight in ((log, FAULTY), (earlier, EARLIER[0])):
        write_log(flight, path)
    assert bfi("convert", earlier, "--rate", 20, "-o", slow).code == 0
    words = [word.replace("EARLIER", earlier).replace("SLOW", slow) for word in words]
    out = bfi("identify", log, *words, "-d", "thesis")
    assert out.code == code
    assert said in out.stderr
    assert out.stderr.count("\n") == 1


def test_a_stretch_of_the_same_log_can_be_the_earlier_record(bfi, tmp_path: Path):
    log = str(tmp_path / "log.h5")
    write_log(inject(flown(1), [replace(DRIFT, onset_s=3.0)]), log)
    dictionary = tmp_path / "drift.yaml"
    dictionary.write_text("channel: tas\natoms:\n  - {name: drift, shape: drift, onset_s: 3}\n")
    out = bfi(
        *("identify", log, f"{log}@6:31", "--together", "--from", 0, "--to", 6, "-d", dictionary, "--json"),
        *("--onset-tolerance", 0),
    )
    assert out.code == 0, out.stderr
    notes = [one["text"] for one in json.loads(out.stdout)["notes"]]
    assert any(f"{log}@6:31" in text for text in notes)
