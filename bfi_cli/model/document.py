"""The JSON documents of the contract: results to plain data, and back to redraw a stored result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..decision.limits import with_plain_proofs, with_proof_entries
from ..errors import ConfigError
from ..notes import Note
from ..provenance import Provenance
from ..report.faults import fault_entry, plain_estimate
from ..report.first_screen import window_screen
from ..serialization import document_of, document_of_kind, from_plain, mapping, member, to_plain
from .result import IdentifyResult

# Samples of the series of a document, more than any figure shows: 80 minutes at 10 Hz. Chosen for its size, 10 MB.
MOST_SAMPLES = 50_000
GIVE = "give the result.json of bfi identify --out"
# Series of an output that the document has beside those it is made of.
DERIVED = ("corrected", "predicted")
ORDER_KEYS = ("orders", "criterion_no_fault", "criterion_best")


def identify_document(result: IdentifyResult, provenance: Provenance) -> dict[str, Any]:
    """Return the document of `bfi identify --json`; numbers that are not finite are None.

    `order_selection`, `residuals`, `truth` and `series` hold what the figures of the report are drawn from; of a very
    long record `series` has every k-th sample.
    """
    thinned = _thinned(result)
    whole = to_plain(thinned)
    whole["outputs"] = [
        {**entry, **{key: to_plain(getattr(series, key)) for key in DERIVED}}
        for entry, series in zip(whole["outputs"], thinned.outputs, strict=True)
    ]
    truth = whole["truth"]
    vaf_fault = None if truth is None else truth.pop("vaf_fault")
    curve = {key: whole["model"].pop(key) for key in ORDER_KEYS}
    body = {
        "log": whole["log"],
        "decision": whole["decision"],
        "headline": to_plain(
            window_screen(result, channel_units={output.channel: output.unit for output in result.outputs}).headline
        ),
        "verdicts": whole["verdicts"],
        "summary": whole["summary"],
        "plausibility": whole["plausibility"],
        "scan": whole["scan"],
        "faults": [fault_entry(estimate) for estimate in result.faults],
        "candidates": whole["candidates"],
        "model": whole["model"],
        "vaf": {"output": whole["vaf_output"], "fault": vaf_fault},
        "solver": whole["solver"],
        "order_selection": curve,
        "residuals": whole["residuals"],
        "truth": truth,
        "series": {key: whole[key] for key in ("time_s", "inputs", "input_units", "outputs")},
    }
    return document_of("identify", with_proof_entries(body, result.proved), thinned.notes, provenance)


def _thinned(result: IdentifyResult) -> IdentifyResult:
    """Return the result with every k-th sample of series that are longer than a document holds, and a note on it."""
    n = len(result.time_s)
    k = -(-n // MOST_SAMPLES)
    if k <= 1:
        return result
    outputs = []
    for series in result.outputs:
        values = {field.name: getattr(series, field.name) for field in fields(series)}
        arrays: dict[str, Any] = {key: value[::k] for key, value in values.items() if isinstance(value, np.ndarray)}
        outputs.append(replace(series, **arrays))
    return replace(
        result,
        time_s=result.time_s[::k],
        inputs={name: values[::k] for name, values in result.inputs.items()},
        outputs=tuple(outputs),
        notes=(*result.notes, Note.method(f"the series of this document hold every {k}th of {n} samples")),
    )


def identify_from_document(document: object, *, where: str = "result") -> tuple[IdentifyResult, Provenance]:
    """Return the result a document was made from: the inverse of `identify_document`.

    Parameters
    ----------
    document : parsed JSON.
    where : the file, for messages.

    Raises
    ------
    ConfigError : it is no `identify` document, has another schema, or is damaged.
    """
    whole = document_of_kind(document, ("identify",), where=where, give=GIVE, wanted="not 'identify'")
    faults = from_plain(tuple[Any, ...], member(whole, "faults", where=where), where=f"{where}: faults")
    series = dict(_mapping_at(whole, "series", where))
    if isinstance(series.get("outputs"), list):  # made of the others
        series["outputs"] = [
            {key: value for key, value in entry.items() if key not in DERIVED} if isinstance(entry, dict) else entry
            for entry in series["outputs"]
        ]
    truth = member(whole, "truth", where=where)
    if truth is not None:
        truth = {**_mapping_at(whole, "truth", where), "vaf_fault": member(whole, "vaf.fault", where=where)}
    flat = {
        **with_plain_proofs(whole, where=where),
        **series,
        "faults": [plain_estimate(entry, where=f"{where}: faults[{i}]") for i, entry in enumerate(faults)],
        "model": {**_mapping_at(whole, "model", where), **_mapping_at(whole, "order_selection", where)},
        "vaf_output": member(whole, "vaf.output", where=where),
        "truth": truth,
    }
    result = from_plain(IdentifyResult, flat, where=where)
    _check_lengths(result, where)
    return result, from_plain(Provenance, member(whole, "provenance", where=where), where=f"{where}: provenance")


def _mapping_at(document: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    return mapping(member(document, key, where=where), where=f"{where}: {key}")


def _check_lengths(result: IdentifyResult, where: str) -> None:
    n, n_orders = result.time_s.size, len(result.model.orders)
    sizes = [(f"series.inputs.{name}", values.size, n) for name, values in result.inputs.items()]
    for i, series in enumerate(result.outputs):
        arrays = {field.name: getattr(series, field.name) for field in fields(series)}
        signals = {key: values for key, values in arrays.items() if isinstance(values, np.ndarray)}
        sizes += [(f"series.outputs[{i}].{key}", values.size, n) for key, values in signals.items()]
    sizes += [(f"order_selection.{key}", len(getattr(result.model, key)), n_orders) for key in ORDER_KEYS]
    sizes += [
        (f"residuals of {residual.channel}", len(residual.autocorrelation), len(residual.lags))
        for residual in result.residuals
    ]
    for key, size, expected in sizes:
        if size != expected:
            raise ConfigError(f"{where}: {key}: {size} numbers instead of {expected}; write the file again")
    if n < 2 or not result.outputs:
        raise ConfigError(f"{where}: series: {n} samples of {len(result.outputs)} outputs; write the file again")
