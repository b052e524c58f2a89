"""The skeleton of the commands that analyse logs: request, log, answer and its files, exit code."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Protocol

import click

from .options import CHANNELS, OPTIONS, Command, GroupedCommand, config_of, with_options
from .output import check_out, emit, stages

if TYPE_CHECKING:
    from ..config import Config
    from ..dictionary import Dictionary
    from ..faults import Decision
    from ..faults.shapes import Kind
    from ..flightlog import FlightLog
    from ..kernels.progress import Progress
    from ..proof import Proving
    from ..quantities.text import Units
    from ..report.content import ReportContent
    from ..serialization import Provenance

# Exit codes of --strict without a trustworthy answer, and of --fail-on with a declared fault.
NO_ANSWER, FAULT_DECLARED = 4, 10
# From name, options and configuration of a command to an exit code.
Many = Callable[[str, Mapping[str, Any], "Config"], int | None]
# The functions from request to answer of the commands that are imported, by name.
ANSWERS: dict[str, Callable[[Asked], Answer]] = {}


class Decided(Protocol):
    """A result from which the exit code follows."""

    @property
    def verdicts(self) -> Mapping[Kind, Decision]:
        """On each kind of fault."""

    @property
    def decision(self) -> str:
        """One of `bfi_cli.faults.Decision`."""

    @property
    def is_trusted(self) -> bool:
        """Whether `--strict` accepts it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """The answer of a command.

    Attributes
    ----------
    document : from its provenance; content : of the document, in the units that are shown.
    log_sha256 : of the log, "" without one.
    dictionary : that was used.
    decided : the result of a command with `--strict` and `--fail-on`.
    deviates : whether an error is declared that surely lies within its tolerance, and is no fault.
    log : of a command of which flights are compared, as it was read.
    """

    document: Callable[[Provenance], Mapping[str, Any]]
    content: Callable[[Mapping[str, Any], Units], ReportContent]
    log_sha256: str
    dictionary: Dictionary | None = None
    decided: Decided | None = None
    deviates: bool = False
    log: FlightLog | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Asked:
    """The request of a command line.

    Attributes
    ----------
    options : options and arguments of the command by name.
    config : of the file, with the options merged; dictionary : that it names or holds, None for most commands.
    log : path, "" without a log.
    inputs : the files that the command reads.
    """

    options: Mapping[str, Any]
    config: Config
    dictionary: Dictionary | None
    log: str
    inputs: tuple[str, ...]
    progress: Progress

    @property
    def has_log(self) -> bool:
        """Whether a log is given; an empty name is given too."""
        return self.options.get("log") is not None

    def check_out(self, drawings: Sequence[str], tables: Sequence[str], *, zoom: bool = False) -> None:
        """Check, before long work, that the files of the answer may be written to --out."""
        check_out(self.options, self.inputs, drawings, tables, zoom=zoom)

    @property
    def workers(self) -> int:
        """Processes, by default as many as there are cores."""
        workers: int | None = self.options["workers"]
        return workers or os.cpu_count() or 1

    def proving(self) -> bool | Proving:
        """Return how the limits are proved, false where that is not asked for; what is done of it is kept in --out."""
        if not self.options["prove"]:
            return False
        from ..proof import Proving

        return Proving(workers=self.workers, out=self.options["out"])

    def flight(self) -> FlightLog:
        """Return the log, of a large one what the analysis of the window needs."""
        return log_of(self.log, self.config)

    def dictionary_of(self, config: Config) -> Dictionary | None:
        """Return the dictionary, its entries on the default channel of a configuration, which the log decides."""
        return None if self.dictionary is None else config.load_dictionary(allow_outside=self.options["allow_outside"])


