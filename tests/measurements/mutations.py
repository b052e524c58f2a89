"""Which changes of lines that decide the fast tests notice: `python tests/measurements/mutations.py [WORD ...]`.

Every entry changes one line of a copy of the repository, or makes a constant 30 % larger, and runs the tests named
beside it, the fast ones of these files; a change that they pass is printed as NOT CAUGHT. Lines are found by their
text: an entry whose text is gone, or stands in its file more than once, is stale and wants to be written again. With
WORDs only the entries run whose file or line has one of them. The exit code is 1 where anything is not caught, stale or
without tests.
"""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = shutil.ignore_patterns(".git", ".*_cache", "__pycache__", "*.egg-info", "build", "dist")
LONGEST_S = 900.0  # of the tests of one change, which may never end


@dataclass(frozen=True, slots=True)
class Line:
    """A line that decides: what is changed in it, into what, and the patterns of the test files that are to notice."""

    file: str
    text: str
    changed: tuple[str, ...]
    tests: tuple[str, ...]


BY = 1.3  # times as much, of a constant


@cache
def read(file: str) -> tuple[list[str], ast.Module]:
    """Return the lines of a module and its tree."""
    source = (ROOT / "bfi_cli" / file).read_text(encoding="utf-8")
    return source.splitlines(), ast.parse(source)


def constant(file: str, name: str, tests: Sequence[str]) -> Line:
    """Return the line of a constant of a module, with the one in which it is 30 % larger."""
    lines, tree = read(file)
    for statement in tree.body:
        if not isinstance(statement, ast.Assign):
            continue
        target, value = statement.targets[0], statement.value
        together = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
        pairs = zip(target.elts, value.elts, strict=True) if together else [(target, value)]
        for named, number in pairs:
            if not (isinstance(named, ast.Name) and named.id == name):
                continue
            line, part = lines[number.lineno - 1], slice(number.col_offset, number.end_col_offset)
            counts = isinstance(number, ast.Constant) and isinstance(number.value, int)
            larger = str(round(BY * int(line[part]))) if counts else f"{BY} * ({line[part]})"
            return Line(file, line, (line[: part.start] + larger + line[part.stop :],), tuple(tests))
    raise ValueError(f"{file} has no constant {name}")


