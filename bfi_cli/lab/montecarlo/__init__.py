"""Monte Carlo sweeps: known faults on a record, drawn many times, identified, counted.

`definition` is a sweep's YAML, `scenarios` what it means, `trial` one draw, `summary` what all of them say.
"""

from .counts import wilson
from .running import check_records, digest_of, open_journal, run_sweep
from .scenarios import Sweep, load_sweep
from .summary import Summary, montecarlo_content, summarise, summary_document
from .trial import run_trial

__all__ = ["Summary", "Sweep", "check_records", "digest_of", "load_sweep", "montecarlo_content", "open_journal"]
__all__ += ["run_sweep", "run_trial", "summarise", "summary_document", "wilson"]
