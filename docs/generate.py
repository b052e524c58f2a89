"""Make what is generated in this folder, or check that it is up to date.

    python docs/generate.py            write commands.md, api.md, tables of other pages, outputs of guide and README
    python docs/generate.py --check    write nothing; exit 1 and name what is out of date
    python docs/generate.py --fast     leave out the outputs, whose commands take a minute

Pages are made from the click tree, the JSON schemas in `configs/schema` and the source's docstrings alone, and come out
the same on any machine. Outputs of commands are numbers: one that is shown is kept where the command still agrees with
it to the digits shown.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import math
import os
import pty
import re
import shlex
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
README = ROOT / "README.md"
sys.path.insert(0, str(ROOT))

COLUMNS = 100  # width of the terminal in the guide: what a page shows without scrolling
LAST_DIGITS = 2.0  # a number agrees within so many units of its last digit: other machines round otherwise
COMMON = 3  # commands that have an option alike: it is explained once
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", re.IGNORECASE)


def pages() -> dict[Path, str]:
    """Return the text of every generated page but the guide."""
    made = {DOCS / "commands.md": commands_page(), DOCS / "api.md": api_page()}
    for page, within in tables().items():
        made[DOCS / page] = with_tables(page, (DOCS / page).read_text("utf-8"), within)
    return made


# Tables in Markdown


def table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Return a table; bars inside a cell are escaped."""
    lines = [header, tuple("---" for _ in header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def with_tables(page: str, text: str, made: dict[str, str]) -> str:
    """Return a page with what stands between `<!-- table: NAME -->` and `<!-- end -->` replaced."""

    def replaced(found: re.Match[str]) -> str:
        return f"<!-- table: {found[1]} -->\n\n{made.pop(found[1])}\n\n<!-- end -->"

    text = re.sub(r"<!-- table: (\S+) -->\n.*?<!-- end -->", replaced, text, flags=re.DOTALL)
    if made:
        raise SystemExit(f"{page}: no place for the tables {', '.join(made)}")
    return text


def tables() -> dict[str, dict[str, str]]:
    """Return the tables of the pages that are written by hand, by page and name."""
    from bfi_cli.flight.tables import ORDINARY
    from bfi_cli.quantities.channels import CASE_MATTERS, CONVERSIONS, STANDARD

    channels = [
        (f"`{one.name}`", one.unit, one.description, ", ".join(f"`{alias.partition('=')[0]}`" for alias in one.aliases))
        for one in STANDARD.values()
        if one.name == one.quantity
    ]
    spellings = [*CONVERSIONS, *((conversion, spelling) for spelling, conversion in CASE_MATTERS.items())]
    units: dict[str, list[str]] = {}
    for conversion, spelled in spellings:
        units.setdefault(conversion.si, []).append(" ".join(f"`{word}`" for word in spelled.split()))
    return {
        "logs.md": {
            "maps": maps_table(),
            "channels": table(("channel", "unit", "what it is", "also called"), channels),
            "units": table(("becomes", "spellings"), [(si, "; ".join(words)) for si, words in units.items()]),
        },
        "configuration.md": {
            "shapes": shapes_table(),
            "config": config_table("config"),
            "montecarlo": config_table("montecarlo"),
        },
        "documents.md": {
            "candidate": attributes_table("bfi_cli.decision", "Candidate"),
            "fault": attributes_table("bfi_cli.faults", "FaultEstimate"),
            "contradiction": attributes_table("bfi_cli.decision.implausible", "Implausible"),
            "event": attributes_table("bfi_cli.flight.result", "Event"),
            "limit": attributes_table("bfi_cli.flight.result", "FlightLimit"),
            "scenario": attributes_table("bfi_cli.lab.montecarlo.counts", "ScenarioSummary"),
            "trial": attributes_table("bfi_cli.lab.montecarlo.trial", "Row"),
            "ordinary": table(("cause", "in words"), [(f"`{name}`", cause.text) for name, cause in ORDINARY.items()]),
        },
        "fleet.md": {"tables": fleet_table()},
        "theory.md": {"relations": relations_table()},
    }


def attributes_table(module: str, name: str) -> str:
    """Return the attributes of a class that is a part of documents, as its docstring and its bases' have them."""
    parts = [
        inspect.cleandoc(part.__doc__ or "") for part in reversed(getattr(importlib.import_module(module), name).mro())
    ]
    lines = "\n".join(part.partition("Attributes\n----------\n")[2] for part in parts)
    items = re.split(r"\n(?=\S)|;\s+(?=\w+(?:, \w+)* : )", lines.strip())  # two on a line stand behind a semicolon
    rows = []
    for keys, _, meaning in (item.partition(" : ") for item in items):
        rows.append((", ".join(f"`{key}`" for key in keys.split(", ")), " ".join(meaning.split()).rstrip(".")))
    return table(("key", "holds"), rows).replace("None", "null")


def fleet_table() -> str:
    """Return the tables of many logs with their columns."""
    from bfi_cli.fleet.tables import CONSTANTS, FLIGHTS, LOG_COLUMNS, SECOND, TRENDS

    whole: dict[str, dict[str, list[str]]] = {}  # by table and by command, its columns
    for command, columns in FLIGHTS.items():
        whole.setdefault("flights", {})[command] = [*LOG_COLUMNS, "sha256", "error", *columns]
        name, further = SECOND[command]
        whole.setdefault(name, {})[command] = [*LOG_COLUMNS, *further]
    whole["constants"] = {"diagnose": [*LOG_COLUMNS, *CONSTANTS]}
    whole["trends"] = {"diagnose --by aircraft": list(TRENDS)}
    rows = [
        (f"`{name}`", f"`{command}`", ", ".join(f"`{column}`" for column in columns))
        for name, commands in whole.items()
        for command, columns in commands.items()
    ]
    return table(("table", "of", "columns"), rows)


def relations_table() -> str:
    """Return what is held against what over a whole log: a row for each reading and tolerance."""
    from bfi_cli.airdata.relations import RELATIONS
    from bfi_cli.quantities.channels import STANDARD

    rows: dict[tuple[str, str, str], list[str]] = {}
    for relation in (row for row in RELATIONS if row.lasts):
        reading, *others = relation.needs
        unit = STANDARD[reading].unit
        scale, unit = (180.0 / math.pi, unit.replace("rad", "deg")) if unit.startswith("rad") else (1.0, unit)
        level = "" if relation.tolerance is None else f"{scale * relation.tolerance:.3g} {unit}"
        level += f" + {100.0 * relation.share:g} %" if relation.share else ""
        moves = "" if relation.least is None else f"{scale * relation.least:.3g} {unit}"
        beside = [f"({name})" for name in relation.beside]
        rows.setdefault((reading, level, moves), []).append(", ".join([*others, *beside]))
    return table(
        ("reading", "implied by (where known)", "medians may differ by", "motion counts from"),
        [(f"`{reading}`", "; ".join(sets), level, moves) for (reading, level, moves), sets in rows.items()],
    )


def schema(name: str) -> dict[str, Any]:
    """Return a shipped JSON schema; a test keeps each the one of its model."""
    loaded: dict[str, Any] = json.loads((ROOT / "configs" / "schema" / f"{name}.json").read_text("utf-8"))
    return loaded


def maps_table() -> str:
    """Return which fields of which recorders are channels, the better source first."""
    from bfi_cli.flightlog.topics import RECORDERS, maps_of

    rows: dict[tuple[str, str], list[str]] = {}
    for recorder, name in RECORDERS.items():
        for one in (row for row in maps_of(recorder) if row.channel):
            scale = "" if one.scale == 1.0 else "-" if one.scale == -1.0 else f"{one.scale:g} x "
            offset = "" if one.offset == 0.0 else f" {'+' if one.offset > 0 else '-'} {abs(one.offset):g}"
            unit = "" if one.unit == "1" else f" {one.unit}"
            rows.setdefault((name, f"`{one.channel}`"), []).append(f"{scale}`{one.topic}.{one.field}`{offset}{unit}")
    return table(("recorder", "channel", "fields"), [(*key, ", ".join(fields)) for key, fields in rows.items()])


def shapes_table() -> str:
    """Return the shapes of a dictionary's entries, what each adds to its channel, and the keys of its own."""
    from bfi_cli.faults.shapes import SHAPES

    rows = []
    for name, shape in SHAPES.items():
        keys = sorted(shape.keys, key=lambda key: not key.required)
        own = [f"`{key.name}`" + ("" if key.required else " (optional)") for key in keys]
        rows.append((f"`{name}`", shape.formula.rstrip("."), ", ".join(own)))
    return table(("shape", "signal of magnitude 1, zero before the onset", "keys of its own"), rows)


def config_table(name: str) -> str:
    """Return every key of a configuration by its dotted path, with its default and its meaning."""
    whole = schema(name)

    def rows(part: dict[str, Any], prefix: str) -> Iterator[tuple[str, ...]]:
        for key, entry in part["properties"].items():
            reference = entry.get("$ref", "").rpartition("/")[2]
            below = whole["$defs"].get(reference, {})
            if name == "montecarlo" and key == "identify":
                yield (f"`{prefix}{key}`", "", "Keys of the configuration of an analysis, for all scenarios.")
            elif "properties" in below:
                yield from rows(below, f"{prefix}{key}.")
            else:
                required = key in part.get("required", ())
                yield (f"`{prefix}{key}`", "required" if required else shown(entry.get("default", {})), meaning(entry))

    return table(("key", "default", "meaning"), list(rows(whole, "")))


def shown(value: Any) -> str:
    """Return a default as YAML has it."""
    return f"`{json.dumps(value).replace(chr(34), '')}`"


def meaning(entry: dict[str, Any]) -> str:
    """Return what a key says of itself, and its choices where they are few words."""
    branches = [entry, *entry.get("anyOf", ()), *entry.get("oneOf", ()), entry.get("items", {})]
    words = [word for branch in branches for word in branch.get("enum", [branch["const"]] if "const" in branch else [])]
    text = entry.get("description", "")
    unsaid = [str(word) for word in words if not re.search(rf"\b{re.escape(str(word))}\b", text)]
    return f"{text} Choices: {', '.join(map(str, words))}.".strip() if unsaid else text


# The command line


def commands_page() -> str:
    """Return the page of all commands, from the click tree."""
    import click

    from bfi_cli.commands import cli

    lines = [
        "# Commands",
        "",
        "Made by `docs/generate.py` from the command line itself: `bfi COMMAND --help` says the same. What is common to"
        " all commands (exit codes, files of `--out`, JSON) is in [documents](documents.md), a worked example in the"
        " [guide](guide.md).",
        "",
    ]
    context = click.Context(cli, info_name="bfi")
    names = cli.list_commands(context)
    lines += [f"- [`bfi {name}`](#bfi-{name})" for name in names]
    commands = {name: cli.get_command(context, name) for name in names}
    rows = {
        name: [option_row(one) for one in command.params if isinstance(one, click.Option) and not one.hidden]
        for name, command in commands.items()
        if command is not None
    }
    times = Counter(row for of_command in rows.values() for row in of_command)
    common = [row for row in times if times[row] >= COMMON]
    lines += ["", "## Common options", "", "The same in several commands; each command names those that it has."]
    lines += ["", table(("option", "what it does", "default"), common)]
    for name, command in commands.items():
        assert command is not None
        arguments = [one.metavar or one.name.upper() for one in command.params if isinstance(one, click.Argument)]
        help_text = re.sub(r"\n\n\s*\n?", "\n\n", (command.help or "").replace("\b", "")).strip()
        lines += ["", f"## bfi {name}", "", "```text", " ".join(["bfi", name, *arguments, "[OPTIONS]"]), "```", ""]
        lines += [help_text, ""]
        shared = [f"`{row[0].strip('`').split()[0].rstrip(',')}`" for row in rows[name] if row in common]
        own = [row for row in rows[name] if row not in common]
        if shared:
            lines += [f"[Common options](#common-options): {' '.join(shared)}", ""]
        lines += [table(("option", "what it does", "default"), own)] if own else []
    return "\n".join(lines).rstrip() + "\n"


def option_row(option: Any) -> tuple[str, str, str]:
    """Return spelling, help and default of an option; a default that the help states is taken from there."""
    import click

    spelled = ", ".join(option.opts)
    if option.secondary_opts:
        spelled += " / " + ", ".join(option.secondary_opts)
    if isinstance(option.type, click.Choice):
        spelled += " " + "|".join(str(choice) for choice in option.type.choices)
    elif not option.is_flag:
        spelled += " " + (option.metavar or option.type.name.upper())
    text, _, default = (option.help or "").partition("[default: ")
    default = default.rstrip("] ")
    if option.show_default and not default:
        default = str(option.default)
    return f"`{spelled}`", " ".join(text.split()), default


# The public names


def api_page() -> str:
    """Return the page of the public names: those of `bfi_cli` itself."""
    import griffe

    package = griffe.load("bfi_cli", search_paths=[str(ROOT)], docstring_parser="numpy")
    lines = [
        "# Public names",
        "",
        "Made by `docs/generate.py` from the source. These are the names of `bfi_cli`; what is not here may change"
        " without notice. `help(NAME)` says the same.",
        "",
        "```text",
        package.docstring.value.strip(),
        "```",
    ]
    targets = {str(name): package.members[str(name)].final_target for name in package.exports if name != "__version__"}
    for name, target in sorted(targets.items(), key=lambda pair: (pair[1].kind.value, pair[0])):
        lines += ["", f"## {name}", "", *described(name, target), ""]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines).rstrip()) + "\n"


