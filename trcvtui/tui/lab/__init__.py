"""The UDT lab on the screen; here only which lines of the prompt are for it: known before it is loaded."""

from __future__ import annotations

LAB, UDT = "lab", "udt"


def is_for_lab(line: str) -> bool:
    return line.strip().partition(" ")[0] in (LAB, UDT)