def analysis(
    name: str,
    *options: str | Command,
    check: Callable[[Mapping[str, Any]], None] | None = None,
    many: Many | None = None,
    **words: str,
) -> Callable[[Callable[[Asked], Answer]], click.Command]:
    """Return the decorator that makes a command of a function from a request to its answer.

    Parameters
    ----------
    options, words : see `with_options`.
    check : raises an error about the options alone, before anything is read.
    many : of a command that takes several logs, answers them and returns the exit code, None where one is given.
    """

    def make(answer_to: Callable[[Asked], Answer]) -> click.Command:
        @with_options(*options, **words)
        def run(**given: Any) -> None:
            if check is not None:
                check(given)
            config, log = config_of(given["config_path"], given), given.get("log") or ""
            if many is not None:
                code = many(name, given, config)
                if code is not None:
                    click.get_current_context().exit(code)
                log = _only_log(given["logs"])
            dictionary = config.load_dictionary(allow_outside=given["allow_outside"]) if "dictionary" in given else None
            inputs = inputs_of(config, log, *given.get("logs", ()), *given.get("results", ()), dictionary=dictionary)
            with stages(wanted=given.get("progress", False)) as progress:
                if log:
                    progress("reading the log", 0.0)  # before what takes as long to import as a short log to analyse
                asked = Asked(
                    options=given, config=config, dictionary=dictionary, log=log, inputs=inputs, progress=progress
                )
                answer = answer_to(asked)
            from ..serialization import provenance

            origin = provenance(
                log_sha256=answer.log_sha256,
                config_sha256=config.sha256,
                dictionary_sha256=None if answer.dictionary is None else answer.dictionary.sha256,
                seed=config.seed,
            )
            document = answer.document(origin)
            shown, code, decided = partial(answer.content, document), 0, answer.decided
            if decided is not None:
                code = exit_code_of(decided.decision, config, is_trusted=decided.is_trusted, deviates=answer.deviates)
                if code == NO_ANSWER:
                    shown = partial(_with_reason, shown, _why_not_trusted(decided, config))
            emit(shown, document, given, units=config.shown_units, origin=origin, inputs=inputs)
            if code:
                click.get_current_context().exit(code)

        ANSWERS[name] = answer_to
        return click.command(name, help=answer_to.__doc__, cls=GroupedCommand)(run)

    return make


def _only_log(logs: Sequence[str]) -> str:
    """Return the log of a command line that names no others."""
    if not logs:
        context = click.get_current_context()
        argument = next(parameter for parameter in context.command.params if parameter.name == "logs")
        raise click.MissingParameter(ctx=context, param=argument)
    return logs[0]


def exit_code_of(decision: str, config: Config, *, is_trusted: bool, deviates: bool = False) -> int:
    """Return the exit code: 4 for --strict and an answer that is not trusted, 10 for what --fail-on names, else 0."""
    if config.strict and not is_trusted:
        return NO_ANSWER
    is_named = (config.fail_on is not None and decision == "fault") or (config.fail_on == "deviation" and deviates)
    return FAULT_DECLARED if is_named else 0


def _why_not_trusted(decided: Decided, config: Config) -> str:
    """Return why `--strict` does not accept an answer."""
    from ..report.first_screen import NOUNS

    nouns = [NOUNS[kind][1] for kind in config.require if decided.verdicts[kind] == "inconclusive"]
    if decided.decision == "inconclusive" and nouns:
        return f"{', '.join(nouns)} not excluded"
    return "false-alarm rate unknown"


def _with_reason(content_in: Callable[[Units], ReportContent], why: str, units: Units) -> ReportContent:
    """Return a report whose first line says why its exit code is 4."""
    content = content_in(units)
    if content.screen is None:
        return content
    return content.headed(replace(content.screen, text=f"{content.screen.text}; --strict: {why}"))


def log_of(path: str, config: Config) -> FlightLog:
    """Read the log of an analysis; of a large log only the window, the training time and the support of the filter.

    Raises
    ------
    LogError : the log cannot be read.
    """
    from ..flightlog import read_log
    from ..flightlog.resampling import with_reach

    from_s, to_s, rate = config.window.from_s, config.window.to_s, config.conditioning.rate_hz
    if config.detect.train is not None and from_s is not None:
        from_s = min(from_s, config.detect.train[0])
    from_s, to_s = with_reach(rate if isinstance(rate, float) else None, from_s, to_s)
    return read_log(path, from_s=from_s, to_s=to_s, **source_of(config))


def source_of(config: Config) -> dict[str, Any]:
    """Return the arguments of `bfi_cli.flightlog.read_log` that the configuration states."""
    return {name: attrgetter(str(OPTIONS[name].key))(config) for name in CHANNELS}


def inputs_of(config: Config, *paths: str | None, dictionary: Dictionary | None = None) -> tuple[str, ...]:
    """Return the files that a command reads: `paths` and those that its configuration and dictionary name."""
    named = {*paths, config.path, config.start_time.samples, config.start_time.calibration}
    named.add(config.diagnose.calibration)
    if dictionary is not None:
        named |= {dictionary.path, *(atom.file for atom in dictionary.atoms)}
    return tuple(path for path in named if path)
