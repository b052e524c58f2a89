"""`dataclass` for frozen data: of a class its constructor alone is made, what all of them share is written once.

For every frozen class `dataclasses` makes five functions of text, before Python 3.13 one at a time: a tenth of a short
command, for the classes that it imports.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import MISSING, FrozenInstanceError, fields
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(
        *, frozen: bool, slots: bool = False, kw_only: bool = False, eq: bool = True, repr: bool = True
    ) -> Callable[[type], type]:
        """Return what makes a dataclass of a class, as that of `dataclasses`; `frozen` is stated and always true."""
        if not frozen:
            raise ValueError("frozen must be true; take the dataclass of dataclasses for data that change")
        shared = {"__setattr__": _refuse, "__delattr__": _refuse}
        shared |= {"__getstate__": _values, "__setstate__": _restore} if slots else {}
        shared |= {"__eq__": _equals, "__hash__": _hash} if eq else {}
        shared |= {"__repr__": _repr} if repr else {}

        def make(kind: type) -> type:
            made = dataclasses.dataclass(init=False, repr=False, eq=False, slots=slots, kw_only=kw_only)(kind)
            for name, method in {"__init__": _constructor(made), **shared}.items():
                if name not in vars(made):
                    setattr(made, name, method)
            return made

        return make


def _constructor(made: type) -> Callable[..., None]:
    """Return the constructor of a dataclass, which sets fields past the refusal to change them."""
    known: dict[str, Any] = {"_set": object.__setattr__, "_none_given": object()}
    arguments: list[str] = []
    body: list[str] = []
    for field in sorted(fields(made), key=lambda field: bool(field.kw_only)):
        name, value, default = field.name, field.name, ""
        if field.default is not MISSING:
            known[f"_default_{name}"] = field.default
            value, default = (name, f"=_default_{name}") if field.init else (f"_default_{name}", "")
        elif field.default_factory is not MISSING:
            known[f"_make_{name}"] = field.default_factory
            value, default = f"_make_{name}() if {name} is _none_given else {name}", "=_none_given"
            value = value if field.init else f"_make_{name}()"
        if field.kw_only and "*" not in arguments:
            arguments.append("*")
        arguments += [name + default] if field.init else []
        body.append(f"_set(self, {name!r}, {value})")
    body += ["self.__post_init__()"] if hasattr(made, "__post_init__") else []
    exec(f"def __init__(self, {', '.join(arguments).removesuffix('*')}):\n " + "\n ".join(body or ["pass"]), known)
    constructor: Callable[..., None] = known["__init__"]
    constructor.__qualname__ = f"{made.__qualname__}.__init__"
    return constructor


def _refuse(self: Any, name: str, *_value: object) -> None:
    raise FrozenInstanceError(f"cannot change field '{name}'")


def _values(self: Any) -> list[Any]:
    return [getattr(self, field.name) for field in fields(self)]


def _restore(self: Any, state: list[Any]) -> None:
    for field, value in zip(fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)


def _compared(self: Any) -> tuple[Any, ...]:
    return tuple(getattr(self, field.name) for field in fields(self) if field.compare)


def _equals(self: Any, other: object) -> bool:
    return _compared(self) == _compared(other) if other.__class__ is self.__class__ else NotImplemented


def _hash(self: Any) -> int:
    return hash(_compared(self))


def _repr(self: Any) -> str:
    shown = ", ".join(f"{field.name}={getattr(self, field.name)!r}" for field in fields(self) if field.repr)
    return f"{type(self).__qualname__}({shown})"
