"""Arguments of the command line: the usual ones are read here; others, help and mistakes are argparse's.

The same functions fill both parsers (`add_...` in cli.py and udt/cli_input.py), so an option stands once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, Final, Protocol

SUPPRESS: Final = "==SUPPRESS=="  # as argparse writes it: no value where the option is not given


class ArgumentRows(Protocol):
    """What the functions fill."""

    description: str | None
    last_words: Callable[[], str] | None
    given: Sequence[str]

    def add_argument(self, name: str, /, **settings: Any) -> Any:
        """Add an option or a place."""
        ...

    def set_defaults(self, **values: Any) -> None:
        """Set what the answer has beside the arguments."""
        ...

    def add_subparsers(self, *, metavar: str, required: bool = ..., help: str | None = ...) -> Any:
        """Let the first word be a command; what is returned takes them."""
        ...


class _Argument:
    """One option or one place; as argparse's own, `required` may be changed after it was added."""

    def __init__(self, name: str, settings: dict[str, Any]) -> None:
        self.is_option = name.startswith("-")
        self.dest: str = settings.get("dest") or name.lstrip("-").replace("-", "_")
        self.action: str = settings.get("action", "store")
        self.is_many = settings.get("nargs") == "+"
        self.default = settings.get("default", False if self.action == "store_true" else None)
        self.choices: Sequence[Any] | None = settings.get("choices")
        self.type: Callable[[str], Any] = settings.get("type", str)
        self.required: bool = settings.get("required", not self.is_option and settings.get("nargs") != "?")

    def value(self, text: str) -> Any:
        """Return what the text says; raise ValueError for a mistake."""
        value = self.type(text)
        if self.choices is not None and value not in self.choices:
            raise ValueError(text)
        return value


class PlainParser:
    """Reads `--name value`, `--name=value` and, side by side, what stands at a place."""

    def __init__(self, is_command_required: bool = False) -> None:
        self.description: str | None = None
        self.last_words: Callable[[], str] | None = None
        self.given: Sequence[str] = ()
        self._is_command_required = is_command_required
        self._defaults: dict[str, Any] = {}
        self._arguments: dict[str, _Argument] = {}
        self._commands: dict[str, PlainParser] = {}

    def add_argument(self, name: str, /, **settings: Any) -> _Argument:
        """Add an option or a place."""
        made = self._arguments[name] = _Argument(name, settings)
        return made

    def set_defaults(self, **values: Any) -> None:
        """Set what the answer has beside the arguments."""
        self._defaults |= values

    def add_subparsers(self, *, metavar: str, required: bool = False, help: str | None = None) -> PlainParser:
        """Let the first word be a command."""
        self._is_command_required = required
        return self

    def add_parser(self, name: str, **settings: object) -> PlainParser:
        """Add a command."""
        made = self._commands[name] = PlainParser()
        return made

    def read(self, words: Sequence[str]) -> SimpleNamespace | None:
        """Return the arguments; None: argparse has to read this line."""
        found: dict[str, Any] = {}
        try:
            self._read(list(words), found)
        except ValueError:
            return None
        return SimpleNamespace(**found)

    def _read(self, words: list[str], found: dict[str, Any]) -> None:
        for one in self._arguments.values():
            if one.default != SUPPRESS:
                found[one.dest] = list(one.default) if isinstance(one.default, list) else one.default
        found |= self._defaults
        if self._commands:
            if words and words[0] in self._commands:
                self._commands[words[0]]._read(words[1:], found)
            elif words or self._is_command_required:
                raise ValueError("no command")
            return
        wanted = {name for name, one in self._arguments.items() if one.is_option and one.required}
        rows: list[list[str]] = [[]]  # what stands side by side between options
        at = 0
        while at < len(words):
            name, has_value, text = words[at].partition("=")
            at += 1
            if not _is_option(name):
                rows[-1].append(words[at - 1])
                continue
            rows.append([])
            option = self._arguments.get(name)
            if option is None or option.action not in ("store", "store_true", "append"):
                raise ValueError(name)
            wanted.discard(name)
            if option.action == "store_true":
                if has_value:
                    raise ValueError(text)
                found[option.dest] = True
                continue
            if not has_value:
                if at == len(words) or _is_option(words[at]):
                    raise ValueError(name)
                text, at = words[at], at + 1
            if option.action == "append":
                found[option.dest].append(option.value(text))
            else:
                found[option.dest] = option.value(text)
        placed = [row for row in rows if row] or [[]]
        if wanted or len(placed) > 1:
            raise ValueError("argparse knows")
        self._place(placed[0], found)

    def _place(self, words: list[str], found: dict[str, Any]) -> None:
        places = [one for one in self._arguments.values() if not one.is_option]
        spare = len(words) - sum(one.required for one in places)
        at = 0
        for one in places:
            takes = one.required + (spare if one.is_many else min(spare, not one.required))
            if takes > 0:
                values = [one.value(word) for word in words[at : at + takes]]
                found[one.dest] = values if one.is_many else values[0]
                spare -= takes - one.required
                at += takes
        if spare:
            raise ValueError("too few or too many")


def _is_option(word: str) -> bool:
    return word.startswith("-") and word != "-"
