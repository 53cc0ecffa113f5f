"""Compares messages with what a receiver expects: their sizes, where they begin, what their bytes mean.

Rule: only the receiver of a project or of a type knows LEN and members. Without a receiver these rules
find only several messages in one segment (`merged`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import gcd
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.diagnosis.data_values import describe_odd_values, find_unwritten_members, make_data_layout
from trcvtui.diagnosis.frame_readings import judge_readings
from trcvtui.diagnosis.line_facts import LineFacts, LineMessage, SegmentFacts
from trcvtui.diagnosis.message_joints import find_head_and_body, find_joined_messages
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.diagnosis.remedies import NO_OFFER, CauseRule, RemedyOffer, finding_to_plc, offer_frame_reset
from trcvtui.diagnosis.session_causes import find_unit_heads, is_session_begin, is_tls_head, judge_plain_tcp
from trcvtui.diagnosis.text_forms import (
    SEND_BYTES,
    describe_sent_strings,
    describe_utf_8_bytes,
    find_text,
    has_only_numbers,
    offer_string,
    offer_text,
)
from trcvtui.snapshots.doctor import Finding, Remedy
from trcvtui.udt.types import StringType
from trcvtui.wording import SECOND, count

FEW_MESSAGES: Final = 3  # fewer sizes say little
SPLIT_NS: Final = 4_000_000  # a pause that a scan may fall into
STATIC, AD_HOC, DATAGRAM = "static", "ad-hoc", "datagram"
MOST_FRAMES: Final = 8
MOST_MESSAGES: Final = 256  # of which the bytes are examined


class SizeStatistics(NamedTuple):
    """The sizes of messages: the usual size, its share, the number of different sizes."""

    usual: int
    share: float
    different: int
    messages: int


def select_whole_messages(line: LineFacts) -> tuple[LineMessage, ...]:
    """Leave out messages that the capture, an end or a closed window may have cut, if enough remain."""
    found = line.messages
    closed = line.from_plc.closed
    if closed:
        free = tuple([one for one in found if one.ns < closed[0].ns][:-1])
        found = free if len(free) >= FEW_MESSAGES else found
    if len(found) > FEW_MESSAGES and not line.has_begin:
        found = found[1:]
    if len(found) > FEW_MESSAGES and line.end is not None:
        found = found[:-1]
    return found


def measure_sizes(messages: Sequence[LineMessage]) -> SizeStatistics:
    """Return the sizes of messages; a multiple of a frequent size counts as several of that size."""
    counted = Counter(one.size for one in messages)
    if not counted:
        return SizeStatistics(0, 0.0, 0, 0)
    base = min((size for size, often in counted.items() if often * 3 >= len(messages)), default=0)
    usual, often = counted.most_common(1)[0]
    if base and len(messages) >= 5 and usual % base == 0:
        multiples = sum(n for size, n in counted.items() if size % base == 0)
        if multiples * 10 >= len(messages) * 9 and len(counted) > 1:  # TCP joined some of them
            return SizeStatistics(base, multiples / len(messages), len(counted), len(messages))
    return SizeStatistics(usual, often / len(messages), len(counted), len(messages))


def _check_kind(line: LineFacts, receiver: Receiver | None, kind: str) -> Receiver | None:
    if receiver is None or not receiver.need or receiver.is_whole or receiver.is_secure:
        return None
    if (
        len(line.from_plc.closed) >= FEW_MESSAGES
        and line.messages[FEW_MESSAGES:]
        and line.from_plc.closed[0].ns <= line.messages[FEW_MESSAGES].ns
    ):
        return None  # the window cut the stream, not pauses
    known = DATAGRAM if line.protocol == "udp" else AD_HOC if receiver.adhoc else STATIC
    is_read = known == kind and line.to_plc.writes and not speaks_session(line, receiver)
    return receiver if is_read else None


def _first_frame_byte(line: LineFacts) -> int:
    return 0 if line.has_begin else line.messages[0].at


def _fits_frames(line: LineFacts, need: int) -> bool:
    found = select_whole_messages(line)
    start = _first_frame_byte(line) if line.has_begin else found[0].at
    hits = [(one.at + one.size - start) % need == 0 for one in found]
    if sum(hits) * 100 >= 97 * len(hits):
        return True
    ends = {one.at + one.size for one in found}
    frames = range(start + need, found[-1].at + found[-1].size + 1, need)
    whole = sum(end in frames for end in ends)  # by ends: a hole may be two gigabytes wide
    is_varied = Counter(one.size for one in found).most_common(1)[0][1] * 10 < 9 * len(found)
    return (
        is_varied and len(frames) >= FEW_MESSAGES and whole * 100 >= 97 * len(frames)
    )  # each frame in pieces


def _find_static_mismatch(
    line: LineFacts, receiver: Receiver | None
) -> tuple[Receiver, SizeStatistics] | None:
    found = _check_kind(line, receiver, STATIC)
    if found is None or not line.messages or _fits_frames(line, found.need):
        return None
    return found, measure_sizes(select_whole_messages(line))


def _len_remedies(receiver: Receiver, size: int) -> tuple[Remedy, ...]:
    name, has_len = receiver.instance, receiver.need < receiver.room
    if not name:
        return (Remedy(f"use a type or a LEN of {size} bytes"),)
    length = Remedy(f"set LEN to {size}", f"set {name} LEN={size}", f"instance.{name}.LEN={size}")
    if not receiver.room or size <= receiver.room:
        left = find_unwritten_members(receiver, size)
        then = f"; not written then: {left.names}" if left else f", and give DATA {size} bytes"
        return (replace(length, text=f"set LEN to {size}{then}"), *offer_frame_reset(receiver))
    more = _room_remedies(receiver, size)
    mends = (*more, length) if has_len and more[0].set else more
    return (*mends, *offer_frame_reset(receiver)) if more[0].set else mends


def _compare_remedies(receiver: Receiver, size: int) -> tuple[Remedy, ...]:
    """If LEN `size` would leave members unwritten, return the remedy to compare type and messages."""
    left = find_unwritten_members(receiver, size)
    if left is None:
        return ()
    text = (
        f"compare {receiver.type_name} with what the partner sends: a member is narrower, packed, or missing"
    )
    return (Remedy(f"{text}; LEN {size} would leave {left.names} unwritten"),)


def _offer_len(receiver: Receiver, size: int, line: LineFacts) -> RemedyOffer:
    as_string = offer_string(receiver, _contents(line))
    if as_string is not None or isinstance(receiver.type, StringType):
        return as_string or NO_OFFER  # LEN alone would put the text where a STRING has its header
    room = max(receiver.room, size) if receiver.room else 0
    has_members = make_data_layout(receiver) is not None
    # The meaning of further bytes is not known, so a type with members cannot be tried with them.
    cured = None if has_members and size > receiver.room else receiver._replace(need=size, room=room)
    return RemedyOffer(_len_remedies(receiver, size), cured, _compare_remedies(receiver, size))


def _room_remedies(receiver: Receiver, size: int) -> tuple[Remedy, ...]:
    """Return the remedy that gives DATA room for `size` bytes, or () if DATA has the room."""
    if not receiver.room or size <= receiver.room:
        return ()
    element = getattr(receiver.type, "element", None)
    if getattr(element, "size", 0) != 1:
        return (Remedy(f"declare members for the {size - receiver.room} bytes that DATA has no room for"),)
    array = f"ARRAY[0..{size - 1}] OF BYTE"
    change = f"{receiver.data} type={array}"
    path = f"data.{receiver.data}.type={array}"
    return (Remedy(f"give DATA {size} bytes: {array}", f"set data {change}", path),)


def _judge_frame_short(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    found = _find_static_mismatch(line, receiver)
    if found is None:
        return None
    wanted, sizes = found
    is_varied = sizes.share < 0.7  # then no single LEN fits
    longest = max(one.size for one in line.messages)
    # Sizes that vary are `adhoc-missing`, unless too few messages came to know.
    if sizes.usual >= wanted.need or (
        is_varied and (sizes.messages >= FEW_MESSAGES or longest >= wanted.need)
    ):
        return None
    last = line.messages[-1]
    of_all = f"{sizes.share:.0%} of {count(sizes.messages, 'message')} have {sizes.usual} bytes"
    some = "messages of several lengths" if is_varied else of_all
    text = f"{some}, but a job waits for {wanted.need}"
    sure = 0.95 if sizes.messages >= 5 else 0.8 if sizes.messages >= FEW_MESSAGES else 0.7
    is_soon = last.ns - line.messages[0].ns < 2 * SECOND  # pieces of one message come in quick succession
    whole = is_soon and (last.at + last.size - _first_frame_byte(line)) % wanted.need == 0
    if sizes.messages < FEW_MESSAGES and (whole or any(one.size == wanted.need for one in line.messages)):
        return None
    if sizes.messages < FEW_MESSAGES and line.end is None and line.last_ns - last.ns < SECOND:
        return None
    end = line.end
    if end is not None and (
        (end.is_reset and not end.by_plc and sizes.messages < FEW_MESSAGES)
        or (line.connect is not None and end.by_plc and end.ns - last.ns < SECOND and len(line.messages) < 2)
    ):
        return None  # the end may have cut off the rest
    if is_soon and last.at + last.size - _first_frame_byte(line) == wanted.need:
        return None  # the pieces of one job
    may_be_cut = sizes.messages < 2 and line.end is not None
    offer = NO_OFFER if may_be_cut or is_varied else _offer_len(wanted, sizes.usual, line)
    return finding_to_plc(wanted, sure, (text,), _segment(last), offer)


def _judge_frame_long(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    found = _find_static_mismatch(line, receiver)
    if found is not None:
        wanted, sizes = found
        if sizes.usual <= wanted.need or sizes.usual % wanted.need == 0:
            return None  # shorter is `frame-short`; a multiple shifts nothing
        if sizes.messages < 2 or (sizes.share < 0.7 and sizes.messages >= FEW_MESSAGES):
            return None
        left = sizes.usual % wanted.need
        of_all = f"{sizes.share:.0%} of {count(sizes.messages, 'message')} have {sizes.usual} bytes"
        text = f"{of_all}, but a job takes {wanted.need}"
        more = f"the next frame begins with the end ({count(left, 'byte')}) of the message before"
        sure = 0.95 if sizes.messages >= 5 else 0.8
        if (members := _make_reading_judge("frame-long")(line, receiver)) is not None:
            return replace(members, evidence=(text, more, *members.evidence))
        offer = _offer_len(wanted, sizes.usual, line)
        return finding_to_plc(wanted, sure, (text, more), _segment(line.messages[0]), offer)
    room = _check_kind(line, receiver, AD_HOC)
    if room is None:
        return None
    sizes = measure_sizes(select_whole_messages(line))
    too_long = [one for one in select_whole_messages(line) if one.size > room.need]
    if len(too_long) * 2 < sizes.messages or len(too_long) < FEW_MESSAGES:
        return None
    most = max(one.size for one in too_long)
    text = f"{len(too_long)} of {sizes.messages} messages are longer than DATA or LEN ({room.need} bytes)"
    return finding_to_plc(
        room, 0.93, (text, f"the longest has {most}"), _segment(too_long[0]), _offer_len(room, most, line)
    )


def _judge_adhoc_missing(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    found = _find_static_mismatch(line, receiver)
    if found is None:
        return None
    wanted, sizes = found
    messages = select_whole_messages(line)
    counted = Counter(one.size for one in messages)
    if sizes.messages < FEW_MESSAGES or sizes.share >= 0.85 or (sizes.different < 3 and sizes.share > 0.8):
        return None
    some = sorted(counted)
    if len(some) > 2 and sum(counted.values()) < 4:
        return None
    sure = 0.94 if sizes.share < 0.7 and sizes.messages >= 5 else 0.7
    spread = f"messages have {some[0]} to {some[-1]} bytes ({sizes.different} sizes)"
    text = f"{spread}, but a static job waits for {wanted.need}"
    name = wanted.instance
    mend = Remedy(
        "receive ad hoc, with DATA large enough for the longest message",
        f"set {name} {'ADHOC=1' if wanted.static else 'LEN=65535'}",
        f"instance.{name}.{'ADHOC=true' if wanted.static else 'LEN=65535'}",
    )
    room = _room_remedies(wanted, some[-1])
    cured = wanted._replace(adhoc=True, need=max(wanted.room or wanted.need, some[-1]))
    offer = offer_string(wanted, _contents(line)) or RemedyOffer((mend, *room) if name else (), cured)
    return finding_to_plc(wanted, sure, (text,), _segment(messages[0]), offer)


def _judge_shifted(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    found = _find_static_mismatch(line, receiver)
    if found is None:
        return None
    wanted, sizes = found
    need, messages = wanted.need, line.messages
    if sizes.messages < 4 or sizes.share < 0.6 or sizes.usual % need:
        return None
    start = _first_frame_byte(line)
    off = [(one.at + one.size - start) % need for one in messages]
    if line.end is not None and off:
        off.pop()  # the end may have cut the last message
    since = next(
        (n for n, rest in enumerate(off) if rest and sum(map(bool, off[n:])) * 10 >= 8 * len(off[n:])), None
    )
    if since is None or len(off) - since < 2:
        return None
    odd, later = messages[since], off[since:]
    what = f"this began after {f'a message of {odd.size}' if odd.size % need else 'missing'} bytes"
    before = f"{count(since, 'message')} before fitted" if since else "no message before fitted"
    where = f"at byte {later[0]} of" if min(later) == max(later) else "inside"
    text = f"since {line.to_seconds(odd.ns):.3f} s messages begin {where} frames of {need} bytes"
    is_first = line.has_begin and not odd.at
    again = sum(one.size == odd.size for one in messages) if odd.size % need else 0
    offer = RemedyOffer(offer_frame_reset(wanted))  # enough for an odd size that comes once
    if again > 1 or (is_first and again):
        ways = f"a first job with LEN {odd.size}, or ad hoc and cut in the program (TwinCAT: ReceiveData)"
        name = "the greeting" if is_first else "these messages"
        take = f"receive the {odd.size} bytes separately: {ways}; or switch {name} off at the device"
        offer = RemedyOffer((Remedy(take),))
    return finding_to_plc(wanted, 0.95, (text, f"{what}; {before}"), _segment(odd), offer)


def _judge_adhoc_splits(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    wanted = _check_kind(line, receiver, AD_HOC)
    messages = select_whole_messages(line)
    if wanted is None or len(messages) < FEW_MESSAGES:
        return None
    if (pairs := find_head_and_body(line.to_plc.writes, bytes(line.to_plc.content), wanted.need)) is not None:
        text = f"{count(pairs.pairs, 'message')} came in two pieces, {pairs.pause_ns / 1e6:.0f} ms apart"
        more = f"a head of {pairs.head} bytes and the rest: {pairs.proof}; an ad-hoc job delivers each piece"
        offer = _offer_static(wanted, max(pairs.sizes))
        if len(pairs.sizes) > 1:
            text_of_two = f"two jobs: LEN {pairs.head} for the head, then as many bytes as the head says"
            offer = RemedyOffer((Remedy(text_of_two),))
        return finding_to_plc(wanted, 0.92, (text, more), _segment(messages[0]), offer)
    split = [one for one in messages if one.pieces > 1 and one.pause_ns >= SPLIT_NS]
    if len(split) < 2 or len(split) * 8 < len(messages):
        return None
    sizes = measure_sizes(messages)
    sure = 0.94 if sizes.share > 0.7 or sizes.usual == wanted.need else 0.8
    pause = sorted(one.pause_ns for one in split)[len(split) // 2]
    pieces = max(one.pieces for one in split)
    text = (
        f"{len(split)} of {len(messages)} messages come in up to {pieces} pieces, {pause / 1e6:.0f} ms apart"
    )
    more = f"the pieces together have {sizes.usual} bytes, but an ad-hoc job delivers each piece"
    offer = _offer_static(wanted, sizes.usual)
    return finding_to_plc(wanted, sure, (text, more), _segment(split[0]), offer)


def _offer_static(receiver: Receiver, size: int) -> RemedyOffer:
    name = receiver.instance
    mend = Remedy(
        f"receive static with LEN {size} if all messages have one length; else cut them in the program",
        f"set {name} {receiver.static}LEN={size}",
        f"instance.{name}.ADHOC=false" if receiver.static else None,
    )  # fmt: skip
    length = Remedy(f"also set LEN to {size}", None, f"instance.{name}.LEN={size}")
    cured = receiver._replace(adhoc=False, need=size, room=max(receiver.room, size))
    return RemedyOffer((mend, length, *offer_frame_reset(receiver)) if name else (), cured)


def _judge_merged(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    if (
        line.protocol == "udp"
        or len(line.to_plc.writes) < 4
        or _check_kind(line, receiver, STATIC) is not None
    ):
        return None
    known = _check_kind(line, receiver, AD_HOC)
    if (receiver is not None and known is None) or speaks_session(line):
        return None
    writes = line.to_plc.writes
    if (found := _judge_merged_by_border(line, known)) is not None:
        return found
    counted = Counter(write.size for write in writes)
    base, often = min(
        counted.most_common(3), key=lambda one: one[0] if one[1] * 5 >= len(writes) else 1 << 30
    )
    several = {size: n for size, n in counted.items() if size > base and size % base == 0}
    amount, others = sum(several.values()), len(writes) - often - sum(several.values())
    share = amount / len(writes)
    sure = 0.92 if known is not None else 0.7
    of_type = known is not None and known.type is not None and base % known.need == 0 and base > known.need
    if known is not None and of_type and _pieces_begin_alike(line, known.need):
        base, often, amount, share, others = known.need, 0, len(writes), 1.0, 0  # each write holds several
        several = counted
    elif len(counted) >= 3 and 4 <= (beat := gcd(*counted)) < base and _pieces_begin_alike(line, beat):
        several = {size: n for size, n in counted.items() if size > beat}
        base, often, amount, share, others = beat, 0, sum(several.values()), 1.0, 0
    elif known is not None and not several and _pieces_begin_alike(line, base):
        return _judge_merged_in_scan(writes, known, base)
    elif base < 4 or often < 2 or amount < FEW_MESSAGES or share < 0.08 or others * 8 > len(writes):
        return None
    if often and not _has_repeated_begin(line, base):  # one size divides the other by chance
        return None
    most = max(several) // base
    at = next(write for write in writes if write.size in several)
    text = f"{amount} of {len(writes)} segments hold several messages of {base} bytes, at most {most}"
    if known is None:
        return Finding(sure, (text,), "to-plc", at, is_remark=True)
    return finding_to_plc(known, sure, (text,), at, _offer_one_per_job(known, base))


def _judge_merged_by_border(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    """Judge whether a delimiter or a length separates several messages in one segment."""
    content, some = bytes(line.to_plc.content), line.to_plc.writes[:MOST_MESSAGES]
    known = [one for one in some if one.at + one.size <= len(content)]
    parts = [content[one.at : one.at + one.size] for one in known]
    found = find_joined_messages(parts)
    several = 0 if found is None else sum(number > 1 for number in found.numbers)
    if found is None or several * 12 < len(parts):
        return None
    at = next(one for one, number in zip(known, found.numbers, strict=True) if number > 1)
    texts = f"several messages in {several} of {len(parts)} segments, up to {max(found.numbers)}", found.proof
    if receiver is None:
        return Finding(0.7, texts, "to-plc", at, is_remark=True)
    return finding_to_plc(receiver, 0.92, texts, at, RemedyOffer((Remedy(found.mend),)))


def _judge_merged_in_scan(writes: Sequence[SegmentFacts], receiver: Receiver, base: int) -> Finding | None:
    soon = [b for a, b in pairwise(writes) if 2 * (b.ns - a.ns) < receiver.interval_ns]
    if len(soon) < FEW_MESSAGES or len(soon) * 5 < len(writes):
        return None
    ms = receiver.interval_ns / 1e6
    text = f"{len(soon)} of {len(writes)} messages come less than half a scan of {ms:g} ms after another one"
    return finding_to_plc(receiver, 0.85, (text,), soon[0], _offer_one_per_job(receiver, base))


def _offer_one_per_job(receiver: Receiver, base: int) -> RemedyOffer:
    if not receiver.instance:
        return NO_OFFER
    text = f"receive static with LEN {base}: a job then takes one message"
    mend = Remedy(text, f"set {receiver.instance} {receiver.static}LEN={base}")
    return RemedyOffer((mend, *offer_frame_reset(receiver)), receiver._replace(adhoc=False, need=base))


def speaks_session(line: LineFacts, receiver: Receiver | None = None) -> bool:
    """Return whether the ends speak TLS or ISO-on-TCP: whole units by their lengths, without gaps.

    If the project declares the connection as plain, both ends have to send such units, and a handshake.
    """
    if line.protocol != "tcp":
        return False
    ways = [find_unit_heads(each, line.has_begin) for each in (line.to_plc, line.from_plc) if each.bytes]
    if not all(ways) or len({is_tls_head(units[0]) for units in ways}) != 1:
        return False
    has_call = any(is_session_begin(units[0]) for units in ways)
    if receiver is not None and receiver.connect:
        return has_call and len(ways) == 2
    return has_call or sum(map(len, ways)) >= FEW_MESSAGES


def _pieces_begin_alike(line: LineFacts, beat: int) -> bool:
    """Return whether all pieces of `beat` bytes of the stream begin alike, but are not all equal."""
    content = line.to_plc.content
    parts = [content[at : at + beat] for at in range(0, len(content) - beat + 1, beat)]
    if len(parts) < 2 * FEW_MESSAGES or any(write.size % beat for write in line.to_plc.writes):
        return False
    fixed = [n for n in range(beat) if len({part[n] for part in parts}) == 1]
    return len(fixed) < beat and fixed[:1] == [0] and any(parts[0][n] for n in fixed)


def _has_repeated_begin(line: LineFacts, base: int) -> bool:
    """Return whether constant bytes of single messages recur inside segments with several messages."""
    content = line.to_plc.content
    single = [
        content[w.at : w.at + base]
        for w in line.to_plc.writes
        if w.size == base and w.at + base <= len(content)
    ]
    inner = [
        content[w.at + n * base : w.at + (n + 1) * base]
        for w in line.to_plc.writes
        if w.size > base and w.size % base == 0 and w.at + w.size <= len(content)
        for n in range(1, w.size // base)
    ]
    if not single or not inner:
        return False
    fixed = [n for n in range(base) if len({part[n] for part in single}) == 1]
    hits = sum(part[n] == single[0][n] for n in fixed for part in inner)
    return bool(fixed) and hits * 10 >= 9 * len(fixed) * len(inner)


def _judge_datagram_size(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    wanted = _check_kind(line, receiver, DATAGRAM)
    if wanted is None:
        return None
    large = [one for one in line.to_plc.writes if one.size > wanted.need]
    if not large:
        return None
    most = max(one.size for one in large)
    of_all = f"{len(large)} of {len(line.to_plc.writes)} datagrams"
    text = f"{of_all} are larger than {wanted.need} bytes; the largest has {most}"
    return finding_to_plc(wanted, 0.95, (text,), large[0], _offer_len(wanted, most, line))


def _judge_frame_marks(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    if receiver is None or receiver.marks == (b"", b"") or len(line.messages) < FEW_MESSAGES:
        return None
    content = bytes(line.to_plc.content)
    messages = [
        content[one.at : one.at + one.size] for one in line.messages if one.at + one.size <= len(content)
    ]
    for mark, place, fits in (
        (receiver.marks[0], "prefix", bytes.startswith), (receiver.marks[1], "suffix", bytes.endswith),
    ):  # fmt: skip
        hits = sum(fits(one, mark) for one in messages) if mark else len(messages)
        if messages and hits * 2 < len(messages) and content.count(mark) * 2 < len(messages):
            shown = mark.hex(" ").upper()
            seen = Counter(one[: len(mark)] if place == "prefix" else one[-len(mark) :] for one in messages)
            usual, often = seen.most_common(1)[0]
            texts = [f"{hits} of {len(messages)} messages have the expected {place} {shown}"]
            if often * 2 > len(messages):
                texts.append(f"{often} messages have {usual.hex(' ').upper()} instead")
            return finding_to_plc(receiver, 0.9, tuple(texts), _segment(line.messages[0]))
    return None


# -- the meaning of bytes ------------------------------------------------------------------------------------


def _frames(line: LineFacts, receiver: Receiver) -> list[bytes]:
    content, need = bytes(line.to_plc.content), receiver.need
    found = select_whole_messages(line) or line.messages
    sizes = measure_sizes(found)
    if line.protocol == "tcp" and not receiver.adhoc and _fits_frames(line, need):
        start = _first_frame_byte(line) if line.has_begin else found[0].at
        parts = [content[at : at + need] for at in range(start, len(content) - need + 1, need)]
    else:
        parts = [
            content[m.at : m.at + m.size]
            for m in found
            if m.size == sizes.usual and m.at + m.size <= len(content)
        ]
        if sizes.share < 0.6:
            return []
    step = max(len(parts) // MOST_FRAMES, 1)
    return parts[::step][-MOST_FRAMES:]


def _has_plain_bytes(line: LineFacts, receiver: Receiver) -> bool:
    """Return whether the bytes of messages are known and reach DATA as they are: no TLS, no ISO-on-TCP."""
    if receiver.is_whole or receiver.is_secure or not line.messages or line.to_plc.cut:
        return False
    return not speaks_session(line, receiver)


def _contents(line: LineFacts) -> list[bytes]:
    content = bytes(line.to_plc.content)
    some = (select_whole_messages(line) or line.messages)[:MOST_MESSAGES]
    return [content[one.at : one.at + one.size] for one in some if one.at + one.size <= len(content)]


_READING_CACHE: Final[dict[tuple[object, ...], Finding | None]] = {}
MOST_CACHED_READINGS: Final = 256


def _judge_other_reading(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    """If the bytes make sense in another reading than the PLC's, return a finding with its `cause`."""
    if (
        receiver is None
        or receiver.type is None
        or receiver.rules is None
        or not _has_plain_bytes(line, receiver)
    ):
        return None
    frames = _frames(line, receiver)
    if not frames or len(frames[0]) > 4096 or (len(frames) < 2 and not _is_lone_message(line, receiver)):
        return None
    key = (receiver.instance, receiver.need, receiver.type, receiver.rules, tuple(frames))
    if key not in _READING_CACHE:
        if len(_READING_CACHE) >= MOST_CACHED_READINGS:
            _READING_CACHE.clear()
        _READING_CACHE[key] = judge_readings(frames, receiver, receiver.type, receiver.rules)
    found = _READING_CACHE[key]
    return found and replace(found, at=_segment(line.messages[0]))


