"""Rewrites C++ in a header as C, keeps all places, and removes what adds nothing to the size of a class.

Rule: only text that surely adds nothing is removed. The C parser refuses any other C++ at its line.
Inside a class, a type is rewritten as a member with `_Atomic`, and a constant as an enumeration.
"""

from __future__ import annotations

import re
from typing import Final

DEEPEST_CLASS: Final = 64
_NAME: Final = r"[A-Za-z_]\w*"
_QUOTED_TEXT: Final = re.compile(r'"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])*\'')
# Words that do not change a size.
_HARMLESS_WORDS: Final = re.compile(
    r"\bstd\s*::\s*(?=u?int(?:8|16|32|64)_t\b)"
    r'|\[\[\s*(?:nodiscard|maybe_unused|noreturn|deprecated)\s*(?:\("[^"\n]*"\)\s*)?\]\]'
)
_CLASS: Final = re.compile(r"(?:\benum\s+)?\b(?:struct|union)\b([^;{}()=<>,]*)\{")
_HEAD: Final = re.compile(
    rf"struct\s+{_NAME}\s*((?:\bfinal\b\s*)?(?::\s*(?:(?:public|protected|private)\s+)?({_NAME})\s*)?)\{{"
)
# `std::array<int, 3> name[2]` and `using Name = std::array<int, 3>`; nested ones, too.
_ARRAY: Final = re.compile(
    rf"(?:\busing[ \t]+({_NAME})[ \t]*=[ \t]*)?\bstd::array[ \t]*<([^;{{}}()=\n]{{1,200}}),"
    rf"([^<>,;{{}}\n]{{1,80}})>[ \t]*(?(1)|((?!operator\b){_NAME})((?:\[[^\[\]\n]+\])*))(?=\s*[;={{])"
)
_ENUM: Final = re.compile(rf"\benum\b(\s+struct\b)?(?:\s+{_NAME})?\s*(:[\w\s]+)?\{{")
_ALIAS: Final = re.compile(rf"\busing\s+({_NAME})\s*=([\w\s*]+);")
_CONSTANT: Final = re.compile(r"\bconstexpr\b(?=[\w\s]*=(?:[\w\s+\-*/()|&'\0]|<<|>>)*;)")
_CPP_ONLY: Final = re.compile(
    r"\b(?:namespace|template|virtual|using|public|private|protected|constexpr|operator|friend)\s+\w|::"
)
# In a class whose brackets and texts are masked with NULs.
_LABEL: Final = re.compile(r"(?:public|private|protected)\s*:(?!:)")
_SIZELESS_DECLARATION: Final = re.compile(
    rf"(?:friend|static_assert)\b[^;{{}}]*;|(?:struct|union)\s+{_NAME}\s*;|using\s+[\w:]+::\w+\s*;"
)
_STATIC: Final = re.compile(
    rf"(?:(?:inline|const|constexpr)\s+)*static\b(?:[\w\s*&]|::|<[^;{{}}()=]*>)*?\b({_NAME})\s*"
    r"(?:\[\0*\]\s*)*(=[^;{},]*|=?\s*\{\0*\}\s*)?;"
)
_FUNCTION: Final = re.compile(
    rf"""(?P<head>(?:[\w\s*&]|::|<[^;{{}}()=]*>){{0,300}}?)
    (?P<name>\boperator\b\s*(?:\(\0*\)|\[\0*\]|[^\s\w({{;\[]+|[\w*&\s]{{1,80}}?)|~?\b{_NAME})\s*+
    \((?P<given>\0*)\)\s*+(?P<after>(?:(?:const|noexcept|volatile)\b\s*+)*&{{0,2}})\s*+
    (?:(?P<body>(?::(?:\s*+[\w:]++\s*+(?:\(\0*\)|\{{\0*\}})\s*+,?)+\s*+)?\{{\0*\}}(?:\s*;)?)
    |=\s*+(?:default|delete)\s*+;|;)""",
    re.VERBOSE,
)
_SPECIFIERS: Final = {"static", "inline", "constexpr", "explicit", "friend", "const", "struct", "enum"}
_BUILT_IN: Final = {"void", "bool", "char", "short", "int", "long", "float", "double", "signed", "unsigned"}
_PARAMETERS: Final = re.compile(
    r"\s*\Z|.*(?:\w\s*[\s*&]\s*[A-Za-z_*&)]|\b(?:\w+_t|int|bool|float|double|char)\b)", re.DOTALL
)
_TYPE: Final = re.compile(r"(?:(?:const|volatile)\s+)*(?:struct|union|enum)\b")
_VALUE: Final = re.compile(
    r"(?<![=!<>])=(?!=)[^;,{}]*(?:\{\0*\}\s*)?(?=[;,])|(?<=[\w\]])\s*\{\0*\}(?=\s*[;,])"
)
_FITTING_VALUE: Final = re.compile(  # the type surely holds the value
    rf"(?<!short\s)\b(?:unsigned|int|size_t|u?int(?:32|64)_t)\s+{_NAME}\s*=|\A(?!.*\bbool\b).*=\s*\d{{1,2}}\s*\Z",
    re.DOTALL,
)
# Marks of C++ in a text that the C parser refused; a message names the first one.
CPP_MARKS: Final = re.compile(
    r"\b(?:virtual|template|alignas|operator|decltype|friend|using|constexpr|static)\b|\[\[|~|\w+\s*::"
    rf"|{_NAME}\s*<[^;{{}}()]*>|[\w>]\s*&&?\s*\w+\s*[;,]|(?<!:):(?!:)[^;{{}}()?]*\{{"
)


