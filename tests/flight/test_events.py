"""What windows and analyses find becomes events: clusters of windows, joined findings, one fault one event."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from bfi_cli.flight.events import (
    BEFORE_S,
    Draft,
    as_one,
    clusters,
    explains,
    is_certain,
    is_return,
    join,
    merge_stages,
    with_ends,
)
from bfi_cli.flight.flight import LastingFault
from bfi_cli.flight.parity import Finding


def draft(onset_s: float = 100.0, window: tuple[float, float] = (60.0, 180.0), **changes: Any) -> Draft:
    values: dict[str, Any] = {
        "fault": "tas",
        "among": (changes.get("fault", "tas"),),
        "channels": (changes.get("fault", "tas"),),
        "stage": "parity",
        "shape": "drift",
        "magnitude": 0.1,
        "sd": 0.01,
        "unit": "m/s^2",
        "onset_s": onset_s,
        "onset_ci95": (onset_s - 3.0, onset_s + 3.0),
        "statistic": 60.0,
        "threshold": 30.0,
        **changes,
    }
    return Draft(finding=Finding(**values), window=window, until_s=window[1])


def random_windows(seed: int) -> list[tuple[float, float]]:
    rng = np.random.default_rng(seed)
    starts = rng.uniform(0.0, 3000.0, 25)
    return [(first, first + length) for first, length in zip(starts, rng.choice([60.0, 120.0], 25), strict=True)]


@pytest.mark.parametrize("seed", range(5))
def test_clusters_part_the_windows_so_that_none_of_two_clusters_overlap(seed: int):
    windows = random_windows(seed)
    found = clusters(windows)
    assert sorted(k for cluster in found for k in cluster) == list(range(len(windows)))
    spans = [(min(windows[k][0] for k in one), max(windows[k][1] for k in one)) for one in found]
    assert all(earlier[1] <= later[0] for earlier, later in pairwise(spans))
    # Within a cluster no moment lies between its first and its last that none of its windows covers.
    for one, (first, last) in zip(found, spans, strict=True):
        moments = np.linspace(first, last, 200, endpoint=False)
        assert all(any(windows[k][0] <= t < windows[k][1] for k in one) for t in moments)


def test_a_channel_that_never_follows_the_flight_explains_no_step_that_the_scan_finds():
    vane = draft(0.0, (0.0, 3000.0), fault="aoa", stage="sensors", shape="scale")
    step = draft(150.0, fault="tas", stage="scan", shape="bias")
    assert [one.finding.fault for one in merge_stages([step, vane])] == ["aoa", "tas"]


@pytest.mark.parametrize("seed", range(5))
def test_clusters_do_not_depend_on_the_order_of_the_windows(seed: int):
    windows = random_windows(seed)
    order = np.random.default_rng(seed + 100).permutation(len(windows)).tolist()
    shuffled = [windows[k] for k in order]
    before = {frozenset(windows[k] for k in cluster) for cluster in clusters(windows)}
    assert {frozenset(shuffled[k] for k in cluster) for cluster in clusters(shuffled)} == before


def test_windows_that_touch_do_not_overlap():
    assert clusters([(0.0, 60.0), (60.0, 120.0)]) == [[0], [1]]
    assert clusters([(30.0, 90.0), (0.0, 60.0)]) == [[1, 0]]
    assert clusters([]) == []


def test_the_strongest_of_a_run_describes_it_and_the_last_window_ends_it():
    weak = draft(window=(60.0, 180.0))
    strong = draft(statistic=90.0, magnitude=0.2, window=(120.0, 240.0))
    other = draft(onset_s=800.0, window=(760.0, 880.0))
    one, two = join([weak, strong, other])
    assert one.finding is strong.finding
    assert (one.until_s, two.until_s) == (240.0, 880.0)
    # Strong is what stands out most from its own threshold, not what has the largest number.
    assert join([weak, draft(statistic=90.0, threshold=60.0, window=(120.0, 240.0))])[0].finding is weak.finding


def test_joining_again_changes_nothing():
    drafts = [draft(onset_s=window[0], window=window) for window in random_windows(3)]
    once = join(drafts)
    assert len(once) < len(drafts)
    again = join(once)
    assert [(one.finding, one.window) for one in again] == [(one.finding, one.window) for one in once]


def test_the_most_trusted_analysis_describes_an_event():
    parity, exact = draft(), draft(onset_s=99.0, stage="static relations", magnitude=0.101)
    for drafts in ([parity, exact], [exact, parity]):
        (event,) = merge_stages(drafts)
        assert event.finding is exact.finding
        assert event.also == (parity.finding,)


def test_faults_of_other_channels_at_one_time_are_two_events():
    events = merge_stages([draft(), draft(fault="pitch", onset_s=110.0)])
    assert [event.finding.fault for event in events] == ["tas", "pitch"]
    # Where a set of faults explains a window, one of them in common is enough.
    (one,) = merge_stages(
        [draft(stage="static relations"), draft(fault="aoa", among=("aoa", "tas"), channels=("aoa",))]
    )
    assert one.finding.fault == "tas"


def test_a_fault_after_the_last_window_that_shows_an_event_is_another():
    exact = draft(stage="static relations")
    inside = draft(onset_s=exact.until_s - 1.0, window=(140.0, 260.0))
    after = draft(onset_s=exact.until_s + 10.0, window=(190.0, 310.0))
    assert len(merge_stages([exact, inside])) == 1
    assert len(merge_stages([exact, after])) == 2


def test_onsets_are_no_more_certain_than_they_are():
    exact = draft(onset_s=300.0, window=(240.0, 360.0), stage="static relations")
    early = draft(onset_s=200.0, window=(150.0, exact.from_s - BEFORE_S + 1.0))
    earlier = draft(onset_s=200.0, window=(150.0, exact.from_s - BEFORE_S - 1.0))
    assert len(merge_stages([exact, early])) == 1
    assert len(merge_stages([exact, earlier])) == 2


def test_whatever_disagrees_with_a_held_line_belongs_to_it():
    held = draft(fault="pitot_blocked", channels=("tas", "cas"), stage="holds", shape="pitot_blocked", magnitude=None)
    (event,) = merge_stages([draft(fault="aoa", onset_s=120.0), held])
    assert event.finding.fault == "pitot_blocked"


def test_steps_of_the_airspeed_belong_to_whatever_is_wrong_then():
    step = draft(onset_s=130.0, stage="scan", shape="bias")
    (event,) = merge_stages([draft(fault="pitch"), step])
    assert event.finding.fault == "pitch"
    assert event.also == (step.finding,)


def test_what_is_small_joins_a_fault_and_no_fault_joins_it():
    """A relation is trusted more than a window, but a small disagreement says nothing of an icing of its time."""
    small, ice = draft(stage="static relations", shape="bias"), draft(fault="pitot_icing", channels=("tas", "cas"))
    (event,) = merge_stages([ice], [small])
    assert event.finding is ice.finding
    assert event.also == (small.finding,)
    later = draft(onset_s=900.0, window=(840.0, 960.0))
    assert [one.finding.onset_s for one in merge_stages([later], [small])] == [100.0, 900.0]


def test_events_come_in_order_of_time():
    events = merge_stages([draft(onset_s=900.0, window=(840.0, 960.0), stage="static relations"), draft()])
    assert [event.finding.onset_s for event in events] == [100.0, 900.0]


def test_an_oscillation_ends_where_the_same_frequency_changes_again():
    def wave(onset_s: float, frequency_hz: float, **changes: Any) -> Draft:
        window = (onset_s - 40.0, onset_s + 80.0)
        return draft(onset_s, window, stage="scan", shape="sine", frequency_hz=frequency_hz, **changes)

    begins, ends, other = wave(100.0, 0.300), wave(400.0, 0.305), wave(600.0, 0.5)
    one, two = with_ends([other, ends, begins])
    assert (one.finding.onset_s, one.finding.offset_s, one.until_s) == (100.0, 400.0, 480.0)
    assert (two.finding.onset_s, two.finding.offset_s) == (600.0, None)
    # Begun and ended, the same frequency a third time is a new oscillation; a step has no end of this kind.
    assert [event.finding.offset_s for event in with_ends([begins, ends, wave(900.0, 0.3)])] == [400.0, None]
    assert len(with_ends([draft(stage="scan", shape="bias"), draft(200.0, stage="scan", shape="bias")])) == 2
    assert len(with_ends([begins, wave(400.0, 0.3, fault="pitch")])) == 2


def test_a_sensor_that_fails_further_is_one_event():
    first, later = draft(), draft(900.0, (860.0, 980.0))
    (event,) = as_one([first, later])
    assert (event.finding, event.also, event.until_s) == (first.finding, (later.finding,), 980.0)
    other = draft(900.0, (860.0, 980.0), fault="aoa")
    assert as_one([first, other]) == [first, other]


def test_what_a_relation_says_of_an_airspeed_that_was_overruled_before_is_one_event():
    overruled = draft(fault="cas", stage="sensors", shape="bias", magnitude=None, sd=None, offset_s=None)
    later = draft(500.0, (440.0, 560.0), fault="cas", among=("cas", "altitude"), stage="static relations")
    (event,) = as_one([overruled, later])
    assert (event.finding, event.also) == (overruled.finding, (later.finding,))
    other = draft(500.0, (440.0, 560.0), fault="aoa", stage="static relations")
    assert as_one([overruled, other]) == [overruled, other]


def test_what_is_only_suspected_takes_no_fault_in():
    suspect, fault = draft(doubt="a turn"), draft(900.0, (860.0, 980.0), statistic=90.0)
    assert as_one([suspect, fault]) == [suspect, fault]


def test_a_step_back_is_the_end_and_what_follows_another_event():
    step = {"stage": "static relations", "shape": "bias", "unit": "m/s", "sd": 0.05}
    up, down = draft(magnitude=2.0, **step), draft(500.0, (460.0, 580.0), magnitude=-1.95, **step)
    again = draft(900.0, (860.0, 980.0), magnitude=1.0, **step)
    ended, other = as_one([up, down, again])
    assert ended.finding.offset_s == 500.0
    assert other == again
    half = draft(500.0, (460.0, 580.0), magnitude=-1.0, **step)
    assert as_one([up, half])[0].finding.offset_s is None


def test_an_oscillation_of_a_channel_that_errs_belongs_to_its_error():
    relation = draft(stage="static relations")
    swing = draft(stage="scan", shape="sine", frequency_hz=0.4)
    assert len(merge_stages([relation, swing])) == 1
    of_all = draft(stage="scan", shape="sine", frequency_hz=0.4, fault="pitot_water")
    assert len(merge_stages([relation, of_all])) == 2


def step(magnitude: float, onset_s: float, fault: str = "aoa", **changes: Any) -> Finding:
    return draft(onset_s, **{"fault": fault, "shape": "bias", "magnitude": magnitude, "sd": 0.01, **changes}).finding


@pytest.mark.parametrize(
    ("later", "earlier", "returns"),
    [
        (step(-1.0, 200.0), step(1.0, 100.0), True),
        (step(-0.95, 200.0), step(1.0, 100.0), True),
        (step(-0.95, 200.0, shape="ramp_hold", constant_s=10.0), step(1.0, 100.0), True),
        (step(-0.7, 200.0), step(1.0, 100.0), False),
        (step(-0.7, 200.0, sd=0.2), step(1.0, 100.0), True),
        (step(-0.4, 200.0, sd=2.0), step(1.0, 100.0), False),  # no interval makes less than half of it a return
        (step(1.0, 200.0), step(1.0, 100.0), False),
        (step(-1.0, 100.0), step(1.0, 200.0), False),
        (step(-1.0, 200.0, fault="pitch"), step(1.0, 100.0), False),
        (step(-1.0, 200.0, shape="drift"), step(1.0, 100.0), False),
        # By what it has grown to: a drift of 0.02 a second is 2 after 100 s.
        (step(-2.0, 200.0), step(0.02, 100.0, shape="drift", sd=0.0), True),
        (step(-2.0, 300.0), step(0.02, 100.0, shape="drift", sd=0.0), False),
        # A line that has lost a fifth of its pressure gains a quarter of what is left.
        (step(0.25, 200.0, fault="q_impact"), step(0.002, 100.0, fault="pitot_icing", shape="drift", sd=0.0), True),
        (step(0.15, 200.0, fault="q_impact"), step(0.002, 100.0, fault="pitot_icing", shape="drift", sd=0.0), False),
    ],
)
def test_a_return_is_a_step_back_by_what_the_fault_has_grown_to(later: Finding, earlier: Finding, returns: bool):
    assert is_return(later, earlier) is returns
    assert not is_return(later, replace(earlier, offset_s=150.0))


def test_a_fault_is_in_the_windows_between_its_onset_and_its_end():
    vane = LastingFault(faults=("aoa",), begun_s=98.0, from_s=102.0, until_s=210.0)
    windows = [(40.0, 100.0), (100.0, 160.0), (102.0, 222.0), (200.0, 260.0), (210.0, 270.0)]
    assert [vane.is_in(window) for window in windows] == [False, False, True, True, False]
    assert replace(vane, until_s=np.inf).is_in((1e6, 2e6))


def test_an_event_is_certain_above_its_threshold():
    one, less = draft(statistic=30.0 * 1.01), draft(statistic=30.0 * 0.99)
    assert is_certain(one)
    assert not is_certain(less)
    assert not is_certain(replace(one, finding=replace(one.finding, stage="scan", doubt="flaps may move")))


def test_of_two_relations_that_show_one_step_the_one_that_knows_its_size_better_describes_it():
    rough, exact = (
        draft(fault="altitude", stage="static relations", shape="bias", magnitude=size, sd=sd, onset_s=onset_s)
        for size, sd, onset_s in ((-56.0, 2.0, 99.5), (-60.0, 0.1, 100.0))
    )
    for drafts in ([rough, exact], [exact, rough]):
        (event,) = merge_stages(drafts)
        assert event.finding.magnitude == -60.0
        assert [one.magnitude for one in event.also] == [-56.0]


@pytest.mark.parametrize(("until_s", "explained"), [(85.5, True), (84.5, False)])
def test_what_was_seen_up_to_fifteen_seconds_before_an_event_is_of_it(until_s: float, explained: bool):
    """Twice the standard deviation that the Cramer-Rao bound leaves the onset of a drift in four minutes."""
    earlier = replace(draft(60.0, (20.0, 80.0)), until_s=until_s)
    assert explains(draft(100.0, onset_ci95=(100.0, 103.0)), earlier) == explained


@pytest.mark.parametrize(
    ("back", "sd", "is_end"),
    [
        (-3.61, 0.01, True),
        (-3.59, 0.01, False),  # a tenth of it may be left
        (-3.41, 0.2, True),
        (-3.39, 0.2, False),  # three standard deviations where they are more
        (-2.01, 5.0, True),
        (-1.99, 5.0, False),  # never more than a half
    ],
)
def test_a_step_back_misses_where_it_came_from_by_little(back: float, sd: float, is_end: bool):
    step = draft(100.0, shape="bias", magnitude=4.0, sd=0.0).finding
    returned = draft(200.0, shape="bias", magnitude=back, sd=sd).finding
    assert is_return(returned, step) == is_end


@pytest.mark.parametrize(("ends_hz", "n"), [(0.2095, 1), (0.2105, 2)])
def test_an_oscillation_ends_with_its_own_frequency(ends_hz: float, n: int):
    """Of two peaks of two minutes' windows, which are a twentieth of the frequency wide."""
    swings = [draft(t, (t - 40.0, t + 80.0), shape="sine", frequency_hz=f) for t, f in ((100.0, 0.2), (300.0, ends_hz))]
    assert len(with_ends(swings)) == n
