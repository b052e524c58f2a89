"""The provenance of a document: program, inputs, libraries, command line and date."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version

from . import __version__


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Program, inputs, libraries, command line and date behind the numbers of a document."""

    version: str
    log_sha256: str
    config_sha256: str | None
    dictionary_sha256: str | None
    seed: int
    numpy: str
    scipy: str
    command: str
    date: str


def provenance(
    *,
    log_sha256: str,
    config_sha256: str | None = None,
    dictionary_sha256: str | None = None,
    seed: int = 0,
) -> Provenance:
    """Return the record of program, inputs, libraries, command line and date (UTC) of a result.

    Parameters
    ----------
    log_sha256 : digest of the log, "" for one made in memory.
    config_sha256, dictionary_sha256 : None where the command was given none.
    seed : of the random steps.
    """
    return Provenance(
        version=__version__,
        log_sha256=log_sha256,
        config_sha256=config_sha256,
        dictionary_sha256=dictionary_sha256,
        seed=seed,
        numpy=version("numpy"),
        scipy=version("scipy"),
        command=shlex.join(["bfi", *sys.argv[1:]]),
        date=datetime.now(UTC).isoformat(timespec="seconds"),
    )
