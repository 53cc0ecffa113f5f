"""From the screen into the user's hands: a yank, a picture of the screen, the mouse."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from textual.app import App

from trcvtui.errors import UserError
from trcvtui.tui.copying.clipboard_and_files import keep, to_clipboard
from trcvtui.tui.copying.copy_formats import Format
from trcvtui.tui.formatting import count

MOST_FOR_TERMINAL: Final = 100_000  # characters; terminals drop an OSC 52 that is longer, or lose their way
# Only whether it reports, not how: the driver knows in which of the modes it asked for places.
MOUSE_OFF: Final = "\x1b[?1000l\x1b[?1003l"
MOUSE_ON: Final = "\x1b[?1000h\x1b[?1003h"

Tell = Callable[[str], None]


async def take(app: App[None], form: Format, text: str, tell: Tell, complain: Tell) -> None:
    """Put a text on the clipboard by each way there is, and always into a file; tell where it is."""
    ways, trouble = [], ""
    if len(text) <= MOST_FOR_TERMINAL:
        app.copy_to_clipboard(text)
        ways.append("to the terminal (OSC 52)")
    program = await asyncio.to_thread(to_clipboard, text)
    if program:
        ways.append(f"to {program}")
    try:
        ways.append(f"to {await asyncio.to_thread(keep, text, 'yank', form.suffix)}")
    except UserError as refused:
        trouble = f"no file was written: {refused}"
    way = ", ".join(ways) or "nowhere"
    told = f"yanked {form.name}, {count(len(text), 'character')}: {way}"
    complain(f"{told}; {trouble}") if trouble else tell(told)


def take_picture(app: App[None], tell: Tell, complain: Tell) -> None:
    """Save the screen as SVG and tell where; in a browser, hand it to the browser."""
    if app.is_web:
        app.deliver_screenshot()
        return
    try:
        path = keep(app.export_screenshot(), "screen", ".svg")
    except UserError as refused:
        complain(f"no picture of the screen was written: {refused}")
        return
    tell(f"the screen as SVG: {path}")


def give_mouse(app: App[None], to_terminal: bool) -> None:
    """Let the terminal have the mouse for its own selection, or take it back."""
    driver = app._driver  # Textual has no public way to it
    if driver is not None:
        driver.write(MOUSE_OFF if to_terminal else MOUSE_ON)
        driver.flush()
