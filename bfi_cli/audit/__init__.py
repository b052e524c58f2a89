"""Audit of a fault dictionary: which of its faults can be seen and told apart, before a fault is looked for.

`audit` compares raw signals, or the signatures that the predictor of a log leaves of them; `entries` checks each entry
as it is written, `comparison` measures how similar signals are, `report` makes the document and the report.
"""

from .audit import audit_dictionary, audit_on_log
from .comparison import Signatures
from .entries import Audit, AuditedAtom
from .report import audit_content, audit_document

__all__ = ["Audit", "AuditedAtom", "Signatures", "audit_content", "audit_dictionary", "audit_document"]
__all__ += ["audit_on_log"]
