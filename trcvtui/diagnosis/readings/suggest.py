"""`doctor --suggest project.toml` makes a project for the messages of a partner, from their bytes alone.

Rule: the proof beside each line says how many of all messages the line explains, and what it does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.blocks.framing import Framing
from trcvtui.blocks.serial.com_buffer import LineChunk, LineRecording
from trcvtui.blocks.table import BlockRow, block_row
from trcvtui.capture.plc_end import parse_plc
from trcvtui.diagnosis.frame_causes import measure_sizes, select_whole_messages, speaks_session
from trcvtui.diagnosis.line_facts import PAUSE_NS, LineFacts, LineMessage, collect_facts
from trcvtui.diagnosis.message_joints import find_length_field
from trcvtui.diagnosis.readings.framing_advice import MOST_FRAMES, advise_framings
from trcvtui.diagnosis.readings.members import FoundType, find_message_type
from trcvtui.diagnosis.readings.proposal import CutKind, describe_workaround, list_evidence, make_title
from trcvtui.diagnosis.readings.trial import LengthField, cut_by_length, join_chunks
from trcvtui.dialects import DIALECTS
from trcvtui.errors import mistake
from trcvtui.files import write_file
from trcvtui.wording import count

LEAST_SHARE: Final = 0.95  # of messages or bytes, that a suggestion has to explain
LEAST_MESSAGES: Final = 3
MOST_LINES: Final = 8
MOST_DATA: Final = 65_536


class Suggestion(NamedTuple):
    """One way to receive the messages of a conversation. `size` is the size of DATA.

    The block is ReceiveData if `framing` is set, URECV_C if `is_datagram`, else TRCV_C (ADHOC = `adhoc`).
    """

    line: LineFacts
    size: int
    adhoc: bool
    is_datagram: bool
    framing: Framing | None
    type: FoundType | None
    proof: tuple[str, ...]


def write_suggested_project(paths: Sequence[str], plc: str | None, project: Path) -> tuple[str, ...]:
    """Write a project and a file of its types; return a line of proof per PLC end. Raise UserError."""
    given = None if plc is None else parse_plc(plc)
    lines = [line for path in paths for line in collect_facts([path], given, receives=True).lines]
    best: dict[object, Suggestion] = {}
    for line in lines:
        found = _suggest_for_line(line)
        if found is not None:
            known = best.get(line.plc_end)
            if known is None or line.to_plc.bytes > known.line.to_plc.bytes:
                best[line.plc_end] = found
    if not best:
        expected = f"a capture with {LEAST_MESSAGES} messages to a PLC end, not in TLS and not ISO-on-TCP"
        raise mistake("--suggest", f"{count(len(lines), 'conversation')} without such messages", expected)
    kept = sorted(best.values(), key=lambda one: -one.line.to_plc.bytes)[:MOST_LINES]
    types = "".join(one.type.st(f"Message_{n}") for n, one in enumerate(kept, 1) if one.type is not None)
    beside = project.with_suffix(".st")
    for taken in (project, *((beside,) if types else ())):
        if taken.exists():
            raise mistake("--suggest", f"{taken}, which is there already", "the name of a new file")
    if types:
        write_file(beside, types, "--suggest", is_new=True)
    write_file(project, "\n".join(_to_toml(kept, beside.name if types else "")), "--suggest", is_new=True)
    return tuple([f"{project}: {one.line.plc}: {one.proof[0]}" for one in kept])


# -- one conversation ----------------------------------------------------------------------------------------


def _suggest_for_line(line: LineFacts) -> Suggestion | None:
    messages = select_whole_messages(line)
    if len(messages) < LEAST_MESSAGES or speaks_session(line):
        return None
    sizes = measure_sizes(messages)
    is_datagram = line.protocol == "udp"
    if line.protocol != "serial" and sizes.share >= LEAST_SHARE and 0 < sizes.usual <= MOST_DATA:
        fitting = round(sizes.share * sizes.messages)
        proof = f"messages of {sizes.usual} bytes: {fitting} of {sizes.messages}"
        return _suggest_fixed(line, sizes.usual, is_datagram, proof, 0 if line.has_begin else messages[0].at)
    most = min(max(one.size for one in messages), MOST_DATA)
    whole = sum(one.pieces == 1 and one.size <= most for one in messages)
    if not is_datagram:
        comes_whole = line.protocol != "serial" and whole >= LEAST_SHARE * len(messages)
        found = _suggest_framing(line, takes_gap=not comes_whole)
        if found is not None or line.protocol == "serial":
            return found
    return _suggest_ad_hoc(line, ())


def _suggest_ad_hoc(line: LineFacts, against: Sequence[str]) -> Suggestion:
    messages = select_whole_messages(line)
    most = min(max(one.size for one in messages), MOST_DATA)
    whole = sum(one.pieces == 1 and one.size <= most for one in messages)
    is_datagram = line.protocol == "udp"
    proof = f"messages of {min(one.size for one in messages)} to {most} bytes"
    if not is_datagram:
        proof += f", each received at once: {whole} of {len(messages)} came in one piece"
    return Suggestion(line, most, not is_datagram, is_datagram, None, None, (proof, *against))


def _suggest_fixed(line: LineFacts, size: int, is_datagram: bool, proof: str, start: int) -> Suggestion:
    content = bytes(line.to_plc.content)
    parts = [content[at : at + size] for at in range(start, len(content) - size + 1, size)]
    return Suggestion(line, size, False, is_datagram, None, find_message_type(parts), (proof,))


def _suggest_framing(line: LineFacts, takes_gap: bool) -> Suggestion | None:
    content, said = bytes(line.to_plc.content), line.to_plc.writes
    chunks = [
        LineChunk(one.ns - line.first_ns, content[one.at : one.at + one.size], not number)
        for number, one in enumerate(said)
        if one.at + one.size <= len(content)
    ]
    source = "serial" if line.protocol == "serial" else "tcp"
    recording = LineRecording(source, tuple(chunks), line.last_ns - line.first_ns, 1)
    if source == "tcp" and (by_length := _suggest_length_field(line, recording)) is not None:
        return by_length
    against, rank = list[str](), 1
    for each in advise_framings(recording).proposals:
        if each.rank > rank:
            break
        whole = (
            f"{each.title}: {each.frames} of {each.of_frames} frames, {each.explained} of {each.total} bytes"
        )
        if each.explained < LEAST_SHARE * each.total or (each.kind is CutKind.GAP and not takes_gap):
            continue
        if doubt := _contradiction(line, each.framing.suffix) if source == "tcp" and each.framing else "":
            against.append(f"not {each.title}: {doubt}")
            rank = each.rank + 1
            continue
        if each.kind is CutKind.SIZE and each.framing is not None and source == "tcp":
            return _suggest_fixed(line, each.framing.size, False, whole, 0)
        proof = (whole, *each.evidence, *each.doubt, *against)
        if each.framing is not None:
            return Suggestion(line, each.longest, True, False, each.framing, None, proof)
        if source == "tcp":
            return Suggestion(line, each.longest, True, False, None, None, (*proof, each.instead))
    return None if not against else _suggest_ad_hoc(line, against)


def _suggest_length_field(line: LineFacts, recording: LineRecording) -> Suggestion | None:
    """Return the suggestion by a length field that is right in each message between two pauses."""
    content = bytes(line.to_plc.content)
    place = find_length_field([content[one.at : one.at + one.size] for one in _whole_messages(line, content)])
    if place is None:
        return None
    field = LengthField(*place)
    made = cut_by_length(join_chunks(recording), field, MOST_DATA, MOST_FRAMES)
    explained = sum(len(frame.content) for frame in made.good)
    if not made.good or explained < LEAST_SHARE * made.total:
        return None
    framing, kind = Framing(field.head_size), CutKind.LENGTH
    frames = f"{len(made.good)} of {len(made.frames)} frames, {explained} of {made.total} bytes"
    proof = (
        f"{make_title(kind, framing, field)}: {frames}",
        *list_evidence(kind, framing, field, made, recording),
    )
    longest = max(len(frame.content) for frame in made.good)
    return Suggestion(line, longest, True, False, None, None, (*proof, describe_workaround(field)))


def _whole_messages(line: LineFacts, content: bytes) -> list[LineMessage]:
    return [one for one in select_whole_messages(line) if one.at + one.size <= len(content)]


def _contradiction(line: LineFacts, suffix: bytes) -> str:
    """Return a text if fewer than 80 % of the pauses follow the suffix. Return "" if pauses are too few."""
    content, messages = bytes(line.to_plc.content), line.messages
    ends = [
        before.at + before.size
        for before, after in pairwise(messages)
        if suffix and after.ns - before.ns >= PAUSE_NS and before.at + before.size <= len(content)
    ]
    hits = sum(content.endswith(suffix, 0, end) for end in ends)
    if len(ends) < LEAST_MESSAGES or hits * 10 >= 8 * len(ends):
        return ""
    return f"{hits} of {len(ends)} pauses follow the suffix {suffix.hex(' ').upper()}, so it is data"


# -- the project ---------------------------------------------------------------------------------------------


def _to_toml(found: Sequence[Suggestion], types: str) -> Iterator[str]:
    dialect = _choose_dialect(any(one.framing is not None for one in found))
    marks = [(n, one.framing) for n, one in enumerate(found, 1) if one.framing is not None]
    yield "# What the partner's bytes say by themselves, with the proof of each. Addresses are the capture's."
    yield f'dialect = "{dialect}"'
    writes = [
        f"write {word}_{n} hex {mark.hex(' ')}"
        for n, framing in marks
        for word, mark in (("prefix", framing.prefix), ("suffix", framing.suffix))
        if mark
    ]
    if writes:
        yield from ("start = '''", *writes, "'''")
    if types:
        yield from ("", "[[udt]]", f'file = "{types}"')
    for n, one in enumerate(found, 1):
        yield ""
        yield from (f"# {' '.join(text.split())}" for text in one.proof)
        yield from _format_data(n, one)
        yield from _format_connection(n, one)
        yield from _format_receiver(n, one, dialect)


def _table(kind: str, **keys: object) -> Iterator[str]:
    yield from ("", f"[[{kind}]]")
    for key, value in keys.items():
        if value is not None:
            shown = str(value).lower() if isinstance(value, bool) else value
            yield f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {shown}"


def _format_data(n: int, one: Suggestion) -> Iterator[str]:
    order, type_ = None, f"ARRAY[0..{max(one.size, 1) - 1}] OF BYTE"
    if one.type is not None:
        order, type_ = one.type.order, f"Message_{n}"
    yield from _table("data", name=f"data_{n}", type=type_, layout=order and "packed", byte_order=order)
    if one.framing is not None:
        chunk = f"ARRAY[0..{max(one.size, 64) - 1}] OF BYTE"
        if one.line.protocol != "serial":
            yield from _table("data", name=f"chunk_{n}", type=chunk)
        for word, mark in (("prefix", one.framing.prefix), ("suffix", one.framing.suffix)):
            if mark:
                size = "BYTE" if len(mark) == 1 else f"ARRAY[0..{len(mark) - 1}] OF BYTE"
                yield from _table("data", name=f"{word}_{n}", type=size)


def _format_connection(n: int, one: Suggestion) -> Iterator[str]:
    line = one.line
    if line.protocol == "serial":
        return
    (plc, _, port), (partner, _, partner_port) = line.plc.rpartition(":"), line.partner.rpartition(":")
    name = f"C{n}"
    if one.is_datagram:
        yield from _table("udp_config", name=name, LocalAddress="127.0.0.1", LocalPort=int(port))
        yield from _table("addr", name=f"from_{n}")
        yield from _table("watch", name=f"L{n}", plc=line.plc, connect=name)
    elif line.plc_calls:
        far = None if ":" in partner else partner
        yield from _table(
            "connect", name=name, ActiveEstablished=True, LocalAddress="127.0.0.1",
            RemoteAddress=far or "127.0.0.1", RemotePort=int(partner_port),
        )  # fmt: skip
        yield from _table("watch", name=f"L{n}", plc=plc.strip("[]"), connect=name, partner=line.partner)
    else:
        yield from _table("connect", name=name, LocalAddress="127.0.0.1", LocalPort=int(port))
        yield from _table("watch", name=f"L{n}", plc=line.plc, connect=name)


def _choose_dialect(frames: bool) -> str:
    """Return the first dialect. With `frames`, the dialect must have a block for any prefix and suffix."""
    return next(
        name
        for name, dialect in DIALECTS.items()
        if not frames or any(block_row(block).mark_lengths for block in dialect.blocks)
    )


def _choose_block(dialect: str, is_it: Callable[[BlockRow], object]) -> BlockRow:
    return next(row for row in map(block_row, DIALECTS[dialect].blocks) if is_it(row))


def _format_receiver(n: int, one: Suggestion, dialect: str) -> Iterator[str]:
    framing, is_serial = one.framing, one.line.protocol == "serial"
    if one.is_datagram:
        row = _choose_block(dialect, lambda row: row.receives_on_net and row.speaks_udp)
        yield from _table(
            "instance", name=f"{row.name}_{n}", block=row.name, config=f"C{n}", addr=f"from_{n}",
            data=f"data_{n}", EN_R=True,
        )  # fmt: skip
        return
    row = _choose_block(dialect, lambda row: row.receives_on_net and row.owns_link)
    if not is_serial:
        data = f"data_{n}" if framing is None else f"chunk_{n}"
        yield from _table(
            "instance", name=f"{row.name}_{n}", block=row.name, connect=f"C{n}", data=data, CONT=True,
            EN_R=True, ADHOC=True if one.adhoc else None, LEN=None if one.adhoc else one.size,
        )  # fmt: skip
    if framing is None:
        return
    yield from _table("combuffer", name=f"RX_{n}", source="sim" if is_serial else f"{row.name}_{n}")
    row = _choose_block(dialect, lambda row: row.mark_lengths)
    keys: dict[str, object] = {row.buffer_pin: f"RX_{n}", "data": f"data_{n}"}
    marks = zip(
        row.pointers, row.mark_lengths, ("prefix", "suffix"), (framing.prefix, framing.suffix), strict=True
    )
    for pointer, length, word, mark in marks:
        if mark:
            keys |= {pointer: f"{word}_{n}", length: len(mark)}
    if framing.timeout_ns:
        keys["Timeout"] = f"T#{framing.timeout_ns // 1_000_000}ms"
    yield from _table("instance", name=f"FRAMES_{n}", block=row.name, **keys, **{row.data_length: one.size})
