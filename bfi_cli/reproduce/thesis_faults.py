"""The thesis's faulty records: a perturbed bias (figure 5-7) and a bias whose start is to be found (figure 5-13)."""

from __future__ import annotations

from collections.abc import Sequence

from ..config import Config, merge
from ..exhibit import Drawing, Exhibit, Panel, Span, curve
from ..faults import Fault
from ..flightlog import FlightLog, inject
from ..identify import identify_faults
from ..onset import find_onset
from ..onset.result import OnsetFault
from ..wording import interval, number
from .answer import declared, model_of, said, with_noise
from .record import stand_in, thesis_dictionary, thesis_record
from .settings import Settings, comparison

__all__ = ["thesis_5_7", "thesis_5_13"]

NOISE_M_S = 0.01
SCAN = {"conditioning.rate_hz": 10.0, "model.order": 4, "start_time.shapes": ["bias", "drift"]}
CAPTION = "The airspeed with and without the fault, and the fault alone; dotted lines mark its start."
PERTURBED = (
    "The perturbation has the frequency of the dictionary's first signal, a quarter of a period apart from it, so that "
    "no signal of the dictionary describes it. Figures 5-8 to 5-10 go on from here."
)
PUBLISHED_SCAN = (
    "The thesis solves the whole problem once for every start and takes the largest magnitude (figures 5-14 to 5-16). "
    "Ours is the start of the largest likelihood, from one factorisation, declared at a stated rate of false alarms."
)


def thesis_5_7(settings: Settings) -> Exhibit:
    """Return figure 5-7: a bias of 4 m/s with a perturbation that the dictionary lacks (kappa = 0.2).

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    log = thesis_record(settings)
    faults = _perturbed_bias(float(log.time_s[0]))
    faulty = inject(log, faults)
    noisy = with_noise(faulty, NOISE_M_S, seed=settings.seed)
    plain, answer = (identify_faults(one, thesis_dictionary(), Config()) for one in (faulty, noisy))
    rows = [
        ("fault", "4 + 0.2 cos(4.5 pi t) (5-8, 5-9)", "the same"),
        ("bias from", "13.8 s (table 5-2)", "13.8 s"),
        ("perturbation from", "12 s (figure 5-7)", "12 s"),
        ("declared by the default method", "-", declared(plain)),
        (f"  the same, noise {NOISE_M_S:g} m/s", "-", declared(answer)),
    ]
    return Exhibit(
        kicker="Reproduction",
        title="Thesis, figure 5-7: a bias with a perturbation",
        heading="Bias and perturbation",
        verdict=f"The fault as published; with {NOISE_M_S:g} m/s of noise {said(answer)}.",
        facts=(("Record", log.path), ("Model", model_of(answer))),
        tables=(comparison(rows),),
        drawings=(_drawing("thesis_5_7", log, faulty, faults),),
        notes=(PERTURBED, *stand_in(settings)),
    )


def thesis_5_13(settings: Settings) -> Exhibit:
    """Return figure 5-13: a bias of 5 m/s from 15 s, whose start is to be found.

    Raises
    ------
    LogError : the log of the settings cannot be used.
    DictionaryError : it ends before the fault.
    """
    log = thesis_record(settings)
    bias = Fault(shape="bias", magnitude=5.0, onset_s=float(log.time_s[0]) + 15.0)
    faulty = inject(log, [bias])
    scan = find_onset(with_noise(faulty, NOISE_M_S, seed=settings.seed), merge(Config(), SCAN))
    found = "; ".join(map(_found, scan.faults)) or "nothing"
    sizes = ", ".join(f"{number(one.estimate.magnitude)} {one.estimate.unit}" for one in scan.faults) or "-"
    rows = [
        ("fault", "bias of 5 m/s from 15 s (5-12)", f"bias of 5 m/s from {bias.onset_s:g} s"),
        (f"scan over all onsets, noise {NOISE_M_S:g} m/s", "figure 5-14", found),
        ("  its magnitude", "figure 5-14", sizes),
    ]
    return Exhibit(
        kicker="Reproduction",
        title="Thesis, figure 5-13: a bias whose start is not known",
        heading="Start found" if scan.faults else "Start not found",
        verdict=f"The scan over all onsets, analysed at 10 Hz, finds {found}.",
        facts=(("Record", log.path),),
        tables=(comparison(rows),),
        drawings=(_drawing("thesis_5_13", log, faulty, [bias], inputs=True),),
        notes=(PUBLISHED_SCAN, *stand_in(settings)),
    )


def _perturbed_bias(start_s: float) -> tuple[Fault, Fault]:
    bias = Fault(shape="bias", name="bias_13.8", magnitude=4.0, onset_s=start_s + 13.8)
    ripple = Fault(
        shape="cosine",
        name="perturbation",
        magnitude=0.2,
        frequency_hz=2.25,
        onset_s=start_s + 12.0,
        phase_reference="window",
    )
    return bias, ripple


def _found(one: OnsetFault) -> str:
    return f"a {one.estimate.fault.shape} from {one.estimate.fault.onset_s:.5g} s ({interval(one.onset_ci95)} s)"


def _drawing(name: str, log: FlightLog, faulty: FlightLog, faults: Sequence[Fault], *, inputs: bool = False) -> Drawing:
    time_s, true, measured = log.time_s, log.channel("tas").values, faulty.channel("tas").values
    spans = tuple(Span(label="start", low=one.onset_s, high=one.onset_s) for one in faults)
    both = (curve("true", time_s, true), curve("measured", time_s, measured, style="dashed"))
    elevator = curve("", time_s, log.channel("elevator").values)
    first = (Panel(x_label="time [s]", y_label="elevator [rad]", curves=(elevator,)),) if inputs else ()
    panels = (
        *first,
        Panel(x_label="time [s]", y_label="tas [m/s]", curves=both, spans=spans),
        Panel(x_label="time [s]", y_label="fault [m/s]", curves=(curve("", time_s, measured - true),), spans=spans),
    )
    return Drawing(name=name, caption=CAPTION, panels=panels)
