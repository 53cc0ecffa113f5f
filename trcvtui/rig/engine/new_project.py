"""A project from nothing: asked for in the terminal before there is a screen, written after a yes."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final, TextIO

from trcvtui.dialects import DIALECTS
from trcvtui.files import write_file
from trcvtui.rig.scenario.recorded_session import SUFFIX

PROPOSED: Final = "baosky"
NO: Final = ("n", "no", "q")
YES: Final = ("", "y", "yes")
MOST_QUESTIONS: Final = 5
TEXT: Final = """# a bench of trcvtui; `save project` writes here what is added on the screen
dialect = "{dialect}"
"""


def is_wanting(path: Path) -> bool:
    """Return whether a project could begin here: no file in a folder that is there, or an empty file."""
    if path.suffix != SUFFIX:
        return False
    if not os.path.lexists(path):
        return path.parent.is_dir()
    return path.is_file() and path.stat().st_size == 0


def offer(path: Path, answers: TextIO, talk: TextIO) -> bool:
    """Ask for which PLC the project shall be, and write it; return whether there is one now."""
    names = [PROPOSED, *(name for name in DIALECTS if name != PROPOSED)]
    state = "is empty" if path.exists() else "is not there"
    talk.write(f"{path} {state}. It can be created, for\n")
    for number, name in enumerate(names, 1):
        talk.write(f"  {number}  {name:<16}{DIALECTS[name].title}\n")
    for _ in range(MOST_QUESTIONS):
        talk.write(f"enter: create it for {PROPOSED}; a number or a name: for that one; n: nothing > ")
        talk.flush()
        line = answers.readline()
        word = line.strip().lower()
        if not line or word in NO:
            break
        chosen = _chosen(word, names)
        if chosen:
            write_file(path, TEXT.format(dialect=chosen), "trcvtui run", is_own=True)
            return True
    talk.write("\nnothing was written\n")
    return False


def _chosen(word: str, names: list[str]) -> str:
    if word in YES:
        return PROPOSED
    if word.isascii() and word.isdigit() and 0 < int(word[:6]) <= len(names):
        return names[int(word[:6]) - 1]
    return word if word in names else ""


def offer_in_the_terminal(path: Path) -> bool:
    """Ask on the terminal."""
    return offer(path, sys.stdin, sys.stderr)
