"""A normal acceleration is upward without gravity, however it is recorded."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from made_journeys import write_journey
from made_logs import made_log
from noted import texts

from bfi_cli.airdata import G
from bfi_cli.flightlog import read_log
from bfi_cli.flightlog.plausible import with_conventions
from bfi_cli.flightlog.record import FlightLog, StoredChannel

T = np.arange(3000) / 10.0
NZ = 1.0 + 0.05 * np.sin(T) + 0.02 * np.cos(3.1 * T)  # of a flight
# How it is recorded, by the load factor, and the unit that is stated.
RECORDED: Mapping[str, tuple[Callable[[np.ndarray], np.ndarray], str | None]] = {
    "acceleration": (lambda n: G * (n - 1.0), "m/s^2"),
    "load factor": (lambda n: n, "g"),
    "load factor less one": (lambda n: n - 1.0, "g"),
    "ratio": (lambda n: n, "1"),
    "ratio less one": (lambda n: n - 1.0, "1"),
    "load factor without a unit": (lambda n: n, None),
    "specific force upward": (lambda n: G * n, "m/s^2"),
    "specific force downward": (lambda n: -G * n, "m/s^2"),
    "specific force downward in g": (lambda n: -n, "g"),
    "specific force downward in feet": (lambda n: -G / 0.3048 * n, "ft/s^2"),
    "specific force without a unit": (lambda n: G * n, None),
}


def read(path: Path, nz: np.ndarray, how: str, **others: np.ndarray) -> FlightLog:
    record, unit = RECORDED[how]
    with h5py.File(path, "w") as file:
        for name, values in {"time": T, "normal_acc": record(nz), **others}.items():
            file[name] = values
        if unit is not None:
            file["normal_acc"].attrs["units"] = unit
    return read_log(path)


@pytest.mark.parametrize("how", RECORDED)
def test_gravity_is_taken_out_and_the_sign_is_upward(tmp_path: Path, how: str):
    log = read(tmp_path / "log.h5", NZ, how)
    np.testing.assert_allclose(log.channels["normal_acc"].values, G * (NZ - 1.0), atol=1e-12)
    said = [text for text in texts(log.notes) if "weight in it" in text]
    assert len(said) == (how not in ("acceleration", "load factor less one"))  # as it should be, unit and all
    assert log.channels["normal_acc"].unit == "m/s^2"


ROLLED = np.where(T < 250.0, 1.2, 0.0)  # banked by 69 degrees for most of the log
CASES: Mapping[str, tuple[np.ndarray, dict[str, np.ndarray]]] = {
    "on the ground": (np.ones(T.size), {}),
    "a steep turn": (1.0 / np.cos(ROLLED), {"roll": ROLLED}),
    "floating": (np.where(T < 200.0, 0.0, 1.0), {"pitch": np.where(T < 200.0, 0.7, 0.02), "roll": np.zeros(T.size)}),
    "inverted": (np.where(T < 200.0, -1.0, 1.0), {"roll": np.where(T < 200.0, np.pi, 0.0)}),
    "some of it missing": (np.where(T < 150.0, np.nan, NZ), {}),
    "spikes": (np.where(np.arange(T.size) % 50 == 0, 1e31, NZ), {}),
    "angles in degrees without a unit": (NZ, {"roll": 20.0 + np.sin(T)}),
}


@pytest.mark.parametrize("how", ["acceleration", "load factor", "specific force downward"])
@pytest.mark.parametrize("case", CASES)
def test_the_convention_is_that_of_level_samples(tmp_path: Path, case: str, how: str):
    nz, others = CASES[case]
    log = read(tmp_path / "log.h5", nz, how, **others)
    known = np.abs(nz) < 1e30
    np.testing.assert_allclose(log.channels["normal_acc"].values[known], G * (nz[known] - 1.0), atol=1e-9)


def test_other_accelerations_are_in_the_unit_of_the_normal_one(tmp_path: Path):
    log = read(tmp_path / "log.h5", NZ, "load factor without a unit", longitudinal_acc=0.1 * NZ)
    np.testing.assert_allclose(log.channels["longitudinal_acc"].values, 0.1 * G * NZ, rtol=1e-12)
    log = read(tmp_path / "si.h5", NZ, "specific force upward", longitudinal_acc=0.1 * NZ)
    np.testing.assert_array_equal(log.channels["longitudinal_acc"].values, 0.1 * NZ)


def test_a_channel_without_numbers_is_left_as_it_is(tmp_path: Path):
    log = read(tmp_path / "log.h5", np.full(T.size, np.nan), "load factor")
    assert np.isnan(log.channels["normal_acc"].values).all()


def test_the_convention_is_that_of_the_whole_log_whatever_window_is_asked_for(tmp_path: Path):
    read(tmp_path / "log.h5", np.where(T < 50.0, 0.0, 1.0), "load factor")
    log = read_log(tmp_path / "log.h5", from_s=0.0, to_s=50.0)
    np.testing.assert_allclose(log.window(0.0, 50.0).channels["normal_acc"].values, G * (0.0 - 1.0))


def test_a_stored_channel_is_read_in_blocks():
    n, read_rows = 1_000_000, []

    def rows_of(rows: slice) -> np.ndarray:
        read_rows.append(rows.stop - rows.start)
        return np.full(rows.stop - rows.start, -G)

    stored = StoredChannel(name="normal_acc", unit="m/s^2", source="fz", read=rows_of, rows=slice(0, n))
    made, convention, _ = with_conventions({"normal_acc": stored})
    assert convention is not None
    assert sum(read_rows) < 0.2 * n
    assert isinstance(made["normal_acc"], StoredChannel)
    np.testing.assert_array_equal(made["normal_acc"].between(slice(5, 9)), np.zeros(4))
    assert made["normal_acc"].n_samples == n


def test_a_log_is_not_modified():
    log = made_log(T, normal_acc=G * NZ)
    before = log.channels["normal_acc"].values.copy()
    with_conventions(log.channels)
    np.testing.assert_array_equal(log.channels["normal_acc"].values, before)


@pytest.mark.realdata
@pytest.mark.parametrize("attitude", [True, False])
def test_every_half_minute_of_recorded_flights_tells_the_convention(flights: Path, attitude: bool):
    """Without attitude only the half minute of a parabola does not."""
    n, wrong = 0, list[tuple[str, float]]()
    for path in sorted(flights.glob("*.h5")):
        log = read_log(path)
        names = [name for name in ("normal_acc", *(("pitch", "roll") if attitude else ())) if name in log.channels]
        size = round(30.0 * log.rate_hz)
        for first in range(0, log.n_samples - size + 1, size) if "normal_acc" in names else ():
            cut = {name: log.channels[name].taken(slice(first, first + size)) for name in names}
            normal = cut["normal_acc"]
            if np.count_nonzero(np.isfinite(normal.values)) < 20:
                continue
            for factor, offset in ((1.0, 0.0), (1.0, G), (-1.0, -G)):
                recorded = replace(normal, values=factor * normal.values + offset, source_unit="m/s^2")
                made, _, _ = with_conventions({**cut, "normal_acc": recorded})
                n += 1
                if not np.allclose(made["normal_acc"].values, normal.values, atol=1e-9, equal_nan=True):
                    wrong.append((path.name, first / log.rate_hz))
    assert n > 4000
    assert len(set(wrong)) <= (0 if attitude else 1)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["diagnose", "detect"])
def test_an_answer_is_the_same_in_any_convention(bfi, tmp_path: Path, command: str):
    write_journey(tmp_path / "log.h5")
    answers = []
    for factor, offset, unit in ((1.0, 0.0, "m/s^2"), (-1.0 / G, -1.0, "g")):
        with h5py.File(tmp_path / "log.h5", "r+") as file:
            file["normal_acc"][...] = factor * file["normal_acc"][()] + offset
            file["normal_acc"].attrs["units"] = unit
        part = ("--from", 300, "--to", 560)
        answer = json.loads(bfi(command, tmp_path / "log.h5", *part, "--json").stdout)
        answers.append({key: answer[key] for key in answer.keys() - {"provenance", "notes", "log"}})
    for one, other in zip(numbers_of(answers[0]), numbers_of(answers[1]), strict=True):
        assert one == other or one == pytest.approx(other, rel=1e-6, abs=1e-6)


def numbers_of(answer: object) -> Iterator[object]:
    """Yield what a document holds, in order."""
    if isinstance(answer, dict):
        for key in sorted(answer):
            yield from (key, *numbers_of(answer[key]))
    elif isinstance(answer, list):
        for one in answer:
            yield from numbers_of(one)
    else:
        yield answer
