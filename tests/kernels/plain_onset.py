"""The onset scan written out plainly: one least squares per onset and magnitude, a dense grid over the magnitude."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from bfi_cli.kernels.lagged import lagged
from bfi_cli.kernels.onset import waveform as shapes
from bfi_cli.kernels.onset.profile import log_ratio
from bfi_cli.kernels.onset.scan import stack_onsets, tabulate

STEP_S = 0.1


def waveforms(n):
    """Return one waveform of every kind over n samples."""
    walk = np.cumsum(np.random.default_rng(3).standard_normal(n))
    return {
        "bias": shapes.bias(n),
        "drift": shapes.drift(n, step_s=STEP_S),
        "sine": shapes.sine(n, angle=2 * np.pi * 0.05),
        "slow sine": shapes.sine(n, angle=2 * np.pi * 0.002),
        "lagged bias": shapes.lagged_bias(n, constant=20.0),
        "ramp-hold": shapes.ramp_hold(n, duration=17.5),
        "samples": shapes.sampled(walk),
    }


def signal(waveform, start, end=None):
    """Return (n_samples,) the fault of unit magnitude on [start, end)."""
    n = len(waveform.samples)
    theta = np.zeros(n)
    theta[start:end] = waveform.unit * waveform.samples[: len(range(*slice(start, end).indices(n)))]
    return theta


def record(n, *, seed=0, noise=0.05, n_outputs=1):
    """Return (u, y) of a stable fourth-order system about 85."""
    rng = np.random.default_rng(seed)
    K = np.poly([0.9 * np.exp(0.3j), 0.9 * np.exp(-0.3j), 0.6, 0.3]).real
    u = np.sign(lfilter([1.0], [1.0, -0.95], rng.standard_normal(n)))
    y = [
        lfilter([1.0], K, lfilter([0.0, 0.5, -0.3, 0.2 * (i + 1), 0.1], [1.0], u) + noise * rng.standard_normal(n))
        for i in range(n_outputs)
    ]
    return u[:, None], 85.0 + np.stack(y, axis=1)


def random_record(n, rng):
    """Return (u, y) of a random stable system with process and measurement noise of random size."""
    poles = []
    for _ in range(rng.integers(1, 4)):
        radius, angle = 1.0 - 10 ** rng.uniform(-2.3, -0.5), rng.uniform(0.0, 1.0)
        pair = [radius * np.exp(1j * angle), radius * np.exp(-1j * angle)]
        poles += pair if rng.random() < 0.6 else [radius]
    u = np.sign(lfilter([1.0], [1.0, -0.95], rng.standard_normal(n)))
    drive = lfilter(np.append(0.0, 0.2 * rng.standard_normal(len(poles))), [1.0], u)
    drive += 10 ** rng.uniform(-2.5, -0.3) * rng.standard_normal(n)
    y = lfilter([1.0], np.poly(poles).real, drive) + 10 ** rng.uniform(-3.0, -1.0) * rng.standard_normal(n)
    return u[:, None], y[:, None]


def regressors(u, corrected, order, *, feedthrough=True):
    """Return [1 | input lags | lags of the corrected outputs] for the rows order .. n_samples - 1."""
    ones = np.ones((len(u) - order, 1))
    inputs = lagged(u, range(0 if feedthrough else 1, order + 1), first=order)
    return np.hstack([ones, inputs, lagged(corrected - corrected.mean(axis=0), range(1, order + 1))])


def rss_at(scan, waveform, onsets, *, z):
    """Return the scan's own rss (n_onsets,) at given magnitudes (n_onsets,), to be compared with `plain_rss`."""
    stack = stack_onsets(scan, tabulate(scan, waveform.samples), onsets)
    return scan.rss0 * np.exp(log_ratio(stack, z * waveform.unit))


def plain_rss(u, y, theta, *, z, order, feedthrough=True, channel=0):
    """Return the determinant of the residuals' products, for one output the sum of squares."""
    corrected = y.copy()
    corrected[:, channel] -= z * theta
    X = regressors(u, corrected, order, feedthrough=feedthrough)
    X /= np.linalg.norm(X, axis=0)
    Y = (corrected - corrected.mean(axis=0))[order:]
    residual = Y - X @ np.linalg.lstsq(X, Y, rcond=None)[0]
    return np.linalg.det(residual.T @ residual)


def dense_minimum(u, y, theta, *, order, bound, size=1200):
    """Return the least RSS of one output over a dense grid of magnitudes, one least squares each.

    The rows are first compressed by an orthogonal transformation, so that thousands of magnitudes take a second.
    """
    y = y - y.mean(axis=0)
    base = regressors(u, y, order)[:, : 1 + (order + 1) * u.shape[1]]
    both = np.hstack([lagged(x, range(order, -1, -1)) for x in (y, theta[:, None])])
    R = np.linalg.qr(np.hstack([base / np.linalg.norm(base, axis=0), both]), mode="r")[base.shape[1] :]
    R = R[:, base.shape[1] :]
    sizes = np.unique(np.concatenate([np.geomspace(1e-6, 1.0, size), np.linspace(0.0, 1.0, size)])) * bound
    z = np.concatenate([-sizes[::-1], sizes])
    corrected = R[:, : order + 1] - z[:, None, None] * R[:, order + 1 :]
    return float(np.min(np.linalg.qr(corrected, mode="r")[:, -1, -1] ** 2))


def gauss_newton(u, y, theta, *, order, steps=20, tolerance=1e-8):
    """Return the magnitude by Gauss-Newton from 0 on all rows, the predictor solved for at each step."""
    y, z = y - y.mean(axis=0), 0.0
    past = lagged(theta[:, None], range(1, order + 1))
    for _ in range(steps):
        corrected = y - z * theta[:, None]
        X = regressors(u, corrected, order)
        K = np.linalg.lstsq(X, corrected[order:, 0], rcond=None)[0][-order:]
        signature = theta[order:] - past @ K
        joint = np.linalg.lstsq(np.column_stack([X, signature]), corrected[order:, 0], rcond=None)[0]
        z += joint[-1]
        if abs(joint[-1]) < tolerance * max(abs(z), 1e-3):
            break
    return z
