"""Keys in the order in which they were typed, each obeyed before the next one is looked at, on every screen.

Textual hands a key to the widget that has the focus when the key arrives, and that widget's queue
hands it on. A letter acts in that queue, but Backspace, enter and tab only when they have gone all the way
up: they are overtaken by what was typed after them. Here a key acts at once, and a screen that was just
opened is waited for.

Rule: whatever takes text is a TypedField, or a screen that is a TakesLetters; nothing else reads letters.
"""

from __future__ import annotations

import asyncio
from typing import Any, Protocol, runtime_checkable

from textual import events
from textual.app import App
from textual.widgets import Input


class TypedField(Input):
    """One line to type into, without a frame. Nothing is selected when it gets the focus: that comes late."""

    def __init__(self, value: str = "", **settings: Any) -> None:
        super().__init__(value=value, compact=True, select_on_focus=False, **settings)

    async def action_submit(self) -> None:
        """Take what stands there now: a key typed after enter is not part of it."""
        raise NotImplementedError

    async def follow(self) -> None:
        """Do what must be done about a change before the next key, such as laying out other fields."""


@runtime_checkable
class TakesLetters(Protocol):
    """A screen that takes letters without a field."""

    def take_letter(self, letter: str) -> None:
        """Take one printable character."""


async def obey(app: App[None], event: events.Key | events.Paste) -> bool:
    """Type the key into the field that has the focus, or do what it is bound to; False: neither."""
    app.app_focus = True
    stands: asyncio.Event = app.screen._mounted_event
    await stands.wait()  # opened by the key before: its fields are there with this
    field = app.focused
    if not isinstance(field, TypedField):
        return await _act(app, event)
    before = field.value
    acted = await _act(app, event)
    if field.is_attached and field.value != before:
        await field.follow()
    return acted


async def _act(app: App[None], event: events.Key | events.Paste) -> bool:
    field, screen = app.focused, app.screen
    if isinstance(event, events.Paste):
        if isinstance(field, Input) and event.text:
            field.replace(event.text.splitlines()[0], *field.selection)
        return isinstance(field, Input)
    if event.is_printable and event.character:
        if isinstance(field, Input):
            field.replace(event.character, *field.selection)
            return True
        if isinstance(screen, TakesLetters):
            screen.take_letter(event.character)
            return True
    bound = screen.active_bindings.get(event.key)
    return bound is not None and await app.run_action(bound.binding.action, bound.node)
