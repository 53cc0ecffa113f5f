"""Finds missing types and constants in the files beside a type, or in a folder.

Rule: every file that declares a missing name is added whole. If two such files differ, the name is refused
as declared twice. A broken file never hides a good one.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from trcvtui.errors import Problem, UserError, collect_problems, mistake
from trcvtui.udt.ast import Declaration, Declarations, strip_places
from trcvtui.udt.constants import plain_name
from trcvtui.udt.resolve import KNOWN_TYPE, expected_constant, unknown_name
from trcvtui.udt.sources import content_of, declarations_in, decode_text, qualify_variables, type_files_in
from trcvtui.udt.type_set import TypeSet, join_declarations

MOST_FILES: Final = 5000  # files, and folders
MOST_BYTES: Final = 64 * 1024 * 1024
MOST_NAMES_SHOWN: Final = 8  # names in one line
TYPE, TYPE_OR_DATA, CONSTANT = "type", "type or data", "constant"  # kinds of missing names
PACKAGE_FILES: Final = (".typ", ".var")  # B&R: valid in all packages of their folder
MOST_FOLDERS_AROUND: Final = 8  # folders
GENERATED_HEADER: Final = (
    r"(?i)(?:.*/)?SG[34C]/.*\.h(?:pp)?"  # B&R generates it from the .typ files of a library
)


class TypeFolder:
    """The type files of a folder, with its subfolders if `is_whole`. Links to folders are not followed."""

    extensions: str | tuple[str, ...] = ""  # of the files that count, "" for all

    def __init__(self, path: str, place: str, without: Iterable[str] = (), is_whole: bool = True) -> None:
        self.path, self.place, self.is_whole = path, place, is_whole
        self.without = {os.path.realpath(each) for each in without}
        self.read: dict[str, Declarations] = {}
        self.problems: list[Problem] = []  # of files that could not be read

    @cached_property
    def texts(self) -> dict[str, str]:
        """Return the casefolded text of each file; raise UserError if there is too much."""
        texts: dict[str, str] = {}
        size = 0
        for number, (folder, inner, _) in enumerate(os.walk(self.path)):
            inner[:] = sorted(name for name in inner if self.is_whole and not name.startswith("."))  # .git
            names = [name for name in type_files_in(folder) if name.lower().endswith(self.extensions)]
            for path in (os.path.join(folder, name) for name in names):
                if len(texts) > MOST_FILES or size > MOST_BYTES or os.path.realpath(path) in self.without:
                    continue
                with suppress(UserError):
                    data = content_of(path)
                    size += len(data)
                    texts[os.path.relpath(path, self.path)] = decode_text(data).casefold()
            if max(number, len(texts)) > MOST_FILES or size > MOST_BYTES:
                found = f"a folder of more than {MOST_FILES} type files or {MOST_BYTES >> 20} MiB"
                raise mistake(self.path, found, "a smaller folder, or --with FILE for each file that is used")
        return texts

    def declarations(self, file: str) -> Declarations:
        """Return a file's declarations, none if unreadable; a generated header gives no types of a .typ."""
        if file not in self.read:
            self.read[file] = Declarations(())
            with collect_problems(self.problems):
                read = declarations_in(os.path.normpath(os.path.join(self.path, file)))
                if re.fullmatch(GENERATED_HEADER, file):
                    types = tuple([one for one in read.types if one.name.casefold() not in self.typ_names])
                    read = read._replace(types=types, problems=read.problems if types else ())
                self.read[file] = qualify_variables(read, file, self.texts)
        return self.read[file]

    @cached_property
    def typ_names(self) -> set[str]:
        files = [self.declarations(file) for file in self.texts if file.lower().endswith(".typ")]
        return {each.name.casefold() for declared in files for each in declared.types}

    def read_all(self) -> list[Declarations]:
        found = _drop_repeated(map(self.declarations, self.texts))
        if self.problems and not any(each.types or each.problems for each in found):
            raise UserError(self.problems[:MOST_NAMES_SHOWN])
        return found

    def find_declaring_files(self, name: str, kind: str) -> dict[str, Declarations]:
        """Return the files with a good declaration of a name, else the files with a bad declaration."""
        last = plain_name(name).casefold().rpartition(".")[2]
        spelled = re.sub("^(udt|db)([0-9])", r"\1[ \\t]*\2", re.escape(last))
        sought = re.compile(rf"(?<!\w){spelled}(?!\w)")
        found: dict[bool, dict[str, Declarations]] = {True: {}, False: {}}
        texts = self.texts.items()
        for file in [file for file, text in texts if sought.search(text) or sought.search(file.casefold())]:
            declared = self.declarations(file)
            owners = [each for each in declared.types if _declares(each, last, kind)]
            constants = declared.constants if kind == CONSTANT else ()
            if owners or any(plain_name(each.name).casefold().split(".")[-1] == last for each in constants):
                is_good = not any(each.spec is None or each.problems for each in owners)
                found[is_good][file] = declared
        return found[True] or found[False]


