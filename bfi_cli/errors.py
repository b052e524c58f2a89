"""Errors by who must mend them; every message is one line `where: what is wrong, got value; what to do`."""

from __future__ import annotations

LONGEST_DETAIL = 120  # letters of another library's message: a line of a terminal


class BfiError(Exception):
    """Base of all errors a user can mend; `exit_code` is what the command returns."""

    exit_code = 2


class ConfigError(BfiError):
    """The configuration or the command line asks for something that does not exist or cannot be."""


class DictionaryError(BfiError):
    """The fault dictionary, or a fault specification, cannot be used."""


class LogError(BfiError):
    """The flight log cannot be used: missing channel, not uniform, NaN, too short."""

    exit_code = 3


class ExcitationError(LogError):
    """The log has no excitation at all, so the dynamics cannot be told from a fault."""


class SweepError(BfiError):
    """A Monte Carlo sweep cannot be run or continued."""


def reason_of(error: Exception) -> str:
    """Return why a file cannot be read or written, as part of one line: what the operating system says, else Python."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def first_line(error: Exception) -> str:
    """Return the first line of another library's message, shortened, as part of one line."""
    lines = str(error).strip().splitlines()
    return " ".join((lines[0] if lines else type(error).__name__).split())[:LONGEST_DETAIL]
