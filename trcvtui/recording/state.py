"""Turns the state of a run into bytes and back: objects, contents, and references to the same object.

Rule 1: objects that writer and reader both have are only named: SharedObjects, and constants of modules.
Rule 2: nothing is unpickled. Classes, functions and constants come only from MAY_HOLD modules, by name.
Rule 3: no length and no number of an object is trusted. Bytes that do not fit raise UserError.
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
STANDARD_TYPES: Final[dict[str, type]] = {one.__qualname__: one for one in (deque, partial)}
MOST_NESTING: Final = 200  # objects inside objects
MOST_OBJECTS: Final = 1 << 20  # of one state
NONE, FALSE, TRUE, INT, FLOAT, TEXT, BYTES, BUFFER, TUPLE, LIST, MAPPING, SET, FROZEN = range(13)
NAMED, SHARED, OBJECT, METHOD, VIEW = range(13, 18)
NEWOBJ: Final = object().__reduce_ex__(2)[0]  # what `__reduce_ex__` returns for what `__new__` makes
BY_NEW, BY_CALL = range(2)  # how an object is made: by __new__, or called
StandIns = Mapping[type, Callable[[], object]]
NO_STAND_INS: Final[StandIns] = MappingProxyType({})
_SINGLETON_KINDS: Final[dict[object, int]] = {None: NONE, False: FALSE, True: TRUE}
_COUNT: Final = struct.Struct("<I")
_FLOAT_VALUE: Final = struct.Struct("<d")
_OBJECT: Final = struct.Struct("<IBIIII")  # class, how; arguments, fields, items, pairs
_ATOM_TYPES: Final = (int, str, bytes, float, bool, type(None))
_SHORT_BYTES: Final = 32  # texts and bytes up to this size are written again


def is_allowed_module(module: str) -> bool:
    return any(module == each or module.startswith(f"{each}.") for each in MAY_HOLD)


class SharedObjects:
    """All objects that `roots` hold at the beginning, numbered. Writer and reader have the same objects."""

    def __init__(self, roots: Iterable[object]) -> None:
        self.objects: list[object] = []
        self.numbers: dict[int, int] = {}
        waiting = [*roots]
        while waiting:
            one = waiting.pop()
            kind = type(one)
            is_long = kind in (str, bytes) and len(cast(bytes, one)) > _SHORT_BYTES
            if id(one) in self.numbers or isinstance(one, (Enum, type, FunctionType)):  # the last are named
                continue
            if kind in _ATOM_TYPES and not is_long:
                continue
            self.numbers[id(one)] = len(self.objects)
            self.objects.append(one)
            if kind in (tuple, list):
                waiting += cast(list[object], one)
            elif kind is dict:
                waiting += [*cast(dict[object, object], one), *cast(dict[object, object], one).values()]
            elif hasattr(kind, "__match_args__"):  # a record or a named tuple
                waiting += _list_field_values(one)


def _list_field_values(record: Any) -> list[object]:
    return [getattr(record, name) for name in type(record).__match_args__]


def _reduce(one: Any) -> Any:
    # A frozen dataclass is made with its values: it needs its hash before a set or mapping holds it.
    kind: Any = type(one)
    if is_dataclass(one) and vars(kind).get("__hash__") and kind.__reduce__ is object.__reduce__:
        return kind, _list_field_values(one)
    return one.__reduce_ex__(4)


def _find_constants() -> dict[int, tuple[str, str]]:
    found: dict[int, tuple[str, str]] = {}
    for name, module in sorted(sys.modules.items()):
        if not is_allowed_module(name):
            continue
        for attribute, value in vars(module).items():
            if attribute.startswith("__") or isinstance(value, (*_ATOM_TYPES, ModuleType, Enum)):
                continue
            if isinstance(value, (type, FunctionType)):
                continue  # they have their own names
            found.setdefault(id(value), (name, attribute))
    return found


class _StateEncoder:
    def __init__(self, shared: SharedObjects, constants: dict[int, tuple[str, str]]) -> None:
        self._shared, self._constants = shared.numbers, constants
        self._known: dict[int, int] = {}
        self._atoms: dict[tuple[type, object], int] = {}
        self._objects: list[Any] = []  # by number; held, so that no id comes twice
        self._extra: list[object] = []  # made on the way; held for the same reason

    def get_number(self, one: Any) -> int:
        kind = type(one)
        if kind in _ATOM_TYPES:
            key = (kind, one if kind is not float else _FLOAT_VALUE.pack(one))  # 0.0 equals -0.0
            number = self._atoms.get(key)
            if number is None:
                if id(one) in self._shared:
                    return self._number_by_identity(one)
                number = self._atoms[key] = self._add_object(one)
            return number
        return self._number_by_identity(one)

    def _number_by_identity(self, one: Any) -> int:
        number = self._known.get(id(one))
        if number is None:
            number = self._known[id(one)] = self._add_object(one)
        return number

    def _add_object(self, one: Any) -> int:
        self._objects.append(one)
        return len(self._objects) - 1

    def encode(self, root: object) -> bytes:
        self.get_number(root)
        parts: list[bytes] = []
        at = 0
        while at < len(self._objects):
            parts.append(self._encode_node(self._objects[at]))
            at += 1
        return _COUNT.pack(len(parts)) + b"".join(parts)

    def _encode_sequence(self, kind: int, some: Iterable[object]) -> bytes:
        numbers = array("I", map(self.get_number, some))
        return struct.pack(f"<BI{len(numbers)}I", kind, len(numbers), *numbers)

    def _encode_node(self, one: Any) -> bytes:
        place = self._shared.get(id(one))
        if place is not None:
            return struct.pack("<BI", SHARED, place)
        kind = type(one)
        if kind in _ATOM_TYPES:
            return _encode_atom(one)
        if kind is tuple:
            return self._encode_sequence(TUPLE, one)
        named = self._constants.get(id(one))
        if named is not None:
            return self._encode_sequence(NAMED, named)
        if kind is list:
            return self._encode_sequence(LIST, one)
        if kind is dict:
            return self._encode_sequence(MAPPING, [each for pair in one.items() for each in pair])
        if kind is bytearray:
            return struct.pack("<BI", BUFFER, len(one)) + bytes(one)
        if kind is set or kind is frozenset:  # in an order that is the same in each run
            return self._encode_sequence(SET if kind is set else FROZEN, sorted(one, key=repr))
        if isinstance(one, type) or kind is FunctionType:
            return self._encode_sequence(NAMED, _get_qualified_name(one))
        if kind is MethodType or kind is BuiltinMethodType:
            return self._encode_sequence(METHOD, one.__reduce_ex__(4)[1])
        if kind is memoryview:
            return struct.pack("<BI", VIEW, self.get_number(_get_viewed_object(one)))
        return self._encode_instance(one)

    def _encode_instance(self, one: Any) -> bytes:
        made = _reduce(one)
        if not isinstance(made, tuple):
            raise TypeError(f"no state of {type(one).__qualname__}")
        make, args, state, items, pairs = (*made, None, None, None)[:5]
        how = BY_CALL
        if make is NEWOBJ:
            how, (make, *args) = BY_NEW, args
        fields: dict[str, object] = {}
        if isinstance(state, dict) and not hasattr(type(one), "__setstate__"):
            fields = state
        elif isinstance(state, tuple) and len(state) == 2 and isinstance(state[1], dict) and how == BY_NEW:
            fields = {**(state[0] or {}), **state[1]}  # of a class with __slots__
        elif state is not None:
            fields = {"": state}  # what __setstate__ takes
        listed = [] if items is None else [*items]
        mapped = [] if pairs is None else [each for pair in pairs for each in pair]
        numbers = [
            *map(self.get_number, args),
            *[self.get_number(each) for pair in fields.items() for each in pair],
            *map(self.get_number, listed),
            *map(self.get_number, mapped),
        ]
        self._extra += [args, state, listed, mapped]
        head = _OBJECT.pack(self.get_number(make), how, len(args), len(fields), len(listed), len(mapped) // 2)
        return bytes([OBJECT]) + head + struct.pack(f"<{len(numbers)}I", *numbers)


def _encode_atom(one: Any) -> bytes:
    match one:
        case None | True | False:
            return bytes([_SINGLETON_KINDS[one]])
        case int():
            raw = one.to_bytes(one.bit_length() // 8 + 1, "little", signed=True)
            return struct.pack("<BI", INT, len(raw)) + raw
        case float():
            return bytes([FLOAT]) + _FLOAT_VALUE.pack(one)
        case str():
            raw = one.encode("utf-8", "surrogatepass")
            return struct.pack("<BI", TEXT, len(raw)) + raw
    return struct.pack("<BI", BYTES, len(one)) + bytes(one)


def _get_qualified_name(one: Any) -> tuple[str, str]:
    module, name = one.__module__, one.__qualname__
    if STANDARD_TYPES.get(name) is one:
        return "", name
    if not is_allowed_module(module) or "<" in name:
        raise TypeError(f"no name of {module}:{name}")
    return module, name


def _get_viewed_object(view: memoryview) -> object:
    try:
        whole = view.nbytes == memoryview(view.obj).nbytes
    except ValueError:  # released: nothing reads it
        return b""
    if whole:
        return view.obj
    if isinstance(view.obj, bytes):
        return bytes(view)
    raise TypeError("a part of a buffer")


def encode_state(one: object, shared: SharedObjects) -> bytes:
    """Return the bytes of an object and all that it holds. Raise TypeError if something cannot be kept."""
    return _StateEncoder(shared, _find_constants()).encode(one)


# -- back --------------------------------------------------------------------------------------------------


class _StateDecoder:
    """Makes the objects of one state, first without content, because objects may refer to each other."""

    def __init__(self, content: bytes, shared: SharedObjects, where: str, instead: StandIns) -> None:
        self._content, self._shared, self._where = content, shared.objects, where
        self._instead = instead
        self._at = 0
        self._nodes: list[tuple[int, Any]] = []
        self._made: list[Any] = []
        self._is_made = bytearray()
        self._last: list[tuple[Any, Any]] = []  # objects with __setstate__, and their states

    def error(self, found: object, expected: str) -> UserError:
        return mistake(f"{self._where}: state", found, expected)

    def _read_bytes(self, size: int) -> bytes:
        taken = self._content[self._at : self._at + size]
        if len(taken) < size:
            raise self.error(f"a length of {size}", f"at most the {len(taken)} bytes that are left")
        self._at += size
        return taken

    def _read_number(self) -> int:
        return cast(int, _COUNT.unpack(self._read_bytes(4))[0])

    def _read_numbers(self, count: int) -> tuple[int, ...]:
        return struct.unpack(f"<{count}I", self._read_bytes(4 * count))

    def decode(self) -> Any:
        count = self._read_number()
        if not 0 < count <= MOST_OBJECTS:  # Rule 3
            raise self.error(f"{count} objects", f"1 to {MOST_OBJECTS}")
        self._nodes = [self._read_node() for _ in range(count)]
        self._made, self._is_made = [None] * count, bytearray(count)
        for number in range(count):
            self._make(number)
        for number, (kind, held) in enumerate(self._nodes):
            self._fill_object(self._made[number], kind, held)
        for one, state in self._last:
            one.__setstate__(state)
        return self._made[0]

    def _read_node(self) -> tuple[int, Any]:
        kind = self._read_bytes(1)[0]
        if kind <= TRUE:
            return kind, (None, False, True)[kind]
        if kind == FLOAT:
            return kind, _FLOAT_VALUE.unpack(self._read_bytes(8))[0]
        if kind in (INT, TEXT, BYTES, BUFFER):
            raw = self._read_bytes(self._read_number())
            if kind == INT:
                return kind, int.from_bytes(raw, "little", signed=True)
            return kind, raw.decode("utf-8", "surrogatepass") if kind == TEXT else raw
        if kind in (SHARED, VIEW):
            return kind, self._read_number()
        if kind == OBJECT:
            make, how, *counts = _OBJECT.unpack(self._read_bytes(_OBJECT.size))
            args, fields, items, pairs = counts
            return kind, (make, how, *map(self._read_numbers, (args, 2 * fields, items, 2 * pairs)))
        if kind <= METHOD:
            return kind, self._read_numbers(self._read_number())
        raise self.error(f"kind {kind}", "one that this version knows")

    def _make(self, number: int, depth: int = 0) -> Any:
        if number >= len(self._nodes):
            raise self.error(f"object {number}", f"one of {len(self._nodes)}")
        if self._is_made[number]:
            return self._made[number]
        if depth > MOST_NESTING:  # a file could nest until the stack is full
            raise self.error("objects inside objects", f"at most {MOST_NESTING} deep")
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
                    raise self.error(f"object {held} of the project", f"one of {len(self._shared)}")
                made = self._shared[held]
            case _ if kind == NAMED:
                made = self._find_named([self._make(each, depth + 1) for each in held])
            case _ if kind == METHOD:
                made = self._bind_method([self._make(each, depth + 1) for each in held])
            case _ if kind == VIEW:
                made = memoryview(self._make(held, depth + 1))
            case _ if kind == OBJECT:
                made = self._make_instance(held, depth)
        self._made[number] = made
        self._is_made[number] = True
        return made

    def _make_instance(self, held: Any, depth: int) -> Any:
        make, args = self._make(held[0], depth + 1), [self._make(each, depth + 1) for each in held[2]]
        if not isinstance(make, type) and not (isinstance(make, FunctionType) and held[1] == BY_CALL):
            raise self.error(f"an object of {make!r:.40}", "a class")  # Rule 2
        if make in self._instead:
            return self._instead[cast(type, make)]()
        made = cast(Callable[..., Any], make.__new__ if held[1] == BY_NEW else make)
        return made(make, *args) if held[1] == BY_NEW else made(*args)

    def _find_named(self, words: Sequence[object]) -> Any:
        module, name = (*words, "", "")[:2]
        if not isinstance(module, str) or not isinstance(name, str):
            raise self.error("a name that is none", "module and name")
        if not module and name in STANDARD_TYPES:
            return STANDARD_TYPES[name]
        found: Any = None
        if is_allowed_module(module) and "__" not in name:  # Rule 2: no way to __globals__
            try:
                __import__(module)
                found = sys.modules[module]
                for part in name.split("."):
                    found = getattr(found, part)
            except (ImportError, AttributeError):
                found = None
        # A module of ours also has names that it imported from others.
        is_strange = isinstance(found, (type, FunctionType)) and not is_allowed_module(found.__module__)
        if found is None or isinstance(found, ModuleType) or is_strange:
            raise self.error(f"{module}:{name}"[:80], "a name that this version knows")
        return found

    def _bind_method(self, held: Sequence[Any]) -> Any:
        one, name = (*held, "", "")[:2]
        if isinstance(name, str) and not name.startswith("__"):  # Rule 2
            found = getattr(type(one), name, None)
            if callable(found) and hasattr(found, "__get__"):
                return found.__get__(one)
        raise self.error(f"{name!r:.40} of {type(one).__qualname__}", "a method")

    def _fill_object(self, one: Any, kind: int, held: Any) -> None:
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


def decode_state(content: bytes, shared: SharedObjects, where: str, instead: StandIns = NO_STAND_INS) -> Any:
    """Return the object of a state. If the bytes are no state, raise UserError that begins with `where`.

    For a class in `instead`, the function there makes the object. The object then gets the state's fields.
    """
    made = _StateDecoder(content, shared, where, instead)
    try:
        return made.decode()
    except UserError:
        raise
    except Exception as wrong:  # Rule 3: bytes of a file decide what is made
        raise made.error(f"{type(wrong).__name__} {wrong}"[:120], "a state that fits this version") from None
