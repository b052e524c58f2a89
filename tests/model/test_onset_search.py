"""Faults that begin within the tolerance of the dictionary's onset: found where they begin, and not at any price."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.flightlog import inject
from bfi_cli.model import identify_faults
from bfi_cli.model.maximum_likelihood import select
from bfi_cli.model.preprocessing.signals import decimate_native
from bfi_cli.model.preprocessing.window import (
    prepare_window,
    regression_of,
    shifts_within,
    signals_of_faults,
    with_onsets,
)
from bfi_cli.model.selection import move_entry

MOVING = merge(Config(), {"model.order": 5})
EXACT = merge(MOVING, {"onset_tolerance_s": 0.0})


def late(log, thesis, name, magnitude, shift_s):
    """Return the log with an entry of the dictionary that begins later."""
    atom = next(one for one in thesis.resolved(float(log.time_s[0])) if one.name == name)
    return inject(log, [replace(atom, magnitude=magnitude, onset_s=atom.onset_s + shift_s)])


@pytest.mark.first_rows(1)
@pytest.mark.parametrize("shift_s", [-0.43, 0.9])
def test_a_step_beside_its_onset_is_found_where_it_begins(flight, thesis, shift_s):
    log = late(flight(3), thesis, "bias_13.8", 2.0, shift_s)
    (fault,) = identify_faults(log, thesis, MOVING).faults
    assert fault.name == "bias_13.8"
    assert fault.fault.onset_s == pytest.approx(13.8 + shift_s, abs=0.06)
    assert abs(fault.magnitude - 2.0) < 4.0 * fault.sd


def test_a_step_at_its_onset_stays_there(flight, thesis):
    log = late(flight(3), thesis, "bias_13.8", 2.0, 0.0)
    moving, exact = (identify_faults(log, thesis, config) for config in (MOVING, EXACT))
    assert [one.fault for one in moving.faults] == [one.fault for one in exact.faults]
    assert [one.magnitude for one in moving.faults] == [one.magnitude for one in exact.faults]


@pytest.mark.slow
def test_a_record_without_a_fault_is_answered_as_with_exact_onsets(flight, thesis):
    moving, exact = (identify_faults(flight(1), thesis, config) for config in (MOVING, EXACT))
    assert moving.faults == exact.faults == ()
    for one, other in zip(moving.candidates, exact.candidates, strict=True):
        assert one.magnitude == other.magnitude
        assert one.minimal_detectable >= other.minimal_detectable


def test_onsets_lie_within_the_tolerance_and_the_window(flight, thesis):
    window = prepare_window(flight(1), thesis, Config())
    for entry in window.live:
        shifts = shifts_within(window, entry, 1.0)
        assert np.all(np.abs(shifts) <= 1.0 + 1e-9)
        assert np.all(shifts != 0.0)
        assert np.all(np.abs(np.round(shifts * window.native.rate_hz) - shifts * window.native.rate_hz) < 1e-6)
        assert shifts_within(window, entry, 0.0).size == 0


def test_a_shifted_entry_has_the_signal_of_its_fault(flight, thesis):
    window = prepare_window(flight(1), thesis, Config())
    entry = window.names.index("bias_13.8")
    fault = window.faults[entry]
    theta = np.asarray(signals_of_faults(window, [fault, fault.later(0.5)]))
    np.testing.assert_array_equal(theta[:, :, 0], np.asarray(window.signals.theta)[:, :, entry])
    moved = with_onsets(window, {entry: 0.5})
    np.testing.assert_array_equal(theta[:, :, 1], np.asarray(moved.signals.theta)[:, :, entry])
    assert moved.faults[entry].onset_s == pytest.approx(14.3)
    native = moved.native.theta_between(slice(None))[:, 0, entry]
    assert moved.largest[entry] == np.abs(native).max()
    first = int(np.flatnonzero(native)[0])
    assert window.native.time_s[first] == pytest.approx(14.3)


@pytest.mark.parametrize(("shift_s", "rate"), [(0.5, "none"), (-0.7, 5.0), (0.5, 7.0)])
def test_a_share_of_the_reading_stays_one_when_it_begins_later(flight, shift_s, rate):
    """Also where the window is resampled, by which a rate that is no part of the log's own is reached."""
    entries = load_dictionary({"relative_to": "window", "atoms": [{"shape": "scale", "onset_s": 12.0}]})
    config = merge(Config(), {"conditioning.rate_hz": rate})
    window = prepare_window(flight(1), entries, config)
    moved = with_onsets(window, {0: shift_s})
    native = moved.native.theta_between(slice(None))[:, 0, 0]
    since_s = moved.native.time_s - moved.faults[0].onset_s + 1e-9
    wanted = np.where(since_s >= 0.0, window.log.channel("tas").values, 0.0)
    clear = np.abs(since_s) > (0.0 if rate != 7.0 else 2.0)  # of the filter that resampling needs
    np.testing.assert_allclose(native[clear], wanted[clear], rtol=1e-9)
    again, largest = decimate_native(moved.native, moved.signals.factor, moved.lowpass)
    np.testing.assert_allclose(again.theta, moved.signals.theta, rtol=1e-9)
    np.testing.assert_allclose(largest, moved.largest, rtol=1e-9)


@pytest.mark.parametrize("shift_s", [-0.9, 0.6])
def test_an_entry_that_is_not_declared_is_moved_to_its_best_other_onset(flight, thesis, shift_s):
    """Whether that pays beside the stated onset or not: it is held against no fault."""
    log = late(flight(3), thesis, "bias_13.8", 2.0, shift_s)
    window = prepare_window(log, thesis, Config())
    regression = regression_of(window, Config())
    choose = partial(select, rules=Config().selection)
    entry = [window.names[one] for one in window.live].index("bias_13.8")
    at_stated = choose(window, regression)
    moved = move_entry(at_stated, entry, at_stated, Config(), choose)
    assert moved is not None
    assert moved.shifts_s == {entry: pytest.approx(shift_s, abs=0.06)}
    assert moved.prices[entry] > 0.0
    assert entry in moved.best.atoms
    assert move_entry(moved, entry, at_stated, Config(), choose) is None
    assert move_entry(at_stated, entry, at_stated, EXACT, choose) is None
