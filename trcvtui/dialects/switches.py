"""Read switch values out of text or TOML: into a choice, a bool, a count or nanoseconds.

Rule: every mistake of a table is reported, each in one line; a value that cannot be read keeps its default.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from trcvtui.dialects.dialect import Dialect, Switch, SwitchValue
from trcvtui.errors import Problem, UserError
from trcvtui.udt.literals import format_time, parse_time

_TRUE: Final = ("true", "1")
_FALSE: Final = ("false", "0")
_LONGEST_COUNT: Final = 12  # digits; more are refused unread


def defaults(dialect: Dialect) -> dict[str, SwitchValue]:
    """Return the default of every switch; durations in ns."""
    return {switch.name: switch.default for switch in dialect.switches}


def read_switches(
    dialect: Dialect, raw: Mapping[str, object], where: str
) -> tuple[dict[str, SwitchValue], list[Problem]]:
    """Return a value for every switch (durations in ns) and the problems of those that `raw` gets wrong."""
    values, problems = defaults(dialect), []
    known = {switch.name: switch for switch in dialect.switches}
    for name, given in raw.items():
        if name not in known:
            expected = f"a switch of {dialect.name}: {', '.join(known)}"
            problems.append(Problem(f"{where}.{name}", "an unknown switch", expected))
            continue
        value = _READ[known[name].kind](known[name], given)
        if value is None:
            problems.append(Problem(f"{where}.{name}", _shown(given), expected_of(known[name])))
        else:
            values[name] = value
    return values, problems


def expected_of(switch: Switch) -> str:
    """Return what a switch takes, in words."""
    match switch.kind:
        case "choice":
            return " or ".join(switch.values)
        case "bool":
            return "true or false"
        case "duration":
            return "a duration such as T#1s500ms, not negative"
        case _:
            return f"a whole number from {switch.least} to {switch.most}"


def format_value(switch: Switch, value: SwitchValue) -> str:
    """Return a switch's value as it is written in a project file: `T#1s`, `true`, `pulse`, `64`."""
    if switch.kind == "duration" and isinstance(value, int):
        return format_time(value)
    return str(value).lower() if switch.kind == "bool" else str(value)


def _shown(given: object) -> str:
    if isinstance(given, bool):
        return str(given).lower()
    text = repr(given)
    return text if len(text) <= 60 else text[:60] + "..."


def _choice(switch: Switch, given: object) -> SwitchValue | None:
    if isinstance(given, bool) or not isinstance(given, (str, int)):
        return None
    text = given.strip().casefold() if isinstance(given, str) else str(given)
    return next((word for word in switch.values if word.casefold() == text), None)


def _bool(switch: Switch, given: object) -> SwitchValue | None:
    word = str(given).strip().lower() if isinstance(given, (bool, int, str)) else ""
    return True if word in _TRUE else False if word in _FALSE else None


def _duration(switch: Switch, given: object) -> SwitchValue | None:
    if not isinstance(given, str):
        return None
    try:
        ns = parse_time(given)
    except UserError:
        return None
    return ns if ns >= 0 else None


def _count(switch: Switch, given: object) -> SwitchValue | None:
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


_READ: Final[dict[str, Callable[[Switch, object], SwitchValue | None]]] = {
    "choice": _choice,
    "bool": _bool,
    "duration": _duration,
    "count": _count,
}
