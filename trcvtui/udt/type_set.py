"""Declared types looked up and joined: the good ones as types, the bad ones with all that is wrong in them.

Rule: a bad type never hides a good one. Duplicates, recursion and unknown types are found together.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from trcvtui.errors import Problem, UserError, mistake
from trcvtui.udt.ast import Declarations, SenderLayout, Spec
from trcvtui.udt.constants import Constants
from trcvtui.udt.resolve import KNOWN, Resolver, unknown_name
from trcvtui.udt.types import Type


@dataclass(frozen=True, slots=True)
class TypeSet:
    """The types of one or more files; `types`, `broken`, `notes` and `senders` by casefolded name.

    `problems` are those of all files in order. `unknown_constants` are the names to ask for, `notes` what is
    to be shown beside a type, `senders` the layouts that the sources of types tell.
    """

    where: str
    types: dict[str, tuple[str, Type]]
    broken: dict[str, tuple[Problem, ...]]
    problems: tuple[Problem, ...]
    unknown_constants: tuple[str, ...] = ()
    notes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    senders: Mapping[str, SenderLayout] = field(default_factory=dict)
    constants: Constants = field(default_factory=Constants, compare=False, repr=False)

    def names(self) -> list[str]:
        """Return the names of the good types, as declared, in declared order."""
        return [name for name, _ in self.types.values()]

    def named(self, name: str, where: str = "type") -> Type:
        """Return a type by name (in any case); raise UserError if it is bad, with all that is, or unknown."""
        for known in _keys(name):
            if known in self.types:
                return self.types[known][1]
            if known in self.broken:
                raise UserError(self.broken[known])
        known = ", ".join(self.names()[:8]) or "no type"
        raise mistake(where, f"'{name}'", f"a type of {self.where}: {known}")

    def layout(self, name: str) -> str:
        """Return the layout that the source of a type stands for, "" for none."""
        return "" if self.sender(name).source else self.sender(name).layout

    def sender(self, name: str) -> SenderLayout:
        """Return the layout that a sender of a type is likely to have: a first guess, never a certainty."""
        known = (key for key in _keys(name) if key in self.types)
        return self.senders.get(next(known, ""), SenderLayout())

    def only(self, files: Sequence[Declarations]) -> str:
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
            raise mistake(self.where, found, "one type, or its name")
        others = " and ".join({word: None for file in files for word in file.others})
        raise mistake(self.where, f"no type, only {others}" if others else "no type", "TYPE ... END_TYPE")


def _keys(name: str) -> tuple[str, str]:
    key = name.casefold()
    return key, key.rpartition(".")[2]  # `A.B.T` of a NAMESPACE is declared as T


NO_TYPES = TypeSet("the project", {}, {}, ())


def join(
    files: Iterable[Declarations],
    where: str,
    constants: Mapping[str, int] | None = None,
    last_wins: Collection[str] = (),
) -> TypeSet:
    """Return the types of all files together; they may use each other in any order.

    `constants` are the user's own; of a type in `last_wins` the last declaration counts, of any other
    a second one is a mistake.
    """
    files = tuple(files)
    known = Constants(constants, [constant for file in files for constant in file.constants])
    resolver = Resolver(known, {}, {}, last_wins)
    for file in files:
        for declaration in file.types:
            resolver.declare(declaration)
    resolver.build_all()
    found = {problem: None for bad in resolver.bad.values() for problem in bad}
    found |= {problem: None for file in files for problem in file.problems}
    types = {key: (resolver.declared[key].name, type_) for key, type_ in resolver.types.items()}
    senders = {
        key: file.sender
        for file in files
        for declared in file.types
        if resolver.declared[key := declared.name.casefold()] is declared
    }
    first: dict[object, Problem] = {}  # what is unknown: one name, one line, at the first place
    for problem in sorted(found, key=_reading_order):
        unknown = problem.found.casefold() + problem.expected.casefold()
        first.setdefault(unknown if problem.expected.startswith(KNOWN) else problem, problem)
    problems = tuple(first.values())
    return TypeSet(
        where,
        types={key: types[key] for key in resolver.declared if key in types},
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
    )


def _reading_order(problem: Problem) -> list[str | int]:
    # Text and numbers alternate, so that line 9 comes before line 10.
    return [int(part) if part.isdigit() else part for part in re.split("([0-9]{1,18})", problem.where)]


def build(spec: Spec, types: TypeSet) -> Type:
    """Return the type that a specification means among these types; raise UserError with all its problems."""
    resolver = Resolver(types.constants, types.types, types.broken)
    type_, _ = resolver.build(spec, "", "")
    if type_ is None:
        raise UserError(resolver.bad[""])
    return type_
