"""Store answers anew and print what differs from those stored before, as the message of the change is to list it.

python tests/lock/relock.py [NAME ...]               all command lines, or those named
python tests/lock/relock.py --windows FIRST:LAST     windows of recorded flights, drawn where none is stored
python tests/lock/relock.py --check ...              store nothing; exit 1 where something differs
python tests/lock/relock.py --check --within 1e-12   for a change that claims the same numbers
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from threadpoolctl import threadpool_limits

ROOT = Path(__file__).resolve().parents[2]
# The modules that tests share, as pytest finds them.
SHARED = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["pytest"]["ini_options"]["pythonpath"]
sys.path += [str(ROOT), *(str(ROOT / folder) for folder in SHARED)]

from command_lines import LINES  # noqa: E402
from locked_answers import STORED, answer, differences_from_stored, store  # noqa: E402


def relock_lines(names: Sequence[str], *, within: float | None, check: bool) -> int:
    """Print the differences of command lines, store their answers unless `check`, and return how many differ."""
    changed = 0
    with TemporaryDirectory() as folder:
        for name in names:
            after = answer(name, Path(folder))
            is_new = not (STORED / f"{name}.json").exists()
            listed = [] if is_new else [str(line) for line in differences_from_stored(name, after, within=within)]
            if is_new or listed:
                changed += 1
                print(f"bfi {LINES[name]}", *(listed or ["new"]), sep="\n    ", flush=True)
                if not check:
                    store(name, after)
    return changed


def relock_windows(first: int, last: int, *, check: bool) -> int:
    """Print the differences of windows, store their answers unless `check`, and return how many differ."""
    from locked_windows import COMMANDS, differences_of_window, store_windows, stored_windows, window_answers
    from window_trials import drawn

    rows, changed = stored_windows(), 0
    kinds: Counter[str] = Counter()
    for number in range(first, last):
        before = rows.get(number)
        after = window_answers(drawn(number) if before is None else before)
        listed = ["new"] if before is None else [str(line) for line in differences_of_window(before, after)]
        if listed:
            changed += 1
            print(f"window {number}, {after['kind']}", *listed, sep="\n    ", flush=True)
            if before is not None:
                kinds.update(f"{name}: {before[name]['decision']} -> {after[name]['decision']}" for name in COMMANDS)
            if not check:
                rows[number] = after
                store_windows(rows)
    for change, count in sorted(kinds.items()):
        print(f"    {count} x {change}")
    return changed


def _span(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    return int(first), int(last)


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of command lines, see command_lines.py")
    parser.add_argument("--windows", type=_span, metavar="FIRST:LAST", help="windows in place of command lines")
    parser.add_argument("--within", type=float, metavar="PART", help="relative difference of equal numbers")
    parser.add_argument("--check", action="store_true", help="store nothing")
    asked = parser.parse_args()
    if unknown := sorted(set(asked.names) - set(LINES)):
        parser.error(f"no command line is called {', '.join(unknown)}")
    with threadpool_limits(1):
        if asked.windows:
            changed = relock_windows(*asked.windows, check=asked.check)
            print(f"{changed} of {asked.windows[1] - asked.windows[0]} windows differ")
        else:
            changed = relock_lines(asked.names or list(LINES), within=asked.within, check=asked.check)
            print(f"{changed} of {len(asked.names or LINES)} command lines differ")
    if not (asked.names or asked.windows or asked.check):
        for path in STORED.glob("*.json"):
            if path.stem not in LINES:
                print(f"{path.name}: of no command line any more, removed")
                path.unlink()
    return int(asked.check and changed > 0)


if __name__ == "__main__":
    sys.exit(main())
