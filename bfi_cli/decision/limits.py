"""What a limit holds for: onsets that could be tested, and the record with and without what is declared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from .candidate import Candidate, with_limit
from .verdict import verdicts_of

# The note of an entry of a dictionary that counts for no verdict, since no analysis of the window could tell.
UNTESTED = "too near an end of the window"
STANDS_FOR = "possible if the declared fault is of another kind"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanLimit:
    """What a scan says of a fault of a dictionary, the worst of the onsets it may have; None where it has no limit.

    Magnitudes and effect in SI, see `Candidate`.

    Attributes
    ----------
    covered : whether the scan claims anything of faults of this shape that begin there.
    """

    excluded_above: float | None = None
    effect: float | None = None
    covered: bool = True


def untested(candidate: Candidate) -> Candidate:
    """Return a candidate that begins where no claim is made: it narrows the claim, and is no doubt of it.

    One that is declared or suspected stays so.
    """
    if candidate.state not in ("excluded", "not_seen"):
        return candidate
    return replace(candidate, state=None, effect=None, excluded_above=None, note=UNTESTED)


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
    effect, excluded = (None, None) if limit is None else (limit.effect, limit.excluded_above)
    bounded = with_limit(candidate, effect, excluded, note=note)
    too_late = covered_s is not None and onset_s is not None and not covered_s[0] <= onset_s <= covered_s[1]
    if too_late or (limit is not None and not limit.covered):
        bounded = untested(bounded)
    # What is left out as the same signal as another entry says so.
    return replace(bounded, note=candidate.note) if candidate.magnitude is None else bounded


def worst_view(views: Sequence[Candidate]) -> Candidate:
    """Return what the first view of a record says of a fault, with the largest limits of all views.

    The first is the record less the declared faults. These may stand for another fault, as a lag does for a slow
    oscillation, which the record less them does not show any more: nothing is excluded that another view admits.
    """
    worst, *others = views
    for other in others:
        if worst.effect is not None and (other.effect is None or other.effect > worst.effect):
            bounded = with_limit(worst, other.effect, other.excluded_above)
            worst = bounded if bounded.state == worst.state else replace(bounded, note=STANDS_FOR)
    return worst


def not_excluded_by(candidates: Sequence[Candidate], searched: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Return candidates with no claim on a kind of which a search of the record as it was measured makes none.

    As in `worst_view`, what is declared may stand for another fault of that kind.
    """
    verdicts = verdicts_of(candidates)
    open_kinds = {one.kind for one in searched if one.state == "not_seen" and verdicts[one.kind] == "no_fault"}
    return tuple(
        replace(one, state="not_seen", excluded_above=None, effect=None, note=STANDS_FOR)
        if one.kind in open_kinds and one.state == "excluded"
        else one
        for one in candidates
    )
