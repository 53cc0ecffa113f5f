"""Records: they mean what the library's dataclasses mean, as far as the program uses them."""

from __future__ import annotations

import ast
import copy
import dataclasses
import pickle
import typing
from pathlib import Path
from typing import Any, ClassVar

import pytest

from trcvtui.records import NamedTuple, dataclass, field, replace

PROGRAM = Path(__file__).parent.parent / "trcvtui"


@dataclass(frozen=True, slots=True)
class Ours:
    kind: ClassVar[str] = "a class's own"
    name: str
    size: int = 3
    note: str = field(default="", compare=False)
    parts: list[int] = field(default_factory=list, compare=False, repr=False)

    @property
    def double(self) -> int:
        return 2 * self.size


@dataclass(frozen=True, slots=True)
class More(Ours):
    last: int = 0


@dataclass(slots=True)
class Open:
    count: int = 0


@dataclass(frozen=True)
class Remembering:
    size: int


@dataclass(frozen=True, slots=True, order=True)
class Ordered:
    first: str
    second: int


@dataclass(frozen=True, slots=True, eq=False)
class Alone:
    size: int


@dataclasses.dataclass(frozen=True, slots=True)
class Theirs:
    kind: ClassVar[str] = "a class's own"
    name: str
    size: int = 3
    note: str = dataclasses.field(default="", compare=False)
    parts: list[int] = dataclasses.field(default_factory=list, compare=False, repr=False)


@pytest.mark.parametrize("words", [("a",), ("a", 4), ("a", 4, "why"), ("a", 4, "why", [1])])
def test_a_record_looks_hashes_and_compares_as_the_librarys_does(words: tuple[Any, ...]) -> None:
    ours, theirs = Ours(*words), Theirs(*words)
    assert repr(ours) == repr(theirs).replace("Theirs", "Ours")
    assert hash(ours) == hash(theirs)
    assert (ours == Ours("a")) == (theirs == Theirs("a"))
    assert Ours.__match_args__ == Theirs.__match_args__
    assert vars(Ours)["__slots__"] == vars(Theirs)["__slots__"]


def test_a_factory_makes_a_new_value_each_time() -> None:
    assert Ours("a").parts is not Ours("a").parts
    assert Ours("a", parts=[7]).parts == [7]


def test_a_frozen_record_refuses_changes_and_an_open_one_takes_them() -> None:
    for record in (Ours("a"), Remembering(1), More("a")):
        with pytest.raises(AttributeError, match="cannot assign to field 'size'"):
            record.size = 4  # type: ignore[misc]
        with pytest.raises(AttributeError, match="cannot delete field 'size'"):
            del record.size
    opened = Open()
    opened.count += 1
    assert opened == Open(1)
    with pytest.raises(TypeError):
        hash(opened)


def test_unknown_missing_and_too_many_fields_are_refused() -> None:
    mistakes: tuple[tuple[tuple[Any, ...], dict[str, Any]], ...]
    mistakes = ((), {}), (("a",), {"nmae": "b"}), (("a", 1, "", [], 5), {})
    for words, named in mistakes:
        with pytest.raises(TypeError):
            Ours(*words, **named)


def test_a_child_has_the_fields_of_its_parent_first() -> None:
    child = More("a", last=9)
    assert repr(child) == "More(name='a', size=3, note='', last=9)"
    assert child != Ours("a")
    assert not hasattr(child, "__dict__")
    assert child.double == 6


def test_replace_gives_a_new_record_and_knows_the_names() -> None:
    assert replace(More("a", 4, "n", [1]), last=2) == More("a", 4, last=2)
    assert replace(More("a", 4, "n", [1])).note == "n"
    with pytest.raises(TypeError):
        replace(Ours("a"), nmae="b")  # type: ignore[call-arg]


@pytest.mark.parametrize("record", [Ours("a", 1, "n", [2]), More("b", last=3), Open(4), Remembering(5)])
def test_a_record_crosses_the_pipe_and_is_copied_whole(record: Any) -> None:
    for twin in (pickle.loads(pickle.dumps(record, 5)), copy.deepcopy(record), copy.copy(record)):
        assert type(twin) is type(record)
        assert [getattr(twin, n) for n in record.__match_args__] == [
            getattr(record, n) for n in record.__match_args__
        ]


def test_records_are_matched_by_place() -> None:
    match Ours("a", 5):
        case Ours(name, size):
            assert (name, size) == ("a", 5)


def test_records_with_order_are_sorted_by_their_fields() -> None:
    assert sorted([Ordered("b", 1), Ordered("a", 2), Ordered("a", 1)]) == [
        Ordered("a", 1),
        Ordered("a", 2),
        Ordered("b", 1),
    ]
    assert Ordered("a", 1) <= Ordered("a", 1) < Ordered("a", 2)


def test_records_without_eq_are_equal_to_themselves_alone() -> None:
    alone = Alone(1)
    assert alone == alone and alone != Alone(1)
    assert len({alone, Alone(1)}) == 2


def test_the_program_uses_no_other_dataclasses_and_nothing_that_records_lack() -> None:
    for path in PROGRAM.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if path.name != "records.py" and isinstance(node, ast.ImportFrom):
                assert node.module != "dataclasses", f"{path}: import it from trcvtui.records"
            if isinstance(node, ast.ClassDef) and any(
                "dataclass" in ast.dump(one) for one in node.decorator_list
            ):
                made = [one.name for one in node.body if isinstance(one, ast.FunctionDef)]
                assert "__post_init__" not in made, f"{path}: records call no __post_init__"


class Named(NamedTuple):
    """Ours."""

    name: str
    size: int = 3

    @property
    def double(self) -> int:
        return 2 * self.size


class TheirNamed(typing.NamedTuple):
    name: str
    size: int = 3


class Empty(NamedTuple):
    """No field."""


@pytest.mark.parametrize("words", [("a",), ("a", 4)])
def test_a_named_tuple_is_what_the_librarys_is(words: tuple[Any, ...]) -> None:
    ours, theirs = Named(*words), TheirNamed(*words)
    assert repr(ours) == repr(theirs).replace("TheirNamed", "Named")
    assert tuple(ours) == tuple(theirs) and hash(ours) == hash(theirs)
    assert ours._asdict() == theirs._asdict()
    assert ours._fields == theirs._fields == Named.__match_args__
    assert ours._replace(name="b") == Named._make(("b", ours.size)) == Named("b", ours.size)
    assert ours.double == 2 * theirs.size
    assert not hasattr(ours, "__dict__")
    assert pickle.loads(pickle.dumps(ours, 5)) == copy.deepcopy(ours) == ours
    assert type(pickle.loads(pickle.dumps(ours, 5))) is Named
    assert type(Named) is type and issubclass(Named, tuple) and Empty() == ()


def test_a_named_tuple_refuses_what_the_librarys_refuses() -> None:
    for refused, act in (
        (AttributeError, lambda: setattr(Named("a"), "size", 4)),
        (TypeError, lambda: Named()),  # type: ignore[call-arg]
        (TypeError, lambda: Named("a", 1, 2)),  # type: ignore[call-arg]
        (TypeError, lambda: Named("a", nmae=1)),  # type: ignore[call-arg]
        (TypeError, lambda: Named._make(("a",))),
        (ValueError, lambda: Named("a")._replace(nmae=1)),  # type: ignore[call-arg]
    ):
        with pytest.raises(refused):
            act()
