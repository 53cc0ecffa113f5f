"""Prepares a C header for a C parser: comments, directives, macros and attributes, line by line.

Handles what declarations need: conditions, `#define` of numbers, words, calls, `#pragma pack`, `packed`.
Rule: lines keep their numbers. Text that changes a layout is understood or refused, never ignored.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

from trcvtui.errors import Problem, UserError, mistake
from trcvtui.udt.sources.cpp_source import CppSource, blank_match, blank_quoted, brace_pairs

PRAGMA_PACKS = {"0": None, "1": 1, "2": 2, "4": 4, "8": 8, "16": 8}  # no type has an alignment above 8
LONGEST_MACRO_TEXT = 200
MOST_CALLS = 256  # of macros in a line, those from other macros included
MOST_CALLS_IN_ALL = 50_000  # in a header: nested macros grow exponentially
MOST_NESTED = 64
# A macro that contains one of these is not a number.
_KEYWORD_TEXT = """
struct union enum typedef const volatile static extern inline restrict void char short int long float double
signed unsigned _Bool bool return if else for while do switch case break goto sizeof __attribute__ __packed
__declspec __pragma _Alignas
"""
KEYWORDS = frozenset(_KEYWORD_TEXT.split())
# Only these attributes never change a layout and may be left out.
HARMLESS = frozenset({"unused", "used", "deprecated", "may_alias", "gcc_struct", "ms_struct", "nonstring"})

# As gcc on x86-64 defines them: Linux headers choose the order of bit-fields by these.
_LE_MACROS = ["__BYTE_ORDER", "__LITTLE_ENDIAN", "__BYTE_ORDER__", "__ORDER_LITTLE_ENDIAN__"]
_GCC_MACROS = {"__GNUC__": "4", "__LITTLE_ENDIAN_BITFIELD": "1", **dict.fromkeys(_LE_MACROS, "1234")}

_SKIP = re.compile(r"""//[^\n]*|/\*.*?(?:\*/|\Z)|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'""", re.DOTALL)
_DIRECTIVE = re.compile(r"[ \t]*#[ \t]*(\w*)[ \t]*(.*)", re.DOTALL)
_MACRO = re.compile(r"([A-Za-z_]\w*)(\([^()]*\)?)?[ \t]*(.*)", re.DOTALL)
_NAMESPACE_START = re.compile(r'\b(?:namespace\b[\w\s:]{0,200}|extern\s*"C"\s*)\{')  # its content is read
_CLASS = re.compile(r"\bclass\b(?=\s+\w+(?:\s+\w+)*\s*(?::(?!:)|[{;]))")
_CALL = re.compile(r"\b([A-Za-z_]\w*)[ \t]*\(")
_PRAGMA_OPERATOR = re.compile(r'_Pragma\s*\(\s*"([^"]*)"\s*\)|__pragma\s*\(((?:[^()]|\([^()]*\))*)\)')
_WORD = re.compile(r"[A-Za-z_]\w*")
_NUMERIC = re.compile(r"[\w\s()+\-*/%<>&|~^!=']+")
_PACK = re.compile(r"pack\s*\(([^()]*)\)")
_ATTRIBUTE = re.compile(r"__attribute__\s*\(\((?P<list>[^()]*(?:\([^()]*\)[^()]*)*)\)\)|__packed\b")
# gcc ignores an attribute in front of `struct`.
_NAME_HEAD = re.compile(r"\s*(?:(?!struct\b|union\b)[A-Za-z_]\w*\s*)?\{")
_STRUCT_HEAD = re.compile(r"\s*(?:(?:typedef|struct|union|const|volatile)\b\s*)*(?:[A-Za-z_]\w*\s*)?\{")


# What a header does not contain itself: the bytes of `long`, and the text of the headers given with it.
LONG_SIZE: ContextVar[int | None] = ContextVar("LONG_SIZE", default=None)
OTHER_HEADERS = ContextVar("OTHER_HEADERS", default="")


