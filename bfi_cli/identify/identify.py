"""Identification from end to end: prepare the window, run the method, assemble the result."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from operator import attrgetter

from threadpoolctl import threadpool_limits

from ..config import Config
from ..dictionary import Dictionary
from ..errors import ConfigError, LogError
from ..flightlog import FlightLog
from ..kernels.progress import Progress, unseen
from ..preprocessing.window import prepare_window, regression_of
from .assemble import assemble_result
from .magnitudes import MethodResult
from .methods import METHODS
from .result import IdentifyResult

__all__ = ["identify_faults"]


def identify_faults(
    log: FlightLog, dictionary: Dictionary, config: Config, progress: Progress = unseen
) -> IdentifyResult:
    """Identify the faults of a dictionary in a log, on one BLAS thread: more are slower here and change the bits.

    Parameters
    ----------
    log : in SI units, see `bfi_cli.flightlog.read_log`.
    dictionary : see `bfi_cli.dictionary.load_dictionary`.
    config : see `bfi_cli.config.Config`; its `method` is one of `bfi_cli.identify.methods.METHODS`.
    progress : told the name of every stage and how far it is.

    Raises
    ------
    LogError, ExcitationError : the log cannot be used, or the method lacks a channel or a model.
    DictionaryError : no entry of the dictionary can be seen in the window.
    ConfigError : the method does not do what is asked.
    """
    method = METHODS[config.method]
    module, _, function = method.function.partition(":")
    with threadpool_limits(1):
        window = prepare_window(log, dictionary, config, partial(progress, "the window and the dictionary"))
        if len(config.outputs) > 1 and not method.several_outputs:
            raise ConfigError(
                f"--method {config.method}: works on one output, got {len(config.outputs)}; give one --output, or "
                "--method ml"
            )
        for key in method.needs:
            if attrgetter(key)(config) is None:
                section, _, name = key.partition(".")
                raise LogError(
                    f"{log.path}: method {config.method} needs a {name}, which no log holds; give --{name} NAME, or "
                    f"{section}: {{{name}: NAME}} in the configuration"
                )
        regression = regression_of(window, config, partial(progress, "the record factorised"))
        identify = getattr(import_module(f".{module}", __package__), function)
        found: MethodResult = identify(window, regression, config, progress)
        return assemble_result(window, config, found)
