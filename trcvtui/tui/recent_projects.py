"""Recent projects: MOST_PROJECTS paths in a file of the state folder."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path
from shlex import quote
from typing import Final

from trcvtui import paths
from trcvtui.errors import UserError, mistake
from trcvtui.files import read_bounded, reason_of, write_file

FILE: Final = "recent.json"
MOST_PROJECTS: Final = 10
MOST_BYTES: Final = 100_000


def recent_projects() -> list[str]:
    """Return the paths of the recent projects, the newest first; raise UserError."""
    path, expected = paths.state_folder() / FILE, "a JSON list of paths; delete the file for a new list"
    try:
        found = json.loads(read_bounded(path, MOST_BYTES))
    except FileNotFoundError:
        return []
    except OSError as failed:
        raise mistake(str(path), reason_of(failed), expected) from None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise mistake(str(path), "something else", expected)
    return found[:MOST_PROJECTS]


def remember_project(project: Path) -> None:
    """List a project first, unless it is the demo. Do nothing if the list cannot be read or written."""
    path = os.path.abspath(project)
    if project != paths.demo_path():
        with suppress(OSError, UserError):
            kept = [each for each in recent_projects() if each != path]
            paths.state_folder().mkdir(parents=True, exist_ok=True, mode=0o700)
            file = paths.state_folder() / FILE
            write_file(file, json.dumps([path, *kept][:MOST_PROJECTS]) + "\n", str(file), is_own=True)


def make_run_line(path: str) -> str:
    """Return the shell command that opens a project. Unprintable bytes of the path are in octal."""
    if path.isprintable():
        return f"trcvtui run {quote(path)}"
    letters = (chr(c) if 32 <= c < 127 and c not in b"\\'" else f"\\{c:03o}" for c in os.fsencode(path))
    return f"trcvtui run $'{''.join(letters)}'"
