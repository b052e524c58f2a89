"""Which faults of a dictionary are in a log: the answer as Python objects, and its signals.

python docs/examples/identify.py [FOLDER]    with a folder, the corrected airspeed goes to corrected.csv there
"""

import sys
from pathlib import Path

import numpy as np

from bfi_cli import Config, identify, load_dictionary, merge, read_log

ROOT = Path(__file__).resolve().parents[2]

log = read_log(ROOT / "data" / "citation_two_faults.h5")
dictionary = load_dictionary(ROOT / "configs" / "thesis_dictionary.yaml")
config = merge(Config(), {"conditioning.rate_hz": 10.0, "inputs": ["elevator"], "outputs": ["tas"]})
result = identify(log, dictionary, config)

print(f"decision: {result.decision}, order {result.model.order}")
for fault in result.faults:
    low, high = fault.ci95
    print(f"{fault.name}: {fault.magnitude:.3f} {fault.unit}, 95 % interval {low:.3f} to {high:.3f}")
for candidate in result.candidates:
    if candidate.minimal_detectable is not None and candidate.state != "declared":
        limit = f"{candidate.minimal_detectable:.2g} {candidate.unit or '(factor)'}"
        print(f"{candidate.name}: {candidate.state}, would be declared from {limit} on")
print(", ".join(f"{kind}: {verdict}" for kind, verdict in result.verdicts.items()))
for note in result.notes:
    print("note:", note)

if len(sys.argv) > 1:
    (airspeed,) = result.outputs
    columns = np.column_stack([result.time_s, airspeed.measured, airspeed.corrected])
    np.savetxt(Path(sys.argv[1]) / "corrected.csv", columns, delimiter=",", header="time,measured,corrected")
