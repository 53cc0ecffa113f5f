"""A receiver of messages to the PLC, of a project or of a type."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

from trcvtui.diagnosis.line_facts import LineFacts

if TYPE_CHECKING:
    from trcvtui.blocks.conditions import Condition
    from trcvtui.udt.layout.rules import LayoutRules
    from trcvtui.udt.types import Type

NEVER_NS: Final = 1 << 62
LOOPBACK: Final = b"\x7f"  # of a project on one machine: its line has other addresses


class Receiver(NamedTuple):
    """A block that receives, or a type. A job needs `need` bytes, or has room for `need` bytes at most.

    The block had this `need` from `since_ns` to `until_ns` (UTC).
    """

    instance: str
    connect: str
    need: int
    adhoc: bool = False
    is_datagram: bool = False
    is_whole: bool = False  # the connection keeps messages whole: ISO-on-TCP
    interval_ns: int = 0
    active: bool = False
    local_port: int = 0
    remote_port: int = 0
    is_only: bool = False  # the only one of its project
    data: str = ""
    type_name: str = ""
    type: Type | None = None
    rules: LayoutRules | None = None
    sender: str = ""  # the likely layout of a sender of the type
    marks: tuple[bytes, bytes] = (b"", b"")
    is_serial: bool = False
    room: int = 0  # of DATA; 0: not known
    own_address: bytes = b""  # of the PLC; b"": any
    partner_address: bytes = b""
    since_ns: int = 0
    until_ns: int = NEVER_NS
    has_reset: bool = False  # its block has COM_RST
    static: str = "ADHOC=0 "  # before a LEN; "": no ADHOC pin, LEN 65535 is ad hoc
    words: Mapping[Condition, int] = {}  # STATUS of what a cause leads to
    is_secure: bool = False  # TLS: its bytes are not on the wire
    ports: frozenset[int] = frozenset()  # of its project, also of CONNECTs without a receiver

    def fits(self, line: LineFacts) -> bool:
        if self.is_serial or line.protocol == "serial":
            return self.is_serial and line.protocol == "serial"
        if (line.protocol == "udp") != self.is_datagram and not (self.is_only and not self.connect):
            return False
        if self.connect == "":
            return True
        if line.connect is not None:
            return self.connect == line.connect
        if self.active:
            is_there = (
                self.partner_address in (b"", line.partner_end[0]) or self.partner_address[:1] == LOOPBACK
            )
            return is_there and self.remote_port in (line.partner_end[1], 0)
        if line.plc_calls:
            return self.remote_port == line.partner_end[1]
        return self.local_port in (line.plc_end[1], 0)

    def has_end_of(self, line: LineFacts) -> bool:
        """Return whether an address and a port of its CONNECT are in the conversation, at whichever end."""
        (plc, plc_port), (partner, partner_port) = line.plc_end, line.partner_end
        has_port = {plc_port, partner_port} & ({self.local_port, self.remote_port} - {0})
        return bool(has_port) and bool({plc, partner} & ({self.own_address, self.partner_address} - {b""}))
