"""Public captures with one fault or defect added: what the doctor should say of it is known.

Rule 1: a mutation changes what it is named after, and nothing else; checksums do not count.
Rule 2: equal input gives equal output; odd and even `Subject.number` differ in how it is done.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.capture.packets import find_ip_header
from trcvtui.capture.pcap import Packet, open_capture
from trcvtui.recording.wire import ACK, FIN, RST, SYN

LEAST_DATA: Final = 10  # segments with bytes
WAIT_NS: Final = 1_200_000_000, 250_000_000  # until a lost segment is sent again
COPY_NS: Final = 50_000
STEP_NS: Final = 3_000_000_000
JUMP: Final = 3 << 29
CIRCLE: Final = 1 << 32
End = tuple[bytes, int]


class Segment(NamedTuple):
    """The TCP of the packet at `place` of the file; `ip` and `tcp` are where the packet has them."""

    place: int
    source: End
    target: End
    seq: int
    ack: int
    flags: int
    size: int
    ip: int
    tcp: int


class Subject(NamedTuple):
    """A capture, its conversations, and the one that gets the fault; `fresh`: its segments with new bytes."""

    number: int
    link_type: int
    packets: Sequence[Packet]
    talks: Sequence[Sequence[Segment]]
    talk: Sequence[Segment]
    fresh: Sequence[Segment]

    def ends(self) -> set[str]:
        """Return both ends of the conversation with the fault, as verdicts name them."""
        return {f"{'.'.join(map(str, host))}:{port}" for host, port in self.talk[0][1:3]}


class Mutation(NamedTuple):
    """A change, and the quality and the cause that tell of it; `most`: bytes that are kept of a packet."""

    name: str
    change: Callable[[Subject], Sequence[Packet]]
    quality: str = ""
    cause: str = ""
    most: int = 0

    def is_due(self, subject: Subject) -> bool:
        """Return whether there is something to tell: a capture of short packets is not cut."""
        longest = max(subject.packets[one.place].length for one in subject.talk)
        return bool(self.quality or self.cause) and longest > self.most


def _segment(link_type: int, place: int, data: bytes) -> Segment | None:
    ip = find_ip_header(link_type, data)
    if ip < 0 or len(data) < ip + 40 or data[ip] >> 4 != 4 or data[ip + 9] != 6:
        return None
    length, _, fragment = struct.unpack_from(">HHH", data, ip + 2)
    tcp = ip + (data[ip] & 15) * 4
    source, target, seq, ack, offset, flags = struct.unpack_from(">HHIIBB", data, tcp)
    ends = (data[ip + 12 : ip + 16], source), (data[ip + 16 : ip + 20], target)
    size = length - (tcp - ip) - (offset >> 4) * 4
    return None if fragment & 0x3FFF else Segment(place, *ends, seq, ack, flags, size, ip, tcp)


def _is_up_to(seq: int, most: int) -> bool:
    return (most - seq) % CIRCLE < CIRCLE // 2


def _fresh(talk: Sequence[Segment]) -> list[Segment]:
    """Return the segments with new bytes that are not acknowledged when they pass."""
    following = {one.source: (one.seq + 1) % CIRCLE for one in talk if one.flags & SYN}
    acked, found = dict(following), []
    for one in talk:
        if one.size > 1 and following[one.source] == one.seq and not one.flags & (SYN | FIN | RST):
            if _is_up_to(acked[one.source], one.seq):
                found.append(one)
            following[one.source] = (one.seq + one.size) % CIRCLE
        if one.flags & ACK and _is_up_to(acked[one.target], one.ack):
            acked[one.target] = one.ack
    return found


def _is_whole(talk: Sequence[Segment]) -> bool:
    """Return whether it is there from SYN and SYN-ACK on, and what both ends say is acknowledged."""
    syns = {(one.source, one.seq, one.flags & ACK) for one in talk if one.flags & SYN}
    is_built = bool(talk[0].flags & SYN) and sorted(ack for *_, ack in syns) == [0, ACK]
    data = [one.source for one in talk if one.size > 0]
    acks = [end for end, _ in {(one.source, one.ack) for one in talk if one.flags & (SYN | ACK) == ACK}]
    return (
        is_built and len(data) >= LEAST_DATA and all(acks.count(end) > 1 and end in data for end, *_ in syns)
    )


def subject_of(path: Path, number: int) -> Subject | None:
    """Return a capture and its largest whole conversation; None: it has none."""
    with open_capture(path) as reader:
        packets, links = list(reader), set(reader.link_types)
    if len(links) != 1 or any(late.ns < soon.ns for soon, late in pairwise(packets)):
        return None
    (link_type,) = links
    parted: dict[frozenset[End], list[Segment]] = defaultdict(list)
    for place, packet in enumerate(packets):
        segment = _segment(link_type, place, packet.data)
        if segment is not None:
            parted[frozenset((segment.source, segment.target))].append(segment)
    whole = [(talk, _fresh(talk)) for talk in parted.values() if _is_whole(talk)]
    talk, fresh = max(whole, key=lambda one: len(one[1]), default=((), ()))
    is_enough = len(fresh) >= LEAST_DATA // 2
    return Subject(number, link_type, packets, list(parted.values()), talk, fresh) if is_enough else None


def write_capture(path: Path, link_type: int, packets: Sequence[Packet]) -> None:
    parts = [struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 1 << 18, link_type)]
    for one in packets:
        parts.append(struct.pack("<IIII", *divmod(one.ns, 1_000_000_000), len(one.data), one.length))
        parts.append(one.data)
    path.write_bytes(b"".join(parts))


def _patched(packet: Packet, at: int, value: int, size: int = 4) -> Packet:
    new = (value % (1 << 8 * size)).to_bytes(size, "big")
    return packet._replace(data=packet.data[:at] + new + packet.data[at + size :])


def _numbered(packet: Packet, ip: int, later: int) -> Packet:
    """Return a packet with a number of its own; hosts that number nothing stay at 0."""
    old = int.from_bytes(packet.data[ip + 4 : ip + 6], "big")
    return _patched(packet, ip + 4, old and ((old + later) & 0xFFFF or 1), 2)


def _by_time(packets: Sequence[Packet]) -> list[Packet]:
    return sorted(packets, key=lambda one: one.ns)


def _lose(subject: Subject) -> list[Packet]:
    """Send segments of one end again, as if they had been lost: all that follows waits for that."""
    sources = [one.source for one in subject.fresh]
    sender = max(sorted(set(sources)), key=sources.count)
    of_one = [one for one in subject.fresh if one.source == sender]
    number = min(len(of_one), max(3, -(-len(subject.talk) // 50)))
    evenly = [of_one[(2 * n + 1) * len(of_one) // (2 * number)] for n in range(number)]
    lost = {one.place: one for one in evenly}
    packets, late_ns = [], 0
    for place, packet in enumerate(subject.packets):
        packets.append(packet._replace(ns=packet.ns + late_ns))
        if place in lost:
            late_ns += WAIT_NS[subject.number % 2]
            packets.append(_numbered(packet._replace(ns=packet.ns + late_ns), lost[place].ip, 0x4001))
    return packets


def _reset(subject: Subject) -> list[Packet]:
    """End the conversation about its middle: the receiver of a segment answers it by RST."""
    last = subject.fresh[len(subject.fresh) // 2]
    model = next(
        one for one in reversed(subject.talk) if one.place < last.place and one.source == last.target
    )
    data = subject.packets[model.place].data[: model.tcp + 20]
    reset = subject.packets[last.place]._replace(data=data, length=len(data))
    reset = reset._replace(ns=reset.ns + 1_000_000)
    reset = _patched(_numbered(reset, model.ip, 1), model.ip + 2, len(data) - model.ip, 2)
    reset = _patched(reset, model.tcp + 4, model.seq + model.size + bool(model.flags & SYN))
    reset = _patched(reset, model.tcp + 12, 0x5000 | RST | ACK, 2)
    dropped = {one.place for one in subject.talk if one.place > last.place}
    return _by_time([*[one for at, one in enumerate(subject.packets) if at not in dropped], reset])


def _double(subject: Subject) -> list[Packet]:
    return _by_time([*subject.packets, *[one._replace(ns=one.ns + COPY_NS) for one in subject.packets]])


def _double_unnumbered(subject: Subject) -> list[Packet]:
    packets = list(subject.packets)
    for one in [one for talk in subject.talks for one in talk]:
        packets[one.place] = _patched(packets[one.place], one.ip + 4, 0, 2)
    return _double(subject._replace(packets=packets))


def _cut_at(most: int) -> Callable[[Subject], list[Packet]]:
    return lambda subject: [one._replace(data=one.data[:most]) for one in subject.packets]


def _one_way(subject: Subject) -> list[Packet]:
    dropped = set[int]()
    for talk in subject.talks:
        caller = next((one.source for one in talk if one.flags & (SYN | ACK) == SYN), talk[0].source)
        dropped |= {one.place for one in talk if (one.source == caller) == bool(subject.number % 2)}
    return [one for place, one in enumerate(subject.packets) if place not in dropped]


def _stop_clock(subject: Subject) -> list[Packet]:
    return [one._replace(ns=subject.packets[0].ns) for one in subject.packets]


def _turn_clock_back(subject: Subject) -> list[Packet]:
    times = [subject.packets[one.place].ns for one in subject.talk]
    nearest = sorted(range(1, len(times)), key=lambda n: times[n] - times[n - 1])[:2]
    steps = [subject.talk[n].place for n in nearest]
    left = [sum(place < step for step in steps) for place in range(len(subject.packets))]
    return [one._replace(ns=one.ns + STEP_NS * n) for one, n in zip(subject.packets, left, strict=True)]


def _jump(subject: Subject) -> list[Packet]:
    """Let the numbers of one end jump in the middle; in every second capture the other acknowledges that."""
    middle = subject.fresh[len(subject.fresh) // 2]
    packets = list(subject.packets)
    for one in [one for one in subject.talk if one.place >= middle.place]:
        if one.source == middle.source:
            packets[one.place] = _patched(packets[one.place], one.tcp + 4, one.seq + JUMP)
        elif subject.number % 2:
            packets[one.place] = _patched(packets[one.place], one.tcp + 8, one.ack + JUMP)
    return packets


JUMPED: Final = "sequence jump of 1.5 GiB"
MUTATIONS: Final = (
    Mutation("packets dropped after the tap", _lose, cause="loss"),
    Mutation("cut by RST in mid message", _reset, cause="resets"),
    Mutation("all packets twice", _double, "duplicated"),
    Mutation("all packets twice, unnumbered", _double_unnumbered),
    Mutation("snaplen 96", _cut_at(96), "snaplen", most=96),
    Mutation("snaplen 54", _cut_at(54), "snaplen", most=54),
    Mutation("one direction removed", _one_way, "one-direction"),
    Mutation("equal stamps", _stop_clock, "clock"),
    Mutation("clock goes back", _turn_clock_back, "clock"),
    Mutation(JUMPED, _jump),
)
