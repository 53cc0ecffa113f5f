"""Events of a tap as packets: right sums, right places, our own remarks, what is missing."""

from __future__ import annotations

import io
from collections.abc import Sequence

import pytest

from trcvtui.capture import pcap
from trcvtui.capture.packets import IpPayload, parse_packet
from trcvtui.capture.reassembly import ConversationEvent, Conversations, SegmentKind
from trcvtui.line.tap_capture import TapPacket, TapPacketMaker
from trcvtui.net.tap import LOSS, WAY_BACK, WAY_TO, TapEvent, TapEventKind
from trcvtui.recording.wire import checksum

OPENS = {
    "v4": b"tcp|10.0.0.9|50000|10.0.0.5|2000",
    "v6": b"tcp|fd00::9|50000|fd00::5|2000",
    "both": b"tcp|127.0.0.1|50000|fd00::5|2000",
    "udp": b"udp|10.0.0.9|50000|10.0.0.5|2000",
}


def event(kind: TapEventKind, way: int = WAY_TO, at: int = 0, data: bytes = b"", number: int = 1) -> TapEvent:
    return TapEvent(kind, way, 0, number, at, 1_000_000_000, data)


BEGIN = event(TapEventKind.OPEN, data=OPENS["v4"]), event(TapEventKind.ANSWERED, WAY_BACK)


def packets_of(*events: TapEvent) -> list[TapPacket]:
    packets = TapPacketMaker()
    return [packet for each in events for packet in packets.make_packets(each)]


def told_of(packets: Sequence[TapPacket]) -> list[ConversationEvent]:
    told: list[ConversationEvent] = []
    conversations = Conversations(told.append)
    for n, each in enumerate(packets):
        packet = pcap.Packet(each.ns, 0, each.data, len(each.data), each.comments, n)
        conversations.add_packet(packet, pcap.RAW_IP)
    conversations.close()
    return told


@pytest.mark.parametrize("size", [0, 1, 2, 1459, 1460, 1461, 10_001])
@pytest.mark.parametrize("opens", OPENS)
def test_every_sum_is_right(opens: str, size: int) -> None:
    data = (bytes(range(256)) * 40)[:size]
    packets = packets_of(
        event(TapEventKind.OPEN, data=OPENS[opens]),
        event(TapEventKind.ANSWERED, WAY_BACK),
        event(TapEventKind.BYTES, data=data),
        event(TapEventKind.BYTES, WAY_BACK, data=b"\xff" * size),
        event(TapEventKind.FIN, at=size),
        event(TapEventKind.RST, WAY_BACK, at=size),
        event(TapEventKind.ENDED),
    )
    for packet in packets:
        carried = parse_packet(pcap.RAW_IP, packet.data, len(packet.data))
        assert isinstance(carried, IpPayload)
        inner = packet.data[carried.at : carried.end]
        ends = carried.source + carried.target + bytes((0, carried.protocol)) + len(inner).to_bytes(2, "big")
        assert checksum(ends + inner) == 0
        assert len(carried.source) == 16 or checksum(packet.data[:20]) == 0


def test_a_conversation_is_read_back_as_it_was() -> None:
    told = told_of(
        packets_of(
            *BEGIN,
            event(TapEventKind.BYTES, data=b"question"),
            event(TapEventKind.BYTES, WAY_BACK, data=b"answer"),
            event(TapEventKind.FIN, at=8),
            event(TapEventKind.RST, WAY_BACK, at=6),
            event(TapEventKind.ENDED),
        )
    )
    kinds = [each.kind for each in told]
    assert kinds[-4:] == [SegmentKind.BYTES, SegmentKind.BYTES, SegmentKind.FIN, SegmentKind.RST]
    assert [each.data for each in told if each.kind is SegmentKind.BYTES] == [b"question", b"answer"]
    assert told[0].conversation.begins_with_syn


def test_what_was_lost_on_the_way_is_missing_and_is_said() -> None:
    alive = (1).to_bytes(4, "little")
    packets = packets_of(
        *BEGIN,
        event(TapEventKind.OPEN, data=OPENS["v4"].replace(b"50000", b"50001"), number=2),
        event(TapEventKind.BYTES, data=b"one"),
        event(TapEventKind.LOST, data=LOSS.pack(2, 100) + alive),
        event(TapEventKind.OPEN, at=1, data=OPENS["v4"]),
        event(TapEventKind.BYTES, at=103, data=b"two"),
        event(TapEventKind.BYTES, WAY_BACK, data=b"seen"),
        event(TapEventKind.FIN, at=106),
    )
    assert [p.comments for p in packets if p.comments] == 2 * [
        ("100 bytes before this are not in the recording (2 events)",)
    ]
    told = told_of(packets)
    sizes = [each.size for each in told if each.kind is SegmentKind.MISSING]
    assert sizes == [100]


def test_an_intervention_is_a_comment_of_the_packet_that_it_changed() -> None:
    packets = packets_of(
        *BEGIN,
        event(TapEventKind.INTERVENTION, data=b"hold"),
        event(TapEventKind.BYTES, WAY_BACK, data=b"other way"),
        event(TapEventKind.INTERVENTION, data=b"edit byte 2 aa"),
        event(TapEventKind.BYTES, data=b"edited"),
        event(TapEventKind.INTERVENTION, WAY_BACK, data=b"delay 5 ms"),
        event(TapEventKind.ENDED),
    )
    assert [p.comments for p in packets[4:]] == [
        ("trcvtui: hold", "trcvtui: edit byte 2 aa"),
        ("trcvtui: delay 5 ms",),
    ]


def test_a_serial_line_has_an_interface_of_its_own() -> None:
    packets = TapPacketMaker()
    assert list(packets.make_packets(event(TapEventKind.OPEN, data=b"serial|/dev/a|0|/dev/b|0"))) == []
    (one,) = packets.make_packets(event(TapEventKind.BYTES, WAY_BACK, data=b"\x02x\x03"))
    assert (one.interface, one.data[12:], packets.lines) == (1, b"\x02x\x03", ["/dev/a - /dev/b"])
    whole = pcap.section_block("x") + pcap.interface_block(pcap.RAW_IP, "tap")
    whole += pcap.interface_block(pcap.RTAC_SERIAL, packets.lines[0]) + pcap.packet_block(*one)
    assert [p.data for p in pcap.CaptureReader(io.BytesIO(whole).read, "x")] == [one.data]
