"""Cuts a bench command into words, and reads them: pins, times, members, bytes (hex, text, udt ..).

Rule: quotes and braces keep a word together. A `#` after a blank begins a comment, but not in T#1s.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from copy import copy
from pathlib import Path
from typing import Final

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.blocks.pins import Pin, PinValue
from trcvtui.errors import UserError, mistake
from trcvtui.files import EXPECTED_READABLE, read_bounded, reason_of
from trcvtui.project.keys import pin_kind
from trcvtui.project.project import Project
from trcvtui.project.tables import DELAY, TRUTH_WORDS, Kind, T, expected_name, integer, quote, with_article
from trcvtui.udt.byte_text import parse_hex
from trcvtui.udt.layout.layout import Layout, Leaf, lay_out
from trcvtui.udt.layout.values import encode, encode_leaf
from trcvtui.udt.literals import NAME_PATTERN
from trcvtui.udt.sources import parse_type

# `name`, `st.arr[2].x`, `[1,2].y`, each with `=` after it.
_STEPS_PATTERN: Final = rf"(?:\.{NAME_PATTERN}|\[[^\]]*\])*"
_PATH_PATTERN: Final = re.compile(rf"\s*((?:{NAME_PATTERN}|\[[^\]]*\]){_STEPS_PATTERN})\s*=\s*")
_STRUCT_PATTERN: Final = re.compile(r"(.*?\bEND_STRUCT)\s*;?\s*(\{.*)", re.IGNORECASE | re.DOTALL)
INLINE_STRUCT_FORM: Final = "STRUCT a : INT; END_STRUCT {a=1}"
_EMPTY_BRACES: Final = re.compile(r"\{\s*\}")
_PLAIN_VALUE: Final = re.compile(r"[^,{}'\"]*")
_VALUE_END: Final = re.compile(r"\s*([,}])")
_QUOTED_TEXT: Final = re.compile(r"""'((?:[^$']|\$.)*)'|"((?:[^\\"]|\\.)*)\"""", re.DOTALL)
_IEC_ESCAPE: Final = re.compile(r"\$([0-9A-Fa-f]{2}|.)", re.DOTALL)
_C_ESCAPE: Final = re.compile(r"\\(x[0-9A-Fa-f]{2}|.)", re.DOTALL)
_NAMED_ESCAPES: Final = {"r": "\r", "n": "\n", "l": "\n", "t": "\t", "p": "\f"}
VALUES_FORM: Final = "members such as {speed=1.5, name='x', arr[0]=3}"


def unquote(text: str) -> str:
    r"""Return the text inside IEC quotes ('$N' escapes) or double quotes ("\n" escapes), else the text."""
    found = _QUOTED_TEXT.fullmatch(text)
    if found is None:
        return text
    if found[1] is not None:
        return _IEC_ESCAPE.sub(lambda e: _unescape(e[1], e[1]), found[1])
    return _C_ESCAPE.sub(lambda e: _unescape(e[1], e[1][1:]), found[2])


def _unescape(letter: str, digits: str) -> str:
    if len(digits) == 2:
        return chr(int(digits, 16))
    return _NAMED_ESCAPES.get(letter.lower(), letter)


def struct_bytes(layout: Layout, braces: str, where: str) -> bytes:
    """Return the bytes of `{speed=1.5, st={x=1}}`, or raise UserError. Members without a value are 0."""
    values = dict(parse_members(braces, where))
    with prefix_problems(where):
        return encode(layout, values)


def parse_members(braces: str, where: str) -> list[tuple[str, str]]:
    """Return path and unquoted text of each member of `{speed=1.5, st={x=1}}`, or raise UserError."""
    members, end = _read_braces(braces, 0, where)
    if end != len(braces):
        raise mistake(where, quote(braces[end:]), VALUES_FORM)
    return members


def _read_braces(text: str, at: int, where: str) -> tuple[list[tuple[str, str]], int]:
    if text[at : at + 1] != "{":
        raise mistake(where, quote(text[at:]), VALUES_FORM)
    empty = _EMPTY_BRACES.match(text, at)
    if empty is not None:
        return [], empty.end()
    members: list[tuple[str, str]] = []
    while True:
        path = _PATH_PATTERN.match(text, at + 1)  # after { or ,
        if path is None:
            raise mistake(where, quote(text[at:]), VALUES_FORM)
        inner, at = _read_value(text, path.end(), where)
        members += [(_join_path(path[1], name), value) for name, value in inner]
        end = _VALUE_END.match(text, at)
        if end is None:
            raise mistake(where, quote(text[at:]), "a comma or } after a value")
        if end[1] == "}":
            return members, end.end()
        at = end.end() - 1


