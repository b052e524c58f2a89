"""The thesis's record, dictionary and faulty records against tables 5-1 and 5-2 and equations 5-8 to 5-12."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.dictionary import load_dictionary
from bfi_cli.lab.reproduce import Settings
from bfi_cli.lab.reproduce.catalogue import run
from bfi_cli.lab.reproduce.record import thesis_dictionary, thesis_record
from bfi_cli.report.content import ReportContent

CONFIGS = Path(__file__).parents[3] / "configs"
N, RATE = 3172, 100.0


def cells(content: ReportContent) -> dict[str, tuple[str, str]]:
    return {row[0]: (row[1], row[2]) for row in content.tables[0].rows}


def test_the_dictionary_shipped_with_the_program_is_the_one_users_are_given():
    assert thesis_dictionary().atoms == load_dictionary(CONFIGS / "thesis_dictionary.yaml").atoms


def test_the_record_has_the_size_of_table_5_1_and_no_fault_is_declared_in_it(made: Callable[[str], ReportContent]):
    found = cells(made("thesis-5-1"))
    assert found["samples"] == ("3172 (table 5-1)", "3172")
    assert found["sampling interval"] == ("0.01 s (table 5-1)", "0.01 s")
    assert found["faults declared in it by the default method"][1] == "none"


def test_the_signals_are_those_of_the_listing(made: Callable[[str], ReportContent]):
    """Lines 103 to 109 of BFI_DataGen.m, written out."""
    t = np.arange(N) / RATE

    def switched(start: int, values: np.ndarray) -> np.ndarray:
        return np.where(np.arange(N) >= start, values, 0.0)

    def part(divisor: float) -> int:
        return int(np.ceil(N / divisor))

    drift = np.concatenate([np.zeros(part(4)), 0.23 * t[: N - N // 4]])
    listing = [
        switched(20, np.sin(4.5 * np.pi * t)),
        switched(part(2.3), np.ones(N)),
        switched(part(5), np.sin(2.3 * np.pi * t)),
        switched(part(3), np.cos(2.25 * np.pi * t)),
        switched(part(6), np.sin(0.7 * np.pi * t)),
        drift,
        switched(part(5), np.ones(N)),
    ]
    panels = made("thesis-5-2").drawings[0].panels
    assert len(panels) == 7
    for panel, signal in zip(panels, listing, strict=True):
        np.testing.assert_allclose(panel.curves[0].y, signal, rtol=0, atol=1e-9)


def test_the_starts_are_those_of_table_5_2_to_a_sample(made: Callable[[str], ReportContent]):
    for published, ours in cells(made("thesis-5-2")).values():
        assert float(ours.removesuffix(" s")) == pytest.approx(float(published.split(" s ")[0]), abs=0.011)


@pytest.mark.slow
def test_the_perturbed_fault_is_equation_5_8(made: Callable[[str], ReportContent]):
    fault = made("thesis-5-7").drawings[0].panels[-1].curves[0]
    expected = 4.0 * (fault.x >= 13.795) + 0.2 * np.cos(4.5 * np.pi * fault.x) * (fault.x >= 11.995)
    np.testing.assert_allclose(fault.y, expected, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_the_start_of_the_bias_of_equation_5_12_is_found_to_a_sample_at_10_hz(made: Callable[[str], ReportContent]):
    content = made("thesis-5-13")
    fault = content.drawings[0].panels[-1].curves[0]
    np.testing.assert_allclose(fault.y, 5.0 * (fault.x >= 14.995), rtol=0, atol=1e-9)
    for record in ("no noise", "noise 0.01 m/s"):
        found = cells(content)[f"scan over all starts, ours, {record}"][1]
        assert found.startswith("bias of 5 m/s from 15 s")
        assert ";" not in found
    assert content.heading == "Start found by the scan"


@pytest.mark.slow
def test_times_count_from_the_start_of_a_log_of_the_user(made: Callable[[str], ReportContent]):
    """The same flight, its clock 100 s ahead, gives the same fault 100 s later."""
    import dataclasses

    log = thesis_record(Settings())
    later = dataclasses.replace(log, time_s=log.time_s + 100.0)
    here, there = made("thesis-5-13"), run("thesis-5-13", Settings(log=later, quick=True))
    one, other = (content.drawings[0].panels[-1].curves[0] for content in (here, there))
    np.testing.assert_array_equal(one.y, other.y)
    assert other.x[0] == 100.0
