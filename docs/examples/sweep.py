"""A Monte Carlo sweep: how often are the right faults isolated, by two methods.

python docs/examples/sweep.py
"""

from pathlib import Path

from bfi_cli.lab.montecarlo import load_sweep, run_sweep, summarise

ROOT = Path(__file__).resolve().parents[2]

if __name__ == "__main__":  # worker processes import this file
    sweep = load_sweep(ROOT / "configs" / "montecarlo_noise.yaml", trials=3, seed=1)
    for scenario in summarise(sweep, run_sweep(sweep, workers=2)).scenarios:
        isolated = scenario.isolation_rate
        print(f"{scenario.name}: {isolated.count} of {isolated.of} isolated")