FLIGHT_LIMITS = (
    "tests/flight/test_*limits*.py",
    "tests/flight/test_*looks*.py",
    "tests/flight/test_*lasting*.py",
)
RELATIONS = ("tests/flight/parity/test_*static_relations*.py", "tests/flight/parity/test_*limits*.py")
ONSET_CLAIMS = (
    "tests/model/onset/test_*claims*.py",
    "tests/model/onset/test_*decision*.py",
    "tests/model/onset/test_*excluded*.py",
)
MAGNITUDES = ("tests/model/preprocessing/test_*magnitudes*.py", "tests/model/preprocessing/test_*limits*.py")
SINES = ("tests/kernels/onset/test_sines.py",)
# By file, the constants that decide what is declared, suspected, told, joined or claimed, and the tests that hold them.
FLIGHT, PARITY = "tests/flight/test_{}.py", "tests/flight/parity/test_{}.py"
CONSTANTS: tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...] = (
    ("flight/weighing.py", ("ABOUT_S",), (FLIGHT.format("weighing_rules"),)),
    ("flight/proposals.py", ("APART_S",), (FLIGHT.format("weighing_rules"),)),
    ("flight/placing.py", ("MOVES", "RESTS_S", "UNDESCRIBED"), (FLIGHT.format("weighing_rules"),)),
    ("flight/judge.py", ("BEFORE_NEXT_S", "AFTER_END_S"), (FLIGHT.format("weighing_rules"),)),
    ("flight/weight.py", ("ALIKE", "DECLARED", "SURE", "LOUD", "AUDIBLE"), (FLIGHT.format("weighing_rules"),)),
    ("flight/judge.py", ("GROUND_BEFORE_S", "SET_WITHIN_S"), (FLIGHT.format("judge"),)),
    ("flight/gross.py", ("HEIGHTS", "SPEEDS", "STAYS", "FEWEST_S", "APART_S", "SETTLED_S"), (FLIGHT.format("gross"),)),
    ("flight/noise.py", ("QUIETEST", "TOLD"), (FLIGHT.format("noise"),)),
    ("flight/surprises.py", ("PROPOSED", "TOLD", "LEADS", "LARGEST", "ICY"), (FLIGHT.format("surprises"),)),
    ("flight/timing.py", ("REACH_S", "TAIL", "EARLIER_S"), (FLIGHT.format("timing"),)),
    ("flight/oscillations.py", ("PROPOSED", "LEAST", "KNOWN", "WEIGHED_S"), (FLIGHT.format("oscillations"),)),
    ("flight/bench.py", ("ZERO",), (FLIGHT.format("judge"),)),
    ("flight/limits.py", ("EXCEEDED_BY",), (FLIGHT.format("limits"),)),
    ("decision/candidate.py", ("MOSTLY",), (FLIGHT.format("limits"),)),
    ("flight/step_bounds.py", ("FRONT", "INVERSION"), (FLIGHT.format("step_bounds"),)),
    ("flight/looks.py", ("CALM", "ENOUGH_WINDOWS"), (FLIGHT.format("looks"),)),
    (
        "flight/events.py",
        ("BEFORE_S", "FREQUENCY_TOLERANCE", "STEP_BACK", "SURE", "MOST_LEFT"),
        (FLIGHT.format("events"),),
    ),
    ("flight/diagnose.py", ("UNLIKE",), (FLIGHT.format("deviations"),)),
    ("flight/relations.py", ("LONGEST",), (FLIGHT.format("lasting_faults"), PARITY.format("static_relations"))),
    ("flight/flight.py", ("MEAN_RATE",), (FLIGHT.format("flight"),)),
    ("flight/parity/frozen.py", ("RESTS",), (PARITY.format("sensors"),)),
    (
        "flight/parity/sensors.py",
        ("FASTEST", "ALTIMETER_M", "AT_ONCE", "UNUSUAL", "UNUSUAL_PITCH"),
        (PARITY.format("sensors"),),
    ),
    (
        "flight/parity/static_relations.py",
        ("THRESHOLD", "LEAST_STEPS"),
        (PARITY.format("static_relations"), PARITY.format("relation_limits")),
    ),
    (
        "flight/parity/relation_series.py",
        ("POSITION_ERROR", "UNSEEN_STEPS"),
        (PARITY.format("static_relations"), PARITY.format("relation_limits")),
    ),
    ("flight/parity/explain.py", ("RARER",), (PARITY.format("explain"),)),
    ("flight/parity/windows.py", ("DEFLECTED",), (PARITY.format("windows"),)),
    ("flight/parity/holds.py", ("STILL", "HIDDEN", "LEVEL_M"), (PARITY.format("holds"),)),
    ("flight/parity/leaks.py", ("LEFT", "BRAKING", "SAME_LEVEL"), (PARITY.format("holds"),)),
    ("flight/parity/relaxation.py", ("MISFIT_OF_CHANGE",), (PARITY.format("relaxation"), PARITY.format("holds"))),
    (
        "flight/parity/residuals.py",
        ("DISPERSION_GROWTH", "BIAS_SD"),
        (PARITY.format("residuals"), PARITY.format("thresholds")),
    ),
    ("flight/parity/credibility.py", ("MOVES", "GUSTS"), (PARITY.format("credibility"),)),
    (
        "flight/plausibility/misfits.py",
        ("HOLDING", "LARGE", "BETTER"),
        ("tests/flight/plausibility/test_*.py",),
    ),
    ("flight/plausibility/search.py", ("SIMPLER",), ("tests/flight/plausibility/test_*.py",)),
    ("flight/plausibility/implausible.py", ("TURN",), ("tests/flight/plausibility/test_circling.py",)),
)
LINES = (
    *(constant(file, name, tests) for file, names, tests in CONSTANTS for name in names),
    Line(
        "flight/parity/static_relations.py",
        "half = max(1, n // 2)",
        ("half = n", "half = max(1, n // 4)"),
        RELATIONS,
    ),
    Line(
        "flight/parity/static_relations.py",
        "sizes, reach = relation.hidden[every], relation.reach[every]",
        (
            "sizes, reach = relation.least[every], relation.reach[every]",
            "sizes, reach = relation.scan.hidden[every], relation.reach[every]",
            "sizes, reach = 0.99 * relation.hidden[every], relation.reach[every]",
        ),
        RELATIONS,
    ),
    Line(
        "flight/parity/static_relations.py",
        "return np.maximum(self.scan.hidden, np.abs(self.scan.amplitude) + self.least)",
        (
            "return np.abs(self.scan.amplitude) + self.least",
            "return np.minimum(self.scan.hidden, np.abs(self.scan.amplitude) + self.least)",
            "return np.maximum(self.scan.hidden, self.least)",
            "return np.maximum(self.scan.hidden, self.scan.amplitude + self.least)",
        ),
        RELATIONS,
    ),
    Line("flight/looks.py", "beside=bool(lasting))", ("beside=False)", "beside=True)"), FLIGHT_LIMITS),
    Line(
        "flight/limits.py",
        "return np.abs(magnitude) + spreads, spreads",
        ("return spreads, spreads", "return magnitude + spreads, spreads", "return np.abs(magnitude), spreads"),
        FLIGHT_LIMITS,
    ),
    Line(
        "flight/looks.py",
        "return false_alarm / (len(LENGTHS_S) + 1) / max(n_windows, 1)",
        ("return false_alarm / (len(LENGTHS_S) + 1)", "return false_alarm / max(n_windows, 1)"),
        FLIGHT_LIMITS,
    ),
    Line(
        "flight/limits.py",
        "best = np.argmin(np.where(inside, spreads, np.inf) * np.where(inside, per_tolerance, 1.0), axis=1)",
        (
            "best = np.argmax(np.where(inside, spreads, -1.0) * np.where(inside, per_tolerance, 1.0), axis=1)",
            "best = np.argmin(np.where(inside, sizes, np.inf) * np.where(inside, per_tolerance, 1.0), axis=1)",
        ),
        FLIGHT_LIMITS,
    ),
    Line(
        "flight/limits.py",
        "if overlaps(scan.window, left_out):",
        ("if False:", "if overlaps(scan.window, left_out[1:]):"),
        FLIGHT_LIMITS,
    ),
    Line(
        "flight/verdict.py",
        "bounded[name] = bool(deciding) and all(limit.within_tolerance for limit in deciding)",
        (
            "bounded[name] = bool(deciding) and any(limit.within_tolerance for limit in deciding)",
            "bounded[name] = all(limit.within_tolerance for limit in deciding)",
        ),
        FLIGHT_LIMITS,
    ),
    Line(
        "model/onset/claims.py",
        "CLAIMED_CYCLES, CYCLES_LEFT = 6.0, 2.0",
        ("CLAIMED_CYCLES, CYCLES_LEFT = 4.0, 2.0", "CLAIMED_CYCLES, CYCLES_LEFT = 6.0, 1.0"),
        ONSET_CLAIMS,
    ),
    Line(
        "model/onset/claims.py",
        "EXCLUDED, SUSPECTED = 0.5 * math.exp(-0.5 * ONE_SIDED_95**2), 1.0",
        (
            "EXCLUDED, SUSPECTED = 1.0 * math.exp(-0.5 * ONE_SIDED_95**2), 1.0",
            "EXCLUDED, SUSPECTED = 0.5 * math.exp(-0.5 * ONE_SIDED_95**2), 2.0",
        ),
        ONSET_CLAIMS,
    ),
    Line(
        "decision/candidate.py",
        'if candidate.state == "excluded" and (candidate.shape, candidate.channel) in rivals',
        (
            'if candidate.state == "excluded" or (candidate.shape, candidate.channel) in rivals',
            'if candidate.state == "excluded" and (candidate.shape, candidate.channel) not in rivals',
        ),
        ("tests/decision/test_limits.py",),
    ),
    Line(
        "model/onset/claims.py",
        "return (math.sqrt(statistic) + ONE_SIDED_90 * math.sqrt(dispersion)) ** 2",
        (
            "return statistic",
            "return (math.sqrt(statistic) + ONE_SIDED_90) ** 2",
            "return math.sqrt(statistic) + ONE_SIDED_90 * math.sqrt(dispersion)",
        ),
        ONSET_CLAIMS,
    ),
    Line(
        "model/onset/claims.py",
        "doubt=ONE_SIDED_95**2 * dispersion,",
        ("doubt=ONE_SIDED_95**2,", "doubt=ONE_SIDED_95 * dispersion,", "doubt=0.0 * dispersion,"),
        ONSET_CLAIMS,
    ),
    Line(
        "detection/parity.py",
        "declared = factor * ((needed + ONE_SIDED_90) * drops.old_sd[run, place]).max(axis=1)",
        (
            "declared = ((needed + ONE_SIDED_90) * drops.old_sd[run, place]).max(axis=1)",
            "declared = factor * (needed * drops.old_sd[run, place]).max(axis=1)",
            "declared = factor * ((needed + ONE_SIDED_90) * drops.old_sd[run, place]).min(axis=1)",
            "declared = factor * ((needed - ONE_SIDED_90) * drops.old_sd[run, place]).max(axis=1)",
        ),
        ("tests/detection/test_limits.py",),
    ),
    Line(
        "detection/parity.py",
        "threshold = _threshold(model, drops, window, false_alarm, patch=patch)",
        (
            "threshold = _threshold(model, drops, window, false_alarm, patch=0)",
            "threshold = _threshold(model, drops, window, false_alarm, patch=2 * patch)",
        ),
        ("tests/detection/test_limits.py",),
    ),
    Line(
        "model/preprocessing/magnitudes.py",
        "RATE_WEIGHT = 0.5",
        ("RATE_WEIGHT = 0.25", "RATE_WEIGHT = 1.0"),
        MAGNITUDES,
    ),
    Line(
        "model/preprocessing/magnitudes.py",
        "n, correlated = penalty.n_rows, np.sqrt(penalty.n_rows / penalty.n_effective)",
        (
            "n, correlated = penalty.n_rows, 1.0",
            "n, correlated = penalty.n_rows, np.sqrt(penalty.n_effective / penalty.n_rows)",
            "n, correlated = penalty.n_rows, penalty.n_rows / penalty.n_effective",
        ),
        MAGNITUDES,
    ),
    Line(
        "model/preprocessing/magnitudes.py",
        "statistic_needed(penalty, overdispersion)) + ONE_SIDED_90 * correlated * np.sqrt(overdispersion)",
        (
            "statistic_needed(penalty, overdispersion))",
            "statistic_needed(penalty, overdispersion)) + ONE_SIDED_90 * np.sqrt(overdispersion)",
            "statistic_needed(penalty, overdispersion)) + ONE_SIDED_90 * correlated",
        ),
        MAGNITUDES,
    ),
    Line(
        "model/preprocessing/magnitudes.py",
        "ratio = penalty.n_effective * (held.log_det - fit.log_det) / overdispersion",
        (
            "ratio = penalty.n_rows * (held.log_det - fit.log_det) / overdispersion",
            "ratio = penalty.n_effective * (held.log_det - fit.log_det)",
            "ratio = penalty.n_effective * (fit.log_det - held.log_det) / overdispersion",
        ),
        MAGNITUDES,
    ),
    Line(
        "model/preprocessing/magnitudes.py",
        "return mean, (1.0 - weight) * variance + weight * value_variance + spread / overdispersion",
        (
            "return mean, (1.0 - weight) * variance + weight * value_variance",
            "return mean, (1.0 - weight) * variance + weight * value_variance + spread",
            "return mean, weight * variance + (1.0 - weight) * value_variance + spread / overdispersion",
        ),
        MAGNITUDES,
    ),
    Line(
        "flight/parity/explain.py",
        "TAILS = 1.3",
        ("TAILS = 1.0", "TAILS = 1.2", "TAILS = 1.5"),
        ("tests/flight/parity/test_explain.py",),
    ),
    Line(
        "kernels/onset/frequency.py",
        "share = self.scan.impulses()[onsets] + self.steady_share[k, self.border[onsets]]",
        ("share = self.scan.impulses()[onsets]", "share = self.steady_share[k, self.border[onsets]]"),
        SINES,
    ),
    Line(
        "flight/parity/residuals.py",
        "BIAS_SD = 0.05",
        ("BIAS_SD = 0.1", "BIAS_SD = 0.025"),
        ("tests/flight/parity/test_residuals.py",),
    ),
    Line(
        "flight/parity/residuals.py",
        "np.column_stack([ahead, ahead * height[:, None]]), np.array([WIND_SD, WIND_SD, SHEAR_SD, SHEAR_SD])",
        (
            "np.column_stack([ahead, ahead * height[:, None]]), np.array([WIND_SD, WIND_SD, WIND_SD, WIND_SD])",
            "np.column_stack([ahead * height[:, None], ahead]), np.array([WIND_SD, WIND_SD, SHEAR_SD, SHEAR_SD])",
            "np.column_stack([ahead, height[:, None] / ahead]), np.array([WIND_SD, WIND_SD, SHEAR_SD, SHEAR_SD])",
        ),
        ("tests/flight/parity/test_residuals.py",),
    ),
    Line(
        "flight/parity/residuals.py",
        "slow=lambda t: 0.3**2 * np.minimum(t[:, None], t[None, :]),  # a random walk",
        (
            "slow=lambda t: 0.6**2 * np.minimum(t[:, None], t[None, :]),",
            "slow=lambda t: 0.15**2 * np.minimum(t[:, None], t[None, :]),",
            "slow=_exponential(0.3, 30.0),",
        ),
        ("tests/flight/parity/test_residuals.py",),
    ),
    # Between 3 and 1000 nothing depends on it; at 1 a large fault has no square, at 10 000 it is none.
    Line(
        "flight/parity/scan.py",
        "LARGE = 300.0",
        ("LARGE = 1.0", "LARGE = 10000.0"),
        ("tests/flight/parity/test_scan.py",),
    ),
    Line(
        "flight/parity/scan.py",
        "return np.asarray(STEP_S * (np.cumsum(known, axis=0) - 0.5 * known))",
        (
            "return np.asarray(STEP_S * np.cumsum(known, axis=0))",
            "return np.asarray(STEP_S * (np.cumsum(known, axis=0) + 0.5 * known))",
            "return np.asarray(STEP_S * (np.cumsum(known, axis=0) - known))",
        ),
        ("tests/flight/parity/test_scan.py",),
    ),
    Line(
        "flight/parity/holds.py",
        "STILL, HIDDEN, MOTIONLESS = 1.0 / 3.0, 0.5, 0.1",
        (
            "STILL, HIDDEN, MOTIONLESS = 2.0 / 3.0, 0.5, 0.1",
            "STILL, HIDDEN, MOTIONLESS = 1.0 / 3.0, 1.0, 0.1",
            "STILL, HIDDEN, MOTIONLESS = 1.0 / 3.0, 0.5, 0.3",
        ),
        ("tests/flight/parity/test_*holds*.py",),
    ),
    Line(
        "airdata/motion.py",
        "kept = error <= OUTLYING * MAD * np.median(error[kept])",
        (
            "kept = error <= OUTLYING * np.median(error[kept])",
            "kept = error <= OUTLYING * MAD * np.median(error)",
        ),
        ("tests/airdata/test_*motion*.py",),
    ),
    Line(
        "airdata/motion.py",
        "prior = AIRSPEED_SD / WIND_SD",
        ("prior = 0.0", "prior = WIND_SD / AIRSPEED_SD", "prior = (AIRSPEED_SD / WIND_SD) ** 2"),
        ("tests/airdata/test_*motion*.py",),
    ),
    Line(
        "kernels/risro_varx.py",
        "dof = n - float(np.sum((w[:, None] * lapack.dtrtri(S[:n, :n])[0]) ** 2))",
        (
            "dof = float(n)",
            "dof = float(np.sum((w[:, None] * lapack.dtrtri(S[:n, :n])[0]) ** 2))",
            "dof = n - float(np.sum(np.abs(w[:, None] * lapack.dtrtri(S[:n, :n])[0])))",
        ),
        ("tests/kernels/test_sparsity*.py",),
    ),
    Line(
        "kernels/whiteness.py",
        "WHITE_WEIGHT = 5",
        ("WHITE_WEIGHT = 2", "WHITE_WEIGHT = 10"),
        ("tests/kernels/test_exponential_tail*.py", "tests/kernels/test_*tail*.py"),
    ),
    Line(
        "flightlog/dataflash.py",
        '"C": ("<u2", 0.01),',
        ('"C": ("<i2", 0.01),', '"C": ("<u2", 1.0),', '"C": (">u2", 0.01),'),
        ("tests/flightlog/test_dataflash.py",),
    ),
    Line(
        "flightlog/dataflash.py",
        '"E": ("<u4", 0.01),',
        ('"E": ("<i4", 0.01),', '"E": ("<u4", 1.0),', '"E": ("<u4", 0.1),'),
        ("tests/flightlog/test_dataflash.py",),
    ),
)


