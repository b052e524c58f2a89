"""A fault as reconstructed by each method: readings of the thesis's algorithm 3, this program, DMAE, the scan."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ...aircraft.catalogue import CITATION
from ...config import Config, merge
from ...decision.calibration import save_tables
from ...faults import FaultEstimate, unit_signal
from ...flightlog import FlightLog
from ...kernels import FloatArray
from ...kernels.lagged import lagged
from ...model import identify_faults
from ...model.identify import NOT_CONVERGED
from ...model.onset import find_onset, table_of_windows
from ...model.preprocessing.regression import build_regression, solve
from ...model.preprocessing.window import prepare_window
from ...model.result import IdentifyResult
from ...model.risro import THRESHOLD
from ...quantities.text import interval, number
from ...serialization import provenance
from ..dmae import DmaeSettings, dmae
from .page import load
from .record import NOISE_M_S, Settings, thesis_dictionary, thesis_record, true_fault, with_noise

# Methods by the names of their settings in methods.yaml; `who` in thesis.yaml has their labels and explains them. The
# readings solve the thesis's problem at the log's rate, the first four as its algorithm 3 is printed and as its program
# runs. The methods of this program choose rate and order.
READINGS = ("sparse", "sparse_2", "rank_only", "listing", "imposed")
PROGRAM = ("risro", "default")
COPIES = 60  # fault-free copies of the record from which a threshold is estimated, limited by the time of a figure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reconstruction:
    """A fault, and the measurement with it, as reconstructed by a method.

    Attributes
    ----------
    label : of the method.
    time_s, fault : (n_samples,) at the rate of the method, m/s.
    airspeed : (n_samples,) the reconstructed measurement, NaN where there is none.
    vaf_fault, vaf_output : equation 5-2 in %, the airspeed about its mean; negative if the error exceeds the signal.
    declared : the declared faults in a few words.
    magnitudes : of the whole dictionary by name; empty for a method without a dictionary.
    """

    label: str
    time_s: FloatArray
    fault: FloatArray
    airspeed: FloatArray
    vaf_fault: float
    vaf_output: float
    declared: str
    magnitudes: dict[str, float] = field(default_factory=dict)


def method_config(name: str) -> Config:
    """Return the settings of a method in methods.yaml."""
    return merge(Config(), load("methods")[name], where="methods.yaml")


def label_of(name: str) -> str:
    """Return the label of a method in figures and tables."""
    label: str = load("thesis")["shared"]["who"][name][0]
    return label


def above(magnitudes: dict[str, float], share: float = THRESHOLD) -> list[str]:
    """Return the names of the magnitudes above a share of the norm of all magnitudes, the rule of section 5-1."""
    size = float(np.linalg.norm(list(magnitudes.values())))
    return [name for name, z in magnitudes.items() if abs(z) > share * size]


def by_readings(log: FlightLog, order: int, names: Sequence[str] = READINGS) -> dict[str, Reconstruction]:
    """Return the reconstructions of a log with injected faults by some readings, with the thesis's dictionary.

    The rate is that of the log, and the first row follows `order` samples of past, as in the thesis.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used, or is too short for the order.
    DictionaryError : no signal of the dictionary can be seen in it.
    """
    configs = {name: method_config(name) for name in names}
    first, *_ = configs.values()
    window = prepare_window(log, thesis_dictionary(), first)
    regression = build_regression(window.signals, window.live, first, orders=[order])
    layout, columns, live = regression.layout, regression.data.columns, list(window.live)
    base = np.hstack([np.ones((regression.n_rows, 1)), lagged(np.asarray(layout.u), columns.input_lags)])
    y, true = log.channel("tas").values, true_fault(log)
    reconstructions = {}
    for name, config in configs.items():
        solution = solve(regression.data, config)
        z = np.zeros(len(window.names))
        z[live] = solution.z * regression.magnitude_unit
        # The prediction error of the VARX with these K and z, its inputs and constant fitted to the rest.
        corrected = layout.y - layout.theta @ solution.z
        rest = corrected[order:, 0] - lagged(corrected, range(1, order + 1)) @ solution.K
        error = regression.unit[0] * (rest - base @ np.linalg.lstsq(base, rest, rcond=None)[0])
        fault = window.signals.theta[:, 0] @ z
        magnitudes = dict(zip(window.names, z.tolist(), strict=True))
        reconstructions[name] = Reconstruction(
            label=label_of(name),
            time_s=log.time_s,
            fault=fault,
            airspeed=np.concatenate([np.full(order, np.nan), y[order:] - error]),
            vaf_fault=vaf(true, fault),
            vaf_output=100.0 * (1.0 - float(np.sum(error**2) / np.sum((y[order:] - y.mean()) ** 2))),
            declared=", ".join(f"{atom} {number(magnitudes[atom], digits=3)}" for atom in above(magnitudes)) or "none",
            magnitudes=magnitudes,
        )
    return reconstructions


def vaf(true: FloatArray, estimate: FloatArray) -> float:
    """Return the variance accounted for in %, negative if the error exceeds the signal (equation 5-2)."""
    return float(100.0 * (1.0 - np.sum((true - estimate) ** 2) / np.sum(true**2)))


def by_program(log: FlightLog, name: str) -> Reconstruction:
    """Return the reconstruction by a method of this program, which chooses rate and order.

    Raises
    ------
    LogError, ExcitationError, DictionaryError : see `identify_faults`.
    """
    answer = identify_faults(log, thesis_dictionary(), method_config(name))
    (output,) = answer.outputs
    assert output.true_fault is not None
    return Reconstruction(
        label=label_of(name),
        time_s=answer.time_s,
        fault=output.fault,
        airspeed=output.predicted,
        vaf_fault=vaf(output.true_fault, output.fault),
        vaf_output=answer.vaf_output["tas"],
        declared=declared(answer),
        magnitudes={fault.name: fault.magnitude for fault in answer.faults},
    )


def declared(answer: IdentifyResult) -> str:
    """Return "bias_13.8 4.003", "none", or that the solver did not converge."""
    if answer.summary == NOT_CONVERGED:
        return "not converged"
    return ", ".join(f"{fault.name} {number(fault.magnitude)}" for fault in answer.faults) or "none"


def by_dmae(log: FlightLog, filters: DmaeSettings, settings: Settings, *, label: str | None = None) -> Reconstruction:
    """Return the reconstruction by double-model adaptive estimation.

    Parameters
    ----------
    settings : whether the log is the model's own or another aircraft's.

    Raises
    ------
    LogError : the log lacks elevator or tas, or its rate is not uniform.
    """
    assert log.truth is not None
    answer = dmae(log, CITATION, reference="trim" if settings.log is None else "start", settings=filters)
    mean, airspeed = answer.measured.mean(), answer.estimate[:, 0] + answer.fault
    return Reconstruction(
        label=label or label_of("dmae"),
        time_s=answer.time_s,
        fault=answer.fault,
        airspeed=airspeed,
        vaf_fault=vaf(answer.measured - log.truth.clean[log.channel("tas").name], answer.fault),
        vaf_output=vaf(answer.measured - mean, airspeed - mean),
        declared="no fault" if answer.onset_s is None else f"a fault from {answer.onset_s:.5g} s",
    )


def by_scan(log: FlightLog, settings: Settings, *, shapes: Sequence[str]) -> Reconstruction:
    """Return the reconstruction by `bfi start-time` at 10 Hz, without a dictionary; see `scanning`.

    Raises
    ------
    LogError, ExcitationError : see `find_onset`.
    """
    with scanning(settings, shapes) as config:
        answer = find_onset(log, config)
    fault = np.zeros(log.n_samples)
    for estimate in answer.faults:
        signal = unit_signal(estimate.fault, log.time_s, window_start_s=float(log.time_s[0]))
        fault += estimate.magnitude * signal
    left = float(answer.model.noise_sd["tas"]) ** 2 / float(np.var(log.channel("tas").values))
    return Reconstruction(
        label=label_of("scan"),
        time_s=log.time_s,
        fault=fault,
        airspeed=np.full(log.n_samples, np.nan),
        vaf_fault=vaf(true_fault(log), fault),
        vaf_output=100.0 * (1.0 - left),
        declared="; ".join(map(dated, answer.faults)) or "none",
    )


def dated(estimate: FaultEstimate) -> str:
    """Return a fault of a scan in words: "drift of 0.25 m/s^2 from 16 s (15.99 to 16.01 s)"."""
    fault = estimate.fault
    shape = fault.shape if fault.frequency_hz is None else f"{fault.frequency_hz:.4g} Hz {fault.shape}"
    size = f"{number(estimate.magnitude, digits=3)} {estimate.unit}".rstrip()
    return f"{shape} of {size} from {fault.onset_s:.5g} s ({interval(estimate.onset_ci95 or estimate.ci95)} s)"


@contextmanager
def scanning(settings: Settings, shapes: Sequence[str]) -> Iterator[Config]:
    """Yield the configuration of a scan at 10 Hz for some shapes.

    The threshold is the shipped one with a log of the user, in a quick run, and with sinusoids, whose table would take
    minutes; otherwise it is calibrated, as by `bfi calibrate`, on 60 fault-free copies of the simulated record with
    0.01 m/s of noise.
    """
    config = _scan_of(shapes)
    if shipped(settings, shapes):
        yield config
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / "table.json"
        path.write_text(_thresholds(tuple(shapes), settings.seed), encoding="utf-8")
        yield merge(config, {"start_time.calibration": str(path)})


def shipped(settings: Settings, shapes: Sequence[str]) -> tuple[str, ...]:
    """Return the note on the shipped threshold, () where `scanning` calibrates one."""
    is_shipped = settings.quick or settings.log is not None or "sine" in shapes
    return (load("thesis")["shared"]["shipped"],) if is_shipped else ()


def _scan_of(shapes: Sequence[str]) -> Config:
    return merge(Config(), {"conditioning.rate_hz": 10.0, "start_time.shapes": list(shapes)})


@lru_cache(maxsize=4)
def _thresholds(shapes: tuple[str, ...], seed: int) -> str:
    clean = thesis_record(Settings())
    whole = clean.span_s
    seeds = np.random.SeedSequence([seed, COPIES]).generate_state(COPIES).tolist()
    copies = [(with_noise(clean, NOISE_M_S, seed=noise_seed), whole) for noise_seed in seeds]
    return save_tables([table_of_windows(copies, _scan_of(shapes))], provenance(log_sha256="", seed=seed))
