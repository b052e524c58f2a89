"""Faults of 0.2 to 10 tolerances in recorded flights, through several recorders, and what the verdicts say of them.

Every trial is drawn from its own number, so that any part of them can be run by itself and at any time:

    python tests/measurements/verdict_trials.py --first 0 --last 500 --results trials.jsonl

runs those of the first 500 that the file does not hold yet, and prints the counts of all that it holds.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy import signal, stats
from threadpoolctl import threadpool_limits

from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.decision import KINDS, decide, kind_of
from bfi_cli.decision.calibration import save_tables
from bfi_cli.decision.candidate import BUILD_UP_S
from bfi_cli.dictionary import Dictionary, load_dictionary
from bfi_cli.errors import LogError
from bfi_cli.faults import Fault, build_up_s, unit_signal
from bfi_cli.flightlog import FlightLog, read_log
from bfi_cli.flightlog.phases import airborne_stretches
from bfi_cli.flightlog.quality import with_seen_recorder
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model.onset import find_onset, table_of_windows
from bfi_cli.model.onset.scan_record import prepare_record
from bfi_cli.model.preprocessing.defaults import tolerance_of
from bfi_cli.serialization import provenance

FLIGHTS = Path(__file__).resolve().parents[3] / "shared" / "flights"
CITATION = ("citation_20180312_f1.h5", "citation_20190312_123416.h5")
DRONE = "px4_flight3"
# Standard deviation of the recorder's Gaussian, of which the flights' description says how it was read.
RECORDER_SD_S = 0.25
STEEPEST_PITCH = np.deg2rad(30.0)
INPUTS = (("elevator", "pitch", "longitudinal_acc"), ("elevator",), ("auto",))
REQUIRED = ("abrupt", "oscillating")
# Frequencies, time constants and durations of the drawn faults where they are not those of the dictionary.
HIGHEST_HZ, TIME_CONSTANTS_S, DURATIONS_S = 0.5, (1.0, 5.0), (2.0, 13.0)
SIZES = (0.2, 10.0)
COMMANDS = ("identify", "start-time", "identify from scan")
# What was between the fault and the log: its own recorder alone, or another one, or the log recorded once more by it.
RECORDERS: dict[str, tuple[str, float]] = {
    "fir 1.3 Hz": ("fir", 1.3),
    "butterworth 1 Hz": ("butter", 1.0),
    "causal 2 Hz": ("causal", 2.0),
    "again fir 0.5 Hz": ("fir", 0.5),
    "again butterworth 0.6 Hz": ("butter", 0.6),
    "again causal 0.8 Hz": ("causal", 0.8),
}
SHAPES = {
    "bias": {"shape": "bias"},
    "drift": {"shape": "drift"},
    "lagged_bias": {"shape": "lagged_bias", "time_constant_s": 5.0},
    "ramp_hold": {"shape": "ramp_hold", "duration_s": 10.0},
    "sine_0.2": {"shape": "sine", "frequency_hz": 0.2},
    "sine_0.05": {"shape": "sine", "frequency_hz": 0.05},
}


def gaussian(values: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return what the flights' recorder stores of a signal, its ends held."""
    lag = np.arange(-int(rate_hz), int(rate_hz) + 1)
    taps = np.exp(-0.5 * (lag / rate_hz / RECORDER_SD_S) ** 2)
    return np.convolve(np.pad(values, lag[-1], mode="edge"), taps / taps.sum(), mode="valid")


def through(values: np.ndarray, rate_hz: float, kind: str, edge_hz: float) -> np.ndarray:
    """Return a signal after another recorder: `fir` and `butter` without delay, `causal` with one; its ends held."""
    if kind == "fir":
        half = round(1.3 * rate_hz / edge_hz)
        taps = signal.firwin(2 * half + 1, edge_hz, window=("kaiser", 5.0), fs=rate_hz)
        return np.convolve(np.pad(values, half, mode="edge"), taps, mode="valid")
    if kind == "butter":
        return np.asarray(signal.sosfiltfilt(signal.butter(4, edge_hz, fs=rate_hz, output="sos"), values))
    sos = signal.butter(2, edge_hz, fs=rate_hz, output="sos")
    return np.asarray(signal.sosfilt(sos, values, zi=signal.sosfilt_zi(sos) * values[0])[0])


