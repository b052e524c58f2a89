"""Run every method on one log, time it, and score its statement against the injected faults, or against the others."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...config import Config
from ...dictionary import Dictionary
from ...errors import BfiError
from ...faults import Fault, has_channel
from ...faults.shapes import SHAPES
from ...flightlog import FlightLog
from ...flightlog.record import frozen_array
from ...kernels.progress import Progress, unseen
from ...model.preprocessing.window import with_inputs_of
from ...model.result import log_summary
from ...notes import Note
from ...threads import one_thread
from .peers import Peer, Problem
from .result import SPREAD_S, ComparisonResult, Isolation, Outcome, Score, Statement, Suspect

# A suspect is a false alarm if its onset lies more than so many seconds before a fault (that of a slow drift is often
# estimated too early), or if it was declared more than SPREAD_S before the fault. Not tuned.
EARLY_S = 5.0


def compare(
    log: FlightLog,
    dictionary: Dictionary | None,
    config: Config,
    peers: Mapping[str, Peer],
    progress: Progress = unseen,
    *,
    asked: Config | None = None,
) -> ComparisonResult:
    """Run methods on the window of a log, one after the other, each on one BLAS thread.

    A method that lacks a channel, a model or a dictionary has the reason in its outcome.

    Parameters
    ----------
    config : with channels of the log in place of defaults that it lacks; asked : as the user stated it, None for the
        same.
    peers : the methods by name.

    Raises
    ------
    LogError : the log has no such window or output, or no input that the user names.
    """
    config = with_inputs_of(log, config)
    window = log.window(config.window.from_s, config.window.to_s)
    problem = Problem(
        log=replace(log, truth=None),
        part=replace(window, truth=None),
        dictionary=dictionary,
        config=config,
        asked=config if asked is None else asked,
    )
    truth = None
    if window.truth is not None:
        first_s, last_s = window.ends()
        acting = (
            fault
            for fault in window.truth.faults
            if fault.onset_s <= last_s and (fault.offset_s is None or fault.offset_s > first_s)
        )
        truth = tuple(sorted(acting, key=lambda fault: fault.onset_s))
    hit = () if window.truth is None else tuple(window.truth.clean)
    channels = [window.channel(name) for name in config.outputs]
    if problem.asked.inputs not in (Config().inputs, ("auto",)):
        window.signals(problem.asked.inputs)  # inputs that the user names must be in the log
    outcomes = []
    for name, peer in peers.items():
        progress(name, 0.0)
        outcomes.append(outcome_of(name, peer, problem, truth, hit))
    return ComparisonResult(
        log=log_summary(
            log.path, window.time_s, rate_hz=window.rate_hz, native_rate_hz=window.rate_hz, epoch=log.epoch
        ),
        truth=truth,
        outcomes=tuple(replace(outcome, agrees=_agreeing(outcome, outcomes)) for outcome in outcomes),
        outputs=config.outputs,
        units=tuple(channel.unit for channel in channels),
        time_s=window.time_s,
        measured=tuple(frozen_array(channel.values) for channel in channels),
        notes=(Note.method("the injected faults were hidden from every method"),) if truth else (),
    )


def outcome_of(
    name: str, peer: Peer, problem: Problem, truth: Sequence[Fault] | None, hit: Sequence[str] = ()
) -> Outcome:
    """Return the statement of a method, or why it has none, on one BLAS thread; `agrees` is left empty.

    Parameters
    ----------
    truth, hit : see `score_of`; None where nothing is known of injected faults.
    """
    started_s = time.perf_counter()
    statement, reason = None, None
    try:
        if lacking := [" or ".join(names) for names in peer.needs if problem.part.channels.keys().isdisjoint(names)]:
            raise BfiError(f"needs {', '.join(lacking)}, which the log lacks; map them with --channel")
        with one_thread():
            statement = peer.state(problem)
    except BfiError as error:
        reason = str(error).removeprefix(f"{problem.log.path}: ")
    return Outcome(
        method=name,
        summary=peer.summary,
        statement=statement,
        reason=reason,
        seconds=time.perf_counter() - started_s,
        score=None if truth is None or statement is None else score_of(statement, truth, hit),
        agrees=(),
    )


def score_of(statement: Statement, truth: Sequence[Fault], hit: Sequence[str] = ()) -> Score:
    """Score a statement against the injected faults, each paired with the suspect that stands for it, see `paired`.

    Parameters
    ----------
    truth : injected faults, the first onset first.
    hit : channels that injected faults of pressure lines moved.
    """
    pairs, rest = paired(statement, truth, hit)
    isolated: Isolation | None = None
    if truth:
        isolated = "no"
        if len(pairs) == len(truth) and not rest:
            isolated = "fault" if all(_same_kind(suspect, fault) for suspect, fault in pairs) else "channel"
    onset_error_s = magnitude_error = delay_s = None
    if pairs:
        suspect, fault = pairs[0]
        onset_error_s = None if suspect.onset_s is None else suspect.onset_s - fault.onset_s
        delay_s = None if suspect.declared_s is None else suspect.declared_s - fault.onset_s
        if (
            suspect.magnitude is not None
            and suspect.shape == fault.shape
            and fault.magnitude
            and SHAPES[fault.shape].has_magnitude
        ):
            magnitude_error = abs(suspect.magnitude - fault.magnitude) / abs(fault.magnitude)
    return Score(
        isolated=isolated,
        onset_error_s=onset_error_s,
        magnitude_error=magnitude_error,
        delay_s=delay_s,
        false_alarms=len(rest) + (statement.decision == "fault" and not statement.suspects and not truth),
        missed=len(truth) - len(pairs),
    )


def paired(
    statement: Statement, truth: Sequence[Fault], hit: Sequence[str] = ()
) -> tuple[list[tuple[Suspect, Fault]], list[Suspect]]:
    """Return the pairs of a suspect and the injected fault that it stands for, and the suspects that stand for none.

    Faults are paired in turn; a suspect must act on the fault's channel and not begin too early, one of the same kind
    is preferred, then the nearest onset.
    """
    rest, pairs = list(statement.suspects), []
    for fault in truth:
        able = [suspect for suspect in rest if _stands_for(suspect, fault, hit)]
        if able:
            best = min(
                able,
                key=lambda suspect: (
                    not _same_kind(suspect, fault),
                    np.inf if suspect.onset_s is None else abs(suspect.onset_s - fault.onset_s),
                ),
            )
            rest.remove(best)
            pairs.append((best, fault))
    return pairs, rest


def _stands_for(suspect: Suspect, fault: Fault, hit: Sequence[str]) -> bool:
    begins_early = suspect.onset_s is not None and suspect.onset_s < fault.onset_s - EARLY_S
    if begins_early or (suspect.declared_s is not None and suspect.declared_s < fault.onset_s - SPREAD_S):
        return False
    if has_channel(fault.shape):
        return suspect.channel == fault.channel
    return suspect.shape == fault.shape or suspect.channel in hit


def _same_kind(suspect: Suspect, fault: Fault) -> bool:
    return suspect.shape in SHAPES and SHAPES[suspect.shape].kind == SHAPES[fault.shape].kind  # type: ignore[index]


def _agreeing(outcome: Outcome, others: Sequence[Outcome]) -> tuple[str, ...]:
    """Return the other methods with the same decision and, where both name channels, the same channels."""

    def named(result: Outcome) -> set[str]:
        return {suspect.channel for suspect in result.statement.suspects} if result.statement else set()

    return tuple(
        other.method
        for other in others
        if other.method != outcome.method and outcome.statement is not None and other.statement is not None
        if other.statement.decision == outcome.statement.decision
        if not named(outcome) or not named(other) or named(outcome) == named(other)
    )
