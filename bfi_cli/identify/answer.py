"""Identification from end to end: take in, estimate by one of the two methods, lay out the result."""

from __future__ import annotations

from functools import partial

from threadpoolctl import threadpool_limits

from ..config import Config
from ..dictionary import Dictionary
from ..flightlog import FlightLog
from ..kernels.progress import Progress, unseen
from ..result import IdentifyResult
from ..study import study_of, take_in
from .layout import laid_out
from .likelihood import by_likelihood
from .published import by_published

__all__ = ["identify_faults"]


def identify_faults(
    log: FlightLog, dictionary: Dictionary, config: Config, progress: Progress = unseen
) -> IdentifyResult:
    """Identify the faults of a dictionary in a log, on one BLAS thread: more are slower here and change the bits.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`.
    progress : told the name of every stage and how far it is.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used.
    DictionaryError : no entry of the dictionary can be seen in the window.
    ConfigError : the method does not do what is asked.
    """
    with threadpool_limits(1):
        intake = take_in(log, dictionary, config, partial(progress, "the window and the dictionary"))
        factorising = partial(progress, "the record factorised")
        study = study_of(intake.log.path, intake.conditioned, intake.live, config, report=factorising)
        if config.method == "risro":
            found = by_published(study, config, partial(progress, "every order"))
        else:
            found = by_likelihood(intake, study, config, progress)
        return laid_out(intake, study, config, found)
