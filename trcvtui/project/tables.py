"""Reads each table of a TOML file key by key. Wrong values and missing or unknown keys are Problems.

Rule: every key has a Kind, and a Kind reads both a TOML value and the text of `--set PATH=VALUE`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final, Generic, TypeVar
from unicodedata import category

from msgspec import Struct

from trcvtui.errors import Problem, UserError, mistake, one_line
from trcvtui.files import is_folder, read_bounded, reason_of
from trcvtui.net.connection.config import parse_address
from trcvtui.net.received_ring import LEAST_HISTORY, MOST_HISTORY
from trcvtui.net.results import Endpoint, parse_end
from trcvtui.net.tap import PLACE_SYNTAX, parse_place
from trcvtui.udt.layout.rules import BYTE_ORDERS, LAYOUT_ALIASES, LAYOUTS, POINTER_SIZES, TEXT_FORMS
from trcvtui.udt.literals import format_duration, parse_duration, parse_integer
from trcvtui.udt.types import ELEMENTARY
from trcvtui.wording import exact_size, parse_size

IDENTIFIER_TEXT: Final = "a name of letters, digits and _ that does not begin with a digit"
EXPECTED_VISIBLE_NAME: Final = "a name without control and bidirectional characters"
_HIDDEN: Final = frozenset({"Cc", "Zl", "Zp"})
_BIDI: Final = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
MOST_LISTED: Final = 16
LEAST_SIMILARITY: Final = 0.7  # of 1: STATE is near STATUS, C2 is not near C1


def hidden_chars(path: str) -> str:
    """Return the control and bidirectional characters of a file's name, escaped; empty if it has none."""
    return one_line("".join(sorted({one for one in path if one in _BIDI or category(one) in _HIDDEN})))


def parse_reference(text: str | None) -> str | None:
    """Return `C1` for `@C1`, and None for any other text."""
    return text[1:] if text and text.startswith("@") and text[1:].isidentifier() else None


def expected_name(wrong: str, known: Iterable[str], what: str) -> str:
    """Return what was expected instead of a wrong name: the nearest known name, or a list of known names.

    `what` is the kind of the names, such as `CONNECT`.
    """
    names = list(dict.fromkeys(known))
    near = find_nearest(wrong, names)
    if near is not None:
        return near
    if not names:
        return f"the name of {with_article(what)}, but there is none"
    listed = ", ".join(names[:MOST_LISTED]) + (", ..." if len(names) > MOST_LISTED else "")
    return listed if len(names) == 1 else f"one of {listed}"


def with_article(word: str) -> str:
    """Return a word with its article, such as `an instance` or `a CONNECT`."""
    return f"{'an' if word[:1] in 'aeioAEIO' else 'a'} {word}"  # no u: "a UDT" is spoken "you-dee-tee"


def find_nearest(wrong: str, known: Iterable[str]) -> str | None:
    """Return the known name that is most like the wrong name, None when no known name is near."""
    folded = {name.casefold(): name for name in known}
    if wrong.casefold() in folded:
        return folded[wrong.casefold()]
    # Imported here: a file without mistakes does not need it.
    import difflib

    found = difflib.get_close_matches(wrong.casefold()[:100], folded, n=1, cutoff=LEAST_SIMILARITY)
    return folded[found[0]] if found else None


LARGEST_FILE: Final = 10 * 1024 * 1024
# tomllib gives the place only at the end of its message: "(at line 3, column 5)", "(at end of document)".
_TOML_PLACE: Final = re.compile(r"(.*) \(at (.*)\)", re.DOTALL)


def read_toml(path: Path) -> dict[str, Any]:
    """Return the document of a TOML file; raise UserError when it cannot be read or is not TOML."""
    return parse_toml(read_text(path), str(path))