def _read_value(text: str, at: int, where: str) -> tuple[list[tuple[str, str]], int]:
    if text[at : at + 1] == "{":
        return _read_braces(text, at, where)
    found = _QUOTED_TEXT.match(text, at) or _PLAIN_VALUE.match(text, at)
    assert found is not None
    return [("", unquote(found[0].strip()))], found.end()


def _join_path(path: str, name: str) -> str:
    return path + name if not name or name.startswith("[") else f"{path}.{name}"


def leaf_bytes(layout: Layout, leaf: Leaf, text: str, where: str) -> bytes:
    """Return the bytes of one value, such as 12.5, TRUE, T#5s or 'abc'."""
    with prefix_problems(where):
        return encode_leaf(layout, leaf, unquote(text))


@contextmanager
def prefix_problems(where: str) -> Iterator[None]:
    """Put `where` before the place of each mistake that the `with` block raises."""
    try:
        yield
    except UserError as refused:
        raise UserError(
            replace(problem, where=f"{where}: {problem.where}") for problem in refused.problems
        ) from None


MOST_BYTES: Final = 16 * 1024 * 1024
KEPT_BYTES: Final = 65536  # a peer keeps so many received bytes: one job of the largest LEN
TEXT_ESCAPES: Final = {"r": b"\r", "n": b"\n", "t": b"\t", "0": b"\0", "\\": b"\\", '"': b'"', "'": b"'"}
_TEXT_PIECE: Final = re.compile(r"\\(?:x([0-9A-Fa-f]{2})|(.?))|([^\\]+)", re.DOTALL)


def text_bytes(text: str, where: str = "text") -> bytes:
    r"""Return the bytes of a text: UTF-8, with the escapes \r \n \t \0 \\ \" \' and \xNN."""
    parts = []
    for piece in _TEXT_PIECE.finditer(text):
        hexadecimal, letter, plain = piece.groups()
        if plain is not None:
            parts.append(plain.encode("utf-8", "surrogatepass"))
        elif hexadecimal is not None:
            parts.append(bytes.fromhex(hexadecimal))
        elif letter in TEXT_ESCAPES:
            parts.append(TEXT_ESCAPES[letter])
        else:
            raise mistake(where, f"'\\{letter}'", r"an escape: \r \n \t \0 \\ \" or \xNN")
    return b"".join(parts)


def random_bytes(count: int, seed: int) -> bytes:
    """Return `count` bytes that depend on the seed alone."""
    return random.Random(seed).randbytes(count)


def file_bytes(path: Path, where: str) -> bytes:
    """Return the bytes of a file. Raise UserError if the file is unreadable, empty, or above 16 MiB."""
    try:
        content = read_bounded(path, MOST_BYTES)
    except (OSError, ValueError) as failed:
        raise mistake(where, f"{reason_of(failed)}: '{path}'", EXPECTED_READABLE, "file") from None
    if len(content) > MOST_BYTES:
        raise mistake(where, f"'{path}', which is too large", f"at most {MOST_BYTES} bytes")
    if not content:
        raise mistake(where, f"'{path}', which is empty", "at least one byte")
    return content


def chunks(payload: bytes, split: Iterable[int]) -> tuple[memoryview, ...]:
    """Cut the payload into pieces of the sizes in `split`, and a piece of the rest. No piece is empty."""
    view = memoryview(payload)
    pieces, start = [], 0
    for size in split:
        pieces.append(view[start : start + size])
        start += size
    pieces.append(view[start:])
    return tuple(piece for piece in pieces if len(piece))


_HEX_WORD: Final = re.compile(r"(?:(?:W#|WORD#)?16#|0x)?([0-9A-F]{1,4})", re.IGNORECASE)


def parse_pin_value(pin: Pin, text: str, where: str) -> PinValue:
    """Return the value of a pin: 0 1 TRUE FALSE, a number, or a STATUS word in hex."""
    if pin.is_bool:
        truth = TRUTH_WORDS.get(text.upper())
        if truth is None:
            raise mistake(where, f"{pin.name}={quote(text)}", f"{pin.name}=0 or {pin.name}=1")
        return truth
    if pin.iec_type == "WORD":
        found = _HEX_WORD.fullmatch(text)
        if found is None:
            raise mistake(where, f"{pin.name}={quote(text)}", "four hex digits such as 7006")
        return int(found[1], 16)
    number: int = parse_value(pin_kind(pin), text, f"{pin.name}=", where)
    return number


