"""Copies of what the screen shows: in a file of the user's state folder, and on the clipboard.

Bounds: MOST_FILES files; the oldest is deleted. A clipboard program is killed after CLIPBOARD_TIMEOUT_S.
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
    """Write a new file in the state folder; return its path; raise UserError."""
    folder = paths.state_folder() / YANK_FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as failed:
        raise mistake(kind, f"{folder}: {reason_of(failed)}", "a folder that can be created") from None
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
    """Give a text to the first clipboard program that takes it. Return the program's name, or ""."""
    encoding = "utf-16" if sys.platform == "win32" else "utf-8"
    for name, *arguments in _clipboard_programs():
        program = shutil.which(name)
        if program is not None and _run_clipboard_program(program, arguments, text.encode(encoding)):
            return name
    return ""


def _run_clipboard_program(program: str, arguments: list[str], content: bytes) -> bool:
    # No pipe for its output: xclip keeps running as the owner of the selection and would hold it open.
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


MOST_OSC52: Final = 100_000  # characters; terminals drop a longer OSC 52, or are confused by it

Notify = Callable[[str], None]


async def yank(app: App[None], form: CopyFormat, text: str, tell: Notify, complain: Notify) -> None:
    """Copy a text to each clipboard that works, and always into a file. `tell` gets these places."""
    ways, trouble = [], ""
    if len(text) <= MOST_OSC52:
        App.copy_to_clipboard(app, text)  # not the app's own: that one runs a program, too
        ways.append("to the terminal (OSC 52)")
    program = await asyncio.to_thread(copy_by_program, text)
    if program:
        ways.append(f"to {program}")
    try:
        ways.append(f"to {await asyncio.to_thread(save_text, text, 'yank', form.suffix)}")
    except UserError as refused:
        trouble = f"no file was written: {refused}"
    way = ", ".join(ways) or "nowhere"
    outcome = f"yanked {form.name}, {count(len(text), 'character')}: {way}"
    complain(f"{outcome}; {trouble}") if trouble else tell(outcome)


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