# Long texts, comments and, as group 1, dotted keys. A text that is not closed ends with its line or the file.
_KEY_PART: Final = r"""(?:[\w-]++|"(?:[^"\\\n]|\\[^\n])*+"?|'[^'\n]*+'?)"""
_TOKEN: Final = re.compile(
    rf"""(?s:"{{3}}(?:[^\\]|\\.)*?(?:"{{3,5}}|\Z)|'{{3}}.*?(?:'{{3,5}}|\Z))|#[^\n]*+"""
    rf"""|({_KEY_PART}(?:[ \t]*+\.[ \t]*+{_KEY_PART})*+)"""
)
MOST_DOTS: Final = 100  # in a key: tomllib's time grows with their square, which a file could exploit


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the document of a TOML text; raise UserError when the text is no TOML."""
    import tomllib

    for token in _TOKEN.finditer(text) if text.count(".") > MOST_DOTS else ():
        dots = len(re.findall(_KEY_PART, token[1] or "")) - 1
        if dots > MOST_DOTS:
            line = text.count("\n", 0, token.start()) + 1
            raise mistake(f"{where}: line {line}", f"a key with {dots} dots", f"at most {MOST_DOTS} dots")
    try:
        return tomllib.loads(text)
    except ValueError as wrong:  # TOMLDecodeError, and numbers of more digits than Python reads
        found = _TOML_PLACE.fullmatch(str(wrong))
        message, place = found.groups() if found else (str(wrong), "")
        raise mistake(f"{where}: {place}" if place else where, f"bad TOML ({message})", "TOML 1.0") from None
    except RecursionError:
        raise mistake(where, "brackets nested too deeply", "fewer levels of brackets") from None


def read_text(path: Path) -> str:
    """Return the text of a TOML file; raise UserError when it cannot be read."""
    hidden = hidden_chars(str(path))
    if hidden:
        raise mistake(str(path), f"{hidden} in its name", EXPECTED_VISIBLE_NAME)
    try:
        content = read_bounded(path, LARGEST_FILE)
    except (OSError, ValueError) as failed:
        reason = reason_of(failed)
        if isinstance(failed, FileNotFoundError) and not is_folder(path.parent):
            reason = f"no folder {path.parent}"
        raise mistake(str(path), reason, "a TOML file that can be read", "file") from None
    if len(content) > LARGEST_FILE:
        raise mistake(str(path), "a file that is too large", f"at most {LARGEST_FILE} bytes")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        line = content.count(b"\n", 0, wrong.start) + 1
        raise mistake(
            f"{path}: line {line}", f"byte 16#{content[wrong.start]:02X}", "TOML in UTF-8"
        ) from None


T = TypeVar("T")

LONGEST_SHOWN: Final = 60
LEAST_INTERVAL_NS: Final = 100_000  # a scan itself takes tens of microseconds
TRUTH_WORDS: Final = {"1": True, "0": False, "TRUE": True, "FALSE": False}


class SetOverride(Struct, frozen=True):
    """A value given as text, as by `--set path=text`. The document has it in place of a TOML value."""

    path: str
    text: str


class Kind(Struct, Generic[T], frozen=True):
    """The values that a key may have. `read` and `from_text` return None for any other value.

    `instead` returns what to write in place of a refused text, or "" if `expected` says it. `write` returns
    the value as it is written in TOML.
    """

    expected: str
    read: Callable[[Any], T | None]
    from_text: Callable[[str], T | None]
    instead: Callable[[str], str] = lambda text: ""
    write: Callable[[Any], Any] = lambda value: value

    def expected_for(self, value: object) -> str:
        text = value.text if isinstance(value, SetOverride) else value
        return (self.instead(text) if isinstance(text, str) else "") or self.expected


def text_kind(
    expected: str,
    read: Callable[[str], T | None],
    instead: Callable[[str], str] = lambda text: "",
    write: Callable[[Any], Any] = lambda value: value,
) -> Kind[T]:
    """Return a kind that is written as a string in TOML."""
    return Kind(expected, lambda value: read(value) if isinstance(value, str) else None, read, instead, write)


def integer(least: int, most: int) -> Kind[int]:
    def bounded(number: int | None) -> int | None:
        return number if number is not None and least <= number <= most else None

    return Kind(
        f"a whole number from {least} to {most}",
        lambda value: bounded(value) if isinstance(value, int) and not isinstance(value, bool) else None,
        lambda text: bounded(parse_integer(text)),
    )


def number_choice_kind(*numbers: int) -> Kind[int]:
    """Return a kind that has only these whole numbers as values."""
    near = integer(min(numbers), max(numbers))
    return Kind(
        " or ".join(map(str, numbers)),
        lambda value: number if (number := near.read(value)) in numbers else None,
        lambda text: number if (number := near.from_text(text)) in numbers else None,
    )


def _truth(value: object) -> bool | None:
    # 1 and 0 are BOOL literals of IEC 61131-3; 1.0 and "1" are not.
    return bool(value) if isinstance(value, int) and value in (0, 1) else None


def _duration_parser(least: int) -> Callable[[str], int | None]:
    def read(text: str) -> int | None:
        ns = parse_duration(text)
        return ns if ns is not None and ns >= least else None

    return read


def _milliseconds(text: str) -> int | None:
    """Return a TIME in ms, None if it is no whole number of ms below 2^32, the limit of TwinCAT."""
    is_count = text.isascii() and text.isdigit() and len(text) < 11
    ns = int(text) * 1_000_000 if is_count else parse_duration(text)
    return None if ns is None or ns % 1_000_000 or not 0 <= ns < 1_000_000 << 32 else ns // 1_000_000


def _texts(value: object) -> tuple[str, ...] | None:
    texts = value if isinstance(value, list) else [value]
    read = tuple(text for text in texts if isinstance(text, str))
    return read if len(read) == len(texts) else None


def _list_kind(what: str) -> Kind[tuple[str, ...]]:
    return Kind(f"a list of {what}", _texts, lambda text: (text,), write=list)


def _valid_tap_place(text: str) -> str | None:
    try:
        parse_place(text, "")
    except UserError:
        return None
    return text


def parse_endpoint(text: str) -> Endpoint | None:
    address, colon, port = text.rpartition(":")
    parsed = parse_address(address)
    if not colon or parsed is None or not (port.isascii() and port.isdigit() and len(port) <= 5):
        return None
    return Endpoint(parsed, int(port)) if int(port) <= 65535 else None


def _addresses(value: Any) -> tuple[str, ...] | None:
    if not isinstance(value, list):
        return None
    found = [parse_address(item) if isinstance(item, str) else None for item in value]
    known = tuple([address for address in found if address is not None])
    return known if len(known) == len(found) else None


TRUTH: Final = Kind("true or false", _truth, lambda text: TRUTH_WORDS.get(text.upper()))
TEXT: Final = text_kind("a text in quotes", lambda text: text)
FILE: Final = text_kind(
    "a text in quotes", lambda text: None if hidden_chars(text) else text, lambda text: EXPECTED_VISIBLE_NAME
)
INTERVAL: Final = text_kind(
    "a duration of at least T#100us, such as T#10ms",
    _duration_parser(LEAST_INTERVAL_NS),
    write=format_duration,
)
DELAY: Final = text_kind(
    "a duration of at least T#0s, such as T#5ms", _duration_parser(0), write=format_duration
)
MILLISECONDS: Final = Kind(
    "a TIME of whole milliseconds such as T#50ms or 50",
    lambda value: None if isinstance(value, bool | float) else _milliseconds(str(value)),
    _milliseconds,
    write=lambda ms: format_duration(ms * 1_000_000),
)
ADDRESS: Final = text_kind("an IPv4 address, four numbers from 0 to 255", parse_address)
ENDPOINT: Final = text_kind("an IPv4 address and a port such as 127.0.0.1:2000", parse_endpoint, write=str)
FAR_END: Final = text_kind(
    "an address with or without a port, such as 10.0.0.5:2000", lambda text: text if parse_end(text) else None
)
TAP_PLACE: Final = text_kind(PLACE_SYNTAX, _valid_tap_place)
ADDRESSES: Final = Kind(
    'a list of IPv4 addresses such as ["10.0.0.1"]',
    _addresses,
    lambda text: _addresses(text.split(",")),
    write=list,
)
PORT: Final = integer(0, 65535)
MESSAGE_LIST: Final = _list_kind('messages such as ["hex 01 02", "random 8"]')
STEP_LIST: Final = _list_kind('message names and pauses such as ["hello", "T#100ms"]')
RULE_LIST: Final = _list_kind('rules such as ["contains hex 05 send hex 06"]')
NAME: Final = text_kind(IDENTIFIER_TEXT, lambda text: text if text.isidentifier() else None)
UINT: Final = integer(*ELEMENTARY["UINT"].limits)
PRIORITY: Final = integer(0, 255)
SEED: Final = integer(0, (1 << 63) - 1)
LINT: Final = integer(*ELEMENTARY["LINT"].limits)


def addresses_by_name(value: Any) -> tuple[tuple[str, str], ...] | None:
    """Return the names of a table with their addresses, None if the value of a name is no address."""
    if not isinstance(value, Mapping):
        return None
    found = [(name, parse_address(address)) for name, address in value.items() if isinstance(address, str)]
    known = tuple((name, address) for name, address in found if address is not None)
    return known if len(known) == len(value) else None


HOST_NAMES: Final[Kind[tuple[tuple[str, str], ...]]] = Kind(
    'names and addresses such as { "plc2.line.local." = "10.0.0.7" }',
    addresses_by_name,
    lambda text: None,
    write=dict,
)


def _valid_reference(text: str) -> str | None:
    return text if parse_reference(text) is not None else None


PORT_OR_NAME: Final[Kind[int | str]] = Kind(
    "a port from 0 to 65535, or @NAME of a peer or CONNECT",
    lambda value: _valid_reference(value) if isinstance(value, str) else PORT.read(value),
    lambda text: _valid_reference(text) or PORT.from_text(text),
)
UDP_PORT_OR_NAME: Final[Kind[int | str]] = Kind(
    "a port from 0 to 65535, or @NAME of a peer or UDP_CONFIG", PORT_OR_NAME.read, PORT_OR_NAME.from_text
)
END_OR_NAME: Final[Kind[Endpoint | str]] = text_kind(
    "an IPv4 address and a port such as 127.0.0.1:2000, or @NAME of a CONNECT",
    lambda text: _valid_reference(text) or parse_endpoint(text),
    write=str,
)
UDP_END_OR_NAME: Final[Kind[Endpoint | str]] = text_kind(
    "an IPv4 address and a port such as 127.0.0.1:2000, or @NAME of a UDP_CONFIG",
    END_OR_NAME.from_text,
    write=str,
)
LAYOUT: Final = text_kind(
    "a layout: " + ", ".join(LAYOUTS),
    lambda text: text if text in LAYOUTS or text in LAYOUT_ALIASES else None,
)
BYTE_ORDER: Final = text_kind("little or big", lambda text: text if text in BYTE_ORDERS else None)
TEXT_FORM: Final = text_kind(
    "a form of STRING: " + ", ".join(TEXT_FORMS), lambda text: text if text in TEXT_FORMS else None
)
POINTER_SIZE: Final = number_choice_kind(*POINTER_SIZES)


QUEUE_SIZE: Final = integer(1, 65_536)
HISTORY_SIZE: Final = text_kind(
    "a size from 64KiB to 64MiB, such as 4MiB",
    lambda text: size if LEAST_HISTORY <= (size := parse_size(text) or 0) <= MOST_HISTORY else None,
    write=exact_size,
)
BAUD: Final = integer(50, 4_000_000)
DATA_BITS: Final = integer(5, 8)


def _word_choice_kind(*words: str) -> Kind[str]:
    return text_kind(" or ".join(words), lambda text: text if text in words else None)


def _stop_bits(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and value in (1, 1.5, 2) else None


STOP_BITS: Final = Kind(
    "1, 1.5 or 2",
    _stop_bits,
    lambda text: {"1": 1.0, "1.5": 1.5, "2": 2.0}.get(text),
    write=lambda number: int(number) if number == int(number) else number,
)
PARITY: Final = _word_choice_kind("none", "even", "odd", "mark", "space")
HANDSHAKE: Final = _word_choice_kind("none", "rts/cts", "dsr/dtr", "xon/xoff")
PORT_NAME: Final = text_kind("the name of a port, such as /dev/ttyUSB0", lambda text: text.strip() or None)


class Table:
    """One table of a document. `where` names the file and the table."""

    def __init__(self, content: Mapping[str, Any], where: str, problems: list[Problem]) -> None:
        self.where = where
        self.problems = problems
        self._content = content
        self._known: list[str] = []

    def get(self, key: str, kind: Kind[T], default: T) -> T:
        """Return the value of an optional key, the default if the key is missing or the value is wrong."""
        found = self.read(key, kind)
        return default if found is None else found

    def require(self, key: str, kind: Kind[T]) -> T | None:
        """Return the value of a key that must be there, None where it is missing or wrong."""
        if key not in self._content:
            self.report(key, "nothing", kind.expected, "missing")
        return self.read(key, kind)

    def read(self, key: str, kind: Kind[T]) -> T | None:
        """Return the value of an optional key, None where it is missing or wrong."""
        self._known.append(key)
        if key not in self._content:
            return None
        value = self._content[key]
        found = kind.from_text(value.text) if isinstance(value, SetOverride) else kind.read(value)
        if found is None:
            self.report(key, quote(value), kind.expected_for(value))
        return found

    def has(self, key: str) -> bool:
        return key in self._content

    def mark_known(self, *keys: str) -> None:
        """Count these keys as read."""
        self._known.extend(keys)

    def peek(self, key: str) -> Any:
        return self._content.get(key)

    def text(self, key: str) -> str | None:
        value = self._content.get(key)
        return value.text if isinstance(value, SetOverride) else value if isinstance(value, str) else None

    def is_true(self, key: str, default: bool = False) -> bool:
        """Return the value of a key; the default if it is neither true nor false."""
        value = self._content.get(key)
        found = TRUTH.from_text(value.text) if isinstance(value, SetOverride) else TRUTH.read(value)
        return default if found is None else found

    def unread_keys(self) -> list[str]:
        return [key for key in self._content if key not in self._known]

    def report(self, key: str, found: str, expected: str, kind: str = "value") -> None:
        self.problems.append(Problem(self.location_of(key), found, expected, kind))

    def report_unknown_name(self, key: str, name: str, known: Iterable[str], what: str) -> None:
        """Report that the name at a key is unknown. `what` is the kind of the known names."""
        self.report(key, quote(name), expected_name(name, known, what), "unknown")

    def location_of(self, key: str) -> str:
        """Return where a key's value is: `bench.toml: connect C1: LocalPort`, or `--set PATH`."""
        value = self._content.get(key)
        return f"--set {value.path}" if isinstance(value, SetOverride) else f"{self.where}: {key}"

    def report_unread_keys(self, what: str = "key") -> None:
        """Report every key that was not read. `what` is the word for a key in the report."""
        for key in self.unread_keys():
            self.report(key, f"an unknown {what}", expected_name(key, self._known, what), "unknown")


def quote(value: object) -> str:
    """Return a TOML value for a message, cut to a readable length."""
    match value:
        case SetOverride(text=text):
            return quote(text)
        case str():
            return f"'{value[:LONGEST_SHOWN]}{'...' * (len(value) > LONGEST_SHOWN)}'"
        case bool():
            return str(value).lower()
        case Mapping():
            return "a table"
        case list():
            return "a list"
        case int() if value.bit_length() > 128:
            return "a number beyond any range"
        case _:
            return str(value)
