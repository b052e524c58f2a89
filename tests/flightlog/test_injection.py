"""Injected faults: exact recovery, linearity, accumulation, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noted import texts

from bfi_cli.errors import DictionaryError, LogError
from bfi_cli.faults import Fault, unit_signal
from bfi_cli.flightlog import inject
from bfi_cli.flightlog.record import Channel, FlightLog, frozen_array

START, STOP = 100.0, 110.0
BIAS = Fault(shape="bias", magnitude=4.0, onset_s=105.0)
SINE = Fault(shape="sine", magnitude=2.0, frequency_hz=1.15, onset_s=103.0, phase_reference="window")

faults = st.builds(
    Fault,
    shape=st.sampled_from(["bias", "drift"]),
    channel=st.sampled_from(["tas", "aoa"]),
    magnitude=st.floats(0.01, 10.0),
    onset_s=st.floats(START - 5.0, STOP - 1.0),
)


def log_of(seed: int = 0, n: int = 200) -> FlightLog:
    noise = np.random.default_rng(seed).standard_normal((2, n))
    signals = {"tas": (100.0 + noise[0], "m/s", "vtas"), "aoa": (0.01 * noise[1], "rad", "alpha")}
    return FlightLog(
        path="flight.h5",
        time_s=frozen_array(np.linspace(START, STOP, n, endpoint=False)),
        channels={
            name: Channel(name=name, values=frozen_array(values), unit=unit, source=source)
            for name, (values, unit, source) in signals.items()
        },
        sha256="0" * 64,
    )


def added(faulty: FlightLog, clean: FlightLog, channel: str = "tas") -> np.ndarray:
    return faulty.channel(channel).values - clean.channel(channel).values


def test_what_is_added_is_magnitude_times_the_unit_signal_on_the_logs_time_axis():
    log = log_of()
    signal = added(inject(log, [BIAS]), log)
    np.testing.assert_allclose(signal, np.where(log.time_s >= 105.0, 4.0, 0.0), rtol=0, atol=1e-12)


def test_a_window_phase_counts_from_the_first_sample():
    log = log_of()
    expected = np.where(log.time_s >= 103.0, 2.0 * np.sin(2.0 * np.pi * 1.15 * (log.time_s - START)), 0.0)
    np.testing.assert_allclose(added(inject(log, [SINE]), log), expected, rtol=0, atol=1e-12)


@given(first=faults, second=faults)
def test_faults_superpose_and_two_steps_are_one(first: Fault, second: Fault):
    log = log_of()
    both = inject(log, [first, second])
    again = inject(inject(log, [first]), [second])
    assert both.truth is not None
    assert again.truth is not None
    assert again.truth.faults == both.truth.faults == (first, second)
    for name in ("tas", "aoa"):
        np.testing.assert_array_equal(again.channel(name).values, both.channel(name).values)
        parts = added(inject(log, [first]), log, name) + added(inject(log, [second]), log, name)
        np.testing.assert_allclose(added(both, log, name), parts, rtol=0, atol=1e-11)


@given(several=st.lists(faults, min_size=1, max_size=4))
def test_measured_is_clean_plus_the_true_faults(several: list[Fault]):
    log = log_of()
    faulty = inject(log, several)
    assert faulty.truth is not None
    assert set(faulty.truth.clean) == {fault.channel for fault in several}
    for name, clean in faulty.truth.clean.items():
        np.testing.assert_array_equal(clean, log.channel(name).values)
        true = sum(
            fault.magnitude * unit_signal(fault, log.time_s, window_start_s=START)
            for fault in faulty.truth.faults
            if fault.channel == name
        )
        np.testing.assert_allclose(faulty.channel(name).values, clean + true, rtol=0, atol=1e-11)


def test_opposite_faults_cancel_but_stay_in_the_truth():
    log = log_of()
    faulty = inject(log, [BIAS, Fault(shape="bias", magnitude=-4.0, onset_s=105.0)])
    np.testing.assert_allclose(added(faulty, log), 0.0, rtol=0, atol=1e-12)
    assert faulty.truth is not None
    assert [fault.magnitude for fault in faulty.truth.faults] == [4.0, -4.0]


def test_other_channels_and_the_original_log_are_left_alone():
    log = log_of()
    before = log.channel("tas").values.copy()
    faulty = inject(log, [BIAS])
    assert faulty.channel("aoa") is log.channel("aoa")
    np.testing.assert_array_equal(log.channel("tas").values, before)
    assert log.truth is None
    assert not faulty.channel("tas").values.flags.writeable


def test_a_changed_log_does_not_carry_the_digest_of_the_file():
    assert inject(log_of(), [BIAS]).sha256 == ""


def test_no_fault_changes_nothing():
    log = log_of()
    assert inject(log, []) is log


def test_the_name_in_the_file_finds_the_channel_and_the_truth_has_the_standard_one():
    faulty = inject(log_of(), [Fault(shape="bias", channel="vtas", onset_s=105.0)])
    assert faulty.truth is not None
    assert faulty.truth.faults[0].channel == "tas"
    assert set(faulty.truth.clean) == {"tas"}


def test_a_missing_channel_is_an_error_of_the_log():
    with pytest.raises(LogError, match=r"flight\.h5: no channel 'cas'; the log has: aoa, tas; map one with --channel"):
        inject(log_of(), [Fault(shape="bias", channel="cas", onset_s=105.0)])


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (
            Fault(shape="bias", magnitude=4.0, onset_s=120.0),
            "flight.h5: fault 'bias': never active in the log, got magnitude 4 from 120 s, "
            "the log runs from 100 s to 109.95 s; change onset, offset or magnitude",
        ),
        (
            Fault(shape="bias", name="early", onset_s=20.0, offset_s=100.0),
            "flight.h5: fault 'early': never active in the log, got magnitude 1 from 20 s until 100 s, "
            "the log runs from 100 s to 109.95 s; change onset, offset or magnitude",
        ),
        (
            Fault(shape="drift", magnitude=0.0, onset_s=101.0),
            "flight.h5: fault 'drift': never active in the log, got magnitude 0 from 101 s, "
            "the log runs from 100 s to 109.95 s; change onset, offset or magnitude",
        ),
    ],
)
def test_a_fault_that_never_acts_in_the_log_is_refused(fault: Fault, message: str):
    with pytest.raises(DictionaryError) as caught:
        inject(log_of(), [fault])
    assert str(caught.value) == message


def test_a_fault_that_acts_at_one_sample_only_is_accepted():
    log = log_of()
    signal = added(inject(log, [Fault(shape="bias", onset_s=105.0, offset_s=105.05)]), log)
    assert np.count_nonzero(signal) == 1


def test_a_fault_without_onset_or_end_in_the_log_is_noted():
    once = inject(log_of(), [BIAS])
    always = inject(once, [Fault(shape="drift", onset_s=50.0)])
    assert texts(once.notes) == ()
    assert texts(always.notes) == (
        "fault 'drift' on tas acts at every sample of the log; with neither onset nor end in it, "
        "it can pass for the aircraft's own motion",
    )
    assert texts(inject(always, [BIAS]).notes) == texts(always.notes)
