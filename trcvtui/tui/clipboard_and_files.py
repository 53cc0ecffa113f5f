"""What is taken away from the screen: a file in the user's state folder, and the clipboard's own programs.

Bounds: MOST_FILES files, the oldest go; a clipboard program that does not answer is left after PATIENCE_S.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from textual.app import App

from trcvtui import paths
from trcvtui.errors import UserError, mistake
from trcvtui.files import reason_of, write_file
from trcvtui.tui.copy_formats import CopyFormat
from trcvtui.wording import count

MOST_FILES: Final = 100
CLIPBOARD_TIMEOUT_S: Final = 2.0
YANK_FOLDER: Final = "yanks"


def save_text(text: str, kind: str, suffix: str) -> Path:
    """Write a text into a new file of the state folder; raise UserError."""
    folder = paths.state_folder() / YANK_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as failed:
        raise mistake(kind, f"{folder}: {reason_of(failed)}", "a folder that can be made") from None
    stamp = time.strftime("%Y%m%d-%H%M%S")
    names = (f"{kind}-{stamp}{f'-{number}' if number > 1 else ''}{suffix}" for number in range(1, 1000))
    path = next((folder / name for name in names if not (folder / name).exists()), folder)
    write_file(path, text, kind, is_new=True)
    _delete_oldest(folder)
    return path


def _delete_oldest(folder: Path) -> None:
    kept = sorted(
        (path for path in folder.iterdir() if path.is_file()), key=lambda path: path.stat().st_mtime
    )
    for path in kept[:-MOST_FILES]:
        path.unlink(missing_ok=True)


def _clipboard_programs() -> Iterator[tuple[str, ...]]:
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


def copy_by_program(text: str) -> str:
    """Hand a text to a clipboard program; return its name, "" where there is none that takes it."""
    encoding = "utf-16" if sys.platform == "win32" else "utf-8"
    for name, *arguments in _clipboard_programs():
        program = shutil.which(name)
        if program is not None and _run_clipboard_program(program, arguments, text.encode(encoding)):
            return name
    return ""


def _run_clipboard_program(program: str, arguments: list[str], content: bytes) -> bool:
    # Its output goes nowhere: xclip stays as the owner of the selection and would hold a pipe open.
    try:
        done = subprocess.run(
            [program, *arguments],
            input=content,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=CLIPBOARD_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return False
    return done.returncode == 0


MOST_OSC52: Final = 100_000  # characters; terminals drop an OSC 52 that is longer, or lose their way

Notify = Callable[[str], None]


async def yank(app: App[None], form: CopyFormat, text: str, tell: Notify, complain: Notify) -> None:
    """Put a text on the clipboard by each way there is, and always into a file; tell where it is."""
    ways, trouble = [], ""
    if len(text) <= MOST_OSC52:
        App.copy_to_clipboard(app, text)  # the program comes next, and is named
        ways.append("to the terminal (OSC 52)")
    program = await asyncio.to_thread(copy_by_program, text)
    if program:
        ways.append(f"to {program}")
    try:
        ways.append(f"to {await asyncio.to_thread(save_text, text, 'yank', form.suffix)}")
    except UserError as refused:
        trouble = f"no file was written: {refused}"
    way = ", ".join(ways) or "nowhere"
    told = f"yanked {form.name}, {count(len(text), 'character')}: {way}"
    complain(f"{told}; {trouble}") if trouble else tell(told)


def screenshot(app: App[None], tell: Notify, complain: Notify) -> None:
    if app.is_web:
        app.deliver_screenshot()
        return
    try:
        path = save_text(app.export_screenshot(), "screen", ".svg")
    except UserError as refused:
        complain(f"no picture of the screen was written: {refused}")
        return
    tell(f"the screen as SVG: {path}")
