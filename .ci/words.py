"""Refuse the worst words: each line of the program and of its pages is searched, and what to say is named.

`python .ci/words.py` answers 0 and nothing, or 1 and one line a place: file, line, found, expected.
A name in the program counts as its words do: `told_once`, `ToldOnce` and "told once" are one.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent
PAGES: Final = ("README.md", "CONTRIBUTING.md", "docs/*.md")
PROGRAM: Final = ("trcvtui/**/*.py",)

# Everywhere: what is found (a pattern, case does not count), and what to say.
WORDS: Final = {
    r"(?<!-)\bbehind\b(?!-)": "after (time), below or beside (place)",
    r"\bbe gone\b": "detach the instance; keep the connection open",
    r"\bwhilst\b|\bhence\b|\bthereof\b|\bthereby\b": "while, so, of it",
    r"\butili[sz]e\b|\bleverage\b": "use",
}
# In the program: coined names, and the field's term.
NAMES: Final = {
    "scene": "view_model", "keepsake": "clipboard_and_files", "provenance": "byte_origin",
    "twin tree": "compare_tree", "courier": "update_pipe", "fact book": "link_statistics",
    "shelf": "index or cache", "told once": "fault_repeat", "kept off": "connect_in_use",
    "connection part": "connection_control", "cont level": "one_shot_cont", "link view": "known_connection",
    "stirred": "ready_handles", "roster": "call_order", "doom": "pending_loss", "doomed": "pending_loss",
    "other dialect": "convert_dialect", "stand in": "substitute", "well known": "builtin_types",
    "corrective": "padded_type", "joining": "resolve", "wave lane": "pin_waveform",
}  # fmt: skip


def _name_pattern(words: str) -> re.Pattern[str]:
    """Return what finds a name in snake_case and in CamelCase."""
    parts = words.split()
    snake, camel = "_".join(parts), "".join(part.capitalize() for part in parts)
    return re.compile(rf"(?<![A-Za-z]){snake}(?![a-z])|{camel}(?![a-z])")


def found_in(path: Path, rules: dict[re.Pattern[str], str]) -> list[str]:
    """Return one line for each word of a file that has to go."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [
        f"{path.relative_to(ROOT)}:{number}: found {match[0]!r}, expected {instead}"
        for number, line in enumerate(lines, 1)
        for pattern, instead in rules.items()
        for match in pattern.finditer(line)
    ]


def main() -> int:
    """Search the program and the pages; return 1 where a word was found."""
    words = {re.compile(pattern, re.IGNORECASE): instead for pattern, instead in WORDS.items()}
    names = {_name_pattern(name): instead for name, instead in NAMES.items()}
    places = dict.fromkeys(PAGES, words) | dict.fromkeys(PROGRAM, words | names)
    found = [
        line
        for pattern, rules in places.items()
        for path in sorted(ROOT.glob(pattern))
        for line in found_in(path, rules)
    ]
    print(*found, sep="\n", end="\n" * bool(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
