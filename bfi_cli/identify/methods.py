"""The registry of the methods of identification: a new one is a line here and a module with its function."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["METHODS", "Method"]


@dataclass(frozen=True, slots=True)
class Method:
    """One way to identify the faults of a dictionary.

    Attributes
    ----------
    summary : in a few words, for the reader of a result.
    function : "module:function" of this package, which takes a `PreparedWindow`, its `RegressionData`, the `Config`
        and the `Progress` to tell, and returns a `MethodResult`; imported when it is used.
    intervals : its standard deviations are meant to cover the truth.
    several_outputs : it works on more than one output.
    candidates : it says of every entry how large it might be, whether declared or not.
    feedthrough : the inputs act in the same sample too, unless the configuration says otherwise.
    needs : keys of the configuration without which it cannot work.
    """

    summary: str
    function: str
    intervals: bool = True
    several_outputs: bool = True
    candidates: bool = True
    feedthrough: bool = True
    needs: tuple[str, ...] = ()


METHODS = {
    "ml": Method("maximum likelihood (ml)", "maximum_likelihood:identify_by_likelihood"),
    "risro": Method(
        "rank-constrained least squares (risro)",
        "risro:identify_by_risro",
        intervals=False,
        several_outputs=False,
        feedthrough=False,
    ),
    "risro-as-published": Method(
        "rank-constrained least squares to the letter of the thesis (risro-as-published)",
        "risro:identify_by_risro",
        intervals=False,
        several_outputs=False,
        feedthrough=False,
    ),
    "dmae": Method(
        "double-model adaptive estimation (dmae)",
        "dmae:identify_by_dmae",
        intervals=False,
        several_outputs=False,
        candidates=False,
        needs=("dmae.model",),
    ),
    "arx-residual": Method(
        "plain 5-sigma residual test (arx-residual)", "arx_residual:identify_by_residual", intervals=False
    ),
}
