"""The times of a recording's packets, read during the replay. A block reads a packet's bytes later."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final

from trcvtui.capture.command import merge_packets
from trcvtui.capture.plc_end import address_text
from trcvtui.capture.reassembly import ConversationEvent, Conversations, SegmentKind, WireDirection

MOST_KEPT_PACKETS: Final = 20_000  # packets of a connection
READ_AHEAD_NS: Final = 1_000_000_000  # a packet follows its scan in the file by at most so much


class PacketTimes:
    """Packets of connections that begin in a file. `now_ns` returns the UTC that the run has reached."""

    def __init__(self, path: str, wall_ns: int, now_ns: Callable[[], int]) -> None:
        self._packets = merge_packets([path], [])
        self._found = Conversations(self._add_event)
        self._directions: dict[tuple[str, str], list[WireDirection]] = {}  # by partner and PLC end
        self._packet_ends: dict[WireDirection, deque[tuple[int, int]]] = {}  # end of each packet, its time
        self._wall_ns, self._now_ns = wall_ns, now_ns
        self._reached_ns = 0

    def find_time(self, ends: tuple[str, str], turn: int, offset: int) -> int | None:
        """Return when a byte came, in ns of the run. `turn` counts connections between `ends` from 0."""
        while True:
            directions = self._directions.get(ends, ())
            if turn < len(directions):
                packets = self._packet_ends[directions[turn]]
                while packets and packets[0][0] <= offset:
                    packets.popleft()
                if packets:
                    return packets[0][1] - self._wall_ns
            if not self._read_packet():
                return None

    def _read_packet(self) -> bool:
        found = next(self._packets, None) if self._reached_ns < self._now_ns() + READ_AHEAD_NS else None
        if found is not None:
            packet, reader = found
            self._found.names = reader.interface_name
            self._found.add_packet(packet, reader.link_types[packet.interface])
            self._reached_ns = packet.ns
        return found is not None

    def _add_event(self, event: ConversationEvent) -> None:
        ns, conversation, direction, kind, at, size, _ = event
        if not conversation.begins_with_syn:
            return  # its offsets count from an unknown byte
        if direction not in self._packet_ends:
            self._packet_ends[direction] = deque(maxlen=MOST_KEPT_PACKETS)
            ends = address_text(direction.address), address_text(direction.other.address)
            self._directions.setdefault(ends, []).append(direction)
        if kind is SegmentKind.BYTES:
            self._packet_ends[direction].append((at + size, ns))
