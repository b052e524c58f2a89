"""The threshold of a scan on a simulated record: counted on fault-free copies of it, as `bfi calibrate` does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..calibration import save_tables
from ..config import Config, merge
from ..onset import table_of_windows
from ..provenance import provenance
from .answer import with_noise
from .record import thesis_record
from .settings import Settings

__all__ = ["COPIES", "NOISE_M_S", "SHIPPED", "scanning"]

NOISE_M_S = 0.01
COPIES = 60
SHIPPED = (
    "The threshold of the scan is the shipped one here, that of real flights, far above what white noise needs: a weak "
    "fault in a quiet record stays below it."
)


@contextmanager
def scanning(settings: Settings, shapes: Sequence[str]) -> Iterator[Config]:
    """Yield how to scan at 10 Hz for some shapes.

    The threshold is the shipped one where the user gave a log, in a quick run, and with sinusoids, whose table would
    take minutes; otherwise that of 60 fault-free copies of the simulated record with 0.01 m/s of noise.
    """
    config = merge(Config(), {"conditioning.rate_hz": 10.0, "start_time.shapes": list(shapes)})
    if settings.log is not None or settings.quick or "sine" in shapes:
        yield config
        return
    with TemporaryDirectory() as folder:
        path = Path(folder) / "table.json"
        path.write_text(_table(tuple(shapes), settings.seed), encoding="utf-8")
        yield merge(config, {"start_time.calibration": str(path)})


@lru_cache(maxsize=4)
def _table(shapes: tuple[str, ...], seed: int) -> str:
    clean = thesis_record(Settings())
    config = merge(Config(), {"conditioning.rate_hz": 10.0, "start_time.shapes": list(shapes)})
    whole = (float(clean.time_s[0]), float(clean.time_s[-1]) + 1.0 / clean.rate_hz)
    seeds = np.random.SeedSequence([seed, COPIES]).generate_state(COPIES).tolist()
    copies = [(with_noise(clean, NOISE_M_S, seed=one), whole) for one in seeds]
    return save_tables([table_of_windows(copies, config)], provenance(log_sha256="", seed=seed))
