"""The skeleton of the commands that analyse logs: what is asked, the log, the answer and its files, the exit code."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Protocol

import click

from ..errors import LogError
from ..notes import Note
from .options import CHANNELS, OPTIONS, Command, GroupedCommand, config_of, with_options
from .output import check_out, emit, note
from .progress import stages

if TYPE_CHECKING:
    from ..config import Config
    from ..dictionary import Dictionary
    from ..display_units import Units
    from ..flightlog import FlightLog
    from ..kernels.progress import Progress
    from ..plausibility import Implausible
    from ..provenance import Provenance
    from ..report.content import ReportContent

# Exit codes of --strict without a trustworthy answer, and of --fail-on with a declared fault.
NO_ANSWER, FAULT_DECLARED = 4, 10


class Decided(Protocol):
    """What the exit code asks of a result."""

    @property
    def decision(self) -> str:
        """One of `bfi_cli.faults.Decision`."""

    @property
    def is_trusted(self) -> bool:
        """Whether `--strict` accepts it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What a command answers.

    Attributes
    ----------
    document : from its provenance; content : of the document, in the units that are shown.
    log_sha256 : "" where no log was read.
    dictionary : that was used.
    decided : the result, where it has an exit code.
    """

    document: Callable[[Provenance], Mapping[str, Any]]
    content: Callable[[Mapping[str, Any], Units], ReportContent]
    log_sha256: str
    dictionary: Dictionary | None = None
    decided: Decided | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Asked:
    """What a command line asks.

    Attributes
    ----------
    options : of the command, and its arguments, by name.
    config : of the file, with the options in it; dictionary : that it names or holds, if the command has one.
    log : path, "" where none is given.
    inputs : the files that the command reads.
    notes : on what was taken from the log in place of defaults, and on what is odd in it.
    findings : on channels that contradict each other throughout the flight.
    """

    options: Mapping[str, Any]
    config: Config
    dictionary: Dictionary | None
    log: str
    inputs: tuple[str, ...]
    progress: Progress
    notes: tuple[Note, ...] = ()
    findings: tuple[Implausible, ...] = ()

    @property
    def has_log(self) -> bool:
        """Whether a log is given; an empty name is one of no file."""
        return self.options.get("log") is not None

    def check_out(self, drawings: Sequence[str], tables: Sequence[str], *, zoom: bool = False) -> None:
        """Check, before long work, that the files of the answer may be written to --out."""
        check_out(self.options, self.inputs, drawings, tables, zoom=zoom)

    def read(self) -> tuple[FlightLog, Asked]:
        """Return the log, and what is asked of it: with what it has in place of defaults that it lacks.

        The notes say what was taken, which windows a long log has unless one was asked for, and ask about values that
        cannot be and units that nobody has stated; the terminal is told too.
        """
        from ..flightlog.quality import advice_on_the_ground, advice_on_windows
        from ..preprocessing.defaults import with_defaults_of

        flight, findings = with_findings(log_of(self.log, self.config), self.config)
        config, notes = with_defaults_of(flight, self.config)
        whole = (config.window.from_s, config.window.to_s) == (None, None)
        asked = (self.config.window.from_s, self.config.window.to_s) != (None, None)
        on_windows = None if asked else advice_on_windows(flight)
        if on_windows and whole:
            on_windows += "; the whole record is analysed"
        on_ground = advice_on_the_ground(flight, config.window.from_s, config.window.to_s, suspects=config.outputs)
        notes = (*map(Note.advice, filter(None, (on_ground, on_windows))), *notes)
        for one in notes:
            note(one.text)
        notes = (*notes, *doubts(flight, (*config.outputs, *config.inputs), findings))
        dictionary = self.dictionary
        if dictionary is not None:  # its entries may act on the output, which is known now
            dictionary = config.load_dictionary(allow_outside=self.options["allow_outside"])
        return flight, replace(self, config=config, notes=notes, dictionary=dictionary, findings=findings)

    def noted(self, result: Any) -> Any:
        """Return a result with the notes before its own, and without a verdict where channels contradict each other."""
        from ..plausibility import in_words, without_verdict

        result = replace(result, notes=(*self.notes, *result.notes))
        if hasattr(result, "plausibility"):
            return without_verdict(result, self.findings)
        said = in_words(self.findings)
        return replace(result, notes=(Note.limit(said), *result.notes)) if said else result


def analysis(
    name: str, *options: str | Command, check: Callable[[Mapping[str, Any]], None] | None = None, **words: str
) -> Callable[[Callable[[Asked], Answer]], click.Command]:
    """Return the decorator that makes a command of a function from what is asked to its answer.

    Parameters
    ----------
    options, words : see `with_options`.
    check : raises what is wrong with the options alone, before anything is read.
    """

    def make(answer_to: Callable[[Asked], Answer]) -> click.Command:
        @with_options(*options, **words)
        def run(**given: Any) -> None:
            if check is not None:
                check(given)
            config, log = config_of(given["config_path"], given), given.get("log") or ""
            dictionary = config.load_dictionary(allow_outside=given["allow_outside"]) if "dictionary" in given else None
            inputs = inputs_of(config, log, *given.get("logs", ()), *given.get("results", ()), dictionary=dictionary)
            with stages(wanted=given.get("progress", False)) as progress:
                if log:
                    progress("reading the log", 0.0)  # before what takes as long to import as a short log to analyse
                asked = Asked(
                    options=given, config=config, dictionary=dictionary, log=log, inputs=inputs, progress=progress
                )
                answer = answer_to(asked)
            from ..provenance import provenance

            origin = provenance(
                log_sha256=answer.log_sha256,
                config_sha256=config.sha256,
                dictionary_sha256=None if answer.dictionary is None else answer.dictionary.sha256,
                seed=config.seed,
            )
            document = answer.document(origin)
            shown = partial(answer.content, document)
            emit(shown, document, given, units=config.shown_units, origin=origin, inputs=inputs)
            if answer.decided is not None:
                click.get_current_context().exit(_exit_code(answer.decided, config))

        return click.command(name, help=answer_to.__doc__, cls=GroupedCommand)(run)

    return make


def _exit_code(result: Decided, config: Config) -> int:
    """Return the exit code of an answer: 4 for --strict without trust in it, 10 for --fail-on with a fault, else 0."""
    if config.strict and not result.is_trusted:
        return NO_ANSWER
    return FAULT_DECLARED if config.fail_on == "fault" and result.decision == "fault" else 0


def log_of(path: str, config: Config) -> FlightLog:
    """Read the log of an analysis; of one that is large only the window, the time to learn from and the filter's reach.

    Raises
    ------
    LogError : it cannot be read.
    """
    from ..flightlog import read_log
    from ..flightlog.resampling import with_reach

    from_s, to_s, rate = config.window.from_s, config.window.to_s, config.conditioning.rate_hz
    if config.detect.train is not None and from_s is not None:
        from_s = min(from_s, config.detect.train[0])
    from_s, to_s = with_reach(rate if isinstance(rate, float) else None, from_s, to_s)
    return read_log(path, from_s=from_s, to_s=to_s, **source_of(config))


def source_of(config: Config) -> dict[str, Any]:
    """Return what the configuration says of how a file is read, for `bfi_cli.flightlog.read_log`."""
    return {name: attrgetter(str(OPTIONS[name].key))(config) for name in CHANNELS}


def inputs_of(config: Config, *paths: str | None, dictionary: Dictionary | None = None) -> tuple[str, ...]:
    """Return the files that a command reads: `paths` and those that its configuration and dictionary name."""
    named = {*paths, config.path, config.start_time.samples, config.start_time.calibration}
    named.add(config.diagnose.calibration)
    if dictionary is not None:
        named |= {dictionary.path, *(atom.file for atom in dictionary.atoms)}
    return tuple(path for path in named if path)


def with_findings(flight: FlightLog, config: Config) -> tuple[FlightLog, tuple[Implausible, ...]]:
    """Return a log with what its channels contradict each other in, and with --fix-units without what is certain."""
    from ..plausibility import implausible_channels, with_fixed_units

    findings = implausible_channels(flight)
    if config.fix_units:
        flight, findings = with_fixed_units(flight, findings)
    for one in findings:
        note(f"{one.advice}: {one.text}" if not one.fixed else f"--fix-units: {one.text}")
    return flight, findings


@contextmanager
def saying_first(findings: Sequence[Implausible]) -> Iterator[None]:
    """Let a log that cannot be analysed be refused with what its channels contradict each other in."""
    try:
        yield
    except LogError as error:
        from ..plausibility import in_words

        if not (said := in_words(findings)):
            raise
        raise LogError(f"{error}; first {said}") from error


def doubts(flight: FlightLog, names: Sequence[str], findings: Sequence[Implausible] = ()) -> tuple[Note, ...]:
    """Return questions about channels whose values cannot be, or whose unit nobody has stated; tell the terminal.

    Parameters
    ----------
    findings : what other channels show already, which is not asked.
    """
    from ..flightlog.plausible import doubts_about

    known = {name for one in findings for name in one.channels}
    questions = doubts_about(flight, [name for name in names if name not in known])
    for one in questions:
        note(one.text)
    return questions
