"""Declared against injected faults: the same for identify and montecarlo."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.faults import Fault, FaultEstimate
from bfi_cli.faults.fault import compare_by_onset, compare_faults

FAULTS = st.dictionaries(st.sampled_from("abcd"), st.floats(0.1, 9.0))


@given(FAULTS, FAULTS)
def test_false_alarms_are_missed_the_other_way_round(declared, injected):
    there, back = compare_faults(declared, injected), compare_faults(injected, declared)
    assert (set(there.false_alarms), set(there.missed)) == (set(back.missed), set(back.false_alarms))
    assert there.isolated == back.isolated == (set(declared) == set(injected))


@given(FAULTS)
def test_the_same_faults_are_isolated_without_error_and_none_declared_is_an_error_of_one(faults):
    same, none = compare_faults(faults, faults), compare_faults({}, faults)
    assert same.isolated
    assert same.magnitude_error == (0.0 if faults else None)
    assert none.magnitude_error == (pytest.approx(1.0) if faults else None)


def test_the_magnitude_error_counts_absent_faults_as_zero():
    one = compare_faults({"a": 3.0, "c": 1.2}, {"a": 3.0, "b": 4.0})
    assert (one.false_alarms, one.missed) == (("c",), ("b",))
    assert one.magnitude_error == pytest.approx((4.0**2 + 1.2**2) ** 0.5 / 5.0)


def test_a_fault_that_is_no_entry_is_missed_and_leaves_no_magnitude_error():
    one = compare_faults({"a": 3.0}, {"a": 3.0}, unknown=["gust"])
    assert (one.isolated, one.missed, one.magnitude_error) == (False, ("gust",), None)


def estimate(name: str, onset_s: float, magnitude: float) -> FaultEstimate:
    fault = Fault(shape="bias", onset_s=onset_s)
    values = {"physical_value": magnitude, "physical_unit": "", "sd": 0.0, "ci95": (magnitude, magnitude)}
    return FaultEstimate(name=name, fault=fault, magnitude=magnitude, unit="", **values)


def test_a_declared_fault_is_the_injected_one_within_the_tolerance_of_the_onset_and_not_beyond():
    declared, injected = [estimate("bias_10", 10.0, 3.0)], [Fault(shape="bias", onset_s=10.2, magnitude=4.0)]
    near = compare_by_onset(declared, injected, tolerance_s=0.21)
    assert (near.isolated, near.magnitude_error) == (True, pytest.approx(0.25))
    far = compare_by_onset(declared, injected, tolerance_s=0.19)
    assert (far.false_alarms, far.missed) == (("bias_10",), ("bias, channel=tas, onset_s=10.2",))
    assert far.magnitude_error is None


def test_one_declared_fault_stands_for_one_injected_fault():
    declared = [estimate("bias_10", 10.0, 3.0)]
    two = [Fault(shape="bias", onset_s=10.0, magnitude=3.0), Fault(shape="bias", onset_s=10.1, name="second")]
    assert compare_by_onset(declared, two, tolerance_s=0.2).missed == ("second",)
    assert not compare_by_onset(declared, two, tolerance_s=0.2).isolated
