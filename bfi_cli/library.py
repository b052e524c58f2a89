"""The calls of the commands: a log and a configuration in, the answer that the command gives out.

Each has the defaults of its command, and is what the command calls. What a command prints on the way, questions about
the log and channels used in place of defaults, goes to `tell` as sentences and stands in the notes of the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar, Unpack

from .errors import ConfigError, LogError
from .kernels.progress import Progress, unseen
from .notes import Note

if TYPE_CHECKING:
    from .aircraft import Discretisation
    from .config import Config
    from .detection import DetectResult
    from .dictionary import Dictionary
    from .faults.ordinary import Occurrence
    from .flight import DiagnoseResult
    from .flight.plausibility import Implausible
    from .flightlog import FlightLog
    from .lab.compare import ComparisonResult, Peer
    from .model.onset import OnsetResult
    from .model.result import IdentifyResult
    from .proof import Proving

# Deflection of a manoeuvre, rad: two degrees, within the range of a linear model.
DEFLECTION_RAD = 0.035

Tell = Callable[[str], None]
Result = TypeVar("Result", bound=Any)


def _silent(_sentence: str) -> None:
    """Tell nobody."""


def ready_log(
    log: FlightLog, config: Config, tell: Tell = _silent
) -> tuple[FlightLog, Config, tuple[Note, ...], tuple[Implausible, ...]]:
    """Make a log ready for the analysis of a window: units, default channels, and what is to be asked about it.

    Returns
    -------
    The log with units that are mended, where the configuration asks for that; this with channels of the log in place
    of defaults that it lacks; notes on these channels and on the log; findings on channels that contradict each other.
    """
    from .flightlog.quality import advice_on_the_ground, is_long
    from .model.preprocessing.defaults import with_defaults_of

    log, findings = with_findings(log, config, tell)
    stated = (config.window.from_s, config.window.to_s) != (None, None)
    config, notes = with_defaults_of(log, config)
    on_windows = None
    if not stated and is_long(log):
        from .flightlog.excitation import advice_on_windows

        on_windows = advice_on_windows(log)
        if (config.window.from_s, config.window.to_s) == (None, None):
            on_windows += "; the whole record is analysed"
    on_ground = advice_on_the_ground(log, config.window.from_s, config.window.to_s, suspects=config.outputs)
    notes = (*map(Note.advice, filter(None, (on_ground, on_windows))), *notes)
    for note in notes:
        tell(note.text)
    notes = (*notes, *doubts(log, (*config.outputs, *config.inputs), findings, tell))
    return log, config, notes, findings


def with_findings(log: FlightLog, config: Config, tell: Tell = _silent) -> tuple[FlightLog, tuple[Implausible, ...]]:
    """Return a log and the contradictions between its channels, with `fix_units` those mended that are certain."""
    from .flight.plausibility import implausible_channels, with_fixed_units

    findings = implausible_channels(log)
    if config.fix_units:
        log, findings = with_fixed_units(log, findings, config.units)
    for finding in findings:
        tell(f"--fix-units: {finding.text}" if finding.fixed else finding.sentence)
    return log, findings


def doubts(
    log: FlightLog, names: Sequence[str], findings: Sequence[Implausible] = (), tell: Tell = _silent
) -> tuple[Note, ...]:
    """Return, and tell, questions about channels with impossible values or without a stated unit.

    Parameters
    ----------
    findings : contradictions between channels, which are not asked about again.
    """
    from .flightlog.plausible import doubts_about

    known = {name for finding in findings for name in finding.channels}
    questions = doubts_about(log, [name for name in names if name not in known])
    for question in questions:
        tell(question.text)
    return questions


def noted(result: Result, notes: Sequence[Note], findings: Sequence[Implausible]) -> Result:
    """Return a result with notes before its own, and with what is wrong with channels throughout."""
    from .flight.plausibility import in_words

    result = replace(result, notes=(*notes, *result.notes))
    if hasattr(result, "plausibility"):  # it was concluded beside them
        return result
    contradictions = in_words(findings)
    return replace(result, notes=(Note.limit(contradictions), *result.notes)) if contradictions else result


@contextmanager
def _saying_first(findings: Sequence[Implausible]) -> Iterator[None]:
    """Append the contradictions between channels to the error of a log that cannot be analysed."""
    try:
        yield
    except LogError as error:
        from .flight.plausibility import in_words

        if not (contradictions := in_words(findings)):
            raise
        raise LogError(f"{error}; first {contradictions}") from error


def identify(
    log: FlightLog,
    dictionary: Dictionary | Mapping[str, Any] | str | Path | None = None,
    config: Config | None = None,
    *,
    allow_outside: bool = False,
    prove: bool | Proving = False,
    progress: Progress = unseen,
    tell: Tell = _silent,
) -> IdentifyResult:
    """Say which faults of a dictionary are in a log, how large they are and how sure that is: `bfi identify`.

    Parameters
    ----------
    log : `FlightLog.earlier` are healthy flights of the same aircraft that share the model.
    dictionary : or the name of a shipped one, a file, a mapping; default that of the configuration, else any fault.
    allow_outside : sample files of the dictionary may lie outside its folder.
    prove : add faults of the stated limits to the log, one at a time at random onsets, and count in `proved` how many
        the same analysis sees; a `Proving` also says on how many processes, and where what is done is kept.
    progress : called with the name of a step and the fraction of it that is done.
    tell : called with each sentence that the command prints before its answer.

    Raises
    ------
    LogError, ConfigError, DictionaryError : see `bfi_cli.analysis.identify`.
    """
    from .analysis import identify as identify_window

    log, config, notes, findings = ready_log(log, _config(config), tell)
    known = _dictionary(dictionary, config, allow_outside=allow_outside)
    with _saying_first(findings):
        result, _ = identify_window(log, known, config, progress, findings=findings)
    if prove:
        from .proof import window_claims, with_proofs

        entries = () if known is None else known.exact.resolved(result.log.start_s)
        claims = window_claims(result, config, {entry.called: entry for entry in entries})
        analyse = partial(_identified, dictionary=known, config=config, findings=findings)
        result = with_proofs(result, log, config, analyse, claims, _proving(prove), progress)
    return noted(result, notes, findings)


def _identified(
    log: FlightLog, dictionary: Dictionary | None, config: Config, findings: Sequence[Implausible]
) -> IdentifyResult:
    from .analysis import identify as identify_window

    return identify_window(log, dictionary, config, findings=findings)[0]


def start_time(
    log: FlightLog,
    config: Config | None = None,
    *,
    prove: bool | Proving = False,
    progress: Progress = unseen,
    tell: Tell = _silent,
) -> OnsetResult:
    """Say when a fault started in a log, which shape it has, how large it is and how sure: `bfi start-time`.

    Parameters
    ----------
    prove, progress, tell : see `identify`.

    Raises
    ------
    LogError, ConfigError : see `bfi_cli.model.onset.find_onset`.
    """
    from .analysis import start_time as scan_window

    log, config, notes, findings = ready_log(log, _config(config), tell)
    with _saying_first(findings):
        result = scan_window(log, config, progress, findings=findings)
    if prove:
        from .proof import window_claims, with_proofs

        analyse = partial(scan_window, config=config, findings=findings)
        claims = window_claims(result, config)
        result = with_proofs(result, log, config, analyse, claims, _proving(prove), progress)
    return noted(result, notes, findings)


def diagnose(
    log: FlightLog,
    config: Config | None = None,
    *,
    workers: int = 1,
    prove: bool | Proving = False,
    progress: Progress = unseen,
    tell: Tell = _silent,
) -> DiagnoseResult:
    """Say which air-data fault hit a flight, when, how large and how sure: `bfi diagnose`.

    Parameters
    ----------
    log : the whole of it, whatever part `config.window` asks for: the angle of zero lift is estimated from the rest.
    workers : processes; the numbers are the same for any.
    prove, progress, tell : see `identify`.

    Raises
    ------
    LogError, ConfigError : see `bfi_cli.flight.diagnose_flight`.
    """
    from .flight import diagnose_flight
    from .flight.parity.record import USED

    config = _config(config)
    log, findings = with_findings(log, config, tell)
    questions = doubts(log, USED, findings, tell)
    with _saying_first(findings):
        result = diagnose_flight(log, config, findings=findings, workers=workers, progress=progress)
    if prove:
        from .proof import flight_claims, with_proofs

        analyse = partial(diagnose_flight, config=config, findings=findings)
        claims = flight_claims(result, log)
        result = with_proofs(result, log, config, analyse, claims, _proving(prove, workers), progress)
    return noted(result, questions, result.plausibility)


def detect(
    log: FlightLog, config: Config | None = None, *, progress: Progress = unseen, tell: Tell = _silent
) -> DetectResult:
    """Say which channel of a log fails, and when, without a model and without a dictionary: `bfi detect`.

    Parameters
    ----------
    progress, tell : see `identify`.

    Raises
    ------
    LogError, ConfigError : see `bfi_cli.detection.detect_faults`.
    """
    from .detection import detect_faults

    config = _config(config)
    log, findings = with_findings(log, config, tell)
    with _saying_first(findings):
        result = detect_faults(log, config, findings=findings, report=partial(progress, "channels"))
    questions = doubts(log, (*result.outputs, *result.inputs), findings, tell)
    return noted(result, questions, findings)


def compare(
    log: FlightLog,
    dictionary: Dictionary | Mapping[str, Any] | str | Path | None = None,
    config: Config | None = None,
    *,
    peers: Mapping[str, Peer] | None = None,
    allow_outside: bool = False,
    progress: Progress = unseen,
    tell: Tell = _silent,
) -> ComparisonResult:
    """Run every method on a log and compare what they say: `bfi compare`.

    Parameters
    ----------
    peers : the methods by name; default all of `bfi_cli.lab.compare.PEERS`.
    dictionary, allow_outside, progress, tell : see `identify`.

    Raises
    ------
    LogError, ConfigError, DictionaryError : see `bfi_cli.lab.compare.compare`.
    """
    from .lab.compare import PEERS
    from .lab.compare import compare as compare_on_window

    asked = _config(config)
    log, config, notes, findings = ready_log(log, asked, tell)
    known = _dictionary(dictionary, config, allow_outside=allow_outside)
    with _saying_first(findings):
        result = compare_on_window(log, known, config, PEERS if peers is None else peers, progress, asked=asked)
    return noted(result, notes, findings)


class Simulation(TypedDict, total=False):
    """Settings of a simulated flight.

    Attributes
    ----------
    manoeuvre : 3211 (default), 3211-pairs, doublet, multisine, none; of jsbsim also tour.
    amplitude : largest deflection, rad, default 0.035; of jsbsim the part of the stick's travel, default 0.08.
    start_s, step_s : start and unit step of the manoeuvre; throttle : size of a throttle doublet after it.
    tas_m_s, altitude_m : at the start, of f16 and jsbsim; wind_m_s : to the north and east, of jsbsim.
    duration_s, rate_hz : of the log, 31.72 s at 100 Hz.
    noise_sd, quantum : white noise and steps of outputs by name; turbulence_m_s : intensity of Dryden gusts.
    ordinary : what happens in a flight of jsbsim, of `bfi_cli.jsbsim.ordinary.SIMULATED`.
    seed : of noise and turbulence, 0.
    """

    manoeuvre: str
    amplitude: float | None
    start_s: float
    step_s: float
    throttle: float
    tas_m_s: float | None
    altitude_m: float | None
    wind_m_s: tuple[float, float]
    duration_s: float
    rate_hz: float
    noise_sd: Mapping[str, float]
    quantum: Mapping[str, float]
    turbulence_m_s: float
    discretisation: Discretisation
    ordinary: Sequence[Occurrence]
    seed: int


# The defaults of `bfi simulate`.
SIMULATION = Simulation(
    manoeuvre="3211",
    amplitude=None,
    start_s=0.2,
    step_s=1.0,
    throttle=0.0,
    tas_m_s=None,
    altitude_m=None,
    wind_m_s=(0.0, 0.0),
    duration_s=31.72,
    rate_hz=100.0,
    noise_sd={},
    quantum={},
    turbulence_m_s=0.0,
    discretisation="zoh",
    ordinary=(),
    seed=0,
)


def simulate(model: str | Path, *, progress: Progress = unseen, **settings: Unpack[Simulation]) -> FlightLog:
    """Return the log of a manoeuvre in straight flight: `bfi simulate`.

    Parameters
    ----------
    model : "citation", "f16", "jsbsim:c172p" and others by name; a `Path` is the YAML file of a linear model.
    settings : see `Simulation`.

    Raises
    ------
    ConfigError : no such model, manoeuvre or output, or a number that is out of range.
    """
    import numpy as np

    from . import aircraft
    from .aircraft.model import load_model

    flown: Simulation = {**SIMULATION, **settings}
    tour = flown["manoeuvre"] == "tour"
    plan = aircraft.FlightPlan(
        tas_m_s=flown["tas_m_s"],
        altitude_m=flown["altitude_m"],
        wind_m_s=flown["wind_m_s"],
        tour=tour,
        ordinary=tuple(flown["ordinary"]),
    )
    aeroplane: aircraft.LinearModel | aircraft.NonlinearModel
    if isinstance(model, Path):
        aeroplane = load_model(model)
        if plan != aircraft.FlightPlan():
            raise ConfigError(
                f"{aeroplane.name}: flies straight from its own trim; leave out --tas, --altitude, --wind, "
                "--ordinary and the tour"
            )
    else:
        aeroplane = aircraft.find_model(model, plan)
    usual = aircraft.STICK if aeroplane.name.startswith(aircraft.PREFIX) else DEFLECTION_RAD
    moved = aircraft.deviations(
        aeroplane,
        "none" if tour else flown["manoeuvre"],
        aircraft.time_axis(duration_s=flown["duration_s"], rate_hz=flown["rate_hz"]),
        amplitude=usual if flown["amplitude"] is None else flown["amplitude"],
        start_s=flown["start_s"],
        step_s=flown["step_s"],
        throttle=flown["throttle"],
    )
    if isinstance(aeroplane, aircraft.NonlinearModel):
        aeroplane = replace(aeroplane, report=partial(progress, "flight"))
    gusts = flown["turbulence_m_s"]
    return aircraft.simulate(
        aeroplane,
        moved,
        rng=np.random.default_rng(flown["seed"]),
        rate_hz=flown["rate_hz"],
        discretisation=flown["discretisation"],
        turbulence=aircraft.Dryden(sigma_m_s=gusts) if gusts else None,
        noise_sd=flown["noise_sd"],
        quantum=flown["quantum"],
    )


def _proving(prove: bool | Proving, workers: int = 1) -> Proving:
    """Return how a proof is made that is asked for, by default on some processes."""
    from .proof import Proving

    return prove if isinstance(prove, Proving) else Proving(workers=workers)


def _config(config: Config | None) -> Config:
    """Return a configuration, the defaults for None."""
    if config is not None:
        return config
    from .config import Config

    return Config()


def _dictionary(
    dictionary: Dictionary | Mapping[str, Any] | str | Path | None, config: Config, *, allow_outside: bool
) -> Dictionary | None:
    """Return a dictionary, of the configuration for None; entries without a channel act on its default channel."""
    from .dictionary import Dictionary, load_dictionary

    if dictionary is None:
        return config.load_dictionary(allow_outside=allow_outside)
    if isinstance(dictionary, Dictionary):
        return dictionary
    return load_dictionary(dictionary, allow_outside=allow_outside, channel=config.default_channel)
