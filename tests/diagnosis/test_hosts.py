"""What ARP, ICMP, SACK and keep-alive probes prove, each beside a twin that is no fault."""

from __future__ import annotations

import json
import struct
import zipfile
from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.diagnosis.doctor_cases import MS, Built, S, Telegrams, Wire, begin, talk, verdicts_of
from tests.diagnosis.make_host_captures import EXPECTED, ZIP
from tests.recording.wire import ACK, PSH, RST, SYN, ip, tcp, udp
from trcvtui.blocks.conditions import Condition
from trcvtui.capture.hosts import MOST_ADDRESSES, MOST_NOTES, HostNotes, parse_host_note
from trcvtui.capture.packets import MOST_FRAGMENTS, Fragment, Fragments
from trcvtui.capture.pcap import ETHERNET, interface_block, packet_block, section_block
from trcvtui.cli.main import main
from trcvtui.diagnosis.receiver import Receiver

A, B, C = (bytes((2, 0, 0, 0, 0, n)) for n in (0x0A, 0x0B, 0x0C))
ALL = b"\xff" * 6
PLC, PARTNER, OTHER, GATEWAY = "10.0.0.5", "10.0.0.9", "10.0.0.77", "10.0.0.1"
Say = Callable[[Random, Built], None]


def frame(packet: bytes, vlan: bytes = b"") -> bytes:
    kind = b"\x86\xdd" if packet[0] >> 4 == 6 else b"\x08\0"
    return ALL + A + vlan + kind + packet


def arp(kind: int, mac: bytes, sender: str, target: str, vlan: bytes = b"") -> bytes:
    ends = mac + ip_address(sender).packed + bytes(6) + ip_address(target).packed
    return ALL + mac + vlan + b"\x08\x06" + struct.pack(">HHBBH", 1, 0x800, 6, 4, kind) + ends + bytes(18)


def icmp(said_by: str, quoted: bytes, kind: int = 3, code: int = 3, size: int = 0, keeps: int = 8) -> bytes:
    """Return what a host says of a packet, with its header and so many bytes more."""
    if quoted[0] >> 4 == 6:
        body = struct.pack(">BBHI", kind, code, 0, size) + quoted[: 40 + keeps]
        return ip(said_by, str(ip_address(quoted[8:24])), 58, body)
    body = struct.pack(">BBHHH", kind, code, 0, 0, size) + quoted[: 20 + keeps]
    return ip(said_by, str(ip_address(quoted[12:16])), 1, body)


class Net:
    """What a mirror port shows: frames, and the packets of lines."""

    def __init__(self) -> None:
        self.built = Built("")
        self.now = begin(Random(59))
        self.frames: list[tuple[int, bytes]] = []

    def line(self, **ends: Any) -> Wire:
        return Wire(Random(59), self.built, self.now, **ends)

    def put(self, *frames: bytes, every: float = 1.0) -> Net:
        for each in frames:
            self.frames.append((self.now, each))
            self.now += int(every * S)
        return self

    def file(self, vlan: bytes = b"") -> bytes:
        packets = [(ns, frame(data, vlan)) for ns, data in self.built.packets]
        some = sorted([*packets, *self.frames], key=lambda one: one[0])
        blocks = [packet_block(0, ns, data) for ns, data in some]
        return b"".join((section_block("tests"), interface_block(ETHERNET, "t"), *blocks))

    def judge(self, folder: Path, *receivers: Receiver, vlan: bytes = b"") -> list[dict[str, Any]]:
        (folder / "net.pcapng").write_bytes(self.file(vlan))
        return verdicts_of(folder / "net.pcapng", receivers=receivers)


def found(verdicts: list[dict[str, Any]], key: str = "findings") -> list[str]:
    return [one["cause"] for each in verdicts for one in each[key]]


def receiver(partner: str = PARTNER, own: str = PLC, **more: Any) -> Receiver:
    ends = {"own_address": ip_address(own).packed, "partner_address": ip_address(partner).packed}
    words = {Condition.UNREACHABLE: 0x80B7, Condition.REFUSED: 0x80B5, Condition.ESTABLISHING: 0x7002}
    usual = {"need": 20, "active": True, "remote_port": 2000, "words": words}
    return Receiver("R1", "C1", **{**usual, **ends, **more})


