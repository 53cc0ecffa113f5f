"""The keys of the lab: what its last line names, and every action by name, for palette and bindings."""

from __future__ import annotations

from typing import Final

KEYS: Final = (
    ("e", "byte order"), ("f", "fit"), ("c", "cure"), ("o p", "profile"), ("s", "STRING"), ("x", "swap"),
    (":", "command"), ("?", "help"), ("esc", "leave"),
)  # fmt: skip
ACTIONS: Final = {
    "e": "order('theirs')", "f": "fit", "c": "cure", "o p": "profile('theirs')", "s": "text('theirs')",
    "x": "exchange", "b": "bytes", "z": "fold_all", "y": "yank", "d": "language", ":": "ask('')",
    "?": "help", "esc": "leave",
}  # fmt: skip
# Title, what stands behind "key", action: the palette and the tests draw from it.
COMMANDS: Final = (
    ("Choose the type", "t", "type"),
    ("Choose our profile", "o", "profile('ours')"),
    ("Choose their profile", "p", "profile('theirs')"),
    ("Other byte order for theirs", "e", "order('theirs')"),
    ("Other byte order for ours", "E", "order('ours')"),
    ("Next STRING form for theirs", "s", "text('theirs')"),
    ("Next STRING form for ours", "S", "text('ours')"),
    ("Exchange ours and theirs", "x", "exchange"),
    ("Choose the bytes", "b", "bytes"),
    ("Which profile fits?", "f", "fit"),
    ("Cure: type for our side, for the sender, swap code", "c", "cure"),
    ("Cure in ST or SCL", "d", "language"),
    ("Next difference", "n", "difference(1)"),
    ("Fold everything, open everything", "z", "fold_all"),
    ("Open a type file", "O", "ask('udt open ')"),
    ("Hex to look at", "X", "ask('udt hex ')"),
    ("Constants that are unknown", "C", "constants"),
    ("Problems in the type files", "w", "problems"),
    ("Take a changed type into DATA", "R", "into_data"),
    ("Let DATA lie as theirs", "V", "data_as_theirs"),
    ("Yank", "y", "yank"),
    ("Command line", ":", "ask('udt ')"),
    ("Help", "?", "help"),
    ("Leave the lab", "esc", "leave"),
)
