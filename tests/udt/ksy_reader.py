"""The part of YAML and of Kaitai Struct that the export writes, read and carried out: an oracle of its own.

Rule: it knows nothing of layouts; what it finds in the bytes comes from the `.ksy` text alone.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import Any

NUMBER = re.compile(r"([us])([1248])|(f)([48])")
CODES = {"u1": "B", "u2": "H", "u4": "I", "u8": "Q", "s1": "b", "s2": "h", "s4": "i", "s8": "q"}
CODES |= {"f4": "f", "f8": "d"}


def read_yaml(text: str) -> Any:
    """Return maps and lists by indentation; scalars are text."""
    lines = [line.split("  #")[0].rstrip() for line in text.splitlines() if line.strip()]
    value, rest = _block(lines, 0)
    assert not rest
    return value


def _depth(line: str) -> int:
    return len(line) - len(line.lstrip(" "))


def _block(lines: list[str], depth: int) -> tuple[Any, list[str]]:
    if lines and lines[0].lstrip().startswith("- "):
        items = []
        while lines and _depth(lines[0]) == depth and lines[0].lstrip().startswith("- "):
            lines = [lines[0].replace("- ", "  ", 1), *lines[1:]]
            item, lines = _block(lines, depth + 2)
            items.append(item)
        return items, lines
    found: dict[str, Any] = {}
    while lines and _depth(lines[0]) == depth and not lines[0].lstrip().startswith("- "):
        key, _, value = lines[0].strip().partition(":")
        lines = lines[1:]
        if value:
            found[key] = value.strip().strip("\"'")
        elif lines and _depth(lines[0]) > depth:
            found[key], lines = _block(lines, _depth(lines[0]))
        else:
            found[key] = {}
    return found, lines


class Parsed:
    """A `.ksy` carried out: `values` yields what it finds, innermost values in order."""

    def __init__(self, text: str) -> None:
        self.file = read_yaml(text)
        self.order = "<" if self.file["meta"]["endian"] == "le" else ">"

    def values(self, data: bytes) -> list[object]:
        """Return every value of the top type."""
        return list(self._type(self.file, data, {}))

    def _type(self, type_: dict[str, Any], data: bytes, params: dict[str, int]) -> Iterator[object]:
        for instance in type_.get("instances", {}).values():
            yield from self._attribute(instance, data, 0, params)[0]
        at, bit, seen = 0, 0, dict(params)
        for attribute in type_.get("seq", []):
            if attribute.get("type") == "b1":
                count = int(attribute.get("repeat-expr", 1))
                for place in range(
                    8 * at - (8 - bit if bit else 0), 8 * at - (8 - bit if bit else 0) + count
                ):
                    yield bool(data[place // 8] >> place % 8 & 1)
                place += 1
                at, bit = -(-place // 8), place % 8
                continue
            bit = 0
            found, at = self._attribute(attribute, data, at, seen)
            if attribute.get("id") in ("longest", "actual") and "capacity" in params:
                seen[attribute["id"]] = found[0]
            elif "id" in attribute:
                yield from found
        assert at <= len(data)

    def _attribute(
        self, attribute: dict[str, Any], data: bytes, at: int, seen: dict[str, int]
    ) -> tuple[list[Any], int]:
        found: list[Any] = []
        for _ in range(int(attribute.get("repeat-expr", 1))):
            values, at = self._one(attribute, data, at, seen)
            found += values
        return found, at

    def _one(
        self, attribute: dict[str, Any], data: bytes, at: int, seen: dict[str, int]
    ) -> tuple[list[Any], int]:
        name = attribute.get("type", "")
        if name in CODES:
            code = struct.Struct(self.order + CODES[name])
            (value,) = code.unpack_from(data, at)
            if "enum" in attribute:
                assert attribute["enum"] in self.file["enums"]
            return [value], at + code.size
        if name == "b1":
            return [bool(data[at] & 1)], at + 1
        size = self._size(attribute["size"], seen)
        part, at = data[at : at + size], at + size
        assert len(part) == size
        if name in ("", "str", "strz"):
            return [self._text(name, attribute, part)], at
        word, _, argument = name.partition("(")
        params = {"capacity": int(argument[:-1])} if argument else {}
        return list(self._type(self.file["types"][word], part, params)), at

    @staticmethod
    def _size(text: str, seen: dict[str, int]) -> int:
        if text.isdecimal():
            return int(text)
        assert text.startswith("(actual < capacity ? actual : capacity)")
        return min(seen["actual"], seen["capacity"]) * (2 if text.endswith("* 2") else 1)

    @staticmethod
    def _text(name: str, attribute: dict[str, Any], part: bytes) -> object:
        if not name:
            return part
        text = part.decode(attribute["encoding"])
        return text.partition("\0")[0] if name == "strz" else text
