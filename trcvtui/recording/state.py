"""The state of a run as plain data, and back: objects, what they hold, which are the same; in fixed layouts.

Rule 1: what both sides have (`Shared`: project, beginning; what stands in a module) is named, not told.
Rule 2: nothing is unpickled. A class, function or constant comes from the modules of MAY_HOLD alone, by name.
Rule 3: no length and no number of an object is trusted; what does not fit raises UserError.
"""

from __future__ import annotations

import struct
import sys
from array import array
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from enum import Enum
from functools import partial
from types import BuiltinMethodType, FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any, Final, cast

from trcvtui.errors import UserError, mistake

PACKAGE: Final = __name__.partition(".")[0]
MAY_HOLD: Final = tuple(  # modules whose classes and functions a state may name
    f"{PACKAGE}.{name}"
    for name in (
        *("bench", "blocks", "commands", "dialects", "files", "history", "net.connection", "net.events"),
        *("net.faults", "net.kernel", "net.layer", "net.layers", "net.received_ring", "net.results"),
        *("net.serial_line", "net.sim", "plc", "project", "recording.journal", "recording.replay"),
        *("recording.seam", "replay", "scenario.scenario", "snapshots", "udt"),
    )
)
OTHERS: Final[dict[str, type]] = {one.__qualname__: one for one in (deque, partial)}
DEEPEST: Final = 200  # objects inside objects
MOST_OBJECTS: Final = 1 << 20  # that are made of a file
NONE, FALSE, TRUE, INT, FLOAT, TEXT, BYTES, BUFFER, TUPLE, LIST, MAPPING, SET, FROZEN = range(13)
NAMED, SHARED, OBJECT, METHOD, VIEW = range(13, 18)
NEWOBJ: Final = object().__reduce_ex__(2)[0]  # what `__reduce_ex__` says where `__new__` makes it
NEW, CALLED = range(2)  # how an object is made: by __new__, or called
Instead = Mapping[type, Callable[[], object]]
NOTHING_ELSE: Final[Instead] = MappingProxyType({})
_SINGLES: Final[dict[object, int]] = {None: NONE, False: FALSE, True: TRUE}
_ONE: Final = struct.Struct("<I")
_FLOAT: Final = struct.Struct("<d")
_OBJECT: Final = struct.Struct("<IBIIII")  # class, how; arguments, fields, items, pairs
_ATOMS: Final = (int, str, bytes, float, bool, type(None))
_SHORT: Final = 32  # bytes, below which a text or bytes are told again


def is_allowed(module: str) -> bool:
    return any(module == each or module.startswith(f"{each}.") for each in MAY_HOLD)


class Shared:
    """Objects that both sides have, by number: those of `roots`, as they are when this is made."""

    def __init__(self, roots: Iterable[object]) -> None:
        self.objects: list[object] = []
        self.numbers: dict[int, int] = {}
        waiting = [*roots]
        while waiting:
            one = waiting.pop()
            kind = type(one)
            is_long = kind in (str, bytes) and len(cast(bytes, one)) > _SHORT
            if id(one) in self.numbers or isinstance(one, (Enum, type, FunctionType)):
                continue
            if kind in _ATOMS and not is_long:
                continue
            self.numbers[id(one)] = len(self.objects)
            self.objects.append(one)
            if kind in (tuple, list):
                waiting += cast(list[object], one)
            elif kind is dict:
                waiting += [*cast(dict[object, object], one), *cast(dict[object, object], one).values()]
            elif hasattr(kind, "__match_args__"):  # a record or a named tuple
                waiting += _values_of(one)


def _values_of(record: Any) -> list[object]:
    return [getattr(record, name) for name in type(record).__match_args__]


def _reduced(one: Any) -> Any:
    # A frozen dataclass is made with its values, so that it has a hash before something holds it.
    kind: Any = type(one)
    if is_dataclass(one) and vars(kind).get("__hash__") and kind.__reduce__ is object.__reduce__:
        return kind, _values_of(one)
    return one.__reduce_ex__(4)


