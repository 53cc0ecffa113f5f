"""A dialect: name, answered questionnaire, STATUS table and layout. This module also reads the switches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from msgspec import Struct, field

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.rules import VendorRules
from trcvtui.blocks.status import StatusRow
from trcvtui.errors import Problem
from trcvtui.udt.literals import format_duration, parse_duration

SwitchValue = str | int | bool


class Switch(Struct, frozen=True):
    """One point that the manual leaves open. `kind` is choice, bool, duration (ns) or count.

    `values` are the words of a choice. `least` and `most` bound a count. `text` says what is decided.
    """

    name: str
    kind: str
    default: SwitchValue
    text: str
    values: tuple[str, ...] = ()
    least: int = 0
    most: int = 1_000_000


# Every vendor's listeners have a queue. Linux silently cuts one that is longer than net.core.somaxconn.
BACKLOG_SWITCH: Final = Switch(
    "backlog",
    "count",
    128,
    "clients that a listener queues; one client more gets no answer and retries",
    least=1,
    most=4096,
)

# No row of any manual uses these codes.
INTERNAL_FAULT: Final = Switch(
    "internal_fault",
    "choice",
    "8FFF",
    "STATUS of an instance that an internal error of this program has stopped",
    ("8FFF", "8FFE", "8FFD"),
)


def map_codes(rows: Iterable[StatusRow]) -> dict[str, dict[Condition, int]]:
    """Return the code that each block shows for each condition, as the rows say."""
    codes: dict[str, dict[Condition, int]] = {}
    for row in rows:
        for block in row.blocks:
            codes.setdefault(block, {}).update(dict.fromkeys(row.conditions, row.code))
    return codes


class Dialect(Struct, frozen=True):
    """One vendor's blocks. `models` maps PLC models to connection budgets; `default_model` is one of them.

    If `describes_connects`, a CONNECT is a description such as TCON_IP_v4, not a TCP_CONNECTCONFIG.
    `structures` are the connection descriptions that the dialect takes, () for all of them.
    `folder` is the folder of the scenarios, if its name is not the name of the dialect.
    `follows` is the document of the sequence, if dialects with the same table differ in sequence.
    `words` has this vendor's words for conditions whose usual words are those of another vendor.
    """

    name: str
    title: str
    blocks: tuple[str, ...]
    status: tuple[StatusRow, ...]
    switches: tuple[Switch, ...]
    models: Mapping[str, int]
    default_model: str
    layout: str
    answer: Callable[[Mapping[str, SwitchValue]], VendorRules]
    describes_connects: bool = False
    structures: tuple[str, ...] = ()
    folder: str = ""
    follows: str = ""
    words: Mapping[str, str] = field(default_factory=dict)

    def label(self, condition: str) -> str:
        """Return a condition in two or three words, for a column beside its code."""
        return self.words.get(condition, condition)

    @property
    def scenario_folder(self) -> str:
        return self.folder or self.name

    def row(self, code: int, block: str | None = None) -> StatusRow | None:
        return next((r for r in self.status if r.code == code and (block is None or block in r.blocks)), None)


# Rule: every mistake of a table is reported, each in one line; a value that cannot be read keeps its default.

_TRUE_WORDS: Final = ("true", "1")
_FALSE_WORDS: Final = ("false", "0")
_LONGEST_COUNT: Final = 12  # digits; more are refused unread


def defaults(dialect: Dialect) -> dict[str, SwitchValue]:
    """Return the default of every switch; durations in ns."""
    return {switch.name: switch.default for switch in dialect.switches}


def read_switches(
    dialect: Dialect, raw: Mapping[str, object], where: str
) -> tuple[dict[str, SwitchValue], list[Problem]]:
    """Return a value for every switch (durations in ns) and the problems of wrong values in `raw`."""
    values, problems = defaults(dialect), []
    known = {switch.name: switch for switch in dialect.switches}
    for name, given in raw.items():
        if name not in known:
            expected = f"a switch of {dialect.name}: {', '.join(known)}"
            problems.append(Problem(f"{where}.{name}", "an unknown switch", expected))
            continue
        value = _SWITCH_PARSERS[known[name].kind](known[name], given)
        if value is None:
            problems.append(Problem(f"{where}.{name}", _format_given(given), describe_expected(known[name])))
        else:
            values[name] = value
    return values, problems


def describe_expected(switch: Switch) -> str:
    match switch.kind:
        case "choice":
            return " or ".join(switch.values)
        case "bool":
            return "true or false"
        case "duration":
            return "a duration of at least T#0s, such as T#1s500ms"
        case _:
            return f"a whole number from {switch.least} to {switch.most}"


def format_value(switch: Switch, value: SwitchValue) -> str:
    """Return a switch's value as it is written in a project file: `T#1s`, `true`, `pulse`, `64`."""
    if switch.kind == "duration" and isinstance(value, int):
        return format_duration(value)
    return str(value).lower() if switch.kind == "bool" else str(value)


def _format_given(given: object) -> str:
    if isinstance(given, bool):
        return str(given).lower()
    text = repr(given)
    return text if len(text) <= 60 else text[:60] + "..."


def _parse_choice(switch: Switch, given: object) -> SwitchValue | None:
    if isinstance(given, bool) or not isinstance(given, (str, int)):
        return None
    text = given.strip().casefold() if isinstance(given, str) else str(given)
    return next((word for word in switch.values if word.casefold() == text), None)


def _parse_bool(switch: Switch, given: object) -> SwitchValue | None:
    word = str(given).strip().lower() if isinstance(given, (bool, int, str)) else ""
    return True if word in _TRUE_WORDS else False if word in _FALSE_WORDS else None


def _parse_duration(switch: Switch, given: object) -> SwitchValue | None:
    ns = parse_duration(given) if isinstance(given, str) else None
    return ns if ns is not None and ns >= 0 else None


def _parse_count(switch: Switch, given: object) -> SwitchValue | None:
    if isinstance(given, bool):
        return None
    if isinstance(given, str):
        digits = given.strip()
        if not (digits.isascii() and digits.isdigit() and len(digits) <= _LONGEST_COUNT):
            return None
        given = int(digits)
    if not isinstance(given, int):
        return None
    return given if switch.least <= given <= switch.most else None


_SWITCH_PARSERS: Final[dict[str, Callable[[Switch, object], SwitchValue | None]]] = {
    "choice": _parse_choice,
    "bool": _parse_bool,
    "duration": _parse_duration,
    "count": _parse_count,
}
