"""The compiled routines are those of scipy, whether they are imported before it or after."""

from __future__ import annotations

import subprocess
import sys

import pytest

PUBLIC = "import scipy.linalg.lapack as public"
OURS = "from bfi_cli.kernels.lapack import lapack; import sys"


@pytest.mark.parametrize("lines", [(OURS, "assert 'scipy.linalg' not in sys.modules", PUBLIC), (PUBLIC, OURS)])
def test_routines_are_those_of_scipy(lines: tuple[str, ...]):
    program = "; ".join((*lines, "assert lapack.dgeqp3 is public.dgeqp3"))
    subprocess.run([sys.executable, "-c", program], check=True)


def test_nothing_else_of_scipy_is_on_the_way_to_an_answer():
    program = "import bfi_cli.analysis, sys; assert not {'scipy.linalg', 'scipy.special'} & {*sys.modules}"
    subprocess.run([sys.executable, "-c", program], check=True)
