"""What an answer holds: shapes, comparison with the truth, what cannot be answered, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from noted import texts

from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import ConfigError, DictionaryError, ExcitationError, LogError
from bfi_cli.faults import Fault
from bfi_cli.flightlog import inject
from bfi_cli.kernels.progress import Termination
from bfi_cli.model import identify_faults
from bfi_cli.model import result as results
from bfi_cli.model.result import identify_document, identify_from_document
from bfi_cli.quantities.text import SI
from bfi_cli.report.first_screen import candidate_lines
from bfi_cli.serialization import provenance

# Without what takes most of the time: the search for an order, and limits for onsets known to a tolerance only.
SETTINGS = {"model": {"order": 5}, "onset_tolerance_s": 0.0}
QUICK = Config.model_validate(SETTINGS)


@pytest.fixture(scope="module")
def result(flight, thesis, faulty):
    """Return an answer with two faults, default settings."""
    return identify_faults(faulty(flight(1), thesis, {"bias_13.8": 3.0, "sine_1.15": 1.0}), thesis, Config())


def test_series_have_the_length_of_the_window_and_add_up(result):
    n = result.log.n_samples
    (series,) = result.outputs
    assert result.time_s.shape == (n,)
    assert result.log.start_s == result.time_s[0]
    assert result.log.stop_s == result.time_s[-1]
    assert {name: u.shape for name, u in result.inputs.items()} == {"elevator": (n,)}
    for name in (
        "measured",
        "corrected",
        "predicted",
        "fault",
        "fault_sd",
        "prediction_error",
        "plain_residual",
        "true_fault",
    ):
        assert getattr(series, name).shape == (n,)
    np.testing.assert_allclose(series.corrected + series.fault, series.measured, rtol=1e-12)
    blank = np.isnan(series.prediction_error)
    np.testing.assert_array_equal(blank, np.isnan(series.predicted))
    np.testing.assert_array_equal(blank, np.arange(n) < max(result.model.orders))
    np.testing.assert_allclose((series.predicted + series.prediction_error - series.measured)[~blank], 0, atol=1e-10)
    assert series.measured.mean() == pytest.approx(100.0, abs=10.0)


def test_the_fault_signal_is_the_injected_one_within_its_deviation(result):
    (series,) = result.outputs
    active = series.fault_sd > 1e-6
    assert active.sum() > 150
    assert np.abs((series.fault - series.true_fault)[active] / series.fault_sd[active]).max() < 5
    before = result.time_s < 6.0
    np.testing.assert_allclose(series.fault[before], 0.0, atol=1e-9)


def test_the_prediction_error_has_the_stated_noise(result):
    (series,) = result.outputs
    assert np.nanstd(series.prediction_error) == pytest.approx(result.model.noise_sd["tas"], rel=0.01)
    assert np.nanstd(series.plain_residual) > np.nanstd(series.prediction_error)
    assert 0 < result.model.noise_sd["tas"] < 0.02


def test_candidates_are_the_dictionary_in_its_order(result, thesis):
    assert [candidate.name for candidate in result.candidates] == [atom.name for atom in thesis.atoms]
    assert {candidate.name for candidate in result.candidates if candidate.state == "declared"} == {
        "bias_13.8",
        "sine_1.15",
    }
    active = {candidate.name: candidate for candidate in result.candidates}
    for fault in result.faults:
        assert (active[fault.name].magnitude, active[fault.name].sd) == (fault.magnitude, fault.sd)


def test_order_curves_have_one_value_per_order(result):
    model = result.model
    assert model.orders == (2, 4, 6, 8, 12)
    assert len(model.criterion_no_fault) == len(model.criterion_best) == 5
    assert np.all(np.array(model.criterion_best) <= np.array(model.criterion_no_fault))
    assert model.order == model.orders[int(np.argmin(model.criterion_best))]


def test_residual_summary(result):
    (summary,) = result.residuals
    assert summary.channel == "tas"
    assert len(summary.lags) == len(summary.autocorrelation) <= 40
    assert summary.band == pytest.approx(1.96 / np.sqrt(result.log.n_samples - 12))
    assert 0 <= summary.ljung_box_p <= 1
    assert any(abs(time - 13.8) < 0.3 for time in summary.plain_alarms_s)


@pytest.mark.parametrize("most", [10_000, 317, 100])
def test_the_series_of_a_long_record_are_thinned_in_the_document_only(result, monkeypatch, most):
    monkeypatch.setattr(results, "MOST_SAMPLES", most)
    made = identify_document(result, provenance(log_sha256=""))
    series, k = made["series"], -(-result.log.n_samples // most)
    assert series["time_s"] == result.time_s[::k].tolist()
    assert len(series["time_s"]) <= most
    assert series["inputs"]["elevator"] == result.inputs["elevator"][::k].tolist()
    assert series["outputs"][0]["measured"] == result.outputs[0].measured[::k].tolist()
    said = [note for note in texts(made["notes"]) if note.startswith("the series of this document hold")]
    assert len(said) == (k > 1)
    again, _ = identify_from_document(made)
    assert again.faults == result.faults
    assert again.log.n_samples == result.log.n_samples == len(result.time_s)


def test_arrays_are_read_only(result):
    (series,) = result.outputs
    with pytest.raises(ValueError, match="read-only"):
        series.fault[0] = 1.0


def test_the_log_is_left_alone_and_the_answer_repeats_to_the_bit(flight, thesis, faulty):
    log = faulty(flight(1), thesis, {"bias_13.8": 3.0})
    before = {name: channel.values.copy() for name, channel in log.channels.items()}
    one, other = (identify_faults(log, thesis, QUICK) for _ in range(2))
    for name, values in before.items():
        np.testing.assert_array_equal(log.channel(name).values, values)
    assert one.faults == other.faults
    assert texts(one.notes) == texts(other.notes)


def test_a_missed_fault_and_a_false_alarm_are_named(flight, thesis, faulty):
    log = faulty(flight(1), thesis, {"bias_13.8": 3.0})
    without = replace(thesis, atoms=tuple(atom for atom in thesis.atoms if atom.name != "bias_13.8"))
    truth = identify_faults(log, without, QUICK).truth
    assert not truth.isolated
    assert truth.missed == ("bias_13.8",)
    assert truth.magnitude_error is None


def test_a_fault_too_small_is_missed_and_no_other_is_declared(flight, thesis, faulty):
    result = identify_faults(faulty(flight(1), thesis, {"sine_0.35": 1e-4}), thesis, QUICK)
    assert result.faults == ()
    (sine,) = (one for one in result.candidates if one.name == "sine_0.35")
    assert (sine.state, sine.effect > 1e-4) == ("excluded", True), "excluded down to a size that is stated"
    assert result.truth.missed == ("sine_0.35",)
    assert result.truth.magnitude_error == pytest.approx(1.0)
    assert result.truth.vaf_fault["tas"] == 0.0


def test_truth_of_another_name_and_sign_is_recognised_by_its_signal(flight, thesis):
    other = Fault(name="mine", shape="bias", channel="tas", onset_s=13.8, magnitude=-3.0)
    truth = identify_faults(inject(flight(1), [other]), thesis, QUICK).truth
    assert truth.isolated
    assert truth.magnitude_error < 0.01


def test_two_injections_of_one_entry_add_up(flight, thesis, faulty):
    log = faulty(faulty(flight(1), thesis, {"bias_13.8": 1.0}), thesis, {"bias_13.8": 2.0})
    truth = identify_faults(log, thesis, QUICK).truth
    assert truth.isolated
    assert truth.magnitude_error < 0.01


def test_truth_is_recognised_at_a_resampled_rate(flight, thesis, faulty):
    """Resampling moves the first sample; a phase that counts from the window's start does not move with it."""
    config = Config.model_validate({**SETTINGS, "conditioning": {"rate_hz": 12.7}})
    truth = identify_faults(faulty(flight(1), thesis, {"sine_2.25": 3.0}), thesis, config).truth
    assert "sine_2.25" not in (*truth.missed, *truth.false_alarms)


