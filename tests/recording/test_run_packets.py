"""Packets of a recording: what came when it came, ends as the wire had them, each job beside its byte."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import pytest

from trcvtui.capture.pcap import Packet, open_capture
from trcvtui.net.kernel import Handle, KernelLoss, NewClient
from trcvtui.net.results import Datagram, Endpoint, Fault
from trcvtui.recording.files import FileLimits, RecordTarget
from trcvtui.recording.journal import RECV, SHOWS, SIM_WALL_NS, STEP, CallRecord, Entry, RunHeader, WireCall
from trcvtui.recording.recording import JOURNAL, Recording, RecordingWriter

BEGINS = RunHeader("0", "sim", 0, SIM_WALL_NS, False, "x.toml", (), "/", (), ())
HERE, PARTNER = Endpoint("10.0.0.5", 2000), Endpoint("10.0.0.9", 51000)
CONNECTED: list[Entry] = [
    WireCall(0, "C1", "bind", 3, (HERE,), None, b""),
    WireCall(0, "C1", "accept", 3, (), NewClient(Handle(7), PARTNER), b""),
]
FLAGS = {1: "FIN", 2: "SYN", 4: "RST"}


def scan(number: int) -> CallRecord:
    return CallRecord("bench", STEP, (), number * 10_000_000)


def call(name: str, *args: object, answer: object = None, data: bytes = b"", handle: int = 7) -> WireCall:
    return WireCall(0, "C1", name, handle, args, answer, data)


def arrives(whole: int, unread: int, data: bytes) -> list[Entry]:
    return [call("arrived", whole, data=data), CallRecord("C1", "gap arrived", (7, whole, unread, 0), data)]


def reads(data: bytes, room: int = 0) -> list[Entry]:
    size = room or len(data)
    return [
        call(RECV, size, answer=len(data)),
        CallRecord("C1", RECV, (7, size), (len(data), data)),
    ]


def sends(data: bytes) -> list[Entry]:
    return [
        call("send", len(data), answer=len(data), data=data),
        CallRecord("C1", "send", (7, len(data), 0), len(data)),
    ]


def shows(
    instance: str = "R1", status: int = 0x7008, length: int | None = None, busy: bool = False
) -> CallRecord:
    outputs = status, busy, status < 0x8000 and not busy, status >= 0x8000, length, None, None
    return CallRecord(instance, SHOWS, ("C1", *outputs), None)


def flat(entries: Iterable[Entry | list[Entry]]) -> list[Entry]:
    return [one for some in entries for one in (some if isinstance(some, list) else [some])]


def written(path: Path, *entries: Entry | list[Entry]) -> list[Packet]:
    """Write a recording; return its packets, those of the journal too."""
    writer = RecordingWriter(path)
    writer.add_entries([BEGINS, *flat(entries)])
    writer.close()
    read = [one for one in Recording(path).read_entries() if isinstance(one, CallRecord)]
    assert read == [one for one in flat(entries) if isinstance(one, CallRecord)]
    return packets(path)


def packets(path: Path) -> list[Packet]:
    with open_capture(path) as capture:
        return list(capture)


def told(found: list[Packet], comments: bool = False) -> list[str]:
    """Return each packet in words: who sent it, at which sequence number, what it carries, its comments."""
    lines = []
    for packet in found:
        if packet.interface == JOURNAL:
            text = "journal"
        elif packet.data[9] == 17:
            text = f"datagram {len(packet.data) - 28}"
        else:
            number, _, _, flags = struct.unpack(">IIBB", packet.data[24:34])
            ends = [name for bit, name in FLAGS.items() if flags & bit]
            size = len(packet.data) - 40
            text = " ".join(
                ["plc" if packet.sent else "partner", str(number), *ends, *[str(size)] * bool(size)]
            )
        if comments or packet.interface != JOURNAL:
            lines.append(" | ".join([text, *packet.comments]) if comments else text)
    return lines


HANDSHAKE = ["partner 0 SYN", "plc 0 SYN", "partner 1"]


# -- what comes --------------------------------------------------------------------------------------------


def test_bytes_are_a_packet_when_they_come_and_the_read_points_to_it(tmp_path: Path) -> None:
    came = bytes(range(100, 200))
    found = written(
        tmp_path / "R", CONNECTED, scan(1), arrives(100, 100, came), sends(b"ab"), scan(2), reads(came[:60]),
        arrives(150, 90, b"x" * 50), scan(3), reads(came[60:] + b"x" * 20), scan(4),
        reads(b"x" * 30 + b"new"),
    )  # fmt: skip
    assert told(found) == [*HANDSHAKE, "partner 1 100", "plc 1 2", "partner 101 50", "partner 151 3"]
    journal = b"".join(packet.data for packet in found if packet.interface == JOURNAL)
    assert came[:10] not in journal and b"xxxx" not in journal and b"new" not in journal


def test_bytes_of_a_block_before_stand_in_the_journal(tmp_path: Path) -> None:
    came = bytes(range(100, 200))
    found = written(
        tmp_path / "R", CONNECTED, scan(1), arrives(100, 100, came), scan(100), arrives(110, 110, b"x" * 10),
        reads(came + b"x" * 10),
    )  # fmt: skip
    assert told(found) == [*HANDSHAKE, "partner 1 100", "partner 101 10"]


def test_the_window_is_what_the_plc_has_room_for(tmp_path: Path) -> None:
    found = written(
        tmp_path / "R", CONNECTED, sends(b"a"), arrives(1000, 1000, bytes(1000)), sends(b"b"),
        reads(bytes(400)), sends(b"c"), arrives(90_000, 89_600, bytes(89_000)), sends(b"d"),
    )  # fmt: skip
    ours = [packet for packet in found if packet.sent and packet.interface != JOURNAL]
    windows = [int.from_bytes(packet.data[34:36], "big") for packet in ours]
    assert windows == [65_535, 65_535, 64_535, 64_935, 0]


def test_a_datagram_is_there_whole_where_data_takes_less(tmp_path: Path) -> None:
    whole, taken = b"0123456789" * 50, b"0123456789"
    answer = Datagram(10, PARTNER, 500), taken
    found = written(
        tmp_path / "R", call("bind", HERE, handle=5), scan(1),
        call("recv_from", 10, answer=answer[0], handle=5),
        call("message", PARTNER, 500, data=whole, handle=5),
        CallRecord("C1", "gap message", (5, PARTNER, 500, 0), whole),
        CallRecord("C1", "recv_from", (5, 10), answer),
        scan(2), shows(length=10), shows("S1", busy=True),
    )  # fmt: skip
    assert told(found, True)[0] == "datagram 500 | R1: 16#7008 DONE 10 B, job 1, scan 2"
    assert taken not in b"".join(packet.data for packet in found if packet.interface == JOURNAL)


# -- ends --------------------------------------------------------------------------------------------------


def test_our_close_with_unread_bytes_is_rst(tmp_path: Path) -> None:
    close = call("close")
    came = arrives(10, 10, bytes(10))
    assert told(written(tmp_path / "1", CONNECTED, came, close))[3:] == ["partner 1 10", "plc 1 RST"]
    assert told(written(tmp_path / "2", CONNECTED, came, reads(bytes(10)), close))[-1] == "plc 1 FIN"
    gone = CallRecord("C1", "discard", (7, 65536), 10)
    assert told(written(tmp_path / "3", CONNECTED, came, gone, close))[-1] == "plc 1 FIN"
    deep = written(tmp_path / "4", CONNECTED, arrives(30, 30, bytes(10)), close)
    assert told(deep, True)[4] == "plc 1 RST | 20 bytes to the PLC are missing: they were never read"


def test_the_partners_end_stands_behind_its_bytes_also_where_they_are_read_later(tmp_path: Path) -> None:
    for how, flag in (("fin", "FIN"), ("rst", "RST")):
        found = written(
            tmp_path / how, CONNECTED, arrives(30, 30, bytes(10)), call("ended", how),
            CallRecord("C1", "gap ended", (7, 0), how), scan(2), reads(bytes(30)), scan(3), call("close"),
        )  # fmt: skip
        ours = ["plc 1 FIN"] if how == "fin" else []
        assert told(found)[3:] == ["partner 1 10", "partner 11 20", f"partner 31 {flag}", *ours]


def test_a_reset_is_rst_whoever_meets_it(tmp_path: Path) -> None:
    reset = Fault("recv", "ECONNRESET")
    by_a_layer = written(tmp_path / "1", CONNECTED, call(RECV, 65536, answer=reset), scan(1), call("close"))
    assert told(by_a_layer)[3:] == ["partner 1 RST"]
    by_a_send: list[Entry] = [
        call("send", 4, answer=Fault("send", "EPIPE")),
        call(RECV, 10, answer=0),
        call("close"),
    ]
    assert told(written(tmp_path / "2", CONNECTED, by_a_send))[3:] == ["partner 1 RST"]
    by_loss: list[Entry] = [call("loss", answer=KernelLoss(reset, 4)), *reads(bytes(4)), call("close")]
    assert told(written(tmp_path / "3", CONNECTED, by_loss))[3:] == ["partner 1 4", "partner 5 RST"]
    by_a_probe: list[Entry] = [CallRecord("C1", "probe", (7,), Fault("shutdown", "ENOTCONN")), call("abort")]
    assert told(written(tmp_path / "4", CONNECTED, by_a_probe))[3:] == ["partner 1 RST"]


@pytest.mark.parametrize(
    ("error", "packets"),
    [
        ("ECONNREFUSED", ["plc 0 SYN", "partner 0 RST"]),
        ("ECONNRESET", ["plc 0 SYN", "partner 0 SYN", "plc 1", "partner 1 RST"]),
    ],
)
def test_a_call_that_is_refused_and_one_that_is_taken_and_reset_are_two(
    error: str, packets: list[str], tmp_path: Path
) -> None:
    begin, fault = call("connect", Endpoint("10.0.0.9", 2000)), Fault("connect", error)
    found = written(tmp_path / "R", begin, call("connect_result", answer=fault), call("close"))
    assert told(found) == packets


def test_a_line_that_is_dead_has_no_end(tmp_path: Path) -> None:
    dead: list[Entry] = [call("loss", answer=KernelLoss(Fault("recv", "ETIMEDOUT"), 0)), call("close")]
    assert told(written(tmp_path / "R", CONNECTED, dead)) == HANDSHAKE


# -- comments ----------------------------------------------------------------------------------------------


def test_a_jobs_end_is_beside_the_packet_with_its_last_byte(tmp_path: Path) -> None:
    found = written(
        tmp_path / "R", CONNECTED, scan(1), arrives(8, 8, bytes(8)), scan(2), arrives(16, 16, bytes(8)),
        scan(3), reads(bytes(4)), scan(4), arrives(20, 16, bytes(4)), shows(length=4), scan(5),
        reads(bytes(12)), scan(6), shows(length=12),
    )  # fmt: skip
    assert told(found, True)[3:6] == [
        "partner 1 8 | R1: 16#7008 DONE 4 B, job 1, scan 4",
        "partner 9 8 | R1: 16#7008 DONE 12 B, job 2, scan 6",
        "partner 17 4",
    ]


def test_a_job_whose_packet_is_written_is_beside_the_newest_of_its_connection_or_of_the_journal(
    tmp_path: Path,
) -> None:
    found = written(
        tmp_path / "R", CONNECTED, scan(1), arrives(8, 8, bytes(8)), scan(100), reads(bytes(4)), scan(101),
        shows(length=4), scan(200), reads(bytes(4)), arrives(9, 1, b"x"), scan(201), shows(length=4),
    )  # fmt: skip
    assert told(found, True)[5:8] == [
        "journal | R1: 16#7008 DONE 4 B, job 1, scan 3, in an earlier packet, sequence number 4",
        "partner 9 1 | R1: 16#7008 DONE 4 B, job 2, scan 5, in an earlier packet, sequence number 8",
        "journal",
    ]


def test_two_receivers_of_a_connection_have_a_packet_each(tmp_path: Path) -> None:
    found = written(
        tmp_path / "R", CONNECTED, scan(1), shows("R1", 0x7006, 0, True), shows("R2", 0x7006, 0, True),
        arrives(8, 8, bytes(8)), scan(2), reads(bytes(8)), arrives(12, 4, bytes(4)), scan(3), reads(bytes(4)),
        shows("R1", length=8), scan(4), shows("R2", length=4),
    )  # fmt: skip
    assert told(found, True)[3:5] == [
        "partner 1 8 | R1: 16#7008 DONE 8 B, job 1, scan 3",
        "partner 9 4 | R2: 16#7008 DONE 4 B, job 1, scan 4",
    ]


def test_a_sender_and_an_error_have_theirs(tmp_path: Path) -> None:
    reset: list[Entry] = [call("ended", "rst"), CallRecord("C1", "gap ended", (7, 0), "rst")]
    found = written(
        tmp_path / "R", CONNECTED, scan(1), sends(bytes(5)), scan(2), shows("S1", 0x0000), sends(bytes(6)),
        scan(3), shows("S1", 0x0000), reset, scan(4), shows("R1", 0x80AA, 0), scan(5), scan(6),
        shows("R1", 0x80A5, 0),
    )  # fmt: skip
    assert told(found, True)[3:] == [
        "plc 1 5 | S1: 16#0000 DONE, job 1, scan 2",
        "plc 6 6 | S1: 16#0000 DONE, job 2, scan 3",
        "partner 1 RST | R1: 16#80AA ERROR, job 1, scan 4",
        "journal | R1: 16#80A5 ERROR, job 2, scan 6",
        "journal",
    ]


def test_a_message_of_iso_on_tcp_ends_where_it_ends(tmp_path: Path) -> None:
    hello, two = bytes((3, 0, 0, 7, 2, 0xE0, 0)), bytes((3, 0, 0, 9, 2, 0xF0, 0x80, 1, 2))
    message = Datagram(2, PARTNER, 2), b"\1\2"
    taken = CallRecord("C1", "recv_from", (7, 16), message)
    found = written(
        tmp_path / "R", CONNECTED, scan(1), call(RECV, 9, answer=7, data=hello), scan(2),
        call(RECV, 9, answer=9, data=two), scan(3), call(RECV, 9, answer=9, data=two), taken, scan(4),
        shows(length=2), taken, scan(5), shows(length=2),
    )  # fmt: skip
    assert told(found, True)[4:6] == [
        "partner 8 9 | R1: 16#7008 DONE 2 B, job 1, scan 4",
        "partner 17 9 | R1: 16#7008 DONE 2 B, job 2, scan 5",
    ]


# -- files that go on --------------------------------------------------------------------------------------


def numbered(folder: Path, limits: FileLimits, *entries: list[Entry]) -> list[Path]:
    folder.mkdir()
    files = RecordTarget(folder, limits=limits).make_file_sink(folder / "R")
    files.add_entries([BEGINS])
    for some in entries:
        files.add_entries(some)
    files.close()
    return sorted(folder.iterdir())


SPLIT = FileLimits(1, 0, -1, -1)  # a file for each scan, and one before


def test_a_connection_goes_on_in_the_next_file(tmp_path: Path) -> None:
    _, before, _, _, after = numbered(
        tmp_path / "out", SPLIT, [scan(1), *CONNECTED, *sends(b"abc"), *arrives(30, 30, bytes(30))],
        [scan(2), *reads(bytes(20))], [scan(3), shows(length=20)], [scan(100), *reads(b"\0" * 10)],
        [*arrives(34, 4, b"tail"), call("close")],
    )  # fmt: skip
    assert told(packets(before))[3:] == ["plc 1 3", "partner 1 30"]
    assert told(packets(after), True) == [
        "partner 21 10 | begins in the middle: 20 bytes to the PLC and 0 bytes from it came before; "
        "repeated: 10 bytes of an unfinished job, of which 10 unread",
        "plc 1 3 | repeated: 3 bytes of an unfinished job",
        "journal",
        "partner 31 4",
        "plc 4 RST",
        "journal",
        "journal",
    ]
    assert all(packet.data[12:24] for packet in packets(after))
    first = next(one for one in Recording(after).read_entries() if isinstance(one, CallRecord))
    assert first == CallRecord("C1", "gap arrived", (7, 30, 10, 0), bytes(10))


def test_a_file_of_a_trigger_has_neither_handshakes_nor_ends_of_its_own(tmp_path: Path) -> None:
    trigger = CallRecord("bench", "do", ("trigger R1 DONE=1",), None)
    [file] = numbered(
        tmp_path / "out", FileLimits(0, 0, 50_000_000, 0), [scan(1), *CONNECTED, *arrives(9, 9, bytes(9))],
        [scan(2), *reads(bytes(9))], [scan(3), shows(length=9)], [scan(50), *arrives(12, 3, b"new")],
        [scan(51), *reads(b"new"), trigger], [scan(99)],
    )  # fmt: skip
    [packet] = [one for one in packets(file) if one.interface != JOURNAL]
    assert told([packet], True) == [
        "partner 10 3 | begins in the middle: 9 bytes to the PLC and 0 bytes from it came before"
    ]
    assert packet.data[20:24] == struct.pack(">HH", PARTNER.port, HERE.port)


def test_a_tls_stream_that_goes_on_says_that_nobody_can_open_it(tmp_path: Path) -> None:
    hello = b"\x16\3\1\0\2\1\0"
    files = numbered(
        tmp_path / "out", SPLIT, [scan(1), *CONNECTED, call(RECV, 9, answer=7, data=hello)], [scan(2)],
        [scan(100), call(RECV, 9, answer=4, data=b"\x17\3\3\0")],
    )  # fmt: skip
    assert told(packets(files[-1]), True)[1] == (
        "partner 8 4 | begins in the middle: 7 bytes to the PLC and 0 bytes from it came before; "
        "TLS: cannot be decrypted in this file"
    )
