"""The thesis's data: its record (figure 5-1) and its dictionary (figure 5-2)."""

from __future__ import annotations

from collections.abc import Mapping

from ..config import Config
from ..dictionary import Dictionary, signals
from ..exhibit import Drawing, Exhibit, Panel, Table, curve
from ..flightlog import FlightLog
from ..identify import identify_faults
from ..wording import number, quantity
from .answer import declared, model_of, said, with_noise
from .record import stand_in, thesis_dictionary, thesis_record
from .settings import Settings, comparison

__all__ = ["thesis_5_1", "thesis_5_2"]

NOISE_M_S = 0.01
STARTS = (0.2, 13.8, 6.35, 10.58, 5.3, 7.93, 6.35)
EXPRESSIONS = ("sin(4.5 pi t)", "1", "sin(2.3 pi t)", "cos(2.25 pi t)", "sin(0.7 pi t)", "0.23 t", "1")
RECORD_CAPTION = "Elevator and true airspeed of the record that all reproductions of the thesis start from."
DICTIONARY_CAPTION = "The seven dictionary signals at magnitude 1 along the record."
DICTIONARY_NOTES = (
    "Table 5-2 prints 5.3 s for the fifth signal; the listing rounds 3172 / 6 samples up, which is 5.29 s. The table "
    "calls the fourth a sine, and its expression is a cosine.",
    "Table 5-2 prints 0.23 t for the drift; the listing counts that time from the start of the drift, and so do we. "
    "The oscillations run on the record's own time and are only switched on at their start.",
    "The thesis does not say how small a fault may be and still be found; the last column is ours, from the standard "
    "deviation of each magnitude on this record with white noise added.",
)


def thesis_5_1(settings: Settings) -> Exhibit:
    """Return figure 5-1: the control input and the airspeed.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    """
    log = thesis_record(settings)
    answer = identify_faults(log, thesis_dictionary(), Config())
    rows = [
        ("input, output", "elevator [rad], true airspeed [m/s] (table 5-1)", "the same"),
        ("samples", "3172 (table 5-1)", str(log.n_samples)),
        ("sampling interval", "0.01 s (table 5-1)", f"{1.0 / log.rate_hz:g} s"),
        ("altitude, condition", "about 5200 m, cruise (table 5-1)", "as flown" if settings.log else "trim at 5000 m"),
        ("airspeed, smallest and largest", "-", _range(log, "tas", "m/s")),
        ("elevator, smallest and largest", "-", _range(log, "elevator", "rad")),
        ("faults declared in it by the default method", "none, by assumption (5-2)", declared(answer)),
    ]
    return Exhibit(
        kicker="Reproduction",
        title="Thesis, figure 5-1: flight data",
        heading="Another record" if settings.log else "A simulated stand-in",
        verdict=f"{log.n_samples} samples at {log.rate_hz:g} Hz of elevator and airspeed; {said(answer)}.",
        facts=(("Record", log.path),),
        tables=(comparison(rows),),
        drawings=(
            Drawing(
                name="thesis_5_1",
                caption=RECORD_CAPTION,
                panels=(_panel(log, "elevator", "rad"), _panel(log, "tas", "m/s")),
            ),
        ),
        notes=(*stand_in(settings), *log.notes),
    )


def thesis_5_2(settings: Settings) -> Exhibit:
    """Return figure 5-2: the signals of the dictionary, with the smallest magnitude of each that could be found.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    """
    log, dictionary = thesis_record(settings), thesis_dictionary()
    answer = identify_faults(with_noise(log, NOISE_M_S, seed=settings.seed), dictionary, Config())
    smallest = {one.name: quantity(one.minimal_detectable, one.unit) for one in answer.candidates}
    rows = [
        (f"theta {i + 1}, {EXPRESSIONS[i]}, from", f"{STARTS[i]:g} s (table 5-2)", f"{atom.onset_s:g} s")
        for i, atom in enumerate(dictionary.atoms)
    ]
    return Exhibit(
        kicker="Reproduction",
        title="Thesis, figure 5-2: the fault dictionary",
        heading="Seven signals",
        verdict=f"As table 5-2; with {NOISE_M_S:g} m/s of noise a bias from 13.8 s would be found from "
        f"{smallest['bias_13.8']} on, 0.23 t from 7.93 s from a magnitude of {smallest['drift_7.93']} on.",
        facts=(("Record", log.path), ("Model", model_of(answer))),
        tables=(comparison(rows), _signals(dictionary, smallest)),
        drawings=(_dictionary_drawing(log, dictionary),),
        notes=(*DICTIONARY_NOTES, *stand_in(settings)),
    )


def _signals(dictionary: Dictionary, smallest: Mapping[str, str]) -> Table:
    heads = ("signal", "name", "expression", f"smallest magnitude found in 90 %, noise {NOISE_M_S:g} m/s")
    names = [str(atom.name) for atom in dictionary.atoms]
    rows = tuple((f"theta {i + 1}", name, EXPRESSIONS[i], smallest[name]) for i, name in enumerate(names))
    return Table(name="signals", title="Signals", heads=heads, rows=rows)


def _dictionary_drawing(log: FlightLog, dictionary: Dictionary) -> Drawing:
    start_s = float(log.time_s[0])
    theta = signals(dictionary.resolved(start_s), log.time_s, ["tas"], window_start_s=start_s)[:, 0]
    panels = tuple(
        Panel(title=f"theta {i + 1}", x_label="time [s]", y_label="[-]", curves=(curve("", log.time_s, theta[:, i]),))
        for i in range(theta.shape[1])
    )
    return Drawing(name="thesis_5_2", caption=DICTIONARY_CAPTION, panels=panels, across=2)


def _panel(log: FlightLog, name: str, unit: str) -> Panel:
    return Panel(
        x_label="time [s]", y_label=f"{name} [{unit}]", curves=(curve("", log.time_s, log.channel(name).values),)
    )


def _range(log: FlightLog, name: str, unit: str) -> str:
    values = log.channel(name).values
    return f"{number(float(values.min()))} and {number(float(values.max()))} {unit}"