@dataclass(frozen=True)
class Trial:
    """What goes in.

    Attributes
    ----------
    flight : its file; recorder : its own, or one of `RECORDERS`.
    fault : on the log's axis; share : its largest error over the tolerance.
    from_s, to_s : the window.
    """

    number: int
    flight: str
    recorder: str
    inputs: tuple[str, ...]
    command: str
    from_s: float
    to_s: float
    fault: Fault
    share: float


def dictionary_of(length_s: float) -> Dictionary:
    """Return the six entries, all from the middle of the window; oscillations have six cycles or more."""
    atoms = [{"name": name, **keys, "channel": "tas", "onset_s": 0.5 * length_s} for name, keys in SHAPES.items()]
    for atom in atoms:
        if atom.get("frequency_hz"):
            atom["frequency_hz"] = max(float(str(atom["frequency_hz"])), 6.0 / length_s)
    return load_dictionary({"relative_to": "window", "atoms": atoms})


@cache
def flight_log(flight: str, recorder: str) -> FlightLog:
    """Return a flight, recorded once more where the recorder's name begins so."""
    log = read_log(FLIGHTS / flight)
    if not recorder.startswith("again"):
        return log
    channels = {
        name: replace(one, values=frozen_array(through(one.values, log.rate_hz, *RECORDERS[recorder])))
        for name, one in log.channels.items()
        if np.isfinite(one.values).all()
    }
    return with_seen_recorder(replace(log, channels=channels, filters=None))


@cache
def starts_s(flight: str, length_s: float) -> tuple[float, ...]:
    """Return where the airborne windows of a length begin, without a parabola."""
    log = flight_log(flight, "own")
    spans = [(700.0, 4200.0)] if flight in CITATION else airborne_stretches(log, suspects=["tas"])
    starts = np.concatenate([np.arange(first, last - length_s, 0.1 * length_s) for first, last in spans])
    pitch = log.channel("pitch").values
    steep = [np.abs(pitch[(log.time_s >= t) & (log.time_s <= t + length_s)]).max() > STEEPEST_PITCH for t in starts]
    return tuple(starts[~np.array(steep)].tolist())


def draw(number: int) -> Trial:
    """Return the trial of a number: half of all with the flights' own recorder, an eighth from the drone."""
    rng = np.random.default_rng([11, number])
    drone = rng.random() < 0.125
    flight = DRONE if drone else str(rng.choice(CITATION))
    recorder = "own" if drone or rng.random() < 0.5 else str(rng.choice(list(RECORDERS)))
    alone = drone or recorder.startswith("again")  # of which a table would have to be made for every set of inputs
    inputs = INPUTS[0] if alone else INPUTS[int(rng.choice(3, p=[0.5, 0.25, 0.25]))]
    length_s = float(rng.choice([20.0, 60.0])) if drone else 120.0
    from_s = float(rng.choice(starts_s(flight, length_s)))
    command = str(rng.choice(COMMANDS, p=[0.45, 0.45, 0.1]))
    atom = dictionary_of(length_s).resolved(from_s)[int(rng.integers(len(SHAPES)))]
    if rng.random() < 0.5:  # no entry of the dictionary, but of the claim about its kind
        atom = replace(
            atom,
            frequency_hz=atom.frequency_hz and float(np.exp(rng.uniform(np.log(6.0 / length_s), np.log(HIGHEST_HZ)))),
            phase_rad=float(rng.uniform(0.0, 2.0 * np.pi)) if atom.frequency_hz else 0.0,
            time_constant_s=atom.time_constant_s and float(rng.uniform(*TIME_CONSTANTS_S)),
            duration_s=atom.duration_s and float(rng.uniform(*DURATIONS_S)),
        )
    onset_s = from_s + length_s * rng.uniform(0.15, 0.85)
    if command == "identify":  # exact, or off by up to the tolerance of a second
        onset_s = from_s + 0.5 * length_s + float(rng.choice([0.0, rng.uniform(-1.0, 1.0)]))
    fault = replace(atom, onset_s=onset_s)
    part = flight_log(flight, "own").window(from_s, from_s + length_s)
    reach = float(np.abs(unit_signal(fault, part.time_s, window_start_s=from_s)).max())
    share = float(np.exp(rng.uniform(*np.log(SIZES))))
    size = share * tolerance_of(flight_log(flight, "own"), part, "tas") / reach * rng.choice([-1.0, 1.0])
    return Trial(
        number=number,
        flight=flight,
        recorder=recorder,
        inputs=inputs,
        command=command,
        from_s=from_s,
        to_s=from_s + length_s,
        fault=replace(fault, magnitude=float(size)),
        share=share,
    )


