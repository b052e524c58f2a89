"""The JSON document and the CSV tables of `bfi start-time`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..faults import fault_to_dict
from ..plain import to_plain
from ..provenance import Provenance
from ..serialize import to_csv
from .result import OnsetResult

__all__ = ["SCHEMA", "onset_document", "onset_tables"]

SCHEMA = 1
KEYS = ("shape", "channel", "onset_s", "offset_s", "frequency_hz", "phase_rad", "time_constant_s", "duration_s", "file")
PROFILE_KEYS = ("shape", "channel", "frequency_hz", "threshold", "unit")
FAULT_COLUMNS = (
    *("shape", "channel", "magnitude", "unit", "sd", "ci95_low", "ci95_high", "physical_value", "physical_unit"),
    *("onset_s", "onset_low_s", "onset_high_s", "offset_s", "frequency_hz", "statistic", "p_value"),
)


def onset_document(result: OnsetResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi start-time --json`; numbers that are not finite are None.

    `profile` has one entry per shape, and channel where there are several, in each of its lists but `onset_s`.
    """
    shapes, onset_s = result.profiles, [one.onset_s for one in result.profiles]
    # Each shape has onsets of its own only where the search for ends made them differ.
    same = all(np.array_equal(one, onset_s[0]) for one in onset_s)
    document: dict[str, Any] = to_plain(
        {
            "kind": "start-time",
            "schema": SCHEMA,
            "log": result.log,
            "decision": result.decision,
            "false_alarm": result.false_alarm,
            "p_value": result.p_value,
            "statistic": result.statistic,
            "threshold": result.threshold,
            "calibration": result.calibration,
            "faults": [
                {
                    **{key: getattr(one.estimate.fault, key) for key in KEYS},
                    "name": one.estimate.name,
                    "phase_rad": one.estimate.fault.phase_rad if one.estimate.fault.shape == "sine" else None,
                    "magnitude": one.estimate.magnitude,
                    "unit": one.estimate.unit,
                    "physical": {"value": one.estimate.physical_value, "unit": one.estimate.physical_unit},
                    "sd": one.estimate.sd,
                    "ci95": _known(one.estimate.ci95),
                    "onset_ci95": _known(one.onset_ci95),
                    "statistic": one.statistic,
                    "p_value": one.p_value,
                }
                for one in result.faults
            ],
            "model": result.model,
            "method": result.method,
            "profile": {
                **{key: [getattr(one, key) for one in shapes] for key in PROFILE_KEYS},
                "onset_s": onset_s[0] if same else onset_s,
                **{key: [getattr(one, key) for one in shapes] for key in ("statistic", "magnitude", "sd")},
            },
            "series": {"time_s": result.time_s, "outputs": result.series},
            "truth": result.truth and [fault_to_dict(fault) for fault in result.truth],
            "notes": result.notes,
            "provenance": provenance,
        }
    )
    return document


def _known(ends: tuple[float, float]) -> tuple[float, float] | None:
    """Return an interval, None where its ends are not numbers."""
    return ends if math.isfinite(ends[0] + ends[1]) else None


def onset_tables(result: OnsetResult) -> dict[str, bytes]:
    """Return the CSV files of the faults and of the profiles, by file name."""
    rows = []
    for one in result.faults:
        estimate, fault = one.estimate, one.estimate.fault
        size = (estimate.magnitude, estimate.unit, estimate.sd, *estimate.ci95)
        when = (fault.onset_s, *one.onset_ci95, fault.offset_s, fault.frequency_hz)
        physical = (estimate.physical_value, estimate.physical_unit)
        rows.append((fault.shape, fault.channel, *size, *physical, *when, one.statistic, one.p_value))
    points = (
        (one.shape, one.channel, *point)
        for one in result.profiles
        for point in zip(*(x.tolist() for x in (one.onset_s, one.statistic, one.magnitude, one.sd)), strict=True)
    )
    heads = ("shape", "channel", "onset_s", "statistic", "magnitude", "sd")
    return {"faults.csv": to_csv(FAULT_COLUMNS, rows), "profile.csv": to_csv(heads, points)}
