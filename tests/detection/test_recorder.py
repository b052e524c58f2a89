"""What the recorder passed decides the rate of a detection and which steps it may exclude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noted import texts

from bfi_cli.aircraft import find_model, manoeuvre, simulate, time_axis
from bfi_cli.config import Config, merge
from bfi_cli.detection import DetectResult, detect_faults
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.quality import recorder_filters
from bfi_cli.flightlog.record import frozen_array

EDGE_HZ, RATE_HZ, DURATION_S = 0.75, 10.0, 240.0
RECORDER = Filter(kind="gaussian", edge_hz=EDGE_HZ, rate_hz=RATE_HZ)
NOISE = 0.01


@pytest.fixture(scope="module")
def recorded() -> FlightLog:
    """Return four minutes of a Citation with noise, all of it through a recorder that the log states."""
    time_s = time_axis(duration_s=DURATION_S, rate_hz=RATE_HZ)
    u = np.sum([manoeuvre("3211", time_s, start_s=start_s) for start_s in np.arange(2.0, DURATION_S, 15.0)], axis=0)
    model, rng = find_model("citation"), np.random.default_rng(0)
    clean = simulate(model, u, rng=rng, rate_hz=RATE_HZ)
    noise_sd = {name: NOISE * float(clean.channel(name).values.std()) for name in model.outputs}
    log = simulate(model, u, rng=rng, rate_hz=RATE_HZ, noise_sd=noise_sd)
    through = response_of([RECORDER], RATE_HZ)
    channels = {
        name: replace(
            one, values=frozen_array(through.filtered(np.pad(one.values, (through.after, through.before), mode="edge")))
        )
        for name, one in log.channels.items()
    }
    return replace(log, channels=channels, filters=(RECORDER,))


def detected(log: FlightLog, **settings: object) -> DetectResult:
    return detect_faults(log, merge(Config(), {key.replace("__", "."): value for key, value in settings.items()}))


def states(result: DetectResult) -> set[str]:
    return {str(one.state) for one in result.candidates}


def limits(result: DetectResult) -> list[float | None]:
    return [one.excluded_above for one in result.candidates]


def test_the_rate_is_what_the_recorder_passes_and_one_that_is_asked_for_wins(recorded: FlightLog):
    own = detected(recorded)
    assert (own.log.rate_hz, own.alarms) == (pytest.approx(2.0), ())
    assert "rate: the recorder's low-pass leaves little above 1 Hz" in texts(own.notes)
    assert any(
        note.startswith("faults are taken through the recorder's low-pass (gaussian") for note in texts(own.notes)
    )
    assert None not in limits(own)
    asked = detected(recorded, conditioning__rate_hz=5.0)
    assert asked.log.rate_hz == pytest.approx(5.0)
    assert "rate: asked for" in texts(asked.notes)


@pytest.mark.slow
def test_a_recorder_that_is_stated_counts_as_that_of_the_log(recorded: FlightLog):
    """One that the command states and one that the file does: the same rate, alarms, limits."""
    failing = inject(recorded, [Fault(shape="bias", channel="aoa", magnitude=0.02, onset_s=150.0)])
    for log in (recorded, failing):
        own, stated = detected(log), detected(replace(log, filters=None), recorder__edge_hz=EDGE_HZ)
        assert stated.log == own.log
        assert [(one.channel, one.time_s, one.size) for one in stated.alarms] == [
            (one.channel, one.time_s, one.size) for one in own.alarms
        ]
        assert limits(stated) == limits(own)
        assert any("Hz, as stated)" in note for note in texts(stated.notes))


@pytest.mark.parametrize(("edge_hz", "told"), [("none", True), (3.0, True), (0.8, False), ("auto", False)])
def test_a_recorder_that_is_stated_against_the_log_counts_and_is_told(
    recorded: FlightLog, edge_hz: str | float, told: bool
):
    filters, sentence = recorder_filters(recorded, edge_hz)
    assert [one.edge_hz for one in filters] == ([] if edge_hz == "none" else [0.75 if edge_hz == "auto" else edge_hz])
    assert ("but the log has one (gaussian, gain one half at 0.75 Hz, stated in the file)" in sentence) == told


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("edge_hz", [3.0, "none", 0.8, "auto"])
def test_a_detection_tells_which_recorder_counts(recorded: FlightLog, edge_hz: str | float):
    _, sentence = recorder_filters(recorded, edge_hz)
    assert sentence in texts(detected(recorded, recorder__edge_hz=edge_hz).notes)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("kind", ["gaussian", "causal"])
def test_the_end_of_a_log_is_watched_as_far_as_the_stated_recorder_looks_ahead(recorded: FlightLog, kind: str):
    bare = replace(recorded, filters=None)
    result = detected(bare, recorder__edge_hz=EDGE_HZ, recorder__kind=kind)
    assert any("after the end of the log" in note for note in texts(result.notes)) == (kind == "gaussian")


@pytest.mark.slow
def test_no_step_is_excluded_at_a_rate_at_which_the_recorder_spreads_it(recorded: FlightLog):
    """Limits of sharp steps would exclude what passes unseen when its rise takes several samples."""
    fast = detected(recorded, conditioning__rate_hz=5.0)
    assert (fast.decision, states(fast), set(limits(fast))) == ("inconclusive", {"not_seen"}, {None})
    assert any(note.endswith("no step is excluded; what gives limits: --rate 2") for note in texts(fast.notes))
    assert any(note.endswith(": --rate 2") for note in texts(fast.notes))
    assert None not in limits(detected(recorded, conditioning__rate_hz=2.0))


@pytest.mark.slow
def test_where_nobody_states_the_recorder_a_slow_one_is_reckoned_with(recorded: FlightLog):
    """At a rate at which it would spread a step nothing is excluded; stated as absent, or at a lower rate, it is."""
    bare = replace(recorded, filters=None)
    fast = detected(bare, conditioning__rate_hz=5.0)
    assert (states(fast), set(limits(fast))) == ({"not_seen"}, {None})
    (said,) = (note for note in texts(fast.notes) if note.startswith("it is unknown whether the recorder"))
    assert said.endswith("no step is excluded; what gives limits: --rate 2; --recorder HZ, or none where there is none")
    slow = detected(bare, conditioning__rate_hz=2.0)
    assert None not in limits(slow)
    assert any("through any low-pass that keeps half of 0.75 Hz" in note for note in texts(slow.notes))
    none = detected(bare, conditioning__rate_hz=5.0, recorder__edge_hz="none")
    assert None not in limits(none)
    assert not any("low-pass" in note for note in texts(none.notes))


@pytest.mark.slow
def test_the_lowest_edge_that_an_uncertain_recorder_may_have_counts(recorded: FlightLog):
    """Spectra that show a windowed sinc of 1.33 Hz may be those of a Gaussian of half that edge."""
    likely = replace(RECORDER, kind="fir", edge_hz=1.33)
    sure, unsure = (detected(replace(recorded, filters=(replace(likely, uncertain=one),))) for one in (False, True))
    assert sure.log.rate_hz == pytest.approx(10.0 / 3.0)
    assert unsure.log.rate_hz < 2.94 * 0.7 * 0.752
    assert None not in [*limits(sure), *limits(unsure)]


@pytest.mark.slow
def test_steps_through_the_recorder_just_above_what_is_excluded_raise_an_alarm(recorded: FlightLog):
    """In every channel at onsets anywhere: at least 95 in a hundred."""
    rng, found, n = np.random.default_rng(7), 0, 0
    for one in detected(recorded).candidates:
        for onset_s in rng.uniform(82.0, 230.0, size=4):
            size = 1.02 * float(rng.choice([-1.0, 1.0])) * one.excluded_above
            fault = Fault(shape="bias", channel=one.channel, magnitude=size, onset_s=float(onset_s))
            found, n = found + bool(detected(inject(recorded, [fault])).alarms), n + 1
    # Of 16 of which 95 % raise one, fewer than 12 do so once in a thousand times.
    assert n == 16
    assert found >= 12


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("edge_hz", ["none", 3.0])
def test_what_is_stated_against_the_log_excludes_no_more_than_the_log_allows(recorded: FlightLog, edge_hz: str | float):
    assert detected(recorded, recorder__edge_hz=edge_hz).log.rate_hz == pytest.approx(2.0)
    asked = detected(recorded, recorder__edge_hz=edge_hz, conditioning__rate_hz=5.0)
    assert set(limits(asked)) == {None}
