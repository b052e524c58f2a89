"""`bfi simulate`: a flight log from an aircraft model."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ..errors import ConfigError
from ..library import SIMULATION, simulate
from .options import Command, pairs, with_options
from .output import stages, write_and_show

SIZES: Mapping[str, Any] = {"default": None, "multiple": True, "callback": pairs("tas=0.01", float)}
AMPLITUDE = """
    Largest deflection, rad; of jsbsim the part of the stick's travel.  [default: 0.035; of jsbsim 0.08]"""
THROTTLE = "Size of a throttle doublet that follows the manoeuvre, of f16 and jsbsim; 1 is the lever's travel."
WIND = "Steady wind in m/s to the north and east, of jsbsim.  [default: calm]"
ORDINARY = """
    What ordinarily happens at a second of the log, of SIZE, in SI or with its unit, of jsbsim; repeatable: flaps (part
    of their travel), altitude_held (by an autopilot for so long, s), on_ground (approach from this height, m, and
    landing), gusts (turbulence begins, m/s), wind (a front, m/s), wind_shear (by height, 1/s)."""

# At the end of a setting's name; its flag has none.
UNIT = re.compile(r"_(s|m|m_s|hz|sd)$")


def setting(name: str, words: str = "", **settings: Any) -> Callable[[Command], Command]:
    """Return the decorator that adds a setting of `library.SIMULATION` as an option, with its default there."""
    default = SIMULATION[name]  # type: ignore[literal-required]
    row: dict[str, Any] = {"default": default, "show_default": default not in (None, {}), "help": words, **settings}
    return click.option(f"--{UNIT.sub('', name)}", name, **row)


def _check(context: click.Context, options: dict[str, Any]) -> None:
    """Refuse options that cannot be, or that move nothing.

    Raises
    ------
    ConfigError : names the option and what to do.
    """
    from ..aircraft.simulate import THROTTLE_AFTER

    given = {name for name in options if context.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    manoeuvre, throttle = options["manoeuvre"], options["throttle"]
    start, step, end = options["start_s"], options["step_s"], options["duration_s"]
    still = manoeuvre in ("none", "tour")
    if still and "amplitude" in given:
        raise ConfigError(f"--amplitude: moves nothing with --manoeuvre {manoeuvre}; leave one of the two out")
    for name in ("start", "step"):
        if still and not throttle and f"{name}_s" in given:
            what = f"times a manoeuvre or a throttle doublet, and --manoeuvre {manoeuvre} has none"
            raise ConfigError(f"--{name}: {what}; leave it out, or give --throttle")
    if options["amplitude"] == 0.0 and not throttle:
        raise ConfigError("--amplitude: moves nothing, got 0; give another size, or --manoeuvre none")
    if start < 0.0:
        raise ConfigError(f"--start: must be 0 or more, got {start:g} s; give when the manoeuvre begins in the log")
    if not still and 0.0 < end <= start < math.inf:
        what = f"the manoeuvre begins at {start:g} s, and the log ends at {end:g} s"
        raise ConfigError(f"--start: {what}; give an earlier --start or a longer --duration")
    begins = start + THROTTLE_AFTER * step
    if throttle and 0.0 < end <= begins < math.inf:
        what = (
            f"its doublet begins at {begins:g} s, {THROTTLE_AFTER:g} steps after --start, and the log ends at {end:g} s"
        )
        raise ConfigError(f"--throttle: {what}; give a longer --duration or a shorter --step")


@click.command("simulate")
@click.argument("name", metavar="[MODEL]", required=False)
@click.option("--model", "model_file", metavar="FILE", help="Linear model of a YAML file, in place of MODEL.")
@with_options("out_file", "force")
@setting("manoeuvre", "3211, 3211-pairs, doublet, multisine, none; of jsbsim also tour.")
@setting("amplitude", AMPLITUDE, metavar="SIZE", type=float)
@setting("start_s", "When the manoeuvre starts.", metavar="S")
@setting("step_s", "The manoeuvre's unit step.", metavar="S")
@setting("throttle", THROTTLE, metavar="PART")
@setting("tas_m_s", "True airspeed at the start, of f16 and jsbsim.", metavar="M/S", type=float)
@setting("altitude_m", "Altitude at the start, of f16 and jsbsim.", metavar="M", type=float)
@setting("wind_m_s", WIND, metavar="NORTH EAST", nargs=2, type=float, show_default=False)
@setting("duration_s", "Length of the log.", metavar="S")
@setting("rate_hz", "Samples per second.", metavar="HZ")
@setting("noise_sd", "White noise of an output; repeatable.", metavar="NAME=SD", **SIZES)
@setting("quantum", "Step of an output; repeatable.", metavar="NAME=STEP", **SIZES)
@setting("turbulence_m_s", "Dryden gusts, in m/s.", metavar="SIGMA")
@click.option("--ordinary", "causes", metavar="CAUSE@S[:SIZE]", multiple=True, help=ORDINARY)
@setting("discretisation", type=click.Choice(["zoh", "bilinear", "euler"]))
@setting("seed", "Random seed of noise and turbulence.", type=click.IntRange(min=0))
@with_options("progress", "as_json")
@click.pass_context
def command(
    context: click.Context, /, name: str | None, model_file: str | None, causes: tuple[str, ...], **options: Any
) -> None:
    """Write a flight log of MODEL in straight flight with a manoeuvre of its elevators.

    MODEL is citation, citation-short-period, b747 (Boeing 747-100/200: four elevators, stabiliser, four engines),
    b747-mf2d (Boeing 747 in cruise, with two sensors: configs/mf2d_dictionary.yaml has steps for them), f16 (nonlinear,
    six degrees of freedom, without turbulence), or jsbsim:NAME, an aircraft of JSBSim (jsbsim:c172p, jsbsim:737;
    pip install 'bfi-cli[jsbsim]') whose pilot keeps the wings level, or flies climbs, descents and turns
    (--manoeuvre tour). --model takes any linear one, such as configs/citation_model.yaml.
    Noise and steps are in the output's unit, m/s or rad: --noise tas=0.01 --quantum tas=0.03.
    """
    from ..faults.ordinary import parse_occurrence
    from ..files import check_files
    from ..jsbsim.ordinary import SIMULATED

    _check(context, options)
    ordinary = [parse_occurrence(text, where="--ordinary", makings=SIMULATED) for text in causes]
    for made in ordinary:
        if not 0.0 <= made.at_s < options["duration_s"]:
            what = f"'{made.cause}' at {made.at_s:g} s, and the log ends at {options['duration_s']:g} s"
            raise ConfigError(f"--ordinary: {what}; give a time in it, or a longer --duration")
    check_files([options["out_file"]], inputs=() if model_file is None else (model_file,), force=options["force"])
    model = name if model_file is None else Path(model_file)
    if model is None or (name and model_file):
        from ..aircraft import MODELS, PREFIX

        given = "no model given" if name is None else f"one model is flown, got '{name}' and --model {model_file}"
        raise ConfigError(f"bfi simulate: {given}; give one of {', '.join(MODELS)}, {PREFIX}NAME, or --model FILE")
    settings: dict[str, Any] = {key: value for key, value in options.items() if key in SIMULATION}
    with stages(wanted=options["progress"]) as progress:
        log = simulate(model, **{**settings, "ordinary": ordinary, "progress": progress})
    write_and_show(log, options, kind="simulate", seed=options["seed"])
