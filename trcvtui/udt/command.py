"""`trcvtui udt`: from the command line to the text on stdout.

Rule: an import that only one command needs is in that command, since shell loops start commands often.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

from msgspec.structs import replace

from trcvtui.errors import Problem, UserError, collect_problems, mistake, one_line, raise_all_problems
from trcvtui.files import is_folder
from trcvtui.system_types import UNVERIFIED_NOTE
from trcvtui.udt.ast import Declarations, SenderLayout
from trcvtui.udt.cli_input import STDIN, read_hex_argument, read_messages, read_types, read_values, where_of
from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.rules import NO_CHOICE, LayoutChoice, LayoutRules, parse_choice
from trcvtui.udt.resolve import KNOWN_TYPE, expected_constant, unknown_name
from trcvtui.udt.sources import qualify_variables, set_header_context
from trcvtui.udt.system_types import unverified_in
from trcvtui.udt.type_set import TypeSet
from trcvtui.udt.types import Enumeration, Struct, Type, Union, all_parts


def notes_of(types: TypeSet, name: str, type_: Type, rules: LayoutRules) -> list[str]:
    """Return the notes of a type and of all types in it, each note once, after the name of its type."""
    found = {f"{name}: {note}": None for note in types.notes.get(name.casefold(), ())}
    for inner in all_parts(type_):
        if isinstance(inner, Struct | Union | Enumeration):
            own = inner.name or name
            for note in (*types.notes.get(own.casefold(), ()), *_find_hints(inner, rules)):
                found[f"{own}: {note}"] = None
    return list(found)


def _find_hints(type_: Struct | Union | Enumeration, rules: LayoutRules) -> Iterator[str]:
    if isinstance(type_, Enumeration):
        return
    if not (type_.members or type_.base or type_.bit_fields):
        word = "UNION" if isinstance(type_, Union) else "STRUCT"
        yield f"this {word} is empty: 0 bytes here; a partner's compiler may refuse it or use 1 byte"
    pack = type_.pack
    if pack is not None and not (rules.takes_pack or (max(pack, 1) == rules.cap and rules.struct_floor == 1)):
        yield f"{rules.name} ignores the packing ({pack}) of this type; the layouts codesys-N and c apply it"


# How a message names these fields of a choice; the others by their option.
OPTION_NAMES: Final = {"layout": "layout", "byte_order": "byte order", "text": "STRING form"}


def list_types(args: SimpleNamespace) -> tuple[str, bool]:
    """Return the answer of `udt types`, and whether any type is good. A row has a layout or problems.

    `sender` is the layout of the type's sender, if the source suggests one.
    """
    from trcvtui.udt.report import indented_json
    from trcvtui.wording import format_columns

    choice = parse_layout_choice(args)
    types, own = read_all_types(args, None)
    rows: list[dict[str, Any]] = []
    wanted = (args.type or "").casefold()
    for name, where in [(each.name, each.where) for file in own for each in file.types]:
        if wanted not in ("", name.casefold()):
            continue
        rows.append({"type": name, "size": None, "layout": None, "where": where, "problems": []})
        try:
            layout, _ = TypeChoice(types, name, types.get_type(name), choice).layout()
            rows[-1] |= {"size": layout.size, "layout": layout.rules.name}
        except UserError as refused:
            rows[-1]["problems"] = [str(suggest_option(each)) for each in refused.problems]
        rows[-1]["sender"] = types.sender_layout(name).layout or None
    if not rows:
        _ = types.get_type(args.type, "--type") if args.type else types.only_name(own)  # raises the mistake
    is_good = any(row["layout"] for row in rows)
    write_notes([str(problem) for file in own for problem in file.problems])
    write_notes([] if is_good else [f"{where_of(args.file)}: no type can be laid out"])
    if args.format == "json":
        return indented_json(rows), is_good
    table = [("type", "size", "layout", "where, or what is wrong")]
    for row in rows:
        sender = f" (sender: {row['sender']})" if row["sender"] not in (None, row["layout"]) else ""
        size = "" if row["size"] is None else str(row["size"])
        table.append((row["type"], size, (row["layout"] or "") + sender, [*row["problems"], row["where"]][0]))
    return "\n".join(format_columns(table, "lrll")), is_good


def show(args: SimpleNamespace) -> str:
    from trcvtui.udt.report import layout_json, layout_table

    layout = read_layout(args)
    return layout_json(layout) if args.format == "json" else layout_table(layout)


def decode(args: SimpleNamespace) -> str:
    from trcvtui.udt.report import csv_lines, decoded_json, decoded_text, markdown, member_rows

    layout = read_layout(args)
    data = read_hex_argument(" ".join(args.hex))
    if args.format in ("json", "text"):
        return (decoded_json if args.format == "json" else decoded_text)(layout, data)
    rows = member_rows(layout, data, layout.name)
    return "\n".join(markdown(rows) if args.format == "md" else csv_lines(rows))


def encode(args: SimpleNamespace) -> str:
    from trcvtui.udt.byte_text import BYTE_FORMS
    from trcvtui.udt.report import encode_values

    layout = read_layout(args)
    content = encode_values(layout, read_values(args.values))
    return BYTE_FORMS[args.format](content, layout.name)


def export(args: SimpleNamespace) -> str | None:
    """Return the answer of `udt export`, or None if the answer was written to a file."""
    from trcvtui.udt import exports

    exports.check_arguments(args.to, args.port)  # mistakes in arguments before those in files
    text = exports.export(read_layout(args), args.to, args.port)
    if args.out is None:
        return text.removesuffix("\n")
    from trcvtui.files import write_file

    write_file(args.out, text, args.out)
    return None


def compare(args: SimpleNamespace) -> tuple[str, bool]:
    """Return the answer of `udt compare`, and whether both sides are equal."""
    from trcvtui.udt.compare.compare import Comparison, comparison_json, comparison_text, is_equal

    (ours, notes), (theirs, their_notes) = [side.layout() for side in read_choices(args, *_split_sides(args))]
    write_notes(dict.fromkeys([*notes, *their_notes]))
    comparison = Comparison(ours, theirs)
    data = read_hex_argument(" ".join(args.hex)) if args.hex else b""
    rows = list(comparison.rows(data))
    answer = comparison_text if args.format == "text" else comparison_json
    return answer(comparison, rows, data), is_equal(comparison, rows)


def fit(args: SimpleNamespace) -> tuple[str, bool]:
    """Return the answer of `udt fit`, and whether a layout fits best, even if ours cannot hold the type."""
    from trcvtui.udt.compare.fit import rank
    from trcvtui.udt.compare.fit_report import fit_json, fit_text

    [ours] = read_choices(args, args)
    rules, notes = ours.rules()
    messages = read_messages(" ".join(args.hex))
    fits = rank(ours.type, messages, ours.name, own=rules, sender=ours.types.sender_layout(ours.name).layout)
    try:
        name = lay_out(ours.type, rules, ours.name).name
    except UserError as refused:
        if not fits:
            raise
        name = fits[0].layout.name
        notes = [_refusal_text(name, rules, refused) + "only layouts that can hold it are tried"]
    write_notes([*notes, *notes_of(ours.types, ours.name, ours.type, rules)])
    is_sure = bool(fits) and fits[0].fits_best
    if args.format == "json":
        from trcvtui.udt.report import indented_json

        return indented_json(fit_json(fits, list(map(len, messages)))), is_sure
    sizes = " + ".join([*(str(len(message)) for message in messages[:8]), "..."][: len(messages)])
    return fit_text(fits, f"{name}, {sizes} bytes"), is_sure


def choose_cure_sides(args: SimpleNamespace) -> tuple[LayoutRules, Layout]:
    """Return our rules and their layout for `udt cure`. A layout option given once is for their side."""
    for option in ("layout", "byte_order", "text"):
        given: list[str | None] = getattr(args, option)
        if len(given) == 1:
            setattr(args, option, [None, *given])
    ours, theirs = read_choices(args, *_split_sides(args))
    (rules, our_notes), (layout, their_notes) = ours.rules(), theirs.layout()
    write_notes(dict.fromkeys([*(our_notes if ours.types.source_layout(ours.name) else []), *their_notes]))
    return rules, layout


# -- what the commands have in common ------------------------------------------------------------------------


class TypeChoice(NamedTuple):
    """A type with its name, and the layout options chosen for it."""

    types: TypeSet
    name: str
    type: Type
    choice: LayoutChoice = NO_CHOICE

    def rules(self) -> tuple[LayoutRules, list[str]]:
        """Return the rules, and notes on a layout from the type's source or on unverified offsets."""
        choice, name, sender = self.choice, self.name, self.types.sender_layout(self.name)
        unsure = [f"{name}: {each}: {UNVERIFIED_NOTE}" for each in unverified_in(self.type)]
        if choice.layout is not None or not sender.layout:
            return choice.rules(), unsure
        if own := self.types.source_layout(name):
            text = f"{name}: the source is Siemens, so the layout is {own}; --layout changes that"
            return choice.rules(own), [text, *unsure]
        shown = choice.rules()
        text = f"a {sender.source} type, shown as {shown.name} receives it; the sender's layout is usually"
        return shown, [f"{name}: {text} {sender.layout} (--layout {sender.layout})"]

    def layout(self) -> tuple[Layout, list[str]]:
        """Return layout and notes; the sender's layout if none is chosen and ours cannot hold the type."""
        rules, notes = self.rules()
        sender = self.types.sender_layout(self.name).layout
        try:
            return lay_out(self.type, rules, self.name), notes
        except UserError as refused:
            if self.choice.layout is None and sender:
                with suppress(UserError):
                    layout = lay_out(self.type, self.choice.rules(sender), self.name)
                    text = f"shown in the layout of its sender, {sender}"
                    return layout, [_refusal_text(layout.name, rules, refused) + text]
            raise


