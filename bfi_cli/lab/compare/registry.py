"""The registry of what `bfi compare` runs: a new method is a row here and a function from a problem to a statement."""

from __future__ import annotations

from functools import partial

from ...methods import METHODS
from .peers import Peer, by_entries, by_likelihood, by_null_space, by_residual, by_search, by_two_filters
from .rivals import AIRSPEED, by_ardupilot, by_change_points, by_cumulative_sum, by_likelihood_ratio, by_px4

# Methods of identification that state more than the entries of a dictionary that they declare.
METHOD_STATEMENTS = {"ml": by_likelihood, "dmae": by_two_filters, "arx-residual": by_residual}
PEERS = {
    **{
        name: Peer(summary=method.summary, state=METHOD_STATEMENTS.get(name, partial(by_entries, method=name)))
        for name, method in METHODS.items()
    },
    "start-time": Peer(summary="search over all onsets, without a dictionary (bfi start-time)", state=by_search),
    "null-space": Peer(summary="null-space detector (bfi detect)", state=by_null_space),
    "cusum": Peer(summary="cumulative sum of the ARX residual (Page)", state=by_cumulative_sum),
    "glr": Peer(summary="likelihood ratio of a change in the ARX residual's mean", state=by_likelihood_ratio),
    "ruptures": Peer(summary="change points of the ARX residual (PELT, package ruptures)", state=by_change_points),
    "px4": Peer(summary="PX4's airspeed validator, default checks", state=partial(by_px4, every=False), needs=AIRSPEED),
    "px4-all": Peer(summary="PX4's airspeed validator, every check", state=partial(by_px4, every=True), needs=AIRSPEED),
    "ardupilot": Peer(
        summary="ArduPilot's airspeed consistency (innovation beyond 5 sd)",
        state=by_ardupilot,
        needs=(*AIRSPEED, ("velocity_north",), ("velocity_east",)),
    ),
}
