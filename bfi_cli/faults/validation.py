"""All complaints about a document in one line: for each key its place, the complaint, and the remedy."""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar, get_args, runtime_checkable

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    Strict,
    StrictInt,
    ValidationError,
    ValidationInfo,
)
from pydantic_core import ErrorDetails, core_schema

from ..errors import BfiError
from ..printable import shortened
from .fault import did_you_mean, shown, unknown_key
from .shapes import SHAPES, lies_inside

Number = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Positive = Annotated[float, Strict(), Field(allow_inf_nan=False, gt=0)]
Whole = StrictInt
Text = Annotated[str, Field(min_length=1)]
Loc = tuple[int | str, ...]
M = TypeVar("M", bound=BaseModel)

BRANCH = re.compile(r"<[a-z]+>")  # of a union, as its tag names it
MAX_COMPLAINTS = 5  # more do not fit on a few rows of a terminal
# Letters of a key, and of a sentence of another module, in a complaint.
KEY_LETTERS, SENTENCE_LETTERS = 40, 300
_MAPPING, _WHOLE, _EMPTY = "must be a mapping of key: value", "must be a whole number", "must not be empty"
WRONG_KIND = {
    **dict.fromkeys(("dict_type", "mapping_type", "model_attributes_type", "model_type"), _MAPPING),
    **dict.fromkeys(("int_from_float", "int_type"), _WHOLE),
    **dict.fromkeys(("string_too_short", "too_short"), _EMPTY),
    "bool_type": "must be true or false",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "invalid_key": "a key must be text; put it in quotes",
    "string_type": "must be text; put it in quotes",
    "tuple_type": "must be a list",
}


