"""`trcvtui conversations`: what is in a capture, and which end of each conversation is the PLC."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from heapq import heappop, heappush
from ipaddress import ip_address
from typing import Any, Final

from trcvtui.capture.pcap import Packet, open_capture
from trcvtui.capture.reassembly import Conversation, Conversations, WireDirection
from trcvtui.errors import Problem, UserError, mistake
from trcvtui.net.results import end_in_words
from trcvtui.records import NamedTuple

# The first three bytes of MACs, as the IEEE gave them.
_MACS: Final = {
    "Beckhoff": "000105",
    "Bosch Rexroth": "000B0F 006034",
    "Mitsubishi Electric": "002692 080070 104B46 28E98E 30BE3B 38E08E 58528A 588D39 94A4B5",
    "Omron": "00000A 3CF7D1",
    "Phoenix Contact": "00A045 A8741D CCCCEA",
    "Pilz": "000248",
    "Rockwell Automation": "0000BC 001D9C 086195 184C08 34C0F9 404101 5C2167 5C8816 68C8EB BCF499 E48EBB "
    "E49069 F45433",
    "Schneider Electric": "000054 000417 0080F4 9C0E51",
    "Siemens": "0001E3 000BA3 000E8C 001B1B 001C06 001FF8 080006 10DFFC 208756 20A8B9 286336 301389 302F1E "
    "30B851 384B24 40ECF8 4CE705 681FD8 683E02 789F87 883F99 8CF319 AC6417 D4F527 E0DCA0 E8EF22 EC1C5D",
    "WAGO": "0030DE",
}
VENDORS: Final = {bytes.fromhex(mac): name for name, macs in _MACS.items() for mac in macs.split()}
_TITLES: Final = ("ID", "PLC END", "PARTNER END", "AT", "FOR", "TO PLC", "FROM PLC")
WIDTH: Final = 80  # columns of text


class PlcEnd(NamedTuple):
    """What `--plc` names: an address as bytes; None: any port."""

    address: bytes
    port: int | None


class PlcGuess(NamedTuple):
    """Which end is the PLC's: what it says, how sure that is (0 to 1), and why."""

    says: WireDirection
    confidence: float
    why: str


def parse_plc(text: str) -> PlcEnd:
    """Return the end that `10.0.0.5`, `10.0.0.5:2000`, `fd00::1` or `[fd00::1]:2000` names."""
    found = end_in_words(text)
    if found is None:
        raise mistake("--plc", f"'{text}'", "10.0.0.5, 10.0.0.5:2000 or [fd00::1]:2000")
    return PlcEnd(*found)


def guess_plc(
    conversation: Conversation, given: PlcEnd | None = None, plc_ports: frozenset[int] = frozenset()
) -> PlcGuess:
    """Return the PLC end: as given, by a vendor's MAC, by the project's ports, or the listening end."""
    ends = (conversation.there, conversation.back)
    if given is not None:
        fits = [
            end for end in ends if end.address[0] == given.address and given.port in (None, end.address[1])
        ]
        if fits:
            return PlcGuess(fits[-1], 1.0, "--plc")
    vendors = [end for end in ends if end.mac[:3] in VENDORS]
    if len(vendors) == 1:
        return PlcGuess(vendors[0], 0.9, f"MAC of {VENDORS[vendors[0].mac[:3]]}")
    listening = [end for end in ends if end.address[1] in plc_ports]
    if len(listening) == 1:
        return PlcGuess(listening[0], 0.8, f"port {listening[0].address[1]} of the project")
    if conversation.listener is not None:
        return PlcGuess(conversation.listener, 0.6, "it listens: the SYN went there")
    lower = min(ends, key=lambda end: end.address[1])
    if ends[0].address[1] == ends[1].address[1]:
        return PlcGuess(conversation.back, 0.2, "the first packet went there")
    return PlcGuess(lower, 0.3, "the lower port: it may listen there")


def in_time_order(paths: Sequence[str], troubles: list[Problem]) -> Iterator[tuple[Packet, int]]:
    """Yield the packets of one capture in several files, each with its link type.

    A file is opened when its time has come; where its reading stopped is added to `troubles`.
    """
    waiting = sorted(((_first_ns(path), n) for n, path in enumerate(paths)), reverse=True)
    running: list[tuple[int, int, Packet, int, Iterator[tuple[Packet, int]]]] = []

    def put_next(number: int, packets: Iterator[tuple[Packet, int]]) -> None:
        found = next(packets, None)
        if found is not None:
            heappush(running, (found[0].ns, number, *found, packets))

    while waiting or running:
        while waiting and (not running or waiting[-1][0] <= running[0][0]):
            number = waiting.pop()[1]
            packets = _packets_of(paths[number], troubles)
            if not waiting and not running:
                yield from packets
            else:
                put_next(number, packets)
        if running:
            _, number, packet, link_type, packets = heappop(running)
            yield packet, link_type
            put_next(number, packets)


def _first_ns(path: str) -> int:
    with open_capture(path) as reader:
        first = next(iter(reader), None)
        return 0 if first is None else first.ns


def _packets_of(path: str, troubles: list[Problem]) -> Iterator[tuple[Packet, int]]:
    with open_capture(path) as reader:
        for packet in reader:
            yield packet, reader.link_types[packet.interface]
        if reader.trouble is not None:
            troubles.append(reader.trouble)


