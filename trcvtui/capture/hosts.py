"""What ARP and ICMP say of hosts: who is asked for in vain, which address two have, what did not get there.

Rule 1: an address is asked for in vain when one host asks again and again, and nothing of it comes later.
Rule 2: what is kept is bounded, whatever comes; the oldest goes first.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from ipaddress import ip_address
from itertools import pairwise
from typing import Final, NamedTuple, TypeVar

from trcvtui.capture.packets import TCP, UDP, ip_start
from trcvtui.wording import SECOND, times

MOST_ADDRESSES: Final = 4096
MOST_PACKETS: Final = 8  # numbers of packets that are kept of one fact
MOST_ASKERS: Final = 8  # of one address
MOST_CHANGES: Final = 64  # of the owner of one address
MOST_NOTES: Final = 64  # of ICMP, of one conversation; of none
MANY: Final = 3  # addresses: who has so many answers for others
AGAIN_NS: Final = SECOND // 2  # a copy of a mirror port comes sooner
QUICK_NS: Final = 5 * SECOND  # between two requests for one address, of QUICK in vain
SLOW_NS: Final = 30 * SECOND  # the same, of SLOW
QUICK, SLOW = 3, 6
SCAN: Final = 16  # hosts that one asks for in vain: it looks who is there
NOT_THERE: Final = "undelivered"  # a packet of no conversation
MEET_NS: Final = 60 * SECOND  # two devices with one address show so soon; an exchange takes longer
AT_ONCE_NS: Final = 5 * SECOND  # an exchange is never so quick
TURNS: Final = 3  # changes of the owner, within TURNS_NS, are no exchange either
TURNS_NS: Final = 600 * SECOND
COPY_NS: Final = SECOND // 5
UNNUMBERED_NS: Final = 300_000
_ARP: Final = (b"\x08\x06",)
_ARP_HEAD: Final = b"\0\1\x08\0\6\4"  # Ethernet and IPv4
_NO_ADDRESS: Final = bytes(4)
T = TypeVar("T")
# VRRP and CARP, HSRP, GLBP, load balancing: several hosts have one address, and should.
_SHARED: Final = (b"\0\0\x5e\0\1", b"\0\0\x0c\x07\xac", b"\0\0\x0c\x9f", b"\0\x07\xb4", b"\2\xbf", b"\3\xbf")


class ArpNote(NamedTuple):
    """Who asks or answers; `sender` and `target` are the same where a host announces itself."""

    is_answer: bool
    mac: bytes
    sender: bytes
    target: bytes


class IcmpNote(NamedTuple):
    """A host says that a packet did not get there; `ports` are b"" where the packet has none.

    `kind`: port (a closed one of who says so), host (no way there), admin (it is forbidden), size (it is too
    large, `size`: what fits, 0: not said) or fragments (some did not come). `number`: those of both IP
    packets, by which a mirror's copy is known.
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
    def flow(self) -> bytes:
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
        return f"{said_by} says by ICMP to {source}: {self.words}{size}, for {there}"


class HeardNote(NamedTuple):
    """A note of ICMP: when, and the number of its packet."""

    ns: int
    packet: int
    note: IcmpNote


_HOST, _ADMIN, _PORT = "host", "admin", "port"
_UNREACHABLE: Final[Mapping[int, tuple[str, str]]] = {
    0: (_HOST, "network unreachable"), 1: (_HOST, "host unreachable"), 2: (_HOST, "protocol unreachable"),
    3: (_PORT, "port unreachable"), 4: ("size", "fragmentation needed"), 5: (_HOST, "source route failed"),
    6: (_HOST, "network unknown"), 7: (_HOST, "host unknown"), 9: (_ADMIN, "network prohibited"),
    10: (_ADMIN, "host prohibited"), 13: (_ADMIN, "administratively filtered"),
}  # fmt: skip
_UNREACHABLE_6: Final[Mapping[int, tuple[str, str]]] = {
    0: (_HOST, "no route"), 1: (_ADMIN, "administratively prohibited"), 2: (_HOST, "beyond scope"),
    3: (_HOST, "address unreachable"), 4: (_PORT, "port unreachable"), 5: (_ADMIN, "source filtered"),
    6: (_ADMIN, "route rejected"),
}  # fmt: skip
_TIME: Final[Mapping[int, tuple[str, str]]] = {
    0: (_HOST, "time to live exceeded (a loop of routes)"),
    1: ("fragments", "fragments are missing"),
}
_TOO_BIG: Final[Mapping[int, tuple[str, str]]] = {0: ("size", "packet too big")}
_TYPES: Final = {3: _UNREACHABLE, 11: _TIME}
_TYPES_6: Final = {1: _UNREACHABLE_6, 2: _TOO_BIG, 3: _TIME}


