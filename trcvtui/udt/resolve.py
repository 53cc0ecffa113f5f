"""Turns specifications into types: looks up names, evaluates formulas, and collects every problem.

Rule: a bad type never hides a good type. Each bad type keeps all its problems.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress

from trcvtui.errors import MOST_PROBLEMS_SHOWN, Problem, UserError
from trcvtui.system_types import UNSURE_HANDLE_TYPES
from trcvtui.udt import ast
from trcvtui.udt.ast import CPP_NOTE
from trcvtui.udt.constants import Constants
from trcvtui.udt.layout.placing import has_padded_end
from trcvtui.udt.system_types import system_types
from trcvtui.udt.types import (
    BUILTIN_TYPES,
    ELEMENTARY,
    VENDOR_NAMES,
    WHOLE_KINDS,
    Array,
    BitField,
    Elementary,
    Enumeration,
    Member,
    Pointer,
    RawType,
    StringType,
    Struct,
    Subrange,
    Type,
    Union,
    all_members,
)

KNOWN = "a known "
KNOWN_TYPE = f"{KNOWN}type"


class Resolver:
    """One set of files with its declarations, the types made of them, and the problems in order."""

    def __init__(
        self,
        constants: Constants,
        known: Mapping[str, tuple[str, Type]],
        broken: Mapping[str, tuple[Problem, ...]],
    ) -> None:
        self.constants, self.known, self.broken = constants, known, broken
        self.declared: dict[str, ast.Declaration] = {}
        self.types: dict[str, Type] = {}
        self.depths: dict[str, int] = {}
        self.bad: dict[str, dict[Problem, None]] = {}
        self.notes: dict[str, dict[str, None]] = {}
        self.circles: dict[tuple[str, str], list[str]] = {}  # by user and used: names, the user first
        self.system_users: set[str] = set()  # types that may have members of system types
        self.used_system: dict[str, str] = {}  # the names as the user writes them

    def declare(self, declaration: ast.Declaration, uses_system: bool = False) -> None:
        key = declaration.name.casefold()
        self.system_users |= {key} if uses_system else set()
        first = self.declared.setdefault(key, declaration)
        for problem in declaration.problems:
            self.report(key, problem)
        if first is not declaration:
            expected = f"one declaration of it; the first is at {first.where}"
            self.report(key, Problem(declaration.where, f"'{declaration.name}' a second time", expected))
        if declaration.name.upper() in ELEMENTARY and declaration.name.upper() not in VENDOR_NAMES:
            expected = "a name that no IEC type has"
            self.report(key, Problem(declaration.where, f"'{declaration.name}'", expected))

    def report(self, key: str, *problems: Problem) -> None:
        bad = self.bad.setdefault(key, {})
        for problem in problems:
            # Problems inherited from used types are bounded: else a chain of bad types multiplies them.
            if len(bad) < 2 * MOST_PROBLEMS_SHOWN or len(problems) == 1:
                bad[problem] = None

    def build_all(self) -> None:
        for declaration in self.declared.values():
            if isinstance(declaration.spec, ast.EnumSpec) and not declaration.spec.is_scoped:
                self.constants.add_values(declaration.name, declaration.spec.values)
        for key in self.order_keys():
            declaration = self.declared[key]
            if declaration.spec is None:
                continue
            type_, depth = self.build(declaration.spec, declaration.name, key)
            if depth > ast.MOST_NESTED:
                found = f"'{declaration.name}' nested {depth} deep"
                expected = f"at most {ast.MOST_NESTED} levels"
                self.report(key, Problem(declaration.where, found, expected))
            if type_ is not None and key not in self.bad:  # a bad type is left out, the good ones stay
                self.types[key], self.depths[key] = type_, depth

    def order_keys(self) -> list[str]:
        """Return all declared keys, each after the keys that it uses. A long chain causes no recursion."""
        order: list[str] = []
        seen: set[str] = set()
        path: dict[str, Iterator[str]] = {}
        for root in self.declared:
            if root not in seen:
                path[root] = self.used_keys(root)
            while path:
                key = next(reversed(path))
                seen.add(key)
                used = next(path[key], None)
                if used is None:
                    order.append(key)
                    del path[key]
                elif used in path:  # a circle: `look_up` refuses it at the member
                    names = [self.declared[each].name for each in path]
                    self.circles[key, used] = [names[-1], *names[list(path).index(used) : -1]]
                elif used not in seen:
                    path[used] = self.used_keys(used)
        return order

    def used_keys(self, key: str) -> Iterator[str]:
        spec = self.declared[key].spec
        names = (self.key_of(reference) for reference in references(spec)) if spec else ()
        return (name for name in names if name in self.declared)

    def key_of(self, reference: ast.TypeName) -> str:
        """Return the key of a name such as `Lib.T`. The key is the whole name if declared, else T."""
        whole = reference.name.casefold()
        return whole if self.is_declared(whole) else whole.rpartition(".")[2]

    def is_declared(self, key: str) -> bool:
        return key in self.declared or key in self.known or key in self.broken

    # -- one specification -------------------------------------------------------------------------------

    def build(self, spec: ast.Spec, name: str, user: str) -> tuple[Type | None, int]:
        """Return the type of a specification, or None if a part is bad, and how deep the type nests."""
        match spec:
            case StringType() | Pointer() | RawType():
                return spec, 0
            case ast.TypeName():
                return self.look_up(spec, user)
            case ast.ArraySpec():
                return self.build_array(spec, user)
            case ast.StructSpec():
                return self.build_struct(spec, name, user)
            case ast.EnumSpec():
                return self.build_enum(spec, name, user), 0
            case ast.TextSpec():
                return self.build_text(spec, user), 0
            case ast.RangeSpec():
                return self.build_range(spec, user), 0

    def build_array(self, spec: ast.ArraySpec, user: str) -> tuple[Type | None, int]:
        element, depth = self.build(spec.element, "", user)
        bounds = [self.find_limits(low, high, user) for low, high in spec.bounds]
        known = tuple([pair for pair in bounds if pair is not None])
        if element is None or len(known) < len(bounds):
            return None, depth + 1
        return Array(known, element), depth + 1

    def build_text(self, spec: ast.TextSpec, user: str) -> Type | None:
        length = self.evaluate_number(spec.length, user)
        if length is not None and length < 1:
            self.report(user, _make_number_problem(spec.length, length, "a length of 1 or more"))
            return None
        return None if length is None else StringType(length, spec.wide, spec.utf8)

    def build_range(self, spec: ast.RangeSpec, user: str) -> Type | None:
        base = self.look_up_integer(spec.base, user)
        unknown = self.find_unknown(spec.low, spec.high)
        limits = None if unknown else self.find_limits(spec.low, spec.high, user)
        if base is not None and unknown:  # the base alone decides the layout
            bounds = [n.text if isinstance(n, ast.Formula) else str(n) for n in (spec.low, spec.high)]
            text = f"{base.name}({'..'.join(bounds)}) is laid out as {base.name}"
            note = f"{spec.base.where}: {text}; unknown limits: {', '.join(unknown)}"
            self.notes.setdefault(user, {})[note] = None
            return base
        if base is None or limits is None:
            return None
        low, high = base.limits
        if limits[0] < low or limits[1] > high:
            found = f"{base.name}({limits[0]}..{limits[1]})"
            self.report(user, Problem(spec.base.where, found, f"limits from {low} to {high}"))
            return None
        return Subrange(base, *limits)

    def build_struct(self, spec: ast.StructSpec, name: str, user: str) -> tuple[Type | None, int]:
        base, deepest = self.build_base(spec, user)
        firsts = dict.fromkeys((member.name.casefold() for member in all_members(base)), "")
        members: list[Member] = []
        bits: list[BitField] = []
        for member in spec.members:
            if member.width is not None:
                bits += self.build_bits(member, member.width, len(members) + bool(base), user)
                continue
            first = firsts.setdefault(member.name.casefold(), member.where)
            if first is not member.where:
                expected = f"a new name; the first is at {first}" if first else "a name the base type lacks"
                self.report(user, Problem(member.where, f"member '{member.name}' a second time", expected))
            type_, depth = self.build(member.spec, "", user)
            deepest = max(deepest, depth)
            if type_ is not None:
                members.append(Member(member.name, type_))
        if len(members) + len(bits) < len(spec.members) or (spec.base is not None and base is None):
            return None, deepest + 1
        made = Union if spec.is_union else Struct
        # The base of a STRUCT is a STRUCT, of a UNION a UNION (`build_base`).
        type_ = made(name, tuple(members), base, spec.pack, tuple(bits))  # type: ignore[arg-type]
        return type_, deepest + 1

    def build_bits(self, member: ast.MemberSpec, width: int, at: int, user: str) -> Iterator[BitField]:
        base = self.build(member.spec, "", user)[0]
        if width == ast.NO_LENGTH:
            if base is not None:
                yield BitField(at, 0, 0, True, base)
            return
        row = base.base if isinstance(base, Enumeration) else base
        if isinstance(row, Elementary) and width <= 8 * row.size:
            yield BitField(at, row.size, width, bool(member.name))
        elif row is not None:
            self.report(user, Problem(member.where, f"{width} bits", "an integer type of as many bits"))

    def build_base(self, spec: ast.StructSpec, user: str) -> tuple[Struct | Union | None, int]:
        if spec.base is None:
            return None, 0
        base, depth = self.look_up(spec.base, user)
        word = "UNION" if spec.is_union else "STRUCT"
        if isinstance(base, Union if spec.is_union else Struct):
            if spec.is_class and has_padded_end(base):
                found = f"base class '{spec.base.name}' that does not end with a member{CPP_NOTE}"
                self.report(user, Problem(spec.base.where, found, "a base without padding at its end"))
                return None, depth
            return base, depth
        if base is not None:
            self.report(user, Problem(spec.base.where, f"'{spec.base.name}'", f"a {word} to extend"))
        return None, depth

    def build_enum(self, spec: ast.EnumSpec, name: str, user: str) -> Type | None:
        base = self.look_up_integer(spec.base, user) if spec.base else ELEMENTARY["INT"]
        return base and Enumeration(name, base, self.evaluate_enum(spec, name), spec.base is not None)

    def evaluate_enum(self, spec: ast.EnumSpec, name: str) -> tuple[tuple[str, int | None], ...]:
        """Return names and numbers; None for a number without a value: the layout does not depend on it."""
        values: list[tuple[str, int | None]] = []
        number: int | None = -1
        for value, own in spec.values:
            if own is not None:
                number = None
                with suppress(UserError):  # a bad number does not change the layout
                    number = self.constants.evaluate_number(own, [], name)
            elif number is not None:
                number += 1
            values.append((value, number))
        return tuple(values)

    # -- names and numbers -------------------------------------------------------------------------------

    def look_up(self, reference: ast.TypeName, user: str) -> tuple[Type | None, int]:
        row = ELEMENTARY.get(reference.name.upper())
        key = self.key_of(reference)
        # A declared type replaces a type of the same name that only one vendor has.
        if row is not None and not (reference.name.upper() in VENDOR_NAMES and self.is_declared(key)):
            return row, 0
        if key in self.declared and self.declared[key].is_data:
            self.report(user, Problem(reference.where, f"'{reference.name}'", KNOWN_TYPE))
            return None, 0
        if key in self.types:
            type_ = self.types[key]
            if not isinstance(type_, Struct | Union | Enumeration):  # an alias: its name is lost in the user
                self.notes.setdefault(user, {}).update(self.notes.get(key, {}))
            return type_, self.depths[key]
        if key in self.known:
            return self.known[key][1], 0
        if key in self.bad or key in self.broken:
            self.report(user, *(self.bad.get(key) or self.broken[key]))
        elif key in self.declared:
            circle = self.circles.get((user, key), [])
            found = f"'{reference.name}', which contains this member"
            if 1 < len(circle) <= MOST_PROBLEMS_SHOWN:
                found = f"'{reference.name}' in a circle: {', '.join(circle)}, {circle[0]}"
            expected = "a type that does not contain itself"
            spec = self.declared[user].spec if user in self.declared else None
            if isinstance(spec, ast.StructSpec) and spec.base is reference:
                found = f"'{reference.name}', which extends this type"
                expected = "a base type that does not extend this type"
            self.report(user, Problem(reference.where, found, expected))
        elif key in BUILTIN_TYPES:
            return BUILTIN_TYPES[key], 0
        elif user in self.system_users and key in system_types():
            self.used_system[key] = reference.name
            if reference.name.upper() in UNSURE_HANDLE_TYPES:
                self.notes.setdefault(user, {})[f"{reference.name}: 16 bits are not verified"] = None
            return system_types()[key], 0
        else:
            self.report(user, Problem(reference.where, f"'{reference.name}'", KNOWN_TYPE))
        return None, 0

    def look_up_integer(self, reference: ast.TypeName, user: str) -> Elementary | None:
        """Return the integer type of this name; for a subrange its base."""
        base = self.look_up(reference, user)[0]
        row = base.base if isinstance(base, Subrange) else base
        if isinstance(row, Elementary) and row.kind in WHOLE_KINDS:
            return row
        if row is not None:
            self.report(user, Problem(reference.where, f"'{reference.name}'", "an integer type such as INT"))
        return None

    def find_limits(self, low: ast.Number, high: ast.Number, user: str) -> tuple[int, int] | None:
        """Return the numbers of `low..high`, or None with a problem if one is unknown or `high` < `low`."""
        first, last = self.evaluate_number(low, user), self.evaluate_number(high, user)
        if first is None or last is None:
            return None
        if last < first:
            if isinstance(high, ast.Formula) or isinstance(low, int):
                place = self.declared[user].where if user in self.declared else "type"
                problem = _make_number_problem(high, last, f"a number from {first} upwards", place)
            else:
                problem = _make_number_problem(low, first, f"a number up to {last}")
            self.report(user, problem)
            return None
        return first, last

    def evaluate_number(self, number: ast.Number, user: str) -> int | None:
        """Return the value of a number; if it has no value, report problems and return None."""
        if isinstance(number, int):
            return number
        unknown: list[str] = []
        try:
            value = self.constants.evaluate_number(number, unknown)
        except UserError as refused:
            self.report(user, *refused.problems)
            return None
        for name in unknown:
            reason = self.constants.missing_reason(name)
            found = f"'{name}', {reason}" if reason else f"'{name}'"
            self.report(user, Problem(number.where, found, expected_constant(name)))
        return value

    def find_unknown(self, *numbers: ast.Number) -> list[str]:
        """Return the names without a value in these numbers; none if a number is itself wrong."""
        unknown: list[str] = []
        for number in numbers:
            try:
                self.constants.evaluate_number(number, unknown)
            except UserError:
                return []
        return list(dict.fromkeys(unknown))


def expected_constant(name: str) -> str:
    return f'{KNOWN}constant; add "{name}" = VALUE to [constants] of the project, or --constant {name}=VALUE'


def unknown_name(problem: Problem) -> str:
    """Return the name of the unknown type or constant in a problem."""
    name, reason, _ = problem.found[1:].rpartition("', which ")
    return name if reason else problem.found[1:-1]


def references(spec: ast.Spec) -> Iterator[ast.TypeName]:
    """Yield every name of a type in a specification."""
    match spec:
        case ast.TypeName():
            yield spec
        case ast.ArraySpec(_, element):
            yield from references(element)
        case ast.EnumSpec(base=ast.TypeName() as base) | ast.RangeSpec(base=base):
            yield base
        case ast.StructSpec(members, base):
            if base is not None:
                yield base
            for member in members:
                yield from references(member.spec)


def _make_number_problem(number: ast.Number, value: int, expected: str, where: str = "") -> Problem:
    if isinstance(number, ast.Formula):
        return Problem(number.where, f"'{number.text}', which is {value}", expected)
    return Problem(where, str(value), expected)
