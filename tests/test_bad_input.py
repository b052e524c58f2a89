"""What a user can get wrong: the exit code of the contract, one line that says where, what and what to do, no files."""

from __future__ import annotations

import json
import os
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from made_logs import write_hdf5
from noted import texts
from odd_logs import ODD
from scipy.io import savemat

from bfi_cli.aircraft import MODELS, manoeuvre, simulate, time_axis
from bfi_cli.flightlog import write_log

T = time_axis(duration_s=60.0, rate_hz=10.0)
FLIGHT = simulate(
    MODELS["citation"],
    manoeuvre("multisine", T, step_s=1.0),
    rng=np.random.default_rng(0),
    rate_hz=10.0,
    noise_sd={"tas": 0.01},
)
TAS = FLIGHT.channel("tas").values
ELEVATOR = FLIGHT.channel("elevator").values
FAULTS = "atoms:\n  - {shape: bias, onset_s: 0.5}\n  - {shape: bias, onset_s: 20}\n  - {shape: drift, onset_s: 30}\n"

# where: what; what to do. A "must" says both.
LINE = re.compile(r"\S.*: (?:.*[^;]; [^;].*|.*\bmust .+, got .+)\n")
NOT_OURS = re.compile(r"\b(?:invalid|please|traceback|usage|error)\b", re.IGNORECASE)


def csv(time_s: np.ndarray = T, elevator: np.ndarray = ELEVATOR, tas: np.ndarray = TAS) -> str:
    rows = zip(time_s.tolist(), elevator.tolist(), tas.tolist(), strict=True)
    return "time [s],elevator [rad],tas [m/s]\n" + "".join(f"{t!r},{u!r},{y!r}\n" for t, u, y in rows)


def altered(values: np.ndarray, at: int, value: float) -> np.ndarray:
    return np.where(np.arange(values.size) == at, value, values)


def holed(values: np.ndarray, at: int) -> np.ndarray:
    """Return values without those of 0.9 s from a sample on, more than what is interpolated."""
    k = np.arange(values.size)
    return np.where((k >= at) & (k < at + 9), np.nan, values)


