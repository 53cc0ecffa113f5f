"""The two looks of the bench: a calm dark one, the default, and its light twin."""

from __future__ import annotations

from typing import Final

from textual.theme import Theme

DARK: Final = Theme(
    name="bench-dark",
    primary="#6cb6d9",
    secondary="#b48ead",
    warning="#e5b567",
    error="#e0707a",
    success="#8fc98a",
    accent="#f0a868",
    foreground="#d6dde6",
    background="#11151b",
    surface="#161b22",
    panel="#1e252e",
    dark=True,
    variables={
        "border": "#6cb6d9",
        "border-blurred": "#323c48",
        "scrollbar": "#323c48",
        "scrollbar-hover": "#4a5868",
        "scrollbar-active": "#6cb6d9",
        "scrollbar-background": "#161b22",
        "scrollbar-background-hover": "#161b22",
        "scrollbar-background-active": "#161b22",
        "scrollbar-corner-color": "#161b22",
    },
)
LIGHT: Final = Theme(
    name="bench-light",
    primary="#1f6f9c",
    secondary="#7d4f8b",
    warning="#a06a00",
    error="#b3343f",
    success="#2f7d32",
    accent="#b35a00",
    foreground="#1f2933",
    background="#f3f1ec",
    surface="#fbfaf7",
    panel="#e9e6df",
    dark=False,
    variables={
        "border": "#1f6f9c",
        "border-blurred": "#c9c4b8",
        "scrollbar": "#c9c4b8",
        "scrollbar-hover": "#a8a294",
        "scrollbar-active": "#1f6f9c",
        "scrollbar-background": "#fbfaf7",
        "scrollbar-background-hover": "#fbfaf7",
        "scrollbar-background-active": "#fbfaf7",
        "scrollbar-corner-color": "#fbfaf7",
    },
)