def take_captures(paths: Sequence[str], found: Conversations, troubles: list[Problem]) -> None:
    """Take all packets of captures, of several in the order of time; raise UserError for what is none."""
    if len(paths) == 1:
        with open_capture(paths[0]) as reader:
            found.take_all(reader, reader.link_types)
            troubles += [reader.trouble] if reader.trouble else []
    else:
        for packet, link_type in in_time_order(paths, troubles):
            found.take(packet, link_type)
    found.close()


def conversations_of(
    paths: Sequence[str], plc: str | None, form: str, plc_ports: frozenset[int] = frozenset()
) -> Iterator[str]:
    """Yield the lines of `trcvtui conversations`; raise UserError where nothing can be read."""
    given = None if plc is None else parse_plc(plc)
    found, troubles = Conversations(), list[Problem]()
    take_captures(paths, found, troubles)
    if troubles and not found.packets:
        raise UserError(troubles)
    rows = (conversation_row(found, one, given, plc_ports) for one in found.all)
    yield from _as_json(rows) if form == "json" else _as_table(rows)
    for line in capture_notes(found, troubles):
        sys.stderr.write(line + "\n")


def capture_notes(found: Conversations, troubles: list[Problem]) -> Iterator[str]:
    """Yield what is to be said of what was read, and of what was not."""
    if not found.all:
        yield f"no conversation in {found.packets} packets"
    for why, count in found.unread.items():
        yield f"not read: {count} {why.value}"
    if found.unlisted:
        yield f"not read: {found.unlisted} packets of conversations after number {len(found.all)}"
    for trouble in troubles:
        yield f"{trouble}; read up to there"


def conversation_row(
    found: Conversations,
    conversation: Conversation,
    given: PlcEnd | None,
    plc_ports: frozenset[int] = frozenset(),
) -> dict[str, Any]:
    """Return what is told of a conversation, as JSON has it."""
    guess = guess_plc(conversation, given, plc_ports)
    partner = guess.says.other
    end = "open"
    if conversation.end is not None:
        end = f"{conversation.end[0]}-{'plc' if conversation.end[1] is guess.says else 'partner'}"
    first_ns = found.first_ns or 0
    return {
        "id": f"C{conversation.number}",
        "protocol": conversation.protocol,
        "plc": address_text(guess.says.address),
        "partner": address_text(partner.address),
        "plc_guess": {"confidence": guess.confidence, "why": guess.why},
        "t_s": (conversation.first_ns - first_ns) / 1e9,
        "duration_s": (conversation.last_ns - conversation.first_ns) / 1e9,
        "begin": "syn" if conversation.begins_with_syn else "middle",
        "end": end,
        "to_plc": _counts(partner),
        "from_plc": _counts(guess.says),
    }


def _counts(direction: WireDirection) -> dict[str, int]:
    return {
        "bytes": direction.bytes,
        "segments": direction.segments,
        "retransmitted": direction.retransmitted,
        "missing": direction.missing,
    }


def address_text(end: tuple[bytes, int]) -> str:
    """Return an end as `10.0.0.5:2000` or `[fd00::1]:2000`."""
    address = ip_address(end[0])
    return f"{address}:{end[1]}" if address.version == 4 else f"[{address}]:{end[1]}"


def _as_json(rows: Iterator[dict[str, Any]]) -> Iterator[str]:
    before = "["
    for row in rows:
        yield before + json.dumps(row)
        before = ","
    yield "]" if before == "," else "[]"


def _as_table(rows: Iterator[dict[str, Any]]) -> Iterator[str]:
    """Yield a line for each conversation, two where its ends are long, and below it what is said of it."""
    found = [(_cells(row), _remarks(row)) for row in rows]
    if not found:
        return
    widths = [max(len(title), *(len(cells[n]) for cells, _ in found)) for n, title in enumerate(_TITLES)]
    lines, used = [[0]], widths[0]
    for n, width in enumerate(widths[1:], 1):
        if used + 2 + width > WIDTH:
            lines.append([])
            used = 2
        lines[-1].append(n)
        used += 2 + width
    for cells, remarks in ((_TITLES, ()), *found):
        for number, columns in enumerate(lines):
            text = "  ".join(cells[n].ljust(widths[n]) for n in columns)
            yield ("    " * (number > 0) + text).rstrip()
        yield from remarks


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    times = (f"{row[name]:.3f}s" for name in ("t_s", "duration_s"))
    sizes = (f"{row[name]['bytes']} B" for name in ("to_plc", "from_plc"))
    return row["id"], row["plc"], row["partner"], *times, *sizes


def _remarks(row: dict[str, Any]) -> tuple[str, ...]:
    """Return how it began and ended, how sure it is who is who, and what was not as it should be."""
    guess = row["plc_guess"]
    begun = f"    {row['protocol']}, {row['begin']} to {row['end']}; "
    told = [f"{begun}PLC end {guess['confidence']:.0%} sure: {guess['why']}"]
    for name, way in (("to_plc", "to PLC"), ("from_plc", "from PLC")):
        counts = row[name]
        if counts["retransmitted"] or counts["missing"]:
            told.append(
                f"    {way}, bytes of {counts['segments']} segments: "
                f"{counts['retransmitted']} sent again, {counts['missing']} missing"
            )
    return tuple(told)