def note_of(link_type: int, data: bytes) -> ArpNote | IcmpNote | None:
    """Return what ARP or ICMP says in a packet; None: it is none of them, or says nothing of the kind."""
    at = ip_start(link_type, data, _ARP)
    if at >= 0 and data[at : at + 6] == _ARP_HEAD and len(data) >= at + 28:
        kind, mac = data[at + 7], data[at + 8 : at + 14]
        is_host = any(mac) and not mac[0] & 1
        if not is_host or kind not in (1, 2):
            return None
        return ArpNote(kind == 2, mac, data[at + 14 : at + 18], data[at + 24 : at + 28])
    at = ip_start(link_type, data)
    try:
        if at >= 0 and data[at] >> 4 == 4 and data[at + 9] == 1 and not (data[at + 6] & 31 or data[at + 7]):
            return _of_version_4(data, at, at + (data[at] & 15) * 4)
        return _of_version_6(data, at) if at >= 0 and data[at] >> 4 == 6 and data[at + 6] == 58 else None
    except IndexError:
        return None  # cut


def _of_version_4(data: bytes, at: int, icmp: int) -> IcmpNote | None:
    found, inner = _TYPES.get(data[icmp], {}).get(data[icmp + 1]), icmp + 8
    if found is None or data[inner] >> 4 != 4 or len(data) < inner + 20:
        return None
    begin = inner + (data[inner] & 15) * 4
    is_first = not (data[inner + 6] & 31 or data[inner + 7])
    ports = data[begin : begin + 4] if is_first and data[inner + 9] in (TCP, UDP) else b""
    size = int.from_bytes(data[icmp + 6 : icmp + 8], "big") if found[0] == "size" else 0
    number = data[at + 4 : at + 6] + data[inner + 4 : inner + 6]
    ends = data[inner + 12 : inner + 16], data[inner + 16 : inner + 20]
    return _note(*found, data[at + 12 : at + 16], data[inner + 9], *ends, ports, number, size)


def _of_version_6(data: bytes, at: int) -> IcmpNote | None:
    icmp, inner = at + 40, at + 48
    found = _TYPES_6.get(data[icmp], {}).get(data[icmp + 1])
    if found is None or data[inner] >> 4 != 6 or len(data) < inner + 40:
        return None
    ports = data[inner + 40 : inner + 44] if data[inner + 6] in (TCP, UDP) else b""
    size = int.from_bytes(data[icmp + 4 : icmp + 8], "big") if found[0] == "size" else 0
    ends = data[inner + 8 : inner + 24], data[inner + 24 : inner + 40]
    return _note(*found, data[at + 8 : at + 24], data[inner + 6], *ends, ports, bytes(4), size)


def _note(
    kind: str, words: str, said_by: bytes, protocol: int, source: bytes, target: bytes, ports: bytes,
    number: bytes, size: int,
) -> IcmpNote:  # fmt: skip
    kind = _ADMIN if kind == _PORT and said_by != target else kind  # a filter refuses in the host's place
    return IcmpNote(kind, words, said_by, protocol, source, target, ports, number, size)


def put_note(notes: list[HeardNote], ns: int, packet: int, note: IcmpNote) -> None:
    """Keep a note of ICMP that is no copy of a mirror port, up to the bound."""
    soon = COPY_NS if any(note.number) else UNNUMBERED_NS
    is_copy = any(one.note == note and 0 <= ns - one.ns <= soon for one in notes[-4:])
    if not is_copy and len(notes) < MOST_NOTES:
        notes.append(HeardNote(ns, packet, note))


class HostFact(NamedTuple):
    """What is said of hosts and of no conversation; `ends`: of whom, who asks last."""

    cause: str
    sure: float
    ns: int
    text: str
    packets: tuple[int, ...]
    ends: tuple[bytes, ...]

    @property
    def line(self) -> str:
        return f"{'icmp' if self.cause == NOT_THERE else 'arp'}: {self.text}"


@dataclass(slots=True)
class _Asked:
    ns: int
    last_ns: int
    packets: list[int]
    often: int = 1
    quick: int = 1
    is_in_vain: bool = False


class _Change(NamedTuple):
    """Another device has an address: how long after the one before was seen last."""

    ns: int
    after_ns: int
    old: bytes
    new: bytes
    packets: tuple[int, int]


@dataclass(slots=True)
class _Owner:
    """Who has an address, when it was seen last, how often since the last change."""

    mac: bytes
    ns: int
    packet: int
    alone: int = 0
    changes: list[_Change] = field(default_factory=list)


