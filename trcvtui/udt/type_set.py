"""The types of files joined: good ones as types, bad ones with all their problems.

Rule: a bad type never hides a good one. Duplicates, recursion and unknown types are found together.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from trcvtui.errors import Problem, UserError, mistake
from trcvtui.udt.ast import Declaration, Declarations, SenderLayout, Spec, strip_places
from trcvtui.udt.constants import Constants
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.resolve import KNOWN, Resolver, unknown_name
from trcvtui.udt.system_types import system_types
from trcvtui.udt.types import Struct, Type
from trcvtui.wording import count


@dataclass(frozen=True, slots=True)
class TypeSet:
    """The types of one or more files. `types`, `broken`, `notes`, `senders` are by casefolded name.

    `problems` are the problems of all files in order. `unknown_constants` are the names to ask the user
    for. `notes` are shown beside a type. `senders` are the layouts that the sources suggest. `used_system`
    are the system types of Siemens in use. With `has_system_types` a new type may use all system types.
    """

    where: str
    types: dict[str, tuple[str, Type]]
    broken: dict[str, tuple[Problem, ...]]
    problems: tuple[Problem, ...]
    unknown_constants: tuple[str, ...] = ()
    notes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    senders: Mapping[str, SenderLayout] = field(default_factory=dict)
    constants: Constants = field(default_factory=Constants, compare=False, repr=False)
    used_system: tuple[str, ...] = ()
    has_system_types: bool = False

    def names(self) -> list[str]:
        """Return the names of the good types, as declared, in declared order."""
        return [name for name, _ in self.types.values()]

    def get_type(self, name: str, where: str = "type") -> Type:
        """Return a type by name, in any case. Raise UserError if unknown or bad, with all problems."""
        for known in _lookup_keys(name):
            if known in self.types:
                return self.types[known][1]
            if known in self.broken:
                raise UserError(self.broken[known])
        known = ", ".join(self.names()[:8]) or "no type"
        raise mistake(where, f"'{name}'", f"a type of {self.where}: {known}")

    def source_layout(self, name: str) -> str:
        """Return the layout that the source of a type decides, "" if it decides no layout."""
        return "" if self.sender_layout(name).source else self.sender_layout(name).layout

    def sender_layout(self, name: str) -> SenderLayout:
        """Return the layout that a sender of a type probably has: always a guess."""
        known = (key for key in _lookup_keys(name) if key in self.types)
        return self.senders.get(next(known, ""), SenderLayout())

    def only_name(self, files: Sequence[Declarations]) -> str:
        """Return the name of the only type of these files; raise UserError for none, several or bad ones."""
        names = list({each.name.casefold(): each.name for file in files for each in file.types}.values())
        bad = {problem for file in files for problem in file.problems}
        if len(names) > 1:
            bad |= {problem for name in names for problem in self.broken.get(name.casefold(), ())}
        if bad:
            raise UserError(problem for problem in self.problems if problem in bad)
        if len(names) == 1:
            return names[0]
        if names:
            found = f"{len(names)} types: {', '.join(names[:8])}"
            raise mistake(self.where, found, "one type, or --type NAME")
        others = " and ".join({word: None for file in files for word in file.others})
        raise mistake(self.where, f"no type, only {others}" if others else "no type", "TYPE ... END_TYPE")


def _lookup_keys(name: str) -> tuple[str, str]:
    key = name.casefold()
    return key, key.rpartition(".")[2]  # `A.B.T` of a NAMESPACE is declared as T


NO_TYPES = TypeSet("the project", {}, {}, ())


def join_declarations(
    files: Iterable[Declarations],
    where: str,
    constants: Mapping[str, int] | None = None,
    has_system_types: bool = False,
) -> TypeSet:
    """Return the types of all files together. The types may use each other in any order.

    `constants` are the user's own. The types of a Siemens source may use the system types of Siemens. With
    `has_system_types` all types may use the system types. A type that a file declares replaces the system
    type of its name.
    """
    files = tuple(files)
    known = Constants(constants, [constant for file in files for constant in file.constants])
    resolver = Resolver(known, {}, {})
    for file in files:
        for declaration in file.types:
            resolver.declare(declaration, has_system_types or file.sender.layout == S7.name)
    copies: dict[object, Declaration] = {}  # equal copies once
    for copy in [copy for file in files for copy in file.copies]:
        copies.setdefault(strip_places((copy.name, copy.spec)), copy)
    # A file that declares a type replaces every copy of it; `_note_differences` compares them.
    again = {key: copy for key, copy in copies.items() if copy.name.casefold() in resolver.declared}
    for key in [key for key in copies if key not in again]:
        resolver.declare(copies[key], uses_system=True)
    resolver.build_all()
    _note_differences(resolver, again.values())
    found = {problem: None for bad in resolver.bad.values() for problem in bad}
    found |= {problem: None for file in files for problem in file.problems}
    types = {key: (resolver.declared[key].name, type_) for key, type_ in resolver.types.items()}
    system = system_types().items() if has_system_types else ()
    of_system = {key: (each.name, each) for key, each in system if isinstance(each, Struct)}
    senders = {
        key: file.sender
        for file in files
        for declared in (*file.types, *file.copies)
        if resolver.declared[key := declared.name.casefold()] is declared
    }
    first: dict[object, Problem] = {}  # an unknown name is reported once, at its first place
    for problem in sorted(found, key=_reading_order):
        unknown = problem.found.casefold() + problem.expected.casefold()
        first.setdefault(unknown if problem.expected.startswith(KNOWN) else problem, problem)
    problems = tuple(first.values())
    return TypeSet(
        where,
        types={key: types[key] for key in resolver.declared if key in types}
        | {key: each for key, each in of_system.items() if key not in resolver.declared},
        broken={key: tuple(bad) for key, bad in resolver.bad.items() if key not in types},
        problems=problems,
        unknown_constants=tuple(
            [unknown_name(p) for p in problems if p.expected.startswith(f"{KNOWN}constant")]
        ),
        notes={
            key: notes
            for key, declared in resolver.declared.items()
            if (notes := (*declared.notes, *resolver.notes.get(key, ())))
        },
        senders=senders,
        constants=known,
        used_system=tuple(resolver.used_system.values()),
        has_system_types=has_system_types,
    )


def _note_differences(resolver: Resolver, copies: Iterable[Declaration]) -> None:
    """Note each type that differs from the system type of its name, or from a copy of it in a file."""
    types, users = resolver.types, resolver.system_users & resolver.types.keys()
    rows = [(key, type_, "the system type") for key, type_ in system_types().items() if key in users]
    resolver.system_users.add("")
    for copy in copies:
        built = resolver.build(copy.spec, copy.name, "")[0] if copy.spec else None
        rows += [(copy.name.casefold(), built, f"the copy at {copy.where}")] if built else []
    resolver.bad.pop("", None)
    for key, other, what in rows:
        ours, theirs = _leaf_places(types[key]) if key in types else [], _leaf_places(other)
        if ours and theirs and ours != theirs:
            sizes = [f"{count(len(each) - 1, 'value')} in {each[0]} bytes" for each in (ours, theirs)]
            resolver.notes.setdefault(key, {})[f"{sizes[0]}, but {what} has {sizes[1]}"] = None


def _leaf_places(type_: Type) -> list[object]:
    """Return the size of a type and the places of its leaves, or nothing if it cannot be laid out."""
    try:
        layout = lay_out(type_, S7)
    except UserError:
        return []
    rows = [(each.path.casefold(), each.offset, each.bit, each.size) for each in layout.leaves()]
    return [layout.size, *rows]


def _reading_order(problem: Problem) -> list[str | int]:
    # Text and numbers alternate, so that line 9 comes before line 10.
    return [int(part) if part.isdigit() else part for part in re.split("([0-9]{1,18})", problem.where)]


def build_type(spec: Spec, types: TypeSet) -> Type:
    """Return the type of a specification that may name these types; raise UserError with all problems."""
    resolver = Resolver(types.constants, types.types, types.broken)
    resolver.system_users |= {""} if types.has_system_types else set()
    type_, _ = resolver.build(spec, "", "")
    if type_ is None:
        raise UserError(resolver.bad[""])
    return type_