LOGS: dict[str, tuple[str, str]] = {
    "empty.csv": ("", "empty.csv: the file is empty; copy"),
    "comments.csv": ("# a\n# b\n", "comments.csv: no header line"),
    "header.csv": ("time,elevator,tas\n", "header.csv: 0 samples below the header"),
    "one_sample.csv": ("time,elevator,tas\n0,0,90\n", "one_sample.csv: 1 samples below the header"),
    "no_header.csv": ("0,0,90\n1,0,90\n2,0,90\n", "no_header.csv: no header, line 1 holds numbers"),
    "text.csv": (
        "time,elevator,tas\n0,0,90\n1,0,fast\n",
        "'tas' holds text in 1 of 2 cells, the first 'fast' in line 3,",
    ),
    "ragged.csv": ("time,elevator,tas\n0,0,90\n1,0\n", "ragged.csv: line 3 has 2 values"),
    "no_time.csv": ("elevator,tas\n0,90\n1,91\n", "no_time.csv: no time"),
    "prose.csv": ("flight of the day\nit rained\n", "prose.csv: 1 samples below the header"),
    "unit.csv": (
        "time,elevator,tas [furlong]\n0,0,1\n1,0,1\n",
        "unit.csv: 'tas' is in 'furlong', an unknown unit, and is left out; the log has: elevator; state",
    ),
    "no_input.csv": (
        csv().replace("elevator", "spoiler"),
        "no channel 'elevator'; the log has: spoiler, tas; map one with",
    ),
    "no_output.csv": (csv().replace("tas", "ias_x"), "no channel 'tas'; the log has: elevator, ias_x; map one with"),
    "nan.csv": (csv(tas=holed(TAS, 7)), "'tas' is not a number at sample 7 (0.7 s), 9 of 600 samples in all"),
    "nan_input.csv": (csv(elevator=holed(ELEVATOR, 9)), "'elevator' is not a number at sample 9 (0.9 s)"),
    "infinite.csv": (csv(tas=altered(TAS, 7, np.inf)), "'tas' is not a number at sample 7"),
    "huge.csv": (csv(tas=altered(TAS, 7, -1e300)), "'tas' is no measurement at sample 7 (0.7 s), got -1e+300 m/s"),
    "all_huge.csv": (csv(tas=1e305 * TAS), "'tas' is no measurement at sample 0 (0 s)"),
    "tiny.csv": (csv(tas=1e-300 * (TAS - 90.0)), "output 'tas' does not change"),
    "uneven.csv": (
        csv(time_s=T + 0.34 * (T >= 30.0)),
        "time step is not uniform: 0.44 s at sample 300, 0.1 s elsewhere",
    ),
    "back.csv": (
        csv(time_s=np.where(np.arange(T.size) % 9 == 5, 0.3, T)),
        "'time' does not increase at sample 5 (0.3 s",
    ),
    "time_nan.csv": (csv(time_s=np.where(np.arange(T.size) % 9 == 5, np.nan, T)), "'time' is not a number at sample 5"),
    "held.csv": (
        csv(tas=TAS[10 * (np.arange(T.size) // 10)]),
        "'tas' repeats its value 90 % of the time (held samples",
    ),
    "still_input.csv": (
        csv(elevator=np.full(T.size, 0.01)),
        "'elevator' does not move (range 0 rad); without excitation",
    ),
    "still_output.csv": (
        csv(tas=np.full(T.size, 99.0)),
        "output 'tas' does not change (stays at 99 m/s); choose another",
    ),
    "short.csv": (csv(T[:12], ELEVATOR[:12], TAS[:12]), "of the window; "),
    "pdf.csv": ("%PDF-1.4 \0\1\2", "neither HDF5, MATLAB v5 or v7.3, nor text; convert it"),
    "spreadsheet.csv": ("PK\3\4 and so on", "a zip archive or spreadsheet cannot be read; convert it"),
    "truncated.h5": ("(written by the fixture)", "damaged or truncated HDF5 file"),
    "no_signals.h5": ("(written by the fixture)", "no_signals.h5: "),
    "absent.csv": ("(not written)", "absent.csv: no such file; give the path of a log"),
    "folder": ("(a folder)", "folder: is a directory without files of ulog2csv (LOG_TOPIC_0.csv); give a log"),
}

PROVENANCE = {
    **dict.fromkeys(("version", "numpy", "scipy", "command", "date", "log_sha256"), ""),
    "seed": 0,
    "config_sha256": None,
    "dictionary_sha256": None,
}
OUTSIDE = "lies outside the dictionary's folder; move it there or give --allow-outside"
LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 30)
)

CONFIGS = {
    "outputz: [tas]": "c.yaml: outputz: unknown key; did you mean 'outputs'?",
    "model: {ordr: 4}": "c.yaml: model.ordr: unknown key; did you mean 'order'?",
    "seed: abc": "c.yaml: seed: must be a whole number, got 'abc'",
    "seed: -1": "c.yaml: seed: must be greater than or equal to 0, got -1",
    "strict: no": "c.yaml: strict: must be true or false, got 'no'",
    "strict: yes": "c.yaml: strict: must be true or false, got 'yes'",
    "inputs: elevator": "c.yaml: inputs: must be a list, got 'elevator'",
    "outputs: []": "c.yaml: outputs: must not be empty, got []",
    "outputs: [elevator]": "c.yaml: 'elevator' is both an input and an output; keep one",
    "outputs: [tas, tas]": "c.yaml: outputs: a value stands twice",
    "method: rizro": "c.yaml: method: not one of the choices, got 'rizro'; did you mean 'risro'?",
    "model: {order: 2.5}": "c.yaml: model.order: must be a whole number, got 2.5",
    "model: 4": "c.yaml: model: must be a mapping of key: value, got 4",
    "window: {from_s: 12:30:00}": "c.yaml: window.from_s: must be a number, got '12:30:00'",
    "window: {from_s: 5, to_s: 5}": "c.yaml: window: to_s must be after from_s (5 s), got 5 s",
    "conditioning: {rate_hz: .nan}": "c.yaml: conditioning.rate_hz: must be a finite number, got nan",
    "units: {tas: furlong}": "unknown unit 'furlong'; give an SI unit",
    "units: {tas: deg}": "'tas' is in m/s, got a unit of rad",
    "dictionary: {atoms: []}": "no faults; add atoms or grids",
    "- a": "c.yaml: must be a mapping of key: value, got ['a']",
    "seed: 1\nseed: 2": "key 'seed' stands twice; keep one",
    "a: [": "c.yaml: line 2, column 1: expected the node content, but found '<stream end>'; mend",
    "a: !!python/object:os.system x": "unknown tag",
    LAUGHS: "c.yaml: line 5, column 45: aliases expand to more than 100000 values; write them out",
    "a: &a [1, *a]": "c.yaml: line 1, column 11: alias 'a' stands in its own value; write it out",
    "model: &m {order: 4}\nselection: {<<: *m}": "c.yaml: selection.order: unknown key; known: criterion, evidence, ",
    f"seed: {'9' * 10_000}": "c.yaml: line 1, column 7: a whole number of 10000 digits; give one of at most 50",
    f"method: {'x' * 100_000}": f"c.yaml: method: not one of the choices, got '{'x' * 47}...{'x' * 48}'; known: ml, ",
    f"{'x' * 1000}: 1": f"c.yaml: {'x' * 19}…{'x' * 20}: unknown key; known: inputs, ",
    f"*{'x' * 100_000}": "xxxxxxxx…xxxxxx",
    "[" * 600: "c.yaml: nested too deeply; flatten the document",
    f"# {'x' * 4_000_000}": "c.yaml: larger than 4 MB, the most that is read; shorten it",
    "[seed, strict]: 1": "c.yaml: line 1, column 1: a key must be a plain word; mend the YAML",
    '"\\UFFFFFFFF": 1': "c.yaml: an escape that stands for no character; mend the YAML",
    f"seed: {'[' * 90}{']' * 90}": "c.yaml: seed: must be a whole number, got [[[[...]]]]",
    "".join(f"k{i}: 1\n" for i in range(3000)): " | and 2995 more; mend these first",
    "start_time: {shapes: [samples], samples: ../x.csv}": "c.yaml: start_time.samples: '../x.csv' lies outside the "
    "configuration's folder; move it there or give --allow-outside",
    "dictionary: {atoms: [{shape: samples, file: ../x.csv}]}": f"dictionary.atoms[0].file: '../x.csv' {OUTSIDE}",
}

DICTIONARIES = {
    "": "d.yaml: must be a mapping of key: value, got null",
    "atoms: []": "d.yaml: no faults; add atoms or grids",
    "atom: []": "d.yaml: atom: unknown key; did you mean 'atoms'?",
    "atoms:\n- {shape: bias, onset: 3}": "d.yaml: atoms[0].onset: unknown key; did you mean 'onset_s'?",
    "atoms:\n- {shape: bais, onset_s: 3}": "d.yaml: atoms[0].shape: unknown shape, got 'bais'; did you mean 'bias'?",
    "atoms:\n- {shape: sine, onset_s: 3}": "d.yaml: atoms[0].frequency_hz: missing; add it",
    "atoms:\n- {shape: sine, frequency_hz: 0}": "d.yaml: atoms[0].frequency_hz: must be greater than 0, got 0",
    "atoms:\n- {shape: bias, onset_s: no}": "d.yaml: atoms[0].onset_s: must be a number, got 'no'",
    "atoms:\n- {shape: bias, onset_s: 3, offset_s: 2}": "d.yaml: atoms[0]: offset_s must be after onset_s",
    "atoms:\n- {shape: pitot_blocked}": "d.yaml: atoms[0].shape: no log tells the signal of a trapped line, which "
    "keeps no trace of the pressure outside, got 'pitot_blocked'; use bfi diagnose, which",
    "atoms:\n- {shape: pitot_icing, time_constant_s: 3}": "d.yaml: atoms[0].time_constant_s: ",
    "atoms:\n- {shape: pitot_leak, onset_s: 3}": "d.yaml: atoms[0].time_constant_s: missing; add it",
    "atoms:\n- {shape: pitot_leak, time_constant_s: 3, magnitude: 2}": "d.yaml: atoms[0].magnitude: this fault is w",
    "atoms:\n- {shape: pitot_water, frequency_hz: 0.0}": "d.yaml: atoms[0].frequency_hz: must be greater than 0, got 0",
    "atoms:\n- {shape: pitot_icing, onset_s: 3}": "no live atom: fault 'pitot_icing_tas_3': p_static needs one of "
    "p_static, altitude; the log has: elevator, tas; map one with --channel altitude=NAME",
    "atoms:\n- {shape: samples, file: none.csv}": "d.yaml: atoms[0].file: no such file, got 'none.csv'; give a CSV",
    **{
        f"atoms: [{{shape: samples, file: {file}}}]": f"d.yaml: atoms[0].file: '{file}' {OUTSIDE}\n"
        for file in ("../x.csv", "/etc/passwd", "folder/../../x.csv", "link.csv")
    },
    'atoms: [{shape: samples, file: "a\\0b"}]': r"d.yaml: atoms[0].file: no such file, got 'a\x00b'; give a CSV file",
    **{
        f"atoms: [{{shape: samples, file: {file}.csv}}]": f"{file}.csv: {problem}"
        for file, problem in {
            "falls": "times do not increase from line to line; sort the samples by time",
            "text": "line 2: not two finite numbers; each line is time in s, value",
            "infinite_value": "line 2: not two finite numbers; each line is time in s, value",
            "large": "cannot read the samples, larger than 20 MB; give a CSV file of time, value",
        }.items()
    },
    "grids:\n- {shape: bias, onset_s: {start: 5, stop: 2, step: 1}}": "stop must not be before start (5), got 2",
    "grids:\n- {shape: bias, onset_s: {start: 0, stop: 9, step: 1e-9}}": "more than 10000 values; give a larger step",
    "atoms:\n- {shape: bias, onset_s: 300}": "no live atom: 'bias_tas_300' starts at 300 s, after the window ends",
    "atoms:\n- {shape: bias, onset_s: -9, offset_s: -5}": "'bias_tas_-9' ends at -5 s, before the window starts (0 s)",
    "atoms:\n- {shape: bias, onset_s: 0}": "no live atom: 'bias_tas_0' does not change in the window",
    "atoms:\n- {shape: bias, channel: aoa, onset_s: 5}": "'bias_aoa_5' acts on 'aoa', which is no output (tas)",
}

OPTIONS = {
    "--output aoa": (3, "no channel 'aoa'; the log has: elevator, tas; map one with --channel aoa=NAME"),
    "--input rudder": (3, "no channel 'rudder'; the log has: elevator, tas; map one with --channel rudder=NAME"),
    "--output elevator": (2, "'elevator' is both an input and an output; keep one"),
    "--output tas --output tas": (2, "--output: a value stands twice, got ['tas', 'tas']; keep one"),
    "--method risro --output tas --output elevator --input spoiler": (3, "no channel 'spoiler'"),
    "--order 1000": (3, "samples of the window; give --order "),
    "--order 0": (2, "--order: must be greater than or equal to 1, got 0"),
    "--order 2.5": (2, "--order: must be a whole number, got 2.5"),
    "--order banana": (2, "--order: not a number or one of the choices, got 'banana'; known: auto"),
    "--order": (2, "--order: no value; write --order VALUE"),
    "--strict=yes": (2, "--strict: takes no value; write --strict"),
    "--from 1000": (3, "no samples between 1000 s and inf s, the log runs from 0 s to 59.9 s; change --from/--to"),
    "--from 20 --to 5": (2, "--from/--to: to_s must be after from_s (20 s), got 5 s"),
    "--from abc": (2, "--from: not a number, got 'abc'; give one like 12.5"),
    "--from nan": (2, "--from: must be a finite number, got nan"),
    "--from 19.5 --to 20.5": (3, "order 2 needs more than the 10 samples of the window; "),
    "--rate 100": (3, "recorded at 10 Hz, it cannot be resampled to 100 Hz; give --rate 10 or less"),
    "--rate 1e-9": (3, "give a higher --rate or a longer window"),
    "--rate -1": (2, "--rate: must be greater than 0, got -1"),
    "--rate banana": (2, "--rate: not a number or one of the choices, got 'banana'; known: none, auto"),
    "--rate inf": (2, "--rate: must be a finite number, got inf"),
    "--method dmae": (3, "good.csv: method dmae needs a model, which no log holds; give --model NAME, or dmae: {model"),
    "--method dmae --model citation": (3, "good.csv: method dmae needs aoa, pitch, pitch_rate of the model 'citation'"),
    "--method dmae --model citatoin": (2, "dmae.model: no linear model, got 'citatoin'; did you mean 'citation'?"),
    "--sparsity exp_l0": (2, "--sparsity: not one of the choices, got 'exp_l0'; did you mean 'exp-l0'?"),
    "--method rizro": (2, "--method: not one of the choices, got 'rizro'; did you mean 'risro'?"),
    "--fail-on faul": (2, "--fail-on: not one of the choices, got 'faul'; did you mean 'fault'?"),
    "--seed x": (2, "--seed: not a whole number, got 'x'; give one like 4"),
    "--seed -1": (2, "--seed: must be greater than or equal to 0, got -1"),
    "--unit tas=furlong": (2, "--unit tas=furlong: unknown unit 'furlong'; give an SI unit"),
    "--unit tas=knotz": (2, "--unit tas=knotz: unknown unit 'knotz'; did you mean 'knot'?"),
    "--unit tas=deg": (2, "--unit tas=deg: 'tas' is in m/s, got a unit of rad; give one like m/s"),
    "--unit flap=deg": (3, "--unit flap=deg: no channel 'flap'; the log has: elevator, tas, time"),
    "--unit tas": (2, "--unit: expected NAME=UNIT, got 'tas'; write --unit tas=kt"),
    "--channel tas": (2, "--channel: expected STD=NAME, got 'tas'; write --channel tas=my_airspeed"),
    "--channel tas=TAS": (3, "--channel tas=TAS: no channel 'TAS'; did you mean 'tas'?"),
    "--channel tas=tsa": (3, "--channel tas=tsa: no channel 'tsa'; did you mean 'tas'?"),
    "--channel tas=a --channel tas=b": (2, "--channel: 'tas' is given twice, as 'a' and 'b'; keep one"),
    "--group one": (3, "good.csv: no group 'one', a log of this kind has none; leave out --group"),
    "--metod ml": (2, "bfi identify: unknown option '--metod'; did you mean '--method'?"),
    "--xyzzy": (2, "bfi identify: unknown option '--xyzzy'; see bfi identify --help"),
    "-x": (2, "bfi identify: unknown option '-x'; see bfi identify --help"),
    "second.csv": (
        2,
        "bfi identify: one LOG is analysed at a time, got 2; add --together where the others are healthy flights",
    ),
    "-c absent.yaml": (2, "absent.yaml: cannot be read, no such file or directory; check the path"),
    "-c folder": (2, "folder: cannot be read, is a directory; check the path"),
    "-c binary.yaml": (2, "binary.yaml: byte 0 is not UTF-8 text; save the file as UTF-8"),
    "-d absent.yaml": (2, "absent.yaml: cannot be read, no such file or directory; check the path"),
    "-d folder": (2, "folder: cannot be read, is a directory; check the path"),
    "-d good.csv": (2, "good.csv: must be a mapping of key: value, got 'time [s],elevator [rad],tas [m/s]"),
    "--out in_the_way": (2, "in_the_way: cannot be written, not a directory; give another --out"),
    "--out in_the_way/deeper": (2, "in_the_way/deeper: cannot be written, not a directory; give another --out"),
}

MODEL = "{name: m, airspeed_m_s: 50, states: [tas], inputs: [elevator], A: [[%s]], B: [[1]]}"
MODEL_FILES = {
    "{name: m, airspeed_m_s: 50}": "c.yaml: states: missing; add it | inputs: missing; add it | A: missing",
    MODEL % "-1, 0": "c.yaml: A: the names ask for 1 rows of 1, got 1 of 2; write one list per row",
    MODEL.replace("elevator", "tas") % "-1": "c.yaml: inputs: 'tas' is an output too; rename one",
    MODEL.replace("elevator", "lever") % "-1": "c.yaml: units: 'lever' is no standard channel; add its unit",
    MODEL % "50": "m: A: unstable, its outputs are no numbers from 14.",
    MODEL % "200": "m: A: unstable, its outputs are no numbers from 3.",
}
# Every command on logs of one, two and three samples; two are a log for `info`, `convert` and `inject`.
SHORT = (
    "info {}",
    "identify {} -d good.yaml",
    "identify {}",
    "start-time {}",
    "detect {}",
    "diagnosability {} -d good.yaml",
    "dictionary good.yaml {}",
    "convert {} -o new.csv --rate 5",
    "info {} --from 0 --to 0.1",
)

COMMANDS = {
    "identify good.csv --output lift_speed": (
        3,
        "good.csv: 'lift_speed' is not recorded, and to derive it the log lacks ",
    ),
    "identify supersonic.csv --output p_total": (
        3,
        "supersonic.csv: 'cas' is 400 m/s at sample 30 (3 s), 0 to 340.3 m/s",
    ),
    "start-time negative.csv --output q_impact": (
        3,
        "negative.csv: 'p_static' is -1000 Pa at sample 30 (3 s), a static",
    ),
    "detect supersonic.csv --output q_impact": (
        3,
        "supersonic.csv: 'cas' is 400 m/s at sample 30 (3 s), 0 to 340.3 m/s",
    ),
    "inject supersonic.csv --fault pitot_blocked,onset_s=1 -o new.h5": (
        3,
        "fault 'pitot_blocked': 'cas' is 400 m/s at 3 s",
    ),
    "inject negative.csv --fault static_blocked,onset_s=1 -o new.h5": (
        3,
        "fault 'static_blocked': 'p_static' is -1000 Pa",
    ),
    "inject good.csv --fault pitot_icing,magnitude=0.01,onset_s=1 -o new.h5": (
        3,
        "fault 'pitot_icing': p_static needs one of p_static, altitude",
    ),
    "inject good.csv --fault pitot_icing,channel=tas -o new.h5": (2, "channel: not a key of this shape"),
    "inject good.csv --fault pitot_leak,onset_s=1 -o new.h5": (2, "time_constant_s: missing; a pitot_leak needs it"),
    "identfy good.csv": (2, "bfi: unknown command 'identfy'; did you mean 'identify'?"),
    "xyzzy": (2, "bfi: unknown command 'xyzzy'; known: info, plot, convert, "),
    "--versoin": (2, "bfi: unknown option '--versoin'; did you mean '--version'?"),
    "identify": (2, "bfi identify: LOG is missing; see bfi identify --help"),
    "identify good.csv --input rudder": (3, "good.csv: no channel 'rudder'"),
    "identify two.h5 --method risro-as-published --output tas --output aoa -d good.yaml": (
        2,
        "--method risro-as-published: works on one output",
    ),
    "identify two.h5 --group x -d good.yaml": (3, "two.h5: no group 'x'"),
    "dictionary": (2, "bfi dictionary: FILE is missing; see bfi dictionary --help"),
    "dictionary absent.yaml": (2, "absent.yaml: cannot be read, no such file or directory; check the path"),
    "dictionary good.yaml absent.csv": (3, "absent.csv: no such file; give the path of a log"),
    "dictionary good.yaml --input tas": (2, "bfi dictionary: --input is about a log; give one after the dictionary"),
    "dictionary good.yaml good.csv --duration 4": (2, "bfi dictionary: --duration is for an audit without a log; give"),
    "dictionary good.yaml --duration -4": (2, "--duration: must be more than 0 s, got -4; give the length of a window"),
    "dictionary good.yaml good.csv --rate banana": (2, "--rate: not a number or one of the choices, got 'banana'"),
    "info absent.csv": (3, "absent.csv: no such file; give the path of a log"),
    "info ''": (3, "'': no such file; give the path of a log"),
    "info good.csv --from 100": (3, "good.csv: no samples between 100 s"),
    "plot": (2, "bfi plot: LOG... is missing; see bfi plot --help"),
    "plot good.csv": (2, "bfi plot: --out is missing; give --out DIR, or --json for phases and windows alone"),
    "plot absent.csv --json": (3, "absent.csv: no such file; give the path of a log"),
    "plot good.csv absent.csv --json": (3, "absent.csv: no such file; give the path of a log"),
    "plot good.csv --out new --channel aoa": (3, "good.csv: no channel 'aoa'; the log has: elevator, tas; map one"),
    "plot good.csv --out new --channel lift_speed": (3, "good.csv: 'lift_speed' is not recorded, and to derive it"),
    "plot good.csv --json --channel aoa=vane": (3, "good.csv: --channel aoa=vane: no channel 'vane'"),
    "plot good.csv --json --channel tas=": (2, "--channel: expected NAME|STD=NAME, got 'tas='; write --channel tas="),
    "plot good.csv --json --channel =": (3, "good.csv: no channel '='; the log has: elevator, tas"),
    "plot good.csv --json --from 100": (3, "good.csv: no samples between 100 s"),
    "plot good.csv --json --from 20 --to 5": (
        2,
        "--from/--to: to_s must be after from_s (20 s), got 5 s; give a later",
    ),
    "plot good.csv --json --to later": (2, "--to: not a number, got 'later'; give one like 12.5"),
    "plot good.csv --json --events absent.json": (2, "absent.json: no such file or directory; give the result.json"),
    "plot good.csv --json --events good.csv": (2, "good.csv: not JSON"),
    "plot good.csv --json --events two.h5": (2, "two.h5: not a text file; give the result.json of bfi identify"),
    "plot good.csv --json --events other.json": (2, "other.json: not a result of this program, it has no 'kind'"),
    "plot good.csv --json --events reproduced.json": (2, "reproduced.json: kind is 'reproduce', which has no events"),
    "plot good.csv --json --events damaged.json": (2, "damaged.json: no key 'provenance'; the file is damaged or of"),
    "plot good.csv --out taken": (2, "taken/report.html: exists and was not written by bfi; give another --out, or"),
    "plot good.csv --out new --series": (2, "bfi plot: --series is about --json; add --json"),
    "diagnose": (2, "bfi diagnose: LOG... is missing; see bfi diagnose --help"),
    "diagnose absent.csv": (3, "absent.csv: no such file; give the path of a log"),
    "diagnose unflown.csv": (
        3,
        "unflown.csv: no airspeed and no impact pressure that changes; the log has: aoa, elevator",
    ),
    "diagnose still_output.csv": (3, "still_output.csv: no airspeed and no impact pressure that changes; the log has"),
    "diagnose taxiing.csv": (3, "taxiing.csv: no part of the log is in flight between take-off and landing; give a"),
    "diagnose good.csv --from 100": (3, "good.csv: no samples between 100 s"),
    "diagnose good.csv --from 20 --to 5": (2, "--from/--to: to_s must be after from_s (20 s), got 5 s"),
    "diagnose good.csv --tolerance aoa=0.1": (2, "--tolerance: 'aoa' is no channel, the log has: elevator, tas; leave"),
    "diagnose good.csv --false-alarm 2": (2, "--false-alarm: must be less than 1, got 2"),
    "diagnose good.csv --calibration absent.json": (2, "absent.json: cannot be read, no such file or directory; check"),
    "diagnose good.csv --calibration good.csv": (2, "good.csv: not JSON (expecting value); give a file of bfi calib"),
    "diagnose good.csv --calibration other.json": (2, "other.json: kind is 'None', not 'calibration'; give a file of"),
    "diagnose good.csv --out in_the_way": (2, "in_the_way: cannot be written, not a directory; give another --out"),
    "diagnose good.csv --workerz 2": (2, "bfi diagnose: unknown option '--workerz'; did you mean '--workers'?"),
    "convert good.csv": (2, "bfi convert: --output is missing; give --output OUT"),
    "convert good.csv -o new.h5 --rate 100": (3, "recorded at 10 Hz, it cannot be resampled to 100 Hz; give --rate 10"),
    "convert good.csv -o new.h5 --rate -1": (2, "--rate: must be a positive number, got -1 Hz; give one like 10"),
    "convert good.csv -o new.h5 --rate 1e-9": (3, "shorter than one step at 1e-09 Hz; give a higher --rate"),
    "convert good.csv -o new.h5 --rate fast": (2, "--rate: not a number, got 'fast'; give one like 12.5"),
    "convert good.csv -o new.txt": (2, "new.txt: no format with the suffix '.txt'; name the file .h5, .csv or .mcap"),
    "convert good.csv -o folder": (2, "folder: cannot be written, is a directory; give another --output"),
    "convert good.csv -o in_the_way/new.h5": (2, "in_the_way/new.h5: cannot be written, not a directory; give"),
    "convert good.csv -o folder.csv": (2, "folder.csv: cannot be written, is a directory; give another --output"),
    "convert truncated.h5 -o new.csv": (3, "truncated.h5: damaged or truncated HDF5 file"),
    **{
        f"{command.format('one.' + kind)}": (3, f"one.{kind}: {said}")
        for kind, said in (("h5", "no signals, got no array of more than one"), ("mat", "no signals, got no array of"))
        for command in SHORT
    },
    **{f"{command.format('one_sample.csv')}": (3, "one_sample.csv: 1 samples below the header") for command in SHORT},
    **{
        f"{command.format(name)}": (3, f"{name}: ")
        for name in ("two_samples.csv", "three_samples.csv")
        for command in SHORT[1:]
    },
    "inject good.csv -o new.h5": (2, "bfi inject: nothing to add; give --fault SPEC or --ordinary CAUSE@S"),
    **{
        f"inject good.csv -o new.h5 --ordinary '{cause}'": (2, f"--ordinary{said}")
        for cause, said in {
            "": ": not a cause, its time and perhaps its size, got ''; write one like altimeter_set@4780",
            "wake": ": not a cause, its time and perhaps its size, got 'wake'; write one like",
            "@30": ": not a cause, its time and perhaps its size, got '@30'; write one like",
            "wake@soon": ": not a cause, its time and perhaps its size, got 'wake@soon'; write one like",
            "wak@30": ": cannot be made, got 'wak'; did you mean 'wake'?",
            "flaps@30": ": cannot be made, got 'flaps'; known: altimeter_set, attitude_settles, wake, clock",
            "wake@nan": " wake@nan: the time must be finite, got nan; give",
            "wake@30:": " wake@30:: the size is no number, got ''; write one like 3 m/s",
            "wake@30:much": " wake@30:much: the size is no number, got 'much'; write one like 3 m/s",
            "wake@30:0": " wake@30:0: the size must be finite and not 0, got 0; write one like 3 m/s",
            "wake@30:inf": " wake@30:inf: the size must be finite and not 0, got inf; write one like 3 m/s",
            "wake@30:2K": " wake@30:2K: the size is in m/s, got '2K'; write one like 3 m/s",
            "wake@30:2xx": " wake@30:2xx: unknown unit 'xx'; give an SI unit",
            "clock@30:2s": " clock@30:2s: the size is in no unit, got '2s'; write one like 5",
        }.items()
    },
    "inject good.csv -o new.h5 --ordinary wake@1000": (3, "'wake' at 1000 s is outside: the log has 0 to 59.9 s; give"),
    "inject good.csv -o new.h5 --ordinary wake@30": (
        3,
        "'wake': p_static needs one of p_static, altitude; the log has",
    ),
    "inject good.csv -o new.h5 --ordinary attitude_settles@30": (3, "'attitude_settles' needs pitch; the log has: ele"),
    "inject good.csv -o new.h5 --ordinary altimeter_set@30": (3, "'altimeter_set' needs baro_altitude; the log has: "),
    "simulate citation -o new.h5 --ordinary flaps@3": (2, "leave out --tas, --altitude, --wind, --ordinary and the"),
    "simulate jsbsim:c172p -o new.h5 --ordinary flap@3": (
        2,
        "--ordinary: cannot be made, got 'flap'; did you mean 'fl",
    ),
    "simulate jsbsim:c172p -o new.h5 --ordinary flaps": (2, "--ordinary: not a cause, its time and perhaps its size"),
    "simulate jsbsim:c172p -o new.h5 --ordinary flaps@300": (2, "at 300 s, and the log ends at 31.72 s; give a time"),
    "simulate jsbsim:c172p -o new.h5 --ordinary flaps@-1": (2, "at -1 s, and the log ends at 31.72 s; give a time"),
    "inject good.csv -o new.h5 --fault bais,onset_s=3": (2, "shape: unknown shape, got 'bais'; did you mean 'bias'?"),
    "inject good.csv -o new.h5 --fault ''": (2, "shape: unknown shape, got ''; known: bias, drift"),
    "inject good.csv -o new.h5 --fault =": (2, "shape: unknown shape, got null; known: bias, drift"),
    "inject good.csv -o new.h5 --fault sine,onset_s=3": (2, "frequency_hz: missing; a sine needs it"),
    "inject good.csv -o new.h5 --fault bias,onset=3": (2, "onset: unknown key; did you mean 'onset_s'?"),
    "inject good.csv -o new.h5 --fault bias,3": (2, "expected key=value, got '3'; separate the keys by commas"),
    "inject good.csv -o new.h5 --fault bias,magnitude=x": (2, "magnitude: must be a finite number, got 'x'"),
    "inject good.csv -o new.h5 --fault 'bias,magnitude=4 1/s'": (
        2,
        "magnitude: is in m/s, got '4 1/s'; give a unit of",
    ),
    "inject good.csv -o new.h5 --fault bias,magnitude=inf": (2, "magnitude: must be a finite number, got inf"),
    "inject good.csv -o new.h5 --fault bias,channel=aoa": (3, "good.csv: no channel 'aoa'; the log has: elevator, tas"),
    "inject good.csv -o new.h5 --fault bias,onset_s=1000": (2, "never active in the log, got magnitude 1 from 1000 s"),
    "simulate citatoin -o new.h5": (2, "simulate: no such model, got 'citatoin'; did you mean 'citation'?"),
    "simulate b52 -o new.h5": (2, "simulate: no such model, got 'b52'; known: citation, "),
    "simulate -o new.h5": (
        2,
        "simulate: no model given; give one of citation, citation-short-period, b747, b747-mf2d, f16",
    ),
    "simulate citation --model d.yaml -o new.h5": (2, "one model is flown, got 'citation' and --model d.yaml; give"),
    "simulate --model absent.yaml -o new.h5": (2, "absent.yaml: cannot be read, no such file or directory; check"),
    "simulate --model binary.yaml -o new.h5": (2, "binary.yaml: byte 0 is not UTF-8 text; save the file as UTF-8"),
    "simulate --model two.h5 -o new.h5": (2, "two.h5: "),
    "simulate --model good.yaml -o new.h5": (2, "good.yaml: name: missing; add it"),
    "simulate citation -o new.h5 --rate -1": (2, "a log has 2 to 10,000,000 samples, got 31.72 s at -1 Hz; change"),
    "simulate citation -o new.h5 --duration 1e12": (2, "a log has 2 to 10,000,000 samples, got 1e+12 s at 100 Hz"),
    "simulate citation -o new.h5 --seed -1": (2, "--seed: too small, got -1; give 0 or more"),
    "simulate citation -o new.h5 --discretisation rk4": (2, "not one of the choices, got 'rk4'; known: 'zoh'"),
    "simulate citation -o new.h5 --noise tas": (2, "--noise: expected NAME=SD, got 'tas'; write --noise tas=0.01"),
    "convert good.csv -o good.csv": (2, "good.csv: is an input of this command; give another --output"),
    "convert good.csv -o folder/../good.csv --force": (2, "good.csv: is an input of this command; give another --out"),
    "convert good.csv -o hard.csv --force": (2, "hard.csv: is an input of this command; give another --output"),
    "convert good.csv -o soft.csv --force": (2, "soft.csv: is an input of this command; give another --output"),
    "convert soft.csv -o good.csv --force": (2, "good.csv: is an input of this command; give another --output"),
    "convert good.csv -o held.csv": (
        2,
        "held.csv: exists and was not written by bfi; give another --output, or --force",
    ),
    "inject good.csv -o good.csv --fault bias,onset_s=5": (2, "good.csv: is an input of this command; give another"),
    "inject good.csv -o held.csv --fault bias,onset_s=5": (2, "held.csv: exists and was not written by bfi; give"),
    "inject good.csv -o held.csv --force --fault samples,file=held.csv": (2, "held.csv: is an input of this command"),
    "simulate citation -o good.csv": (2, "good.csv: exists and was not written by bfi; give another --output, or"),
    "simulate citation -o truncated.h5": (2, "truncated.h5: exists and was not written by bfi; give another --output"),
    "calibrate -o new.json": (2, "bfi calibrate: LOG... is missing; see bfi calibrate --help"),
    "calibrate folder -o new.json": (3, "folder: no logs are there (files that end with .bin, .csv"),
    "calibrate --list two_aircraft.csv -o new.json": (
        2,
        "bfi calibrate: the logs are of 2 aircraft, N1, N2; give those of one",
    ),
    "calibrate good.csv -o good.csv": (2, "good.csv: is an input of this command; give another -o"),
    "calibrate good.csv -o other.json": (2, "other.json: exists and was not written by bfi; give another -o, or --for"),
    "calibrate good.csv -o other.json --append": (
        2,
        "other.json: kind is 'None', not 'calibration'; give a file",
    ),
    "identify taken/series.csv --out taken --force": (2, "taken/series.csv: is an input of this command; give another"),
    "identify good.csv -d taken/result.json --out taken --force": (2, "taken/result.json: is an input of this command"),
    "identify good.csv -d good.yaml --out taken": (
        2,
        "exists and was not written by bfi; give another --out",
    ),
    "start-time good.csv --out taken": (
        2,
        "taken/report.html: exists and was not written by bfi; give another --out, or",
    ),
    "detect good.csv --out taken": (2, "taken/report.html: exists and was not written by bfi; give another --out, or"),
    "diagnosability good.csv -d good.yaml --out taken": (2, "taken/report.html: exists and was not written by bfi"),
    "dictionary good.yaml --out taken": (2, "taken/report.html: exists and was not written by bfi; give another --out"),
    "montecarlo -c sweep.yaml --out taken": (2, "taken/trials.csv: exists and was not written by bfi; give another"),
    "montecarlo -c sweep.yaml --out begun": (2, "begun/trials.jsonl: exists and was not written by bfi; give"),
    "reproduce thesis-2-2": (
        2,
        "thesis-2-2 has no page, it is a block diagram of DMAE with nothing to compute; give one",
    ),
    "reproduce thesis-5-1 --out taken": (2, "taken/report.html: exists and was not written by bfi; give another --out"),
    "identify good.csv --series": (2, "bfi identify: --series is about --json; add --json"),
    "report absent.json": (2, "absent.json: no such file or directory; give the result.json of a command's --out"),
    "report folder": (2, "folder: is a directory; give the result.json of a command's --out"),
    "report good.csv": (2, "good.csv: not JSON"),
    "report two.h5": (2, "two.h5: not a text file; give the result.json"),
    "report other.json": (2, "other.json: not a result of this program, it has no 'kind'; give the result.json"),
    "report reproduced.json": (
        2,
        "reproduced.json: exhibit: '../../drawn' is no name of a file; run the command again",
    ),
    "identify good.csv -d good.yaml --require abrupt,sloww": (2, "--require: not one of the choices, got 'sloww'; did"),
    "diagnose folder": (3, "folder: no logs are there (files that end with .bin, .csv"),
    "diagnose good.csv good.csv hard.csv --json --series": (
        2,
        "--series: is about one log, got several; result.json",
    ),
    "diagnose good.csv hard.csv --verbose": (2, "--verbose: is about one log, got several; the report of each log has"),
    "diagnose good.csv hard.csv --events-csv new.csv": (2, "--events-csv: is about one log, got several; the table"),
    "diagnose good.csv hard.csv --jsonl good.csv": (2, "good.csv: is an input of this command; give another --jsonl"),
    "diagnose good.csv hard.csv --jsonl in_the_way": (2, "in_the_way: exists and was not written by bfi; give another"),
    "diagnose good.csv hard.csv --out in_the_way": (2, "in_the_way: cannot be written, not a directory; give another"),
    "diagnose good.csv hard.csv --workers 2 --scheduler a": (
        2,
        "bfi diagnose: --workers and --scheduler exclude each other; keep one",
    ),
    "diagnose good.csv hard.csv --workers 0": (2, "--workers: too small, got 0; give 1 or more"),
    "diagnose --list absent.txt": (2, "--list absent.txt: no such file or directory; give a text file with the path"),
    "diagnose --list good.csv": (2, "--list good.csv: no column 'log', the first line is 'time [s],elevator [rad]"),
    "info good.csv hard.csv --out good.csv": (2, "good.csv: cannot be written, not a directory; give another --out"),
    "start-time good.csv --require abrupt,abrupt": (2, "--require: a value stands twice"),
    "identify good.csv -d good.yaml --tolerance aoa=1": (
        2,
        "--tolerance: 'aoa' is no output of this analysis; known: tas",
    ),
    "start-time good.csv --tolerance tas": (2, "--tolerance: expected CHANNEL=VALUE, got 'tas'; write --tolerance tas"),
    "identify good.csv -d good.yaml --tolerance tas=-1": (2, "--tolerance: tas: must be greater than 0, got -1.0"),
    "identify good.csv -d good.yaml --onset-tolerance -1": (2, "--onset-tolerance: must be greater than or equal to 0"),
    "report damaged.json": (2, "damaged.json: no key 'provenance'; the file is damaged or of another program"),
}

ROWS = (
    *((f"identify {name} -d good.yaml", "", 3, fragment) for name, (_, fragment) in LOGS.items()),
    *((f"identify {name} -d good.yaml", "", 3, fragment) for name, (_, fragment) in ODD.items()),
    *(("identify good.csv -d good.yaml -c c.yaml", text, 2, fragment) for text, fragment in CONFIGS.items()),
    *(("identify good.csv -d d.yaml", text, 2, fragment) for text, fragment in DICTIONARIES.items()),
    *((f"identify good.csv -d good.yaml {options}", "", *expected) for options, expected in OPTIONS.items()),
    *((line, "", *expected) for line, expected in COMMANDS.items()),
    *(("simulate --model c.yaml -o new.h5", text, 2, fragment) for text, fragment in MODEL_FILES.items()),
    ("simulate --model c.yaml -o new.h5 --discretisation bilinear", MODEL % "200", 2, "m: A: has no bilinear"),
)


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of good and bad files."""
    folder = tmp_path_factory.mktemp("desk")
    for name, (content, _) in LOGS.items():
        if name.endswith(".csv") and name != "absent.csv":
            (folder / name).write_text(content)
    (folder / "folder").mkdir()
    (folder / "folder.csv").mkdir()
    (folder / "good.csv").write_text(csv())
    (folder / "good.yaml").write_text(FAULTS)
    for name, head, column in (
        ("supersonic.csv", "altitude [m],cas [m/s]", (np.full(T.size, 3000.0), altered(TAS, 30, 400.0))),
        ("negative.csv", "p_static [Pa],cas [m/s]", (altered(np.full(T.size, 7e4), 30, -1000.0), TAS)),
    ):
        rows = zip(T.tolist(), ELEVATOR.tolist(), *(one.tolist() for one in column), strict=True)
        text = "".join(",".join(map(repr, row)) + "\n" for row in rows)
        (folder / name).write_text(f"time [s],elevator [rad],{head}\n{text}")
    (folder / "two_aircraft.csv").write_text("log,aircraft\ngood.csv,N1\nhard.csv,N2\n")
    (folder / "unflown.csv").write_text(csv().replace("tas [m/s]", "aoa [rad]"))
    (folder / "taxiing.csv").write_text(csv(tas=0.02 * TAS))
    (folder / "in_the_way").write_text("a file")
    (folder.parent / "x.csv").write_text("0,0\n1,1\n")
    (folder / "link.csv").symlink_to("../x.csv")
    (folder / "falls.csv").write_text("0,0\n2,1\n1,2\n")
    (folder / "infinite_value.csv").write_text("0,0\n1,inf\n")
    with open(folder / "large.csv", "wb") as file:
        file.truncate(20_000_001)
    reproduced = {"kind": "reproduce", "schema": 1, "provenance": PROVENANCE}
    drawn = {"name": "../../drawn", "caption": "", "panels": [], "heat_maps": []}
    told = dict.fromkeys(("kicker", "title", "heading", "verdict"), "")
    (folder / "reproduced.json").write_text(json.dumps({**reproduced, "exhibit": {**told, "drawings": [drawn]}}))
    (folder / "hard.csv").hardlink_to(folder / "good.csv")
    (folder / "soft.csv").symlink_to("good.csv")
    (folder / "sweep.yaml").write_text("record: {model: citation}\ndictionary: good.yaml\nactive: 1\ntrials: 1\n")
    for name in ("taken/series.csv", "taken/result.json", "taken/report.html", "taken/trials.csv"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(FAULTS if name.endswith(".json") else csv())
    (folder / "begun").mkdir()
    (folder / "begun" / "trials.jsonl").write_text(csv())
    (folder / "other.json").write_text("{}")
    (folder / "damaged.json").write_text('{"kind": "identify", "schema": 2}')
    (folder / "binary.yaml").write_bytes(b"\xff\xfe\0")
    write_log(FLIGHT, folder / "two.h5")
    (folder / "truncated.h5").write_bytes((folder / "two.h5").read_bytes()[:20_000])
    rows = csv().splitlines(keepends=True)
    (folder / "two_samples.csv").write_text("".join(rows[:3]))
    (folder / "three_samples.csv").write_text("".join(rows[:4]))
    one = {"time": T[:1], "elevator": ELEVATOR[:1], "tas": TAS[:1]}
    write_hdf5(folder / "one.h5", **one)
    savemat(folder / "one.mat", one)
    for name, (write, _) in ODD.items():
        write(folder / name)
    with h5py.File(folder / "no_signals.h5", "w") as file:
        file.attrs["comment"] = "nothing was recorded"
    return folder


def contents(folder: Path) -> dict[str, int]:
    paths = (os.path.join(root, name) for root, _, names in os.walk(folder) for name in names)
    return {path: os.stat(path).st_mtime_ns for path in paths}


@pytest.mark.parametrize(
    ("line", "document", "code", "fragment"), ROWS, ids=[f"{row[0]} {row[1]}"[:80] for row in ROWS]
)
def test_one_line_says_where_what_and_what_to_do(
    bfi: Callable, desk: Path, monkeypatch: pytest.MonkeyPatch, line: str, document: str, code: int, fragment: str
):
    monkeypatch.chdir(desk)
    for name in ("c.yaml", "d.yaml"):
        Path(name).write_text(document + "\n")
    argv = shlex.split(line)
    if argv[0] == "identify" and "--out" not in argv:
        argv[2:2] = ["--out", "new"]
    before = contents(desk)
    outcome = bfi(*argv)
    assert (outcome.code, outcome.stdout) == (code, "")
    assert fragment in outcome.stderr
    assert LINE.fullmatch(outcome.stderr)
    assert not NOT_OURS.search(outcome.stderr.replace(fragment, ""))
    assert contents(desk) == before
    assert not (desk / "new").exists()


@pytest.mark.usefixtures("unscanned")
@pytest.mark.parametrize("text", ["risro: {tolerance: 1e-3}", "window: {from_s: 1e0}", "strict: false", "", "{}"])
def test_what_yaml_may_say(bfi: Callable, desk: Path, monkeypatch: pytest.MonkeyPatch, text: str):
    monkeypatch.chdir(desk)
    Path("fine.yaml").write_text(text)
    outcome = bfi("identify", "good.csv", "-d", "good.yaml", "-c", "fine.yaml")
    assert (outcome.code, outcome.stderr) == (0, "")


@pytest.mark.usefixtures("unscanned")
def test_dead_duplicate_and_constant_faults_are_notes_while_one_is_live(bfi: Callable, desk: Path, tmp_path: Path):
    path = tmp_path / "mixed.yaml"
    onsets = {"live": 20, "again": 20, "late": 300, "constant": 0}
    path.write_text("atoms:\n" + "".join(f"- {{name: {k}, shape: bias, onset_s: {v}}}\n" for k, v in onsets.items()))
    outcome = bfi("identify", desk / "good.csv", "-d", path, "--onset-tolerance", 0, "--json")
    document = json.loads(outcome.stdout)
    notes = {candidate["name"]: candidate["note"] for candidate in document["candidates"]}
    assert outcome.code == 0
    assert notes["live"] is None
    for name, said in {
        "again": "the same signal as 'live'",
        "late": "after the window ends",
        "constant": "not change",
    }.items():
        assert said in notes[name]
        assert any(notes[name] in note for note in texts(document["notes"]))