def described(name: str, target: Any) -> Iterator[str]:
    """Yield signature and docstring of a public object, with the public methods of a class."""
    if target.is_function:
        yield from ("```python", signature(name, target), "```")
    elif target.is_class:
        bases = ", ".join(str(base).rpartition(".")[2] for base in target.bases)
        fields = [
            one
            for one in target.members.values()
            if one.is_attribute and not one.name.startswith("_") and one.name != "model_config"
        ]
        body = [
            f"    {one.name}: {one.annotation}" + (f" = {one.value}" if one.value is not None else "")
            for one in fields
            if one.annotation is not None and "property" not in one.labels
        ]
        yield from ("```python", "\n".join([f"class {name}" + (f"({bases})" if bases else "") + ":", *body]), "```")
    else:
        value = str(target.value)
        yield from ("```python", f"{name} = {value if len(value) < 100 else '...'}", "```")
    yield ""
    yield from docstring(target)
    if target.is_class:
        for member in target.members.values():
            if not member.name.startswith("_") and (member.is_function or "property" in member.labels):
                text = member.docstring.value.split("\n")[0] if member.docstring else ""
                call = signature(member.name, member) if member.is_function else member.name
                yield from (f"- `{' '.join(call.removeprefix('def ').split())}`: {text}",)


def signature(name: str, function: Any) -> str:
    """Return a signature, on lines of its own where it is long."""
    words: list[str] = []
    kinds = [one.kind.value for one in function.parameters]
    for one, kind in zip(function.parameters, kinds, strict=True):
        if one.name in ("self", "cls"):
            continue
        if kind == "keyword-only" and "*" not in words and "variadic positional" not in kinds:
            words.append("*")
        star = {"variadic positional": "*", "variadic keyword": "**"}.get(kind, "")
        word = f"{star}{one.name}" + (f": {one.annotation}" if one.annotation is not None else "")
        words.append(word + (f" = {one.default}" if one.default is not None and not star else ""))
    answer = f" -> {function.returns}" if function.returns is not None else ""
    line = f"def {name}({', '.join(words)}){answer}"
    return line if len(line) <= 100 else f"def {name}(\n    " + ",\n    ".join(words) + f",\n){answer}"


