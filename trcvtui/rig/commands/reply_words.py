"""What a reply rule looks for in the bytes that a peer receives: one frozen class a kind of match."""

from __future__ import annotations

from dataclasses import dataclass, field

from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout import Layout


@dataclass(frozen=True, slots=True)
class Contains:
    """`contains hex 05`: these bytes anywhere in the stream, also when they come in pieces."""

    payload: bytes
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class Starts:
    """`starts hex 01 02`: the first bytes of the connection, or the first that come in a scan."""

    payload: bytes
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class Matches:
    """`regex "id=[0-9]+;"`: a pattern over the stream, found with its last byte; as between the quotes."""

    pattern: str


@dataclass(frozen=True, slots=True)
class FieldIs:
    """`field Telegram.id = 7`: the stream cut into Telegrams from its beginning, and a member of one."""

    type_name: str
    path: str
    value: Value
    layout: Layout = field(compare=False, repr=False)


Match = Contains | Starts | Matches | FieldIs