def _judge_text(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    """Judge whether text comes where numbers are declared."""
    if receiver is None or not _has_plain_bytes(line, receiver) or not has_only_numbers(receiver):
        return None
    messages = _contents(line)
    found = find_text(messages)
    if found is None:
        return None
    numbers = f"{receiver.type_name or 'DATA'} has numbers"
    offer = offer_text(receiver, found, max(map(len, messages)))
    return finding_to_plc(receiver, 0.93, (found.said, numbers), _segment(line.messages[0]), offer)


def _judge_encoding(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    if receiver is None or not _has_plain_bytes(line, receiver):
        return None
    said = describe_utf_8_bytes(_contents(line), receiver.need)
    if not said:
        return None
    return finding_to_plc(receiver, 0.95, (said,), _segment(line.messages[0]), RemedyOffer((SEND_BYTES,)))


def _judge_header(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    if (found := _make_reading_judge("header")(line, receiver)) is not None:
        return found
    if receiver is None or not _has_plain_bytes(line, receiver):
        return None
    said = describe_sent_strings(receiver, _contents(line))
    at = _segment(line.messages[0])
    return finding_to_plc(receiver, 0.0, (said,), at, is_remark=True) if said else None


def _make_reading_judge(cause: str) -> Callable[[LineFacts, Receiver | None], Finding | None]:
    def judge(line: LineFacts, receiver: Receiver | None) -> Finding | None:
        found = _judge_other_reading(line, receiver)
        return found if found is not None and found.cause == cause else None

    return judge


# -- symptoms of DATA: causes above explain them -------------------------------------------------------------


def _judge_unwritten(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    """Judge which members frames never write. If frames end between two members, make only a remark."""
    if receiver is None or not receiver.need or receiver.is_whole or not line.messages:
        return None
    size = receiver.need
    if receiver.adhoc or line.protocol == "udp":
        sizes = measure_sizes(select_whole_messages(line))
        if sizes.share < 0.6 or sizes.messages < FEW_MESSAGES:
            return None
        size = min(size, sizes.usual)
    left = find_unwritten_members(receiver, size)
    if left is None or speaks_session(line) or (receiver.adhoc and not left.is_cut):
        return None
    text = f"frames of {size} bytes never write {left.names} of {receiver.type_name}"
    offer = RemedyOffer(_compare_remedies(receiver, size))
    return finding_to_plc(receiver, 0.85, (text,), _segment(line.messages[0]), offer, not left.is_cut)


def _judge_odd_values(line: LineFacts, receiver: Receiver | None) -> Finding | None:
    if receiver is None or not receiver.need or receiver.is_whole or receiver.type is None:
        return None
    if not line.messages or speaks_session(line) or line.to_plc.cut:
        return None
    content, need = bytes(line.to_plc.content), receiver.need
    if receiver.adhoc or line.protocol == "udp":
        some = [(one.at, min(one.size, need)) for one in line.messages]
    else:
        some = [(at, need) for at in range(_first_frame_byte(line), len(content) - need + 1, need)]
    frames = [content[at : at + size] for at, size in some if at + size <= len(content)][-MOST_FRAMES:]
    if isinstance(receiver.type, StringType):  # its header comes first, so a short frame can be read
        frames = [one.ljust(receiver.room, b"\0") for one in frames]
    texts = describe_odd_values(receiver, frames)
    if not texts:
        return None
    sure = 0.8 if len(frames) >= FEW_MESSAGES else 0.6
    offer = offer_string(receiver, _contents(line)) or NO_OFFER
    return finding_to_plc(receiver, sure, texts[:MOST_FRAMES], _segment(line.messages[0]), offer)


def _segment(message: LineMessage) -> SegmentFacts:
    return SegmentFacts(message.ns, message.at, message.size, message.packet)


def _is_lone_message(line: LineFacts, receiver: Receiver) -> bool:
    """Return whether only one message came, and the job then waited 1 s or to the line's end for more."""
    only = line.messages[0]
    is_over = line.end is not None or line.last_ns - only.ns >= SECOND
    return len(line.messages) == 1 and only.pieces == 1 and only.size < receiver.need and is_over


_LAYOUT_CAUSES: Final = ("header", "padding")
_OTHER: Final = ("wrong-tsap", "tls-refused")
_FORMS: Final = ("encoding", "text")  # the bytes are not of the declared kind
_DATA_CAUSES: Final = (
    *_OTHER, *_LAYOUT_CAUSES, *_FORMS, "byte-order", "frame-short", "frame-long", "adhoc-missing", "shifted",
    "adhoc-splits", "merged", "datagram-size", "framing",
)  # fmt: skip
FRAME_RULES: Final = (
    CauseRule("plain-tcp", judge_plain_tcp, _OTHER),
    CauseRule("encoding", _judge_encoding, _OTHER),
    CauseRule("text", _judge_text, _OTHER),
    CauseRule("header", _judge_header, (*_OTHER, *_FORMS)),
    CauseRule("padding", _make_reading_judge("padding"), (*_OTHER, *_FORMS)),
    CauseRule("byte-order", _make_reading_judge("byte-order"), (*_OTHER, *_FORMS)),
    CauseRule("frame-short", _judge_frame_short, (*_OTHER, "encoding"), (*_LAYOUT_CAUSES, "text")),
    CauseRule("frame-long", _judge_frame_long, (*_OTHER, "merged", "encoding"), (*_LAYOUT_CAUSES, "text")),
    CauseRule(
        "adhoc-missing", _judge_adhoc_missing, (*_OTHER, *_LAYOUT_CAUSES, "encoding", "shifted"), ("text",)
    ),
    CauseRule("shifted", _judge_shifted, (*_OTHER, "encoding"), ("text",)),
    CauseRule("adhoc-splits", _judge_adhoc_splits, (*_OTHER, "frame-long", "encoding"), ("text",)),
    CauseRule("merged", _judge_merged, (*_OTHER, "closes-each-message", "encoding"), ("flood",)),
    CauseRule("datagram-size", _judge_datagram_size, ("encoding",), ("text",)),
    CauseRule("framing", _judge_frame_marks, (), ("line-errors",)),
    CauseRule("members-unwritten", _judge_unwritten, _DATA_CAUSES),
    CauseRule("odd-values", _judge_odd_values, _DATA_CAUSES),
)