def _declares(declared: Declaration, name: str, kind: str) -> bool:
    if kind == CONSTANT:
        return name in [each.casefold() for each, _ in getattr(declared.spec, "values", ())]
    is_sought = kind == TYPE_OR_DATA or not declared.is_data
    return is_sought and f"/{declared.name.casefold()}".endswith(f"/{name}")  # also `Prog/Variables`


def packages_around(path: str, without: Iterable[str]) -> Iterator[TypeFolder]:
    """Yield the packages of B&R around a file or folder, the nearest first, up to the folder `Logical`."""
    inner = Path(os.path.abspath(path))
    folders = [inner, *inner.parents][not inner.is_dir() :][: MOST_FOLDERS_AROUND + 1]
    for folder, around in pairwise(folders):
        # `Logical` is the root of a B&R project; nothing above the home folder is searched.
        if folder.name == "Logical" or folder == Path(os.path.expanduser("~")):
            return
        near = os.path.relpath(around)
        package = TypeFolder(near, f"in {near}", without, is_whole=False)
        package.extensions = PACKAGE_FILES
        yield package


def find_types(
    files: Sequence[Declarations],
    folders: Sequence[TypeFolder],
    names: Collection[str],
    where: str,
    constants: Mapping[str, int],
) -> tuple[TypeSet, list[str]]:
    """Return the types of files, the types in folders that `names` need, and notes on the used folders."""
    found_in: dict[str, dict[str, dict[str, Declarations]]] = {}
    sought: set[tuple[str, str]] = set()
    types = join_declarations(files, where, constants)
    while new := set(_find_missing(types, names)) - sought:
        sought |= new
        for name, kind in sorted(new):
            is_found = False
            for folder in folders:  # all given folders; the files beside FILE only if these have none
                if (folder.is_whole or not is_found) and (found := folder.find_declaring_files(name, kind)):
                    is_found = True
                    found_in.setdefault(folder.place, {})[name] = found
                    files = _drop_repeated([*files, *found.values()])
        types = join_declarations(files, where, constants)
    return types, [_describe_found(names, place, found) for place, found in found_in.items()]


def _find_missing(types: TypeSet, names: Iterable[str]) -> Iterator[tuple[str, str]]:
    known = types.types.keys() | types.broken.keys()
    yield from ((name, TYPE) for name in types.used_system)  # a file may declare it instead
    for name in names:
        if known.isdisjoint({name.casefold(), name.casefold().rpartition(".")[2]}):
            yield name, TYPE_OR_DATA
        for problem in types.broken.get(name.casefold(), ()):
            lacked = unknown_name(problem)
            if problem.found == f"'{lacked}'" and problem.expected in (KNOWN_TYPE, expected_constant(lacked)):
                yield lacked, TYPE if problem.expected == KNOWN_TYPE else CONSTANT


def _describe_found(users: Collection[str], place: str, found: Mapping[str, Iterable[str]]) -> str:
    names: dict[tuple[str, ...], list[str]] = {}
    for name, files in found.items():
        names.setdefault(tuple(files), []).append(name)
    texts = [f"{_shorten_names(each)}: found in {_shorten_names(files)}" for files, each in names.items()]
    verb = "uses" if len(users) == 1 else "use"
    uses = f"{_shorten_names(users)} {verb} " if found.keys().isdisjoint(users) else ""
    return f"{uses}{_shorten_names(texts)} {place}"


def _shorten_names(names: Collection[str]) -> str:
    return ", ".join([*list(names)[:MOST_NAMES_SHOWN], "..."][: len(names)])


def _drop_repeated(files: Iterable[Declarations]) -> list[Declarations]:
    """Return the files; a declaration that is equal to one in an earlier file is left out."""
    known: set[Any] = set()
    kept: list[Declarations] = []
    for file in files:
        contents = [strip_places((each.name, each.spec, file.sender.layout)) for each in file.types]
        new = [each for each, content in zip(file.types, contents, strict=True) if content not in known]
        kept.append(file._replace(types=tuple(new)))
        known |= set(contents)
    return kept
