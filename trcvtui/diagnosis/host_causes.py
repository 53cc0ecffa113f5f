"""What ARP, ICMP and SACK prove: no such host, a duplicate address, no route, oversized packets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from ipaddress import ip_address
from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.capture.hosts import UNDELIVERED, HostFact, TimedNote
from trcvtui.diagnosis.line_facts import LARGE_SEGMENT, CaptureFacts, DirectionFacts, LineFacts, SegmentFacts
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.snapshots.doctor import Finding, Remedy
from trcvtui.wording import times

CERTAIN_ANSWERS: Final = 2  # ICMP answers to datagrams: a single one may be chance
CLOSED: Final = 3  # likewise, of an end that sent bytes: fewer are answers to a socket that was just closed
MOST_KNOWN_PORT: Final = 1023
_SERVICES: Final = frozenset({1900, 3702, 5353, 5355})  # SSDP, WS-Discovery, mDNS, LLMNR
_LAST_BYTES: Final = (1, 254)  # of most gateways
_CALL_FAILED: Final = (Condition.UNREACHABLE, Condition.CONNECT_FAILED)
_NO_FRAGMENTS: Final = "keep datagrams below 1472 bytes, or let fragments pass: firewalls drop them"
# Causes that a second device with the address of an end explains.
DOUBLE_EFFECTS: Final = frozenset({
    "second-client", "refused", "turned-away", "filtered", "closes-each-message", "reconnect-storm",
    "half-open", "no-keep-alive", "dead-link", "mtu", "resets", "loss",
})  # fmt: skip


def is_service(line: LineFacts) -> bool:
    """Return whether a line has datagrams that any network has: to all hosts, or of a common service."""
    ends = line.plc_end, line.partner_end
    if line.protocol != "udp":
        return False
    is_known = min(port for _, port in ends) <= MOST_KNOWN_PORT or any(port in _SERVICES for _, port in ends)
    return is_known or any(ip_address(host).is_multicast or host[-1:] == b"\xff" for host, _ in ends)


def _from_icmp(
    line: LineFacts, some: Sequence[TimedNote], sure: float, *texts: str, mend: str = ""
) -> Finding:
    """Return the finding that ICMP messages about one direction prove, in the first message's words."""
    first, packets = some[0], tuple([one.packet for one in some])
    way = "from-plc" if first.note.source == line.plc_end[0] else "to-plc"
    mends = (Remedy(mend),) if mend else ()
    text, at = f"{first.note.text}, {times(len(some))}", SegmentFacts(first.ns, 0, 0, first.packet)
    icmp = "icmp" if len(first.note.said_by) == 4 else "icmpv6"
    return Finding(sure, (text, *texts), way, at, "", mends, False, sure > 0.9, packets, filter=icmp)


def judge_icmp_reports(line: LineFacts, receivers: Sequence[Receiver], *kinds: str) -> Finding | None:
    """Return the finding that a host refuses a port, or a router or filter refuses packets to the host."""
    some = [one for one in line.undelivered if one.note.kind in kinds]
    is_udp = line.protocol == "udp"
    if not some or (line.is_built and not is_udp):
        return None
    note = some[0].note
    if note.kind == "port":
        finding = _from_icmp(line, some, 0.97, f"nothing listens on port {note.port}")
    else:
        router, target = ip_address(note.said_by), ip_address(note.target)
        no_way = f"correct the address, switch {target} on, or give {router} a route to it"
        mend = f"ask the operator of {router}, which forbids it" if note.kind == "admin" else no_way
        finding = replace(_from_icmp(line, some, 0.97, mend=mend), leads_to=_CALL_FAILED)
    return _judge_datagram_report(line, receivers, some, finding) if is_udp else finding


def _judge_datagram_report(
    line: LineFacts, receivers: Sequence[Receiver], some: Sequence[TimedNote], finding: Finding
) -> Finding | None:
    note = some[0].note
    is_to_plc = (note.target, note.port) == line.plc_end
    end = line.from_plc if is_to_plc else line.to_plc
    if end.last_ns > some[0].ns or (end.segments and len(some) < CLOSED):
        return None  # the end still sends, or has just closed its socket
    takes = {one.local_port for one in receivers if one.is_datagram and is_to_plc} - {0}
    if takes and note.port not in takes:
        texts, mend = (f"the project receives on {min(takes)}",), f"send to port {min(takes)}"
        finding = replace(finding, evidence=(*finding.evidence, *texts), mend=(Remedy(mend),))
    is_noise = note.port not in takes and is_service(line)
    is_sure = len(some) >= CERTAIN_ANSWERS
    is_remark = is_noise or not (receivers or is_sure)
    sure = 0.97 if is_sure else 0.6
    return replace(finding, confidence=sure, is_remark=is_remark, is_fact=is_sure, leads_to=())


# -- packets that are too large ------------------------------------------------------------------------------


