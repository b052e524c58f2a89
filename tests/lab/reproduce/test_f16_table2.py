"""Table II of the F-16 diagnosability paper: the quick form of the reproduction, and what must hold in any form."""

from __future__ import annotations

import numpy as np
import pytest
from noted import texts

from bfi_cli.errors import ConfigError
from bfi_cli.flightlog import FlightLog
from bfi_cli.lab.reproduce import Settings
from bfi_cli.lab.reproduce.f16_table2 import (
    TABLE_2,
    Case,
    F16Options,
    Residuals,
    f16_table2,
    fault_deg_s,
    fly_cases,
    indices,
    montecarlo,
    options_from,
)
from bfi_cli.report.content import ReportContent

COARSE = F16Options(step_s=0.1)


@pytest.fixture(scope="module")
def flights() -> list[Residuals]:
    return fly_cases([Case(options=COARSE, seed=0)])


@pytest.fixture(scope="module")
def quick() -> ReportContent:
    return f16_table2(Settings(quick=True, trials=1), COARSE)


def changed(**change: object) -> F16Options:
    return COARSE.model_copy(update=change)


def test_the_fault_is_that_of_equation_26():
    t = np.arange(200) * 0.1
    f = np.array([fault_deg_s(time) for time in t])
    np.testing.assert_allclose(f[:40], 0.0)
    np.testing.assert_allclose(f[40:120], 2.0 * np.sin(2.0 * np.pi * t[40:120]), rtol=0, atol=1e-12)
    np.testing.assert_allclose(f[120:], 4.0 * np.sin(2.0 * np.pi * t[120:]), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_before_the_fault_only_the_noise_tells_the_flights_apart():
    quiet = F16Options(step_s=0.1, noise_deg_s=0.0)
    (one,) = fly_cases([Case(options=quiet, seed=0)])
    before = one.time_s < 4.0 - 1e-6
    np.testing.assert_allclose(one.roll_fault[before], one.healthy[before], rtol=0, atol=1e-10)
    np.testing.assert_allclose(one.pitch_fault[before], one.healthy[before], rtol=0, atol=1e-10)
    same = F16Options(step_s=0.1, noise_deg_s=0.0, reference_window="same")
    np.testing.assert_allclose(indices([one], same).index[0, :, 0], 0.0, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_the_nominal_aircraft_without_noise_has_no_residual():
    (one,) = fly_cases([Case(options=F16Options(step_s=0.1, noise_deg_s=0.0), seed=0)])
    assert np.abs(one.nominal).max() < 1e-9
    assert np.abs(one.healthy).max() > 0.1


@pytest.mark.slow
def test_cases_are_independent_and_in_order(flights: list[Residuals]):
    other = changed(noise_deg_s=0.02, roll_deg=0.0, observer_gain=(10.0, 10.0, 10.0))
    estimated = changed(observer_rates="estimated")
    cases = [Case(options=o, seed=s) for o, s in ((other, 1), (COARSE, 0), (estimated, 0))]
    told: list[tuple[int, int]] = []
    found = fly_cases(cases, lambda done, total: told.append((done, total)))
    np.testing.assert_allclose(found[1].roll_fault, flights[0].roll_fault, rtol=0, atol=1e-9)
    assert np.abs(found[2].roll_fault - flights[0].roll_fault).max() > 0.01
    assert told[-1] == (400, 400)
    assert [done for done, _ in told] == list(range(1, 401))


@pytest.mark.slow
def test_bits_with_halves_lie_between_0_and_1_and_the_other_readings_are_multiples(flights: list[Residuals]):
    bits = indices(flights, COARSE).index
    assert ((bits >= 0.0) & (bits <= 1.0)).all()
    np.testing.assert_allclose(indices(flights, changed(log_base="e")).index, np.log(2.0) * bits, rtol=1e-12)
    np.testing.assert_allclose(indices(flights, changed(halves=False)).index, 2.0 * bits, rtol=1e-12)


def test_base_e_cannot_give_the_published_table():
    assert np.log(2.0) < TABLE_2.max() <= 1.0


@pytest.mark.slow
def test_equation_17_agrees_with_equation_15(flights: list[Residuals]):
    value, error = montecarlo(flights[0], COARSE, 2000, rng=np.random.default_rng(0))
    assert (np.abs(value - indices(flights, COARSE).index[0]) < 4.0 * error).all()


@pytest.mark.slow
def test_the_index_rises_and_stays_near_the_table_even_with_a_coarse_step(flights: list[Residuals]):
    for reference in ("kde", "gaussian"):
        found = indices(flights, changed(reference=reference))
        assert (np.diff(found.index, axis=2) > 0.0).all()
        assert found.worst < 0.15


@pytest.mark.slow
def test_the_content_holds_table_errata_and_figures(quick: ReportContent):
    names = [table.name for table in quick.tables]
    assert names == ["comparison", "choices", "robust", "errata", "initial"]
    comparison, choices, *_ = quick.tables
    assert comparison.rows[0][:2] == ("FD, roll rate, 0-4 s", "0.1691 (table II)")
    assert [row[1].removesuffix(" (section IV)") for row in comparison.rows[6:]] == [
        "0.2600",
        "0.5738",
        "0.3430",
        "0.6798",
    ]
    assert {len(row) for row in choices.rows} == {len(choices.heads)}
    assert [drawing.name for drawing in quick.drawings] == [
        *("f16_manoeuvre", "f16_residuals", "f16_bandwidths", "f16_densities")
    ]
    for drawing in quick.drawings:
        for panel in drawing.panels:
            assert all(np.isfinite(one.y).all() for one in panel.curves)
    assert dict(quick.facts)["Gyro noise"].startswith("0.05 deg/s")
    assert texts(quick.notes)
    assert all(published == f"{ours} (table I)" for _, published, ours in quick.tables[4].rows)


@pytest.mark.slow
def test_figure_3_has_the_data_and_both_bandwidths(quick: ReportContent):
    """Every density of a window integrates to 1; the adaptive one is not the fixed one."""
    panels = quick.drawings[3].panels
    assert len(panels) == 4
    for panel in panels:
        data, adaptive, fixed, _ = panel.curves
        assert [one.label for one in panel.curves[:3]] == ["data", "adaptive bandwidth", "fixed bandwidth"]
        assert np.sum(data.y[:-1] * np.diff(data.x)) == pytest.approx(1.0, abs=1e-9)
        for one in (adaptive, fixed):
            assert np.trapezoid(one.y, one.x) == pytest.approx(1.0, abs=0.01)
        assert np.abs(adaptive.y - fixed.y).max() > 1e-3


@pytest.mark.slow
def test_the_verdict_says_that_the_settings_were_chosen_and_how_far_the_table_moves(quick: ReportContent):
    choices = {row[0]: row[1:7] for row in quick.tables[1].rows}
    assert quick.verdict.startswith("With settings chosen for it")
    chosen, *ends = (
        np.array([float(cell) for cell in choices[name]])
        for name in ("as chosen", "smallest, same scale", "largest, same scale")
    )
    moves = max(np.abs(end - chosen).max() for end in ends)
    assert moves > 0.2
    assert float(quick.verdict.split("moves by up to ")[1].split()[0]) == pytest.approx(moves, abs=0.0011)


@pytest.mark.slow
def test_the_chosen_reading_is_not_repeated_among_the_others(quick: ReportContent):
    labels = [row[0] for row in quick.tables[1].rows]
    assert labels[:2] == ["published", "as chosen"]
    assert "reference: kernels" not in labels
    assert "reference: Gaussian fit" in labels


@pytest.mark.slow
def test_other_choices_reach_the_answer():
    log = FlightLog(path="flight", time_s=np.arange(3.0), channels={})
    content = f16_table2(Settings(quick=True, trials=1, log=log), changed(reference="gaussian", noise_deg_s=0.1))
    assert "The record given is not used: the flights are the experiment." in texts(content.notes)
    facts = dict(content.facts)
    assert facts["Gyro noise"].startswith("0.1 deg/s")
    assert facts["Reference"].startswith("Gaussian fit")
    assert "reference: kernels" in [row[0] for row in content.tables[1].rows]


def test_options_are_read_from_texts():
    options = options_from(["noise_deg_s = 0.03", "variation=[0.3, 0.3, 0.3]", "exponent=null", "log_base=2"])
    assert options == F16Options(noise_deg_s=0.03, variation=(0.3, 0.3, 0.3), exponent=None)
    assert options_from([]) == F16Options()
    assert options_from(["aoa_command=[[0, 0], [2, 10]]"]).aoa_command == ((0.0, 0.0), (2.0, 10.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("noise=1", "f16-table2: noise: unknown key; did you mean 'noise_deg_s'?"),
        ("noise_deg_s=-1", "f16-table2: noise_deg_s: must be greater than or equal to 0, got -1"),
        ("noise_deg_s", "f16-table2: expected KEY=VALUE, got 'noise_deg_s'; write noise_deg_s=0.03"),
        ("log_base=10", "f16-table2: log_base: not one of the choices, got '10'; known: 2, e"),
        ("aoa_command=[[1, 0], [0, 8]]", "f16-table2: aoa_command: needs two corners or more in the order of time"),
    ],
)
def test_what_cannot_be_is_one_line(text: str, message: str):
    with pytest.raises(ConfigError) as caught:
        options_from([text])
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_a_residual_without_a_density_is_refused():
    with pytest.raises(ConfigError, match="the fault-free residual is zero and has no density; give some noise"):
        options_from(["noise_deg_s=0", "variation=[0, 0, 0]"])
