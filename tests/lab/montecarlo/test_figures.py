"""The figures of a sweep say what its summary says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bfi_cli.lab.montecarlo import Sweep, montecarlo_content, run_sweep, summarise, summary_document
from bfi_cli.report.figures import draw
from bfi_cli.report.style import to_svg
from bfi_cli.serialization import provenance

HEAD = "record: {model: citation, rate_hz: 10, duration_s: 30}\ndictionary: dictionary.yaml\n"
OWN = "identify: {conditioning: {rate_hz: none}, method: risro}"


@pytest.fixture
def swept(sweep: Callable[..., Sweep]) -> Callable[[str], dict[str, Any]]:
    """Run a sweep and return its document."""

    def run(text: str) -> dict[str, Any]:
        whole = sweep(text)
        return summary_document(summarise(whole, run_sweep(whole)), provenance(log_sha256=""), digest="")

    return run


def test_rates_and_their_intervals_are_where_they_belong(swept: Callable[[str], dict[str, Any]]):
    document = swept(f"{HEAD}active: [1, 3]\ntrials: 4\n{OWN}\ngrid: {{model.order: [4, 90]}}\n")
    (axes,) = draw(montecarlo_content(document).drawings[0]).axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["model.order=4", "model.order=90"]
    for bars, order, share in zip(axes.containers, (4, 90), (1.0, 0.0), strict=True):
        line, _, (segments,) = bars.lines
        np.testing.assert_allclose(np.array(line.get_xdata(), dtype=float), [1, 3], atol=0.31)
        np.testing.assert_allclose(line.get_ydata(), 100.0 * share)
        scenarios = [one for one in document["scenarios"] if one["axes"]["model.order"] == order]
        ends = [np.sort(segment[:, 1]) for segment in segments.get_segments()]
        np.testing.assert_allclose(
            ends, [100.0 * np.array(one["isolation_rate"]["ci95"]) for one in scenarios], atol=1e-9
        )


@pytest.mark.slow
def test_medians_of_the_errors(swept: Callable[[str], dict[str, Any]]):
    document = swept(f"{HEAD}active: [0, 1, 2]\ntrials: 5\n{OWN}\n")
    (axes,) = draw(montecarlo_content(document).drawings[1]).axes
    medians = [one["magnitude_error"]["p50"] for one in document["scenarios"] if one["magnitude_error"]]
    drawn = [line.get_ydata() for line in axes.lines if len(line.get_ydata()) == 2 and np.ptp(line.get_ydata()) == 0]
    assert len(medians) == 2
    for median in medians:
        assert any(np.allclose(ends, median, rtol=1e-5) for ends in drawn)


@pytest.mark.first_rows(2)
@pytest.mark.parametrize(
    "text",
    [
        f"{HEAD}active: 0\ntrials: 1\n{OWN}\n",
        f"{HEAD}active: 2\ntrials: 1\n{OWN}\ngrid: {{model.order: [90, 91]}}\n",
        f"{HEAD}active: 2\ntrials: 1\n{OWN}\ngrid: {{model.order: [2, 3, 4, 5, 6, 7, 8]}}\n",
    ],
    ids=["no fault", "nothing but failures", "many curves"],
)
def test_every_sweep_can_be_drawn(swept: Callable[[str], dict[str, Any]], text: str):
    for drawing in montecarlo_content(swept(text)).drawings:
        assert to_svg(draw(drawing)) == to_svg(draw(drawing))