def parse_value(kind: Kind[T], text: str, before: str, where: str) -> T:
    """Return a text as a value of `kind`. `before` comes before the value in the line, such as `gap=`."""
    found = kind.from_text(text)
    if found is None:
        raise mistake(where, f"{before}{quote(text)}", kind.expected_for(text))
    return found


def parse_delay(text: str, before: str, where: str) -> int:
    """Return the ns of a duration, such as T#20ms, that must not be negative."""
    return parse_value(DELAY, text, before, where)


CLOSING_MARKS: Final = {'"': '"', "'": "'", "{": "}"}
QUOTE_ESCAPES: Final = {'"': "\\", "'": "$"}
MOST_NESTED: Final = 32  # bounds the recursion of `_find_closing`


class Token(Struct, frozen=True):
    text: str
    start: int
    end: int


def split_tokens(line: str, where: str) -> list[Token]:
    """Return the words of a line; raise UserError for a quote or brace without its end."""
    found: list[Token] = []
    at = 0
    while at < len(line):
        if line[at].isspace():
            at += 1
        elif line[at] == "#":
            break
        else:
            end = _word_end(line, at, where)
            found.append(Token(line[at:end], at, end))
            at = end
    return found


def _word_end(line: str, at: int, where: str) -> int:
    while at < len(line) and not line[at].isspace():
        at = _find_closing(line, at, where) if line[at] in CLOSING_MARKS else at + 1
    return at


def _find_closing(line: str, start: int, where: str, depth: int = 1) -> int:
    opening, at = line[start], start + 1
    if depth > MOST_NESTED:
        raise mistake(where, "braces nested too deeply", f"at most {MOST_NESTED} levels")
    while at < len(line):
        if line[at] == CLOSING_MARKS[opening]:
            return at + 1
        if opening == "{" and line[at] in CLOSING_MARKS:
            at = _find_closing(line, at, where, depth + 1)
        else:
            at += 2 if line[at] == QUOTE_ESCAPES.get(opening) else 1  # an escaped quote closes nothing
    raise mistake(where, quote(line[start:]), f"a closing {CLOSING_MARKS[opening]}")


class Words:
    """The words of one command, read from left to right."""

    def __init__(self, line: str, where: str) -> None:
        self.where = where
        self._line = line
        self._tokens = split_tokens(line, where)
        self.place = 0  # how many words have been taken

    def __bool__(self) -> bool:
        return self.place < len(self._tokens)

    def next(self, expected: str) -> str:
        """Take the next word; raise UserError if there is none."""
        if not self:
            raise self.error("no further word", expected, "missing")
        self.place += 1
        return self._tokens[self.place - 1].text

    def peek(self, ahead: int = 0) -> str:
        """Return a later word without taking it, "" if there is none."""
        at = self.place + ahead
        return self._tokens[at].text if at < len(self._tokens) else ""

    def remaining_words(self) -> list[str]:
        """Return the remaining words without taking them."""
        return [token.text for token in self._tokens[self.place :]]

    @property
    def verb(self) -> str:
        return self._tokens[0].text if self._tokens else ""

    def take_rest(self) -> list[str]:
        rest = self.remaining_words()
        self.place = len(self._tokens)
        return rest

    def take_rest_text(self, expected: str) -> str:
        """Take the rest as it is written; raise UserError if there is nothing."""
        start = self.place
        self.next(expected)
        self.take_rest()
        return self.text_since(start)

    def remaining_text(self) -> str:
        """Return the rest as it is written, without taking it."""
        rest = self._tokens[self.place :]
        return self._line[rest[0].start : rest[-1].end] if rest else ""

    def text_since(self, start: int) -> str:
        """Return the taken words from number `start` on, as they are written."""
        return self._line[self._tokens[start].start : self._tokens[self.place - 1].end]

    def cut_tail_words(self, begins: Callable[[str], bool]) -> list[str]:
        """Cut off and return the remaining words from the first word for which `begins` is true."""
        return self.cut_tail(begins).remaining_words()

    def cut_tail(self, begins: Callable[[str], bool]) -> Words:
        """Cut off the remaining words from the first for which `begins` is true. Return the cut words."""
        after = range(self.place, len(self._tokens))
        number = next((n for n in after if begins(self._tokens[n].text)), len(self._tokens))
        tail = copy(self)
        tail.place = number
        self._tokens = self._tokens[:number]
        return tail

    def expect_end(self) -> None:
        """Raise UserError if words remain."""
        if self:
            raise self.error(quote(self.peek()), "the end of the command", "surplus")

    def error(self, found: str, expected: str, kind: str = "value") -> UserError:
        return mistake(self.where, found, expected, kind)

    def next_known(self, known: Collection[str], what: str, expected: str = "") -> str:
        """Take the next word; raise UserError if it is none of the known ones."""
        word = self.next(expected or f"the name of {with_article(what)}")
        if word not in known:
            raise self.make_unknown_error(word, known, what)
        return word

    def next_choice(self, *known: str) -> str:
        """Take the next word; raise UserError if it is none of these few."""
        word = self.next(" or ".join(known))
        if word not in known:
            raise self.error(quote(word), " or ".join(known))
        return word

    def make_unknown_error(self, name: str, known: Iterable[str], what: str) -> UserError:
        """Return the error for an unknown name. `what` is the kind of the known names."""
        return self.error(quote(name), expected_name(name, known, what), "unknown")