def judge_mtu(line: LineFacts) -> Finding | None:
    pieces = [one for one in line.undelivered if one.note.kind == "fragments"]
    if pieces:
        return _from_icmp(line, pieces, 0.95, mend=_NO_FRAGMENTS)
    for flow, end in ((line.from_plc, line.plc_end), (line.to_plc, line.partner_end)):
        reports = [one for one in line.undelivered if (one.note.kind, one.note.source) == ("size", end[0])]
        size, stuck = reports[0].note.size if reports else 0, flow.stuck
        to = f"to {size}" if size else "to a smaller size (try 1300)"
        mend = f"let large packets pass, or set the MTU at both ends {to}; a cable is not the cause"
        again = f"{stuck.size} bytes are sent again {times(flow.stuck_often)}"
        if reports and flow.stuck_often >= 2 and stuck.size + 40 > size:  # 40: IP and TCP headers
            return _from_icmp(line, reports, 0.97, f"{again} without becoming smaller", mend=mend)
        if reports:  # of several datagrams: their sender ignores the report
            is_late = line.protocol == "udp" and len(reports) > CERTAIN_ANSWERS
            return replace(_from_icmp(line, reports, 0.95 * is_late, mend=mend), is_remark=not is_late)
        if flow.stuck_often >= 3 and stuck.size >= LARGE_SEGMENT and _is_only_small_arriving(flow):
            small = "smaller segments sent after them arrive (SACK): only large packets get lost"
            way = "from-plc" if flow is line.from_plc else "to-plc"
            texts = f"{again} and never acknowledged", small
            return Finding(0.9, texts, way, stuck, mend=(Remedy(mend),), packets=flow.packets_of("resent"))
    return None


def _is_only_small_arriving(flow: DirectionFacts) -> bool:
    at = flow.stuck.at
    has = [one for one in flow.sacked if one[1] > at + flow.stuck.size]
    large = [one.at for one in flow.writes if one.size >= LARGE_SEGMENT and one.at != at]
    arrived = (one < at or any(begin <= one < end for begin, end in has) for one in large)
    return bool(has) and flow.acked_at <= at and not any(arrived)


# -- addresses -----------------------------------------------------------------------------------------------


def list_host_facts(
    facts: CaptureFacts, receivers: Sequence[Receiver], plc: bytes
) -> Iterator[tuple[HostFact, bool]]:
    """Yield facts on missing hosts, lost fragments, and duplicate addresses that have no conversation.

    Each fact comes with True if one of its hosts is in the project or `plc`, or if all lines are services.
    """
    known = {plc, *(end for one in receivers for end in (one.own_address, one.partner_address))} - {b""}
    ends = {end[0] for line in facts.lines for end in (line.plc_end, line.partner_end)}
    is_alone = all(is_service(line) for line in facts.lines)
    for one in facts.hosts:
        if one.cause != UNDELIVERED and not (one.cause == "duplicate-ip" and one.ends[0] in ends):
            yield one, is_alone or bool(known & {*one.ends})


def make_host_finding(fact: HostFact, receivers: Sequence[Receiver]) -> Finding:
    texts, mend = [fact.text], _NO_FRAGMENTS
    if fact.cause == "duplicate-ip":
        mend = f"give one of the two devices with {ip_address(fact.ends[0])} another address"
    if fact.cause == "no-such-host":
        more, mend = _explain_missing_host(fact.ends[0], fact.ends[1], receivers)
        texts += [more] if more else []
    packet = fact.packets[-1 if fact.cause == "duplicate-ip" else 0] if fact.packets else 0
    at = SegmentFacts(fact.ns, 0, 0, packet) if packet else None
    shown = "ip.flags.mf == 1 || ip.frag_offset > 0" if fact.cause == "mtu" else "arp"
    return Finding(
        fact.sure, tuple(texts), at=at, mend=(Remedy(mend),), is_fact=fact.sure > 0.9, packets=fact.packets,
        filter=shown, cause=fact.cause,
    )  # fmt: skip


def _explain_missing_host(target: bytes, asker: bytes, receivers: Sequence[Receiver]) -> tuple[str, str]:
    """Return what a missing host means, and the remedy."""
    gone, here = ip_address(target), ip_address(asker)
    partners = {one.partner_address for one in receivers if one.own_address == asker} - {b""}
    far = [one for one in partners if one[:3] != asker[:3] == target[:3]]
    of_gateway = f"check {gone}: the gateway of {here} is wrong, off or unplugged"
    if far and target not in partners:
        return f"the gateway on the way to {ip_address(far[0])} does not answer", of_gateway
    if partners and target not in partners:
        names = ", ".join(str(ip_address(one)) for one in sorted(partners))
        return f"the project has the partner {names}", f"correct the address of the partner at {here}"
    if not partners and target[-1] in _LAST_BYTES:
        return "this address may be a gateway that does not answer", of_gateway
    return "", f"switch {gone} on and plug it in, or correct the address at {here}"
