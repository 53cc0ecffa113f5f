"""The looks of the bench: a calm dark one (the default), its light twin, one of the terminal's 16 colours."""

from __future__ import annotations

from typing import Final

from textual.theme import Theme

DARK: Final = Theme(
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
    variables={
        "text-muted": "auto 66%",
        "text-disabled": "auto 53%",
        "border": "#6cb6d9",
        "border-blurred": "#3d4957",
        "scrollbar": "#4a5868",
        "scrollbar-hover": "#5d6d80",
        "scrollbar-active": "#6cb6d9",
        "scrollbar-background": "#161b22",
        "scrollbar-background-hover": "#161b22",
        "scrollbar-background-active": "#161b22",
        "scrollbar-corner-color": "#161b22",
    },
)
LIGHT: Final = Theme(
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
    variables={
        "text-muted": "auto 72%",
        "text-disabled": "auto 57%",
        "border": "#18597f",
        "border-blurred": "#b5afa1",
        "scrollbar": "#a8a294",
        "scrollbar-hover": "#8d8778",
        "scrollbar-active": "#18597f",
        "scrollbar-background": "#fbfaf7",
        "scrollbar-background-hover": "#fbfaf7",
        "scrollbar-background-active": "#fbfaf7",
        "scrollbar-corner-color": "#fbfaf7",
    },
)
# The terminal's own 16 colours on its own background: for consoles that have no more, and under NO_COLOR.
ANSI: Final = Theme(
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
THEMES: Final = {"dark": DARK, "light": LIGHT, "ansi": ANSI}