def docstring(target: Any) -> Iterator[str]:
    """Yield a numpydoc docstring: its text, and a list for each of its sections."""
    for section in target.docstring.parsed if target.docstring else ():
        kind = section.kind.value
        if kind == "text":
            yield from (section.value, "")
        elif kind in ("parameters", "attributes", "returns", "raises", "yields"):
            yield from (f"**{kind.capitalize()}**", "")
            for item in section.value:
                # Shapes, units and reasons stand where numpydoc has a type; errors have no name but that.
                named, _, text = (
                    str(item.annotation or "").partition(" : ")
                    if kind == "raises"
                    else (getattr(item, "name", ""), "", str(item.annotation or ""))
                )
                text = " ".join(part for part in (text, " ".join(item.description.split())) if part)
                yield f"- `{named}`" + (f": {text}" if text else "")
            yield ""


# Outputs of the guide's commands


def guide_page(text: str, folder: Path) -> str:
    """Return the guide with the output of every `sh` block in the `text` block that follows it.

    An output that still agrees to the digits shown stays as it is. `<!-- first N lines -->` before the output cuts it.
    """
    for place in ("data", "configs"):
        (folder / place).symlink_to(ROOT / place)
    pattern = re.compile(
        r"```sh\n(?P<run>.*?)```\n(?P<between>\n(?:<!-- first (?P<lines>\d+) lines -->\n)?```text\n)?"
        r"(?P<shown>(?(between).*?)(?=```|$))?",
        re.DOTALL,
    )
    parts, end = [], 0
    for block in pattern.finditer(text):
        output = "\n".join(terminal_output(line, folder) for line in block["run"].splitlines() if line.strip())
        if block["between"]:
            wanted = output.splitlines()
            if block["lines"] and len(wanted) > int(block["lines"]):
                wanted = [*wanted[: int(block["lines"])], "..."]
            fresh = "\n".join(wanted) + "\n"
            stays = agrees(block["shown"], fresh)
            parts += [text[end : block.start("shown")], block["shown"] if stays else fresh]
            end = block.end("shown")
    return "".join(parts) + text[end:]