def test_an_injection_taken_back_is_no_fault(flight, thesis, faulty):
    log = faulty(faulty(flight(1), thesis, {"bias_13.8": 3.0}), thesis, {"bias_13.8": -3.0})
    result = identify_faults(log, thesis, QUICK)
    assert result.faults == ()
    assert result.truth.isolated
    assert result.truth.magnitude_error is None


def test_a_fault_that_was_there_before_the_window_cannot_be_answered(flight):
    """The constant absorbs a bias, and lags absorb an oscillation; what cannot be seen is said, not guessed."""
    old = load_dictionary({"channel": "tas", "atoms": [{"name": "old", "shape": "bias", "onset_s": 0.05}]})
    log = inject(flight(1), [replace(atom, magnitude=3.0) for atom in old.atoms])
    result = identify_faults(log, old, QUICK)
    assert result.decision == "inconclusive"
    assert "this window cannot tell" in texts(result.notes)[0]
    assert result.candidates[0].state is None
    assert "too near an end" in result.candidates[0].note


@pytest.mark.slow
def test_an_entry_near_an_end_narrows_the_claim_and_does_not_void_it(flight):
    """Before, it made "a step of any size" of every window."""
    config = merge(Config(), {"conditioning.rate_hz": 5.0, "model.order": 3})
    entries = [{"name": f"at_{s}", "shape": "bias", "onset_s": s} for s in (10, 20, 0.3, 31.5)]
    few, all_ = (load_dictionary({"channel": "tas", "atoms": entries[:n]}) for n in (2, 4))
    narrow, wide = (identify(flight(1), one, config)[0] for one in (few, all_))
    assert narrow.verdicts["abrupt"] == wide.verdicts["abrupt"] == "no_fault"
    assert [one.state for one in wide.candidates[:4]] == ["excluded", "excluded", None, None]
    assert {one.note for one in wide.candidates[2:4]} == {"too near an end of the window"}
    unchecked = [candidate_lines(one.candidates, SI)["Not checked"] for one in (narrow, wide)]
    assert [any("entries start" in part for part in parts) for parts in unchecked] == [False, True]


