"""What ARP and ICMP say about hosts: no answer, one address twice, packets that were not delivered.

Rule 1: an address does not answer if a host asks for it repeatedly and then no packet comes from it.
Rule 2: all lists are bounded, whatever comes. A full list of addresses drops its oldest address.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from ipaddress import ip_address
from itertools import pairwise
from typing import Final, NamedTuple, TypeVar

from trcvtui.capture.packets import TCP, UDP, find_ip_header
from trcvtui.wording import SECOND, count, times

MOST_ADDRESSES: Final = 4096
MOST_PACKETS: Final = 8  # numbers of packets that are kept of one fact
MOST_ASKERS: Final = 8  # of one address
MOST_CHANGES: Final = 64  # of the owner of one address
MOST_NOTES: Final = 64  # of ICMP, of one conversation; of none
MANY_ADDRESSES: Final = 3  # a host with so many addresses is a proxy: it answers for others
REPEAT_NS: Final = SECOND // 2  # a copy of a mirror port comes sooner
QUICK_NS: Final = 5 * SECOND  # between two requests for one address, of QUICK in vain
SLOW_NS: Final = 30 * SECOND  # the same, of SLOW
QUICK_REQUESTS, SLOW_REQUESTS = 3, 6
SCANNED_HOSTS: Final = 16  # a host that asks for so many in vain is a scanner
UNDELIVERED: Final = "undelivered"  # a packet of no conversation
DUPLICATE_NS: Final = 60 * SECOND  # two devices with one address show so soon; an exchange takes longer
AT_ONCE_NS: Final = 5 * SECOND  # an exchange is never so quick
OWNER_TURNS: Final = 3  # changes of the owner, within TURNS_NS, are no exchange either
TURNS_NS: Final = 600 * SECOND
COPY_NS: Final = SECOND // 5
UNNUMBERED_NS: Final = 300_000
_ARP: Final = (b"\x08\x06",)
_ARP_HEAD: Final = b"\0\1\x08\0\6\4"  # Ethernet and IPv4
_NO_ADDRESS: Final = bytes(4)
_PROTOCOL_OF_CAUSE: Final = {UNDELIVERED: "icmp", "mtu": "udp"}
T = TypeVar("T")
# VRRP and CARP, HSRP, GLBP, load balancing: several hosts have one address, and should.
_SHARED: Final = (b"\0\0\x5e\0\1", b"\0\0\x0c\x07\xac", b"\0\0\x0c\x9f", b"\0\x07\xb4", b"\2\xbf", b"\3\xbf")


class ArpNote(NamedTuple):
    """A request or an answer of ARP. If `sender` is `target`, a host announces itself (gratuitous ARP)."""

    is_answer: bool
    mac: bytes
    sender: bytes
    target: bytes


class IcmpNote(NamedTuple):
    """A host reports an undelivered packet. `ports` is b"" if the packet has no ports.

    `kind` is port (closed at the reporting host), host (unreachable), admin (forbidden), size (too large)
    or fragments (some did not come). `size` is how many bytes fit, or 0 if that is not said. `number` has
    the Identification of the report and of the reported packet, the same in a mirrored copy.
    """

    kind: str
    words: str
    said_by: bytes
    protocol: int
    source: bytes
    target: bytes
    ports: bytes
    number: bytes
    size: int = 0

    @property
    def flow_key(self) -> bytes:
        """Return the key of the conversation to which the packet belongs."""
        return b"".join((b"U" if self.protocol == UDP else b"", self.source, self.target, self.ports))

    @property
    def port(self) -> int:
        return int.from_bytes(self.ports[2:], "big")

    @property
    def text(self) -> str:
        size = f", {self.size} bytes fit" if self.size else ""
        there = str(ip_address(self.target)) + f" port {self.port}" * bool(self.ports)
        said_by, source = ip_address(self.said_by), ip_address(self.source)
        return f"{said_by} says by ICMP to {source}: {self.words} for {there}{size}"


class TimedNote(NamedTuple):
    """A note of ICMP, with its time and the number of the packet that has the note."""

    ns: int
    packet: int
    note: IcmpNote


_HOST, _ADMIN, _PORT, _SIZE = "host", "admin", "port", "size"
_ICMP_MEANINGS: Final[Mapping[tuple[int, int, int], tuple[str, str]]] = {  # by protocol, type and code
    (1, 3, 0): (_HOST, "network unreachable"), (1, 3, 1): (_HOST, "host unreachable"),
    (1, 3, 2): (_HOST, "protocol unreachable"), (1, 3, 3): (_PORT, "port unreachable"),
    (1, 3, 4): (_SIZE, "fragmentation needed"), (1, 3, 5): (_HOST, "source route failed"),
    (1, 3, 6): (_HOST, "network unknown"), (1, 3, 7): (_HOST, "host unknown"),
    (1, 3, 9): (_ADMIN, "network prohibited"), (1, 3, 10): (_ADMIN, "host prohibited"),
    (1, 3, 13): (_ADMIN, "administratively filtered"), (1, 11, 0): (_HOST, "time to live exceeded"),
    (1, 11, 1): ("fragments", "fragments are missing"), (58, 1, 0): (_HOST, "no route"),
    (58, 1, 1): (_ADMIN, "administratively prohibited"), (58, 1, 2): (_HOST, "beyond scope"),
    (58, 1, 3): (_HOST, "address unreachable"), (58, 1, 4): (_PORT, "port unreachable"),
    (58, 1, 5): (_ADMIN, "source filtered"), (58, 1, 6): (_ADMIN, "route rejected"),
    (58, 2, 0): (_SIZE, "packet too big"), (58, 3, 0): (_HOST, "hop limit exceeded"),
    (58, 3, 1): ("fragments", "fragments are missing"),
}  # fmt: skip


def parse_host_note(link_type: int, data: bytes) -> ArpNote | IcmpNote | None:
    """Return the ARP or ICMP note in a packet, or None if the packet has no note that matters here."""
    at = find_ip_header(link_type, data, _ARP)
    if at >= 0 and data[at : at + 6] == _ARP_HEAD and len(data) >= at + 28:
        kind, mac = data[at + 7], data[at + 8 : at + 14]
        is_host = any(mac) and not mac[0] & 1 and kind in (1, 2)
        return ArpNote(kind == 2, mac, data[at + 14 : at + 18], data[at + 24 : at + 28]) if is_host else None
    at = find_ip_header(link_type, data)
    try:
        return _parse_icmp(data, at) if at >= 0 else None
    except IndexError:
        return None  # cut


def _parse_icmp(data: bytes, at: int) -> IcmpNote | None:
    is_4 = data[at] >> 4 == 4
    # In the IP header: offsets of protocol and addresses, length of an address.
    protocol, ends, width = (9, 12, 4) if is_4 else (6, 8, 16)
    head = (data[at] & 15) * 4 if is_4 else 40
    inner, is_rest = at + head + 8, is_4 and (data[at + 6] & 31 or data[at + 7])
    found = _ICMP_MEANINGS.get((data[at + protocol], data[at + head], data[at + head + 1]))
    if (
        found is None
        or is_rest
        or data[inner] >> 4 != (4 if is_4 else 6)
        or len(data) < inner + ends + 2 * width
    ):
        return None
    kind, words = found
    said_by, source, target = (data[n : n + width] for n in (at + ends, inner + ends, inner + ends + width))
    begin = inner + ((data[inner] & 15) * 4 if is_4 else 40)
    has_ports = data[inner + protocol] in (TCP, UDP) and not (
        is_4 and (data[inner + 6] & 31 or data[inner + 7])
    )
    size = int.from_bytes(data[inner - (2 if is_4 else 4) : inner], "big") if kind == _SIZE else 0
    kind = _ADMIN if kind == _PORT and said_by != target else kind  # a filter refuses in the host's place
    number = data[at + 4 : at + 6] + data[inner + 4 : inner + 6] if is_4 else b""
    ports = data[begin : begin + 4] if has_ports else b""
    return IcmpNote(kind, words, said_by, data[inner + protocol], source, target, ports, number, size)


def append_note(notes: list[TimedNote], ns: int, packet: int, note: IcmpNote) -> None:
    """Add a note of ICMP, up to MOST_NOTES; a mirror port's copy is left out."""
    soon = COPY_NS if any(note.number) else UNNUMBERED_NS
    is_copy = any(one.note == note and 0 <= ns - one.ns <= soon for one in notes[-4:])
    if not is_copy and len(notes) < MOST_NOTES:
        notes.append(TimedNote(ns, packet, note))


