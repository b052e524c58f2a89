"""Faults of air data from first principles, for whole flights: nothing of the package makes them, so that it is tested.

Pressures follow from cas, altitude and total temperature in the troposphere of the standard atmosphere; the fault acts
on pressures, probe or channel; the differences pass the recorder's low-pass and are added to the recorded channels. A
line that is trapped gets the noise of a transducer and the steps of the air-data computer before the recorder.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Channels = dict[str, FloatArray]

GAMMA, GAS, G0 = 1.4, 287.053, 9.80665
P0, T0, LAPSE = 101_325.0, 288.15, 0.0065
A0 = float(np.sqrt(GAMMA * GAS * T0))
# Of the recorded flights, before their low-pass: 1/16 kt and 1 ft; 1 Pa is a usual transducer's noise.
CAS_STEP, ALTITUDE_STEP, NOISE_PA = 0.514444 / 16.0, 0.3048, 1.0
# An aircraft with a pressurised cabin keeps it about so much above the outside.
CABIN_PA = (8_000.0, 20_000.0)
AIR = ("tas", "cas", "mach", "altitude", "altitude_rate", "sat", "tat", "p_static", "p_total", "q_impact")


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What was put in: the name it should get, where, and the size of the course, None where it has none.

    `magnitude` of what grows is its slope, for `grows_s`.
    """

    fault: str
    shape: str | None
    onset_s: float
    offset_s: float | None
    magnitude: float | None
    about: str
    grows_s: float | None = None


def static_pressure(altitude: FloatArray) -> FloatArray:
    """Return the pressure of the standard troposphere, Pa."""
    return P0 * (1.0 - LAPSE * altitude / T0) ** (G0 / (LAPSE * GAS))


def altitude_at(p_static: FloatArray) -> FloatArray:
    """Return the pressure altitude, m."""
    return T0 / LAPSE * (1.0 - (p_static / P0) ** (LAPSE * GAS / G0))


def impact_pressure(cas: FloatArray) -> FloatArray:
    """Return qc of a calibrated airspeed, Pa."""
    return P0 * ((1.0 + 0.2 * (cas / A0) ** 2) ** 3.5 - 1.0)


def computed(p_static: FloatArray, q_impact: FloatArray, tat: FloatArray, step_s: float) -> Channels:
    """Return the channels that an air-data computer makes of two pressures and a total temperature."""
    q = np.maximum(q_impact, 0.0)
    mach = np.sqrt(5.0 * ((q / p_static + 1.0) ** (2.0 / 7.0) - 1.0))
    sat = tat / (1.0 + 0.2 * mach**2)
    altitude = altitude_at(p_static)
    return {
        "tas": mach * np.sqrt(GAMMA * GAS * sat),
        "cas": A0 * np.sqrt(5.0 * ((q / P0 + 1.0) ** (2.0 / 7.0) - 1.0)),
        "mach": mach,
        "altitude": altitude,
        "altitude_rate": np.gradient(altitude, step_s),
        "sat": sat,
        "tat": tat,
        "p_static": p_static,
        "p_total": p_static + q,
        "q_impact": q,
    }


Low = Callable[[FloatArray], FloatArray]
Maker = Callable[[Channels, FloatArray, NDArray[np.bool_], np.random.Generator, Low], tuple[Channels, Truth]]


def _air(
    channels: Mapping[str, FloatArray],
    time_s: FloatArray,
    p_static: FloatArray,
    q_impact: FloatArray,
    tat: FloatArray,
    low: Low,
) -> Channels:
    """Return the recorded channels with what changed pressures and probe make of them."""
    step_s = float(np.median(np.diff(time_s)))
    before = computed(static_pressure(channels["altitude"]), impact_pressure(channels["cas"]), channels["tat"], step_s)
    after = computed(p_static, q_impact, tat, step_s)
    return {name: channels[name] + low(after[name] - before[name]) for name in AIR if name in channels}


def _span(onset_s: float, time_s: FloatArray, rng: np.random.Generator, lasts_s: tuple[float, float]) -> float | None:
    """Return when a fault ends: in half of the trials it lasts."""
    end_s = onset_s + float(rng.uniform(*lasts_s))
    return end_s if rng.random() < 0.5 and end_s < time_s[-1] - 60.0 else None


def _on(time_s: FloatArray, onset_s: float, offset_s: float | None) -> NDArray[np.bool_]:
    return (time_s >= onset_s) & (time_s < (np.inf if offset_s is None else offset_s))


