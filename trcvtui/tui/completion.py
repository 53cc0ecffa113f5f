"""Completion of the prompt: the bench commands, and the lines that the screen or its engine carries out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Final

from textual.dom import DOMNode
from textual.suggester import Suggester

from trcvtui.commands.completion import NextWords, after_framing, after_trigger, offer_none
from trcvtui.commands.table import COMMANDS
from trcvtui.project.project import Project
from trcvtui.udt.sources import complete_type_path


def complete(line: str, project: Project) -> str | None:
    """Return the line with its last word completed, None if no candidate begins with that word."""
    *words, last = line.split(" ")
    if not words and not last:
        return None
    is_path = words[:2] in (["add", "udt"], ["udt", "open"])
    last = line.split(" ", 2)[2] if is_path else last
    for candidate in complete_type_path(last, project.base) if is_path else _next_words(words, project):
        if candidate.startswith(last) and candidate != last:
            return line[: len(line) - len(last)] + candidate
    return None


def list_verbs() -> tuple[str, ...]:
    return (*(row.verb for row in COMMANDS.values() if row.at_prompt), *SCREEN_COMMANDS)


def _next_words(words: list[str], project: Project) -> Iterable[str]:
    if not words:
        return list_verbs()
    row = COMMANDS.get(words[0])
    candidates = row.next_words if row is not None else SCREEN_NEXT_WORDS.get(words[0], offer_none)
    return candidates(words, project)


def _after_udt(words: list[str], project: Project) -> Iterable[str]:
    from trcvtui.tui.lab.lab import PROFILE_WORDS, SOURCES  # read when first asked for
    from trcvtui.tui.lab.lab_lines import LAB_WORDS

    if len(words) == 1:
        return LAB_WORDS
    known = {"type": project.types.names(), "bytes": SOURCES, "ours": PROFILE_WORDS, "theirs": PROFILE_WORDS}
    return known.get(words[1], ())


# Lines that are no bench commands (`BenchApp.submit`, `Controller.take`).
SCREEN_COMMANDS: Final = (
    "hold", "go", "trigger", "scenarios", "export timing vcd", "find", "mark", "save scenario",
    "save project", "save recording", "record", "record stop", "lab", "udt", "framing",
)  # fmt: skip
SCREEN_NEXT_WORDS: Final[Mapping[str, NextWords]] = {
    "trigger": after_trigger,
    "save": lambda words, project: ("scenario", "project", "recording") if len(words) == 1 else (),
    "udt": _after_udt,
    "framing": after_framing,
}


class BenchSuggester(Suggester):
    def __init__(self, project: Callable[[], Project]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._project = project

    async def get_suggestion(self, value: str) -> str | None:
        return complete(value, self._project())

    def _get_suggestion(self, requester: DOMNode, value: str) -> Any:
        """Return a function, because a coroutine would never be awaited if the app ended."""
        return partial(super()._get_suggestion, requester, value)