class CppSource:
    """A header whose `text` the C parser can read, perhaps C++ (`is_cpp`) with classes (`has_classes`).

    `bases` has the type of each enumeration, and whether it is scoped, by the place of its brace. `parents`
    has the base class by the brace of a class, `arrays` the places of declarators made from a `std::array`.
    If `has_types`, a member with `_Atomic` is a type, since the header itself has no `_Atomic`.
    """

    def __init__(self, text: str, has_classes: bool, is_cpp: bool) -> None:
        self.parents: dict[int, str | None] = {}
        self.arrays: set[int] = set()
        self.text, count = _HARMLESS_WORDS.sub(blank_match, text), 1
        while count:  # one pass for each level of nested arrays
            self.text, count = _ARRAY.subn(self._convert_array, self.text)
        self.bases: dict[int, tuple[str, bool]] = {}
        self._edits: dict[int, str] = {}
        self.has_types = "_Atomic" not in text
        bare = blank_quoted(self.text)
        pairs, ends = brace_pairs(bare), list[int]()
        for found in _CLASS.finditer(bare):
            end = pairs.get(found.end() - 1, 0)
            ends = [one for one in ends if one > end]
            if end and len(ends) < DEEPEST_CLASS and not found[0].startswith("enum"):
                ends.append(end)
                if head := _HEAD.fullmatch(found[0]):
                    self.parents[found.end() - 1] = head[2]
                    self._blank_range(found.start() + head.start(1), found.start() + head.end(1))
                names = re.findall(rf"(?!final\b)\b{_NAME}", found[1].split(":")[0])
                self._convert_class(_mask(bare, found.end(), end), found.end(), names[-1] if names else "")
        self.has_classes = has_classes or bool(self._edits)
        self.is_cpp = is_cpp or self.has_classes or bool(_CPP_ONLY.search(text))
        for found in _ENUM.finditer(bare):
            if found[1] or found[2]:
                self.bases[found.end() - 1] = (found[2] or ":int")[1:].strip(), bool(found[1])
                self._blank_range(*found.span(1))
                self._blank_range(*found.span(2))
        outer = _mask(bare, 0, len(bare))
        for found in _ALIAS.finditer(outer):
            self._replace_range(*found.span(), f"typedef {found[2].strip()} {found[1]};")
        for found in _CONSTANT.finditer(outer):
            self._edits[found.start()] = "const    "
        parts, at = [], 0
        for begin, new in sorted(self._edits.items()):
            parts += [self.text[at:begin], new]
            at = begin + len(new)
        self.text = "".join([*parts, self.text[at:]])

    def _convert_array(self, found: re.Match[str]) -> str:
        """Return a `std::array` as a C array, padded to the same number of characters."""
        alias, element, length, name, more = found.groups(default="")
        declared = f"{alias or name}{more}[{length.strip()}]"
        self.arrays.add(found.end() - len(declared))
        return f"{'typedef ' * bool(alias)}{element.strip()} {declared}".rjust(len(found[0]))

    def _blank_range(self, begin: int, end: int) -> None:
        if 0 <= begin < end:
            self._edits[begin] = re.sub(r"[^\n]", " ", self.text[begin:end])

    def _replace_range(self, begin: int, end: int, new: str) -> None:
        """Replace C++ by C if the C fits into the line. Else the C++ stays, and the C parser refuses it."""
        first = len(self.text[:begin].rstrip(" \t"))
        if "\n" not in self.text[begin:end] and len(new) <= end - first:
            begin = min(begin, end - len(new))
            self._edits[begin] = new.ljust(end - begin)

    def _convert_class(self, flat: str, start: int, name: str) -> None:
        at = match_end(r"\s*", flat, 0)
        while at < len(flat):
            text = flat[at : match_end(r"[^;]*;?", flat, at)]
            found = _LABEL.match(flat, at) or ("(" in text and _FUNCTION.match(flat, at)) or None
            if found and (found.re is _LABEL or self._is_function(found, start, name)):
                self._blank_range(start + at, start + found.end())
                at = found.end()
            else:
                self._convert_member(text, start + at)
                at += len(text)
            at = match_end(r"\s*", flat, at)

    def _is_function(self, found: re.Match[str], start: int, class_: str) -> bool:
        """Return whether the match is surely a function, not a member with a size or a macro."""
        name, head = found["name"], found["head"]
        words = re.findall(r"\w+", re.sub(r"<[^;]*>|\w+\s*::", " ", head))
        types = [word for word in words if word not in _SPECIFIERS]
        count = len([word for word in types if word not in _BUILT_IN]) + any(w in _BUILT_IN for w in types)
        if name == class_ or name[0] == "~":
            return not count and not re.search("[*&]", head)
        if name.startswith("operator"):
            return count <= 1
        if count != 1 or name in _BUILT_IN | _SPECIFIERS:
            return False
        given = self.text[start + found.start("given") : start + found.end("given")]
        is_plain = _PARAMETERS.match(given) and not name.isupper()
        return is_plain or bool(found["body"] or found["after"])

    def _convert_member(self, text: str, at: int) -> None:
        if re.search(r"\b(?:operator|virtual|template)\b", text):
            return
        if _SIZELESS_DECLARATION.fullmatch(text):
            self._blank_range(at, at + len(text))
        elif found := _STATIC.fullmatch(text):
            given = self.text[at : at + len(text) - 1]
            if not re.search(r"\bconst(?:expr)?\b", text):
                self._blank_range(at, at + len(text))
            else:
                is_known = (found[2] or "")[:1] == "=" and _FITTING_VALUE.search(given)
                value = given[found.start(2) + 1 :] if is_known else '""'  # known as a name, without a number
                self._replace_range(at, at + len(text), f"enum{{{found[1]}={value.strip()}}};")
        elif (alias := _ALIAS.fullmatch(text)) and self.has_types:
            self._replace_range(at, at + len(text), f"_Atomic {alias[2].strip()} {alias[1]};")
        elif re.match(r"typedef\b", text) and self.has_types:
            self._edits[at] = "_Atomic"
        else:
            for found in () if _TYPE.match(text) else _VALUE.finditer(text):
                self._blank_range(at + found.start(), at + found.end())


