"""What a limit holds for: onsets that could be tested, and only what may not stand in place of a declared fault."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..faults.shapes import Kind
from ..serialization import mapping, member
from .candidate import Candidate, with_limit

# The note of an entry of a dictionary that counts for no verdict, since no analysis of the window could tell.
UNTESTED = "too near an end of the window"
IN_PLACE = "in place of what is declared it would explain the log nearly as well"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanLimit:
    """What a scan says of a fault of a dictionary, the worst of the onsets it may have; None where it has no limit.

    Magnitudes and errors in SI, see `Candidate`.

    Attributes
    ----------
    covered : whether the scan claims anything of faults of this shape that begin there.
    """

    excluded_above: float | None = None
    effect: float | None = None
    seen_above: float | None = None
    covered: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """How many faults of the size that an answer excludes were seen by the same analysis when added to the same log.

    Attributes
    ----------
    kind : of the faults; channel : that they were added to, or a pressure line by its fault.
    size : largest error or slope that the answer does not exclude, in `unit`.
    n_seen : declared or suspected, of this kind and at their onsets; n_added : faults that were added, one at a time.
    """

    kind: Kind
    channel: str
    size: float
    unit: str
    n_seen: int
    n_added: int


def untested(candidate: Candidate) -> Candidate:
    """Return a candidate that begins where no claim is made: it narrows the claim, and is no doubt of it.

    One that is declared or suspected stays so.
    """
    if candidate.state not in ("excluded", "not_seen"):
        return candidate
    return with_limit(candidate, None, None, state=None, note=UNTESTED)


def with_limit_of_scan(
    candidate: Candidate, limit: ScanLimit | None, covered_s: tuple[float, float] | None
) -> Candidate:
    """Return a candidate whose onset is known to a tolerance only, excluded by what a scan over all onsets excludes.

    Parameters
    ----------
    limit : of the scan, None where it has none.
    covered_s : between which onsets the scan's claims hold, None where the window is not scanned.
    """
    if candidate.state not in ("excluded", "not_seen"):
        return candidate
    note, onset_s = None, candidate.onset_s
    if limit is None:
        why = " and the window is not scanned" if covered_s is None else ": the scan does not look for it"
        note = f"no claim where its onset is not exact{why} (--onset-tolerance 0)"
    sizes = (None, None, None) if limit is None else (limit.effect, limit.excluded_above, limit.seen_above)
    bounded = with_limit(candidate, *sizes, note=note)
    too_late = covered_s is not None and onset_s is not None and not covered_s[0] <= onset_s <= covered_s[1]
    if too_late or (limit is not None and not limit.covered):
        bounded = untested(bounded)
    # What is left out as the same signal as another entry says so.
    return replace(bounded, note=candidate.note) if candidate.magnitude is None else bounded


def not_excluded(candidates: Sequence[Candidate], rivals: Collection[tuple[str, str]]) -> tuple[Candidate, ...]:
    """Return candidates with none excluded that may stand in place of a declared fault.

    Parameters
    ----------
    rivals : shape and channel of what may.
    """
    return tuple(
        with_limit(candidate, None, None, note=IN_PLACE)
        if candidate.state == "excluded" and (candidate.shape, candidate.channel) in rivals
        else candidate
        for candidate in candidates
    )


def with_proof_entries(body: Mapping[str, Any], proofs: Sequence[Proof]) -> dict[str, Any]:
    """Return the body of a document with the entries `proved`, without them where nothing was proved."""
    entries = [
        {
            "kind": proof.kind,
            "channel": proof.channel,
            "size": proof.size,
            "unit": proof.unit,
            "found": proof.n_seen,
            "of": proof.n_added,
        }
        for proof in proofs
    ]
    rest = {key: value for key, value in body.items() if key != "proved"}
    return {**rest, "proved": entries} if entries else rest


def with_plain_proofs(document: Mapping[str, Any], *, where: str) -> dict[str, Any]:
    """Return a document with its entries `proved` as plain data of `Proof`, the inverse of `with_proof_entries`.

    Raises
    ------
    ConfigError : an entry is damaged.
    """
    entries = enumerate(document.get("proved", ()))
    plain = [
        {
            **mapping(entry, where=f"{where}: proved[{i}]"),
            "n_seen": member(entry, "found", where=f"{where}: proved[{i}]"),
            "n_added": member(entry, "of", where=f"{where}: proved[{i}]"),
        }
        for i, entry in entries
    ]
    return {**document, "proved": plain}
