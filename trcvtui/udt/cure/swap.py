"""Swap code for the sender: reverses the bytes of every number of a type, in ST or in SCL.

Rule: the swapped telegram is a type in which each number is a bit string of its size. The reversed bytes of
a REAL are not a number and must not pass through a REAL variable.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal, NamedTuple

from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.rules import S7, LayoutRules
from trcvtui.udt.st_write import join_arrays, rename_for_st, scl_name, scl_text, st_name, st_text
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    Elementary,
    Enumeration,
    Member,
    StringType,
    Struct,
    Subrange,
    Type,
    Union,
    ValueKind,
    all_members,
    direct_parts,
    type_text,
)

Language = Literal["st", "scl"]
BITS: Final = {2: "WORD", 4: "DWORD", 8: "LWORD"}
# In TIA these are converted to a bit string by way of a number.
SCL_INTERMEDIATE_TYPES: Final = {
    "TIME": "DINT",
    "LTIME": "LINT",
    "DATE": "UINT",
    "TOD": "UDINT",
    "LTOD": "ULINT",
    "LDT": "LINT",
}
HELPER_FUNCTIONS: Final = {
    "SWAP2": """FUNCTION SWAP2 : WORD
VAR_INPUT x : WORD; END_VAR
SWAP2 := ROL(x, 8);
END_FUNCTION
""",
    "SWAP4": """FUNCTION SWAP4 : DWORD
