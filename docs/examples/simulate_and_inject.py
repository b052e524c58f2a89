"""Fly a model, put a fault of your own into the log, identify it, and compare with the truth.

python docs/examples/simulate_and_inject.py [FOLDER]    with a folder, the log goes to flight.h5 there
"""

import sys
from pathlib import Path

from bfi_cli import Fault, identify, inject, simulate, write_log

clean = simulate("citation", amplitude=0.03, duration_s=40.0, noise_sd={"tas": 0.02}, seed=1)

fault = Fault(shape="lagged_bias", channel="tas", magnitude=-1.5, onset_s=20.0, time_constant_s=2.0)
log = inject(clean, [fault])
if len(sys.argv) > 1:
    write_log(log, Path(sys.argv[1]) / "flight.h5")

suspects = {
    "atoms": [{"shape": "lagged_bias", "time_constant_s": 2.0, "onset_s": 20.0}, {"shape": "bias", "onset_s": 20.0}]
}
result = identify(log, suspects)
print(f"decision: {result.decision}, isolated: {result.truth.isolated}")
for found in result.faults:
    print(f"{found.name}: {found.magnitude:.3f} {found.unit} +- {found.sd:.3f}, injected {fault.magnitude}")
