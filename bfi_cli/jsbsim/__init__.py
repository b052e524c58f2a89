"""Flights of JSBSim, an open-source flight dynamics model with aircraft that nobody here wrote (extra `jsbsim`).

`run` flies in a separate process, see `bfi_cli.jsbsim.flight`.
"""

from __future__ import annotations

from .channels import CONTROLS as _CONTROLS
from .channels import RECORDED
from .process import run

__all__ = ["CONTROLS", "OUTPUTS", "run"]

CONTROLS = tuple(_CONTROLS)
OUTPUTS = tuple(channel.name for channel in RECORDED)
