"""The themes of the bench: a calm dark one (the default), a light one, one in the terminal's 16 colours."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from rich.color import Color as RichColor
from rich.style import Style
from textual.color import Color
from textual.theme import BUILTIN_THEMES, Theme
from textual.widget import Widget

# Textual's partial style ignores transparency and `auto` colours. Here both are blended over the background
# of the row: a dimmed word stays dimmed on a cursor. Native 16 colours cannot blend: there, pale is `dim`.
# The classes belong to the app: those of a screen or a pane would be computed again whenever it is styled.

# fmt: off
STYLE_NAMES: Final = (
    "dim", "faint", "strong", "label", "key",                    # weights of text
    "on", "busy", "done", "error", "warn",                       # lamps and judgements
    "cursor", "cursor-blurred", "hover", "link", "byte-cursor",  # what is pointed at
    "run", "hold", "stop",                                       # chips of the header
    "null", "printable", "space", "control", "high", "ghost",    # classes of bytes
    "changed", "match",                                          # bytes that differ, bytes that were sought
    "prefix", "suffix",                                          # the marks of a frame
)
# fmt: on
PALE_ALPHA: Final = 0.75


def component_class(name: str) -> str:
    """Return the component class of a style; its rule is in styles.tcss."""
    return f"bench--{name}"


COMPONENT_CLASSES: Final = {component_class(name) for name in STYLE_NAMES}


def compose_style(widget: Widget, names: Iterable[str]) -> Style:
    """Return the widget's style with these styles on top; a later style overrides an earlier one."""
    _, _, background, ink = widget.colors
    auto, text = False, widget.text_style
    for name in names:
        component = widget.app.get_component_styles(component_class(name))
        if component.has_rule("background") and component.background.a > 0:
            background = background + component.background
        if component.has_rule("color"):
            ink, auto = component.color, component.auto_color
        text = text + component.text_style
    return text + _colour_style(background, ink, auto)


def _colour_style(background: Color, ink: Color, auto: bool) -> Style:
    if ink.ansi is not None:
        return Style(color=ink.rich_color, bgcolor=_or_default(background), dim=ink.a < PALE_ALPHA or None)
    if auto:
        ink = background.get_contrast_text(ink.a)
    return Style(color=(background + ink).rich_color, bgcolor=_or_default(background))


def _or_default(background: Color) -> RichColor | None:
    return background.rich_color if background.a > 0 else None


def _variables(muted: int, pale: int, borders: tuple[str, str], bars: tuple[str, str, str]) -> dict[str, str]:
    """Return the colours that Textual would mix itself if the theme did not set them."""
    backs = ("background", "background-hover", "background-active", "corner-color")
    return {
        "text-muted": f"auto {muted}%",
        "text-disabled": f"auto {pale}%",
        "border": borders[0],
        "border-blurred": borders[1],
        "scrollbar": bars[0],
        "scrollbar-hover": bars[1],
        "scrollbar-active": borders[0],
        **{f"scrollbar-{back}": bars[2] for back in backs},
    }


DARK_THEME: Final = Theme(
    name="bench-dark",
    primary="#6cb6d9",
    secondary="#b48ead",
    warning="#e5b567",
    error="#e8828b",
    success="#8fc98a",
    accent="#f0a868",
    foreground="#d6dde6",
    background="#11151b",
    surface="#161b22",
    panel="#1e252e",
    dark=True,
    variables=_variables(66, 53, ("#6cb6d9", "#3d4957"), ("#4a5868", "#5d6d80", "#161b22")),
)
LIGHT_THEME: Final = Theme(
    name="bench-light",
    primary="#18597f",
    secondary="#74447f",
    warning="#7d5200",
    error="#9f2632",
    success="#236127",
    accent="#934500",
    foreground="#1f2933",
    background="#f3f1ec",
    surface="#fbfaf7",
    panel="#e9e6df",
    dark=False,
    variables=_variables(72, 57, ("#18597f", "#b5afa1"), ("#a8a294", "#8d8778", "#fbfaf7")),
)
# The terminal's own 16 colours on its own background: for consoles that have no more, and under NO_COLOR.
ANSI_THEME: Final = Theme(
    name="bench-ansi",
    primary="ansi_blue",
    secondary="ansi_magenta",
    warning="ansi_yellow",
    error="ansi_red",
    success="ansi_green",
    accent="ansi_cyan",
    foreground="ansi_default",
    background="ansi_default",
    surface="ansi_default",
    panel="ansi_default",
    boost="ansi_default",
    dark=True,
    ansi=True,
    luminosity_spread=0.15,
    text_alpha=0.95,
    variables={
        "ansi-background": "ansi_black",
        "ansi-foreground": "ansi_white",
        "border": "ansi_cyan",
        "border-blurred": "ansi_bright_black",
        "block-cursor-foreground": "ansi_black",
        "block-cursor-background": "ansi_white",
        "input-cursor-background": "ansi_white",
        "input-cursor-foreground": "ansi_black",
        "input-cursor-text-style": "none",
        "input-selection-background": "ansi_bright_blue",
        "input-selection-foreground": "ansi_black",
        "screen-selection-background": "ansi_bright_blue",
        "screen-selection-foreground": "ansi_black",
    },
)
OWN_THEMES: Final = {"dark": DARK_THEME, "light": LIGHT_THEME, "ansi": ANSI_THEME}
THEMES: Final = {**OWN_THEMES, **BUILTIN_THEMES}

BACKGROUND_NAMES: Final = ("surface", "background", "panel")
# Contrast to 1. WCAG 2 asks 4.5 of small text, and a cursor takes some of it; 3 of the frame with the focus.
CONTRASTS: Final = {
    "foreground": 7.0,
    "text-muted": 6.0,
    **dict.fromkeys(("text-disabled", "primary", "secondary", "accent", "warning", "error", "success"), 5.5),
    "border": 3.0,
    **dict.fromkeys(("border-blurred", "scrollbar"), 1.8),
}


def readable_colours(theme: Theme, colours: dict[str, str]) -> dict[str, str]:
    """Return some colours of a Textual theme, changed where words or frames would be hard to see."""
    if theme in OWN_THEMES.values():
        return {}
    if theme.ansi:
        return {"border-blurred": "ansi_bright_black"}
    papers = [Color.parse(colours[name]) for name in BACKGROUND_NAMES]
    ink = Color.parse(colours["foreground"])
    pale = {"text-muted": 0.2, "text-disabled": 0.35}
    colours = colours | {name: ink.blend(papers[0], part, 1.0).hex for name, part in pale.items()}
    return {
        name: _adjust_ink(papers, Color.parse(colours[name]), least).hex for name, least in CONTRASTS.items()
    }


def _adjust_ink(papers: list[Color], ink: Color, least: float) -> Color:
    """Return the ink, moved towards black or white until its contrast to each paper is `least` or more."""
    end = papers[0].get_contrast_text(1.0)
    steps = (ink.blend(end, step / 20, 1.0) for step in range(20))
    return next((one for one in steps if min(contrast(one, paper) for paper in papers) >= least), end)


def contrast(one: Color, other: Color) -> float:
    """Return the contrast of two colours, 1 to 21."""
    dark, bright = sorted(_luminance(colour) for colour in (one, other))
    return (bright + 0.05) / (dark + 0.05)


def _luminance(colour: Color) -> float:
    linear = (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in colour.normalized)
    return sum(weight * each for weight, each in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
