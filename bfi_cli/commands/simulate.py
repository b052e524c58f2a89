"""`bfi simulate`: a flight log from an aircraft model."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ..errors import ConfigError
from .options import pairs, with_options
from .output import write_and_show
from .progress import stages

SIZES = pairs("tas=0.01", float)
AMPLITUDE = """
    Largest deflection, rad; of jsbsim the part of the stick's travel.  [default: 0.035; of jsbsim 0.08]"""
THROTTLE = "Size of a throttle doublet that follows the manoeuvre, of f16 and jsbsim; 1 is the lever's travel."
WIND = "Steady wind in m/s to the north and east, of jsbsim.  [default: calm]"

ORDINARY = """
    What ordinarily happens at a second of the log, of SIZE, in SI or with its unit, of jsbsim; repeatable: flaps (part
    of their travel), altitude_held (by an autopilot for so long, s), on_ground (approach from this height, m, and
    landing), gusts (turbulence begins, m/s), wind (a front, m/s), wind_shear (by height, 1/s)."""


def _check(context: click.Context, options: dict[str, Any]) -> None:
    """Refuse options that cannot be, or that move nothing.

    Raises
    ------
    ConfigError : names the option and what to do.
    """
    from ..aircraft.simulate import THROTTLE_AFTER

    given = {name for name in options if context.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    manoeuvre, throttle = options["manoeuvre"], options["throttle"]
    start, step, end = options["start"], options["step"], options["duration"]
    still = manoeuvre in ("none", "tour")
    if still and "amplitude" in given:
        raise ConfigError(f"--amplitude: moves nothing with --manoeuvre {manoeuvre}; leave one of the two out")
    for name in ("start", "step"):
        if still and not throttle and name in given:
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
@click.option(
    "--manoeuvre",
    default="3211",
    show_default=True,
    help="3211, 3211-pairs, doublet, multisine, none; of jsbsim also tour.",
)
@click.option("--amplitude", metavar="SIZE", type=float, help=AMPLITUDE)
@click.option("--start", metavar="S", type=float, default=0.2, show_default=True, help="When the manoeuvre starts.")
@click.option("--step", metavar="S", type=float, default=1.0, show_default=True, help="The manoeuvre's unit step.")
@click.option("--throttle", metavar="PART", type=float, default=0.0, show_default=True, help=THROTTLE)
@click.option("--tas", metavar="M/S", type=float, help="True airspeed at the start, of f16 and jsbsim.")
@click.option("--altitude", metavar="M", type=float, help="Altitude at the start, of f16 and jsbsim.")
@click.option("--wind", metavar="NORTH EAST", nargs=2, type=float, default=(0.0, 0.0), help=WIND)
@click.option("--duration", metavar="S", type=float, default=31.72, show_default=True, help="Length of the log.")
@click.option("--rate", metavar="HZ", type=float, default=100.0, show_default=True, help="Samples per second.")
@click.option("--noise", metavar="NAME=SD", multiple=True, callback=SIZES, help="White noise of an output; repeatable.")
@click.option("--quantum", metavar="NAME=STEP", multiple=True, callback=SIZES, help="Step of an output; repeatable.")
@click.option("--turbulence", metavar="SIGMA", type=float, default=0.0, show_default=True, help="Dryden gusts, in m/s.")
@click.option("--ordinary", "causes", metavar="CAUSE@S[:SIZE]", multiple=True, help=ORDINARY)
@click.option("--discretisation", type=click.Choice(["zoh", "bilinear", "euler"]), default="zoh", show_default=True)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Random seed of noise and turbulence."
)
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
    from ..library import simulate

    _check(context, options)
    ordinary = [parse_occurrence(text, where="--ordinary", makings=SIMULATED) for text in causes]
    for made in ordinary:
        if not 0.0 <= made.at_s < options["duration"]:
            what = f"'{made.cause}' at {made.at_s:g} s, and the log ends at {options['duration']:g} s"
            raise ConfigError(f"--ordinary: {what}; give a time in it, or a longer --duration")
    check_files([options["out_file"]], inputs=() if model_file is None else (model_file,), force=options["force"])
    model = name if model_file is None else Path(model_file)
    if model is None or (name and model_file):
        from ..aircraft import MODELS, PREFIX

        given = "no model given" if name is None else f"one model is flown, got '{name}' and --model {model_file}"
        raise ConfigError(f"bfi simulate: {given}; give one of {', '.join(MODELS)}, {PREFIX}NAME, or --model FILE")
    with stages(wanted=options["progress"]) as progress:
        log = simulate(
            model,
            manoeuvre=options["manoeuvre"],
            amplitude=options["amplitude"],
            start_s=options["start"],
            step_s=options["step"],
            throttle=options["throttle"],
            tas_m_s=options["tas"],
            altitude_m=options["altitude"],
            wind_m_s=options["wind"],
            duration_s=options["duration"],
            rate_hz=options["rate"],
            noise_sd=options["noise"],
            quantum=options["quantum"],
            turbulence_m_s=options["turbulence"],
            discretisation=options["discretisation"],
            ordinary=ordinary,
            seed=options["seed"],
            progress=progress,
        )
    write_and_show(log, options, kind="simulate", seed=options["seed"])
