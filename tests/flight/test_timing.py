"""When a fault begins and ends by its own likelihood: from a place that is proposed too early or too late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from made_journeys import made_journey

from bfi_cli.faults import parse_spec
from bfi_cli.flight.bench import Bench, bench_of, place_of
from bfi_cli.flight.judge import channel_faults, ordinary_of, weights_of_channel
from bfi_cli.flight.lines import LAWS, weights_of_laws
from bfi_cli.flight.model import flight_model
from bfi_cli.flight.seconds import seconds_of
from bfi_cli.flight.timing import begun_before, likeliest, timing_of
from bfi_cli.flight.weight import Weight
from bfi_cli.flightlog.injection import inject

ONSET_S, OFFSET_S = 420.3, 500.8
# What dates an error of the true airspeed.
FEW = ("tas", "cas", "altitude", "altitude_rate", "pitch", "velocity_north", "velocity_east")


@cache
def bench_with(spec: str, *, part: tuple[float, float] = (0.0, 600.0), names: tuple[str, ...] = ()) -> Bench:
    log = made_journey(rate_hz=1.0).window(*part)
    log = replace(log, channels={name: log.channels[name] for name in names or log.channels})
    log = inject(log, [parse_spec(spec, unit_of=lambda name: log.channel(name).unit)])
    seconds = seconds_of(log)
    assert seconds is not None
    model = flight_model(seconds)
    assert model is not None
    return bench_of(model)


@cache
def weight_of(bench: Bench, fault: str, onset_s: float, offset_s: float | None) -> Weight:
    """Return what a step of a channel, or a line by its first law, is worth: from there on it is placed."""
    place = place_of(bench, onset_s, offset_s)
    assert place is not None
    if fault in channel_faults(bench.model):
        (weight,) = weights_of_channel(fault, 0.0, [place], ordinary_of(place))
    else:
        law = next(law for law in LAWS if law.fault == fault)
        (weight,) = weights_of_laws([(law, place)], ordinary_of(place))
    return weight


def test_where_nothing_is_flown_nothing_begins():
    bench = bench_with(f"bias,channel=tas,magnitude=4,onset_s={ONSET_S}")
    weight = weight_of(bench, "tas", ONSET_S, None)
    assert timing_of(bench, weight, 20.0, None) is None
    assert timing_of(bench, weight, float(np.max(bench.model.time_s)), None) is None


def test_an_end_behind_what_is_weighed_stays_as_proposed():
    bench = bench_with(f"bias,channel=tas,magnitude=4,onset_s={ONSET_S}")
    weight = weight_of(bench, "tas", ONSET_S, None)
    timing = timing_of(bench, weight, ONSET_S, OFFSET_S, until_s=OFFSET_S - 10.0)
    assert timing is not None
    assert timing.offset_s == OFFSET_S


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("spec", "fault", "early_s", "widest_s"),
    [
        ("bias,channel=tas,magnitude=4", "tas", 16.0, 4.0),
        ("static_leak,time_constant_s=8", "static_leak", 16.0, 6.0),
        ("static_leak,time_constant_s=8", "static_leak", -12.0, 6.0),
        ("static_leak,time_constant_s=12", "static_leak", 16.0, 6.0),
        ("static_leak,time_constant_s=12", "static_leak", -12.0, 11.0),
        ("bias,channel=tas,magnitude=4", "tas", -12.0, 4.0),
        ("pitot_leak,time_constant_s=30", "pitot_leak", 16.0, 10.0),
        ("pitot_leak,time_constant_s=30", "pitot_leak", -12.0, 10.0),
        ("pitot_icing,magnitude=0.003", "pitot_icing", 16.0, 60.0),
        ("pitot_icing,magnitude=0.003", "pitot_icing", -12.0, 60.0),
        ("bias,channel=aoa,magnitude=0.03", "aoa", 16.0, 4.0),
        ("bias,channel=aoa,magnitude=0.03", "aoa", -12.0, 4.0),
        ("static_blocked", "static_blocked", 16.0, 60.0),
        ("static_blocked", "static_blocked", -12.0, 60.0),
        ("pitot_blocked", "pitot_blocked", 16.0, 60.0),
        ("pitot_blocked", "pitot_blocked", -12.0, 60.0),
    ],
)
def test_an_onset_is_in_its_interval_wherever_it_was_proposed(
    spec: str, fault: str, early_s: float, widest_s: float
) -> None:
    to_s = 960.0 if fault == "static_blocked" else 600.0  # the descent tells of a port that is blocked
    bench = bench_with(f"{spec},onset_s={ONSET_S}", part=(0.0, to_s))
    weight = weight_of(bench, fault, ONSET_S, None)
    timing = timing_of(bench, weight, ONSET_S - early_s, None)
    assert timing is not None
    first_s, last_s = timing.onset_ci95
    assert first_s <= ONSET_S <= last_s
    assert first_s <= timing.onset_s <= last_s
    assert last_s - first_s <= widest_s


@pytest.mark.slow
def test_an_end_is_found_with_the_onset():
    bench = bench_with(f"bias,channel=tas,magnitude=4,onset_s={ONSET_S},offset_s={OFFSET_S}")
    weight = weight_of(bench, "tas", ONSET_S, OFFSET_S)
    timing = timing_of(bench, weight, ONSET_S - 15.0, OFFSET_S + 20.0)
    assert timing is not None
    assert timing.onset_s == pytest.approx(ONSET_S, abs=1.0)
    assert timing.offset_s == pytest.approx(OFFSET_S, abs=1.0)
    assert timing.weight.size == pytest.approx(4.0, abs=0.3)


@pytest.mark.first_rows(1)
@pytest.mark.parametrize(
    ("spec", "fault", "growth_s"),
    [
        ("bias,channel=tas,magnitude=6", "tas", 0.0),
        ("ramp_hold,channel=tas,magnitude=8,duration_s=45", "tas", 45.0),
        ("static_leak,time_constant_s=8", "static_leak", None),
    ],
)
def test_what_comes_back_began_before(spec: str, fault: str, growth_s: float | None) -> None:
    bench = bench_with(f"{spec},onset_s={ONSET_S},offset_s={OFFSET_S}", part=(250.0, 600.0), names=FEW)
    timing = begun_before(bench, [fault], OFFSET_S + 1.0, sure=20.0)
    assert timing is not None
    assert timing.onset_s == pytest.approx(ONSET_S, abs=2.0 if not growth_s else 0.2 * growth_s)
    assert timing.offset_s == pytest.approx(OFFSET_S, abs=1.5)
    assert timing.weight.growth_s == (growth_s and pytest.approx(growth_s, rel=0.3))


def test_what_lasts_began_no_earlier():
    bench = bench_with(f"bias,channel=tas,magnitude=4,onset_s={ONSET_S}")
    assert begun_before(bench, ["tas"], ONSET_S, sure=20.0) is None


def test_an_onset_is_sought_within_a_minute_of_where_it_was_proposed() -> None:
    """From 55 s before it is dated; from 70 s before it is beyond what is sought, where another fault begins."""
    bench = bench_with(f"bias,channel=tas,magnitude=4,onset_s={ONSET_S}")
    weight = weight_of(bench, "tas", ONSET_S, None)
    near, far = (timing_of(bench, weight, ONSET_S - early_s, None) for early_s in (55.0, 70.0))
    assert near is not None
    assert near.onset_s == pytest.approx(ONSET_S, abs=1.0)
    assert far is not None
    assert far.onset_ci95[1] < ONSET_S


@pytest.mark.parametrize(("lasts_s", "is_dated"), [(390.0, True), (450.0, False)])
def test_an_onset_is_sought_in_the_seven_minutes_before_what_may_be_its_end(
    monkeypatch: pytest.MonkeyPatch, lasts_s: float, is_dated: bool
) -> None:
    """A step that lasted for 390 s is dated; of one that lasted for 450 s no second that is sought is the onset."""
    for courses in ("GROWTHS_S", "GROWN_S"):  # a step is told apart from what grows elsewhere
        monkeypatch.setattr(f"bfi_cli.flight.timing.{courses}", (0.0,))
    onset_s = 750.0 - lasts_s
    bench = bench_with(f"bias,channel=tas,magnitude=6,onset_s={onset_s},offset_s=750.0", part=(200.0, 850.0), names=FEW)
    timing = begun_before(bench, ["tas"], 751.0, sure=20.0)
    assert timing is not None
    assert (abs(timing.onset_s - onset_s) < 2.0) is is_dated


def test_an_interval_of_a_normal_likelihood_is_that_of_its_quantiles() -> None:
    """Of a standard deviation of 100 places, 196 to both sides hold 95 %; where the dispersion is 4, twice as many.

    So it is where four neighbours say the same.
    """

    def weigh(places: Sequence[int], wide: float = 1.0, memory_s: float = 1.0) -> list[Weight]:
        margins = [-0.5 * ((k - 1000) / 100.0) ** 2 for k in places]
        same = Weight(fault="tas", margin=0.0, shares={}, size=1.0, dispersion=wide, memory_s=memory_s)
        return [replace(same, margin=margin) for margin in margins]

    assert likeliest(2001, weigh) == (1000, pytest.approx(804, abs=2), pytest.approx(1196, abs=2))
    for wide, memory_s in ((4.0, 1.0), (1.0, 4.0)):
        _, first, last = likeliest(2001, partial(weigh, wide=wide, memory_s=memory_s))
        assert (first, last) == (pytest.approx(608, abs=2), pytest.approx(1392, abs=2))
