"""The UDT lab on the screen. This file only recognizes the lab's prompt lines, before the lab is loaded."""

from __future__ import annotations

LAB, UDT = "lab", "udt"


def is_for_lab(line: str) -> bool:
    return line.strip().partition(" ")[0] in (LAB, UDT)
