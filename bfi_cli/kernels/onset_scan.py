from __future__ import annotations
import numpy as np
from .onset_tables import Scan, Tables, tabulate
from .onset_profile import Pencil, log_ratio

def assemble(scan: Scan, tables: Tables, onsets) -> Pencil:
    s, degrees = scan.order, scan.degrees
    n1 = scan.Q.shape[0] - scan.n_base
    C = np.stack([tables.P[a][scan.n_base:, onsets + s - j] for j, a in enumerate(degrees)], axis=1)
    S = np.empty((s + 1, s + 1, len(onsets)))
    for i, a in enumerate(degrees):
        for j in range(i, s + 1):
            S[i, j] = S[j, i] = tables.G[a, degrees[j], j - i][onsets + s - i]
    return pencil(scan, C, S)

def pencil(scan, C, S):
    Wt = np.ascontiguousarray(scan.W.T)
    m = len(Wt)
    A = np.matmul(Wt, C)
    H1 = A + A.transpose(1, 0, 2)
    X = np.matmul(Wt, S)
    H2 = (Wt @ X.reshape(len(S), -1)).reshape(m, m, -1)
    return Pencil(H1=H1, H2=H2, n_outputs=scan.n_outputs)