def _refusal_text(name: str, rules: LayoutRules, refused: UserError) -> str:
    problem = refused.problems[0]
    return f"{name}: {rules.name} cannot hold this type ({problem.where}, {problem.found}); "


def read_layout(args: SimpleNamespace) -> Layout:
    """Return the layout that the arguments name, and write its notes on stderr; raise UserError."""
    [choice] = read_choices(args, args)
    layout, notes = choice.layout()
    write_notes([*notes, *notes_of(choice.types, choice.name, choice.type, layout.rules)])
    return layout


def read_file_layout(path: str) -> tuple[Layout, SenderLayout]:
    """Return the layout of a file's only outermost type, and the likely layout of its sender."""
    types, own = read_all_types(SimpleNamespace(file=path, others=(), constant=()), None)
    inner = {
        part.name.casefold()
        for _, type_ in types.types.values()
        for part in list(all_parts(type_))[1:]
        if isinstance(part, Struct | Union | Enumeration)
    }
    declared = [each.name for file in own for each in file.types]
    outer = [name for name in declared if name.casefold() not in inner]
    is_good = len(outer) == 1 and all(name.casefold() in types.types for name in declared)
    name = outer[0] if is_good else types.only_name(own)
    layout, notes = TypeChoice(types, name, types.get_type(name, path)).layout()
    write_notes(notes)
    return layout, types.sender_layout(name)


