"""Many logs in one call of a command: each is analysed as a call on it alone would, on the one engine."""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click

from ..errors import BfiError, ConfigError, reason_of
from .analysis import ANSWERS, Answer, Asked, exit_code_of, inputs_of
from .output import note, print_text, progress, show_lines, without_notes

if TYPE_CHECKING:
    from ..config import Config
    from ..fleet import FleetLog, LogAnswer, Outcome, Store, Task
    from ..fleet.trends import FleetTrend
    from ..serialization import Provenance

# Options that ask for an answer to many logs, whatever their number.
FLEET_OPTIONS = ("recursive", "list_file", "jsonl", "scheduler", "by")
# What is about one log: refused with several, by the option's name in the table, with what serves in its place.
SINGLE_LOG_OPTIONS = {
    "series": "result.json in the folder of each log has them; give --out DIR",
    "verbose": "the report of each log has every table; give --out DIR",
    "events_csv": "the table events has those of all; give --out DIR",
}
DEFECT = 70  # exit code of a defect of ours, EX_SOFTWARE of sysexits.h
PATH_LETTERS, STATE_LETTERS, ANSWER_LETTERS = 48, 14, 100  # of a line on a terminal
PIECE = 1 << 20  # letters of an array that are in memory while it is printed
# Settings that change no answer: what an exit code follows from, and where a configuration lies.
NO_ANSWER_SETTINGS = ("strict", "fail_on")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Request:
    """What is asked of every log.

    Attributes
    ----------
    kind : name of the command; options : those of a call on one log.
    settings : digest of what an answer depends on beside the log.
    origin : provenance of every answer, with the log's digest in place of its own.
    wants_files, wants_document : see `bfi_cli.fleet.Outcome`.
    """

    kind: str
    config: Config
    options: Mapping[str, Any]
    settings: str
    origin: Provenance
    wants_files: bool
    wants_document: bool


def answer_fleet(kind: str, given: Mapping[str, Any], config: Config) -> int | None:
    """Analyse the logs of a command line, print and write the answers, and return the exit code.

    Nothing is done, and None is returned, where a single log is asked for.

    Raises
    ------
    ConfigError : an option is about one log, or a file may not be written.
    LogError : there is no log.
    """
    from ..files import replace_files
    from ..fleet import Store, fleet_files, is_fleet, logs_of, remove_left_over, run_fleet, trends_of
    from ..serialization import provenance

    if not is_fleet(given["logs"]) and not any(given.get(name) for name in FLEET_OPTIONS):
        return None
    for name, instead in SINGLE_LOG_OPTIONS.items():
        if given.get(name):
            raise ConfigError(f"--{name.replace('_', '-')}: is about one log, got several; {instead}")
    if given["workers"] is not None and given["scheduler"] is not None:
        raise click.UsageError("--workers and --scheduler exclude each other; keep one")
    logs = logs_of(given["logs"], recursive=given["recursive"], listed=given["list_file"])
    out: Path | None = given["out"]
    if given.get("by") and not any(log.aircraft for log in logs):
        raise ConfigError("--by aircraft: no log states its aircraft; give --list FILE with columns log and aircraft")
    inputs = inputs_of(config, given["list_file"])
    _check_files(kind, given, logs, inputs)
    origin = provenance(log_sha256="", config_sha256=config.sha256, seed=config.seed)
    request = Request(
        kind=kind,
        config=config,
        options={**given, "out": None, "as_json": False, "workers": 1, "progress": False},
        settings=_digest_of_settings(kind, config, given, inputs, origin),
        origin=origin,
        wants_files=out is not None,
        wants_document=given["as_json"] or given["jsonl"] is not None,
    )
    answers: list[LogAnswer] = []
    opened = nullcontext() if out is None else Store(out, origin=origin, inputs=inputs, force=given["force"])
    workers, work = given["workers"] or os.cpu_count() or 1, partial(analyse, request=request)
    with (
        opened as store,
        _documents(given) as add_document,
        progress("logs", wanted=given.get("progress")) as report,
        closing(run_fleet(work, logs, store=store, workers=workers, scheduler=given["scheduler"])) as results,
    ):
        report(0, len(logs))
        for answer, document in results:
            answers.append(answer)
            if request.wants_document:
                add_document(document or _stored(answer, store, origin))
            report(len(answers), len(logs))
    trends = trends_of(answers) if given.get("by") else None
    if out is not None:
        files = fleet_files(kind, answers, origin, trends)
        replace_files(files, out, inputs=inputs, force=given["force"])
        remove_left_over(kind, out, files)
        note(f"wrote {out / 'index.html'}")
    if not given["as_json"]:
        show_lines({}, _as_wide_as_terminal([*_lines(answers), *_trend_lines(trends)]), as_json=False)
    unread = [answer for answer in answers if answer.error]
    if unread:
        click.echo(f"bfi {kind}: {len(unread)} of {len(answers)} logs could not be read", err=True)
    return _exit_code(answers, config)