def passes(copy: Path, files: Sequence[str]) -> bool:
    """Return whether the fast tests of these files pass in a copy of the repository; what never ends does not pass."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    environment = {**os.environ, **threads, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *files]
    try:
        done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        return False
    if done.returncode == 4:  # pytest was started wrongly
        raise RuntimeError(done.stdout.decode()[-2000:] + done.stderr.decode()[-2000:])
    return done.returncode in (0, 5)  # passed, or without a fast test


def tried(copy: Path, line: Line, sound: dict[tuple[str, ...], bool]) -> list[str]:
    """Return what becomes of each change of a line: "caught", or what is wrong."""
    path = copy / "bfi_cli" / line.file
    before = path.read_text(encoding="utf-8") if path.is_file() else ""
    n_found = before.count(line.text)
    if n_found != 1:
        return [f"stale: {n_found} lines have the text"]
    files = tuple(sorted({str(one.relative_to(copy)) for pattern in line.tests for one in copy.glob(pattern)}))
    if not files:
        return ["no test file"]
    if files not in sound:
        sound[files] = passes(copy, files)
    if not sound[files]:
        return ["the tests fail without a change"]
    answers = []
    for changed in line.changed:
        path.write_text(before.replace(line.text, changed), encoding="utf-8")
        answers.append("NOT CAUGHT" if passes(copy, files) else "caught")
    path.write_text(before, encoding="utf-8")
    return answers


def main(words: Sequence[str]) -> int:
    """Print what becomes of the changes, and return the exit code."""
    chosen = [one for one in LINES if not words or any(word in " ".join((one.file, one.text)) for word in words)]
    sound: dict[tuple[str, ...], bool] = {}
    wrong = 0
    with TemporaryDirectory(prefix="mutations-") as folder:
        copy = Path(folder) / "tree"
        shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
        where = "import bfi_cli; print(bfi_cli.__file__)"
        used = subprocess.run(
            [sys.executable, "-c", where], cwd=copy, capture_output=True, text=True, check=True
        ).stdout
        if not Path(used.strip()).is_relative_to(copy):
            raise RuntimeError(f"the tests of the copy would import {used.strip()}")
        for line in chosen:
            print(f"{line.file}: {line.text}")
            answers = tried(copy, line, sound)
            for k, answer in enumerate(answers):
                print(
                    f"    {answer:12s} {line.changed[k] if answer in ('caught', 'NOT CAUGHT') else ''}".rstrip(),
                    flush=True,
                )
            wrong += any(answer != "caught" for answer in answers)
    print(f"{len(chosen) - wrong} of {len(chosen)} lines: every change is caught")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
