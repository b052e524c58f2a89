"""A dictionary of your own: single entries, a grid of onsets, and a shape given by samples; then its audit on a log.

python docs/examples/own_dictionary.py
"""

import tempfile
from pathlib import Path

import numpy as np

from bfi_cli import Config, load_dictionary, read_log
from bfi_cli.audit import audit_on_log

ROOT = Path(__file__).resolve().parents[2]

with tempfile.TemporaryDirectory() as folder:
    time_s = np.arange(0.0, 10.1, 0.1)
    shape = np.column_stack([time_s, 1.0 - np.cos(0.2 * np.pi * time_s)])
    np.savetxt(Path(folder) / "swell.csv", shape, delimiter=",", header="time,value", comments="")
    dictionary = load_dictionary(
        {
            "channel": "tas",
            "relative_to": "window",
            "atoms": [{"name": "swell", "shape": "samples", "file": "swell.csv", "onset_s": 12.0, "offset_s": 22.0}],
            "grids": [{"shape": "bias", "onset_s": {"start": 8.0, "stop": 24.0, "step": 4.0}}],
        },
        folder=Path(folder),
    )
    audit = audit_on_log(read_log(ROOT / "data" / "citation_clean.h5"), dictionary, Config())

for atom in audit.atoms:
    limit = "not at all where its onset is not exact"
    if atom.minimal_detectable is not None:
        limit = f"from {atom.minimal_detectable:.2g} on"
    print(f"{atom.name}: detectable {limit}")
