"""The inputs of a reproduction: its settings, the thesis's record or its stand-in, the thesis's dictionary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...aircraft import find_model, flight_of
from ...dictionary import SHIPPED, Dictionary, load_dictionary
from ...engine import in_order
from ...errors import LogError
from ...faults import Fault
from ...flightlog import FlightLog, inject
from ...kernels import FloatArray
from ...report.content import Curve, Panel, Span, curve

# White noise added to the airspeed on pages about noise; the thesis does not state the noise of its record.
NOISE_M_S = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Settings:
    """Settings of a reproduction.

    Attributes
    ----------
    log : fault-free record to use in place of the simulated one, None for the default.
    quick : few trials, short sweeps: seconds instead of minutes, for tests.
    trials : per point of a Monte Carlo figure, None for the published number (or a few where quick).
    seed : of all random numbers.
    workers : processes of this machine.
    choices : "key=value" of open choices, which f16-table2 has.
    report : called with (done, total).
    """

    log: FlightLog | None = None
    quick: bool = False
    trials: int | None = None
    seed: int = 0
    workers: int = 1
    choices: tuple[str, ...] = ()
    report: Callable[[int, int], None] = lambda _done, _total: None

    def trials_or(self, published: int, quick: int) -> int:
        """Return the number of trials: as stated, else `quick` in a quick run, else `published`."""
        return self.trials if self.trials is not None else quick if self.quick else published


def trials_of(run: Callable[[Any], Any], points: Sequence[object], n_trials: int, settings: Settings) -> FloatArray:
    """Return the outcomes of trials of every point, (n_points, n_trials, ...).

    Parameters
    ----------
    run : a function at the top of a module, from (point, seed) to an outcome; the seed, (settings.seed, point, trial),
        determines it.
    """
    trials = [(point, (settings.seed, i, k)) for i, point in enumerate(points) for k in range(n_trials)]
    done = []
    with closing(in_order(run, trials, workers=settings.workers)) as results:
        for outcome, _ in results:
            done.append(outcome)
            settings.report(len(done), len(trials))
    outcomes = np.array(done)
    return outcomes.reshape(len(points), n_trials, *outcomes.shape[1:])


def thesis_record(settings: Settings) -> FlightLog:
    """Return the log of the settings, by default 3172 samples at 100 Hz of the linear Citation, free of noise.

    Raises
    ------
    LogError : the log carries injected faults, or lacks elevator or tas.
    """
    log = settings.log
    if log is None:
        return flight_of(find_model("citation"), "3211", rng=np.random.default_rng(0))
    if log.truth is not None and log.truth.faults:
        raise LogError(
            f"{log.path}: --log: a reproduction adds its own faults, got a log with {len(log.truth.faults)} injected; "
            "give the fault-free one"
        )
    log.signals(("elevator", "tas"))
    return replace(log, filters=())  # the thesis adds its faults to the record as it is, after every filter


def thesis_dictionary() -> Dictionary:
    """Return the seven signals of table 5-2."""
    return load_dictionary(SHIPPED["thesis"])


def with_fault(clean: FlightLog, *faults: Fault) -> FlightLog:
    """Return the log with faults whose times count from its first sample.

    Raises
    ------
    DictionaryError : the log ends before a fault.
    """
    return inject(clean, [fault.later(float(clean.time_s[0])) for fault in faults])


def with_noise(log: FlightLog, sd: float, *, seed: int) -> FlightLog:
    """Return the log with white noise of standard deviation `sd` (m/s) on its airspeed."""
    channel = log.channel("tas")
    noise = np.random.default_rng(seed).standard_normal(log.n_samples)
    return log.plus({channel.name: sd * noise})


def records_of(log: FlightLog, settings: Settings) -> dict[str, FlightLog]:
    """Return records by their names: a simulated log with and without noise on its airspeed, another as recorded."""
    if settings.log is not None:
        return {"as recorded": log}
    return {"no noise": log, f"noise {NOISE_M_S:g} m/s": with_noise(log, NOISE_M_S, seed=settings.seed)}


def true_fault(log: FlightLog) -> FloatArray:
    """Return (n_samples,) the measured airspeed minus the one without faults, of a log with its truth."""
    assert log.truth is not None
    channel = log.channel("tas")
    return np.asarray(channel.values - log.truth.clean[channel.name])


def fault_starts(log: FlightLog) -> tuple[Span, ...]:
    """Return a line at the start of every fault of a log with its truth."""
    assert log.truth is not None
    return tuple(Span(label="start", low=fault.onset_s, high=fault.onset_s) for fault in log.truth.faults)


def airspeed_panel(log: FlightLog, spans: tuple[Span, ...]) -> Panel:
    """Return the true and the measured airspeed of a log with its truth."""
    assert log.truth is not None
    channel = log.channel("tas")
    true = curve("true", log.time_s, log.truth.clean[channel.name])
    measured = curve("measured", log.time_s, channel.values, style="dashed")
    return Panel(x_label="time [s]", y_label="tas [m/s]", curves=(true, measured), spans=spans)


def fault_panel(log: FlightLog, label: str = "", beside: Sequence[Curve] = (), **settings: Any) -> Panel:
    """Return the true fault of the airspeed of a log with its truth, other curves beside it."""
    curves = (curve(label, log.time_s, true_fault(log)), *beside)
    return Panel(x_label="time [s]", y_label="fault [m/s]", curves=curves, **settings)
