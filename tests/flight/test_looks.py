"""The scan of windows: what the threshold of each depends on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bfi_cli.decision.calibration import null_from
from bfi_cli.flight import looks
from bfi_cli.flight.looks import Scanned, scan_flight
from bfi_cli.flight.parity import ScanKey, Threshold
from bfi_cli.flight.parity.windows import Window
from bfi_cli.flightlog.phases import Phase

AT = Threshold(level=9.0, suspected=6.0, null=null_from({"largest": np.arange(1.0, 100.0)}))
WINDOW = (0.0, 60.0)


def flight_with(lasting: tuple[str, ...]) -> SimpleNamespace:
    ratios = SimpleNamespace(
        weighted=lambda weights: (np.ones((1, 2)), np.ones((1, 2))),
        needed=lambda level: np.full((1, 2), np.sqrt(level)),
    )
    scan = SimpleNamespace(
        kinds=(SimpleNamespace(name="lift"),),
        constants=SimpleNamespace(knows_zero_lift=False),
        faults=("tas",),
        strongest=("tas", 20.0),
        ratios=ratios,
        weights=None,
        lacking={},
        statistic=4.0,
        onsets_s=np.array([10.0, 20.0]),
    )
    return SimpleNamespace(lasting_in=lambda window: lasting, scan=lambda window: scan)


def scanned(lasting: tuple[str, ...], kept: list[Scanned]) -> tuple[Scanned, list[ScanKey]]:
    asked: list[ScanKey] = []

    def threshold(key: ScanKey) -> Threshold:
        asked.append(key)
        return AT

    (one,) = scan_flight(flight_with(lasting), [WINDOW], threshold, kept=kept)  # type: ignore[arg-type]
    return one, asked


@pytest.mark.parametrize("lasting", [(), ("aoa",)])
def test_a_window_beside_a_fault_that_lasts_has_the_threshold_of_such_windows(lasting: tuple[str, ...]):
    one, (key,) = scanned(lasting, [])
    assert (one.fault, one.onset_s, one.lasting) == ("tas", 20.0, lasting)
    assert one.declared["tas"] == pytest.approx(np.sqrt(AT.level) + 1.2816, rel=1e-4)  # with 90 % power, sd 1
    assert key == ScanKey(residuals=("lift",), length_s=60.0, knows_zero_lift=False, beside=bool(lasting))


@pytest.mark.parametrize(("lasting", "n_made"), [((), 0), (("aoa",), 1)])
def test_a_scan_is_made_again_where_other_faults_last(lasting: tuple[str, ...], n_made: int):
    kept, _ = scanned((), [])
    _, asked = scanned(lasting, [kept])
    assert len(asked) == n_made


@dataclass(frozen=True)
class Rough:
    """A flight whose windows show 1, 2, 3 times what the table does, and so on; the angle of zero lift is free."""

    statistics: Iterator[int]
    phases: tuple[Phase, ...]
    zero_lift: float | None = 0.1
    tables: tuple[()] = ()

    def scan(self, window: Window) -> SimpleNamespace:
        assert self.zero_lift is None
        return SimpleNamespace(
            kinds=(), statistic=float(next(self.statistics)), constants=SimpleNamespace(knows_zero_lift=False)
        )


@pytest.mark.parametrize(("n_windows", "scale"), [(9, 1.0), (10, 3.25), (21, 6.0)])
def test_the_calmest_quarter_of_ten_windows_says_how_rough_a_flight_is(
    monkeypatch: pytest.MonkeyPatch, n_windows: int, scale: float
):
    """A fault fills fewer of them, and what fills most but not the calmest quarter raises no threshold."""
    monkeypatch.setattr(looks, "table_for", lambda tables, key: SimpleNamespace(statistics=np.ones(5)))
    flown = Phase(phase="cruise", from_s=0.0, to_s=120.0 * n_windows)
    rough: Any = Rough(statistics=iter(range(1, n_windows + 1)), phases=(flown,))
    assert looks.scale_of(rough) == pytest.approx(scale)
