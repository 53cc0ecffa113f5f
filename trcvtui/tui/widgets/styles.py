"""Component classes to terminal styles: several classes over one background, in any theme.

Textual's partial style forgets transparency and `auto` colours; here both are blended over the background of
the row, so that a dimmed word stays dimmed on a cursor. Native 16 colours cannot blend: there, pale is `dim`.
The classes belong to the screen: classes of a pane would be computed again for every pane there is.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from rich.color import Color as RichColor
from rich.style import Style
from textual.color import Color
from textual.widget import Widget

# fmt: off
STYLE_NAMES: Final = (
    "dim", "faint", "strong", "label", "key",                    # weights of text
    "on", "busy", "done", "error", "warn", "glow",               # lamps and judgements
    "cursor", "cursor-blurred", "hover", "link", "byte-cursor",  # what is pointed at
    "run", "hold", "stop",                                       # chips of the header
    "null", "printable", "space", "control", "high", "ghost",    # classes of bytes
    "changed", "match",                                          # bytes that differ, bytes that were sought
    "prefix", "suffix",                                          # the marks of a frame
)
# fmt: on
PALE: Final = 0.75


def component_class(name: str) -> str:
    """Return the component class of a style; its rule stands in styles.tcss."""
    return f"bench--{name}"


COMPONENT_CLASSES: Final = {component_class(name) for name in STYLE_NAMES}


def composed(widget: Widget, names: Iterable[str]) -> Style:
    """Return the style of the widget with these styles on top, the last one winning."""
    _, _, background, ink = widget.colors
    auto, text = False, widget.text_style
    for name in names:
        component = widget.screen.get_component_styles(component_class(name))
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
