"""A fault as every method reconstructs it: the published one at many orders, DMAE, the default method, the scan."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from ..aircraft.catalogue import CITATION
from ..calibration import save_tables
from ..config import Config, merge
from ..faults import unit_signal
from ..flightlog import FlightLog
from ..flightlog.record import frozen_array
from ..identify import identify_faults
from ..identify.dmae import DmaeSettings, Reference, dmae
from ..identify.result import IdentifyResult
from ..identify.risro import declared as declared_atoms
from ..identify.risro import solve
from ..kernels.lagged import restrict
from ..onset import find_onset, table_of_windows
from ..onset.result import OnsetFault
from ..preprocessing.regression import build_regression
from ..preprocessing.window import prepare_window
from ..provenance import provenance
from ..wording import interval, number
from .page import load
from .record import NOISE_M_S, Settings, thesis_dictionary, thesis_record, true_fault, with_noise

__all__ = [
    *("COPIES", "LISTING", "SETTLED", "Reconstruction", "Solved", "by_default", "by_dmae", "by_published", "by_scan"),
    *("clause", "dated", "declared", "scanning", "shipped", "solved", "vaf"),
]

FloatArray = NDArray[np.float64]

OWN_RATE = {"method": "risro", "conditioning.rate_hz": "none"}
LISTING = merge(Config(), {**OWN_RATE, "risro": {"as_published": True, "sparsity": "exp-l0", "p0": 1e-300}})
"""As the listing runs: 50 steps, its updates that never happen, its matrix put together anew after every step."""
SETTLED = merge(Config(), OWN_RATE)
"""The same problem with the corner of the matrix imposed, solved until it settles."""
LISTING_SHARE = 0.01  # of the norm of all magnitudes: what the listing of the sweep over orders counts as a fault
COPIES = 60  # fault-free copies of the record behind a threshold: as many as a figure of the scan can wait for


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """The published method at one order.

    Attributes
    ----------
    z : (n_atoms,) all magnitudes of the dictionary.
    names : declared by the rule of section 5-1.
    n_listing : how many the listing of the sweep over orders counts, whose rule is ten times as strict.
    error : of the magnitudes, equation 5-1; NaN where no true fault is in the dictionary.
    fault : (n_samples,) from all magnitudes, as in the thesis.
    vaf_fault, vaf_output : equation 5-2 in %, not below 0 (as in the listing); the output about its mean.
    """

    order: int
    z: FloatArray
    names: tuple[str, ...]
    n_listing: int
    error: float
    fault: FloatArray
    vaf_fault: float
    vaf_output: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reconstruction:
    """A fault as one method sees it.

    Attributes
    ----------
    time_s, fault : (n_samples,) of the method's own rate, m/s.
    vaf_fault, vaf_output : equation 5-2 in %, the output about its mean.
    found : what is declared, in a few words.
    """

    label: str
    time_s: FloatArray
    fault: FloatArray
    vaf_fault: float
    vaf_output: float
    found: str


def solved(
    log: FlightLog, orders: Sequence[int], config: Config, *, report: Callable[[int], None] = lambda _done: None
) -> tuple[Solved, ...]:
    """Solve a log with injected faults for the thesis's dictionary, every order on the rows of the largest.

    Parameters
    ----------
    log : with its truth.
    config : `LISTING` or `SETTLED`.
    report : told how many orders are done.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used, or is too short for an order.
    DictionaryError : no signal of the dictionary can be seen in it.
    """
    assert log.truth is not None
    window = prepare_window(log, thesis_dictionary(), config)
    regression = build_regression(window.signals, window.live, config, orders=orders)
    channel = window.log.channel("tas")
    true = channel.values - log.truth.clean[channel.name]
    sizes = {fault.name: fault.magnitude for fault in log.truth.faults}
    wanted = np.array([sizes.get(name, 0.0) for name in window.names])
    spread = float(np.linalg.norm(regression.layout.y[regression.layout.first :, 0]))
    found = []
    for done, order in enumerate(regression.orders, start=1):
        solution = solve(restrict(regression.data, order=order), config)
        z = np.zeros(len(window.names))
        z[list(window.live)] = solution.z * regression.magnitude_unit
        size = float(np.linalg.norm(z))
        active = declared_atoms(solution, z[list(window.live)], config)
        fault = window.signals.theta[:, 0] @ z
        found.append(
            Solved(
                order=order,
                z=frozen_array(z),
                names=tuple(window.names[j] for j, is_one in zip(window.live, active, strict=True) if is_one),
                n_listing=int(np.sum(np.abs(z) > LISTING_SHARE * size)),
                error=float(np.linalg.norm(z - wanted) / np.linalg.norm(wanted)) if wanted.any() else float("nan"),
                fault=frozen_array(fault),
                vaf_fault=vaf(true, fault),
                vaf_output=max(0.0, 100.0 * (1.0 - (solution.misfit / spread) ** 2)),
            )
        )
        report(done)
    return tuple(found)


def vaf(true: FloatArray, estimate: FloatArray) -> float:
    """Return the variance accounted for in %, not below 0 (equation 5-2 and the listing)."""
    return max(0.0, float(100.0 * (1.0 - np.sum((true - estimate) ** 2) / np.sum(true**2))))


def by_published(log: FlightLog, order: int) -> Reconstruction:
    """Return the published method at an order, solved until it settles.

    Raises
    ------
    LogError, ExcitationError, DictionaryError : see `solved`.
    """
    (one,) = solved(log, [order], SETTLED)
    z = dict(zip((str(atom.name) for atom in thesis_dictionary().atoms), one.z.tolist(), strict=True))
    return Reconstruction(
        label=f"published, s = {order}",
        time_s=log.time_s,
        fault=one.fault,
        vaf_fault=one.vaf_fault,
        vaf_output=one.vaf_output,
        found=", ".join(f"{name} {number(z[name], digits=3)}" for name in one.names) or "none",
    )


def by_default(log: FlightLog) -> Reconstruction:
    """Return what `bfi identify` finds by itself.

    Raises
    ------
    LogError, ExcitationError, DictionaryError : see `identify_faults`.
    """
    answer = identify_faults(log, thesis_dictionary(), Config())
    accounted = answer.truth.vaf_fault["tas"] if answer.truth is not None else None
    return Reconstruction(
        label="ours",
        time_s=answer.time_s,
        fault=answer.outputs[0].fault,
        vaf_fault=accounted or 0.0,
        vaf_output=max(0.0, answer.vaf_output["tas"]),
        found=declared(answer),
    )


def declared(answer: IdentifyResult) -> str:
    """Return "bias_13.8 4.003", "none", or that it cannot be told."""
    if answer.decision == "not_identifiable":
        return "not identifiable"
    return ", ".join(f"{one.name} {number(one.magnitude)}" for one in answer.faults) or "none"


def clause(answer: IdentifyResult) -> str:
    """Return what the default method declares, as a clause of a sentence."""
    if answer.decision == "not_identifiable":
        return "the default method says that it cannot tell"
    return f"the default method declares {declared(answer) if answer.faults else 'no fault'}"


def by_dmae(log: FlightLog, filters: DmaeSettings, settings: Settings, *, label: str = "DMAE") -> Reconstruction:
    """Return what double-model adaptive estimation makes of a log.

    Parameters
    ----------
    settings : whether the log is the model's own or another aircraft's.

    Raises
    ------
    LogError : the log lacks elevator or tas, or its rate is not uniform.
    """
    assert log.truth is not None
    reference: Reference = "trim" if settings.log is None else "start"
    found = dmae(log, CITATION, reference=reference, settings=filters)
    measured, mean = found.measured, found.measured.mean()
    return Reconstruction(
        label=label,
        time_s=found.time_s,
        fault=found.fault,
        vaf_fault=vaf(measured - log.truth.clean[log.channel("tas").name], found.fault),
        vaf_output=vaf(measured - mean, found.estimate[:, 0] + found.fault - mean),
        found="no fault" if found.onset_s is None else f"a fault from {found.onset_s:.5g} s",
    )


def by_scan(log: FlightLog, settings: Settings, *, shapes: Sequence[str]) -> Reconstruction:
    """Return what `bfi start-time` finds at 10 Hz without a dictionary, see `scanning`.

    Raises
    ------
    LogError, ExcitationError : see `find_onset`.
    """
    with scanning(settings, shapes) as config:
        answer = find_onset(log, config)
    fault = np.zeros(log.n_samples)
    for one in answer.faults:
        signal = unit_signal(one.estimate.fault, log.time_s, window_start_s=float(log.time_s[0]))
        fault += one.estimate.magnitude * signal
    left = float(answer.model.noise_sd["tas"]) ** 2 / float(np.var(log.channel("tas").values))
    return Reconstruction(
        label="ours, scan",
        time_s=log.time_s,
        fault=fault,
        vaf_fault=vaf(true_fault(log), fault),
        vaf_output=max(0.0, 100.0 * (1.0 - left)),
        found="; ".join(map(dated, answer.faults)) or "none",
    )


def dated(one: OnsetFault) -> str:
    """Return a fault of a scan in words: "drift of 0.25 m/s^2 from 16 s (15.99 to 16.01 s)"."""
    fault = one.estimate.fault
    shape = fault.shape if fault.frequency_hz is None else f"{fault.frequency_hz:.4g} Hz {fault.shape}"
    size = f"{number(one.estimate.magnitude, digits=3)} {one.estimate.unit}".rstrip()
    return f"{shape} of {size} from {fault.onset_s:.5g} s ({interval(one.onset_ci95)} s)"


@contextmanager
def scanning(settings: Settings, shapes: Sequence[str]) -> Iterator[Config]:
    """Yield how to scan at 10 Hz for some shapes.

    The threshold is the shipped one where the user gave a log, in a quick run, and with sinusoids, whose table would
    take minutes; otherwise that of 60 fault-free copies of the simulated record with 0.01 m/s of noise, counted as
    `bfi calibrate` does.
    """
    config = merge(Config(), {"conditioning.rate_hz": 10.0, "start_time.shapes": list(shapes)})
    if shipped(settings) or "sine" in shapes:
        yield config
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / "table.json"
        path.write_text(_thresholds(tuple(shapes), settings.seed), encoding="utf-8")
        yield merge(config, {"start_time.calibration": str(path)})


def shipped(settings: Settings) -> tuple[str, ...]:
    """Return the note that the shipped threshold is taken for biases and drifts, none where it is counted anew."""
    return (load("thesis")["shared"]["shipped"],) if settings.quick or settings.log is not None else ()


@lru_cache(maxsize=4)
def _thresholds(shapes: tuple[str, ...], seed: int) -> str:
    clean = thesis_record(Settings())
    config = merge(Config(), {"conditioning.rate_hz": 10.0, "start_time.shapes": list(shapes)})
    whole = (float(clean.time_s[0]), float(clean.time_s[-1]) + 1.0 / clean.rate_hz)
    seeds = np.random.SeedSequence([seed, COPIES]).generate_state(COPIES).tolist()
    copies = [(with_noise(clean, NOISE_M_S, seed=one), whole) for one in seeds]
    return save_tables([table_of_windows(copies, config)], provenance(log_sha256="", seed=seed))