def _constants() -> dict[int, tuple[str, str]]:
    found: dict[int, tuple[str, str]] = {}
    for name, module in sorted(sys.modules.items()):
        if not is_allowed(name):
            continue
        for attribute, value in vars(module).items():
            if attribute.startswith("__") or isinstance(value, (*_ATOMS, ModuleType, Enum)):
                continue
            if isinstance(value, (type, FunctionType)):
                continue  # they have a name of their own
            found.setdefault(id(value), (name, attribute))
    return found


class _Kept:
    def __init__(self, shared: Shared, constants: dict[int, tuple[str, str]]) -> None:
        self._shared, self._constants = shared.numbers, constants
        self._known: dict[int, int] = {}
        self._atoms: dict[tuple[type, object], int] = {}
        self._objects: list[Any] = []  # in the order of their numbers; all of them live as long as this
        self._extra: list[object] = []  # made on the way: they live as long, so that no id comes twice

    def number(self, one: Any) -> int:
        kind = type(one)
        if kind in _ATOMS:
            key = (kind, one if kind is not float else _FLOAT.pack(one))
            number = self._atoms.get(key)
            if number is None:
                if id(one) in self._shared:
                    return self._new(one)
                number = self._atoms[key] = self._add(one)
            return number
        return self._new(one)

    def _new(self, one: Any) -> int:
        number = self._known.get(id(one))
        if number is None:
            number = self._known[id(one)] = self._add(one)
        return number

    def _add(self, one: Any) -> int:
        self._objects.append(one)
        return len(self._objects) - 1

    def state(self, root: object) -> bytes:
        self.number(root)
        parts: list[bytes] = []
        at = 0
        while at < len(self._objects):
            parts.append(self._node(self._objects[at]))
            at += 1
        return _ONE.pack(len(parts)) + b"".join(parts)

    def _many(self, kind: int, some: Iterable[object]) -> bytes:
        numbers = array("I", map(self.number, some))
        return struct.pack(f"<BI{len(numbers)}I", kind, len(numbers), *numbers)

    def _node(self, one: Any) -> bytes:
        place = self._shared.get(id(one))
        if place is not None:
            return struct.pack("<BI", SHARED, place)
        kind = type(one)
        if kind in _ATOMS:
            return _atom_bytes(one)
        if kind is tuple:
            return self._many(TUPLE, one)
        named = self._constants.get(id(one))
        if named is not None:
            return self._many(NAMED, named)
        if kind is list:
            return self._many(LIST, one)
        if kind is dict:
            return self._many(MAPPING, [each for pair in one.items() for each in pair])
        if kind is bytearray:
            return struct.pack("<BI", BUFFER, len(one)) + bytes(one)
        if kind is set or kind is frozenset:
            return self._many(SET if kind is set else FROZEN, sorted(one, key=repr))
        if isinstance(one, type) or kind is FunctionType:
            return self._many(NAMED, _name_of(one))
        if kind is MethodType or kind is BuiltinMethodType:
            return self._many(METHOD, one.__reduce_ex__(4)[1])
        if kind is memoryview:
            return struct.pack("<BI", VIEW, self.number(_seen_by(one)))
        return self._object(one)

    def _object(self, one: Any) -> bytes:
        made = _reduced(one)
        if not isinstance(made, tuple):
            raise TypeError(f"no state of {type(one).__qualname__}")
        make, args, state, items, pairs = (*made, None, None, None)[:5]
        how = CALLED
        if make is NEWOBJ:
            how, (make, *args) = NEW, args
        fields: dict[str, object] = {}
        if isinstance(state, dict) and not hasattr(type(one), "__setstate__"):
            fields = state
        elif isinstance(state, tuple) and len(state) == 2 and isinstance(state[1], dict) and how == NEW:
            fields = {**(state[0] or {}), **state[1]}
        elif state is not None:
            fields = {"": state}  # what __setstate__ takes
        listed = [] if items is None else [*items]
        mapped = [] if pairs is None else [each for pair in pairs for each in pair]
        numbers = [
            *map(self.number, args),
            *[self.number(each) for pair in fields.items() for each in pair],
            *map(self.number, listed),
            *map(self.number, mapped),
        ]
        self._extra += [args, state, listed, mapped]
        head = _OBJECT.pack(self.number(make), how, len(args), len(fields), len(listed), len(mapped) // 2)
        return bytes([OBJECT]) + head + struct.pack(f"<{len(numbers)}I", *numbers)


def _atom_bytes(one: Any) -> bytes:
    match one:
        case None | True | False:
            return bytes([_SINGLES[one]])
        case int():
            raw = one.to_bytes(one.bit_length() // 8 + 1, "little", signed=True)
            return struct.pack("<BI", INT, len(raw)) + raw
        case float():
            return bytes([FLOAT]) + _FLOAT.pack(one)
        case str():
            raw = one.encode("utf-8", "surrogatepass")
            return struct.pack("<BI", TEXT, len(raw)) + raw
    return struct.pack("<BI", BYTES, len(one)) + bytes(one)


def _name_of(one: Any) -> tuple[str, str]:
    module, name = one.__module__, one.__qualname__
    if OTHERS.get(name) is one:
        return "", name
    if not is_allowed(module) or "<" in name:
        raise TypeError(f"no name of {module}:{name}")
    return module, name


def _seen_by(view: memoryview) -> object:
    try:
        whole = view.nbytes == memoryview(view.obj).nbytes
    except ValueError:  # released: it is read no more
        return b""
    if whole:
        return view.obj
    if isinstance(view.obj, bytes):
        return bytes(view)
    raise TypeError("a part of a buffer")


def state_of(one: object, shared: Shared) -> bytes:
    """Return an object and all that it holds; raise TypeError where something cannot be kept."""
    return _Kept(shared, _constants()).state(one)


# -- back --------------------------------------------------------------------------------------------------


class _Made:
    """The objects of one state, made one after the other: first themselves, then what they hold."""

    def __init__(self, content: bytes, shared: Shared, where: str, instead: Instead) -> None:
        self._content, self._shared, self._where = content, shared.objects, where
        self._instead = instead
        self._at = 0
        self._nodes: list[tuple[int, Any]] = []
        self._made: list[Any] = []
        self._is_made = bytearray()
        self._last: list[tuple[Any, Any]] = []  # objects that take their state themselves, and it

    def wrong(self, found: object, expected: str) -> UserError:
        return mistake(f"{self._where}: state", found, expected)

    def _take(self, size: int) -> bytes:
        taken = self._content[self._at : self._at + size]
        if len(taken) < size:
            raise self.wrong(f"a length of {size}", f"at most the {len(taken)} bytes that are left")
        self._at += size
        return taken

    def _number(self) -> int:
        return cast(int, _ONE.unpack(self._take(4))[0])

    def _numbers(self, count: int) -> tuple[int, ...]:
        return struct.unpack(f"<{count}I", self._take(4 * count))

    def root(self) -> Any:
        count = self._number()
        if not 0 < count <= MOST_OBJECTS:
            raise self.wrong(f"{count} objects", f"1 to {MOST_OBJECTS}")
        self._nodes = [self._node() for _ in range(count)]
        self._made, self._is_made = [None] * count, bytearray(count)
        for number in range(count):
            self._make(number)
        for number, (kind, held) in enumerate(self._nodes):
            self._fill(self._made[number], kind, held)
        for one, state in self._last:
            one.__setstate__(state)
        return self._made[0]

    def _node(self) -> tuple[int, Any]:
        kind = self._take(1)[0]
        if kind <= TRUE:
            return kind, (None, False, True)[kind]
        if kind == FLOAT:
            return kind, _FLOAT.unpack(self._take(8))[0]
        if kind in (INT, TEXT, BYTES, BUFFER):
            raw = self._take(self._number())
            if kind == INT:
                return kind, int.from_bytes(raw, "little", signed=True)
            return kind, raw.decode("utf-8", "surrogatepass") if kind == TEXT else raw
        if kind in (SHARED, VIEW):
            return kind, self._number()
        if kind == OBJECT:
            make, how, *counts = _OBJECT.unpack(self._take(_OBJECT.size))
            args, fields, items, pairs = counts
            return kind, (make, how, *map(self._numbers, (args, 2 * fields, items, 2 * pairs)))
        if kind <= METHOD:
            return kind, self._numbers(self._number())
        raise self.wrong(f"kind {kind}", "one that this version knows")

    def _make(self, number: int, depth: int = 0) -> Any:
        if number >= len(self._nodes):
            raise self.wrong(f"object {number}", f"one of {len(self._nodes)}")
        if self._is_made[number]:
            return self._made[number]
        if depth > DEEPEST:
            raise self.wrong("objects inside objects", f"at most {DEEPEST} deep")
        kind, held = self._nodes[number]
        made: Any = held
        match kind:
            case _ if kind == TUPLE:
                made = tuple([self._make(each, depth + 1) for each in held])
            case _ if kind == FROZEN:
                made = frozenset([self._make(each, depth + 1) for each in held])
            case _ if kind in (LIST, MAPPING, SET):
                made = {LIST: list, MAPPING: dict, SET: set}[kind]()
            case _ if kind == BUFFER:
                made = bytearray(held)
            case _ if kind == SHARED:
                if held >= len(self._shared):
                    raise self.wrong(f"object {held} of the project", f"one of {len(self._shared)}")
                made = self._shared[held]
            case _ if kind == NAMED:
                made = self._named([self._make(each, depth + 1) for each in held])
            case _ if kind == METHOD:
                made = self._method([self._make(each, depth + 1) for each in held])
            case _ if kind == VIEW:
                made = memoryview(self._make(held, depth + 1))
            case _ if kind == OBJECT:
                made = self._object(held, depth)
        self._made[number] = made
        self._is_made[number] = True
        return made

    def _object(self, held: Any, depth: int) -> Any:
        make, args = self._make(held[0], depth + 1), [self._make(each, depth + 1) for each in held[2]]
        if not isinstance(make, type) and not (isinstance(make, FunctionType) and held[1] == CALLED):
            raise self.wrong(f"an object of {make!r:.40}", "a class")
        if make in self._instead:
            return self._instead[cast(type, make)]()
        made = cast(Callable[..., Any], make.__new__ if held[1] == NEW else make)
        return made(make, *args) if held[1] == NEW else made(*args)

    def _named(self, words: Sequence[object]) -> Any:
        module, name = (*words, "", "")[:2]
        if not isinstance(module, str) or not isinstance(name, str):
            raise self.wrong("a name that is none", "module and name")
        if not module and name in OTHERS:
            return OTHERS[name]
        found: Any = None
        if is_allowed(module) and "__" not in name:
            try:
                __import__(module)
                found = sys.modules[module]
                for part in name.split("."):
                    found = getattr(found, part)
            except (ImportError, AttributeError):
                found = None
        is_strange = isinstance(found, (type, FunctionType)) and not is_allowed(found.__module__)
        if found is None or isinstance(found, ModuleType) or is_strange:
            raise self.wrong(f"{module}:{name}"[:80], "a name that this version knows")
        return found

    def _method(self, held: Sequence[Any]) -> Any:
        one, name = (*held, "", "")[:2]
        if isinstance(name, str) and not name.startswith("__"):
            found = getattr(type(one), name, None)
            if callable(found) and hasattr(found, "__get__"):
                return found.__get__(one)
        raise self.wrong(f"{name!r:.40} of {type(one).__qualname__}", "a method")

    def _fill(self, one: Any, kind: int, held: Any) -> None:
        made = self._made
        if kind == LIST:
            one += [made[each] for each in held]
        elif kind == SET:
            one.update([made[each] for each in held])
        elif kind == MAPPING:
            one.update(zip([made[n] for n in held[::2]], [made[n] for n in held[1::2]], strict=True))
        elif kind == OBJECT:
            _, _, _, fields, items, pairs = held
            for name, value in zip(fields[::2], fields[1::2], strict=True):
                if made[name]:
                    object.__setattr__(one, made[name], made[value])
                else:
                    self._last.append((one, made[value]))
            if items:
                one.extend([made[each] for each in items])
            for key, value in zip(pairs[::2], pairs[1::2], strict=True):
                one[made[key]] = made[value]


def from_state(content: bytes, shared: Shared, where: str, instead: Instead = NOTHING_ELSE) -> Any:
    """Return the object of a state; raise UserError that begins with `where` for what is none.

    Objects of the classes in `instead` are made by what stands there, and get the fields of the state.
    """
    made = _Made(content, shared, where, instead)
    try:
        return made.root()
    except UserError:
        raise
    except Exception as wrong:  # bytes of a file decide what is made: whatever does not fit ends here
        raise made.wrong(f"{type(wrong).__name__} {wrong}"[:120], "a state that fits this version") from None
