"""The JSON document, and what a reader is shown of it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from bfi_cli.diagnosability import DiagnosabilityResult, diagnosability_content, diagnosability_document
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.report.figures import draw
from bfi_cli.serialization import provenance, to_json

ORIGIN = provenance(log_sha256="")


def stored(result: DiagnosabilityResult) -> dict:
    return json.loads(to_json(diagnosability_document(result, ORIGIN)))


def test_the_document_has_what_scripts_rely_on(at_unit):
    document = stored(at_unit)
    assert (document["kind"], document["schema"]) == ("diagnosability", 4)
    assert {"atoms", "between", "manoeuvres", "notes", "provenance", "log", "model", "information"} <= set(document)
    assert {"name", "divergence_bits", "minimal_detectable", "apart_bits", "most_like"} <= set(document["atoms"][0])
    assert [atom["name"] for atom in document["atoms"]][1] == "bias_13.8"
    np.testing.assert_array_equal(document["between"], at_unit.between)
    assert (document["manoeuvres"], document["best"]) == ([], None)


def test_what_is_not_known_is_null(at_unit):
    dead = replace(at_unit.atoms[0], live=False, divergence_bits=None, minimal_detectable=None)
    between = at_unit.between.copy()
    between[0], between[:, 0] = np.nan, np.nan
    document = stored(replace(at_unit, atoms=(dead, *at_unit.atoms[1:]), between=frozen_array(between)))
    assert document["between"][0] == [None] * 7
    content = diagnosability_content(document)
    (heat_map,) = content.drawings[0].heat_maps
    assert len(heat_map.rows) == 6
    assert np.isfinite(heat_map.values).all()
    assert content.tables[0].rows[-1][:3] == ("sine_2.25", "1 m/s", "-")


def test_the_heat_map_has_no_fault_first_and_then_every_fault(at_unit):
    (heat_map,) = diagnosability_content(stored(at_unit)).drawings[0].heat_maps
    names = tuple(atom.name for atom in at_unit.atoms)
    assert (heat_map.rows, heat_map.columns) == (names, ("no fault", *names))
    values = np.array(heat_map.values)
    np.testing.assert_array_equal(values[:, 0], [atom.divergence_bits for atom in at_unit.atoms])
    np.testing.assert_array_equal(values[:, 1:], at_unit.between)


def test_the_curves_cross_the_dashed_line_at_the_minimal_detectable_magnitudes(at_unit):
    drawing = diagnosability_content(stored(at_unit)).drawings[1]
    limits = {atom.name: (atom.physical_scale or 1.0) * atom.minimal_detectable for atom in at_unit.atoms}
    curves = [(panel.levels[0][1], one) for panel in drawing.panels for one in panel.curves]
    assert {one.label for _, one in curves} == set(limits)
    for level, one in curves:
        assert np.exp(np.interp(level, one.y, np.log(one.x))) == pytest.approx(limits[one.label], rel=0.01)


@pytest.mark.slow
def test_the_verdict_names_what_is_hardest_and_the_best_manoeuvre(at_unit, compared):
    assert "Hardest to see: drift_7.93 of 0.23 m/s^2 (" in diagnosability_content(stored(at_unit)).verdict
    content = diagnosability_content(stored(compared))
    assert content.heading == f"Best manoeuvre: {compared.best}"
    assert content.verdict.startswith(f"Of 3 manoeuvres {compared.best} tells most.")
    assert [row[0] for row in content.tables[1].rows] == [score.name for score in compared.manoeuvres]
    assert "does not move" in content.tables[1].rows[-1][-1]
    (heat_map,) = content.drawings[-1].heat_maps
    assert heat_map.rows == tuple(score.name for score in compared.manoeuvres[:2])


def test_the_table_is_sorted_by_what_is_easiest(at_unit):
    (table,) = diagnosability_content(stored(at_unit)).tables
    bits = [float(row[2]) for row in table.rows]
    assert bits == sorted(bits, reverse=True)
    assert {len(row) for row in table.rows} == {len(table.heads)}


@pytest.mark.slow
def test_every_drawing_can_be_drawn(compared):
    for drawing in diagnosability_content(stored(compared)).drawings:
        assert draw(drawing).axes


def test_a_large_dictionary_has_no_map(at_unit):
    many = tuple(replace(at_unit.atoms[n % 7], name=f"fault {n}") for n in range(31))
    content = diagnosability_content(stored(replace(at_unit, atoms=many, between=frozen_array(np.zeros((31, 31))))))
    assert [drawing.name for drawing in content.drawings] == ["information"]
    assert sum(len(panel.curves) for panel in content.drawings[0].panels) == 8
    assert len(content.tables[0].rows) == 31
