"""Every method on one log: what each says, against the injected faults where the log has them, else against the others.

A method is a row of `bfi_cli.compare.registry.PEERS` and a function from a `Problem` to a `Statement`; one of another
program is an executable that reads a log file and writes JSON (docs/benchmark.md).
"""

from .compare import compare
from .document import compare_content, compare_document
from .registry import PEERS
from .result import ComparisonResult, Outcome, Score, Statement, Suspect

__all__ = ["PEERS", "ComparisonResult", "Outcome", "Score", "Statement", "Suspect", "compare", "compare_content"]
__all__ += ["compare_document"]