VAR_INPUT x : DWORD; END_VAR
SWAP4 := (ROL(x, 8) AND 16#00FF00FF) OR (ROR(x, 8) AND 16#FF00FF00);
END_FUNCTION
""",
    "SWAP8": """FUNCTION SWAP8 : LWORD
VAR_INPUT x : LWORD; END_VAR
SWAP8 := (ROL(x, 8) AND 16#000000FF000000FF) OR (ROL(x, 24) AND 16#0000FF000000FF00)
    OR (ROR(x, 24) AND 16#00FF000000FF0000) OR (ROR(x, 8) AND 16#FF000000FF000000);
END_FUNCTION
""",
    # REAL_TO_DWORD rounds to a whole number in CODESYS; a UNION keeps the bits.
    **{
        f"{real}_BITS": f"""TYPE U_{real}_BITS :
UNION
    r : {real};
    d : {bits};
END_UNION
END_TYPE
FUNCTION {real}_BITS : {bits}
VAR_INPUT x : {real}; END_VAR
VAR u : U_{real}_BITS; END_VAR
u.r := x;
{real}_BITS := u.d;
END_FUNCTION
"""
        for real, bits in (("REAL", "DWORD"), ("LREAL", "LWORD"))
    },
}


def language_of(rules: LayoutRules) -> Language:
    return "scl" if rules.name == S7.name else "st"


class SwapCode(NamedTuple):
    """The swapped telegram as a type and as text, helper functions, statements, and what is not swapped."""

    type: Type
    types: str
    helpers: str
    code: str
    left_out: tuple[str, ...]

    @property
    def text(self) -> str:
        return "\n".join(part for part in (self.types, self.helpers, self.code) if part)


def swap_code(sent: Layout, language: Language = "st") -> SwapCode:
    """Return the code that copies the variable `msg` to `wire` with the bytes of every number reversed."""
    return _SwapWriter(sent.rules, language).write_code(sent)


class _SwapPosition(NamedTuple):
    """The place of a statement: the type as declared, target, source, the path as declared."""

    plain: Type
    to: str
    of: str
    path: str
    depth: int = 0
    indent: str = ""


class _SwapWriter:
    def __init__(self, rules: LayoutRules, language: Language) -> None:
        self.rules, self.language = rules, language
        self.left_out: list[str] = []
        self.helpers: set[str] = set()
        self.deepest = 0
        self._made: dict[int, Struct] = {}

    def write_code(self, sent: Layout) -> SwapCode:
        plain = sent.type
        if self.language == "st":
            sent = lay_out(rename_for_st(sent.type), self.rules, st_name(sent.name))
        made = self.swap_type(sent.type)
        assert lay_out(made, self.rules).size == sent.size
        body = "\n".join(self.statements(sent.type, _SwapPosition(plain, "wire", "msg", "")))
        types, name = "", f"{sent.name}_swapped"
        if made is not sent.type:
            types = st_text(made, name) if self.language == "st" else scl_text(made, name, self.rules)
        helpers = "\n".join(text for name, text in HELPER_FUNCTIONS.items() if name in self.helpers)
        loops = ", ".join(f"i{number}" for number in range(1, self.deepest + 1))
        note = f"{loops} : DINT; " if loops else ""
        name = getattr(made, "name", "") or name
        head = f"// msg : {sent.name}; wire : {name}; {note}send {self.variable_name('wire')}"
        return SwapCode(made, types, helpers, f"{head}\n{body}\n", tuple(self.left_out))

    def swap_type(self, type_: Type) -> Type:
        """Return the type with every number as a bit string."""
        match type_:
            case Array(bounds=bounds, element=element):
                made = self.swap_type(element)
                return type_ if made is element else Array(bounds, made)
            case Struct():
                if id(type_) not in self._made:
                    self._made[id(type_)] = self.swap_struct(type_)
                return self._made[id(type_)]
            case _:
                row = self.number_type(type_)
                return type_ if row is None or row.kind is ValueKind.BITS else ELEMENTARY[BITS[row.size]]

    def swap_struct(self, type_: Struct) -> Struct:
        members = tuple(Member(member.name, self.swap_type(member.type)) for member in type_.members)
        base = None if type_.base is None else self.swap_struct(type_.base)
        pairs = zip(members, type_.members, strict=True)
        if base is type_.base and all(new.type is old.type for new, old in pairs):
            return type_
        name = f"{type_.name}_swapped" if type_.name else ""
        return Struct(name, members, base, type_.pack, type_.bit_fields)

    def stored_type(self, type_: Type) -> Elementary | None:
        return self.rules.storage(type_) if isinstance(type_, Elementary | Subrange | Enumeration) else None

    def number_type(self, type_: Type) -> Elementary | None:
        row = self.stored_type(type_)
        if row is None or row.size not in BITS or row.code.endswith("s") or row.kind is ValueKind.ADDRESS:
            return None
        return row

    def keeps_bytes(self, type_: Type) -> bool:
        """Return whether the swap leaves all bytes of the type where they are."""
        match type_:
            case Array() | Struct() | Union():
                return all(map(self.keeps_bytes, direct_parts(type_)))
            case StringType(wide=wide):
                return not wide
            case _:
                row = self.stored_type(type_)
                # The BCD digits of a DT have no byte order.
                return row is not None and (row.size == 1 or (row.name, row.code) == ("DT", "8s"))

    def statements(self, type_: Type, at: _SwapPosition) -> Iterator[str]:
        _, to, of, path, _, indent = at
        row = self.number_type(type_)
        if self.keeps_bytes(type_) and _has_type_name(type_):
            yield f"{indent}{self.variable_name(to)} := {self.variable_name(of)};"
        elif row is not None:
            yield f"{indent}{self.variable_name(to)} := {self.swap_expression(row, self.variable_name(of))};"
        elif isinstance(type_, Array):
            yield from self.loops(type_, at)
        elif isinstance(type_, Struct):
            assert isinstance(at.plain, Struct)
            for own, plain in zip(all_members(type_), all_members(at.plain), strict=True):
                name = own.name if self.language == "st" else scl_name(own.name)
                below = f"{path}.{plain.name}" if path else plain.name
                there = at._replace(plain=plain.type, to=f"{to}.{name}", of=f"{of}.{name}", path=below)
                yield from self.statements(own.type, there)
        else:
            what = "a UNION; swap the member that is in use" if isinstance(type_, Union) else type_text(type_)
            self.left_out.append(f"{path or of}: {what}")
            yield f"{indent}// {to} is not swapped here: {what}"

    def loops(self, type_: Array, at: _SwapPosition) -> Iterator[str]:
        depth, indent, plain = at.depth, at.indent, at.plain
        if self.language == "scl":  # the written type has its nested ARRAYs joined, too
            type_ = plain = join_arrays(type_, self.rules)
        names = [f"i{depth + number}" for number in range(1, len(type_.bounds) + 1)]
        self.deepest = max(self.deepest, depth + len(names))
        inner = indent
        for name, (low, high) in zip(names, type_.bounds, strict=True):
            yield f"{inner}FOR {self.variable_name(name)} := {low} TO {high} DO"
            inner += "    "
        index = f"[{','.join(map(self.variable_name, names))}]"
        assert isinstance(plain, Array)
        below = at.path + index, depth + len(names), inner
        there = _SwapPosition(plain.element, at.to + index, at.of + index, *below)
        yield from self.statements(type_.element, there)
        for _ in names:
            inner = inner[:-4]
            yield f"{inner}END_FOR;"

    def swap_expression(self, row: Elementary, value: str) -> str:
        """Return the expression that reverses the bytes of a number."""
        bits = BITS[row.size]
        if self.language == "scl":
            via = SCL_INTERMEDIATE_TYPES.get(row.name)
            if via:
                value = f"{row.name}_TO_{via}({value})"
            same = row.kind is ValueKind.BITS
            return f"SWAP({value})" if same else f"SWAP({via or row.name}_TO_{bits}({value}))"
        self.helpers.add(f"SWAP{row.size}")
        if row.kind is ValueKind.REAL:
            self.helpers.add(f"{row.name}_BITS")
            value = f"{row.name}_BITS({value})"
        elif row.kind is not ValueKind.BITS:
            value = f"{row.name}_TO_{bits}({value})"
        return f"SWAP{row.size}({value})"

    def variable_name(self, path: str) -> str:
        return f"#{path}" if self.language == "scl" else path


def _has_type_name(type_: Type) -> bool:
    while isinstance(type_, Array):
        type_ = type_.element
    return not isinstance(type_, Struct) or bool(type_.name)