class Rules(BaseModel):
    """A part of a document: unknown keys are errors, values cannot change, attribute docstrings are the editor's help.

    The docstrings are read when a schema is written, not at import, where they would cost a tenth of every command.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=False, defer_build=True)


class _Deferred:
    """Marks a part of a document whose rules are compiled when a document holds it, not with the whole."""

    def __get_pydantic_core_schema__(self, source: type[BaseModel], _handler: object) -> core_schema.CoreSchema:
        return deferred(lambda: source)


def deferred(model: Callable[[], type[BaseModel]]) -> core_schema.CoreSchema:
    """Return rules that make a model, and compile it, when the first value is validated by them.

    Compiled with the whole, the sections of the configuration and the shapes of a dictionary that no document of a run
    holds took a tenth of a second of every command.
    """

    def json_schema(_schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        made = model()
        made.model_rebuild()
        rules, parts = made.__pydantic_core_schema__, []
        if rules["type"] == "definitions":
            rules, parts = rules["schema"], rules["definitions"]
        # With a reference, so that the schema names the model among its definitions.
        named = {**rules, "ref": f"{made.__module__}.{made.__qualname__}:{id(made)}"}
        return handler(core_schema.definitions_schema(named, parts))

    return core_schema.with_info_plain_validator_function(
        lambda value, info: model().model_validate(value, context=info.context),
        metadata={"pydantic_js_annotation_functions": [json_schema]},
    )


Deferred = Annotated[M, _Deferred()]


@runtime_checkable
class OneOfModels(Protocol):
    """A mark of values that are validated by one of several models."""

    def models(self) -> Iterator[type[BaseModel]]:
        """Yield the models."""


def validate(
    model: type[M], data: object, *, where: str, error: type[BfiError], context: Mapping[str, object] | None = None
) -> M:
    """Return `data` as a `model`.

    Raises
    ------
    error : all complaints about `data` in one line, `where: key: what | key: what`.
    """
    try:
        return model.model_validate(data, context=dict(context or {}))
    except ValidationError as fault:
        details = fault.errors(include_url=False)
    # A list from which elements were refused is not complained of as too short.
    details = [detail for detail in details if detail["type"] != "too_short" or not len(detail["input"])]
    complaints: list[str] = []
    for n, detail in enumerate(details):
        if len(complaints) == MAX_COMPLAINTS:
            complaints.append(f"and {len(details) - n} more; mend these first")
            break
        place, text = _place(detail["loc"], detail["type"]), " ".join(_sentence(model, detail).split())
        complaints.append(f"{place}: {text}" if place else text)
        complaints = list(dict.fromkeys(complaints))
    raise error(f"{where}: {' | '.join(complaints)}")


def path_beside(file: str, info: ValidationInfo, document: str) -> str:
    """Return the path of a sample file that a document names relative to its own folder, in which it must lie.

    A document without a file is the caller's, whose sample files may lie anywhere.

    Parameters
    ----------
    document : name of the document in messages.

    Raises
    ------
    ValueError : the file lies outside the folder, and the context does not allow that, or its name is impossible.
    """
    context = info.context or {}
    path = Path(context.get("folder", "")) / file
    try:
        is_inside = "folder" not in context or lies_inside(path, Path(context["folder"]))
    except (OSError, ValueError):
        raise ValueError(f"no such file, got {shown(str(path))}; give a CSV file of time, value") from None
    if not is_inside and not context.get("allow_outside"):
        raise ValueError(f"{shown(file)} lies outside the {document}'s folder; move it there or give --allow-outside")
    return str(path)


def editor_schema(model: type[BaseModel], title: str) -> dict[str, Any]:
    """Return the JSON schema of a document, with the dialect that editors look for and readable names of its parts."""
    schema = model.model_json_schema()
    by_title = {part["title"]: part for part in schema["$defs"].values()}
    seen, pending = set(), [model]
    while pending:
        part = pending.pop()
        if part in seen:
            continue
        seen.add(part)
        pending += [below for key in part.model_fields for below in _models(part, key)]
        described = schema if part is model else by_title[part.__name__]
        for key, description in _attribute_docstrings(part).items():
            described["properties"][part.model_fields[key].alias or key]["description"] = description
    text = json.dumps(schema)
    for name, definition in schema["$defs"].items():
        part_title = definition["title"]
        text = text.replace(f'"{name}": {{', f'"{part_title}": {{').replace(f'/{name}"', f'/{part_title}"')
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **json.loads(text), "title": title}


def _attribute_docstrings(part: type[BaseModel]) -> dict[str, str]:
    """Return the string that follows each attribute in the source of a model and its bases."""
    described: dict[str, str] = {}
    for owner in reversed(part.__mro__):
        if issubclass(owner, Rules) and not owner.__pydantic_generic_metadata__["args"]:
            described |= _own_docstrings(owner)
    return described


@cache
def _own_docstrings(owner: type[BaseModel]) -> dict[str, str]:
    """Return the string that follows each attribute in the source of a model, without its bases."""
    described: dict[str, str] = {}
    try:
        source = inspect.getsource(owner)
    except OSError:  # made from an entry of `bfi_cli.faults.shapes`; its fields carry their descriptions
        return described
    (definition,) = ast.parse(textwrap.dedent(source)).body
    assert isinstance(definition, ast.ClassDef)
    for statement, after in pairwise(definition.body):
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            match after:
                case ast.Expr(value=ast.Constant(value=str(text))):
                    described[statement.target.id] = inspect.cleandoc(text)
    return described


def _place(loc: Loc, kind: str) -> str:
    """Return "atoms[0].onset_s": the branches of unions that pydantic puts into a location are left out."""
    path = ""
    for before, part in zip((None, *loc), loc, strict=False):
        if isinstance(part, int):
            path += f"[{part}]"
        elif not (BRANCH.fullmatch(part) or (isinstance(before, int) and part in SHAPES)):
            key = shortened(part, KEY_LETTERS)
            path += f".{key}" if path else key or "''"
    # A union without a tag of its own complains about the whole entry, and means its `shape`.
    return f"{path}.shape" if kind in ("union_tag_invalid", "union_tag_not_found") else path


def _sentence(model: type[BaseModel], details: ErrorDetails) -> str:
    kind, value, limits = details["type"], shown(details["input"]), details.get("ctx", {})
    match kind:
        case "extra_forbidden":
            return unknown_key(str(details["loc"][-1]), _known_keys(model, details["loc"]))
        case "union_tag_invalid":
            known = [tag.strip("' ") for tag in limits["expected_tags"].split(",")]
            return f"unknown shape, got {shown(limits['tag'])}{did_you_mean(limits['tag'], known)}"
        case "missing" | "union_tag_not_found":
            return "missing; add it"
        case "literal_error":
            known = limits["expected"].replace(" or ", ", ").replace("'", "").split(", ")
            number = "a number or " if "<word>" in details["loc"] else ""
            return f"not {number}one of the choices, got {value}{did_you_mean(details['input'], known)}"
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            return f"{details['msg'].replace('Input should', 'must')}, got {value}"
        case "value_error":
            return shortened(str(limits["error"]), SENTENCE_LETTERS)
    wrong = WRONG_KIND.get(kind) or f"{details['msg'][:1].lower()}{details['msg'][1:]}; write another value"
    what, semicolon, remedy = wrong.partition(";")
    return f"{what}, got {value}{semicolon}{remedy}"


def _known_keys(model: type[BaseModel], loc: Loc) -> list[str]:
    """Return the keys allowed beside the last part of `loc`, found by walking the models' annotations."""
    here = [model]
    for part in loc[:-1]:
        below = [m for parent in here if part in parent.model_fields for m in _models(parent, str(part))]
        tagged = [m for m in here if "shape" in m.model_fields and part in get_args(m.model_fields["shape"].annotation)]
        here = below or tagged or here
    return list(dict.fromkeys(field.alias or key for m in here for key, field in m.model_fields.items()))


def _models(parent: type[BaseModel], key: str) -> Iterator[type[BaseModel]]:
    pending: list[Any] = [parent.model_fields[key].annotation]
    while pending:
        annotation = pending.pop()
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield annotation
        elif isinstance(annotation, OneOfModels):
            yield from annotation.models()
        pending.extend(get_args(annotation))