def healthy(net: Net) -> Net:
    wire = net.line().open()
    talk(Random(1), wire, Telegrams(Random(1), 20), 12, S, "answered")
    return net


# -- ARP -----------------------------------------------------------------------------------------------------


def asks(often: int, every: float = 1.0, target: str = PARTNER, net: Net | None = None) -> Net:
    return (net or Net()).put(*[arp(1, A, PLC, target)] * often, every=every)


VLAN = b"\x81\0\0\x07"


@pytest.mark.parametrize("vlan", [b"", VLAN], ids=["plain", "vlan"])
@pytest.mark.parametrize(
    ("often", "every", "sure"), [(3, 1.0, 0.85), (11, 1.0, 0.95), (20, 0.2, 0.95), (6, 10.0, 0.6)]
)
def test_an_address_that_is_asked_for_in_vain_is_no_such_host(
    often: int, every: float, sure: float, vlan: bytes, tmp_path: Path
) -> None:
    net = Net().put(*[arp(1, A, PLC, PARTNER, vlan)] * often, every=every)
    (one,) = net.judge(tmp_path)
    assert found([one]) == ["no-such-host"] and one["conversation"] is None and one["verdict"] == "findings"
    (finding,) = one["findings"]
    assert (finding["confidence"], finding["packets"][0], finding["filter"]) == (sure, 1, "arp")


NO_FAULT: dict[str, Callable[[], Net]] = {
    "two requests": lambda: asks(2),
    "each minute": lambda: asks(8, 60.0),
    "a mirror that copies": lambda: Net().put(*[arp(1, A, PLC, PARTNER)] * 4, every=0.0001),
    "answered": lambda: asks(4).put(arp(2, B, PARTNER, PLC)),
    "it announces itself later": lambda: asks(4).put(arp(1, B, PARTNER, PARTNER)),
    "it asks later": lambda: asks(4).put(arp(1, B, PARTNER, PLC)),
    "it answers a ping later": lambda: asks(4).put(frame(ip(PARTNER, PLC, 1, bytes(16)))),
    "an address is looked at (RFC 5227)": lambda: Net().put(*[arp(1, A, "0.0.0.0", PARTNER)] * 5),
    "announcements": lambda: Net().put(*[arp(1, A, PLC, PLC)] * 5),
    "a scan of a network": lambda: Net().put(
        *[arp(1, A, PLC, f"10.0.0.{n}") for n in range(20, 90)], every=0.1),
    "a scan that insists": lambda: Net().put(
        *[arp(1, A, PLC, f"10.0.0.{20 + n % 20}") for n in range(100)], every=0.1),
    "VRRP": lambda: Net().put(
        *[arp(2, mac, GATEWAY, PLC) for mac in (b"\0\0\x5e\0\1\7", B, b"\0\0\x5e\0\1\7")]),
    "HSRP": lambda: Net().put(*[arp(2, mac, GATEWAY, PLC) for mac in (b"\0\0\x0c\x07\xac\1", B, B)]),
    "a proxy": lambda: Net().put(
        *[arp(2, C, f"10.0.0.{n}", PLC) for n in (7, 8, 9)], arp(2, B, PARTNER, PLC)),
    "a device that was exchanged": lambda: Net().put(
        *[arp(2, A, PARTNER, PLC)] * 4, every=60.0).put(*[arp(2, B, PARTNER, PLC)] * 9, every=30.0),
    "a device that was exchanged soon": lambda: Net().put(
        *[arp(2, A, PARTNER, PLC)] * 4, every=20.0).put(*[arp(2, B, PARTNER, PLC)] * 9, every=5.0),
    "cut": lambda: Net().put(*[arp(1, A, PLC, PARTNER)[:30]] * 5),
    "no address of Ethernet": lambda: Net().put(*[arp(2, mac, PARTNER, PLC) for mac in (A, bytes(6), ALL)]),
}  # fmt: skip


