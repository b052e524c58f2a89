"""Frozen data behave as those of `dataclasses` do, whose functions are made for every class anew."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, replace
from typing import ClassVar

import pytest

from bfi_cli import frozen


class Kept:
    count: ClassVar[int] = 3
    first: int
    second: tuple[int, ...] = ()
    third: dict[str, int] = field(default_factory=dict, compare=False)
    fourth: list[int] = field(init=False, repr=False, compare=False, default_factory=list)

    def __post_init__(self) -> None:
        self.fourth.append(self.first)

    @property
    def doubled(self) -> int:
        return 2 * self.first


def made(maker, **more):
    body = {name: value for name, value in vars(Kept).items() if name not in ("__dict__", "__weakref__")}
    kind = maker(**{"frozen": True, "slots": True, **more})(type("Kept", (), body))
    kind.__qualname__ = "Kept"
    return kind


MORE = ({}, {"kw_only": True}, {"eq": False}, {"repr": False}, {"slots": False}, {"kw_only": True, "eq": False})
Ours, Theirs = made(frozen.dataclass), made(dataclass)


@pytest.mark.parametrize("more", MORE, ids=str)
def test_a_frozen_class_has_the_fields_and_the_arguments_of_a_dataclass(more):
    ours, theirs = made(frozen.dataclass, **more), made(dataclass, **more)
    parameters = [
        [(one.name, one.kind, one.default is one.empty) for one in inspect.signature(kind).parameters.values()]
        for kind in (ours, theirs)
    ]
    assert parameters[0] == parameters[1]
    shown = [
        [(one.name, one.init, one.repr, one.compare) for one in dataclasses.fields(kind)] for kind in (ours, theirs)
    ]
    assert shown[0] == shown[1]
    assert getattr(ours, "__slots__", None) == getattr(theirs, "__slots__", None)
    values = [dataclasses.asdict(kind(first=1, third={"a": 1})) for kind in (ours, theirs)]
    assert values[0] == values[1] == {"first": 1, "second": (), "third": {"a": 1}, "fourth": [1]}
    same = [kind(first=1) == kind(first=1) for kind in (ours, theirs)]
    assert same == [more.get("eq", True)] * 2
    assert ours(first=2).doubled == 4
    assert ours(first=2).third is not ours(first=2).third
    if more.get("repr", True):
        assert repr(ours(first=1)) == repr(theirs(first=1))
    with pytest.raises(TypeError):
        ours()


def test_frozen_data_do_not_change():
    kept = Ours(first=1)
    for change in (
        lambda: setattr(kept, "first", 2),
        lambda: setattr(kept, "other", 2),
        lambda: delattr(kept, "first"),
    ):
        with pytest.raises(FrozenInstanceError):
            change()
    assert replace(kept, first=2) == Ours(first=2) != kept


def test_equal_data_have_one_hash_and_what_is_not_compared_does_not_count():
    assert {Ours(first=1, third={"a": 1}), Ours(first=1)} == {Ours(first=1)}
    assert Ours(first=1) != Theirs(first=1)


@frozen.dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    x: float
    y: float = 0.0


@frozen.dataclass(frozen=True, slots=True, kw_only=True)
class Named(Point):
    name: str


def test_frozen_data_are_copied_and_pickled():
    named = Named(x=1.0, name="a")
    assert pickle.loads(pickle.dumps(named)) == copy.deepcopy(named) == copy.copy(named) == named
    assert [one.name for one in dataclasses.fields(named)] == ["x", "y", "name"]


def test_only_frozen_data_are_made():
    with pytest.raises(ValueError, match="frozen must be true"):
        frozen.dataclass(frozen=False)
