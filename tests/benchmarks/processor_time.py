"""Where the processor time of the tests goes: `pytest -q -n 2 -p tests.benchmarks.processor_time`.

Processor time, of the workers and of the programs that their tests start and wait for, hardly depends on what else the
machine does. A fixture of a module or session counts for the test that is the first to ask for it.
"""

from __future__ import annotations

import resource
from collections import defaultdict
from collections.abc import Generator, Mapping
from typing import Any

import pytest

# Share [1] of the whole: what a single test may take at most.
LARGEST_SHARE = 0.01
# Number of files and of tests that are listed, those that take most.
LISTED = 40
COLLECTION = "imports and collection"


def processor_seconds() -> float:
    """Return user and system time of this process and of its children that have ended, in s."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


class ProcessorTime:
    """Seconds of every test, handed from the workers to the summary with the reports."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.last = 0.0
        self.seconds: dict[str, float] = defaultdict(float)

    def elapsed(self) -> float:
        """Return the seconds since this was last asked, at first those since the process began."""
        before, self.last = self.last, processor_seconds()
        return self.last - before

    def pytest_collection_finish(self) -> None:
        """Take the time until here for the collection, also in a worker, whose output is read at its end."""
        self.seconds[COLLECTION] += (seconds := self.elapsed())
        if (output := getattr(self.config, "workeroutput", None)) is not None:
            output[COLLECTION] = seconds

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Add the collection of a worker that has ended."""
        output: Mapping[str, float] = getattr(node, "workeroutput", {})
        self.seconds[COLLECTION] += output.get(COLLECTION, 0.0)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Add to the report of a phase what has passed since the one before."""
        report = yield
        report.user_properties = [("processor_s", self.elapsed())]
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Sum the phases of a test."""
        self.seconds[report.nodeid] += dict(report.user_properties)["processor_s"]

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print the whole, the files and the tests that take most."""
        whole = sum(self.seconds.values())
        files: dict[str, float] = defaultdict(float)
        for test, seconds in self.seconds.items():
            files[test.partition("::")[0]] += seconds
        tests = {name: seconds for name, seconds in self.seconds.items() if name != COLLECTION}
        beyond = sum(seconds > LARGEST_SHARE * whole for seconds in tests.values())
        terminalreporter.section(
            f"processor time: {whole:.1f} s in {len(tests)} tests, {beyond} of them above {LARGEST_SHARE:.0%}"
        )
        for table in (files, tests):
            for name, seconds in sorted(table.items(), key=lambda pair: -pair[1])[:LISTED]:
                terminalreporter.line(f"{seconds:8.2f} s {seconds / whole:6.1%}  {name}")
            terminalreporter.line("")


def pytest_configure(config: pytest.Config) -> None:
    """Measure in every worker, and in the process that prints."""
    config.pluginmanager.register(ProcessorTime(config), "bfi-processor-time")