class HostNotes:
    """What ARP says of addresses, and ICMP of packets that belong to no conversation."""

    def __init__(self) -> None:
        self.icmps: list[HeardNote] = []
        self._asked: OrderedDict[bytes, dict[bytes, _Asked]] = OrderedDict()
        self._owners: OrderedDict[bytes, _Owner] = OrderedDict()
        self._addresses: OrderedDict[bytes, set[bytes]] = OrderedDict()  # of a MAC, up to MANY

    def hear(self, address: bytes) -> None:
        """Take that a packet of this address has come."""
        self._asked.pop(address, None)

    def take(self, ns: int, packet: int, note: ArpNote) -> None:
        if note.sender == _NO_ADDRESS:
            return  # it looks whether an address is free (RFC 5227)
        self.hear(note.sender)
        self._own(ns, packet, note)
        if note.is_answer or note.sender == note.target:
            return
        askers = _kept(self._asked, note.target, dict)
        asked = askers.get(note.sender)
        if asked is None or ns - asked.last_ns > SLOW_NS:
            if asked is not None or len(askers) < MOST_ASKERS:
                askers[note.sender] = _Asked(ns, ns, [packet])
            return
        pause = ns - asked.last_ns
        if pause < AGAIN_NS:
            return
        asked.often, asked.last_ns = asked.often + 1, ns
        asked.quick = asked.quick + 1 if pause <= QUICK_NS else 1
        asked.is_in_vain |= asked.quick >= QUICK or asked.often >= SLOW
        asked.packets += [packet] if len(asked.packets) < MOST_PACKETS else []

    def _own(self, ns: int, packet: int, note: ArpNote) -> None:
        if note.mac.startswith(_SHARED):
            return
        addresses = _kept(self._addresses, note.mac, set)
        if len(addresses) < MANY:
            addresses.add(note.sender)
        owner = _kept(self._owners, note.sender, lambda: _Owner(note.mac, ns, packet))
        is_same = owner.mac == note.mac
        if not is_same and len(owner.changes) < MOST_CHANGES:
            change = _Change(ns, ns - owner.ns, owner.mac, note.mac, (owner.packet, packet))
            owner.changes.append(change)
        owner.alone = owner.alone + 1 if is_same else 0
        owner.mac, owner.ns, owner.packet = note.mac, ns, packet

    def facts(self, heard_ns: Mapping[bytes, int]) -> Iterator[HostFact]:
        """Yield what is so at the end; `heard_ns`: when each host was heard last by TCP or UDP."""
        vain = [
            (asker, target, one)
            for target, askers in self._asked.items()
            for asker, one in askers.items()
            if one.is_in_vain and heard_ns.get(target, 0) <= one.last_ns
        ]
        often = Counter(asker for asker, _, _ in vain)
        for asker, target, one in vain:
            if often[asker] < SCAN:
                text = f"{ip_address(asker)} asks {times(one.often)} who has {ip_address(target)}: no answer"
                is_quick = one.often > SLOW - 2 and one.last_ns - one.ns <= QUICK_NS * one.often
                sure = 0.95 if is_quick else 0.85
                yield HostFact("no-such-host", sure, one.ns, text, tuple(one.packets), (target, asker))
        for address, owner in self._owners.items():
            yield from self._doubled(address, owner)
        same: dict[str, list[HeardNote]] = {}
        for heard in self.icmps:
            same.setdefault(heard.note.text, []).append(heard)
        for text, notes in same.items():
            packets = tuple([one.packet for one in notes[:MOST_PACKETS]])
            yield HostFact(NOT_THERE, 0.0, notes[0].ns, f"{text}, {times(len(notes))}", packets, ())

    def _doubled(self, address: bytes, owner: _Owner) -> Iterator[HostFact]:
        """Yield that two devices have an address: not a proxy, and none took the other's place."""
        changes = [one for one in owner.changes if not (self._has_many(one.old) or self._has_many(one.new))]
        back = any((b.old, b.new) == (a.new, a.old) for a, b in pairwise(changes))
        often = len(changes) >= TURNS and changes[TURNS - 1].ns - changes[0].ns <= TURNS_NS
        met = next((one for one in changes if often or one.after_ns <= MEET_NS), None)
        if met is None or (not back and met.after_ns > AT_ONCE_NS and owner.alone >= TURNS):
            return
        others = max(len(self._addresses.get(mac, ())) for mac in (met.old, met.new)) > 1
        old, new = (f"{mac.hex(':')} (packet {n})" for mac, n in zip(met[2:4], met.packets, strict=True))
        text = f"{ip_address(address)} is at {old} and at {new}" + ", in turns" * back
        text += "; one of them has another address, and may answer for others" * others
        sure = 0.7 if others else 0.95 if back else 0.85
        yield HostFact("duplicate-ip", sure, met.ns, text, met.packets, (address,))

    def _has_many(self, mac: bytes) -> bool:
        return len(self._addresses.get(mac, ())) >= MANY


def _kept(some: OrderedDict[bytes, T], key: bytes, make: Callable[[], T]) -> T:
    """Return what is kept at a key, as the newest; the oldest goes where there are too many."""
    found = some.get(key)
    if found is None:
        if len(some) == MOST_ADDRESSES:
            some.popitem(last=False)
        found = some[key] = make()
    some.move_to_end(key)
    return found
