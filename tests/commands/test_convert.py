"""`bfi convert` on small real files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bfi_cli.flightlog import read_log

T = np.arange(0.0, 30.0, 0.02)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.csv"
    rows = "\n".join(f"{t!r};{x!r}" for t, x in zip(T.tolist(), np.sin(0.3 * T).tolist(), strict=True))
    path.write_text(f"t [s];vtas [kt]\n{rows}\n")
    return path


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_names_and_units_are_normalised(bfi, log: Path, tmp_path: Path, suffix: str):
    out = tmp_path / f"out{suffix}"
    outcome = bfi("convert", log, "-o", out, "--json")
    assert (outcome.code, outcome.stderr) == (0, "")
    document = json.loads(outcome.stdout)
    assert (document["kind"], document["n_samples"]) == ("convert", 1500)
    np.testing.assert_array_equal(read_log(out).channels["tas"].values, read_log(log).channels["tas"].values)
    assert read_log(out).channels["tas"].source_unit == "m/s"


def test_converting_twice_gives_the_same_file(bfi, log: Path, tmp_path: Path):
    bfi("convert", log, "-o", tmp_path / "a.csv")
    bfi("convert", tmp_path / "a.csv", "-o", tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_rate_window_unit_and_channel(bfi, log: Path, tmp_path: Path):
    out = tmp_path / "out.h5"
    options = ["--rate", 5, "--from", 10, "--to", 20, "--channel", "cas=vtas", "--unit", "vtas=m/s"]
    assert bfi("convert", log, "-o", out, *options).code == 0
    back = read_log(out)
    assert back.rate_hz == pytest.approx(5.0)
    assert back.n_samples == 50
    assert list(back.channels) == ["cas"]
    np.testing.assert_allclose(back.channels["cas"].values, np.sin(0.3 * back.time_s), rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["-o", "OUT/out.xlsx"], 2, "no format with the suffix '.xlsx'; name the file .h5, .csv or .mcap"),
        (["-o", "OUT/flight.csv"], 2, "flight.csv: is an input of this command; give another --output"),
        (["-o", "OUT/out.h5", "--rate", "100"], 3, "recorded at 50 Hz, it cannot be resampled to 100 Hz"),
        (["-o", "OUT/out.h5", "--rate", "fast"], 2, "--rate"),
        ([], 2, "-o"),
    ],
)
def test_what_the_user_can_mend_is_one_line(
    bfi, log: Path, tmp_path: Path, options: list[str], code: int, message: str
):
    outcome = bfi("convert", log, *(word.replace("OUT", str(tmp_path)) for word in options))
    assert outcome.code == code
    assert message in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["flight.csv"]
