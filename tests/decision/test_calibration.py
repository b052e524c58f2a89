"""Thresholds and p-values from counted statistics: inverse to each other, free of scale, honest about their counts."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.decision.calibration import (
    FEWEST_WINDOWS,
    CalibrationSettings,
    CalibrationTable,
    differences,
    join_tables,
    load_tables,
    nearest,
    null_of,
    save_tables,
)
from bfi_cli.errors import ConfigError
from bfi_cli.flight.parity.calibration import air_data_in
from bfi_cli.serialization import provenance

MADE = CalibrationSettings(
    rate_hz=2.0,
    duration_s=120.0,
    orders=(2, 4),
    feedthrough=True,
    inputs=("elevator",),
    outputs=("tas",),
    shapes=("bias", "drift"),
)


def table(n: int = 100, seed: int = 0, **changed: object) -> CalibrationTable:
    rng = np.random.default_rng(seed)
    statistics = {"bias": 5.0 + rng.exponential(2.0, n), "drift": 20.0 + rng.exponential(9.0, n)}
    return CalibrationTable(settings=replace(MADE, **changed), statistics=statistics, logs=("a.h5",))


@given(alpha=st.floats(1e-3, 0.14), seed=st.integers(0, 50))
def test_the_p_value_of_a_threshold_is_the_false_alarm_rate(alpha: float, seed: int):
    null = null_of(table(seed=seed), ("bias", "drift"))
    for shape in ("bias", "drift"):
        reached = null.standardised(shape, null.threshold(shape, alpha))
        assert null.tail.probability(reached) == pytest.approx(alpha)
        assert null.p_value(reached) == pytest.approx(max(alpha, 1 / 101))


@given(seed=st.integers(0, 50), scale=st.floats(0.1, 50))
def test_each_shape_has_a_scale_of_its_own(seed: int, scale: float):
    one = table(seed=seed)
    other = replace(one, statistics={**one.statistics, "drift": scale * one.statistics["drift"]})
    a, b = (null_of(x, ("bias", "drift")) for x in (one, other))
    assert b.threshold("bias", 0.01) == pytest.approx(a.threshold("bias", 0.01))
    assert b.threshold("drift", 0.01) == pytest.approx(scale * a.threshold("drift", 0.01))


def test_an_outlier_of_one_shape_raises_the_threshold_of_another_little():
    one = table()
    values = one.statistics["bias"].copy()
    values[:2] = 4.0 * values.max()
    other = replace(one, statistics={**one.statistics, "bias": values})
    a, b = (null_of(x, ("bias", "drift")) for x in (one, other))
    assert b.threshold("bias", 0.01) > 2.0 * a.threshold("bias", 0.01)
    assert b.threshold("drift", 0.01) < 1.75 * a.threshold("drift", 0.01)


def test_the_rate_of_false_alarms_is_the_one_wanted():
    null = null_of(table(2000), ("bias", "drift"))
    fresh = table(20_000, seed=1)
    top = np.max([[null.standardised(s, x) for x in fresh.statistics[s]] for s in ("bias", "drift")], axis=0)
    rate = np.mean([null.p_value(x) < 0.05 for x in top])
    # Half a percent is three standard deviations of 20 000 trials, and as much again for those of the table.
    assert rate == pytest.approx(0.05, abs=0.015)


@pytest.mark.parametrize("n", [20, 100])
def test_p_values_fall_and_end_where_the_counts_do(n: int):
    null = null_of(table(n), ("bias",))
    p = [null.p_value(x) for x in np.linspace(-5, 500, 300)]
    assert np.all(np.diff(p) <= 1e-12)
    assert p[-1] == null.rarest == 1 / (n + 1)
    assert p[0] == pytest.approx(1.0)


def test_thresholds_rise_without_end_as_the_rate_falls():
    null = null_of(table(20), ("bias",))
    thresholds = np.array([null.threshold("bias", rate) for rate in np.geomspace(0.5, 1e-12, 50)])
    assert np.all(np.diff(thresholds) > 0.0)


def test_a_file_keeps_everything(tmp_path):
    path = tmp_path / "t.json"
    tables = (table(), table(30, rate_hz=10.0, frequency_hz=(0.1, 2.0)))
    path.write_text(save_tables(tables, provenance(log_sha256="")))
    read = load_tables(path)
    assert [one.settings for one in read] == [one.settings for one in tables]
    for one, same in zip(read, tables, strict=True):
        assert (one.logs, one.n_unusable, one.n_windows) == (same.logs, same.n_unusable, same.n_windows)
        for shape in one.statistics:
            np.testing.assert_array_equal(one.statistics[shape], same.statistics[shape])


def test_what_fits_and_what_does_not():
    made = table()
    assert differences(made, MADE) == ()
    assert differences(made, replace(MADE, shapes=("drift",), duration_s=115.0, rate_hz=2.005)) == ()
    changes = {"rate_hz": 10.0, "duration_s": 60.0, "orders": (4,), "inputs": ("pitch",), "ends": True}
    for name, value in changes.items():
        assert len(differences(made, replace(MADE, **{name: value}))) == 1
    assert differences(made, replace(MADE, rate_hz=10.0)) == ("rate 2 instead of 10",)


def test_the_nearest_table():
    slow, fast = table(rate_hz=1.0), table(rate_hz=8.0)
    assert nearest([slow, fast], replace(MADE, rate_hz=10.0)) is fast
    assert nearest([slow, fast], replace(MADE, rate_hz=1.0)) is slow
    assert nearest([slow, fast], replace(MADE, shapes=("sine",))) is None
    assert nearest([], MADE) is None


def test_windows_scanned_alike_are_joined():
    both = join_tables([table(30), table(40, rate_hz=1.0)], table(25, seed=2))
    assert sorted(one.n_windows for one in both) == [40, 55]


def test_too_few_windows():
    with pytest.raises(ConfigError, match=f"19 windows without a fault, fewer than {FEWEST_WINDOWS}"):
        null_of(table(19), ("bias",))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{", "not JSON"),
        ('{"kind": "identify"}', "kind is 'identify', not 'calibration'"),
        ('{"kind": "calibration", "schema": 9}', "schema is 9"),
        ('{"kind": "calibration", "schema": 1}', "no key 'tables'"),
        ("[]", "not a mapping"),
    ],
)
def test_a_file_of_another_kind(tmp_path, text: str, complaint: str):
    path = tmp_path / "t.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match=complaint) as error:
        load_tables(path)
    assert str(error.value).startswith(str(path))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.json"):
        load_tables(tmp_path / "none.json")


def document_of(**changes: object) -> dict[str, Any]:
    """Return the document of a table, as a version that wrote no digest would have, with changes by dotted key."""
    document = json.loads(save_tables([table(40)], provenance(log_sha256="")))
    del document["digest"]
    for place, value in changes.items():
        *keys, last = place.split("__")
        target: Any = document["tables"][0]
        for key in keys:
            target = target[key]
        target[last] = value
    return document


def test_what_an_earlier_version_wrote_is_taken(tmp_path):
    (tmp_path / "t.json").write_text(json.dumps(document_of()))
    assert load_tables(tmp_path / "t.json")[0].n_windows == 40


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"statistics__bias": [0.0] * 40}, r"tables\[0\]: statistics.bias: all of them are 0"),
        ({"statistics__bias": [7.0] * 40}, r"statistics.bias: all of them are 7"),
        ({"statistics__bias": [-5.0] * 40}, r"statistics.bias: -5 is negative"),
        ({"statistics__drift": [None] * 40}, r"statistics.drift: not all of them are numbers"),
        (
            {"statistics__drift": [1e-6 * k for k in range(40)]},
            r"statistics.drift: their median is 1.95e-05, less than",
        ),
        ({"statistics__drift": [9.0, 8.0]}, r"the shapes have 2 and 40 windows"),
        ({"statistics": {}}, r"settings.shapes is bias, drift, but the statistics are of nothing"),
        ({"settings__shapes": ["bias"]}, r"settings.shapes is bias, but the statistics are of bias, drift"),
        ({"settings__shapes": []}, r"settings.shapes is empty"),
        ({"settings__inputs": []}, r"settings.inputs is empty"),
        ({"settings__outputs": []}, r"settings.outputs is empty"),
        ({"settings__orders": []}, r"settings.orders is \[\]"),
        ({"settings__orders": [0]}, r"settings.orders is \[0\]"),
        ({"settings__rate_hz": -2.0}, r"settings.rate_hz is -2.0"),
        ({"settings__rate_hz": None}, r"settings.rate_hz is nan"),
        ({"settings__duration_s": 0.0}, r"settings.duration_s is 0.0"),
        ({"settings__recorder_hz": -1.0}, r"settings.recorder_hz is -1.0"),
    ],
)
def test_a_table_without_sense_is_refused(changes: dict[str, Any], complaint: str, tmp_path):
    path = tmp_path / "t.json"
    path.write_text(json.dumps(document_of(**changes)))
    with pytest.raises(ConfigError, match=complaint) as error:
        load_tables(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_a_scaled_table_is_not_the_one_that_was_written(factor: float, tmp_path):
    document = json.loads(save_tables([table(40)], provenance(log_sha256="")))
    values = document["tables"][0]["statistics"]["bias"]
    document["tables"][0]["statistics"]["bias"] = [factor * value for value in values]
    (tmp_path / "t.json").write_text(json.dumps(document))
    with pytest.raises(ConfigError, match="its tables are not those that were written"):
        load_tables(tmp_path / "t.json")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"statistics": [0.0] * 30}, r"tables\[0\]: statistics: all of them are 0"),
        ({"statistics": list(range(30, 0, -1))}, r"tables\[0\]: its statistics do not rise"),
        ({"statistics": [-1.0, *range(29)]}, r"tables\[0\]: statistics: -1 is negative"),
        ({"residuals": []}, r"tables\[0\]: residuals is empty"),
        ({"residuals": ["lift", "magic"]}, r"tables\[0\]: residuals is lift, magic, known: climb"),
        ({"length_s": -60.0}, r"tables\[0\]: length_s is -60.0"),
        ({"zero_lift_rad": 2.0}, r"zero_lift_rad is 2, not an angle"),
    ],
)
def test_air_data_without_sense_are_refused(changes: dict[str, Any], complaint: str):
    air_data: dict[str, Any] = {
        "residuals": ["lift"],
        "length_s": 60.0,
        "knows_zero_lift": True,
        "statistics": [float(k) for k in range(1, 31)],
        "logs": ["a.h5"],
    }
    angle = changes.get("zero_lift_rad", -0.02)
    document = {"air_data": {"zero_lift_rad": angle, "tables": [air_data | changes]}}
    with pytest.raises(ConfigError, match=f"t.json: air_data: {complaint}"):
        air_data_in(document, where="t.json")
    with pytest.raises(ConfigError, match="holds no air data"):
        air_data_in({}, where="t.json")
