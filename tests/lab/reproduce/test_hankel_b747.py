"""Paper H, figure 1: every failure at its very sample, a million times above the healthy channels."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest

from bfi_cli.aircraft.catalogue import B747
from bfi_cli.lab.reproduce.catalogue import reproduce_content, reproduce_document
from bfi_cli.lab.reproduce.hankel_b747 import (
    COUPLED,
    DIAGONAL,
    FAILURES,
    KINDS,
    N_SAMPLES,
    ONSET,
    RATE_HZ,
    WIDTH,
    blamed,
    fly,
)
from bfi_cli.report.content import ReportContent
from bfi_cli.serialization import provenance, to_plain

BAR = 1e6
lastings = pytest.mark.parametrize("lasting", KINDS.values(), ids=list(KINDS))
failures = pytest.mark.parametrize("failure", FAILURES, ids=lambda one: "+".join(one[1]))


def test_the_failures_are_those_of_the_paper():
    assert [k / RATE_HZ for k, _ in FAILURES] == [0.10, 0.15, 0.20, 0.25, 0.30, 0.35, 0.40]
    single = [names[0] for _, names in FAILURES[:-1]]
    assert tuple(single) == B747.outputs
    assert FAILURES[-1][1] == ("tas_rate", "pitch_rate")
    assert WIDTH == 10


@failures
@lastings
def test_a_failure_alone_is_flagged_at_its_very_sample_a_million_times_above_the_rest(failure, lasting):
    case = fly([failure], lasting=lasting)
    assert case.flagged == {(failure[0], name) for name in failure[1]}
    print(f"{failure[1]}: {case.ratio(failure):.1e} at the sample")
    assert case.ratio(failure) >= BAR


@lastings
def test_all_failures_in_one_flight_are_flagged_at_their_very_samples_and_nothing_else(lasting):
    case = fly(FAILURES, lasting=lasting)
    assert case.flagged == case.expected
    ratios = [case.ratio(failure) for failure in FAILURES]
    print(f"lasting {lasting}: {min(ratios):.1e} to {max(ratios):.1e}")
    assert min(ratios) >= BAR


@failures
@lastings
def test_a_single_failure_blames_no_healthy_channel_while_it_is_in_the_window(failure, lasting):
    case = fly([failure], lasting=lasting)
    if len(failure[1]) == 1:
        assert min(case.ratio(failure, after=after) for after in range(6)) >= BAR


@lastings
def test_the_criterion_is_ready_within_ten_samples_as_in_the_paper_after_seven(lasting):
    found = fly(FAILURES, lasting=lasting).null_space
    assert found.ready == 7
    assert np.isnan(found.channel[:6]).all()
    assert np.isfinite(found.channel[6:]).all()


def test_without_a_failure_every_channel_is_at_round_off():
    case = fly([], lasting=1)
    assert case.flagged == set()
    assert np.nanmax(case.null_space.channel) < 1e-11


def test_a_failure_of_a_redundant_channel_blames_nobody_even_with_moving_elevators():
    """Vz = 92.6 (theta - alpha): two of them give the third, so that the healthy rows still span all motion."""
    i = np.arange(N_SAMPLES)
    elevators = 0.05 * (np.sin(0.3 * i) + np.sin(0.9 * i) + np.sin(1.7 * i))
    rest = {}
    for failure in FAILURES[:-1]:
        case = fly([failure], lasting=N_SAMPLES, elevators=elevators)
        rest[failure[1][0]] = max(case.levels(failure, after=after)[1] for after in range(WIDTH))
    assert max(rest[name] for name in ("aoa", "pitch", "altitude_rate")) < 1e-13
    assert max(rest[name] for name in ("pitch_rate", "tas_rate")) > 1e-9


def test_condition_30_tells_whether_a_healthy_channel_is_blamed_later():
    one = (0.9, 1.0)
    coupled, diagonal = blamed(COUPLED, one), blamed(DIAGONAL, one)
    assert coupled[0, 0] > 1e-4
    assert coupled[0, 1] < 1e-11 < 1e-4 < coupled[1, 1]
    assert diagonal[:, 1].max() < 1e-11 < 1e-4 < diagonal[0, 0]
    assert blamed(COUPLED, (0.9, 0.9)).min() > 1e-4


def test_two_failures_that_cannot_be_seen():
    """Wrong from the start there is no healthy past; with a first input the null vectors leave the last column out."""
    assert blamed(COUPLED, (0.9, 1.0), onset=0).max() < 1e-11
    first = blamed(COUPLED, (0.9, 1.0), step=ONSET)
    assert first[0].max() < 1e-11 < 1e-6 < first[1].min()


def test_the_content_says_so_and_comes_back_from_its_document(made: Callable[[str], ReportContent]):
    content = made("hankel-b747")
    assert content.heading == "Every failure localised"
    assert content.tables[0].name == "comparison"
    assert content.tables[0].rows[0] == ("samples before the criterion can be formed", "7 (example)", "7")
    document = json.loads(json.dumps(reproduce_document("hankel-b747", content, provenance(log_sha256=""))))
    assert to_plain(reproduce_content(document)) == to_plain(content)


def test_the_tables_have_a_row_per_failure_and_the_drawings_log_axes(made: Callable[[str], ReportContent]):
    content = made("hankel-b747")
    for table in content.tables[1:3]:
        assert len(table.rows) == len(KINDS) * len(FAILURES)
        assert [row[2] for row in table.rows] == [row[3] for row in table.rows]
        assert min(float(row[6]) for row in table.rows) >= BAR
    assert [drawing.name for drawing in content.drawings] == ["hankel_b747", "hankel_b747_persistent"]
    assert all(panel.log_y and len(panel.curves) == 6 for one in content.drawings for panel in one.panels)
