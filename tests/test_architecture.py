"""The shape of the house: imports point down, each library has one place, what is public is described."""

from __future__ import annotations

import ast
import graphlib
import importlib
import json
import re
import subprocess
import symtable
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import click
import pytest

from bfi_cli.commands import COMMANDS, cli

PACKAGE = Path(__file__).parents[1] / "bfi_cli"

# From the ground up. A module imports what stands on lower floors, and its own package; neighbours know nothing of
# each other. The longest name counts: what several analyses share is below them, wherever its file lies.
FLOORS = (
    ("epoch", "errors", "first_use", "guard", "kernels", "methods", "notes", "printable", "threads"),
    ("airdata", "engine", "files", "programs", "quantities", "yaml12"),
    ("faults", "serialization"),
    ("decision", "dictionary", "flightlog", "journal", "jsbsim"),
    ("aircraft", "config", "report"),
    ("model",),
    ("audit", "detection", "diagnosability", "flight"),
    ("analysis", "fleet"),
    ("lab", "proof"),
    ("library",),
    ("commands",),
    ("__main__",),
)
FLOOR = {unit: floor for floor, units in enumerate(FLOORS) for unit in units}
HOME = {
    "click": {"commands"},
    "matplotlib": {"report"},
    "dask": {"engine"},
    "distributed": {"engine"},
    "h5py": {"flightlog", "files"},
    "jinja2": {"report"},
    "jsbsim": {"jsbsim"},
    "ruptures": {"lab"},
    "nptdms": {"flightlog"},
    "pyarrow": {"fleet"},
    "yaml": {"yaml12"},
}
SLOW = ("dask", "distributed", "h5py", "jinja2", "matplotlib", "pyarrow", "rich", "ruptures")
# The parts of scipy that are imported in tenths of a second; the others take one second and are not always needed.
SCIPY = {"fft", "linalg", "special"}
EMPTY = re.compile(r"one|own|told|said|found|_?of_\w+")
VAGUE = {"utils", "util", "helpers", "helper", "common", "base", "core", "misc"}

FILES = {".".join(path.relative_to(PACKAGE).with_suffix("").parts): path for path in sorted(PACKAGE.rglob("*.py"))}
MODULES = {name.removesuffix(".__init__"): path for name, path in FILES.items() if name != "__init__"}


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


LOOKED_AT = (
    *(ast.Import, ast.ImportFrom, ast.Raise, ast.FunctionDef),
    *(ast.Dict, ast.List, ast.Tuple, ast.Set),
)


@cache
def nodes(path: Path) -> dict[type[ast.AST], list[ast.AST]]:
    """Return the nodes of a file that the tests look at, by their kind: one walk for all of them."""
    found: dict[type[ast.AST], list[ast.AST]] = {kind: [] for kind in LOOKED_AT}
    left: list[ast.AST] = [tree(path)]
    for node in left:  # grows, and is walked in half the time of `ast.walk`
        if type(node) in found:
            found[type(node)].append(node)
        for value in vars(node).values():
            if isinstance(value, list):
                left.extend(part for part in value if isinstance(part, ast.AST))
            elif isinstance(value, ast.AST) and not isinstance(value, ast.expr_context | ast.operator):
                left.append(value)
    return found


@cache
def imports(path: Path) -> tuple[tuple[str, ast.stmt], ...]:
    """Return the modules a file imports, those of this package as ".name"."""
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[tuple[str, ast.stmt]]:
    package = path.relative_to(PACKAGE).parent.parts
    for node in (*nodes(path)[ast.Import], *nodes(path)[ast.ImportFrom]):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module or "", node
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) + 1 - node.level]
            for alias in node.names:
                parts = (*above, *(node.module or "").split("."), alias.name)
                yield "." + inner(".".join(filter(None, parts))), node


def inner(name: str) -> str:
    """Return the module of a dotted name: itself, or what it is a name in; "" for the package's own names."""
    while name and name not in MODULES:
        name = name.rpartition(".")[0]
    return name


def unit(name: str) -> str:
    """Return the entry of `FLOORS` a module belongs to."""
    while name and name not in FLOOR:
        name = name.rpartition(".")[0]
    return name


def test_every_module_has_a_floor():
    assert [name for name in MODULES if not unit(name)] == []


def test_folders_of_tests_are_those_of_the_package():
    """What runs on whole commands, on stored answers, on many trials or for its speed has folders of its own."""
    files = PACKAGE.with_name("tests").rglob("test_*.py")
    folders = {path.parent.relative_to(PACKAGE.with_name("tests")) for path in files}
    others = {Path("lock"), Path("measurements"), Path("benchmarks")}
    assert [str(folder) for folder in sorted(folders - others) if not (PACKAGE / folder).is_dir()] == []