def _check_files(kind: str, given: Mapping[str, Any], logs: Sequence[FleetLog], inputs: Sequence[str]) -> None:
    """Check, before long work, that the files of the answers may be written."""
    from ..files import check_files, check_folder, same_file
    from ..fleet import fleet_names

    out: Path | None = given["out"]
    if given["jsonl"] is not None:
        paths = [*inputs, *(log.path for log in logs)]
        check_files([given["jsonl"]], inputs=paths, force=given["force"], option="--jsonl")
    if out is None:
        return
    check_folder(out, fleet_names(kind), inputs=inputs, force=given["force"])
    for log in logs:
        if same_file(out / log.folder, log.path):
            raise ConfigError(f"{out / log.folder}: is a log of this command; give another --out")


def _digest_of_settings(
    kind: str, config: Config, given: Mapping[str, Any], inputs: Sequence[str], origin: Provenance
) -> str:
    """Return the digest of what an answer depends on beside the log: versions, configuration and the files it names."""
    from ..fleet import columns_of_answers
    from ..flightlog import digest_of_log
    from ..serialization import to_json

    settings = config.model_dump(mode="json", exclude=set(NO_ANSWER_SETTINGS))
    versions = (origin.version, origin.numpy, origin.scipy)
    files = sorted(digest_of_log(path) for path in inputs if path != given["list_file"] and os.path.isfile(path))
    asked = (kind, given.get("explain", False), given.get("prove", False), columns_of_answers(kind))
    text = to_json([asked, versions, settings, files], indent=None)
    return hashlib.sha256(text.encode()).hexdigest()


def analyse(task: Task, *, request: Request) -> Outcome:
    """Return what a call of the command on a log alone answers; an error is an answer too."""
    from ..fleet import LogAnswer, Outcome
    from ..fleet.running import key_of
    from ..flightlog import digest_of_log

    log, sha256, key = task.log, "", ""
    if os.path.isfile(log.path) or os.path.isdir(log.path):
        try:
            sha256 = digest_of_log(log.path)
            key = key_of(request.settings, sha256)
        except (OSError, BfiError):
            pass  # the reader says why
    if key and key == task.known_key:
        return Outcome()
    unread = LogAnswer(log=log.path, folder=log.folder, key=key, sha256=sha256, flight={})
    try:
        with without_notes():
            return _analysed(task, request, key)
    except BfiError as error:
        return Outcome(answer=replace(unread, error=str(error), error_code=error.exit_code))
    except MemoryError:
        error_line = f"{log.path}: out of memory; choose a shorter window or a lower --rate"
        return Outcome(answer=replace(unread, key="", error=error_line, error_code=3))
    except Exception as error:
        from . import crash_line

        return Outcome(answer=replace(unread, key="", error=crash_line(error), error_code=DEFECT))


def _analysed(task: Task, request: Request, key: str) -> Outcome:
    """Return the answer on a log that is read.

    Raises
    ------
    BfiError : the log, or the configuration for it, cannot be used.
    """
    from ..fleet import LogAnswer, Outcome, answer_of_diagnosis, answer_of_info, rows_of_constants
    from ..flight.plausibility.constants import constant_errors
    from ..quantities.text import IN_FILES, UNITS
    from ..report.files import content_files
    from ..serialization import to_json, without_series

    import_module(f"{__package__}.{request.kind}")  # a new process knows none of the commands
    log, config = task.log, request.config
    asked = Asked(
        options={**request.options, "logs": (log.path,)},
        config=config,
        dictionary=None,
        log=log.path,
        inputs=inputs_of(config, log.path),
        progress=lambda _stage, _done: None,
    )
    answer: Answer = ANSWERS[request.kind](asked)
    origin = replace(request.origin, log_sha256=answer.log_sha256)
    document = answer.document(origin)
    content = answer.content(document, UNITS[config.shown_units])
    fields = (answer_of_diagnosis if request.kind == "diagnose" else answer_of_info)(document, content)
    decided = answer.decided
    files = {}
    if request.wants_files:
        files = content_files(content, document, origin, plain=answer.content(document, IN_FILES))
    return Outcome(
        answer=LogAnswer(
            log=log.path,
            folder=log.folder,
            key=key,
            sha256=answer.log_sha256,
            is_trusted=decided is None or decided.is_trusted,
            constants=() if answer.log is None else rows_of_constants(constant_errors(answer.log)),
            **fields,
        ),
        document=to_json(without_series(document), indent=None) if request.wants_document else "",
        files=files,
    )


