"""A type exported to the language of another tool, with exactly the offsets of its layout."""

from __future__ import annotations

from typing import Final

from trcvtui.errors import mistake
from trcvtui.udt.layout.layout import Layout

LANGUAGES: Final = {"lua": "Wireshark dissector"}  # by name, which is also the extension of the file: title


def check_arguments(to: str, port: int | None = None) -> None:
    """Raise UserError for an unknown language or port."""
    if to not in LANGUAGES:
        raise mistake("--to", f"'{to}'", "one of " + ", ".join(LANGUAGES))
    if port is not None and port not in range(1, 65_536):
        raise mistake("--port", str(port), "a port from 1 to 65535")


def export(layout: Layout, to: str, port: int | None = None) -> str:
    """Return the type in language `to`; raise UserError for a bad argument, or a type without values."""
    check_arguments(to, port)
    from trcvtui.udt.exports.lua import write_dissector

    return write_dissector(layout, port)
