"""What ARP, ICMP and SACK prove: no such host, a double address, no way there, packets too large for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from ipaddress import ip_address
from typing import Final, NamedTuple

from trcvtui.blocks.conditions import Condition
from trcvtui.capture.hosts import AskedInVain, DoubleAddress, HeardNote
from trcvtui.diagnosis.line_facts import LARGE, CaptureFacts, DirectionFacts, LineFacts, SegmentFacts
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.diagnosis.sign import Remedy, Sign
from trcvtui.wording import SECOND, count, times

CERTAIN: Final = 2  # answers of ICMP to datagrams; one may be chance
CLOSED: Final = 3  # the same, where the end has received before: fewer are late answers to a closed socket
NO_WAY: Final = ("host", "admin", "port")
MOST_KNOWN_PORT: Final = 1023
_SERVICES: Final = frozenset({1900, 3702, 5353, 5355})  # SSDP, WS-Discovery, mDNS, LLMNR
_LAST_BYTES: Final = (1, 254)  # of most gateways
_NO_CALL: Final = (Condition.UNREACHABLE, Condition.CONNECT_FAILED)
# What a second device with the address of an end explains, all of it.
OF_DOUBLE: Final = frozenset({
    "second-client", "refused", "turned-away", "filtered", "closes-each-message", "reconnect-storm",
    "half-open", "no-keep-alive", "dead-link", "mtu", "resets", "loss",
})  # fmt: skip


class HostFinding(NamedTuple):
    """What is found of hosts and not of a conversation; `ends`: whose conversations it touches."""

    cause: str
    said: Sign
    ends: tuple[bytes, ...]
    of_project: bool


def _at(heard: HeardNote) -> SegmentFacts:
    return SegmentFacts(heard.ns, 0, 0, heard.packet)


def _told(line: LineFacts, *kinds: str) -> list[HeardNote]:
    return [one for one in line.undelivered if one.note.kind in kinds]


def _way_of(line: LineFacts, heard: HeardNote) -> str:
    return "from-plc" if heard.note.source == line.plc_end[0] else "to-plc"


def is_service(line: LineFacts) -> bool:
    """Return whether datagrams are those of any network: to all hosts, or of a service."""
    ends = line.plc_end, line.partner_end
    if line.protocol != "udp":
        return False
    is_known = min(port for _, port in ends) <= MOST_KNOWN_PORT or any(port in _SERVICES for _, port in ends)
    return is_known or any(ip_address(host).is_multicast or host[-1:] == b"\xff" for host, _ in ends)


def _no_way(line: LineFacts, some: list[HeardNote], *texts: str) -> Sign:
    note, packets = some[0].note, tuple([one.packet for one in some])
    router, target = ip_address(note.said_by), ip_address(note.target)
    mend = (
        f"ask who runs {router}: it forbids this connection"
        if note.kind == "admin" or (note.kind == "port" and note.said_by != note.target)
        else f"correct the address, switch {target} on, or give {router} a route to it"
    )
    said = f"{note.text}, {times(len(some))}"
    return Sign(
        0.97, (*texts, said), _way_of(line, some[0]), _at(some[0]), mend=(Remedy(mend),), is_fact=True,
        packets=packets, leads_to=_NO_CALL,
    )  # fmt: skip


def refused_by_icmp(line: LineFacts, receivers: Sequence[Receiver]) -> Sign | None:
    """Return that a host says of its own port that nothing listens there."""
    some = [one for one in _told(line, "port") if one.note.said_by == one.note.target]
    if line.protocol == "udp":
        return _lost_datagrams(line, some, receivers)
    if not some or line.is_built:
        return None
    port = int.from_bytes(some[0].note.ports[2:], "big")
    texts = (f"{some[0].note.text}, {times(len(some))}", f"nothing listens on port {port}")
    packets = tuple([one.packet for one in some])
    return Sign(0.97, texts, _way_back(line, some[0]), _at(some[0]), is_fact=True, packets=packets)


def _way_back(line: LineFacts, heard: HeardNote) -> str:
    return "to-plc" if _way_of(line, heard) == "from-plc" else "from-plc"


def no_way_by_icmp(line: LineFacts, receivers: Sequence[Receiver]) -> Sign | None:
    """Return that a router, or a filter, says that it does not let packets through."""
    some = [
        one for one in _told(line, *NO_WAY) if one.note.kind != "port" or one.note.said_by != one.note.target
    ]
    if line.protocol == "udp":
        return _lost_datagrams(line, some, receivers)
    if not some or line.is_built:
        return None
    asked = f"{count(len(line.caller.syns), 'SYN')} to {ip_address(some[0].note.target)}"
    return _no_way(line, some, asked)


def _lost_datagrams(line: LineFacts, some: list[HeardNote], receivers: Sequence[Receiver]) -> Sign | None:
    if not some:
        return None
    note, port = some[0].note, int.from_bytes(some[0].note.ports[2:], "big")
    end = line.from_plc if (note.target, port) == line.plc_end else line.to_plc
    if end.last_ns > some[0].ns or (end.segments and len(some) < CLOSED):
        return None
    takes = sorted({one.local_port for one in receivers if one.is_datagram and one.local_port})
    is_other = port not in takes and is_service(line)
    is_remark = is_other or (not receivers and len(some) < CERTAIN)
    sure = 0.97 if len(some) >= CERTAIN else 0.6
    if note.kind != "port":
        return _no_way(line, some)._replace(confidence=sure, is_remark=is_remark, leads_to=())
    is_wrong = bool(takes) and port not in takes and end is line.from_plc
    texts = [f"{note.text}, {times(len(some))}", f"nothing receives on UDP port {port}"]
    texts += [f"the project receives on {takes[0]}"] if is_wrong else []
    mend = (
        f"send to port {takes[0]}"
        if is_wrong
        else f"start what receives on UDP port {port}, or correct the port"
    )
    return Sign(
        sure, tuple(texts), _way_back(line, some[0]), _at(some[0]), mend=(Remedy(mend),), is_remark=is_remark,
        is_fact=len(some) >= CERTAIN, packets=tuple([one.packet for one in some]), leads_to=(),
    )  # fmt: skip


# -- packets that are too large ------------------------------------------------------------------------------


def mtu(line: LineFacts) -> Sign | None:
    """Return that large packets do not get there, and small ones do."""
    pieces = _told(line, "fragments")
    if pieces:
        mend = Remedy("keep datagrams below 1472 bytes, or let the way carry fragments: firewalls drop them")
        text = f"{pieces[0].note.text}, {times(len(pieces))}"
        return Sign(0.95, (text,), _way_of(line, pieces[0]), _at(pieces[0]), mend=(mend,), is_fact=True)
    some = _told(line, "size")
    for said, end, way in (
        (line.from_plc, line.plc_end, "from-plc"),
        (line.to_plc, line.partner_end, "to-plc"),
    ):
        told = [one for one in some if one.note.source == end[0]]
        stuck, often = said.stuck, said.stuck_often
        size = told[0].note.size if told else 0
        is_late = line.protocol == "udp" and len(told) > CERTAIN
        if told and (is_late or (often >= 2 and stuck.size + 40 > size)):
            texts = [f"{told[0].note.text}, {times(len(told))}"]
            texts += (
                [f"{stuck.size} bytes are sent again {times(often)}, as large as before"] if often else []
            )
            return Sign(0.97, tuple(texts), way, _at(told[0]), mend=_smaller(size), is_fact=True)
        if told:
            return Sign(
                0.0, (f"{told[0].note.text}: the sender keeps to it",), way, _at(told[0]), is_remark=True
            )
        if line.protocol == "tcp" and often >= 3 and stuck.size >= LARGE and _only_small_arrive(said, stuck):
            text = f"{stuck.size} bytes are sent again {times(often)}, and never acknowledged"
            small = (
                "smaller segments behind them arrive (SACK): large packets do not get there, small ones do"
            )
            return Sign(0.9, (text, small), way, stuck, mend=_smaller(0), packets=said.packets_of("resent"))
    return None


def _smaller(size: int) -> tuple[Remedy, ...]:
    to = f"to {size}" if size else "lower (try 1300)"
    return (Remedy(f"let the way carry large packets, or set the MTU at both ends {to}; no cable does this"),)


def _only_small_arrive(said: DirectionFacts, stuck: SegmentFacts) -> bool:
    has = [one for one in said.sacked if one[1] > stuck.at + stuck.size]
    large = [one for one in said.writes if one.size >= LARGE and one.at != stuck.at]
    arrived = (one.at < stuck.at or any(a <= one.at < b for a, b in has) for one in large)
    return bool(has) and said.acked_at <= stuck.at and not any(arrived)


# -- addresses -----------------------------------------------------------------------------------------------


def double_address(line: LineFacts) -> Sign | None:
    """Return that an address of a conversation has two devices."""
    return sign_of_double(line.doubled[0]) if line.doubled else None


def sign_of_double(one: DoubleAddress) -> Sign:
    texts = [one.text, "they take turns" if one.takes_turns else "both were seen within a minute"]
    texts += ["one of them has another address, too: it may answer for others"] if one.has_others else []
    address = ip_address(one.address)
    mend = Remedy(
        f"give one of both devices with {address} another address; the first half of a MAC names its maker"
    )
    sure = 0.7 if one.has_others else 0.97 if one.takes_turns else 0.85
    at = SegmentFacts(one.ns, 0, 0, one.packets[1])
    return Sign(sure, tuple(texts), at=at, mend=(mend,), is_fact=one.takes_turns, packets=one.packets)


def host_findings(facts: CaptureFacts, receivers: Sequence[Receiver], plc: bytes) -> Iterator[HostFinding]:
    """Yield addresses without a host, and those of two devices that have no conversation.

    `plc`: the address that was asked for. They are of the project where the address, or who asks, is, or
    where nothing else is in the capture.
    """
    own = {one.own_address for one in receivers} | {plc}
    known = (own | {one.partner_address for one in receivers}) - {b""}
    ends = {end[0] for line in facts.lines for end in (line.plc_end, line.partner_end)}
    is_alone = all(is_service(line) for line in facts.lines)
    for one in facts.doubled:
        if one.address not in ends:
            yield HostFinding(
                "duplicate-ip", sign_of_double(one), (one.address,), is_alone or one.address in known
            )
    for vain in facts.vain:
        of_project = is_alone or bool({vain.asker, vain.target} & known)
        yield HostFinding("no-such-host", _no_host(vain, receivers), (vain.target, vain.asker), of_project)


def _no_host(vain: AskedInVain, receivers: Sequence[Receiver]) -> Sign:
    asker, target = ip_address(vain.asker), ip_address(vain.target)
    partners = [
        one.partner_address for one in receivers if one.own_address == vain.asker and one.partner_address
    ]
    far = [one for one in partners if one[:3] != vain.asker[:3] == vain.target[:3]]
    texts, mend = [vain.text], f"switch {target} on and plug it in, or correct the address at {asker}"
    if vain.target in partners or not (partners or vain.target[-1] in _LAST_BYTES):
        pass
    elif far or not partners:
        way = f" on the way to {ip_address(far[0])}" if far else ""
        texts.append(
            f"the gateway{way} does not answer" if far else "it may be a gateway: then that does not answer"
        )
        mend = f"look at {target}: the gateway that {asker} has is wrong, off or not plugged in"
    else:
        texts.append(f"the project has {', '.join(str(ip_address(one)) for one in dict.fromkeys(partners))}")
        mend = f"correct the address of the partner, or of the gateway, at {asker}"
    sure = 0.95 if vain.last_ns - vain.ns >= 5 * SECOND else 0.85
    at = SegmentFacts(vain.ns, 0, 0, vain.packets[0])
    return Sign(sure, tuple(texts), at=at, mend=(Remedy(mend),), is_fact=True, packets=vain.packets)