@pytest.mark.parametrize("case", NO_FAULT)
def test_arp_alone_without_a_fault_is_nothing_to_judge(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (one,) = NO_FAULT[case]().judge(tmp_path)
    assert (one["verdict"], one["findings"], one["remarks"]) == ("nothing", [], [])
    assert main(["doctor", str(tmp_path / "net.pcapng")]) == 2
    capsys.readouterr()


def test_arp_alone_with_a_fault_is_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asks(11).judge(tmp_path)
    assert main(["doctor", str(tmp_path / "net.pcapng")]) == 1
    assert "10.0.0.5 asks 11 times who has 10.0.0.9" in capsys.readouterr().out


@pytest.mark.parametrize(("partner", "target", "text"), [
    (PARTNER, PARTNER, ""), (PARTNER, "10.0.0.19", "the project has the partner 10.0.0.9"),
    ("192.168.7.2", GATEWAY, "the gateway on the way to 192.168.7.2 does not answer"),
])  # fmt: skip
def test_no_such_host_names_the_partner_or_the_gateway(
    partner: str, target: str, text: str, tmp_path: Path
) -> None:
    (one,) = asks(4, target=target).judge(tmp_path, receiver(partner))
    (finding,) = one["findings"]
    assert "".join(finding["evidence"][1:]) == text
    assert finding["status"] == ["80B7"]


LISTENS: dict[str, Any] = {"active": False, "local_port": 2000}


@pytest.mark.parametrize(("receivers", "key"), [
    ((receiver(**LISTENS),), "findings"),
    ((receiver("10.0.0.8", "10.0.0.7", **LISTENS),), "remarks"),
    ((), "remarks"),
])  # fmt: skip
def test_beside_a_healthy_line_a_host_of_the_project_alone_is_a_finding(
    receivers: tuple[Receiver, ...], key: str, tmp_path: Path
) -> None:
    line, *more = asks(4, target="10.0.0.19", net=healthy(Net())).judge(tmp_path, *receivers)
    assert line["conversation"] is not None and line["findings"] == []
    assert found([line, *more], key) == ["no-such-host"] and len(more) == (key == "findings")


@pytest.mark.parametrize("macs", [(A, B), (A, B, A, B), (A, A, B, A)], ids=["met", "turns", "again"])
def test_an_address_of_two_devices_silences_what_it_explains(macs: tuple[bytes, ...], tmp_path: Path) -> None:
    net = Net().put(*[arp(2, mac, PARTNER, PLC) for mac in macs], every=0.2)
    wire = net.line(plc_calls=True)
    for _ in range(3):
        wire.ask_to_connect("rst")
        wire.wait(S)
    for one in net.judge(tmp_path):
        assert found([one]) == ["duplicate-ip"] and one["findings"][0]["filter"] == "arp"
    assert found(
        healthy(Net().put(*[arp(2, mac, OTHER, PLC) for mac in macs])).judge(tmp_path), "remarks"
    ) == ["duplicate-ip"]


def test_a_double_address_comes_before_what_its_messages_look_like(tmp_path: Path) -> None:
    net = healthy(Net().put(arp(2, A, PARTNER, PLC), arp(2, B, PARTNER, PLC)))
    (one,) = net.judge(tmp_path, receiver(need=24, **LISTENS))
    assert found([one]) == ["duplicate-ip", "frame-short"]


def test_a_port_refused_stays_where_the_address_has_one_device(tmp_path: Path) -> None:
    net = Net().put(*[arp(2, A, PARTNER, PLC)] * 4, every=0.2)
    net.line(plc_calls=True).ask_to_connect("rst")
    assert found(net.judge(tmp_path)) == ["refused"]


def test_what_is_kept_of_arp_is_bounded() -> None:
    notes = HostNotes()
    for n in range(3 * MOST_ADDRESSES):
        target = str(ip_address(0x0A000000 + n))
        for mac, kind in ((struct.pack(">HI", 0x200, n), 1), (B, 2)):
            note = parse_host_note(
                ETHERNET, arp(kind, mac, target, PLC if kind == 2 else f"11.0.{n % 200}.{n // 200}")
            )
            assert note is not None
            notes.add_arp(n * S, n, note)  # type: ignore[arg-type]
    kept = [len(each) for each in (notes._asked, notes._owners)]
    assert max(kept) <= MOST_ADDRESSES


# -- ICMP ----------------------------------------------------------------------------------------------------

SYN_PACKET = tcp(seq=100, flags=SYN, source=(PLC, 40000), target=(PARTNER, 2000))


def calls(*answers: bytes, often: int = 3) -> Net:
    net = Net()
    for _ in range(often):
        net.put(frame(SYN_PACKET), every=0.01).put(*[frame(one) for one in answers], every=1.0)
    return net


BY_ICMP = [
    (icmp(PARTNER, SYN_PACKET), "refused", ["80B5"]),
    (icmp(GATEWAY, SYN_PACKET), "filtered", ["80B7"]),
    (icmp(GATEWAY, SYN_PACKET, code=1), "filtered", ["80B7"]),
    (icmp(GATEWAY, SYN_PACKET, code=13, keeps=20), "filtered", ["80B7"]),
    (icmp(GATEWAY, SYN_PACKET, 11, 0), "filtered", ["80B7"]),
]


@pytest.mark.parametrize("vlan", [b"", VLAN], ids=["plain", "vlan"])
@pytest.mark.parametrize(("answer", "cause", "status"), BY_ICMP)
def test_icmp_is_read_as_the_answer_to_a_call(
    answer: bytes, cause: str, status: list[str], vlan: bytes, tmp_path: Path
) -> None:
    net = Net()
    for _ in range(3):
        net.put(frame(SYN_PACKET, vlan), every=0.01).put(frame(answer, vlan))
    (one,) = net.judge(tmp_path, receiver())
    (finding,) = one["findings"]
    assert (finding["cause"], finding["confidence"], finding["status"]) == (cause, 0.95, status)
    assert "ICMP" in "".join(finding["evidence"]) and finding["filter"].endswith(" && icmp")
    assert "nothing comes back" not in str(finding)


@pytest.mark.parametrize("answer", [
    icmp(GATEWAY, SYN_PACKET, code=1, keeps=2), icmp(GATEWAY, SYN_PACKET, 5, 1),
    icmp(GATEWAY, tcp(flags=SYN, source=(PLC, 1), target=(OTHER, 2000)), code=1),
])  # fmt: skip
def test_icmp_that_is_cut_or_of_another_kind_or_line_is_no_answer(answer: bytes, tmp_path: Path) -> None:
    (one,) = calls(answer).judge(tmp_path, receiver())
    assert [each["cause"] for each in one["findings"]] == ["filtered"]
    assert "ICMP" not in str(one["findings"][0]["evidence"])


def test_a_connection_that_stands_is_not_filtered_by_an_old_note(tmp_path: Path) -> None:
    net = Net().put(frame(SYN_PACKET), frame(icmp(GATEWAY, SYN_PACKET, code=1)))
    wire = net.line(plc_calls=True, caller_port=2000)
    wire.plc, wire.partner, wire.seq["plc"] = (PLC, 40000), (PARTNER, 2000), 100
    talk(Random(1), wire.open(), Telegrams(Random(1), 20), 12, S, "answered")
    assert found(net.judge(tmp_path)) == []


def datagrams(port: int, often: int, answered: bool = False, copies: int = 1, v6: bool = False) -> Net:
    net, ends = Net(), ("fd00::9", "fd00::5") if v6 else (PARTNER, PLC)
    for n in range(10):
        said = bytearray(udp(bytes((n,) * 12), (ends[0], 5100), (ends[1], port)))
        said[4:6] = said[4:6] if v6 else struct.pack(">H", n + 1)
        net.put(frame(bytes(said)), every=0.1)
        if answered and not n:
            net.put(frame(udp(b"answer", (ends[1], port), (ends[0], 5100))), every=0.1)
        if n < often:
            kind = (1, 4) if v6 else (3, 3)
            net.put(*[frame(icmp(ends[1], bytes(said), *kind))] * copies, every=0.0001)
        net.now += S
    return net


@pytest.mark.parametrize(("net", "sure"), [
    (datagrams(2000, 2), 0.95), (datagrams(2000, 1), 0.6), (datagrams(2000, 1, copies=2), 0.6),
    (datagrams(2000, 10, answered=True), 0.95), (datagrams(2000, 10, v6=True), 0.95),
])  # fmt: skip
def test_a_closed_udp_port_is_refused_and_certain_from_two_answers_on(
    net: Net, sure: float, tmp_path: Path
) -> None:
    listens = receiver(is_datagram=True, active=False, local_port=2001, partner_address=b"", own_address=b"")
    (one,) = net.judge(tmp_path, listens)
    (finding,) = one["findings"]
    assert (finding["cause"], finding["confidence"]) == ("refused", sure)
    assert "the project receives on 2001" in finding["evidence"]


@pytest.mark.parametrize("net", [
    datagrams(161, 10), datagrams(2000, 1), datagrams(2000, 2, answered=True), datagrams(2000, 0),
])  # fmt: skip
def test_a_service_of_the_office_and_a_late_answer_are_no_finding(net: Net, tmp_path: Path) -> None:
    (one,) = net.judge(tmp_path)
    assert one["findings"] == []


# -- large packets -------------------------------------------------------------------------------------------


def sack(begin: int, end: int) -> bytes:
    return b"\1\1\5\x0a" + struct.pack(">II", begin % 2**32, end % 2**32)


def with_options(packet: bytes, options: bytes) -> bytes:
    """Return a TCP packet without data with options."""
    made = bytearray(packet + options)
    made[2:4] = struct.pack(">H", len(made))
    made[32] = (5 + len(options) // 4) << 4
    return bytes(made)


def large(answer: str, large_first: bool = False, stamps: bytes = b"") -> Net:
    """Return a sender whose full segment is lost on the way, again and again, and what is said of it."""
    net = Net()
    wire = net.line().open()
    if large_first:
        wire.say("partner", bytes(1460))
    else:
        wire.say("partner", bytes(100))
    wire.wait(S)
    begin_, full = wire.seq["partner"], bytes(1460)
    wire.put("partner", full, ACK | PSH)
    first = net.built.packets[-1][1]
    wire.seq["partner"] += 1460
    for n in range(4):
        wire.wait(10 * MS)
        if answer.startswith("size"):
            to = int(answer[4:])
            net.built.packets.append((wire.now, icmp(GATEWAY, first, 3, 4, to)))
            if n == 0 and answer == "size1400":
                wire.put("partner", full[:1300], ACK, begin_)
                wire.put("partner", full[1300:], ACK, begin_ + 1300)
                wire.wait(10 * MS)
                wire.put("plc")
                talk(Random(1), wire, Telegrams(Random(1), 20), 8, S, "alone")
                return net
        if answer == "sack":
            wire.put("partner", bytes(40), ACK | PSH)
            wire.seq["partner"] += 40
            wire.wait(MS)
            ack = tcp(b"", wire.seq["plc"], begin_, ACK, 8192, wire.plc, wire.partner)
            block = sack(begin_ + 1460, wire.seq["partner"])
            net.built.packets.append((wire.now, with_options(ack, stamps + block)))
        wire.wait(S)
        wire.put("partner", full, ACK | PSH, begin_)
    return net


STAMPS = b"\1\1\x08\x0a" + bytes(8)


@pytest.mark.parametrize(("net", "cause", "words"), [
    (large("size1300"), "mtu", "1300"), (large("size0"), "mtu", "ICMP"), (large("sack"), "mtu", "SACK"),
    (large("sack", stamps=STAMPS), "mtu", "SACK"), (large("sack", large_first=True), "loss", ""),
    (large(""), "dead-link", ""),
])  # fmt: skip
def test_large_packets_that_never_arrive_are_mtu_and_no_loss(
    net: Net, cause: str, words: str, tmp_path: Path
) -> None:
    (one,) = net.judge(tmp_path)
    assert found([one])[:1] == [cause] and ("mtu" in found([one])) is (cause == "mtu")
    assert words in "".join(one["findings"][0]["evidence"])


def test_a_sender_that_keeps_to_the_size_that_it_is_told_is_healthy(tmp_path: Path) -> None:
    (one,) = large("size1400").judge(tmp_path)
    assert one["findings"] == [] and "mtu" in found([one], "remarks")


def test_missing_fragments_of_datagrams_are_told_by_who_waited_for_them(tmp_path: Path) -> None:
    said = udp(bytes(20), (PARTNER, 5100), (PLC, 2000))
    net = Net().put(*[frame(said)] * 3).put(frame(icmp(PLC, said, 11, 1)))
    assert found(net.judge(tmp_path)) == ["mtu"]


def pieces(n: int, lost: int | None, copies: int = 1) -> list[bytes]:
    """Return a datagram of 2500 bytes in three fragments; `lost`: the one that does not come."""
    whole = udp(bytes(2500), (PARTNER, 5100), (PLC, 2000))[20:]
    found = []
    for k in range(3):
        part, flags = whole[k * 1000 : (k + 1) * 1000], (k * 125) | (0x2000 if k < 2 else 0)
        head = bytearray(ip(PARTNER, PLC, 17, part))
        head[4:8] = struct.pack(">HH", n, flags)
        found += [frame(bytes(head))] * copies if k != lost else []
    return found


@pytest.mark.parametrize(("lost", "copies", "causes_"), [
    ([1, 1, 1], 1, ["mtu"]), ([0, 0, 2], 2, ["mtu"]), ([None] * 4, 2, []), ([1, None, None, None], 1, []),
])  # fmt: skip
def test_datagrams_that_lack_fragments_are_mtu_and_copies_of_a_mirror_are_not(
    lost: list[int | None], copies: int, causes_: list[str], tmp_path: Path
) -> None:
    net = Net()
    for n, one in enumerate(lost, 1):
        net.put(*pieces(n, one, copies), every=0.001)
    verdicts = net.judge(tmp_path)
    assert found(verdicts) == causes_ and all(
        one["confidence"] < 0.7 for each in verdicts for one in each["findings"]
    )


def test_what_is_kept_of_fragments_is_bounded() -> None:
    fragments = Fragments()
    for n in range(3 * MOST_FRAGMENTS):
        of = struct.pack(">I", n), bytes(4), bytes(2), b"\x11"
        fragments.add(Fragment(of, 8, True, b"", 0, 0, b"x"), n)
    assert max(len(fragments._lost), len(fragments._packets), len(fragments._done)) <= MOST_FRAGMENTS


# -- probes and restarts -------------------------------------------------------------------------------------


def probed(open_: int, answered: int = 3, rst: bool = False, gone: bool = False, after: float = 5.0) -> Net:
    net = Net()
    wire = net.line(plc_calls=True).open()
    talk(Random(1), wire, Telegrams(Random(1), 20), 6, S, "answered")
    for n in range(answered + open_):
        wire.wait(5 * S)
        wire.keep_alive("plc", answered=n < answered)
    if gone:
        net.now = wire.now
        net.put(*[arp(1, A, PLC, PARTNER)] * 4)
    wire.wait(after * S)
    if rst:
        wire.rst("plc")
    else:
        net.now = wire.now
        net.put(frame(udp(b"another line", (OTHER, 7), (GATEWAY, 7))))
    return net


@pytest.mark.parametrize("net", [probed(3), probed(2, rst=True), probed(2, gone=True), probed(5, 0)])
def test_probes_without_an_answer_are_a_dead_link_and_never_a_reset(net: Net, tmp_path: Path) -> None:
    assert found(net.judge(tmp_path, receiver())) == ["dead-link"]


@pytest.mark.parametrize(("net", "remarks"), [
    (probed(0, 8), []), (probed(1), ["dead-link"]), (probed(1, rst=True), ["dead-link", "resets"]),
    (probed(0, 3, rst=True), ["resets"]),
])  # fmt: skip
def test_probes_that_are_answered_are_healthy_and_one_in_vain_is_a_remark(
    net: Net, remarks: list[str], tmp_path: Path
) -> None:
    one, *_ = net.judge(tmp_path)
    assert one["findings"] == [] and found([one], "remarks") == remarks


def restarted(
    often: int = 1, silent: float = 30.0, answer: str = "challenge", new_port: bool = False, **ends: Any
) -> Net:
    """Return a caller that starts anew and calls again; `answer`: what the old connection says to that."""
    net = Net()
    at, old = net.now, None
    for n in range(often + 1):
        wire = Wire(Random(n), net.built, at, 40000 + new_port * n, **ends)
        if old is not None and answer:
            flags = {"challenge": ACK, "rst": RST | ACK}[answer]
            caller, listener = wire.caller, wire.listener
            wire.put(caller, flags=SYN)
            wire.wait(MS)
            own, wire.seq = (
                wire.seq,
                dict(old.seq) if flags == ACK else {**wire.seq, caller: wire.seq[caller] + 1},
            )
            wire.put(listener, flags=flags)
            wire.wait(MS)
            if answer == "challenge":
                wire.put(caller, flags=RST)
            wire.wait(S)
            wire.seq = {**own, caller: own[caller] + 77777 * (answer == "rst")}
        talk(Random(n), wire.open(), Telegrams(Random(1), 20), 6, S, "answered")
        if old is not None and new_port:
            old.now = wire.now
            old.say("plc", bytes(20), ack=False)
            old.rst("partner")
        old, at = wire, wire.now + int(silent * S)
    return net


@pytest.mark.parametrize("net", [
    restarted(), restarted(silent=5.0), restarted(answer="rst"), restarted(5, 4.0),
    restarted(1, 5.0, "", True),
])  # fmt: skip
def test_a_device_that_has_started_anew_is_half_open_and_nothing_else(net: Net, tmp_path: Path) -> None:
    assert set(found(net.judge(tmp_path, receiver(**LISTENS)))) == {"half-open"}


@pytest.mark.parametrize("calls", [False, True])
def test_a_connection_whose_begin_is_not_in_the_capture_is_half_open_too(calls: bool, tmp_path: Path) -> None:
    net = restarted(plc_calls=calls)
    net.built.packets = net.built.packets[5:]
    ours = receiver(**(LISTENS if not calls else {"remote_port": 40000}))
    assert set(found(net.judge(tmp_path, ours))) == {"half-open"}


def test_a_port_that_is_used_again_after_its_end_is_not_half_open(tmp_path: Path) -> None:
    net = Net()
    at = net.now
    for n in range(3):
        wire = Wire(Random(n), net.built, at, 40000).open()
        talk(Random(n), wire, Telegrams(Random(1), 20), 6, S, "answered")
        wire.fin("partner")
        at = wire.now + 20 * S
    assert found(net.judge(tmp_path)) == []


# -- what is listed ------------------------------------------------------------------------------------------


def aside() -> Net:
    net = asks(4, target="10.0.0.19", net=healthy(Net()))
    note = icmp(GATEWAY, udp(b"", (PLC, 7), (OTHER, 7)), code=1)
    return net.put(*[frame(note)] * 2, *[arp(2, mac, OTHER, PLC) for mac in (A, B, A)])


def test_conversations_lists_below_the_others_what_belongs_to_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "net.pcapng"
    path.write_bytes(aside().file())
    assert main(["conversations", str(path)]) == 0
    text = capsys.readouterr().out
    below = text.partition("apart from the conversations\n")[2].splitlines()
    assert [line.split()[0] for line in below] == ["arp:", "icmp:", "arp:"] and text.startswith("ID")
    assert main(["conversations", str(path), "--format", "json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [(row["id"], row.get("cause")) for row in rows] == [
        ("C1", None), (None, "no-such-host"), (None, "undelivered"), (None, "duplicate-ip"),
    ]  # fmt: skip


def test_watch_names_once_what_arp_and_icmp_say(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "net.pcapng"
    path.write_bytes(aside().file())
    assert main(["watch", str(path)]) == 0
    lines = [line.partition(":")[0] for line in capsys.readouterr().err.splitlines()]
    assert lines == ["arp", "icmp", "arp"]


def test_notes_of_one_conversation_are_bounded(tmp_path: Path) -> None:
    some = [icmp(GATEWAY, SYN_PACKET[:4] + struct.pack(">H", n) + SYN_PACKET[6:], code=1) for n in range(200)]
    net = Net().put(frame(SYN_PACKET)).put(*map(frame, some), every=0.01)
    (one,) = net.judge(tmp_path)
    assert f"{MOST_NOTES} times" in "".join(one["findings"][0]["evidence"])


@pytest.mark.parametrize("name", EXPECTED)
def test_captures_of_real_stacks_have_the_one_cause_that_was_made(name: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(ZIP) as kept:
        path = kept.extract(f"{name}.pcapng", tmp_path)
    assert {*found(verdicts_of(Path(path)))} == {*filter(None, [EXPECTED[name]])}
