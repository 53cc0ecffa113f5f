"""`trcvtui conversations` shows the content of a capture in one or several files."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from heapq import heappop, heappush
from typing import Any, Final

from trcvtui.capture.hosts import HostFact
from trcvtui.capture.pcap import CaptureReader, Packet, open_capture
from trcvtui.capture.plc_end import NO_KNOWN_ENDS, KnownEnds, PlcEnd, address_text, guess_plc, parse_plc
from trcvtui.capture.quality import find_limits
from trcvtui.capture.reassembly import Conversation, Conversations, WireDirection
from trcvtui.errors import Problem, UserError
from trcvtui.wording import count, json_text

_TITLES: Final = ("ID", "PLC END", "PARTNER END", "AT", "FOR", "TO PLC", "FROM PLC")
SHOWN_KINDS: Final = 4  # of what is not read
TABLE_WIDTH: Final = 80  # columns of text


def merge_packets(paths: Sequence[str], troubles: list[Problem]) -> Iterator[tuple[Packet, CaptureReader]]:
    """Yield the packets of a capture in several files, each packet with its reader.

    The first packet of each file is read at once, later packets in turn. `troubles` collects read errors.
    """
    waiting = sorted(((_first_ns(path), n) for n, path in enumerate(paths)), reverse=True)
    running: list[tuple[int, int, Packet, CaptureReader, Iterator[tuple[Packet, CaptureReader]]]] = []

    def put_next(number: int, packets: Iterator[tuple[Packet, CaptureReader]]) -> None:
        found = next(packets, None)
        if found is not None:
            heappush(running, (found[0].ns, number, *found, packets))

    while waiting or running:
        while waiting and (not running or waiting[-1][0] <= running[0][0]):
            number = waiting.pop()[1]
            packets = _read_packets(paths[number], troubles)
            if not waiting and not running:
                yield from packets
            else:
                put_next(number, packets)
        if running:
            _, number, packet, reader, packets = heappop(running)
            yield packet, reader
            put_next(number, packets)


def _first_ns(path: str) -> int:
    with open_capture(path) as reader:
        first = next(iter(reader), None)
        return 0 if first is None else first.ns


def _read_packets(path: str, troubles: list[Problem]) -> Iterator[tuple[Packet, CaptureReader]]:
    with open_capture(path) as reader:
        for packet in reader:
            yield packet, reader
        if reader.trouble is not None:
            troubles.append(reader.trouble)


def read_captures(paths: Sequence[str], found: Conversations, troubles: list[Problem]) -> None:
    """Read all packets, several files in order of time. Raise UserError for a file that is no capture."""
    if len(paths) == 1:
        with open_capture(paths[0]) as reader:
            found.names = reader.interface_name
            found.add_packets(reader, reader.link_types)
            found.drops = reader.drop_count
            troubles += [reader.trouble] if reader.trouble else []
    else:
        for packet, reader in merge_packets(paths, troubles):
            found.names = reader.interface_name
            found.add_packet(packet, reader.link_types[packet.interface])
            found.drops = max(found.drops, reader.drop_count)
    found.close()


def format_conversations(
    paths: Sequence[str], plc: str | None, form: str, known: KnownEnds | None = None
) -> Iterator[str]:
    """Yield the lines of `trcvtui conversations`. Raise UserError if nothing can be read."""
    given = None if plc is None else parse_plc(plc)
    found, troubles = Conversations(), list[Problem]()
    read_captures(paths, found, troubles)
    if troubles and not found.packets:
        raise UserError(troubles)
    rows = (conversation_row(found, one, given, known or NO_KNOWN_ENDS) for one in found.all)
    if form == "json":
        yield from _as_json((*rows, *(_fact_row(one, found.first_ns or 0) for one in found.host_facts())))
    else:
        yield from _as_table(rows)
        for number, fact in enumerate(found.host_facts()):
            yield from ["apart from the conversations"] * (not number)
            yield f"    {fact.display_line}"
    for line in capture_notes(found, troubles, with_hosts=False):
        sys.stderr.write(line + "\n")


def capture_notes(found: Conversations, troubles: list[Problem], with_hosts: bool = True) -> Iterator[str]:
    """Yield notes on a whole capture. If `with_hosts`, include what ARP and ICMP say."""
    if with_hosts:
        yield from (fact.display_line for fact in found.host_facts())
    if not found.all:
        yield f"no conversation in {found.packets} packets"
    if found.others:
        shown = found.others.most_common(SHOWN_KINDS)
        kinds = [count(number, kind.name) + kind.number for kind, number in shown]
        if more := found.others.total() - sum(number for _, number in shown):
            kinds.append(f"{count(more, 'packet')} of {count(len(found.others) - len(shown), 'other kind')}")
        yield f"not read (neither TCP nor UDP): {', '.join(kinds)}"
    for why, number in found.not_read.items():
        yield f"not read: {number} {why.value}"
    if found.unlisted:
        yield f"not read: {count(found.unlisted, 'packet')} of conversations after the first {len(found.all)}"
    for trouble in troubles:
        yield f"{trouble}; only the packets before that are read"


def conversation_row(
    found: Conversations, conversation: Conversation, given: PlcEnd | None, known: KnownEnds = NO_KNOWN_ENDS
) -> dict[str, Any]:
    guess = guess_plc(conversation, given, known)
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
        "quality": [*find_limits(conversation, found.drops)],
    }


def _fact_row(fact: HostFact, first_ns: int) -> dict[str, Any]:
    t_s = (fact.ns - first_ns) / 1e9 if fact.packets else None
    return {"id": None, "cause": fact.cause, "t_s": t_s, "text": fact.text, "packets": fact.packets}


def _counts(direction: WireDirection) -> dict[str, int | None]:
    return {
        "bytes": direction.byte_count,
        "segments": direction.segments,
        "retransmitted": direction.retransmitted,
        "missing": None if direction.has_jumped else direction.missing,
        "copies": direction.copies,
    }


def _as_json(rows: Iterable[dict[str, Any]]) -> Iterator[str]:
    before = "["
    for row in rows:
        yield before + json_text(row)
        before = ","
    yield "]" if before == "," else "[]"


def _as_table(rows: Iterator[dict[str, Any]]) -> Iterator[str]:
    found = [(_cells(row), _remarks(row)) for row in rows]
    if not found:
        return
    widths = [max(len(title), *(len(cells[n]) for cells, _ in found)) for n, title in enumerate(_TITLES)]
    lines, used = [[0]], widths[0]
    for n, width in enumerate(widths[1:], 1):
        if used + 2 + width > TABLE_WIDTH:
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
    guess = row["plc_guess"]
    begun = f"    {row['protocol']}, {row['begin']} to {row['end']}; "
    lines = [f"{begun}PLC end ({guess['confidence']:.0%} sure): {guess['why']}"]
    for name, way in (("to_plc", "to PLC"), ("from_plc", "from PLC")):
        counts = row[name]
        if counts["retransmitted"] or counts["missing"]:
            lines.append(
                f"    {way}, {count(counts['segments'], 'segment')}: "
                f"{counts['retransmitted']} B sent again, {counts['missing'] or 0} B missing"
            )
        if counts["copies"]:
            lines.append(f"    {way}: {counts['copies']} packets twice, as a mirror port shows them")
    if row["quality"]:
        lines.append(f"    quality: {', '.join(row['quality'])}")
    return tuple(lines)