def _stored(answer: LogAnswer, store: Store | None, origin: Provenance) -> str:
    """Return the document of an answer that no worker made: of a log that is unread, or did not change."""
    from ..fleet import unread_document
    from ..serialization import to_json, without_series

    if answer.error or store is None:
        return to_json(unread_document(answer.log, answer.error, origin), indent=None)
    return to_json(without_series(store.document(answer)), indent=None)


@contextmanager
def _documents(given: Mapping[str, Any]) -> Iterator[Any]:
    """Yield a function that takes documents as they come, for --jsonl and --json; the array is printed at the end."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as spool, _jsonl(given["jsonl"]) as file:

        def add(document: str) -> None:
            if file is not None:
                try:
                    file.write(document + "\n")
                    file.flush()
                except OSError as error:
                    raise ConfigError(
                        f"{given['jsonl']}: cannot be written, {reason_of(error)}; free some space"
                    ) from None
            if given["as_json"]:
                spool.write((",\n" if spool.tell() else "") + document)

        yield add
        if given["as_json"]:
            spool.seek(0)
            print_text("[\n")
            while piece := spool.read(PIECE):
                print_text(piece)
            print_text("\n]\n")


@contextmanager
def _jsonl(path: Path | None) -> Iterator[IO[str] | None]:
    if path is None:
        yield None
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("w", encoding="utf-8", newline="")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written, {reason_of(error)}; give another --jsonl") from None
    with file:
        yield file


def _lines(answers: Sequence[LogAnswer]) -> list[str]:
    """Return a line for each log, those that need a reader first."""
    from ..printable import printable, shortened

    ordered = sorted(answers, key=lambda answer: answer.rank)
    logs = [shortened(answer.log, PATH_LETTERS) for answer in ordered]
    width = max(map(len, logs), default=0)
    lines = []
    for log, answer in zip(logs, ordered, strict=True):
        state = "not read" if answer.error else answer.state.replace("_", " ")
        summary = printable(answer.error) if answer.error else shortened(answer.summary, ANSWER_LETTERS)
        hidden = f"; {answer.hidden}" if answer.hidden else ""
        lines.append(f"{log:<{width}}  " + (f"{state:<{STATE_LETTERS}}  " if state else "") + f"{summary}{hidden}")
    return lines


def _as_wide_as_terminal(lines: Sequence[str]) -> list[str]:
    """Return lines, on a terminal cut where it ends, so that each log has one; a pipe gets each line whole."""
    if not sys.stdout.isatty():
        return list(lines)
    width = shutil.get_terminal_size().columns
    return [line if len(line) <= width else f"{line[: width - 1]}…" for line in lines]


def _trend_lines(trends: Sequence[FleetTrend] | None) -> list[str]:
    """Return a line for each trend that is declared, or one that none is; none where they are not asked for."""
    from ..fleet import sentence_of_trend

    if trends is None:
        return []
    declared = [f"{trend.aircraft}: {sentence_of_trend(trend)}" for trend in trends if trend.is_declared]
    return declared or [f"no trend over the flights of an aircraft, of {len(trends)} constant errors"]


def _exit_code(answers: Sequence[LogAnswer], config: Config) -> int:
    """Return the exit code of a fleet.

    70 if a log met a defect of ours; that of the errors if no log could be read; else the first of what a call on a log
    alone would exit with.
    """
    codes = {answer.error_code for answer in answers if answer.error}
    if DEFECT in codes:
        return DEFECT
    read = [answer for answer in answers if not answer.error]
    if not read:
        return max(codes, default=0)
    by_log = {
        exit_code_of(
            answer.decision, config, is_trusted=answer.is_trusted, deviates=bool(answer.flight.get("deviations"))
        )
        for answer in read
    }
    return min(by_log - {0}, default=0)