def parse_layout_choice(args: SimpleNamespace) -> LayoutChoice:
    """Return the layout options; raise UserError for an unknown value."""
    found: dict[str, Any] = {}
    for field in LayoutChoice._fields:
        if (text := getattr(args, field)) is not None:
            name = OPTION_NAMES.get(field, f"--{field.replace('_', '-')}")
            found[field] = parse_choice(field, text, name)
    return LayoutChoice(**found)


def write_notes(notes: Iterable[str]) -> None:
    for note in notes:
        sys.stderr.write(f"note: {one_line(note)}\n")


def read_all_types(args: SimpleNamespace, *names: str | None) -> tuple[TypeSet, list[Declarations]]:
    """Return the types of FILE and of every `--with`, and what FILE declares.

    Types that `names` need (None: all of FILE) come from the given folders, then from files beside FILE.
    """
    from trcvtui.udt.sources.type_folder import PACKAGE_FILES, TypeFolder, find_types, packages_around

    paths = [args.file, *args.others]
    set_header_context(paths, getattr(args, "long_size", None))
    if [*paths, *getattr(args, "hex", ()), getattr(args, "values", "")].count(STDIN) > 1:
        raise mistake(where_of(STDIN), "- more than once", "only one input on stdin, the others in files")
    folders = [TypeFolder(path, f"in {path}") for path in paths if is_folder(path)]
    files: dict[str, list[Declarations]] = {}
    with raise_all_problems() as problems:
        for path in paths:
            with collect_problems(problems):
                files[path] = [] if is_folder(path) else [qualify_variables(read_types(path), path, paths)]
    own = files[args.file]
    if not own and None in names:
        own += folders[0].read_all()
    elif own and args.file != STDIN:
        folders.append(TypeFolder(os.path.dirname(args.file) or ".", "beside FILE", paths, is_whole=False))
    names_in = folders[0].texts if is_folder(args.file) else [args.file]
    if any(name.lower().endswith(PACKAGE_FILES) for name in names_in):
        folders += packages_around(args.file, paths)
    wanted = [name for name in names if name] or [each.name for file in own for each in file.types]
    given = [file for each in files.values() for file in each]
    where = ", ".join(map(where_of, paths))
    types, notes = find_types(given, folders, wanted, where, constants_of(args.constant))
    write_notes(notes)
    return types, own


