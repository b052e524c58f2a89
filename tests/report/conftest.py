"""The four answers an identification can give, made by hand, and their figures, drawn once."""

import made_results
import pytest

from bfi_cli.model.report import identify_content
from bfi_cli.report.figures import draw
from bfi_cli.report.style import to_svg

MAKERS = {
    "fault": made_results.fault_result,
    "two-outputs": made_results.two_output_result,
    "no-fault": made_results.no_fault_result,
    "inconclusive": made_results.inconclusive_result,
}


@pytest.fixture(params=MAKERS, scope="session")
def result(request):
    return MAKERS[request.param]()


@pytest.fixture(params=["fault", "two-outputs", "inconclusive"], scope="session")
def drawn(request):
    return MAKERS[request.param]()


@pytest.fixture(scope="session")
def figures(drawn):
    return {drawing.name: draw(drawing) for drawing in identify_content(drawn).drawings}


@pytest.fixture(scope="session")
def vectors(figures):
    return {name: to_svg(figure) for name, figure in figures.items()}


@pytest.fixture(scope="session")
def provenance():
    return made_results.PROVENANCE
