"""What the limits of an answer are worth on its own log: faults of their sizes are added to it and sought again.

A limit is a claim about faults that were not in the log. Here they are: each kind of fault at its limit, through the
log's recorder, at random onsets, one at a time, and the same analysis with the same settings is asked again.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from .config import Config
from .decision import KINDS, ONSET_SAMPLES, Candidate, Proof
from .engine import in_order
from .errors import BfiError
from .faults import Fault, build_up_s, has_channel, unit_signal
from .faults.filters import response_of
from .faults.shapes import SHAPES, Kind, Shape
from .flight import DiagnoseResult, FlightLimit
from .flight.parity.record import STEP_S
from .flight.parity.sampled import quanta_of
from .flightlog import FlightLog, inject
from .flightlog.derived import with_derived
from .flightlog.quality import recorder_filters
from .journal import Journal, lines_of_journal
from .kernels.low_pass import Response
from .kernels.progress import Progress
from .model.onset import OnsetResult
from .model.onset.claims import CYCLES_LEFT, claimed_band_hz, claimed_constants_s
from .model.onset.scan_record import searched_band_hz
from .model.result import IdentifyResult, LogSummary
from .quantities.channels import STANDARD
from .serialization import document_of, provenance, to_json

Span = tuple[float, float]
Result = TypeVar("Result", OnsetResult, IdentifyResult, DiagnoseResult)
Analyse = Callable[[FlightLog], OnsetResult | IdentifyResult | DiagnoseResult]

# ADDED: faults of each kind; of 20 of which each is seen with 95 %, 18 and more are seen in 92 % of proofs.
ADDED = 20
# Draws of an onset until one lies where the answer claims something and names no fault of the kind already.
DRAWS = 1000
JOURNAL, AGAIN = "proof.jsonl", "start again, with the same --out to continue,"
# Shapes of limits of a flight that can be added to a log as they are; a leak of the static line has another size.
ADDED_TO: tuple[Shape, ...] = ("bias", "drift", "pitot_icing")


@dataclass(frozen=True, slots=True, kw_only=True)
class Proving:
    """How a proof is made: processes, and the folder that keeps what is done of it, None for none."""

    workers: int = 1
    out: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """What an answer declares or suspects: kinds of fault, under its names, with the interval of its onset if any.

    A fault that cannot be told from some of other kinds is of all these.
    """

    kinds: frozenset[Kind]
    names: frozenset[str]
    onset_s: Span | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A fault to add to the log, for the claim at an index."""

    claim: int
    fault: Fault


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A limit of an answer: of a kind of fault, on a channel or pressure line, by the faults that it excludes."""

    kind: Kind
    channel: str
    size: float
    unit: str
    draw: Callable[[np.random.Generator], Fault | None]


def with_proofs(
    result: Result,
    log: FlightLog,
    config: Config,
    analyse: Analyse,
    claims: Sequence[Claim],
    proving: Proving,
    progress: Progress,
) -> Result:
    """Return an answer with how many of the faults that its claims exclude the same analysis sees.

    Parameters
    ----------
    log, config : of the answer.
    analyse : the analysis that gave it, of the log with a fault; processes are handed it.
    claims : see `window_claims` and `flight_claims`.
    """
    before = sightings_of(result)
    trials = tuple(drawn_trials(claims, before, np.random.default_rng(config.seed)))
    # An analysis that knows the truth compares itself with it.
    channels = [claim.channel for claim in claims if claim.channel in STANDARD]
    log = replace(with_derived(log, channels, from_s=config.window.from_s, to_s=config.window.to_s), truth=None)
    filters, _ = recorder_filters(log, config.recorder.edge_hz, config.recorder.kind)
    work = partial(
        finds,
        log=log,
        analyse=analyse,
        response=response_of(filters, log.rate_hz),
        before=before,
        claims=[(claim.kind, claim.channel) for claim in claims],
        quanta=quanta_of(log, {claim.channel for claim in claims} & log.channels.keys()),
        slack_s=ONSET_SAMPLES * (STEP_S if isinstance(result, DiagnoseResult) else 1.0 / result.log.rate_hz),
    )
    digest = hashlib.sha256(to_json([log.sha256, config.model_dump(mode="json"), trials]).encode()).hexdigest()
    seen = [] if proving.out is None else _kept(proving.out / JOURNAL, digest)[: len(trials)]
    opened = nullcontext() if proving.out is None else _journal(proving.out / JOURNAL, digest, seen, log, config)
    with opened as journal:
        results = in_order(work, trials[len(seen) :], workers=proving.workers, chunk=1, again=AGAIN)
        try:
            for is_seen, _ in results:
                seen.append(is_seen)
                if journal is not None:
                    journal.add({"is_seen": is_seen})
                progress("proof of the limits", len(seen) / len(trials))
        finally:
            results.close()
    return replace(result, proved=tuple(proofs_of(claims, trials, seen)))


def _journal(path: Path, digest: str, seen: Sequence[bool | None], log: FlightLog, config: Config) -> Journal:
    """Return the journal of a proof, with what was found in it."""
    origin = provenance(log_sha256=log.sha256, config_sha256=config.sha256, seed=config.seed)
    head = document_of("start-time", {"digest": digest}, (), origin)
    return Journal(path, head, [{"is_seen": is_seen} for is_seen in seen], inputs=[log.path])


def _kept(path: Path, digest: str) -> list[bool | None]:
    """Return what a journal keeps of the same proof, in the order of its trials."""
    head, *lines = lines_of_journal(path) or [{}]
    if not isinstance(head, dict) or head.get("digest") != digest:
        return []
    return [line["is_seen"] for line in lines if isinstance(line, dict) and "is_seen" in line]


def drawn_trials(claims: Sequence[Claim], before: Sequence[Sighting], rng: np.random.Generator) -> Iterator[Trial]:
    """Yield the faults to add: of each claim `ADDED`, none where the answer names one of the kind already."""
    for i, claim in enumerate(claims):
        drawn = (claim.draw(rng) for _ in range(DRAWS))
        fits = (fault for fault in drawn if fault is not None and not sees(before, claim.kind, claim.channel, fault))
        yield from (Trial(claim=i, fault=fault) for fault in islice(fits, ADDED))


def finds(
    trial: Trial,
    *,
    log: FlightLog,
    analyse: Analyse,
    response: Response,
    before: Sequence[Sighting],
    claims: Sequence[tuple[Kind, str]],
    quanta: Mapping[str, float],
    slack_s: float,
) -> bool | None:
    """Say whether an analysis sees the fault of a trial, None where it cannot be added to the log.

    Parameters
    ----------
    quanta : steps in which channels were recorded: no recorder stores a part of one.
    """
    fault = _in_whole_steps(trial.fault, quanta.get(trial.fault.channel))
    try:
        faulty = replace(_with_components(inject(log, [fault], response=response), log), truth=None)
    except BfiError:
        return None
    try:
        sightings = sightings_of(analyse(faulty))
    except BfiError:
        return False
    new = [sighting for sighting in sightings if sighting.onset_s is not None or sighting not in before]
    return sees(new, *claims[trial.claim], fault, slack_s)


def _in_whole_steps(fault: Fault, quantum: float | None) -> Fault:
    """Return a step with a size of whole quanta, no smaller than it was: others would blur the levels of a channel."""
    if quantum is None or fault.shape != "bias":
        return fault
    n_quanta = math.ceil(abs(fault.magnitude) / quantum - 1e-6)
    return replace(fault, magnitude=math.copysign(n_quanta * quantum, fault.magnitude))


def _with_components(faulty: FlightLog, log: FlightLog) -> FlightLog:
    """Return a log whose ground velocity has the ground speed of the log: both are of one receiver."""
    speed = {name: other.find("ground_speed") for name, other in (("faulty", faulty), ("clean", log))}
    if speed["faulty"] is None or speed["clean"] is None or speed["faulty"].values is speed["clean"].values:
        return faulty
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num(speed["faulty"].values / speed["clean"].values, nan=1.0, posinf=1.0, neginf=1.0)
    names = [name for name in ("velocity_north", "velocity_east") if name in faulty.channels]
    return faulty.with_values({name: share * faulty.channels[name].values for name in names})


def proofs_of(claims: Sequence[Claim], trials: Sequence[Trial], seen: Sequence[bool | None]) -> Iterator[Proof]:
    """Yield the proof of every claim of which faults could be added."""
    for i, claim in enumerate(claims):
        answers = [is_seen for trial, is_seen in zip(trials, seen, strict=True) if trial.claim == i]
        n_added = sum(is_seen is not None for is_seen in answers)
        if n_added:
            yield Proof(
                kind=claim.kind,
                channel=claim.channel,
                size=claim.size,
                unit=claim.unit,
                n_seen=answers.count(True),
                n_added=n_added,
            )


def sightings_of(result: OnsetResult | IdentifyResult | DiagnoseResult) -> tuple[Sighting, ...]:
    """Return what an answer declares or suspects, what is within a tolerance too."""
    if isinstance(result, DiagnoseResult):
        return tuple(
            Sighting(
                kinds=frozenset((event.kind,)),
                names=frozenset((event.fault, *event.among, *event.channels)),
                onset_s=event.onset_ci95,
            )
            for event in (*result.events, *result.deviations)
        )
    declared = (
        Sighting(
            kinds=frozenset(SHAPES[shape].kind for shape in (estimate.fault.shape, *estimate.among) if shape in SHAPES),
            names=frozenset((estimate.fault.channel, estimate.fault.shape)),
            onset_s=estimate.onset_span_s,
        )
        for estimate in result.faults
    )
    suspected = (
        Sighting(
            kinds=frozenset((candidate.kind,)), names=frozenset((candidate.channel, candidate.shape)), onset_s=None
        )
        for candidate in result.candidates
        if candidate.state == "suspected"
    )
    return (*declared, *suspected)


def sees(sightings: Sequence[Sighting], kind: Kind, channel: str, fault: Fault, slack_s: float = 0.0) -> bool:
    """Say whether sightings of its kind, or of its shape's, hold the onset of a fault, or a time until it is built up.

    What grows until it ends is built up then.
    """
    kinds, built_up_s = {kind, SHAPES[fault.shape].kind}, build_up_s(fault)
    if built_up_s is None and kind == "slow" and fault.offset_s is not None:
        built_up_s = fault.offset_s - fault.onset_s
    first_s, last_s = fault.onset_s - slack_s, fault.onset_s + (built_up_s or 0.0) + slack_s
    return any(
        not kinds.isdisjoint(sighting.kinds)
        and channel in sighting.names
        and (sighting.onset_s is None or (sighting.onset_s[0] <= last_s and first_s <= sighting.onset_s[1]))
        for sighting in sightings
    )


def window_claims(
    result: IdentifyResult | OnsetResult, config: Config, entries: Mapping[str, Fault] | None = None
) -> list[Claim]:
    """Return by kind and channel the limit of a window, where every fault of the kind that was looked for has one.

    Parameters
    ----------
    entries : of a dictionary with their onsets, by name.
    """
    asked = [candidate for candidate in result.candidates if candidate.is_unseen]
    claims = []
    for kind in KINDS:
        for channel in dict.fromkeys(candidate.channel for candidate in asked if candidate.kind == kind):
            alike = [candidate for candidate in asked if (candidate.kind, candidate.channel) == (kind, channel)]
            errors = [candidate.seen_above for candidate in alike if candidate.seen_above is not None]
            if len(errors) < len(alike):
                continue
            error = max(errors)
            draw = partial(_window_fault, alike=alike, error=error, result=result, config=config)
            claims.append(
                Claim(
                    kind=kind,
                    channel=channel,
                    size=error,
                    unit=alike[0].channel_unit,
                    draw=partial(draw, entries=entries or {}),
                )
            )
    return claims


def _window_fault(
    rng: np.random.Generator,
    *,
    alike: Sequence[Candidate],
    error: float,
    result: IdentifyResult | OnsetResult,
    config: Config,
    entries: Mapping[str, Fault],
) -> Fault | None:
    """Return a fault of one of some candidates that makes an error within the window; None where it does not fit.

    Its onset is one that was searched, or that of its entry within what that is known to; its frequency, time constant
    or duration one that the claim covers, all equally likely, frequencies by their logarithm.
    """
    candidate = alike[int(rng.integers(len(alike)))]
    error *= float(rng.choice([-1.0, 1.0]))
    entry = entries.get(candidate.name)
    if entry is not None:
        shift_s = float(rng.uniform(-1.0, 1.0)) * config.onset_tolerance_s
        return _with_error(entry.later(shift_s), error, result.log)
    if not candidate.onsets_checked:
        return None
    spans = candidate.onsets_checked
    lengths = np.array([last_s - first_s for first_s, last_s in spans])
    first_s, last_s = spans[int(rng.choice(len(spans), p=lengths / lengths.sum()))]
    key, duration_s = SHAPES[candidate.shape].parameter, result.log.stop_s - result.log.start_s
    parameter: dict[str, Any] = {}
    if key == "frequency_hz":
        rate_hz, n_samples = result.model.rate_hz, result.log.n_samples
        band_hz = claimed_band_hz(searched_band_hz(config.start_time.frequency_hz, rate_hz, n_samples), duration_s)
        frequency_hz = float(np.exp(rng.uniform(*np.log(band_hz))))
        parameter, last_s = {key: frequency_hz}, min(last_s, result.log.stop_s - CYCLES_LEFT / frequency_hz)
    elif key is not None:
        parameter = {key: float(rng.uniform(0.0, claimed_constants_s(candidate.shape, duration_s)[-1]))}
    elif candidate.shape == "samples":
        parameter = {"file": config.start_time.samples}
    if last_s <= first_s:
        return None
    onset_s = float(rng.uniform(first_s, last_s))
    fault = Fault(shape=candidate.shape, channel=candidate.channel, magnitude=1.0, onset_s=onset_s, **parameter)
    return _with_error(fault, error, result.log)


def _with_error(fault: Fault, error: float, window: LogSummary) -> Fault | None:
    """Return a fault with the magnitude that makes its largest error within a window; None where none does."""
    time_s = np.linspace(window.start_s, window.stop_s, window.n_samples)
    largest = float(np.abs(unit_signal(fault, time_s, window_start_s=window.start_s)).max())
    if largest == 0.0:
        return None
    if fault.shape == "drift" and fault.offset_s is None:
        return _drift_until(fault, window.stop_s, error)
    return replace(fault, magnitude=error / largest)


def _drift_until(drift: Fault, stop_s: float, error: float) -> Fault:
    """Return a drift that makes an error by a time and keeps it.

    If it went on, it would make errors by the end of the log that no instrument has; if it ended, that would show as a
    step back, which is another fault.
    """
    return replace(drift, shape="ramp_hold", slope=None, magnitude=error, duration_s=stop_s - drift.onset_s)


def flight_claims(result: DiagnoseResult, log: FlightLog) -> list[Claim]:
    """Return what a flight would show of each channel and of icing, in most of the time that was watched."""
    claims = []
    # A fault has one size, by whatever it shows first.
    for limit in {(limit.fault, limit.shape): limit for limit in result.limits if limit.holds_in < 1.0}.values():
        is_channel = limit.fault in STANDARD and limit.shape in SHAPES and log.find(limit.fault) is not None
        shape = limit.shape if is_channel else limit.fault
        if limit.seen_above is None or shape not in ADDED_TO:
            continue
        claims.append(
            Claim(
                kind=SHAPES[shape].kind,
                channel=limit.fault,
                size=limit.seen_above,
                unit=limit.unit,
                draw=partial(_flight_fault, limit=limit, shape=shape, result=result),
            )
        )
    return claims


def _flight_fault(
    rng: np.random.Generator, *, limit: FlightLimit, shape: Shape, result: DiagnoseResult
) -> Fault | None:
    """Return a fault of the size that would be seen, which grows as long as its window lasts; None if none watches."""
    assert limit.seen_above is not None
    assert limit.seen_within_s is not None
    length_s = limit.seen_within_s
    onset_s = float(rng.uniform(result.log.start_s, result.log.stop_s - length_s))
    # What grows, or is to be seen, within so many seconds has these in flight.
    is_watched = all(
        any(look.from_s <= at_s <= look.to_s for look in result.windows) for at_s in (onset_s, onset_s + length_s)
    )
    if not is_watched or any(from_s <= onset_s + length_s and onset_s <= to_s for from_s, to_s, _ in result.unwatched):
        return None
    sign = 1.0 if SHAPES[shape].is_loss else float(rng.choice([-1.0, 1.0]))
    if shape == "drift":
        drift = Fault(shape="drift", channel=limit.fault, magnitude=1.0, onset_s=onset_s)
        return _drift_until(drift, onset_s + length_s, sign * limit.seen_above * length_s)
    return Fault(
        shape=shape,
        channel=limit.fault if has_channel(shape) else "",
        magnitude=sign * limit.seen_above,
        onset_s=onset_s,
        offset_s=onset_s + length_s if SHAPES[shape].kind == "slow" else None,
    )
