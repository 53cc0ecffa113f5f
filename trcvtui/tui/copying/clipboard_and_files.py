"""What is taken away from the screen: a file in the user's state folder, and the clipboard's own programs.

Bounds: MOST_FILES files, the oldest go; a clipboard program that does not answer is left after PATIENCE_S.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake
from trcvtui.files import reason_of, write_file

MOST_FILES: Final = 100
PATIENCE_S: Final = 2.0
FOLDER: Final = "yanks"


def state_folder() -> Path:
    """Return where this program keeps what the user did not give a name."""
    from platformdirs import user_state_path  # read when first asked for

    return user_state_path("trcvtui", appauthor=False) / FOLDER


def keep(text: str, kind: str, suffix: str) -> Path:
    """Write a text into a new file of the state folder; raise UserError."""
    folder = state_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as failed:
        raise mistake(kind, f"{folder}: {reason_of(failed)}", "a folder that can be made") from None
    stamp = time.strftime("%Y%m%d-%H%M%S")
    names = (f"{kind}-{stamp}{f'-{number}' if number > 1 else ''}{suffix}" for number in range(1, 1000))
    path = next((folder / name for name in names if not (folder / name).exists()), folder)
    write_file(path, text, kind, is_new=True)
    _forget_the_oldest(folder)
    return path


def _forget_the_oldest(folder: Path) -> None:
    kept = sorted(
        (path for path in folder.iterdir() if path.is_file()), key=lambda path: path.stat().st_mtime
    )
    for path in kept[:-MOST_FILES]:
        path.unlink(missing_ok=True)


def _programs() -> Iterator[tuple[str, ...]]:
    """Yield the command lines that may take a text for the clipboard here, the likeliest first."""
    if sys.platform == "darwin":
        yield ("pbcopy",)
    elif sys.platform == "win32":
        yield ("clip",)
    else:
        if os.environ.get("WAYLAND_DISPLAY"):
            yield ("wl-copy",)
        if os.environ.get("DISPLAY"):
            yield ("xclip", "-selection", "clipboard")
            yield ("xsel", "--clipboard", "--input")


def to_clipboard(text: str) -> str:
    """Hand a text to a clipboard program; return its name, "" where there is none that takes it."""
    encoding = "utf-16" if sys.platform == "win32" else "utf-8"
    for name, *arguments in _programs():
        program = shutil.which(name)
        if program is not None and _gives(program, arguments, text.encode(encoding)):
            return name
    return ""


def _gives(program: str, arguments: list[str], content: bytes) -> bool:
    # Its output goes nowhere: xclip stays behind as the owner of the selection and would hold a pipe open.
    try:
        done = subprocess.run(
            [program, *arguments],
            input=content,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=PATIENCE_S,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return False
    return done.returncode == 0