def test_imports_point_down():
    wrong = {
        f"{name} -> {target[1:]}"
        for name, path in MODULES.items()
        for target, _ in imports(path)
        if target.startswith(".") and target != "." and unit(name) != unit(target[1:])
        if FLOOR[unit(target[1:])] >= FLOOR[unit(name)]
    }
    assert wrong == set()


def test_nothing_is_imported_by_its_absolute_name():
    absolute = [name for name, path in FILES.items() for target, _ in imports(path) if target.startswith("bfi_cli")]
    assert absolute == []


def test_no_module_imports_itself_in_a_circle():
    graph = {name: {t[1:] for t, _ in imports(path) if t.startswith(".")} - {name} for name, path in MODULES.items()}
    assert list(graphlib.TopologicalSorter(graph).static_order())


def test_kernels_import_numpy_scipy_and_each_other():
    allowed = {*sys.stdlib_module_names, "numpy", "scipy", ".kernels"}
    wrong = {
        f"{name} -> {target}"
        for name, path in MODULES.items()
        if unit(name) == "kernels"
        for target, _ in imports(path)
        if (f".{unit(target[1:])}" if target.startswith(".") else target.partition(".")[0]) not in allowed
    }
    assert wrong == set()


def test_kernels_raise_value_errors_only():
    wrong = [
        f"{name}:{node.lineno}"
        for name, path in MODULES.items()
        if unit(name) == "kernels"
        for node in nodes(path)[ast.Raise]
        if isinstance(node.exc, ast.Call)
        if ast.unparse(node.exc.func) not in ("ValueError", "np.linalg.LinAlgError")
    ]
    assert wrong == []


@pytest.mark.parametrize(("library", "home"), HOME.items())
def test_a_library_has_its_place(library: str, home: set[str]):
    importers = {
        unit(name)
        for name, path in MODULES.items()
        for target, _ in imports(path)
        if target.partition(".")[0] == library
    }
    assert importers <= home


def test_what_takes_long_to_import_is_imported_where_it_is_used():
    """Inside functions; names for annotations stand under TYPE_CHECKING."""
    wrong = [
        f"{name}: {target}"
        for name, path in MODULES.items()
        for target, node in imports(path)
        if node in tree(path).body and target.partition(".")[0] in SLOW
    ]
    assert wrong == []


def test_little_of_scipy_is_imported_before_it_is_used():
    """On the way to an answer scipy.signal and scipy.stats would take longer than the analysis."""
    wrong = {
        f"{name}: scipy.{part}"
        for name, path in MODULES.items()
        for node in tree(path).body
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "scipy"
        for part in ([one.name for one in node.names] if node.module == "scipy" else [node.module.split(".")[1]])
        if part not in SCIPY
    }
    assert wrong == set()


HELP = """
import json, sys
before = set(sys.modules)
from bfi_cli.commands import run_command
code = run_command(["--help"])
print(json.dumps([code, sorted(set(sys.modules) - before)]), file=sys.stderr)
"""


def test_help_imports_click_and_little_of_this_package():
    done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, cwd=PACKAGE.parent, check=True)
    code, loaded = json.loads(done.stderr)
    tops = {name.partition(".")[0] for name in loaded}
    assert code == 0
    assert tops - sys.stdlib_module_names <= {"bfi_cli", "click", "colorama"}
    ours = {name.removeprefix("bfi_cli") for name in loaded if name.startswith("bfi_cli")}
    assert ours == {"", ".commands", ".errors", ".printable"}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_a_module_and_a_help(name: str):
    assert f"commands.{name.replace('-', '_')}" in MODULES
    with click.Context(cli) as context:
        command = cli.get_command(context, name)
    assert command is not None
    assert command.name == name
    assert command.help
    for option in command.params:
        assert isinstance(option, click.Argument) or option.help or option.type.name == "choice", option.name


def test_no_module_has_a_vague_name():
    assert [name for name in MODULES if VAGUE & set(name.split("."))] == []


def empty_names(table: symtable.SymbolTable) -> Iterator[str]:
    """Yield the names that a source binds in any scope and that say nothing of what they hold."""
    for symbol in table.get_symbols():
        name = symbol.get_name()
        if (symbol.is_assigned() or symbol.is_parameter()) and EMPTY.fullmatch(name) and not symbol.is_imported():
            yield f"{table.get_name()}:{name}"
    for child in table.get_children():
        yield from empty_names(child)


