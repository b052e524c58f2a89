"""When did a fault start, and which shape has it: the scan over all onsets, with the profile of every shape.

python docs/examples/scan_onsets.py
"""

from pathlib import Path

from bfi_cli import Config, merge, read_log, start_time

ROOT = Path(__file__).resolve().parents[2]

log = read_log(ROOT / "data" / "citation_bias.csv")
config = merge(Config(), {"conditioning.rate_hz": 10.0, "model.order": 4, "start_time.shapes": ["bias", "drift"]})
result = start_time(log, config)

for found in result.faults:
    fault = found.fault
    low, high = found.onset_ci95
    print(f"{fault.shape} of {found.magnitude:.3f} from {fault.onset_s:.2f} s ({low:.2f} to {high:.2f} s)")
for profile in result.profiles:
    best = int(profile.statistic.argmax())
    print(f"{profile.shape}: statistic {profile.statistic[best]:.1f} at {profile.onset_s[best]:.1f} s", end="")
    print(f", threshold {profile.threshold:.1f}, magnitude {profile.magnitude[best]:.3g} {profile.unit}")