def readme_page(text: str, folder: Path) -> str:
    """Return the README with the output of its example, the block behind `<!-- example -->`."""
    example = re.search(r"<!-- example -->\n```sh\n.*?```\n\n```text\n.*?```\n", text, re.DOTALL)
    if example is None:
        raise SystemExit("README.md: no example with its output")
    return text[: example.start()] + guide_page(example[0], folder) + text[example.end() :]


def terminal_output(line: str, folder: Path) -> str:
    """Run one command line as on a terminal of 100 columns without colours, and return what it prints."""
    words = shlex.split(line)
    if words.pop(0) != "bfi":
        raise SystemExit(f"guide.md: only bfi is run, got {line}")
    ours, theirs = pty.openpty()
    plain = {"COLUMNS": str(COLUMNS), "NO_COLOR": "1", "TERM": "xterm", "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-m", "bfi_cli", *words],
        cwd=folder,
        stdout=theirs,
        stderr=subprocess.PIPE,
        env={**os.environ, **plain, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    os.close(theirs)
    printed = b""
    while piece := read_or_end(ours):
        printed += piece
    os.close(ours)
    _, complaint = process.communicate()
    if process.returncode:
        raise SystemExit(f"{line}: exit {process.returncode}: {complaint.decode()}")
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", printed.decode()).replace("\r\n", "\n")
    return "\n".join(row.rstrip() for row in text.splitlines()).strip("\n")


def read_or_end(terminal: int) -> bytes:
    """Read from a terminal; nothing once the other side is closed, which Linux calls an error."""
    try:
        return os.read(terminal, 65536)
    except OSError:
        return b""


def agrees(before: str, after: str) -> bool:
    """Say whether two outputs have the same words and, to the digits shown, the same numbers."""

    def words(text: str) -> str:
        return re.sub(r"[\s─]+", " ", NUMBER.sub("#", text)).strip()

    if words(before) != words(after):
        return False
    pairs = zip(NUMBER.findall(before), NUMBER.findall(after), strict=True)
    return all(abs(float(a) - float(b)) <= LAST_DIGITS * max(unit(a), unit(b)) * (1 + 1e-9) for a, b in pairs)


def unit(number: str) -> float:
    """Return the value of one in the last digit of a number as it is written."""
    mantissa, _, exponent = number.lower().partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def main() -> int:
    """Write or check the pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, exit 1 where something is out of date")
    parser.add_argument("--fast", action="store_true", help="leave out the guide's commands")
    wanted = parser.parse_args()
    made = pages()
    if not wanted.fast:
        guide = DOCS / "guide.md"
        with tempfile.TemporaryDirectory() as folder:
            made[guide] = guide_page(guide.read_text("utf-8"), Path(folder))
        with tempfile.TemporaryDirectory() as folder:
            made[README] = readme_page(README.read_text("utf-8"), Path(folder))
    stale = [path for path, text in made.items() if not path.exists() or path.read_text("utf-8") != text]
    for path in stale:
        if not wanted.check:
            path.write_text(made[path], "utf-8")
        print(f"{path.relative_to(ROOT)}: {'out of date; run python docs/generate.py' if wanted.check else 'written'}")
    return 1 if wanted.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
