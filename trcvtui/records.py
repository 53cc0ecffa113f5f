"""Records: `@dataclass` and `NamedTuple` as the program uses them, without much work at a start.

A type checker reads the library's own `dataclass`, `field` and `replace`. What runs is this: eq, hash, repr,
order and pickling are shared functions over a getter of the class. `__init__` is compiled once for each
number of fields and given the names of each class. Not here: `__post_init__`, `init=False`, `kw_only`.
"""

from __future__ import annotations

from collections import _tuplegetter  # type: ignore[attr-defined]  # what namedtuple reads a field with
from operator import attrgetter
from types import FunctionType
from typing import TYPE_CHECKING, Any, Final

__all__ = ["NamedTuple", "dataclass", "field", "replace"]

MISSING: Final = object()
_CODES: Final[dict[str, Any]] = {}  # kinds of the fields, "v" or "f" each -> code of __init__
_IN_DICT: Final = ("__dict__", "__weakref__")


class _Field:
    __slots__ = ("compare", "default", "factory", "repr")

    def __init__(self, default: Any, factory: Any, compare: bool, repr: bool) -> None:
        self.default, self.factory, self.compare, self.repr = default, factory, compare, repr


def _field(
    *, default: Any = MISSING, default_factory: Any = None, compare: bool = True, repr: bool = True
) -> Any:
    return _Field(default, default_factory, compare, repr)


def _replace(record: Any, /, **changes: Any) -> Any:
    for name in record.__match_args__:
        if name not in changes:
            changes[name] = getattr(record, name)
    return type(record)(**changes)


def _dataclass(*, frozen: bool = False, slots: bool = False, eq: bool = True, order: bool = False) -> Any:
    return lambda cls: _decorated(cls, frozen, slots, eq, order)


def _decorated(cls: Any, frozen: bool, slots: bool, eq: bool, order: bool) -> Any:
    own = dict(cls.__dict__)
    fields: dict[str, _Field] = {}
    for base in cls.__mro__[:0:-1]:
        fields |= base.__dict__.get("__record_fields__", {})
    for name, kind in own.get("__annotations__", {}).items():
        if "ClassVar" in str(kind):
            continue
        given = own.pop(name, MISSING)
        fields[name] = given if isinstance(given, _Field) else _Field(given, None, True, True)
        if not slots and fields[name].default is not MISSING:
            own[name] = fields[name].default
    names = tuple(fields)
    if slots:
        inherited = {name for base in cls.__mro__[1:-1] for name in base.__dict__.get("__slots__", ())}
        own["__slots__"] = tuple(name for name in names if name not in inherited)
    for name in _IN_DICT:
        own.pop(name, None)
    own |= {"__record_fields__": fields, "__match_args__": names}
    own["__record_values__"] = _getter(names)
    own.setdefault("__repr__", _repr)
    if frozen:
        own |= {"__setattr__": _refuse_to_set, "__delattr__": _refuse_to_delete}
    if frozen and slots and cls.__reduce__ is object.__reduce__:
        own["__reduce__"] = _reduce
    if eq:
        own["__record_compared__"] = _getter([name for name, one in fields.items() if one.compare])
        own.setdefault("__eq__", _eq)
        if own.get("__hash__") is None:
            own["__hash__"] = _hash if frozen else None
    if order:
        own |= {"__lt__": _lt, "__le__": _le, "__gt__": _gt, "__ge__": _ge}
    made = type(cls)(cls.__name__, cls.__bases__, own)
    made.__init__ = _init(made, fields, slots)
    return made


def _init(cls: Any, fields: dict[str, _Field], slots: bool) -> Any:
    """Return `__init__`: it sets a field by its slot, which a frozen record does not refuse."""
    kinds = "".join("v" if one.factory is None else "f" for one in fields.values())
    code = _CODES.get(kinds)
    if code is None:
        lines = [f"def __init__(self{''.join(f', a{at}' for at in range(len(kinds)))}):", " pass"]
        for at, kind in enumerate(kinds):
            value = f"a{at}" if kind == "v" else f"make_{at}() if a{at} is MISSING else a{at}"
            lines.append(f" set_{at}(self, {value})")
        scratch: dict[str, Any] = {}
        exec("\n".join(lines), scratch)
        code = _CODES[kinds] = scratch["__init__"].__code__
    names: dict[str, Any] = {"MISSING": MISSING}
    for at, (name, one) in enumerate(fields.items()):
        names[f"set_{at}"] = getattr(cls, name).__set__ if slots else _setter(name)
        names[f"make_{at}"] = one.factory
    defaults = tuple(one.default for one in fields.values() if one.default is not MISSING or one.factory)
    made = FunctionType(code.replace(co_varnames=("self", *fields)), names, "__init__", defaults)
    made.__qualname__ = f"{cls.__qualname__}.__init__"
    return made


