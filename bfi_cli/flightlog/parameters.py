"""Parameters of an autopilot, as its log lists them: the settings that it flew with."""

from __future__ import annotations

from .dataflash import is_dataflash, read_dataflash_parameters
from .px4 import is_ulog, read_ulog_parameters


def parameters_of(path: str) -> dict[str, float]:
    """Return the parameters that a ULog or a DataFlash log lists by name, each as it was last; none of another log."""
    try:
        with open(path, "rb") as file:
            head = file.read(8)
    except (OSError, ValueError):  # a log that was made in memory
        return {}
    if is_ulog(head):
        return read_ulog_parameters(path)
    return read_dataflash_parameters(path) if is_dataflash(head) else {}