def faulty_log(trial: Trial) -> FlightLog:
    """Return the whole log with the fault of a trial, which went through the recorders."""
    log = flight_log(trial.flight, trial.recorder)
    added = trial.fault.magnitude * unit_signal(trial.fault, log.time_s, window_start_s=trial.from_s)
    if trial.flight in CITATION and (trial.recorder == "own" or trial.recorder.startswith("again")):
        added = gaussian(added, log.rate_hz)
    if trial.recorder in RECORDERS:
        added = through(added, log.rate_hz, *RECORDERS[trial.recorder])
    tas = log.channel("tas")
    return replace(log, channels={**log.channels, "tas": replace(tas, values=frozen_array(tas.values + added))})


@cache
def cross_calibrated(flight: str, recorder: str, inputs: tuple[str, ...], folder: Path) -> Config:
    """Return the configuration: thresholds from the other flight of the aircraft, the default ones where there is none.

    A log of another recorder has the thresholds of the other flight recorded by it as well. Tables are kept in the
    folder.
    """
    config = merge(Config(), {"inputs": inputs, "require": REQUIRED})
    if flight not in CITATION:
        return config
    (other,) = set(CITATION) - {flight}
    recorder = recorder if recorder.startswith("again") else "own"
    path = folder / f"{Path(other).stem} {recorder} {' '.join(inputs)}.json"
    if not path.exists():
        log = flight_log(other, recorder)
        pieces = [(log, (start_s, start_s + 120.0)) for start_s in starts_s(other, 120.0)[::8]]
        folder.mkdir(exist_ok=True)
        unfinished = path.with_suffix(f".{os.getpid()}")
        unfinished.write_text(save_tables([table_of_windows(pieces, config)], provenance(log_sha256="")))
        unfinished.replace(path)  # another worker may make the same one
    return merge(config, {"start_time.calibration": str(path)})


def is_claimed(trial: Trial, log: FlightLog, config: Config) -> bool:
    """Say whether the fault is one that the verdict on its kind speaks of (docs/theory.md, 8.7)."""
    left_s, f = trial.to_s - trial.fault.onset_s, trial.fault.frequency_hz
    if f is None:
        return True
    record = prepare_record(log, config)
    return f * record.settings.duration_s >= 6.0 - 1e-9 and f * left_s >= 2.0 and f <= record.band_hz[1]


