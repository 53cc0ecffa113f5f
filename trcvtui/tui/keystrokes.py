"""Keys in the order in which they were typed, each obeyed before the next one is looked at.

Textual hands a key to the widget that has the focus when the key arrives, and that widget's queue
hands it on. A key that moves the focus is then overtaken by those typed after it: text meant for the
prompt would toggle pins. Here, on the bench, a key acts at once.
"""

from __future__ import annotations

from textual import events
from textual.app import App
from textual.widgets import Input


async def obey(app: App[None], event: events.Key) -> bool:
    """Type the key into the field that has the focus, or do what it is bound to; False: neither."""
    app.app_focus = True
    field = app.focused
    if isinstance(field, Input) and event.is_printable and event.character:
        field.replace(event.character, *field.selection)
        return True
    bound = app.screen.active_bindings.get(event.key)
    return bound is not None and await app.run_action(bound.binding.action, bound.node)
