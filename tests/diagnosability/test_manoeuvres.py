"""Manoeuvres compared on a model: the same draws for each, the better one first, the useless one named."""

from __future__ import annotations

import numpy as np
import pytest
from noted import texts

from bfi_cli.config import Config, merge
from bfi_cli.diagnosability import assess, assess_manoeuvres, flown
from bfi_cli.dictionary import load_dictionary
from bfi_cli.errors import ConfigError, ExcitationError

NOISE = {"tas": 0.02}
QUICK = merge(Config(), {"conditioning.rate_hz": 10.0, "model.order": 4})
BIAS = load_dictionary({"channel": "tas", "atoms": [{"name": "bias", "shape": "bias", "onset_s": 12.0}]})


def flights(*manoeuvres: str, base: Config | None = None, **settings) -> Config:
    given = {"model": "citation", "manoeuvres": list(manoeuvres), "noise": NOISE, "draws": 2, **settings}
    return merge(base or Config(), {f"diagnosability.{key}": value for key, value in given.items()})


@pytest.mark.slow
def test_one_draw_of_one_manoeuvre_is_the_assessment_of_its_record(thesis):
    one = flights("3211", draws=1)
    result, log = assess_manoeuvres(thesis, one), flown(one, "3211", 0)
    expected = assess(log, thesis, merge(Config(), {"onset_tolerance_s": 0.0}))
    assert result.atoms == expected.atoms
    np.testing.assert_array_equal(result.between, expected.between)
    (score,) = result.manoeuvres
    assert (result.best, score.standard_error) == ("3211", None)
    assert score.bits == pytest.approx(np.mean([atom.apart_bits for atom in result.atoms]), rel=1e-12)
    assert score.divergence_bits == tuple(atom.divergence_bits for atom in result.atoms)


@pytest.mark.slow
def test_progress_is_told(compared, progress):
    assert progress == [(3, 6), (4, 6), (5, 6), (6, 6)]


@pytest.mark.slow
def test_the_best_comes_first_and_is_what_the_numbers_are_about(compared):
    scored = [score for score in compared.manoeuvres if score.bits is not None]
    assert [score.bits for score in scored] == sorted((score.bits for score in scored), reverse=True)
    assert compared.best == compared.manoeuvres[0].name
    assert tuple(atom.divergence_bits for atom in compared.atoms) == scored[0].divergence_bits
    assert compared.draws == 2
    assert all(score.weakest == "drift_7.93" and score.weakest_bits < score.bits for score in scored)


def test_a_manoeuvre_that_cannot_be_used_is_last_and_says_why(compared, thesis):
    last = compared.manoeuvres[-1]
    assert (last.name, last.bits, last.weakest) == ("none", None, None)
    assert "'elevator' does not move" in last.problem
    with pytest.raises(ExcitationError, match="'elevator' does not move"):
        assess_manoeuvres(thesis, flights("none"))


def test_every_manoeuvre_meets_the_same_noise():
    alike = flights("3211", "doublet")
    still = flown(alike, "none", 1).channel("tas").values
    quiet = flights("3211", "doublet", noise={})
    for name in alike.diagnosability.manoeuvres:
        noise = flown(alike, name, 1).channel("tas").values - flown(quiet, name, 1).channel("tas").values
        np.testing.assert_allclose(noise, still - 100.0, atol=1e-9)
    assert not np.array_equal(flown(alike, "none", 0).channel("tas").values, still)


@pytest.mark.slow
def test_limits_are_those_of_all_manoeuvres_together():
    one = flights("3211", "doublet", base=QUICK, draws=1, magnitude=2.0, at_limit=True)
    result = assess_manoeuvres(BIAS, one)
    each = np.array([score.minimal_detectable for score in result.manoeuvres], dtype=float)
    expected = 2.0 * np.exp(np.mean(np.log(each), axis=0))
    np.testing.assert_allclose([atom.magnitude for atom in result.atoms], expected, rtol=1e-9)


@pytest.mark.slow
def test_gusts_hide_faults():
    def bits(turbulence_m_s: float) -> float:
        one = flights("3211", base=QUICK, draws=1, turbulence_m_s=turbulence_m_s)
        return assess_manoeuvres(BIAS, one).manoeuvres[0].bits

    assert bits(1.0) < bits(0.0)


@pytest.mark.slow
def test_what_is_not_clearly_better_is_said():
    """Faults too small for any manoeuvre make them alike."""
    alike = assess_manoeuvres(BIAS, flights("3211", "doublet", base=QUICK, magnitude=1e-9))
    assert "'3211' is not clearly better than 'doublet': give more --draws to tell them apart" in texts(alike.notes)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"manoeuvres": []}, "diagnosability.manoeuvres: must not be empty"),
        ({"manoeuvres": ["3211", "3211"]}, "diagnosability.manoeuvres: a value stands twice"),
        ({"draws": 0}, "diagnosability.draws: must be greater than or equal to 1, got 0"),
    ],
)
def test_flights_that_cannot_be(settings, message):
    with pytest.raises(ConfigError, match=message):
        flights(**settings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"manoeuvres": ["3212"]}, "manoeuvre: unknown, got '3212'; did you mean '3211'"),
        ({"model": "citaton"}, "no such model, got 'citaton'; did you mean 'citation'"),
        ({"noise": {"tass": 1.0}}, "no output 'tass'"),
        ({"duration_s": 0.01}, "change --duration or --rate"),
        ({"model": None}, "diagnosability.model: names no model"),
    ],
)
def test_what_the_model_does_not_have(thesis, settings, message):
    with pytest.raises(ConfigError, match=message):
        assess_manoeuvres(thesis, flights(**{"manoeuvres": ["3211"], "noise": {}, "draws": 1, **settings}))