def _setter(name: str) -> Any:
    return lambda self, value: self.__dict__.__setitem__(name, value)


def _getter(names: Any) -> Any:
    if len(names) > 1:
        return staticmethod(attrgetter(*names))
    return staticmethod(lambda record: tuple([getattr(record, name) for name in names]))


# -- what every record shares -------------------------------------------------------------------------------


def _eq(self: Any, other: Any) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    values = self.__record_compared__
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(self.__record_compared__(self))


def _repr(self: Any) -> str:
    shown = [f"{name}={getattr(self, name)!r}" for name, one in self.__record_fields__.items() if one.repr]
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _reduce(self: Any) -> tuple[Any, ...]:
    return self.__class__, self.__record_values__(self)


def _refuse_to_set(self: Any, name: str, value: object) -> None:
    raise AttributeError(f"cannot assign to field {name!r}")


def _refuse_to_delete(self: Any, name: str) -> None:
    raise AttributeError(f"cannot delete field {name!r}")


def _ordering(name: str) -> Any:
    def compare(self: Any, other: Any) -> Any:
        if other.__class__ is not self.__class__:
            return NotImplemented
        values = self.__record_compared__
        return getattr(values(self), name)(values(other))

    return compare


_lt, _le, _gt, _ge = map(_ordering, ("__lt__", "__le__", "__gt__", "__ge__"))

# -- named tuples -------------------------------------------------------------------------------------------


class _Tuple(tuple[Any, ...]):
    """What all named tuples share."""

    __slots__ = ()
    _fields: tuple[str, ...] = ()

    @classmethod
    def _make(cls, values: Any) -> Any:
        made = tuple.__new__(cls, values)
        if len(made) != len(cls._fields):
            raise TypeError(f"Expected {len(cls._fields)} arguments, got {len(made)}")
        return made

    def _replace(self, /, **changes: Any) -> Any:
        made = self._make(map(changes.pop, self._fields, self))
        if changes:
            raise ValueError(f"Got unexpected field names: {list(changes)!r}")
        return made

    def _asdict(self) -> dict[str, Any]:
        return dict(zip(self._fields, self, strict=True))

    def __repr__(self) -> str:
        shown = [f"{name}={value!r}" for name, value in zip(self._fields, self, strict=True)]
        return f"{self.__class__.__name__}({', '.join(shown)})"

    def __getnewargs__(self) -> tuple[Any, ...]:
        return tuple(self)


class _TupleMaker(type):
    def __new__(mcs, name: str, bases: tuple[type, ...], own: dict[str, Any]) -> Any:
        if not bases:
            return super().__new__(mcs, name, bases, own)
        names = tuple(own.get("__annotations__", {}))
        defaults = tuple(own.pop(name) for name in names if name in own)
        code = _CODES.get(f"tuple {len(names)}")
        if code is None:
            places = "".join(f"a{at}, " for at in range(len(names)))
            scratch: dict[str, Any] = {}
            exec(f"def __new__(cls, {places}): return new(cls, ({places}))", scratch)
            code = _CODES[f"tuple {len(names)}"] = scratch["__new__"].__code__
        new = FunctionType(
            code.replace(co_varnames=("cls", *names)), {"new": tuple.__new__}, "__new__", defaults
        )
        fields = {name: _tuplegetter(at, None) for at, name in enumerate(names)}
        shared = {"__slots__": (), "_fields": names, "__match_args__": names, "__new__": new}
        return type(name, (_Tuple,), own | fields | shared)


class _NamedTuple(metaclass=_TupleMaker):
    """The base that a class of named fields is written with; it is gone from what is made."""


if TYPE_CHECKING:
    from dataclasses import dataclass, field, replace
    from typing import NamedTuple
else:
    NamedTuple = _NamedTuple
    dataclass, field, replace = _dataclass, _field, _replace
