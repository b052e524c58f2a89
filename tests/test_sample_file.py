"""A dictionary of a stranger opens no file outside its folder; what the user names is opened wherever it lies."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.config import load_config, merge
from bfi_cli.errors import ConfigError, DictionaryError
from bfi_cli.faults.shapes import lies_inside, read_samples, sample_bytes
from bfi_cli.flightlog import write_log

T = time_axis(duration_s=60.0, rate_hz=10.0)
REFUSED = "'../shape.csv' lies outside the {}'s folder; move it there or give --allow-outside\n"
ATOM = "{name: own, shape: samples, file: ../shape.csv, onset_s: 20}"
ANALYSIS = "conditioning: {rate_hz: none}\nmodel: {order: 2}\n"
LINES = {
    "dictionary given/d.yaml": "given/d.yaml: atoms[0].file: " + REFUSED.format("dictionary"),
    "dictionary given/d.yaml log.h5": "given/d.yaml: atoms[0].file: " + REFUSED.format("dictionary"),
    "identify log.h5 -d given/d.yaml": "given/d.yaml: atoms[0].file: " + REFUSED.format("dictionary"),
    "identify log.h5 -c given/names.yaml": "given/d.yaml: atoms[0].file: " + REFUSED.format("dictionary"),
    "identify log.h5 -c given/holds.yaml": "given/holds.yaml: dictionary.atoms[0].file: "
    + REFUSED.format("dictionary"),
    "diagnosability log.h5 -d given/d.yaml": "given/d.yaml: atoms[0].file: " + REFUSED.format("dictionary"),
    "montecarlo -c given/sweep.yaml": "given/d.yaml: atoms[0].file: " + REFUSED.format("dictionary"),
    "start-time log.h5 -c given/scan.yaml": "given/scan.yaml: start_time.samples: " + REFUSED.format("configuration"),
    "calibrate log.h5 -o t.json -c given/scan.yaml": "given/scan.yaml: start_time.samples: "
    + REFUSED.format("configuration"),
    "detect log.h5 -c given/scan.yaml --input elevator --output tas": "given/scan.yaml: start_time.samples: "
    + REFUSED.format("configuration"),
}


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory: a log, a shape of the user's own, a folder `given` by a stranger."""
    monkeypatch.chdir(tmp_path)
    flight = simulate(
        MODELS["citation"],
        manoeuvre("multisine", T, step_s=1.0),
        rng=np.random.default_rng(0),
        rate_hz=10.0,
        noise_sd={"tas": 0.01},
    )
    write_log(flight, "log.h5")
    Path("shape.csv").write_text("0,0\n1,1\n5,3\n")
    given = tmp_path / "given"
    given.mkdir()
    (given / "d.yaml").write_text(f"atoms: [{ATOM}]")
    (given / "names.yaml").write_text(f"dictionary: d.yaml\n{ANALYSIS}")
    (given / "holds.yaml").write_text(f"dictionary: {{atoms: [{ATOM}]}}\n{ANALYSIS}")
    (given / "scan.yaml").write_text(
        f"start_time: {{shapes: [samples], samples: ../shape.csv, calibration: gaussian}}\n{ANALYSIS}"
    )
    record = "record: {log: ../log.h5}\ndictionary: d.yaml\nactive: 1\nmagnitudes: [2]\ntrials: 1\n"
    (given / "sweep.yaml").write_text(f"{record}identify: {{model: {{order: 2}}, conditioning: {{rate_hz: none}}}}\n")
    return tmp_path


@pytest.mark.first_rows(7)
@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("line", LINES)
def test_files_outside_are_refused_unless_they_are_allowed(bfi: Callable, desk: Path, line: str):
    refused = bfi(*line.split())
    assert (refused.code, refused.stdout, refused.stderr) == (2, "", LINES[line])
    allowed = bfi(*line.split(), "--allow-outside")
    assert allowed.code == 0, allowed.stderr