class HostFact(NamedTuple):
    """A fact about hosts outside of any conversation. `ends` are host addresses, an asking host last."""

    cause: str
    sure: float
    ns: int
    text: str
    packets: tuple[int, ...]
    ends: tuple[bytes, ...]

    @property
    def display_line(self) -> str:
        return f"{_PROTOCOL_OF_CAUSE.get(self.cause, 'arp')}: {self.text}"


@dataclass(slots=True)
class _AddressRequests:
    ns: int
    last_ns: int
    packets: list[int]
    often: int = 1
    quick: int = 1
    in_vain: float = 0.0  # how sure that is


class _OwnerChange(NamedTuple):
    """An address moved to another device, `after_ns` after the old device was last seen."""

    ns: int
    after_ns: int
    old: bytes
    new: bytes
    packets: tuple[int, int]


@dataclass(slots=True)
class _Owner:
    """The device that has an address, last seen at `ns`, and seen `alone` times since the last change."""

    mac: bytes
    ns: int
    packet: int
    alone: int = 0
    changes: list[_OwnerChange] = field(default_factory=list)

    @property
    def macs(self) -> set[bytes]:
        return {self.mac, *(one.old for one in self.changes)}


class HostNotes:
    """Notes of ARP on addresses, and notes of ICMP on packets that belong to no conversation."""

    def __init__(self) -> None:
        self.icmps: list[TimedNote] = []
        self._asked: OrderedDict[bytes, dict[bytes, _AddressRequests]] = OrderedDict()
        self._owners: OrderedDict[bytes, _Owner] = OrderedDict()

    def mark_heard(self, address: bytes) -> None:
        """Forget the ARP requests for this address: a packet from it shows that its host is there."""
        self._asked.pop(address, None)

    def add_arp(self, ns: int, packet: int, note: ArpNote) -> None:
        if note.sender == _NO_ADDRESS:
            return  # a probe whether an address is free (RFC 5227)
        self.mark_heard(note.sender)
        self._update_owner(ns, packet, note)
        if note.is_answer or note.sender == note.target:
            return
        askers = _get_or_make(self._asked, note.target, dict)
        asked = askers.get(note.sender)
        is_in_vain = asked is not None and asked.in_vain > 0
        if asked is None or (ns - asked.last_ns > SLOW_NS and not is_in_vain):
            if asked is not None or len(askers) < MOST_ASKERS:
                askers[note.sender] = _AddressRequests(ns, ns, [packet])
            return
        pause = ns - asked.last_ns
        if pause < REPEAT_NS:
            return
        asked.often, asked.last_ns = asked.often + 1, ns
        asked.quick = asked.quick + 1 if pause <= QUICK_NS else 1
        sure = 0.95 if asked.quick > QUICK_REQUESTS + 1 else 0.85 if asked.quick >= QUICK_REQUESTS else 0.0
        asked.in_vain = max(asked.in_vain, sure or 0.6 * (asked.often >= SLOW_REQUESTS))
        asked.packets += [packet] if len(asked.packets) < MOST_PACKETS else []

    def _update_owner(self, ns: int, packet: int, note: ArpNote) -> None:
        if note.mac.startswith(_SHARED):
            return
        owner = _get_or_make(self._owners, note.sender, lambda: _Owner(note.mac, ns, packet))
        is_same = owner.mac == note.mac
        if not is_same and len(owner.changes) < MOST_CHANGES:
            change = _OwnerChange(ns, ns - owner.ns, owner.mac, note.mac, (owner.packet, packet))
            owner.changes.append(change)
        owner.alone = owner.alone + 1 if is_same else 0
        owner.mac, owner.ns, owner.packet = note.mac, ns, packet

    def facts(
        self, heard_ns: Mapping[bytes, int], lacking: Mapping[tuple[bytes, ...], int]
    ) -> Iterator[HostFact]:
        """Yield the facts at the end of the capture.

        `heard_ns`: time of a host's last TCP/UDP packet. `lacking`: number of incomplete datagrams by ends.
        """
        for ends, n in lacking.items():
            there, here = map(ip_address, ends)
            text = f"{count(n, 'datagram')} from {there} to {here} came with fragments missing"
            yield HostFact("mtu", 0.6, 0, text, (), ends[::-1])
        vain = [
            (asker, target, one)
            for target, askers in self._asked.items()
            for asker, one in askers.items()
            if one.in_vain and heard_ns.get(target, 0) <= one.last_ns
        ]
        often = Counter(asker for asker, _, _ in vain)
        for asker, target, one in vain:
            if often[asker] < SCANNED_HOSTS:
                text = f"{ip_address(asker)} asks {times(one.often)} who has {ip_address(target)}: no answer"
                text += " (only a mirror port would show one)" * (one.in_vain < 0.7)
                yield HostFact("no-such-host", one.in_vain, one.ns, text, tuple(one.packets), (target, asker))
        addresses = Counter(mac for one in self._owners.values() for mac in one.macs)
        for address, owner in self._owners.items():
            yield from _find_duplicates(address, owner, addresses)
        same: dict[str, list[TimedNote]] = {}
        for heard in self.icmps:
            same.setdefault(heard.note.text, []).append(heard)
        for text, notes in same.items():
            packets = tuple([one.packet for one in notes[:MOST_PACKETS]])
            yield HostFact(UNDELIVERED, 0.0, notes[0].ns, f"{text}, {times(len(notes))}", packets, ())