def suggest_option(problem: Problem) -> Problem:
    """Return the problem; for an unknown type or constant, add the option that solves it."""
    if problem.expected == KNOWN_TYPE:
        return replace(problem, expected=f"{KNOWN_TYPE}; add --with FILE that declares it")
    name = unknown_name(problem)
    if problem.expected == expected_constant(name):
        if problem.found != f"'{name}'":  # declared, but with several values or none
            return replace(problem, expected=f"one number; add --constant {name}=VALUE")
        expected = f"a known constant; add --constant {name}=VALUE, or --with FILE that declares it"
        return replace(problem, expected=expected)
    return problem


def read_choices(args: SimpleNamespace, *sides: SimpleNamespace) -> list[TypeChoice]:
    """Return the type and layout options of each side. The default type is the only type of FILE."""
    choices = [parse_layout_choice(side) for side in sides]  # mistakes in arguments before those in files
    types, own = read_all_types(args, *[side.type for side in sides])
    try:
        names = [types.only_name(own) if side.type is None else side.type for side in sides]
        return [
            TypeChoice(types, name, types.get_type(name, "--type"), choice)
            for name, choice in zip(names, choices, strict=True)
        ]
    except UserError as refused:
        raise UserError([suggest_option(problem) for problem in refused.problems]) from None


def _split_sides(args: SimpleNamespace) -> tuple[SimpleNamespace, SimpleNamespace]:
    ours, theirs = {}, {}
    for option in ("type", *LayoutChoice._fields):
        given = getattr(args, option)
        if len(given) > 2:
            found = f"it {len(given)} times"
            raise mistake(f"--{option.replace('_', '-')}", found, "one for both sides, or one for each")
        ours[option], theirs[option] = (given[0], given[-1]) if given else (None, None)
    return SimpleNamespace(**ours), SimpleNamespace(**theirs)


def constants_of(given: Sequence[str]) -> dict[str, int]:
    """Return the constants of `--constant NAME=VALUE`. Raise UserError with every bad option."""
    from trcvtui.udt.literals import parse_integer

    constants: dict[str, int] = {}
    with raise_all_problems() as problems:
        for text in given:
            name, _, value = text.partition("=")
            number = parse_integer(value) if value else None
            if not name.strip() or number is None:
                problems.append(Problem("--constant", f"'{text}'", "NAME=VALUE such as GVL.MAX=10"))
            else:
                constants[name.strip()] = number
    return constants
