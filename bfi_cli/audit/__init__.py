"""What a fault dictionary can tell apart, before a fault is looked for.

`audit` does it on the raw signals, or on what the predictor of a log leaves of them; `entries` looks at the dictionary
as it is written, `comparison` at how alike signals are, `report` makes the document and the content of the report.
"""

from .audit import audit_dictionary, audit_on_log
from .comparison import Signatures
from .entries import Audit, AuditedAtom
from .report import audit_content, audit_document

__all__ = ["Audit", "AuditedAtom", "Signatures", "audit_content", "audit_dictionary", "audit_document"]
__all__ += ["audit_on_log"]
