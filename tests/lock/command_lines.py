"""The command lines whose answers are stored, and the files that they read beside those of data/ and configs/."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from made_journeys import made_journey, write_journey

from bfi_cli.flightlog import write_log

ROOT = Path(__file__).resolve().parents[2]

SWEEP = """\
record: {model: citation, manoeuvre: "3211"}
noise: {tas: [0.01]}
dictionary: configs/thesis_dictionary.yaml
active: [1, 2]
trials: 3
grid:
  method: [ml, risro]
"""
RECORDED = """\
Time,TrueAirspeed [kt],Elevator [deg],Remark
0.0,200.0,1.0,start
0.1,200.5,1.1,
0.2,201.0,
"""


def _write_cruise(path: Path) -> None:
    """Write the journey without the elevator, so that no scan for steps takes its time."""
    log = made_journey()
    write_log(
        replace(log, channels={name: channel for name, channel in log.channels.items() if name != "elevator"}), path
    )


def _text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content, "utf-8")


# By name, the function or the command line that writes the file; a command line may read others of the table.
FILES: dict[str, str | Callable[[Path], object]] = {
    "journey.h5": write_journey,
    "cruise.h5": _write_cruise,
    "drifting.h5": "inject cruise.h5 --fault drift,channel=tas,magnitude=0.05,onset_s=430",
    "icing.h5": "inject cruise.h5 --fault pitot_icing,magnitude=0.002,onset_s=430",
    "blocked.h5": "inject cruise.h5 --fault pitot_blocked,onset_s=430,offset_s=480",
    "static.h5": "inject cruise.h5 --fault static_blocked,onset_s=730",
    "vane.h5": "inject cruise.h5 --fault drift,channel=aoa,magnitude=0.0008,onset_s=430",
    "attitude.h5": "inject cruise.h5 --fault bias,channel=pitch,magnitude=0.06,onset_s=450",
    "stepping.h5": "inject journey.h5 --fault bias,channel=tas,magnitude=6,onset_s=430",
    "oscillating.h5": "inject journey.h5 --fault sine,channel=tas,magnitude=4,frequency_hz=0.2,onset_s=430",
    "gusty.h5": "simulate citation --duration 60 --manoeuvre 3211-pairs --rate 20 --turbulence 0.1 --noise tas=0.05"
    " --noise pitch_rate=0.001 --seed 3",
    "gusty_lag.h5": "inject gusty.h5 --fault lagged_bias,channel=tas,magnitude=2,time_constant_s=2,onset_s=30",
    "b747.h5": "simulate b747 --duration 30 --rate 20 --noise pitch_rate=0.0001 --seed 4",
    "coarse.h5": "simulate citation --quantum tas=0.25 --seed 5",
    "resampled.csv": "convert data/citation_bias.h5 --rate 20",
    "copied.h5": lambda path: shutil.copy(ROOT / "data" / "citation_clean.h5", path),
    "remarks.csv": _text(RECORDED),
    "sweep.yaml": _text(SWEEP),
    "misspelt.yaml": _text("window: {from: 3}\n"),
    "no_atoms.yaml": _text("atoms: []\n"),
    "damaged.json": _text('{"kind": "identify", "schema": 3}'),
}

# Answers of which numbers hang on the rounding of a processor: simulations without noise, whose regressors follow from
# others to round-off, digests of files and tables, what a window far below its threshold would be.
ROUNDED = frozenset(
    (
        *("plot_journey", "identify_thesis", "identify_two_faults", "identify_clean", "identify_outputs"),
        *("identify_rate_and_order", "identify_together", "identify_arx", "identify_fails_on_fault"),
        *("diagnose_icing", "diagnose_static", "calibrate", "compare", "reproduce_fir"),
    )
)

# By name, the command line. The names are those of the stored answers.
LINES: dict[str, str] = {
    "info_bias": "info data/citation_bias.h5 --json",
    "info_csv": "info data/citation_bias.csv --json",
    "info_ulog": "info data/px4_bias.ulg --json",
    "info_window": "info data/citation_clean.h5 --from 5 --to 20 --units aviation --json",
    "info_journey": "info journey.h5 --json",
    "info_coarse": "info coarse.h5 --json",
    "info_resampled": "info resampled.csv --json",
    "info_b747": "info b747.h5 --json",
    "plot_journey": "plot journey.h5 --json",
    "plot_difference": "plot data/citation_bias.h5 data/citation_clean.h5 --diff --json",
    "convert_ulog": "convert data/px4_bias.ulg -o px4.h5 --json",
    "convert_rate": "convert data/citation_clean.h5 --rate 10 -o slow.csv --json",
    "simulate_citation": "simulate citation --noise tas=0.01 --seed 1 -o citation.h5 --json",
    "simulate_f16": "simulate f16 --duration 10 --rate 20 -o f16.h5 --json",
    "inject_two": "inject data/citation_clean.h5 --fault drift,channel=tas,magnitude=1.5,onset_s=12"
    " --fault bias,channel=tas,magnitude=-2,onset_s=20 -o two.h5 --json",
    "dictionary_alone": "dictionary configs/thesis_dictionary.yaml --duration 31.72 --json",
    "dictionary_on_a_log": "dictionary configs/thesis_dictionary.yaml data/citation_clean.h5 --json",
    "dictionary_b747": "dictionary configs/mf2d_dictionary.yaml --duration 30 --json",
    "diagnosability_log": "diagnosability data/citation_clean.h5 -d configs/thesis_dictionary.yaml --json",
    "diagnosability_model": "diagnosability --model citation --noise tas=0.01 --draws 2"
    " -d configs/thesis_dictionary.yaml --json",
    "identify_thesis": "identify data/citation_bias.h5 -d configs/thesis_dictionary.yaml --json",
    "identify_two_faults": "identify data/citation_two_faults.h5 -d configs/thesis_dictionary.yaml --json",
    "identify_clean": "identify data/citation_clean.h5 -d configs/thesis_dictionary.yaml --json",
    "identify_csv": "identify data/citation_bias.csv --json",
    "identify_ulog": "identify data/px4_bias.ulg -d airdata --json",
    "identify_outputs": "identify data/citation_bias.h5 -d configs/thesis_dictionary.yaml"
    " --output tas --output pitch_rate --rate 10 --json",
    "identify_rate_and_order": "identify data/citation_two_faults.h5 --rate 10 --order 4 --json",
    "identify_step": "identify stepping.h5 -d airdata --input auto --from 400 --to 480 --json",
    "identify_icing": "identify icing.h5 -d airdata --input auto --from 400 --to 480 --json",
    "identify_lag": "identify gusty_lag.h5 -d airdata --json",
    "identify_together": "identify data/citation_bias.h5 data/citation_clean.h5 --together"
    " -d configs/thesis_dictionary.yaml --json",
    "identify_risro": "identify data/citation_bias.h5 -d configs/thesis_dictionary.yaml --method risro --json",
    "identify_published": "identify data/citation_two_faults.h5 -d configs/thesis_dictionary.yaml"
    " --method risro-as-published --rate 20 --json",
    "identify_arx": "identify data/citation_bias.h5 -d configs/thesis_dictionary.yaml --method arx-residual --json",
    "identify_dmae": "identify data/citation_bias.h5 -d configs/thesis_dictionary.yaml --method dmae --model citation"
    " --json",
    "identify_fails_on_fault": "identify data/citation_bias.h5 -d configs/listing_dictionary.yaml --fail-on fault"
    " --json",
    "start_time_bias": "start-time data/citation_bias.h5 --json",
    "start_time_clean": "start-time data/citation_clean.h5 --json",
    "start_time_csv": "start-time data/citation_bias.csv --shape bias --rate 5 --ends --json",
    "start_time_ulog": "start-time data/px4_bias.ulg --json",
    "start_time_oscillating": "start-time oscillating.h5 --input auto --from 400 --to 480 --json",
    "start_time_thesis": "start-time data/citation_bias.h5 --method thesis --rate 10 --json",
    "diagnose_healthy": "diagnose cruise.h5 --workers 1 --json",
    "diagnose_step": "diagnose stepping.h5 --workers 1 --from 400 --to 540 --json",
    "diagnose_drift": "diagnose drifting.h5 --workers 1 --from 330 --to 620 --json",
    "diagnose_icing": "diagnose icing.h5 --workers 1 --from 330 --to 620 --json",
    "diagnose_blocked": "diagnose blocked.h5 --workers 1 --from 330 --to 620 --json",
    "diagnose_static": "diagnose static.h5 --workers 1 --from 600 --to 880 --json",
    "diagnose_vane": "diagnose vane.h5 --workers 1 --from 330 --to 620 --json",
    "diagnose_attitude": "diagnose attitude.h5 --workers 1 --from 330 --to 620 --json",
    "diagnose_ulog": "diagnose data/px4_bias.ulg --workers 1 --json",
    "detect_bias": "detect data/citation_bias.h5 --json",
    "detect_strict": "detect data/citation_bias.csv --strict --json",
    "detect_journey": "detect stepping.h5 --train 240:400 --from 240 --to 620 --json",
    "calibrate": "calibrate data/citation_clean.h5 gusty.h5 --rate 10 --length 20 -o table.json --json",
    "compare": "compare data/citation_bias.h5 -d configs/thesis_dictionary.yaml --rate 10 --only ml"
    " --only null-space --only arx-residual --json",
    "montecarlo": "montecarlo -c sweep.yaml --seed 1 --out sweep --json",
    "reproduce_fir": "reproduce fir --quick --trials 2 --json",
    "reproduce_thesis": "reproduce thesis-5-14 --quick --json",
    # Errors: the answer is the code and a line.
    "no_command": "identity data/citation_bias.h5 --json",
    "no_file": "identify absent.h5 --json",
    "no_log": "info misspelt.yaml --json",
    "no_channel": "identify data/citation_bias.csv --input throttle --json",
    "no_unit": "identify data/citation_bias.csv --unit tas=furlong --json",
    "no_window": "start-time data/citation_bias.h5 --from 30 --json",
    "no_number": "start-time data/citation_bias.h5 --order several --json",
    "no_key": "identify data/citation_bias.h5 -c misspelt.yaml --json",
    "no_atoms": "identify data/citation_bias.h5 -d no_atoms.yaml --json",
    "no_shape": "inject copied.h5 --fault bais,channel=tas,magnitude=1 -o other.h5 --json",
    "no_input_replaced": "convert copied.h5 -o copied.h5 --force --json",
    "no_text": "info remarks.csv --json",
    "no_result": "report damaged.json --json",
    "no_name": "reproduce thesis-9-9 --json",
}

# Lines that are run with the fast tests, two seconds or less each.
FAST = (
    "info_bias",
    "convert_rate",
    "dictionary_alone",
    "identify_clean",
    "detect_bias",
    "no_channel",
    "no_key",
)