def _find_duplicates(address: bytes, owner: _Owner, addresses: Mapping[bytes, int]) -> Iterator[HostFact]:
    """Yield a fact if two devices use one address, unless one has many addresses or replaced the other."""
    changes = [one for one in owner.changes if max(addresses[one.old], addresses[one.new]) < MANY_ADDRESSES]
    back = any((b.old, b.new) == (a.new, a.old) for a, b in pairwise(changes))
    often = len(changes) >= OWNER_TURNS and changes[OWNER_TURNS - 1].ns - changes[0].ns <= TURNS_NS
    met = next((one for one in changes if often or one.after_ns <= DUPLICATE_NS), None)
    if met is None or (not back and met.after_ns > AT_ONCE_NS and owner.alone >= OWNER_TURNS):
        return
    others = addresses[met.old] > 1 or addresses[met.new] > 1
    old, new = (f"{mac.hex(':')} (packet {n})" for mac, n in zip(met[2:4], met.packets, strict=True))
    text = f"{ip_address(address)} is at {old} and at {new}" + ", in turns" * back
    text += "; one of them has another address, too, and may answer for other devices" * others
    yield HostFact(
        "duplicate-ip", 0.7 if others else 0.95 if back else 0.85, met.ns, text, met.packets, (address,)
    )


def _get_or_make(some: OrderedDict[bytes, T], key: bytes, make: Callable[[], T]) -> T:
    """Return the value of a key and make it the newest; above MOST_ADDRESSES drop the oldest."""
    found = some.get(key)
    if found is None:
        if len(some) == MOST_ADDRESSES:
            some.popitem(last=False)
        found = some[key] = make()
    some.move_to_end(key)
    return found
