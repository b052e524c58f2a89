"""Flights of JSBSim analysed as typed: `bfi identify LOG -d DICTIONARY`, its defaults by what the log holds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from bars import FULL
from threadpoolctl import threadpool_limits

from bfi_cli.aircraft import STICK, Dryden, FlightPlan, deviations, find_model, simulate, time_axis
from bfi_cli.analysis import identify
from bfi_cli.config import Config, merge
from bfi_cli.dictionary import Dictionary, load_dictionary
from bfi_cli.faults import Fault
from bfi_cli.faults.ordinary import Occurrence
from bfi_cli.flight import diagnose_flight
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import frozen_array
from bfi_cli.model import identify_faults
from bfi_cli.model.preprocessing.defaults import with_defaults_of
from bfi_cli.model.result import IdentifyResult

AIRCRAFT = ("c172p", "737", "f16")
DURATION_S, RATE_HZ, NOISE = 60.0, 50.0, 0.1
ONSET_S = 30.0
AFTER_S = 200.0  # of a tour, behind an onset where BFI_FULL=1 is not set
# An onset that is searched is found to about a sample of the analysis.
NEAR_S = 0.5
BIAS = Fault(shape="bias", channel="tas", magnitude=1.0, onset_s=ONSET_S)
# A step at a known onset, of the minimal detectable magnitude.
KNOWN = {"channel": "tas", "atoms": [{"name": "bias", "shape": "bias", "onset_s": ONSET_S}]}


@cache
def flight(name: str, *, gusts: float = 0.0, seed: int = 0) -> FlightLog:
    """Return 60 s of flight: steps of the elevator from 5 s, a doublet of the throttle from 15 to 25 s.

    Every aircraft, intensity and seed has gusts of its own: what is counted together must not be the same draw.
    """
    model, time_s = find_model(f"jsbsim:{name}"), time_axis(duration_s=DURATION_S, rate_hz=RATE_HZ)
    u = deviations(model, "3211", time_s, amplitude=STICK, start_s=5.0, step_s=1.0, throttle=0.15)
    turbulence = Dryden(sigma_m_s=gusts) if gusts else None
    rng = np.random.default_rng([AIRCRAFT.index(name), round(1000 * gusts), seed])
    return simulate(model, u, rng=rng, rate_hz=RATE_HZ, turbulence=turbulence)


def with_noise(log: FlightLog, *key: int) -> FlightLog:
    """Return the flight with white noise on the airspeed, other noise for every aircraft and key."""
    channel = log.channel("tas")
    noise = NOISE * np.random.default_rng([AIRCRAFT.index(log.path.split(":")[1]), *key]).standard_normal(log.n_samples)
    return replace(log, channels={**log.channels, "tas": replace(channel, values=frozen_array(channel.values + noise))})


def identified(log: FlightLog, dictionary: Dictionary, settings: dict[str, object] | None = None) -> IdentifyResult:
    """Return the answer with the inputs that the command would take, of stated entries without a scan beside them."""
    config, _ = with_defaults_of(log, merge(Config(), settings or {}))
    with threadpool_limits(1):
        return identify(log, dictionary, config)[0] if settings is None else identify_faults(log, dictionary, config)


@dataclass(frozen=True)
class SmoothTrial:
    """Answers for one aircraft and seed in smooth air, with a bias of 1 m/s and without."""

    aircraft: str
    seed: int
    identified: bool
    covered: bool
    clean: bool
    found: tuple[tuple[str, float], ...]


def smooth_trial(job: tuple[str, int]) -> SmoothTrial:
    """Analyse a flight with and without a bias, by the shipped dictionary."""
    name, seed = job
    healthy, dictionary = with_noise(flight(name), seed), load_dictionary("airdata")
    with_bias = identified(inject(healthy, [BIAS]), dictionary)
    biases = [one for one in with_bias.faults if one.fault.shape == "bias"]
    bias = next((one for one in biases if abs(one.fault.onset_s - ONSET_S) < NEAR_S), None)
    exact = bias is not None and len(with_bias.faults) == 1
    covered = exact and bias is not None and bias.ci95[0] <= BIAS.magnitude <= bias.ci95[1]
    clean = identified(healthy, dictionary).decision != "fault"
    said = tuple((one.name, round(one.magnitude, 2)) for one in with_bias.faults)
    return SmoothTrial(name, seed, exact, covered, clean, said)


@dataclass(frozen=True)
class GustTrial:
    """What was declared of a step of 0, 0.5, 1 and 2 times the minimal detectable magnitude, in gusts."""

    aircraft: str
    seed: int
    minimal_detectable: float
    declared: dict[float, bool]


def gust_trial(job: tuple[str, int, float]) -> GustTrial:
    """Analyse a flight in gusts of its own, the step's onset known exactly."""
    name, seed, gusts = job
    healthy, dictionary = (
        with_noise(flight(name, gusts=gusts, seed=seed), seed, round(1000 * gusts)),
        load_dictionary(KNOWN),
    )
    exact: dict[str, object] = {"onset_tolerance_s": 0.0}
    clean = identified(healthy, dictionary, exact)
    (candidate,) = clean.candidates
    least = candidate.minimal_detectable
    assert least is not None
    declared = {0.0: clean.decision == "fault"}
    for times in (0.5, 1.0, 2.0):
        step = Fault(shape="bias", channel="tas", magnitude=times * least, onset_s=ONSET_S)
        declared[times] = bool(identified(inject(healthy, [step]), dictionary, exact).faults)
    return GustTrial(name, seed, least, declared)


