"""Faults of a pressure line as a recorder would store them: transducer noise, quantisation and low-pass made anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bfi_cli.airdata import air_data_of, altitude_of, calibrated_airspeed
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import response_of
from bfi_cli.flightlog import FlightLog, inject
from bfi_cli.flightlog.record import frozen_array

# Of the recorded flights, before their low-pass: 1/16 kt and 1 ft.
CAS_STEP, ALTITUDE_STEP = 0.514444 / 16.0, 0.3048


def recorded_anew(log: FlightLog, fault: Fault, *, noise_pa: float, rng: np.random.Generator) -> FlightLog:
    """Return a log with a blocked or leaking line whose cas and altitude were quantised and low-passed after the fault.

    `bfi inject` adds differences, so that a trapped line there is stiller than any transducer.
    """
    faulty = inject(log, [fault])
    on = (log.time_s >= fault.onset_s) & (log.time_s < (np.inf if fault.offset_s is None else fault.offset_s))
    air = air_data_of({name: log.channels[name].values for name in ("altitude", "cas")})
    p_static, p_total = np.array(air.p_static), np.array(air.p_total)
    first = int(np.argmax(on))
    if fault.shape == "static_blocked":
        p_static[on] = p_static[first]
    elif fault.shape == "pitot_blocked":
        p_total[on] = p_total[first]
    else:
        left = np.exp(-(log.time_s[on] - fault.onset_s) / fault.time_constant_s)
        p_total[on] = p_static[on] + left * (p_total[on] - p_static[on])
    p_static += noise_pa * rng.standard_normal(len(on))
    p_total += noise_pa * rng.standard_normal(len(on))
    altitude = np.round(altitude_of(p_static) / ALTITUDE_STEP) * ALTITUDE_STEP
    cas = np.round(calibrated_airspeed(np.maximum(p_total - p_static, 0.0)) / CAS_STEP) * CAS_STEP
    through, channels = response_of(log.filters or (), log.rate_hz), dict(faulty.channels)
    for name, values in (("altitude", altitude), ("cas", cas)):
        stored = through.filtered(np.pad(values, (through.after, through.before), mode="edge"))
        made = np.where(on, stored, log.channels[name].values)
        channels[name] = replace(channels[name], values=frozen_array(made))
    return replace(faulty, channels=channels)