def test_dead_constant_and_repeated_entries_are_left_out_and_named(flight, thesis, faulty):
    extra = [
        Fault(name="late", shape="bias", channel="tas", onset_s=40.0),
        Fault(name="always", shape="bias", channel="tas", onset_s=0.0),
        Fault(name="twin", shape="bias", channel="tas", onset_s=13.8),
        Fault(name="elsewhere", shape="bias", channel="aoa", onset_s=13.8),
    ]
    larger = replace(thesis, atoms=(*thesis.atoms, *extra))
    log = faulty(flight(1), thesis, {"bias_13.8": 3.0})
    one, other = identify_faults(log, thesis, QUICK), identify_faults(log, larger, QUICK)
    assert [fault.name for fault in other.faults] == ["bias_13.8"]
    assert other.faults[0].magnitude == pytest.approx(one.faults[0].magnitude, rel=1e-6)
    assert other.truth.isolated
    notes = {candidate.name: candidate.note for candidate in other.candidates}
    assert "after the window ends" in notes["late"]
    assert "does not change in the window" in notes["always"]
    assert notes["twin"] == "'twin' is the same signal as 'bias_13.8' in the window; only the latter is kept"
    assert "is no output" in notes["elsewhere"]
    left_out = [candidate for candidate in other.candidates if candidate.name in notes and candidate.sd is None]
    assert {candidate.name for candidate in left_out} == {fault.name for fault in extra}
    assert {notes[fault.name] for fault in extra} <= set(texts(other.notes))


def test_a_combination_of_entries_is_left_out_where_all_are_estimated_at_once(flight, faulty):
    """Two steps and the block between them: the third is the difference of the others."""
    atoms = [
        {"name": "up", "shape": "bias", "onset_s": 10.0},
        {"name": "later", "shape": "bias", "onset_s": 20.0},
        {"name": "block", "shape": "bias", "onset_s": 10.0, "offset_s": 20.0},
    ]
    dictionary = load_dictionary({"channel": "tas", "atoms": atoms})
    result = identify_faults(flight(1), dictionary, merge(QUICK, {"method": "risro"}))
    assert "is a combination of the entries before it" in result.candidates[2].note
    # Where a few entries are selected it is one as good as any.
    result = identify_faults(faulty(flight(1), dictionary, {"block": 2.0}), dictionary, QUICK)
    assert [fault.name for fault in result.faults] == ["block"]
    assert result.faults[0].magnitude == pytest.approx(2.0, abs=3.0 * result.faults[0].sd)


@pytest.mark.slow
def test_a_dictionary_denser_than_the_rate_declares_the_entries_that_are_there(flight, faulty):
    """Entries three to a sample combine to each other, and each is still told from its neighbours."""
    atoms = [{"name": f"step_{k}", "shape": "bias", "onset_s": 6.0 + k / 30.0} for k in range(600)]
    dictionary = load_dictionary({"channel": "tas", "atoms": atoms})
    result = identify_faults(faulty(flight(1), dictionary, {"step_121": 2.0, "step_400": -3.0}), dictionary, QUICK)
    assert {fault.name for fault in result.faults} == {"step_121", "step_400"}


def changed(log, name, values):
    channel = log.channel(name)
    values = np.array(values(channel.values), dtype=float)
    return replace(log, channels={**log.channels, name: replace(channel, values=values)})


@pytest.mark.parametrize(
    ("change", "config", "error", "message"),
    [
        (lambda log: changed(log, "elevator", np.zeros_like), {}, ExcitationError, "'elevator' does not move"),
        (lambda log: changed(log, "tas", np.ones_like), {}, LogError, "output 'tas' does not change"),
        (lambda log: log, {"outputs": ["mach"]}, LogError, "no channel 'mach'"),
        (lambda log: log, {"window": {"from_s": 2.0, "to_s": 2.05}}, ExcitationError, "does not move"),
        (lambda log: log, {"window": {"from_s": 3.1, "to_s": 3.5}, "model": {"order": 12}}, LogError, "give --order 7"),
        (lambda log: log, {"window": {"from_s": 90.0}}, LogError, "no samples between"),
        (lambda log: log, {"model": {"order": 200}}, LogError, "give --order"),
        (
            lambda log: log,
            {"method": "risro-as-published", "outputs": ["tas", "aoa"]},
            ConfigError,
            "works on one output",
        ),
    ],
)
def test_refusals(flight, thesis, change, config, error, message):
    with pytest.raises(error, match=message) as caught:
        identify_faults(change(flight(1)), thesis, Config.model_validate(config))
    assert "\n" not in str(caught.value)