def blank_quoted(text: str) -> str:
    return _QUOTED_TEXT.sub(lambda found: "\0" * len(found[0]), text)


def blank_match(found: re.Match[str]) -> str:
    return re.sub(r"[^\n]", " ", found.group())


def brace_pairs(text: str) -> dict[int, int]:
    opened: list[int] = []
    pairs: dict[int, int] = {}
    for found in re.finditer("[{}]", text):
        if found.group() == "{":
            opened.append(found.start())
        elif opened:
            pairs[found.start()] = opened[-1]
            pairs[opened.pop()] = found.start()
    return pairs


def match_end(pattern: str, text: str, at: int) -> int:
    found = re.compile(pattern).match(text, at)
    return found.end() if found else at


def _mask(text: str, begin: int, end: int) -> str:
    """Return a part of a text with NULs in place of the contents of brackets."""
    parts, depth, at = list[str](), 0, begin
    for found in re.compile(r"[(\[{}\])]").finditer(text, begin, end):
        if found[0] in "([{":
            parts += [] if depth else [text[at : found.end()]]
            at, depth = (at if depth else found.end()), depth + 1
        elif depth:
            depth -= 1
            parts += [] if depth else ["\0" * (found.start() - at)]
            at = at if depth else found.start()
    return "".join([*parts, "\0" * (end - at) if depth else text[at:end]])
