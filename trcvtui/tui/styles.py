"""Component classes to terminal styles: several classes over one background, in any theme.

Textual's partial style forgets transparency and `auto` colours; here both are blended over the background of
the row, so that a dimmed word stays dimmed on a cursor. Native 16 colours cannot blend: there, pale is `dim`.
"""

from __future__ import annotations

from typing import Final

from rich.color import Color as RichColor
from rich.style import Style
from textual.color import Color
from textual.widget import Widget

PALE: Final = 0.75


def composed(widget: Widget, names: tuple[str, ...]) -> Style:
    """Return the style of the widget with these component classes on top, the last one winning."""
    _, _, background, ink = widget.colors
    auto, text = False, widget.text_style
    for name in names:
        component = widget.get_component_styles(name)
        if component.has_rule("background") and component.background.a > 0:
            background = background + component.background
        if component.has_rule("color"):
            ink, auto = component.color, component.auto_color
        text = text + component.text_style
    return text + _colours(background, ink, auto)


def _colours(background: Color, ink: Color, auto: bool) -> Style:
    if ink.ansi is not None:
        return Style(color=ink.rich_color, bgcolor=_or_default(background), dim=ink.a < PALE or None)
    if auto:
        ink = background.get_contrast_text(ink.a)
    return Style(color=(background + ink).rich_color, bgcolor=_or_default(background))


def _or_default(background: Color) -> RichColor | None:
    return background.rich_color if background.a > 0 else None
