"""The registry of the methods of identification: a new one is a line here and a module with its function."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Method:
    """One way to identify the faults of a dictionary.

    Attributes
    ----------
    summary : of the method in a few words, for the reader of a result.
    function : "module:function" of `bfi_cli`, imported when it is used. It takes a `PreparedWindow`, its
        `RegressionData`, the `Config` and a `Progress` to report to, and returns a `MethodResult`.
    intervals : whether its intervals are meant to cover the true magnitude.
    several_outputs : whether it works on more than one output.
    candidates : whether it estimates the magnitude of every entry, declared or not.
    feedthrough : whether the inputs act in the same sample too by default.
    needs : keys of the configuration without which it cannot work.
    is_published : whether it is one of the papers', whose input is the elevator; others take every trusted channel.
    """

    summary: str
    function: str
    intervals: bool = True
    several_outputs: bool = True
    candidates: bool = True
    feedthrough: bool = True
    needs: tuple[str, ...] = ()
    is_published: bool = False


METHODS = {
    "ml": Method("maximum likelihood (ml)", "model.maximum_likelihood:identify_by_likelihood"),
    "risro": Method(
        "rank-constrained least squares (risro)",
        "model.risro:identify_by_risro",
        is_published=True,
        intervals=False,
        feedthrough=False,
    ),
    "risro-as-published": Method(
        "rank-constrained least squares to the letter of the thesis (risro-as-published)",
        "model.risro:identify_by_risro",
        is_published=True,
        intervals=False,
        several_outputs=False,
        feedthrough=False,
    ),
    "mf2d": Method(
        "nuclear norm and l1 norm, re-solved on their support (mf2d)",
        "lab.mf2d:identify_by_mf2d",
        is_published=True,
        intervals=False,
    ),
    "mfddfd": Method(
        "group lasso on time courses whose channels nobody knows (mfddfd)",
        "lab.mfddfd:identify_by_mfddfd",
        is_published=True,
        intervals=False,
        candidates=False,
    ),
    "dmae": Method(
        "double-model adaptive estimation (dmae)",
        "lab.dmae:identify_by_dmae",
        is_published=True,
        intervals=False,
        several_outputs=False,
        candidates=False,
        needs=("dmae.model",),
    ),
    "arx-residual": Method(
        "plain 5-sigma residual test (arx-residual)", "model.arx_residual:identify_by_residual", intervals=False
    ),
}