def run(trial: Trial, tables: Path) -> dict[str, Any]:
    """Return a trial and what was said of it, as JSON has it; tables of thresholds are kept in a folder."""
    config = cross_calibrated(trial.flight, trial.recorder, trial.inputs, tables)
    config = merge(config, {"window": {"from_s": trial.from_s, "to_s": trial.to_s}})
    log = faulty_log(trial)
    with threadpool_limits(1):
        if trial.command == "identify":
            result: Any = identify(log, dictionary_of(trial.to_s - trial.from_s), config)[0]
        elif trial.command == "start-time":
            result = find_onset(log, config)
        else:
            result = identify(log, None, config)[0]
    build_up = build_up_s(trial.fault)
    return {
        "number": trial.number,
        "flight": trial.flight,
        "recorder": trial.recorder,
        "inputs": " ".join(trial.inputs),
        "command": trial.command,
        "from_s": trial.from_s,
        "length_s": trial.to_s - trial.from_s,
        "shape": trial.fault.shape,
        "onset_s": trial.fault.onset_s,
        "magnitude": trial.fault.magnitude,
        "frequency_hz": trial.fault.frequency_hz,
        "build_up_s": build_up if build_up is None or build_up <= BUILD_UP_S else None,
        "share": trial.share,
        "claimed": is_claimed(trial, log, config),
        "kind": kind_of(trial.fault, declared=False),
        "decision": result.decision,
        "verdicts": dict(result.verdicts),
        "of_all_kinds": decide(result.verdicts, KINDS),
    }


def counts_of(rows: Iterable[dict[str, Any]]) -> dict[str, tuple[int, int]]:
    """Return how many answers were "no fault", and how many of them while the error was beyond the tolerance.

    A decision counts where the kind of the fault was required; `of all kinds` is the decision had all been.
    """
    said: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    for row in rows:
        beyond = row["share"] > 1.0 and row["claimed"]
        answers = {
            "kind": row["verdicts"][row["kind"]],
            f"kind {row['kind']}": row["verdicts"][row["kind"]],
            "decision": row["decision"] if row["kind"] in REQUIRED else "",
            "of all kinds": row["of_all_kinds"],
            f"kind, {row['command']}": row["verdicts"][row["kind"]],
            f"kind, recorder {row['recorder']}, {row['flight'][:8]}": row["verdicts"][row["kind"]],
            f"kind, inputs {row['inputs']}": row["verdicts"][row["kind"]],
            f"kind, {row['shape']}": row["verdicts"][row["kind"]],
        }
        for name, answer in answers.items():
            said[name] += answer == "no_fault"
            wrong[name] += answer == "no_fault" and beyond
    return {name: (n, wrong[name]) for name, n in sorted(said.items())}


def wrong_of(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows whose fault is beyond the tolerance and of a kind that was answered by "no fault"."""
    return [one for one in rows if one["share"] > 1.0 and one["claimed"] and one["verdicts"][one["kind"]] == "no_fault"]


def interval(wrong: int, n: int) -> tuple[float, float]:
    """Return the exact 95 % interval (Clopper and Pearson 1934) of a share."""
    if n == 0:
        return 0.0, 1.0
    known = stats.binomtest(wrong, n).proportion_ci(0.95, method="exact")
    return float(known.low), float(known.high)


def resumed(numbers: Sequence[int], results: Path, run: Callable[[int], dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of some numbers, those that the file of results does not hold yet run and added to it."""
    held = {row["number"]: row for row in map(json.loads, results.read_text().splitlines())} if results.exists() else {}
    with results.open("a") as file:
        for number in numbers:
            if number not in held:
                try:
                    held[number] = run(number)
                except LogError as problem:  # a window that cannot be analysed gets no answer
                    held[number] = {"number": number, "refused": str(problem)}
                file.write(json.dumps(held[number]) + "\n")
                file.flush()
    return [held[number] for number in numbers if "refused" not in held[number]]


def main() -> None:
    """Run a part of the trials and print the counts of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, required=True)
    parser.add_argument("--results", type=Path, required=True)
    asked = parser.parse_args()
    tables = asked.results.with_suffix(".tables")
    resumed(range(asked.first, asked.last), asked.results, lambda number: run(draw(number), tables))
    every = [json.loads(line) for line in asked.results.read_text().splitlines()]
    rows = [row for row in every if "refused" not in row]
    print(f"{len(rows)} runs, {len(every) - len(rows)} more in windows that cannot be analysed")
    for name, (n, wrong) in counts_of(rows).items():
        low, high = interval(wrong, n)
        print(f"{name}: {wrong} of {n} wrong ({low:.1%} to {high:.1%})")
    for row in wrong_of(rows):
        print(row)


if __name__ == "__main__":
    main()