def test_a_name_says_what_it_holds():
    """A noun of the field: neither `one`, `own`, `told`, `said`, `found` nor "of" something that is not named."""
    empty = {
        name: [*empty_names(symtable.symtable(path.read_text("utf-8"), name, "exec"))] for name, path in FILES.items()
    }
    assert {name: names for name, names in empty.items() if names} == {}


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("found = [one for one in range(3)]\n", ["top:found", "listcomp:one"]),
        ("def of_log(own):\n    return own\n", ["top:of_log", "of_log:own"]),
        ("class Share:\n    _of_row: int\n", ["Share:_of_row"]),
        ("founder = done = 1\n", []),
    ],
)
def test_a_name_that_says_nothing_is_seen(source: str, names: list[str]):
    assert [*empty_names(symtable.symtable(source, "source", "exec"))] == names


def test_what_is_public_is_described():
    definitions = [
        (f"{name}.{node.name}", node)
        for name, path in FILES.items()
        for node in tree(path).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    ]
    described = [(name, tree(path)) for name, path in FILES.items()] + definitions
    assert [name for name, node in described if not ast.get_docstring(node)] == []


def test_what_a_module_offers_exists():
    modules = {name: importlib.import_module(f"bfi_cli.{name}") for name in sorted(MODULES)}
    assert [
        f"{name}.{offered}"
        for name, module in modules.items()
        for offered in getattr(module, "__all__", ())
        if not hasattr(module, offered)
    ] == []


def numeric(value: ast.expr) -> bool:
    """Return whether an expression is made of numbers: of them, of names, and of what numpy makes of both."""
    made = (ast.Constant, ast.Name, ast.Attribute, ast.Call, ast.BinOp, ast.UnaryOp, ast.Tuple, ast.List, ast.Dict)
    nodes = [node for node in ast.walk(value) if isinstance(node, ast.expr)]
    calls = (ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call))
    return (
        all(isinstance(node, made) for node in nodes)
        and any(isinstance(node, ast.Constant) and type(node.value) in (int, float) for node in nodes)
        and all(call in ("float", "range", "tuple") or call.startswith(("np.", "math.")) for call in calls)
    )


def uncommented(source: str, module: ast.Module) -> list[str]:
    """Return the numeric constants of a module without a comment on a line of theirs or above their block of lines."""
    lines, found = source.splitlines(), []
    for node in module.body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None or not numeric(node.value):
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        name = ", ".join(ast.unparse(target) for target in targets)
        # The version of a document is what the document's page says.
        if not re.search(r"^\W*_?[A-Z]", name) or name.endswith("SCHEMA"):
            continue
        first = node.lineno - 1
        while first and lines[first - 1].strip() and not lines[first - 1].startswith(("#", "def ", "class ", "@")):
            first -= 1
        headed = first and lines[first - 1].startswith("#")
        if not headed and not any("  # " in line for line in lines[node.lineno - 1 : node.end_lineno]):
            found.append(name)
    return found


def test_every_number_has_its_source_beside_it():
    found = {name: uncommented(path.read_text("utf-8"), tree(path)) for name, path in FILES.items()}
    assert {name: bare for name, bare in found.items() if bare} == {}


@pytest.mark.parametrize(
    ("source", "bare"),
    [
        ("A = 1.5\n", ["A"]),
        ("A = 1.5  # of a second\n", []),
        ("# Of a second.\nA = 1.5\nB, C = 2, np.array([3.0])\n", []),
        ("# Of a second.\n\nA = 1.5\n", ["A"]),
        ("A: float = -(2**3)\n", ["A"]),
        ("A = {'tas': 1.0}\n\nB = np.geomspace(1.0, 2.0, 3)\n", ["A", "B"]),
        ("A = 'text'\nB = frozenset()\nc = 1.0\nA_SCHEMA = 2\nD = Path(__file__)\n", []),
    ],
)
def test_a_number_without_a_source_is_found(source: str, bare: list[str]):
    assert uncommented(source, ast.parse(source)) == bare


# A body is one step that a textbook would number, or the numbered steps of an algorithm on a page.
LONGEST_BODY, MOST_PARAMETERS = 60, 8
# What asks for more today: nothing is added here, and what is done goes.
MANY = {"flightlog.read.read_log", "model.onset.claims.claims_of"}


def body_lines(function: ast.FunctionDef) -> int:
    """Return the lines of a body, without its docstring and without what only lists: literals of more than a line."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    if not body:
        return 0
    literals = {
        line
        for statement in body
        for node in ast.walk(statement)
        if isinstance(node, ast.Dict | ast.List | ast.Tuple)
        for line in range(node.lineno + 1, (node.end_lineno or 0) + 1)
        if not any(isinstance(one, ast.Call | ast.comprehension) for one in ast.walk(node))
    }
    return (function.end_lineno or 0) - body[0].lineno + 1 - len(literals)


def n_parameters(function: ast.FunctionDef) -> int:
    given = function.args
    named = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    return len([one for one in named if one.arg not in ("self", "cls")])


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield every function and method of the package by its name."""
    for name, path in MODULES.items():
        for node in nodes(path)[ast.FunctionDef]:
            yield f"{name}.{node.name}", node