SEED_KIND: Final = integer(0, (1 << 63) - 1)
RANDOM_COUNT_KIND: Final = integer(1, MOST_BYTES)


class Payload(Struct, frozen=True):
    """Bytes, and how the command wrote them."""

    content: bytes
    text: str


def parse_payload(words: Words, project: Project) -> Payload:
    """Return the payload of all remaining words; raise UserError."""
    start = words.place
    form = words.next("one of hex, text, udt, file, random")
    if form not in FORMS:
        raise words.make_unknown_error(form, FORMS, "form of payload")
    content = FORMS[form](words, project)
    return Payload(content, words.text_since(start))


def _read_hex(words: Words, project: Project) -> bytes:
    expected = "hex bytes such as 01 02 0A"
    content = parse_hex(words.take_rest_text(expected), f"{words.where}: hex")
    if not content:
        raise words.error("no bytes", expected)
    return content


def read_quoted_text(words: Words) -> str:
    """Return the text of the last word without its double quotes. Raise UserError if it has no quotes."""
    written = words.next('a text such as "abc"')
    words.expect_end()
    if len(written) < 2 or written[0] != '"' or written[-1] != '"':
        raise words.error(quote(written), 'a text in double quotes such as "abc"')
    return written[1:-1]


def _read_text(words: Words, project: Project) -> bytes:
    content = text_bytes(read_quoted_text(words), f"{words.where}: text")
    if not content:
        raise words.error('""', "at least one character")
    return content


def _read_udt(words: Words, project: Project) -> bytes:
    if words.peek().upper() == "STRUCT":
        text = words.take_rest_text(INLINE_STRUCT_FORM)
        if (found := _STRUCT_PATTERN.fullmatch(text)) is None:
            raise words.error(quote(text), INLINE_STRUCT_FORM)
        name, rules, braces = "STRUCT", project.layout, found[2]
        type_ = parse_type(found[1], project.types, words.where)
    else:
        name = words.next("the name of a UDT")
        if name.casefold() not in project.types.types:
            raise words.make_unknown_error(name, project.types.names(), "UDT")
        type_, rules = project.types.get_type(name), project.layout_rules_of(name)
        braces = words.take_rest_text("members in braces such as {speed=1.5}")
    content = struct_bytes(lay_out(type_, rules, name), braces, words.where)
    if not content:
        raise words.error(f"{name}, which has no bytes", "a UDT with members")
    return content


def _read_file(words: Words, project: Project) -> bytes:
    name = words.next("the name of a file")
    words.expect_end()
    return file_bytes(project.base / _strip_quotes(name), f"{words.where}: file")


def _strip_quotes(name: str) -> str:
    return name[1:-1] if len(name) > 2 and name[0] == name[-1] and name[0] in "\"'" else name


def _read_random(words: Words, project: Project) -> bytes:
    count = parse_value(RANDOM_COUNT_KIND, words.next("a number of bytes"), "", words.where)
    seed = 0
    if words:
        key, _, text = words.next("seed=1").partition("=")
        if key != "seed":
            raise words.error(quote(key), "seed=1 or the end of the command")
        seed = parse_value(SEED_KIND, text, "seed=", words.where)
    words.expect_end()
    return random_bytes(count, seed)


FORMS: Final[dict[str, Callable[[Words, Project], bytes]]] = {
    "hex": _read_hex,
    "text": _read_text,
    "udt": _read_udt,
    "file": _read_file,
    "random": _read_random,
}