def blocked(line: str) -> Maker:
    """Return the maker of a line that traps its pressure for 90 to 400 s."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        onset_s = drawn_onset(time_s, free, rng)
        offset_s = onset_s + float(rng.uniform(90.0, 400.0))
        on = _on(time_s, onset_s, offset_s)
        ps, qc = static_pressure(channels["altitude"]), impact_pressure(channels["cas"])
        pt, first = ps + qc, int(np.argmax(on))
        if line == "static":
            ps = np.where(on, ps[first], ps)
        else:
            pt = np.where(on, pt[first], pt)
        noisy = NOISE_PA * rng.standard_normal((2, len(time_s))) * on
        ps, pt = ps + noisy[0], pt + noisy[1]
        changed = _air(channels, time_s, ps, np.maximum(pt - ps, 0.0), channels["tat"], low)
        # The steps of the computer are made anew where the line is trapped, as the recorded ones are of the free line.
        step_s = float(np.median(np.diff(time_s)))
        made = computed(ps, np.maximum(pt - ps, 0.0), channels["tat"], step_s)
        stored = {
            "cas": np.round(made["cas"] / CAS_STEP) * CAS_STEP,
            "altitude": np.round(made["altitude"] / ALTITUDE_STEP) * ALTITUDE_STEP,
        }
        for name, values in stored.items():
            changed[name] = np.where(on, low(np.where(on, values, channels[name])), changed[name])
        name = f"{'static' if line == 'static' else 'pitot'}_blocked"
        return changed, Truth(fault=name, shape=None, onset_s=onset_s, offset_s=offset_s, magnitude=None, about="")

    return make


def leak(line: str, share: tuple[float, float], slow_s: tuple[float, float]) -> Maker:
    """Return the maker of a leak: pt to ps, or ps to the cabin, by a share of the difference with a time constant."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        onset_s = drawn_onset(time_s, free, rng)
        offset_s = _span(onset_s, time_s, rng, (150.0, 400.0))
        k, constant_s = float(rng.uniform(*share)), float(rng.uniform(*slow_s))
        on = _on(time_s, onset_s, offset_s)
        grown = k * np.where(on, -np.expm1(-np.maximum(time_s - onset_s, 0.0) / constant_s), 0.0)
        ps, qc = static_pressure(channels["altitude"]), impact_pressure(channels["cas"])
        pt = ps + qc
        if line == "static":
            # The controller holds the cabin: its pressure is what it was at the onset, never below the outside.
            cabin = np.maximum(ps[int(np.argmax(on))] + float(rng.uniform(*CABIN_PA)), ps)
            ps = ps + grown * (cabin - ps)
        else:
            pt = pt - grown * qc
        changed = _air(channels, time_s, ps, np.maximum(pt - ps, 0.0), channels["tat"], low)
        name = f"{line}_leak"
        about = f"k {k:.2f}, T {constant_s:.0f} s"
        return changed, Truth(fault=name, shape=None, onset_s=onset_s, offset_s=offset_s, magnitude=None, about=about)

    return make


def icing(rate: tuple[float, float]) -> Maker:
    """Return the maker of a loss of impact pressure that grows to 25 to 50 % and stays."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        onset_s = drawn_onset(time_s, free, rng)
        speed, most = float(np.exp(rng.uniform(*np.log(rate)))), float(rng.uniform(0.25, 0.5))
        lost = np.clip(speed * (time_s - onset_s), 0.0, most)
        ps, qc = static_pressure(channels["altitude"]), impact_pressure(channels["cas"])
        changed = _air(channels, time_s, ps, (1.0 - lost) * qc, channels["tat"], low)
        return changed, Truth(
            fault="pitot_icing",
            shape=None,
            onset_s=onset_s,
            offset_s=None,
            magnitude=speed,
            about=f"{100 * speed:.2f} %/s to {most:.0%}",
            grows_s=most / speed,
        )

    return make


def probe() -> Maker:
    """Return the maker of a total-temperature probe that is off, with all that the computer makes of it."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        onset_s = drawn_onset(time_s, free, rng)
        offset_s = _span(onset_s, time_s, rng, (150.0, 400.0))
        size = float(rng.choice([-1.0, 1.0]) * rng.uniform(4.0, 8.0))
        off = size * _on(time_s, onset_s, offset_s)
        ps, qc = static_pressure(channels["altitude"]), impact_pressure(channels["cas"])
        changed = _air(channels, time_s, ps, qc, channels["tat"] + off, low)
        return changed, Truth(
            fault="tat",
            shape="bias",
            onset_s=onset_s,
            offset_s=offset_s,
            magnitude=size,
            about=f"{size:.1f} K",
        )

    return make


