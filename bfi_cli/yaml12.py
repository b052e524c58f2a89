"""YAML with the core rules of version 1.2: `1e-3` is a number, `no` and `12:30:00` are text, a key stands once.

Of version 1.1 the merge key is read, `<<: *name`.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, NoReturn, cast

import yaml

from .errors import BfiError, ConfigError, reason_of
from .printable import shortened

NULL = re.compile(r"(?:~|null|Null|NULL|)\Z")
BOOL = re.compile(r"(?:true|True|TRUE|false|False|FALSE)\Z")
INT = re.compile(r"(?:[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)\Z")
FLOAT = re.compile(
    r"(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))\Z"
)
TAG = "tag:yaml.org,2002:"

# A dictionary of 10 000 faults, the most there may be, of four keys each; PyYAML reads some 20 000 values in a second.
MAX_VALUES = 100_000
# Those values at 40 letters each.
MAX_BYTES = 4_000_000
# A seed of 128 bits has 39; Python itself refuses to read and show numbers of more than 4300 digits.
MAX_DIGITS = 50
# PROBLEM_LETTERS: letters of an alias, a tag or a token that a complaint of PyYAML quotes.
PROBLEM_LETTERS = 160


class _Loader(yaml.SafeLoader):
    """PyYAML's reader with its own (version 1.1) scalar rules and constructors removed, and aliases counted."""

    yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012
    yaml_constructors: ClassVar[dict[Any, Any]] = {}

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.n_values = 0
        self.sizes: dict[str | None, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a value and count it, an alias as all values of its anchor; too many values are refused."""
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        before = self.n_values
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in self.anchors and event.anchor not in self.sizes:
                _refuse(event, f"alias '{event.anchor}' stands in its own value; write it out")
            self.n_values += self.sizes.get(event.anchor, 0)
            if self.n_values > MAX_VALUES:
                _refuse(event, f"aliases expand to more than {MAX_VALUES} values; write them out")
        else:
            self.n_values += 1
            if self.n_values > MAX_VALUES:
                _refuse(event, f"more than {MAX_VALUES} values; shorten the document")
        node = super().compose_node(parent, index)
        if not isinstance(event, yaml.AliasEvent) and event.anchor is not None:
            self.sizes[event.anchor] = self.n_values - before
        return node


if yaml.__with_libyaml__:

    class _QuickLoader(yaml.CSafeLoader, _Loader):
        """The same with libyaml for the letters, a fifth of the time; nodes and values are made by the same rules."""

        get_single_node = _Loader.get_single_node

        def __init__(self, text: str) -> None:
            yaml.CSafeLoader.__init__(self, text)
            yaml.composer.Composer.__init__(self)
            self.n_values = 0
            self.sizes: dict[str | None, int] = {}


def _refuse(node: Any, problem: str) -> NoReturn:
    raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


def _scalar(pattern: re.Pattern[str], kind: str, convert: Callable[[str], object]) -> None:
    """Read text that matches a pattern as a kind of scalar."""

    def construct(loader: _Loader, node: yaml.ScalarNode) -> object:
        text = loader.construct_scalar(node)
        if kind == "int" and len(text) > MAX_DIGITS:
            _refuse(node, f"a whole number of {len(text)} digits; give one of at most {MAX_DIGITS}")
        if not pattern.match(text):
            _refuse(node, f"'{text:.40}' is not of type {kind}")
        return convert(text)

    _Loader.add_implicit_resolver(f"{TAG}{kind}", pattern, None)
    _Loader.add_constructor(f"{TAG}{kind}", construct)


def _mapping(loader: _Loader, node: yaml.Node) -> dict[Any, Any]:
    if not isinstance(node, yaml.MappingNode):
        _refuse(node, "not a mapping")
    result: dict[Any, Any] = {}
    merged: dict[Any, Any] = {}
    merges = 0
    for key_node, value_node in node.value:
        if isinstance(key_node, yaml.ScalarNode) and not key_node.style and key_node.value == "<<":
            merges += 1
            if merges > 1:
                _refuse(key_node, "key '<<' stands twice; give it a list, <<: [*a, *b]")
            merged = _merged(loader, value_node)
            continue
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str | int | float | bool | None):
            _refuse(key_node, "a key must be a plain word")
        if key in result:
            _refuse(key_node, f"key '{shortened(str(key), 40)}' stands twice; keep one")
        result[key] = loader.construct_object(value_node, deep=True)
    return merged | result


def _merged(loader: _Loader, node: yaml.Node) -> dict[Any, Any]:
    """Return the keys of a mapping, or of a list of mappings of which the first counts, that `<<` puts in another.

    The merge key of version 1.1, which version 1.2 has no more, since configurations use it and no key of ours is `<<`.
    """
    values = loader.construct_object(node, deep=True)
    merged: dict[Any, Any] = {}
    for value in reversed(values if isinstance(values, list) else [values]):
        if not isinstance(value, dict):
            _refuse(node, "'<<' merges mappings; write <<: *name or <<: [*a, *b]")
        merged |= value
    return merged


def _sequence(loader: _Loader, node: yaml.Node) -> list[Any]:
    if not isinstance(node, yaml.SequenceNode):
        _refuse(node, "not a list")
    return [loader.construct_object(child, deep=True) for child in node.value]


_scalar(NULL, "null", lambda text: None)
_scalar(BOOL, "bool", lambda text: text.lower() == "true")
_scalar(INT, "int", lambda text: int(text, {"0o": 8, "0x": 16}.get(text[:2], 10)))
_scalar(FLOAT, "float", lambda text: float(text.replace(".", "") if text[-1] in "fFnN" else text))
_Loader.add_constructor(f"{TAG}str", lambda loader, node: str(loader.construct_scalar(cast("yaml.ScalarNode", node))))
_Loader.add_constructor(f"{TAG}map", _mapping)
_Loader.add_constructor(f"{TAG}seq", _sequence)
_Loader.add_constructor(
    None,
    lambda _, node: _refuse(node, f"unknown tag '{node.tag.removeprefix(TAG)}'; write the value without a tag"),
)


def load_yaml(source: str | Path, *, where: str | None = None, error: type[BfiError] = ConfigError) -> Any:
    """Return the one document of a YAML 1.2 file (a `Path`) or text (a `str`).

    Parameters
    ----------
    source : a path is read as UTF-8; text is parsed as it stands.
    where : what messages call the source; default the path, or "yaml".
    error : the class to raise.

    Raises
    ------
    error : the file cannot be read or is not YAML; one line with file, line and column.
    """
    name = where or (str(source) if isinstance(source, Path) else "yaml")
    text = read_text(source, error=error) if isinstance(source, Path) else source
    if yaml.__with_libyaml__:
        # What it refuses is read again for the complaint, which names what is wrong and where.
        with contextlib.suppress(yaml.YAMLError, ValueError, OverflowError, RecursionError):
            return yaml.load(text, Loader=_QuickLoader)
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as fault:
        problem = shortened(" ".join(f"{fault.problem or fault.context or 'not YAML'}".split()), PROBLEM_LETTERS)
        problem += "" if ";" in problem else "; mend the YAML"
        mark = fault.problem_mark or fault.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise error(f"{name}: {where}{problem}") from None
    except yaml.reader.ReaderError as fault:
        line = text.count("\n", 0, fault.position) + 1
        column = fault.position - text.rfind("\n", 0, fault.position)
        raise error(f"{name}: line {line}, column {column}: a character YAML does not allow; remove it") from None
    except RecursionError:
        raise error(f"{name}: nested too deeply; flatten the document") from None
    except (ValueError, OverflowError):  # PyYAML's own, of an escape such as "\\UFFFFFFFF"
        raise error(f"{name}: an escape that stands for no character; mend the YAML") from None


def read_text(path: Path, *, error: type[BfiError], most_bytes: int = MAX_BYTES) -> str:
    """Return the text of a UTF-8 file.

    Raises
    ------
    error : it does not exist, cannot be read, is larger than `most_bytes`, or is not UTF-8.
    """
    try:
        with path.open("rb") as file:  # not its size first: a pipe or a device has none
            data = file.read(most_bytes + 1)
        if len(data) > most_bytes:
            raise error(f"{path}: larger than {most_bytes / 1e6:g} MB, the most that is read; shorten it")
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as fault:
        raise error(f"{path}: byte {fault.start} is not UTF-8 text; save the file as UTF-8") from None
    except (OSError, ValueError) as fault:
        raise error(f"{path}: cannot be read, {reason_of(fault)}; check the path") from None
