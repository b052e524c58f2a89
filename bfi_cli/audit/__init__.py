"""What a fault dictionary can tell apart, before a fault is looked for.

`definition` looks at the dictionary as it is written, `comparison` at how alike signals are; `without_log` and `on_log`
put the two together on the raw signals, or on what a predictor leaves of them.
"""

from .on_log import audit_on_log
from .report import audit_content, audit_document
from .result import Audit, AuditedAtom, Signatures
from .without_log import audit

__all__ = ["Audit", "AuditedAtom", "Signatures", "audit", "audit_content", "audit_document", "audit_on_log"]