def course(channel: str, shape: str, size: tuple[float, float]) -> Maker:
    """Return the maker of a step, or of a drift for 40 to 90 s that then stays, of one channel."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        onset_s = drawn_onset(time_s, free, rng)
        magnitude = float(rng.choice([-1.0, 1.0]) * rng.uniform(*size))
        offset_s = _span(onset_s, time_s, rng, (150.0, 400.0))
        since = np.where(_on(time_s, onset_s, offset_s), time_s - onset_s, 0.0)
        grows_s = float(rng.uniform(40.0, 90.0))
        unit = np.minimum(since, grows_s) if shape == "drift" else (since > 0.0).astype(float)
        about = f"{magnitude:.3g}" + (f"/s for {grows_s:.0f} s" if shape == "drift" else "")
        changed = {channel: channels[channel] + low(magnitude * unit)}
        return changed, Truth(
            fault=channel,
            shape=None,
            onset_s=onset_s,
            offset_s=offset_s,
            magnitude=magnitude,
            about=about,
            grows_s=grows_s if shape == "drift" else None,
        )

    return make


def swinging(channel: str, amplitude: tuple[float, float], frequency_hz: tuple[float, float]) -> Maker:
    """Return the maker of an airspeed that swings, of the impact pressure for "", by amplitudes of TAS in m/s."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        onset_s = drawn_onset(time_s, free, rng)
        offset_s = _span(onset_s, time_s, rng, (250.0, 500.0))
        size, hertz = float(rng.uniform(*amplitude)), float(rng.uniform(*frequency_hz))
        phase = float(rng.uniform(0.0, 2.0 * np.pi))
        on = _on(time_s, onset_s, offset_s)
        wave = size * np.sin(2.0 * np.pi * hertz * (time_s - onset_s) + phase) * on
        if channel:
            changed = {channel: channels[channel] + low(wave)}
        else:
            cas = channels["cas"] + wave * channels["cas"] / np.maximum(channels["tas"], 1.0)
            p_static = static_pressure(channels["altitude"])
            sharp = _air(channels, time_s, p_static, impact_pressure(cas), channels["tat"], np.asarray)
            size *= float(np.nanstd((sharp["tas"] - channels["tas"])[on]) / np.std(wave[on]))
            changed = _air(channels, time_s, p_static, impact_pressure(cas), channels["tat"], low)
        return changed, Truth(
            fault=channel or "pitot_water",
            shape="sine",
            onset_s=onset_s,
            offset_s=offset_s,
            magnitude=size,
            about=f"{size:.3g} at {hertz:.3g} Hz",
        )

    return make


def frozen(channel: str, lasts_s: tuple[float, float]) -> Maker:
    """Return the maker of a channel that keeps its value for a while."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        onset_s = drawn_onset(time_s, free, rng)
        offset_s = onset_s + float(rng.uniform(*lasts_s))
        on, values = _on(time_s, onset_s, offset_s), channels[channel]
        held = np.where(on, values[int(np.argmax(on))], values)
        stuck = values + low(held - values)
        stuck[_on(time_s, onset_s + 1.5, offset_s - 1.5)] = held[int(np.argmax(on))]
        changed = {channel: stuck}
        return changed, Truth(
            fault=channel,
            shape="frozen",
            onset_s=onset_s,
            offset_s=offset_s,
            magnitude=None,
            about=f"{offset_s - onset_s:.0f} s",
        )

    return make


def short(channel: str, shape: str, n: int) -> Maker:
    """Return the maker of dropouts to zero for 1 to 3 s, or of spikes of 10 to 40 of 0.1 to 0.3 s, at random times."""

    def make(
        channels: Channels, time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator, low: Low
    ) -> tuple[Channels, Truth]:
        values = channels[channel]
        delta = np.zeros_like(values)
        onsets = sorted(drawn_onset(time_s, free, rng) for _ in range(n))
        for onset_s in onsets:
            lasts_s = rng.uniform(1.0, 3.0) if shape == "dropout" else rng.uniform(0.1, 0.3)
            on = _on(time_s, onset_s, onset_s + float(lasts_s))
            size = -values if shape == "dropout" else rng.choice([-1.0, 1.0]) * rng.uniform(10.0, 40.0)
            delta = np.where(on, size, delta)
        return {channel: values + low(delta)}, Truth(
            fault=channel,
            shape=shape,
            onset_s=onsets[0],
            offset_s=None,
            magnitude=None,
            about=f"{n}",
        )

    return make


def drawn_onset(time_s: FloatArray, free: NDArray[np.bool_], rng: np.random.Generator) -> float:
    """Return a moment at which a fault may begin, between samples too."""
    step_s = float(np.median(np.diff(time_s)))
    return float(rng.choice(time_s[free]) + rng.uniform(0.0, step_s))


KINDS: Mapping[str, Maker] = {
    "pitot_blocked": blocked("pitot"),
    "static_blocked": blocked("static"),
    "pitot_leak": leak("pitot", (1.0, 1.0), (2.0, 30.0)),
    "static_leak": leak("static", (1.0, 1.0), (2.0, 20.0)),
    "static_leak partial": leak("static", (0.03, 0.2), (2.0, 20.0)),
    "pitot_icing": icing((0.0025, 0.01)),
    "tas step": course("tas", "bias", (3.0, 8.0)),
    "tas drift": course("tas", "drift", (0.08, 0.25)),
    "aoa step": course("aoa", "bias", (0.02, 0.05)),
    "aoa drift": course("aoa", "drift", (0.0004, 0.0010)),
    "aoa frozen": frozen("aoa", (60.0, 300.0)),
    "probe": probe(),
    "tas dropout": short("tas", "dropout", 5),
    "tas spikes": short("tas", "spikes", 8),
    "tas frozen": frozen("tas", (5.0, 15.0)),
}
