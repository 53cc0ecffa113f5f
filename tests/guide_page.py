"""A page of docs/guide as steps: commands of a terminal; keys, lines and text of a screen; words to be seen.

Each line of a `sh` block is a command; *words* behind the block are in what its commands print. A command
that opens a screen is the last of its block. On that screen the numbered items are played: `x` or `enter` is
a key, `:set ...` a line at the prompt, other `code` is text; *words* are then on the screen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

FOLDER: Final = Path(__file__).parents[1] / "docs" / "guide"
SCREENS: Final = ("run", "replay", "watch", "tap")
NO_SCREEN: Final = ("--format", "--check", "--set", "--dialect")  # of `replay` and `watch`: these print
_NAMES: Final = "enter escape tab space up down left right home end pageup pagedown backspace delete"
_SPELLINGS: Final = {"esc": "escape", "←": "left", "→": "right", "↑": "up", "↓": "down"}
NAMED_KEYS: Final = _SPELLINGS | {name: name for name in _NAMES.split()}
_PART: Final = re.compile(r"`([^`]+)`|(?<!\*)\*([^*]+)\*(?!\*)")
HOUR_ENDS: Final = "\n## Your own UDT\n"  # before it tests/e2e/test_first_hour.py plays first-hour.md
Kind = Literal["command", "key", "line", "text", "words"]


@dataclass(frozen=True)
class Step:
    kind: Kind
    text: str
    begins_block: bool = False  # the first command of a block: words are of its output from here on


def played_text(name: str) -> str:
    """Return what the test of all pages plays of a page."""
    text = (FOLDER / name).read_text(encoding="utf-8")
    return text.partition(HOUR_ENDS)[2] if name == "first-hour.md" else text


def opens_screen(command: str) -> bool:
    words = command.split()
    return words[0] == "trcvtui" and words[1] in SCREENS and not {*words} & {*NO_SCREEN}


def steps(page: str) -> list[Step]:
    """Return what a page asks for, in its order."""
    found: list[Step] = []
    has_screen = False
    for kind, text in _pieces(page):
        if kind == "sh":
            commands = [line.strip() for line in text.splitlines() if line.strip()]
            found += [Step("command", command, at == 0) for at, command in enumerate(commands)]
            has_screen = opens_screen(commands[-1])
        elif kind == "item" and has_screen:
            found += _played(text)
        elif kind in ("item", "prose") and not has_screen:
            found += [step for step in _played(text) if step.kind == "words"]
    return found


def _pieces(page: str) -> Iterator[tuple[str, str]]:
    """Return blocks with their language, numbered items as "item", other text as "prose"."""
    kind, lines = "prose", list[str]()
    for line in page.splitlines():
        if line.startswith("```"):
            yield kind, "\n".join(lines)
            is_open = kind in ("item", "prose")
            kind, lines = (line[3:] or "text") if is_open else "prose", []
        elif kind not in ("item", "prose"):
            lines.append(line)
        elif re.match(r"\d+\. ", line):
            yield kind, "\n".join(lines)
            kind, lines = "item", [line]
        elif kind == "item" and line and not line.startswith("   "):
            yield kind, "\n".join(lines)
            kind, lines = "prose", [line]
        else:
            lines.append(line)
    yield kind, "\n".join(lines)


def _played(text: str) -> Iterator[Step]:
    for typed, words in _PART.findall(re.sub(r"!\[.*?\]\(.*?\)", "", text, flags=re.DOTALL)):
        if words:
            yield Step("words", " ".join(words.split()))
        elif len(typed) == 1 or typed in NAMED_KEYS or re.fullmatch(r"(ctrl|shift|alt)\+\w+", typed):
            yield Step("key", NAMED_KEYS.get(typed, typed))
        elif typed.startswith(":"):
            yield Step("line", " ".join(typed[1:].split()))
        else:
            yield Step("text", " ".join(typed.split()))


def joined(text: str) -> str:
    """Return a screen or an output without frames and line breaks."""
    return " ".join(re.sub("[│┃]", " ", text).split())
