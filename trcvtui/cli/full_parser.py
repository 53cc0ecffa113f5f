"""The parser of the lines that are not the usual ones: help, mistakes, options before and between places."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from trcvtui.cli.arguments import SUPPRESS
from trcvtui.errors import one_line


class _Help(argparse.HelpFormatter):
    """Help for 80 columns; asking the terminal for its width would cost an import at every start."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=78)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n" in text else super()._fill_text(text, width, indent)


class FullParser(argparse.ArgumentParser):
    """One line for a mistake; the last lines of the help are made when somebody asks for them."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=_Help, allow_abbrev=False, **settings)
        self.last_words: Callable[[], str] | None = None
        self.given: Sequence[str] = ()  # what stands after the command's name

    def add_argument(self, *names: str, **settings: Any) -> Any:
        """Add an option or a place; argparse knows "no value" by its own object alone."""
        if settings.get("default") == SUPPRESS:
            settings["default"] = argparse.SUPPRESS
        return super().add_argument(*names, **settings)

    def add_subparsers(self, **settings: Any) -> Any:
        """Let the first word be a command; SUPPRESS as help leaves the list of commands out."""
        if settings.get("help") == SUPPRESS:
            settings["help"] = argparse.SUPPRESS
        return super().add_subparsers(**settings)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and leave with 2."""
        self.exit(2, one_line(f"{self.prog}: {message}") + "\n")

    def format_help(self) -> str:
        """Return the help, with the names that only an import can tell."""
        if self.last_words is not None:
            self.epilog = self.last_words()
        return super().format_help()