@pytest.mark.parametrize(
    "line",
    [
        "inject log.h5 --fault samples,file=given/../shape.csv,onset_s=20 -o new.h5",
        "start-time log.h5 --shape samples --samples {desk}/shape.csv --calibration gaussian --order 2 --rate none",
    ],
)
def test_files_the_user_names_are_read_wherever_they_lie(bfi: Callable, desk: Path, line: str):
    (desk / "elsewhere").mkdir()
    outcome = bfi(*line.format(desk=desk).split())
    assert outcome.code == 0, outcome.stderr


@pytest.mark.usefixtures("unscanned")
def test_a_log_opens_no_file(bfi: Callable, desk: Path):
    """The truth of a log may name a file; it is compared only where the dictionary names the same file."""
    (desk / "d.yaml").write_text("atoms: [{name: own, shape: samples, file: shape.csv, onset_s: 20}]")
    spec = "samples,file=shape.csv,magnitude=2,onset_s=20"
    assert bfi("inject", "log.h5", "--fault", spec, "-o", "faulty.h5").code == 0
    options = ["-d", "d.yaml", "--order", "2", "--rate", "none"]

    def truth() -> dict[str, object]:
        outcome = bfi("identify", "faulty.h5", *options, "--json")
        assert outcome.code == 0, outcome.stderr
        return json.loads(outcome.stdout)["truth"]

    assert truth()["isolated"]
    os.mkfifo("pipe")  # to open it would wait for ever
    with h5py.File("faulty.h5", "a") as file:
        fault = {"shape": "samples", "name": "stranger", "file": "pipe", "channel": "tas", "onset_s": 20.0}
        file["truth"].attrs["faults"] = json.dumps([fault])
    assert truth()["missed"] == ["stranger"]


def test_links_are_followed_and_files_need_not_exist(tmp_path: Path):
    folder, outside = tmp_path / "folder", tmp_path / "outside"
    folder.mkdir()
    outside.mkdir()
    (folder / "away").symlink_to(outside)
    (folder / "back").symlink_to(folder / "deep")
    (folder / "loop").symlink_to("loop")
    (tmp_path / "link").symlink_to(folder)
    for inside in ("a.csv", "deep/a.csv", "../folder/a.csv", "back/a.csv", "loop", "../link/a.csv"):
        assert lies_inside(folder / inside, folder), inside
        assert lies_inside(tmp_path / "link" / inside, tmp_path / "link"), inside
    for away in ("../a.csv", "away/a.csv", "away", "../folder2/a.csv", "/etc/passwd", "back/../../a.csv"):
        assert not lies_inside(folder / away, folder), away


def test_a_configuration_stays_usable_from_another_folder(desk: Path, monkeypatch: pytest.MonkeyPatch):
    """What was inside when the file was read is not asked again with the values of the command line."""
    (desk / "given" / "shape.csv").write_text("0,0\n1,1\n")
    path = desk / "given" / "inside.yaml"
    path.write_text("dictionary: {atoms: [{shape: samples, file: shape.csv}]}\n")
    (desk / "deep").mkdir()
    monkeypatch.chdir(desk / "deep")
    config = merge(load_config(path), {"seed": 3})
    assert Path(config.load_dictionary().atoms[0].file).samefile(desk / "given" / "shape.csv")
    with pytest.raises(ConfigError, match="lies outside"):
        load_config(desk / "given" / "holds.yaml")


def test_endless_and_large_files_are_refused(tmp_path: Path):
    with pytest.raises(DictionaryError, match="/dev/zero: cannot read the samples, larger than 20 MB; give"):
        sample_bytes("/dev/zero")
    path = tmp_path / "secret"
    path.write_text("root:x:0:0:the password\n1,2\nanother secret,3\n")
    with pytest.raises(DictionaryError) as refusal:
        read_samples(str(path))
    assert str(refusal.value) == f"{path}: line 3: not two finite numbers; each line is time in s, value"
