"""The lines that the lab carries out itself: `udt open FILE`, `udt theirs natural8 big`, `udt hex 01 02` …

These lines also work on the prompt of the bench. `lab` alone opens the lab.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake
from trcvtui.tui.formatting import plain
from trcvtui.tui.lab import LAB, UDT
from trcvtui.tui.lab.lab import HEX, OURS, SOURCES, THEIRS, Lab, profile_from
from trcvtui.udt.byte_text import parse_hex
from trcvtui.udt.command import constants_of
from trcvtui.wording import count

MISTAKE_PLACE: Final = "udt"
CONSTANT, RELOAD = "constant", "reload"
MOST_HEX: Final = 65_535  # bytes: the largest job
LINE_SYNTAX: Final = (
    "open FILE, project, type NAME, ours|theirs LAYOUT little|big s7|cstr|nul, swap, bytes "
    "data|job|last|message, hex 01 02, fit, constant NAME=VALUE, or reload"
)


def run_lab_line(line: str, lab: Lab) -> str:
    """Carry out a line. Return the pane to open, or "" for none; raise UserError."""
    verb, _, rest = line.strip().partition(" ")
    if verb == LAB and not rest.strip():
        return ""
    word, _, rest = rest.strip().partition(" ")
    if verb != UDT or word not in _ACTIONS_BY_WORD:
        raise mistake(MISTAKE_PLACE, f"'{plain(line.strip())[:60]}'", f"udt {LINE_SYNTAX}")
    pane, act = _ACTIONS_BY_WORD[word]
    act(lab, rest.strip())
    return pane


def goes_to_engine_too(line: str) -> bool:
    """Return whether the engine also needs the line, to save constants or to read types again."""
    return line.split()[1:2] in ([CONSTANT], [RELOAD])


def describe_outcome(lab: Lab, trouble: str, message: str) -> tuple[str, str]:
    """Return the sentence below the panes and its style: an error, else the last result, else a hint."""
    files, problems = lab.files, lab.files.types.problems
    bad = f"; w: {count(len(problems), 'problem')} in {files.name}" if problems else ""
    if trouble:
        return f"✗ {trouble}", "error"
    if files.trouble:
        return f"✗ {files.trouble} (the last good types stay)", "error"
    if message or lab.news:
        return f"{message or lab.news}{bad}", ""
    return f"f: which profile fits? c: the cure{bad}", "warn" if bad else "dim"


def _open_types(lab: Lab, rest: str) -> None:
    if not rest:
        raise mistake(MISTAKE_PLACE, "no file name", "udt open FILE")
    path = Path(rest).expanduser()
    lab.open_type_file(path if path.exists() else lab.base / path)


def _choose_profile(side: str, lab: Lab, rest: str) -> None:
    lab.choose_profile(side, profile_from(rest.split(), lab.profiles[side], f"{MISTAKE_PLACE} {side}"))


def _choose_bytes(lab: Lab, rest: str) -> None:
    if rest not in SOURCES:
        raise mistake(f"{MISTAKE_PLACE} bytes", f"'{plain(rest)[:40]}'", "one of " + ", ".join(SOURCES))
    lab.bytes.source, lab.bytes.back, lab.bytes.is_chosen = rest, 0, True


def _use_hex(lab: Lab, rest: str) -> None:
    content = parse_hex(rest, f"{MISTAKE_PLACE} hex")
    if len(content) > MOST_HEX:
        raise mistake(f"{MISTAKE_PLACE} hex", f"{len(content)} bytes", f"at most {MOST_HEX}")
    lab.bytes.typed, lab.bytes.source, lab.bytes.is_chosen = content, HEX, True


# By the word after `udt`: the pane that it opens, and its action.
_ACTIONS_BY_WORD: Final[dict[str, tuple[str, Callable[[Lab, str], object]]]] = {
    "open": ("tree", _open_types),
    "project": ("tree", lambda lab, _: lab.use_project_types()),
    "type": ("tree", Lab.choose_type),
    OURS: ("tree", partial(_choose_profile, OURS)),
    THEIRS: ("tree", partial(_choose_profile, THEIRS)),
    "swap": ("tree", lambda lab, _: lab.exchange_profiles()),
    "bytes": ("hex", _choose_bytes),
    HEX: ("hex", _use_hex),
    "fit": ("fit", lambda lab, _: lab.rank_profiles()),
    CONSTANT: ("tree", lambda lab, rest: lab.add_constants(constants_of(rest.split()))),
    RELOAD: ("tree", lambda lab, _: lab.reload_if_changed()),
}
LAB_WORDS: Final = tuple(_ACTIONS_BY_WORD)
