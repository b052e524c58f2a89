"""Every method on one log: what each says, against the injected faults where the log has them, else against the others.

A method is a row of `bfi_cli.lab.compare.registry.PEERS` and a function from a `Problem` to a `Statement`; one of
another program is an executable that reads a log file and writes JSON (docs/benchmark.md).
"""

from .compare import compare, outcome_of, paired
from .document import compare_content, compare_document
from .peers import Peer, Problem
from .programs import program_peer
from .registry import PEERS
from .result import ComparisonResult, Outcome, Score, Statement, Suspect

__all__ = ["PEERS", "ComparisonResult", "Outcome", "Peer", "Problem", "Score", "Statement", "Suspect", "compare"]
__all__ += ["compare_content", "compare_document", "outcome_of", "paired", "program_peer"]
