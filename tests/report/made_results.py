"""Results made by hand, with the shapes and sizes of real ones but without any computation behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bfi_cli.decision import KINDS, Candidate, verdicts_of
from bfi_cli.decision.conclude import summarise
from bfi_cli.faults import Fault, FaultEstimate
from bfi_cli.faults.fault import Comparison
from bfi_cli.model.result import (
    IdentifyResult,
    LogSummary,
    ModelSummary,
    OutputSeries,
    ResidualSummary,
    ScanSummary,
    SolverSummary,
)
from bfi_cli.notes import Note
from bfi_cli.serialization import Provenance

ONSET_S = 13.8
ORDER = 4
PLAIN_SD = 0.021

PROVENANCE = Provenance(
    version="0.1.0",
    log_sha256="5f" * 32,
    config_sha256=None,
    dictionary_sha256="a7" * 32,
    seed=0,
    numpy="2.0.0",
    scipy="1.14.0",
    command="bfi identify flight.csv --dictionary faults.yaml --out result",
    date="2024-05-17T09:30:00+00:00",
)


def fault_result(*, n_samples: int = 317, rate_hz: float = 10.0, channel: str = "tas") -> IdentifyResult:
    """One bias of 4 m/s on one airspeed, whose truth is known."""
    time_s = np.arange(n_samples) / rate_hz
    outputs = (_output(channel, "m/s", time_s, 4.0),)
    return _result(
        time_s, outputs, (_bias(channel), *_others(channel)), faults=(_estimate(channel),), truth=_truth(channel)
    )


def two_output_result() -> IdentifyResult:
    """A bias on the airspeed and none on the altitude rate; nothing is known about the truth."""
    time_s = 100.0 + np.arange(317) / 10.0
    outputs = (
        replace(_output("tas", "m/s", time_s, 4.0, onset_s=100.0 + ONSET_S), true_fault=None),
        replace(_output("altitude_rate", "m/s", time_s, 0.0, seed=3), true_fault=None),
    )
    estimate = _estimate("tas")
    estimate = replace(estimate, fault=replace(estimate.fault, onset_s=100.0 + ONSET_S, offset_s=125.0))
    sine = replace(
        estimate,
        name="sine_altitude_rate_13.8",
        fault=Fault(shape="sine", channel="altitude_rate", onset_s=113.8, frequency_hz=1.15, phase_reference="window"),
    )
    candidates = (_bias("tas"), replace(_bias("altitude_rate"), name=sine.name), *_others("altitude_rate"))
    return _result(time_s, outputs, candidates, faults=(estimate, sine), truth=None)


def no_fault_result() -> IdentifyResult:
    """Nothing found; the truth says there is nothing."""
    time_s = np.arange(317) / 10.0
    quiet = replace(
        _bias("tas"), state="excluded", magnitude=0.004, sd=0.007, excluded_above=0.033, effect=0.033, tolerance=2.6
    )
    truth = Comparison(isolated=True, false_alarms=(), missed=(), magnitude_error=None, vaf_fault={"tas": None})
    return _result(time_s, (_output("tas", "m/s", time_s, 0.0),), (quiet, *_others("tas")), faults=(), truth=truth)


def inconclusive_result() -> IdentifyResult:
    """A log without a manoeuvre: an order alone, numbers that are not finite."""
    made = no_fault_result()
    unknown = replace(
        _bias("tas"), state="not_seen", magnitude=None, sd=None, minimal_detectable=np.inf, note="constant"
    )
    note = "flight.csv: 'elevator' hardly moves (range 0.0004 rad); the dynamics cannot be told from a drift"
    return replace(
        made,
        decision="inconclusive",
        verdicts=verdicts_of((unknown,)),
        summary=summarise(verdicts_of((unknown,)), (unknown,)),
        candidates=(unknown,),
        notes=(Note.limit(note), Note.limit("the condition number of the regressors is 3e+16")),
        model=replace(made.model, orders=(), criterion_no_fault=(), criterion_best=()),
        solver=replace(made.solver, condition_number=np.inf, termination="rank lost"),
        truth=None,
    )


def _result(time_s, outputs, candidates, *, faults, truth):
    channels = tuple(series.channel for series in outputs)
    return IdentifyResult(
        log=LogSummary(
            path="flight.csv",
            rate_hz=10.0,
            n_samples=time_s.size,
            start_s=float(time_s[0]),
            stop_s=float(time_s[-1]),
            native_rate_hz=100.0,
        ),
        decision="fault" if faults else "no_fault",
        verdicts=verdicts_of(candidates),
        summary=summarise(verdicts_of(candidates), candidates),
        scan=ScanSummary(decision=None, verdicts=dict.fromkeys(KINDS, "inconclusive"), faults=(), note="not scanned"),
        faults=faults,
        candidates=candidates,
        model=ModelSummary(
            order=ORDER,
            rate_hz=10.0,
            feedthrough=True,
            inputs=("elevator",),
            outputs=channels,
            noise_sd=dict.fromkeys(channels, 0.02),
            orders=(2, 4, 6, 8, 12),
            criterion_no_fault=(-1210.0, -1350.0, -1345.0, -1338.0, -1310.0),
            criterion_best=(-2300.0, -2411.0, -2405.0, -2398.0, -2371.0)
            if faults
            else (-1209.0, -1348.0, -1341.0, -1331.0, -1305.0),
        ),
        vaf_output=dict.fromkeys(channels, 99.99),
        solver=SolverSummary(method="ml", termination="converged", iterations=6, condition_number=812.0),
        notes=(Note.method("the log was decimated from 100 Hz to 10 Hz"),),
        time_s=time_s,
        inputs={"elevator": _three_two_one_one(time_s)},
        input_units={"elevator": "rad"},
        outputs=outputs,
        residuals=tuple(_residual(series, time_s) for series in outputs),
        truth=truth,
    )


def _three_two_one_one(time_s):
    since = time_s - time_s[0]
    level = np.zeros_like(since)
    for start, stop, value in (
        (2, 5, 0.03),
        (5, 7, -0.03),
        (7, 8, 0.03),
        (8, 9, -0.03),
        (20, 23, -0.02),
        (23, 25, 0.02),
    ):
        level[(since >= start) & (since < stop)] = value
    return level


def _output(channel, unit, time_s, magnitude, *, onset_s=ONSET_S, seed=1):
    rng = np.random.default_rng(seed)
    since = time_s - time_s[0]
    noise = 0.02 * rng.standard_normal(time_s.size)
    clean = 85.0 + 3.0 * np.sin(0.25 * since) * np.exp(-since / 30.0) + noise
    true_fault = magnitude * (time_s >= onset_s)
    fault = 1.0007 * true_fault
    first = np.arange(time_s.size) < ORDER
    error = np.where(first, np.nan, noise)
    plain = error + np.convolve(np.diff(true_fault, prepend=0.0), [1.0, -0.9, 0.2, 0.1])[: time_s.size] * 0.9
    return OutputSeries(
        channel=channel,
        unit=unit,
        measured=clean + true_fault,
        fault=fault,
        fault_sd=0.05 * (true_fault != 0.0),
        prediction_error=error,
        plain_residual=plain,
        true_fault=true_fault,
    )


def _residual(series, time_s):
    error = series.prediction_error[ORDER:]
    error = error - error.mean()
    lags = tuple(range(1, 21))
    scale = float(error @ error)
    return ResidualSummary(
        channel=series.channel,
        lags=lags,
        autocorrelation=tuple(float(error[lag:] @ error[:-lag]) / scale for lag in lags),
        band=1.96 / float(np.sqrt(error.size)),
        ljung_box_p=0.41,
        plain_alarms_s=tuple(time_s[np.abs(series.plain_residual) > 5.0 * PLAIN_SD].tolist()),
        plain_sd=PLAIN_SD,
    )


def _estimate(channel):
    return FaultEstimate(
        name="bias_13.8",
        fault=Fault(shape="bias", channel=channel, onset_s=ONSET_S, name="bias_13.8"),
        magnitude=4.003,
        unit="m/s",
        physical_value=4.003,
        physical_unit="m/s",
        sd=0.007,
        ci95=(3.989, 4.017),
    )


def _bias(channel):
    return Candidate(
        name="bias_13.8",
        shape="bias",
        channel=channel,
        kind="abrupt",
        state="declared",
        magnitude=4.003,
        unit="m/s",
        sd=0.007,
        minimal_detectable=0.033,
        channel_unit="m/s",
    )


def _others(channel):
    told = {"channel": channel, "state": "excluded", "tolerance": 2.6, "channel_unit": "m/s"}
    wave = {**told, "kind": "oscillating", "unit": "m/s", "sd": 0.006, "minimal_detectable": 0.028}
    drift = {**told, "state": "not_seen", "kind": "slow", "unit": "", "sd": 0.14, "minimal_detectable": 0.67}
    drift |= {"physical_scale": 0.23, "physical_unit": "m/s^2"}
    limit = {"excluded_above": 0.03, "effect": 0.03}
    return (
        Candidate(name="drift_7.93", shape="drift", magnitude=0.11, excluded_above=0.8, effect=4.4, **drift),
        Candidate(name="sine_1.15", shape="sine", magnitude=-0.012, **wave, **limit),
        Candidate(name="cos_1.125", shape="cosine", magnitude=0.0014, **wave, **limit),
        Candidate(
            name="bias_40",
            shape="bias",
            channel=channel,
            kind="abrupt",
            state=None,
            magnitude=None,
            unit="m/s",
            sd=None,
            note="left out: it starts at 40 s, after the window ends (31.7 s)",
        ),
    )


def _truth(channel):
    return Comparison(isolated=True, false_alarms=(), missed=(), magnitude_error=0.00075, vaf_fault={channel: 99.998})
