"""A laid-out type in the language of another tool: name -> writer, one line each.

Rule: a writer sees the layout, never the declaration alone, so that what it writes has its very offsets.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Final, NamedTuple

from trcvtui.errors import mistake
from trcvtui.udt.layout.layout import Layout

PORTS: Final = range(1, 65_536)


class Export(NamedTuple):
    """One language: what it is for, the suffix of its files, the module that writes it."""

    title: str
    suffix: str
    module: str


EXPORTS: Final = {
    "lua": Export("Wireshark dissector", ".lua", "lua"),
    "ksy": Export("Kaitai Struct", ".ksy", "ksy"),
    "imhex": Export("ImHex pattern", ".hexpat", "imhex"),
}


def check(to: str, port: int | None = None) -> None:
    """Raise UserError for an unknown language, or a port that is none."""
    if to not in EXPORTS:
        raise mistake("--to", f"'{to}'", "one of " + ", ".join(EXPORTS))
    if port is not None and to != "lua":
        raise mistake("--port", f"one for {to}", "one for lua only")
    if port is not None and port not in PORTS:
        raise mistake("--port", str(port), "a port from 1 to 65535")


def export(layout: Layout, to: str, port: int | None = None) -> str:
    """Return the type in that language; raise UserError as `check` does, or for a type without a value."""
    check(to, port)
    write: Callable[..., str] = import_module(f"{__name__}.{EXPORTS[to].module}").write
    return write(layout) if port is None else write(layout, port)
