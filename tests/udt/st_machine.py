"""A machine for the ST and SCL that swap code is written in: assignments, FOR, functions of one value."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal

from tests.udt.udt_strategies import types_of
from trcvtui.udt.layout.layout import Layout, LayoutRules, lay_out

Order = Literal["little", "big"]
LOCAL = r"(?<!\d)#"  # before the name of a local variable in SCL
WIDTHS = {"BYTE": 1, "WORD": 2, "DWORD": 4, "LWORD": 8}


class Machine:
    """Variables as bytes in the sender's layout; `run` carries out statements."""

    def __init__(self, rules: LayoutRules, variables: Mapping[str, Layout], helpers: str = "") -> None:
        self.rules, self.layouts = rules, dict(variables)
        self.memory = {name: bytearray(layout.size) for name, layout in variables.items()}
        self.indices: dict[str, int] = {}
        self.helpers = helpers
        self.is_scl = False

    def run(self, code: str) -> None:
        """Carry out the statements of a text."""
        self.is_scl = re.search(LOCAL, code) is not None
        unmarked = rf'{LOCAL}|"' if self.is_scl else LOCAL  # in SCL a name may stand in quotes
        lines = [re.sub(unmarked, "", line.split("//")[0]).strip() for line in code.splitlines()]
        self._block([line for line in lines if line])

    def _block(self, lines: list[str]) -> None:
        at = 0
        while at < len(lines):
            loop = re.fullmatch(r"FOR (\w+) := (-?\d+) TO (-?\d+) DO", lines[at])
            if loop is None:
                target, value = re.fullmatch(r"(.+?) := (.+);", lines[at]).groups()  # type: ignore[union-attr]
                self._assign(target, value)
                at += 1
                continue
            end, depth = at + 1, 1
            while True:
                depth += lines[end].startswith("FOR ") - (lines[end] == "END_FOR;")
                if not depth:
                    break
                end += 1
            for index in range(int(loop[2]), int(loop[3]) + 1):
                self.indices[loop[1]] = index
                self._block(lines[at + 1 : end])
            at = end + 1

    def _assign(self, target: str, value: str) -> None:
        bit = re.fullmatch(r"\((.+) AND 16#(\w+)\) <> 0", value)
        if bit:
            ((to_name, to_leaf),), (of,) = self._leaves(target), self._leaves(bit[1])
            self._write(to_name, to_leaf, int(self._read(*of) & int(bit[2], 16) != 0))
            return
        if "(" not in value:
            for to, of in zip(self._leaves(target), self._leaves(value), strict=True):
                raw = self._read(*of)
                self._write(*to, raw)
            return
        (to,) = self._leaves(target)
        number, size = self._value(value)
        assert size == to[1][3], f"{target} has {to[1][3]} bytes, {value} has {size}"
        self._write(*to, number)

    def _leaves(self, path: str) -> list[tuple[str, tuple[str, object, int, int, int | None]]]:
        path = re.sub(r"\[([^\]]*)\]", self._index, path)
        name = path.replace("[", ".").partition(".")[0]
        below = path[len(name) :].removeprefix(".")
        leaves = [
            leaf
            for leaf in self.layouts[name].leaves()
            if re.fullmatch(re.escape(below) + r"([.\[].*)?", leaf.path)
        ]
        assert leaves, path
        return [(name, (leaf.path, leaf.type, leaf.offset, leaf.size, leaf.bit)) for leaf in leaves]

    def _index(self, found: re.Match[str]) -> str:
        return f"[{','.join(str(eval(part, {}, self.indices)) for part in found[1].split(','))}]"

    def _read(self, name: str, leaf: tuple[str, object, int, int, int | None]) -> int:
        raw = int.from_bytes(self.memory[name][leaf[2] : leaf[2] + leaf[3]], self._order)
        return raw if leaf[4] is None else raw >> leaf[4] & 1

    def _write(self, name: str, leaf: tuple[str, object, int, int, int | None], raw: int) -> None:
        place = slice(leaf[2], leaf[2] + leaf[3])
        if leaf[4] is not None:
            raw = self.memory[name][leaf[2]] & ~(1 << leaf[4]) | raw << leaf[4]
        self.memory[name][place] = raw.to_bytes(leaf[3], self._order)

    @property
    def _order(self) -> Order:
        return "little" if self.rules.byte_order == "little" else "big"

    def _value(self, text: str) -> tuple[int, int]:
        """Return the bits of an expression, and their bytes."""
        if " OR " in text and text.startswith(("BYTE_TO_", "SHL(")):
            found = [self._value(part) for part in text.split(" OR ")]
            assert sum(number for number, _ in found) < 1 << 8 * found[0][1]
            return sum(number for number, _ in found), found[0][1]
        shift = re.fullmatch(r"SHL\(IN := (.+), N := (\d+)\)", text)
        if shift:
            number, size = self._value(shift[1])
            return number << int(shift[2]), size
        call = re.fullmatch(r"(\w+)\((.+)\)", text)
        if call is None:
            (leaf,) = self._leaves(text)
            return self._read(*leaf), leaf[1][3]
        number, size = self._value(call[2])
        if call[1] == "SWAP":
            assert self.is_scl
            return int.from_bytes(number.to_bytes(size, "big"), "little"), size
        if f"FUNCTION {call[1]} :" in self.helpers:
            return self._call(call[1], number), size
        converted = re.fullmatch(r"([A-Z]+)_TO_([A-Z]+)", call[1])
        assert converted is not None, call[1]
        assert self.is_scl or "REAL" not in converted[1], "in CODESYS this rounds"
        return number, WIDTHS.get(converted[2], size)

    def _call(self, name: str, number: int) -> int:
        head = re.search(
            rf"FUNCTION {name} : (\w+)\nVAR_INPUT x : (\w+); END_VAR\n(.*?)END_FUNCTION", self.helpers, re.S
        )
        assert head is not None
        width, body = 8 * WIDTHS[head[1]], head[3]
        union = re.search(r"VAR u : (\w+); END_VAR\n", body)
        if union is None:
            expression = re.fullmatch(rf"{name} := (.*);\n", body, re.S)
            assert expression is not None
            return _bits_of(expression[1], number, width)
        declared = re.search(rf"TYPE {union[1]} :.*?END_TYPE", self.helpers, re.S)
        assert declared is not None
        layout = lay_out(types_of(declared[0]).get_type(union[1]), self.rules)
        assert body.endswith(f"u.r := x;\n{name} := u.d;\n")
        leaves = {leaf.path: leaf for leaf in layout.leaves()}
        assert leaves["r"].size == leaves["d"].size == width // 8
        return number  # both members are the same bytes


def _bits_of(expression: str, number: int, width: int) -> int:
    """Return the value of an expression of ROL, ROR, AND and OR over x."""
    python = re.sub(r"\bOR\b", "|", expression.replace("16#", "0x").replace("AND", "&")).replace("\n", " ")

    def rol(x: int, places: int) -> int:
        return (x << places | x >> width - places) & (1 << width) - 1

    def ror(x: int, places: int) -> int:
        return rol(x, width - places)

    return int(eval(python, {"ROL": rol, "ROR": ror, "x": number}))