class CSource:
    """A header: its prepared text, its macros, and its problems.

    `evaluate` returns the value of a condition or a macro, or None if there is no value.
    """

    def __init__(
        self, text: str, name: str, evaluate: Callable[[str, CSource], int | None], others: str = ""
    ) -> None:
        self.name, self.evaluate = name, evaluate
        self.problems: list[Problem] = []
        self.moved: list[tuple[int, Problem]] = []
        self.starts = [0]
        self.numbers = dict(_GCC_MACROS)
        is_cpp = name.lower().endswith(".hpp")
        self.numbers |= {"__cplusplus": "201703"} if is_cpp else {}
        self.words: dict[str, str] = {}
        self.calls: dict[str, tuple[list[str], str]] = {}
        self._macros: tuple[dict[str, Any], ...] = self.numbers, self.words, self.calls
        if others:
            own = set(re.findall(r"#\s*define\s+(\w+)", text))
            for number, known in enumerate(CSource(others, name, evaluate)._macros):
                self._macros[number].update({one: known[one] for one in known.keys() - own})
        self.given = frozenset(self.numbers)
        self.includes: list[str] = []
        self.packs: list[tuple[int, int | None]] = [(0, None)]
        self.braces: set[int] = set()  # of the structures that an attribute packs
        self._stack: list[tuple[str, int | None]] = []  # name, and the packing to restore
        self._conditions: list[tuple[bool, bool]] = []  # (this branch is active, one of them was)
        self._depth = 0
        self._calls_left = MOST_CALLS_IN_ALL
        without_comments = self._blank_comments(text)
        ready = "\n".join(self._process_lines(_NAMESPACE_START.sub(blank_match, without_comments)))
        ready, count = _CLASS.subn("struct", ready)
        self.starts = [0, *(end.end() for end in re.finditer("\n", ready))]
        self.cpp = CppSource(self._blank_attributes(ready), bool(count), is_cpp)
        self.text = self.cpp.text

    def line_and_column(self, offset: int) -> tuple[int, int]:
        """Return line and column of a place in the prepared text, both from 1."""
        line = bisect_right(self.starts, offset)
        return line, offset - self.starts[line - 1] + 1

    def where(self, offset: int) -> str:
        line, column = self.line_and_column(offset)
        return f"{self.name}:{line}:{column}"

    def offset(self, line: int, column: int) -> int:
        """Return the place of a line and column, at most the end of the text."""
        return min(self.starts[min(max(line, 1), len(self.starts)) - 1] + max(column, 1) - 1, len(self.text))

    def packing_of(self, brace: int) -> int | None:
        """Return the packing of the STRUCT that a brace opens."""
        return 1 if brace in self.braces else self.pragma_packing(brace)

    def pragma_packing(self, offset: int) -> int | None:
        line = bisect_right(self.starts, offset)
        return self.packs[bisect_right(self.packs, line, key=lambda row: row[0]) - 1][1]

    def raise_move_problems(self, begin: int, end: int) -> None:
        """Raise UserError if something between two places moves members in an unknown way."""
        first, last = self.line_and_column(begin)[0], self.line_and_column(end)[0]
        moved = [problem for line, problem in self.moved if first <= line <= last]
        if moved:
            raise UserError(moved)

    def add_problem(self, line: int, found: str, expected: str) -> None:
        self.problems.append(Problem(f"{self.name}:{line}", found, expected))

    def _add_move_problem(self, line: int, found: str, expected: str) -> None:
        self.moved.append((line, Problem(f"{self.name}:{line}", found, expected)))

    # -- comments and lines ------------------------------------------------------------------------------

    def _blank_comments(self, text: str) -> str:
        text = text.replace("\r\n", "\n").replace("\r", "\n").replace("\f", " ").replace("\v", " ")

        def blank_unless_quoted(found: re.Match[str]) -> str:
            if found[0][0] in "\"'":
                return found[0]
            if found[0].startswith("/*") and (not found[0].endswith("*/") or len(found[0]) < 4):
                self.add_problem(text.count("\n", 0, found.start()) + 1, "'/*' without an end", "'*/'")
            return blank_match(found)

        return _SKIP.sub(blank_unless_quoted, text)

    def _process_lines(self, text: str) -> list[str]:
        ready: list[str] = []
        lines = text.split("\n")
        at = 0
        while at < len(lines):
            first, line = at + 1, lines[at]
            while line.endswith("\\") and at + 1 < len(lines):
                at += 1
                line = line[:-1] + " " + lines[at]
            at += 1
            directive = _DIRECTIVE.fullmatch(line)
            if directive:
                self._handle_directive(directive.group(1), directive.group(2).strip(), first)
            if directive or not self._is_branch_active():
                line = ""
            opened = self._count_open_brackets(line)
            while opened > 0 and at < len(lines):
                line += "\n" + lines[at]
                opened += lines[at].count("(") - lines[at].count(")")
                at += 1
            line = self._expand_macros(line)
            pragma = _PRAGMA_OPERATOR.fullmatch(line.strip(" \t;"))
            if pragma:
                self._handle_directive("pragma", (pragma[1] or pragma[2]).strip(), first)
                line = ""
            # The parser would ignore a pragma in a line with a declaration: it is made a syntax error.
            line = re.sub(r"#(?=\s*pragma)", "@", line.replace("_Pragma", "_Pragma_beside_a_declaration"))
            ready.append(line)
            ready.extend([""] * (at - first - line.count("\n")))
            bare = blank_quoted(line)
            self._depth = max(0, self._depth + bare.count("{") - bare.count("}"))
        if self._conditions:
            self.add_problem(len(lines), "the end of the file", "#endif")
        return ready

    def _is_branch_active(self) -> bool:
        return all(counts for counts, _ in self._conditions)

    def _expand_macros(self, line: str) -> str:
        if self.words:
            line = _WORD.sub(lambda found: self.words.get(found.group(), found.group()), line)
        at, most = 0, 2 * len(line) + MOST_CALLS * LONGEST_MACRO_TEXT
        for _ in range(min(MOST_CALLS, self._calls_left) if self.calls else 0):
            found = self._find_macro_call(line, at)
            if found is None or len(line) > most:
                break
            self._calls_left -= 1
            at = found.start()
            names, body = self.calls[found[1]]
            given, end = _split_arguments(line, found.end())
            if len(given) != len(names):
                break  # the parser refuses the call
            values = dict(zip(names, given, strict=True))
            text = _WORD.sub(lambda word, known=values: known.get(word[0], word[0]), body)  # type: ignore[misc]
            count = line.count("\n", at, end)  # lines keep their numbers
            text = text if text.count("\n") <= count else text.replace("\n", " ")
            line = line[:at] + text + "\n" * (count - text.count("\n")) + line[end:]
        return line

    def _find_macro_call(self, line: str, at: int = 0) -> re.Match[str] | None:
        return next((found for found in _CALL.finditer(line, at) if found[1] in self.calls), None)

    def _count_open_brackets(self, line: str) -> int:
        """Return how many brackets a call of a macro leaves open for the next line."""
        found = self._find_macro_call(line) if self.calls else None
        return 0 if found is None else line.count("(", found.start()) - line.count(")", found.start())

    # -- directives --------------------------------------------------------------------------------------

    def _handle_directive(self, kind: str, rest: str, line: int) -> None:
        if kind in ("if", "ifdef", "ifndef", "elif", "else", "endif"):
            self._handle_condition(kind, rest, line)
        elif not self._is_branch_active():
            return
        elif kind == "define":
            self._define(rest)
        elif kind == "undef":
            self._undefine(rest)
        elif kind == "include":
            self.includes.append(rest.strip('<>" \t'))
        elif kind == "pragma" and re.match(r"pack\b|options\s+align", rest):
            self._handle_pragma_pack(rest, line)
        elif kind == "error":
            self.add_problem(line, f"'#error {rest[:60]}'", "conditions that exclude it")

    def _handle_condition(self, kind: str, rest: str, line: int) -> None:
        outer = all(counts for counts, _ in self._conditions[:-1])
        if kind in ("if", "ifdef", "ifndef"):
            if len(self._conditions) >= MOST_NESTED:
                expected = f"at most {MOST_NESTED} levels"
                raise mistake(f"{self.name}:{line}", f"#{kind} nested deeper", expected)
            holds = self._is_branch_active() and self._evaluate_condition(kind, rest, line)
            self._conditions.append((holds, holds))
        elif not self._conditions:
            self.add_problem(line, f"#{kind}", "#if before it")
        elif kind == "endif":
            self._conditions.pop()
        else:
            done = self._conditions[-1][1]
            holds = outer and not done and (kind == "else" or self._evaluate_condition(kind, rest, line))
            self._conditions[-1] = (holds, done or holds)

    def _evaluate_condition(self, kind: str, rest: str, line: int) -> bool:
        """Return whether a condition is true; an undefined name is 0, as in C."""
        if kind in ("ifdef", "ifndef"):
            return self._is_defined(rest) == (kind == "ifdef")
        text = re.sub(
            r"\bdefined\b\s*(?:\(\s*(\w+)\s*\)|(\w+))",
            lambda found: str(int(self._is_defined(found.group(1) or found.group(2)))),
            rest,
        )
        text = self._expand_macros(text)
        text = _WORD.sub(lambda found: found.group() if found.group() in self.numbers else "0", text)
        value = self.evaluate(text, self)
        if value is None:
            self.add_problem(line, f"'#{kind} {rest[:60]}'", "a condition of numbers and defined names")
        return bool(value)

    def _is_defined(self, name: str) -> bool:
        return any(name in table for table in self._macros)

    def _undefine(self, name: str) -> None:
        for table in self._macros:
            table.pop(name, None)

    def _define(self, rest: str) -> None:
        macro = _MACRO.fullmatch(rest)
        if macro is None:
            return
        name, names, body = macro.group(1), macro.group(2), macro.group(3).strip()
        self._undefine(name)
        if names:
            if "#" not in body and "..." not in names:  # else the parser refuses its use
                self.calls[name] = [one.strip() for one in names[1:-1].split(",")], self._expand_macros(body)
            return
        words = _WORD.findall(body)
        if body and _NUMERIC.fullmatch(body) and not any(w in KEYWORDS or w in self.words for w in words):
            self.numbers[name] = body
        else:
            body = self._expand_macros(body)
            self.words[name] = body if len(body) <= LONGEST_MACRO_TEXT else name

    def _handle_pragma_pack(self, rest: str, line: int) -> None:
        """Set the packing as gcc does; a pragma that gcc ignores with a warning is a problem here."""
        text = _WORD.sub(lambda word: self.numbers.get(word[0], word[0]), self._expand_macros(rest))
        found = _PACK.match(text)
        action, *more = [word.strip() for word in found[1].split(",")] if found else ["?"]
        if action not in ("push", "pop", "show"):
            action, more = "set", [action, *more] if action or more else []
        names = [word for word in more if _WORD.fullmatch(word) and action != "set"]
        numbers = [PRAGMA_PACKS.get(word, -1) for word in more if word[:1].isdigit() and action != "pop"]
        if self._depth > 0:
            self._add_move_problem(line, f"'#pragma {rest[:60]}' inside a structure", "it outside")
        now = self.packs[-1][1]
        if len(names) > 1 or len(numbers) > 1 or len(more) > len(names) + len(numbers) or -1 in numbers:
            self.add_problem(
                line, f"'#pragma {rest[:60]}'", "#pragma pack(push, 1), pack(pop), pack(1) or pack()"
            )
        elif action == "pop" and not self._stack:
            self.add_problem(line, "'#pragma pack(pop)'", "#pragma pack(push) before it")
        elif action == "pop":
            at = next((at for at, (name, _) in enumerate(self._stack[::-1]) if [name] == names), 0)
            self.packs.append((line, self._stack[-1 - at][1]))
            del self._stack[-1 - at :]
        elif action != "show":
            if action == "push":
                self._stack.append(("".join(names), now))
            self.packs.append((line, numbers[0] if numbers else now if action == "push" else None))

    # -- attributes --------------------------------------------------------------------------------------

    def _blank_attributes(self, text: str) -> str:
        pairs = brace_pairs(text)

        def blank_attribute(found: re.Match[str]) -> str:
            listed = found.group("list")
            names = {"packed"} if listed is None else {n.strip().strip("_") for n in listed.split(",")} - {""}
            brace = _find_packed_brace(text, found.start(), found.end(), pairs) if "packed" in names else None
            if brace is not None:
                self.braces.add(brace)
                names.discard("packed")
            if names - HARMLESS:
                line, _ = self.line_and_column(found.start())
                shown = " ".join(found.group().split())[:60]
                self._add_move_problem(line, f"'{shown}'", "only the attribute packed, on a struct or union")
            return blank_match(found)

        return _ATTRIBUTE.sub(blank_attribute, text)


def _split_arguments(text: str, begin: int) -> tuple[list[str], int]:
    """Return the arguments of a call, and where the call ends. A call without an end has no arguments."""
    found: list[str] = []
    depth = 0
    for one in re.compile("[(),]").finditer(text, begin):
        if depth == 0 and one[0] != "(":
            found.append(text[begin : one.start()])
            begin = one.end()
            if one[0] == ")":
                return found, begin
        depth += {"(": 1, ")": -1, ",": 0}[one[0]]
    return [], len(text)


def _find_packed_brace(text: str, begin: int, end: int, pairs: dict[int, int]) -> int | None:
    if text[max(0, begin - 400) : begin].rstrip().endswith("}"):
        return pairs.get(text.rindex("}", 0, begin))
    ahead = (_NAME_HEAD if text.startswith("__attribute", begin) else _STRUCT_HEAD).match(text, end)
    return ahead.end() - 1 if ahead else None
