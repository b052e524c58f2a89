"""Which faults of a dictionary are in a log, how large, how sure (METHOD sections 3 and 4)."""

from .answer import identify_faults

__all__ = ["identify_faults"]