# Noise of an air-data computer and an attitude reference.
SENSORS = {
    "tas": 0.05,
    "cas": 0.05,
    "mach": 2e-4,
    "altitude": 0.3,
    "altitude_rate": 0.05,
    "p_static": 3.0,
    "p_total": 3.0,
    "tat": 0.02,
    "sat": 0.02,
    "aoa": 5e-4,
    "sideslip": 5e-4,
    "pitch": 3e-4,
    "roll": 3e-4,
    "normal_acc": 0.05,
    "longitudinal_acc": 0.02,
    "lateral_acc": 0.02,
    "velocity_north": 0.05,
    "velocity_east": 0.05,
}


@cache
def tour(name: str, *, seed: int, duration_s: float = 900.0, ordinary: tuple[Occurrence, ...] = ()) -> FlightLog:
    """Return climbs, descents and turns in gusts and wind at 10 Hz, every sensor with noise of its own."""
    plan = FlightPlan(tour=True, wind_m_s=(6.0, -4.0), ordinary=ordinary)
    model, time_s = find_model(f"jsbsim:{name}", plan), time_axis(duration_s=duration_s, rate_hz=10.0)
    u, gusts = np.zeros((len(time_s), len(model.inputs))), Dryden(sigma_m_s=0.7)
    rng = np.random.default_rng(seed)
    return simulate(model, u, rng=rng, rate_hz=10.0, turbulence=gusts, noise_sd=SENSORS)


@dataclass(frozen=True)
class TourTrial:
    """What `bfi diagnose` said of a tour: the faults declared, each with all that it may be and its onset in s."""

    aircraft: str
    seed: int
    shape: str
    onset_s: float
    declared: tuple[tuple[tuple[str, ...], float], ...]

    @property
    def right(self) -> bool:
        """Nothing where nothing is wrong; else the fault, alone and among no others, within two seconds."""
        if not self.shape:
            return not self.declared
        if len(self.declared) != 1:
            return False
        among, onset_s = self.declared[0]
        return among == (self.shape,) and abs(onset_s - self.onset_s) <= 2.0


def tour_trial(job: tuple[str, int, str]) -> TourTrial:
    """Diagnose a tour with a pressure line blocked at a time drawn from the seed, or healthy for ""."""
    name, seed, shape = job
    log, onset_s = tour(name, seed=seed), float(np.random.default_rng([5, seed]).uniform(150.0, 750.0))
    log = log if FULL else log.window(None, onset_s + AFTER_S)
    if shape:
        log = inject(log, [Fault(shape=shape, onset_s=onset_s)])
    with threadpool_limits(1):
        result = diagnose_flight(log, Config())
    declared = tuple((one.among, round(one.onset_s, 1)) for one in result.events if one.state == "declared")
    return TourTrial(name, seed, shape, onset_s, declared)
