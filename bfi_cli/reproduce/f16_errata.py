"""What the F-16 diagnosability paper prints and cannot mean, and what we take instead."""

from __future__ import annotations

from ..exhibit import Table

__all__ = ["errata_table"]

ERRATA = (
    ("eq. 1, alpha-dot", "(r sin a - p cos a) tan b", "-(p cos a + r sin a) tan b", "alpha = atan(w/u)"),
    ("eq. 1, beta-dot", "+F_z sin b sin a", "-F_z sin b sin a", "sideslip is normal to the velocity"),
    ("eq. 1, z", "z0 = 3000 m", "z0 = -3000 m", "z is positive down"),
    ("eq. 1, c", "c1 to c6", "c1 to c9", "all nine are used"),
    ("eq. 5", "inverse of g2", "surfaces first, then the nozzle", "g2 is 3 by 5"),
    ("section IV", "k_p = k_d = k_r", "k_p = k_q = k_r", "the gains of eq. 6; k_i2 is never used"),
    ("below eq. 9", "(1), (2) and (7)", "(1), (2) and (8)", "(7) has no variation"),
    ("below eq. 11", "p_i(r) > p_NF(r)", "E(lambda) > 0", "both densities integrate to 1"),
    ("eq. 15", "log", "log2", "base e stays below 0.693, table II does not"),
    ("eq. 16", "min J", "J", "a minimum of one number"),
    ("below eq. 16", "less difficult", "more difficult", "the next two sentences say so"),
    ("eq. 17", "no factors 1/2", "factors 1/2", "as printed it estimates 2 J"),
    ("eq. 18", "second moments", "variances / 4", "error of a mean with the halves of eq. 15"),
    ("below eq. 18", "(18) evaluated, (17) exact", "(17) evaluated, (15) exact", "eq. 18 is the variance"),
    ("eq. 20", "1 / (2 pi)", "1 / sqrt(2 pi)", "as printed a kernel integrates to 0.399"),
    ("eq. 26", "bias fault", "a sine of mean zero", "samples see ten phases, not the peak"),
    ("section IV", "angle sensor; f2 fails, r1", "rate gyro; f2 fails, r2", "x2 are the rates"),
    ("section IV", "r2 is smaller than r1", "r2 is 1.18 to 1.32 times r1", "the published bandwidths, equal n"),
)


def errata_table() -> Table:
    """Return place, what is printed, what is taken, and why."""
    heads = ("place", "printed", "taken", "because")
    return Table(name="errata", title="Errata of the paper", heads=heads, rows=ERRATA)
