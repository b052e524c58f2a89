"""Paper H, figure 1: failures of the sensors of a Boeing 747, localised by the null space of the data matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..aircraft.catalogue import B747
from ..exhibit import Drawing, Exhibit, Panel, Table, curve
from ..kernels.nullspace import data_matrices, window_criteria
from ..wording import number
from .hankel_condition import condition_table
from .hankel_flight import FAILURES, GAIN, KINDS, LEVEL, N_SAMPLES, RATE_HZ, WIDTH, Case, Failure, columns, fly
from .settings import Settings, comparison

__all__ = ["hankel_b747"]

FloatArray = NDArray[np.float64]
Flights = dict[str, Case]
Alone = dict[str, list[Case]]

LEAST, LATER = 1e-18, 5
WORDS = dict(zip(B747.outputs, ("alpha", "Vdot", "theta", "q", "Vz", "h"), strict=True))
PRINTED_A15 = -2.4e-6

CAPTION = (
    "Measurement errors caused by the failures (above) and criteria (29) of every channel (below), both as a share of "
    "the channel's largest magnitude so far; failures last {kind}, window of 10 samples, zero drawn at 1e-18. A "
    "channel leaves round-off at the sample in which it fails and returns when the window has passed that sample."
)
GAIN_NOTE = (
    "The gains f_k are not printed; 0.9 stands for all of them here. The criterion of a failed channel is proportional "
    "to 1 - f_k at its very sample: another gain moves the curves up or down and changes no instant. Nor is it printed "
    "how long a failure lasts: both readings are shown. Where failures last, Vdot and q fail a second time at 0.40 s, "
    "from 0.9 to 0.81 of the truth."
)
MATRIX_NOTE = (
    "The paper prints A(1,5) as -2.4e-6, the test data that B, C and D are taken from have -2.04e-6, used here; with "
    "the printed value {same}. The method needs no model and does not see the difference."
)
READY_NOTE = (
    "Constant inputs leave five directions above round-off in the past data; the sixth column depends on them, and "
    "six columns take seven samples, as in the paper."
)
HEALTHY_NOTE = (
    "Condition (30) holds for none of these failures. Healthy channels stay at round-off all the same as long as the "
    "healthy rows of the past span all motion: a failed row then only adds to them. For alpha, theta and Vz, of which "
    "any two give the third, that is always so; for the others it is so because ten samples under constant inputs move "
    "in few directions. After Vdot and q fail to the end healthy channels rise to {double}, in the flight with all "
    "failures to {together}; with the elevators moving in three sines they rise to {moved} after a single failure, and "
    "to {redundant} after one of alpha, theta or Vz. At the sample of the failure itself they are at round-off always."
)
LEVEL_NOTE = (
    "A channel is flagged when its criterion passes 1e-4 of its largest magnitude, about half way, in decades, between "
    "the smallest failure and the largest healthy channel of these flights; the paper gives no threshold. Criteria are "
    "divided by that magnitude and by the root of the window's length: metres and radians then compare."
)


def hankel_b747(settings: Settings) -> Exhibit:
    """Return figure 1 with failures of one sample and to the end, in one flight and alone; it has no choices."""
    flights = {kind: fly(FAILURES, lasting=lasting) for kind, lasting in KINDS.items()}
    alone = {kind: [fly([one], lasting=lasting) for one in FAILURES] for kind, lasting in KINDS.items()}
    cases = [*flights.values(), *(case for cases in alone.values() for case in cases)]
    settings.report(1, 1)
    right = all(case.flagged == case.expected for case in cases)
    every = "Every" if right else "Not every"
    return Exhibit(
        kicker="Reproduction",
        title="Hankel null space, Boeing 747, figure 1",
        heading=f"{every} failure localised",
        verdict=f"{every} failure is flagged in its channel at its very sample; its criterion there is at least "
        f"{min(_ratios(cases)):.0e} times that of any channel without a failure inside the window.",
        facts=(
            ("Flight", "Euler, 0.01 s, from rest, engines 5 degrees, no noise"),
            ("Window", f"{WIDTH} samples, ready after {cases[0].found.ready}"),
            ("Failures", f"gain {GAIN:g}, singly and two at once"),
        ),
        tables=(comparison(_compared(flights, alone)), *_tables(flights, alone), condition_table()),
        drawings=tuple(_drawing(kind, case) for kind, case in flights.items()),
        notes=(
            GAIN_NOTE,
            MATRIX_NOTE.format(same=_with_printed()),
            READY_NOTE,
            _healthy_note(flights, alone),
            LEVEL_NOTE,
        ),
    )


def _ratios(cases: Sequence[Case]) -> list[float]:
    return [case.ratio(one) for case in cases for one in case.failures]


def _healthy_note(flights: Flights, alone: Alone) -> str:
    """Return why healthy channels stay at round-off, with what they rise to where they do not."""
    i = np.arange(N_SAMPLES)
    elevators = 0.05 * (np.sin(0.3 * i) + np.sin(0.9 * i) + np.sin(1.7 * i))
    moved = [fly([one], lasting=N_SAMPLES, elevators=elevators) for one in FAILURES]
    rise = {case.failures[0][1]: _worst(case) for case in moved}
    return HEALTHY_NOTE.format(
        double=f"{_worst(alone['to the end'][-1]):.0e}",
        together=f"{_worst(flights['to the end']):.0e}",
        moved=f"{max(level for names, level in rise.items() if len(names) == 1):.0e}",
        redundant=f"{max(rise[name,] for name in ('aoa', 'pitch', 'altitude_rate')):.0e}",
    )


def _worst(case: Case) -> float:
    """Return the largest criterion of a channel without a failure inside the window, over the last failure's window."""
    return max(case.levels(case.failures[-1], after=after)[1] for after in range(WIDTH))


