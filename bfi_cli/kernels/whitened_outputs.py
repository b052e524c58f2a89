"""Outputs in coordinates in which a prediction error has unit covariance, for the rank-constrained form of several.

A fault may act on any output there, so its signals are dense. Least squares in these coordinates does not depend on
the units of the outputs nor on their order. One output is left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import FloatArray
from .risro import DEFICIENT
from .variable_projection import ProjectedRegression, without_signal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WhitenedOutputs:
    """The regression of `ProjectedRegression` with rows (m) last.

    Attributes
    ----------
    y : (order + 1, n_outputs, m) outputs at lags 0..order.
    theta : (order + 1, n_outputs, n, m) signals of the atoms.
    atoms : (n,) of the dictionary, those with a signal.
    whiten : (n_outputs, n_outputs), measured outputs @ whiten are these.
    """

    y: FloatArray
    theta: FloatArray
    atoms: np.ndarray[tuple[int], np.dtype[np.intp]]
    whiten: FloatArray

    def coefficients(self, K: FloatArray) -> FloatArray:
        """Return (order n_outputs, n_outputs), past corrected outputs to outputs, of K in the outputs' own units.

        Of one output K is (order,), of several (order, n_outputs, n_outputs).
        """
        n_y = len(self.whiten)
        turned = np.linalg.solve(self.whiten, K.reshape(-1, n_y, n_y).transpose(0, 2, 1)) @ self.whiten
        return turned.reshape(-1, n_y)

    def predictor(self, H: FloatArray) -> FloatArray:
        """Return K in the outputs' own units of its coefficients here: the inverse of `coefficients`."""
        n_y = len(self.whiten)
        turned = self.whiten @ H.reshape(-1, n_y, n_y) @ np.linalg.inv(self.whiten)
        return turned.ravel() if n_y == 1 else turned.transpose(0, 2, 1)


def whitened_outputs(problem: ProjectedRegression, z: FloatArray, K: FloatArray) -> WhitenedOutputs:
    """Return the regression in coordinates in which the prediction errors of (z, K) are orthonormal.

    Where these depend on each other, as they do at round-off, each output is divided by its norm.

    Parameters
    ----------
    z : (n_atoms,) of the dictionary.
    K : (order,) of one output, which is left as it is; (order, n_outputs, n_outputs) of several.
    """
    y, (m, n_lags, n_y) = problem.y, problem.y.shape
    if n_y == 1:
        theta = problem.theta.transpose(1, 2, 0)[:, None]
        atoms = np.array([atom for _, atom in problem.signals], dtype=np.intp)
        return WhitenedOutputs(y=y.transpose(1, 2, 0), theta=theta, atoms=atoms, whiten=np.eye(1))
    less = problem
    for present in np.flatnonzero(z):
        less = without_signal(less, int(present), float(z[present]))
    error = less.y[:, 0] - np.einsum("kic,imc->km", less.y[:, 1:], K)
    norms = np.linalg.norm(y[:, 0], axis=0)
    norms[norms == 0.0] = 1.0
    R, whiten = np.linalg.qr(error / norms)[1], np.diag(1.0 / norms)
    if m >= n_y and np.linalg.cond(R) * DEFICIENT < 1.0:
        whiten = whiten @ np.linalg.inv(R)
    atoms = np.unique(np.array([atom for _, atom in problem.signals], dtype=np.intp))
    theta = np.zeros((n_lags, n_y, len(atoms), m))
    for column, (output, atom) in enumerate(problem.signals):
        signature = problem.theta[:, :, column].T[:, None] * whiten[output][:, None]
        theta[:, :, np.searchsorted(atoms, atom)] += signature
    return WhitenedOutputs(y=(y @ whiten).transpose(1, 2, 0), theta=theta, atoms=atoms, whiten=whiten)