def test_a_dictionary_without_a_live_entry_is_refused(flight):
    late = load_dictionary({"channel": "tas", "atoms": [{"name": "late", "shape": "bias", "onset_s": 40.0}]})
    with pytest.raises(DictionaryError, match="no live atom: 'late' starts at 40 s, after the window ends"):
        identify_faults(flight(1), late, QUICK)


def test_the_published_method_says_what_it_lacks(flight, thesis, faulty):
    config = Config.model_validate({"method": "risro", "risro": {"sparsity": "none"}})
    result = identify_faults(faulty(flight(1), thesis, {"bias_13.8": 3.0}), thesis, config)
    assert result.solver.method == "risro"
    assert result.solver.sparsity is None
    assert not result.model.feedthrough
    assert "no false-alarm rate" in texts(result.notes)[0]
    assert "bias_13.8" in {fault.name for fault in result.faults}
    assert all(np.isfinite([fault.magnitude, fault.sd]).all() for fault in result.faults)


@pytest.mark.parametrize("kind", ["exp-l0", "l1", "lp"])
def test_the_answer_says_what_the_sparsity_stage_did(flight, thesis, faulty, kind):
    config = Config.model_validate({"method": "risro", "model": {"order": 6}, "risro": {"sparsity": kind}})
    result = identify_faults(faulty(flight(1), thesis, {"bias_13.8": 3.0}), thesis, config)
    told = result.solver.sparsity
    assert result.truth.isolated
    assert (told.kind, told.alpha is None, told.updates) == (kind, kind != "exp-l0", None)
    assert [(run.order, run.start) for run in told.runs] == [(6, "risro"), (6, "no fault")]
    assert all(run.iterations > 1 and run.converged for run in told.runs)
    assert ("bias_13.8",) in {run.supports[-1] for run in told.runs}
    assert "bias_13.8" not in told.set_to_zero
    steps = " and ".join(str(run.iterations) for run in told.runs)
    said = f"({kind}, {steps} steps from its two starts) sets {len(told.set_to_zero)} of"
    assert any(said in note for note in texts(result.notes)) == bool(told.set_to_zero)


def test_the_published_stage_runs_as_published_only(flight, thesis, faulty):
    log, rate = (
        faulty(flight(1), thesis, {"bias_13.8": 3.0}),
        {"conditioning": {"rate_hz": 10.0}, "model": {"order": 4}},
    )
    for updates in (0, 1, 2):
        rules = {"method": "risro-as-published", "risro": {"updates": updates}}
        result = identify_faults(log, thesis, Config.model_validate({**rules, **rate}))
        told = result.solver.sparsity
        assert (told.kind, told.alpha, told.r, told.runs) == ("exp-l0", 1.0, 10.0, ())
        assert told.updates == updates * (result.solver.iterations - 1)


def test_a_solver_that_did_not_converge_gives_no_interval_and_no_verdict(flight, thesis, faulty):
    rules = {"method": "risro", "risro": {"sparsity": "none", "max_iterations": 2, "tolerance": 1e-300}}
    result = identify_faults(faulty(flight(1), thesis, {"bias_13.8": 3.0}), thesis, Config.model_validate(rules))
    assert result.decision == "inconclusive"
    assert "did not converge" in texts(result.notes)[0]
    assert Termination.MAX_ITERATIONS.value in texts(result.notes)[0]
    assert result.faults
    assert all(np.isnan([fault.sd, *fault.ci95]).all() for fault in result.faults)
    assert all(entry.sd is None and entry.minimal_detectable is None for entry in result.candidates)
    entries = identify_document(result, provenance(log_sha256=""))["faults"]
    assert all(entry["sd"] is None and entry["ci95"] is None for entry in entries)


def test_the_published_threshold_decides_what_is_active(flight, thesis, faulty):
    log = faulty(flight(1), thesis, {"bias_13.8": 3.0})
    strict, loose = (
        identify_faults(
            log, thesis, Config.model_validate({"method": "risro", **SETTINGS, "selection": {"threshold": threshold}})
        )
        for threshold in (0.9, 1e-6)
    )
    assert len(strict.faults) <= 1
    assert len(loose.faults) == 7
