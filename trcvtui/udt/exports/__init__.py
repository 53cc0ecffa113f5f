"""A laid-out type in the language of another tool, one row each: name -> title, extension, writer.

Rules: a writer sees the layout, so that what it writes has its very offsets. Help, the lab and docs/udt.md
ask the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from trcvtui.errors import mistake
from trcvtui.udt.layout.layout import Layout

PORTS: Final = range(1, 65_536)


class Export(NamedTuple):
    """One language: its name, the tool and what it reads, the extension of its files, what writes it."""

    name: str
    title: str
    extension: str
    write: Callable[[Layout, int | None], str]
    takes_port: bool = False


# A writer is imported when it is first asked for.


def _lua(layout: Layout, port: int | None) -> str:
    from trcvtui.udt.exports.lua import write

    return write(layout, port)


def _ksy(layout: Layout, _: int | None) -> str:
    from trcvtui.udt.exports.ksy import write

    return write(layout)


def _imhex(layout: Layout, _: int | None) -> str:
    from trcvtui.udt.exports.imhex import write

    return write(layout)


EXPORTS: Final = {
    row.name: row
    for row in (
        Export("lua", "Wireshark dissector", ".lua", _lua, takes_port=True),
        Export("ksy", "Kaitai Struct", ".ksy", _ksy),
        Export("imhex", "ImHex pattern", ".hexpat", _imhex),
    )
}


def check(to: str, port: int | None = None) -> None:
    """Raise UserError for an unknown language, or a port that is none."""
    if to not in EXPORTS:
        raise mistake("--to", f"'{to}'", "one of " + ", ".join(EXPORTS))
    if port is not None and not EXPORTS[to].takes_port:
        takers = ", ".join(row.name for row in EXPORTS.values() if row.takes_port)
        raise mistake("--port", f"one for {to}", f"one for {takers} only")
    if port is not None and port not in PORTS:
        raise mistake("--port", str(port), "a port from 1 to 65535")


def export(layout: Layout, to: str, port: int | None = None) -> str:
    """Return the type in that language; raise UserError as `check` does, or for a type without a value."""
    check(to, port)
    return EXPORTS[to].write(layout, port)