def test_a_body_is_read_at_once():
    long = [(name, node) for name, node in functions() if node.end_lineno - node.lineno > LONGEST_BODY]
    assert {name: n for name, node in long if (n := body_lines(node)) > LONGEST_BODY} == {}


def test_a_function_asks_for_few_things():
    many = {name: n for name, node in functions() if (n := n_parameters(node)) > MOST_PARAMETERS}
    assert {name: n for name, n in many.items() if name not in MANY} == {}


def test_what_is_said_to_ask_for_many_exists():
    assert {name for name, _ in functions()} >= MANY


@pytest.mark.parametrize(("n_steps", "n_rows"), [(5, 0), (5, 90), (61, 0)])
def test_tables_are_no_steps_of_a_body(n_steps: int, n_rows: int):
    steps = "".join(f"    x = {k}\n" for k in range(n_steps))
    rows = "    rows = (\n" + "".join(f"        {k},\n" for k in range(n_rows)) + "    )\n" if n_rows else ""
    (function,) = ast.parse(f'def f(a, *, b):\n    """Return."""\n{steps}{rows}').body
    assert isinstance(function, ast.FunctionDef)
    assert body_lines(function) == n_steps + (n_rows > 0)
    assert n_parameters(function) == 2


CONTRIBUTING = PACKAGE.parent / "CONTRIBUTING.md"
TO_ADD = re.findall(r"^\| (a .+?) \| (.+) \| (.+) \|$", CONTRIBUTING.read_text("utf-8"), re.MULTILINE)


def named_files(text: str) -> list[tuple[str, list[str]]]:
    """Return the files that a text names in code, each with the tables that follow it."""
    found: list[tuple[str, list[str]]] = []
    for code in re.findall(r"`([^`]+)`", text):
        if code.endswith(".py"):
            found.append((code, []))
        elif found:
            found[-1][1].append(code)
    return found


def defined(path: Path) -> set[str]:
    """Return the names that a module defines on its own."""
    assigned = (
        target
        for node in tree(path).body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
    )
    made = (node.name for node in tree(path).body if isinstance(node, ast.FunctionDef | ast.ClassDef))
    return {*map(ast.unparse, assigned), *made}


def test_the_guide_says_how_to_add_each_kind_of_thing():
    assert [what for what, _, _ in TO_ADD] == [
        "a shape",
        "a method",
        "a reader",
        "a relation",
        "a source of evidence",
        "a command",
    ]
    assert len(CONTRIBUTING.read_text("utf-8").splitlines()) <= 150


@pytest.mark.parametrize(("files", "tests"), [row[1:] for row in TO_ADD], ids=[row[0] for row in TO_ADD])
def test_what_is_to_be_touched_is_where_the_guide_says(files: str, tests: str):
    existing = [(name, tables) for name, tables in named_files(files) if not re.search("[A-Z]{4}", name)]
    assert any(tables for _, tables in existing)
    for name, tables in existing:
        assert (PACKAGE / name).is_file(), name
        assert {*tables} <= defined(PACKAGE / name), name
    for name, _ in named_files(tests):
        assert (CONTRIBUTING.parent / "tests" / name).is_file(), name


@pytest.mark.parametrize(("module", "registry"), [("methods", "METHODS"), ("faults.shapes", "SHAPES")])
def test_an_entry_of_a_table_stands_in_no_other_list(module: str, registry: str):
    """No other display of the package lists most of the entries of a table: what is added once is known throughout."""
    entries = {*getattr(importlib.import_module(f"bfi_cli.{module}"), registry)}
    copies = [
        f"{name}:{node.lineno}"
        for name, path in MODULES.items()
        for kind in (ast.Dict, ast.List, ast.Tuple, ast.Set)
        for node in nodes(path)[kind]
        if len(entries & {one.value for one in ast.iter_child_nodes(node) if isinstance(one, ast.Constant)})
        > 0.6 * len(entries)
        if name != module
    ]
    assert copies == []


def test_tests_import_no_private_names():
    imported = re.compile(r"^ *from bfi_cli[\w.]* import (\([^)]*\)|.*)", re.MULTILINE)
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        names = " ".join(imported.findall(path.read_text(encoding="utf-8")))
        assert not re.findall(r"\b_[a-z]\w*", names), path