def _with_printed() -> str:
    A = B747.A.copy()
    A[0, 4] = PRINTED_A15
    case = fly(FAILURES, lasting=1, model=replace(B747, A=A))
    same = case.flagged == case.expected
    outcome = "the same channels are flagged at the same samples" if same else "not all failures are found"
    return f"{outcome}, the least ratio is {min(_ratios([case])):.0e}"


def _shares(case: Case) -> list[float]:
    """Return the criteria (29) as printed over the errors, in the same units, at the failures' samples."""
    shares: list[float] = []
    for k, names in case.failures:
        printed = window_criteria(*data_matrices(case.measured, case.u, at=k, width=WIDTH))
        failed = columns(names)
        shares += list(printed[failed] / np.abs(case.measured - case.healthy)[k, failed])
    return shares


def _compared(flights: Flights, alone: Alone) -> list[tuple[str, str, str]]:
    single = [case for cases in alone.values() for case in cases[:-1]]
    double = [cases[-1] for cases in alone.values()]
    shares = [share for case in (*single, *double) for share in _shares(case)]
    least = "healthy at round-off (figure 1)"
    rows = [("samples before the criterion can be formed", "7 (example)", str(flights["one sample"].found.ready))]
    for kind, case in flights.items():
        hits = len(case.flagged & case.expected)
        text = f"{hits} of {len(case.expected)}; {len(case.flagged) - hits} other alarms"
        rows.append((f"flagged at their very sample, lasting {kind}", "all, instantly (example)", text))
    return [
        *rows,
        ("criterion over measurement error at the failure", "comparable (figure 1)", _range(shares)),
        ("failed over healthy at the sample, single", least, _range(_ratios(single))),
        ("the same, two at once", least, _range(_ratios(double))),
        ("the same, all in one flight", least, _range(_ratios(list(flights.values())))),
    ]


def _range(values: Sequence[float]) -> str:
    return f"{number(min(values), digits=2)} to {number(max(values), digits=2)}"


def _tables(flights: Flights, alone: Alone) -> tuple[Table, Table]:
    heads = ("lasting", "channel", "instant [s]", "flagged [s]", "criterion", "largest healthy", "ratio", "least later")
    together = [_row(kind, case, one) for kind, case in flights.items() for one in FAILURES]
    apart = [_row(kind, case, one) for kind, cases in alone.items() for case in cases for one in case.failures]
    later = "healthy: no failure inside the window; least later: least ratio in the next 5 samples"
    return (
        Table(name="together", title=f"All failures in one flight ({later})", heads=heads, rows=tuple(together)),
        Table(name="alone", title=f"Each failure in a flight of its own ({later})", heads=heads, rows=tuple(apart)),
    )


def _row(kind: str, case: Case, failure: Failure) -> tuple[str, ...]:
    k, names = failure
    rises = sorted({i for i, name in case.flagged if name in names and abs(i - k) <= LATER})
    low, high = case.levels(failure)
    later = min(case.ratio(failure, after=after) for after in range(1, LATER + 1))
    words = " and ".join(WORDS[name] for name in names)
    when = ", ".join(f"{i / RATE_HZ:.2f}" for i in rises) or "-"
    shown = (f"{low:.1e}", f"{high:.1e}", f"{case.ratio(failure):.0e}", f"{later:.0e}")
    return (kind, words, f"{k / RATE_HZ:.2f}", when, *shown)


def _drawing(kind: str, case: Case) -> Drawing:
    t = np.arange(N_SAMPLES) / RATE_HZ
    peaks = np.maximum.accumulate(np.abs(case.healthy), axis=0)
    errors = np.abs(case.measured - case.healthy) / np.where(peaks > 0.0, peaks, 1.0)
    above, below = _panel("error [-]", t, errors), _panel("criterion (29) [-]", t, case.found.channel)
    name = "hankel_b747" if kind == "one sample" else "hankel_b747_persistent"
    panels = (above, replace(below, levels=(("level", LEVEL),)))
    return Drawing(name=name, caption=CAPTION.format(kind=kind), panels=panels)


def _panel(label: str, t: FloatArray, values: FloatArray) -> Panel:
    shown = np.maximum(values, LEAST)
    curves = tuple(curve(WORDS[name], t, shown[:, k]) for k, name in enumerate(B747.outputs))
    return Panel(x_label="time [s]", y_label=label, curves=curves, log_y=True)
