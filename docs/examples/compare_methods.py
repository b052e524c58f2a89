"""The default method beside the published one on the same log, with and without a fault.

python docs/examples/compare_methods.py
"""

from pathlib import Path

from bfi_cli import Config, identify, load_dictionary, merge, read_log

ROOT = Path(__file__).resolve().parents[2]

dictionary = load_dictionary(ROOT / "configs" / "thesis_dictionary.yaml")
for name in ("citation_bias.h5", "citation_clean.h5"):
    log = read_log(ROOT / "data" / name)
    for method in ("ml", "risro"):
        config = merge(Config(), {"method": method, "conditioning.rate_hz": 10.0, "model.order": 6})
        result = identify(log, dictionary, config)
        found = ", ".join(f"{fault.name} {fault.magnitude:.3f}" for fault in result.faults) or "nothing"
        print(f"{name}, {method}: {result.decision}, {found}")
