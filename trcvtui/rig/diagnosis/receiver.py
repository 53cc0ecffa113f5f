"""What takes the messages to the PLC, of a project or of a type."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from trcvtui.records import NamedTuple
from trcvtui.rig.diagnosis.line_facts import LineFacts

if TYPE_CHECKING:
    from trcvtui.blocks.conditions import Condition
    from trcvtui.udt.layout.rules import LayoutRules
    from trcvtui.udt.types import Type

NEVER_NS: Final = 1 << 62


class Receiver(NamedTuple):
    """What takes the messages to the PLC: how many bytes a job wants, or has room for (`need`).

    Of a run: until when it took so many (UTC).
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
    marks: tuple[bytes, bytes] = (b"", b"")
    is_serial: bool = False
    room: int = 0  # of DATA; 0: not known
    own_address: bytes = b""  # of the PLC; b"": any
    partner_address: bytes = b""
    until_ns: int = NEVER_NS
    words: Mapping[Condition, int] = {}  # STATUS of what a cause leads to

    def fits(self, line: LineFacts) -> bool:
        """Return whether the conversation is this receiver's."""
        if self.is_serial or line.protocol == "serial":
            return self.is_serial and line.protocol == "serial"
        if (line.protocol == "udp") != self.is_datagram and not (self.is_only and not self.connect):
            return False
        if self.connect == "":
            return True
        if line.connect is not None:
            return self.connect == line.connect
        if self.active or line.plc_calls:
            return (self.remote_port or None) in (line.partner_end[1], None)
        return self.local_port in (line.plc_end[1], 0)

    def has_address_of(self, line: LineFacts) -> bool:
        """Return whether one end of the conversation is at an address of its CONNECT."""
        addresses = {line.plc_end[0], line.partner_end[0]} - {b""}
        return self.own_address in addresses or self.partner_address in addresses
