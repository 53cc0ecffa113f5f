"""Finds messages that are text instead of numbers, STRINGs with or without header, or bytes as UTF-8."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from trcvtui.diagnosis.receiver import Receiver
from trcvtui.diagnosis.remedies import RemedyOffer, offer_frame_reset
from trcvtui.snapshots.doctor import Remedy
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.types import Array, Elementary, StringType, Type

FEW_MESSAGES: Final = 3
MOST_LEAVES: Final = 64  # members that are looked at
MOST_SHOWN: Final = 24  # characters of a message
PRINTABLE_SHARE: Final = 0.95  # of the bytes of a text
LEAST_TEXT_BYTES: Final = 16  # bytes of which something is said
HEADER: Final = 2  # bytes before the characters of a STRING: maximum and length
LONGEST_STRING: Final = 254
_TEXT_ENDS: Final = {b"\r\n": "CR LF", b"\n": "LF", b"\r": "CR", b"\x03": "ETX", b";": "';'"}
_TEXT_BYTES: Final = frozenset(range(0x20, 0x7F)) | frozenset(b"\t\r\n\x02\x03")
_NUMBER_BYTES: Final = frozenset(b"0123456789+-., ;:\t\r\n")


class FoundText(NamedTuple):
    """`said` says that messages are text. `end` is the mark that ends each message, b"" if no mark does."""

    said: str
    end: bytes


def _is_mostly_text(messages: Sequence[bytes]) -> bool:
    said = b"".join(messages)
    return sum(byte in _TEXT_BYTES for byte in said) >= PRINTABLE_SHARE * len(said)


def find_text(messages: Sequence[bytes]) -> FoundText | None:
    """Return the proof that messages are printable and delimited, or only digits, signs and separators."""
    if len(messages) < 2 or sum(map(len, messages)) < LEAST_TEXT_BYTES or not _is_mostly_text(messages):
        return None
    end = next((end for end in _TEXT_ENDS if all(one.endswith(end) and one != end for one in messages)), b"")
    if not end and not all(_NUMBER_BYTES.issuperset(one) for one in messages):
        return None
    shown = messages[-1].decode("ascii", "replace").strip()[:MOST_SHOWN]
    ended = f"; each ends in {_TEXT_ENDS[end]}" if end else ""
    return FoundText(f"all {len(messages)} messages are text{ended}; the last is {shown!r}", end)


def has_only_numbers(receiver: Receiver) -> bool:
    """Return whether DATA is declared as numbers, most of them of several bytes, and no text."""
    if receiver.type is None or receiver.rules is None:
        return False
    leaves = lay_out(receiver.type, receiver.rules, receiver.type_name).leaves(0, MOST_LEAVES)
    large = [one for one in leaves if one.size > 1]
    return len(large) * 2 > len(leaves) and not any(isinstance(one.type, StringType) for one in large)


def offer_text(receiver: Receiver, found: FoundText, longest: int) -> RemedyOffer:
    way = f", cut at {found.end.hex(' ').upper()} (TwinCAT: ReceiveString with that suffix)"
    suffix = way if found.end else ""
    text = f"receive a text: DATA as ARRAY[0..{longest - 1}] OF CHAR{suffix}; convert the text in the program"
    return RemedyOffer((Remedy(text),))


# -- STRING --------------------------------------------------------------------------------------------------


def find_string_maximum(messages: Sequence[bytes]) -> int:
    """Return the maximum length in the STRING header of all messages; 0: they have no header."""
    most = messages[0][0] if messages and messages[0] else 0
    for one in messages:
        if len(one) < HEADER + 1 or one[0] != most or not one[1] <= most <= LONGEST_STRING:
            return 0
        if HEADER + one[1] > len(one) or not _TEXT_BYTES.issuperset(one[HEADER : HEADER + one[1]]):
            return 0
    return most if any(one[1] for one in messages) else 0


def offer_string(receiver: Receiver, messages: Sequence[bytes]) -> RemedyOffer | None:
    """Return a remedy if the text for a STRING has no header or a wrong length in its header, else None."""
    type_, rules = receiver.type, receiver.rules
    if (
        not isinstance(type_, StringType)
        or type_.wide
        or rules is None
        or not rules.text.header
        or not messages
    ):
        return None
    longest = max(map(len, messages))
    most = find_string_maximum(messages)
    if most and most != rules.text.length(type_) and HEADER + most == longest:
        return _offer_type(
            receiver, f"STRING[{most}]", longest, f"the partner's STRING has {most} places: declare DATA so"
        )
    if most or not _is_mostly_text(messages):
        return None
    text = "the partner sends no STRING header: receive characters and make a STRING of them in the program"
    return _offer_type(receiver, f"ARRAY[0..{longest - 1}] OF CHAR", longest, text)


def _offer_type(receiver: Receiver, name: str, size: int, text: str) -> RemedyOffer:
    line = Remedy(
        f"{text} ({name})", f"set data {receiver.data} type={name}", f"data.{receiver.data}.type={name}"
    )
    mends = [line if receiver.data else Remedy(line.text)]
    if receiver.need not in (receiver.room, size):
        pin = f"{receiver.instance}.LEN={size}"
        mends.append(Remedy(f"also set LEN to {size}", f"set {pin.replace('.', ' ')}", f"instance.{pin}"))
    cured = receiver._replace(need=size, room=size, type=None)
    return RemedyOffer((*mends, *offer_frame_reset(receiver)), cured)


def describe_sent_strings(receiver: Receiver, messages: Sequence[bytes]) -> str:
    """Return a sentence if whole STRINGs come although DATA is bytes or characters, else ""."""
    if len(messages) < FEW_MESSAGES or not is_bytes(receiver.type):
        return ""
    most = find_string_maximum(messages)
    if not most or any(len(one) != HEADER + most for one in messages):
        return ""
    return (
        f"messages are STRINGs with header, the last with {messages[-1][1]} of {most} places used: "
        f"DATA as STRING[{most}] reads them; TSEND_C of a STRING with LEN 0 sends such messages"
    )


def is_bytes(type_: Type | None) -> bool:
    element = type_.element if isinstance(type_, Array) else type_
    return isinstance(element, Elementary) and element.size == 1


# -- UTF-8 ---------------------------------------------------------------------------------------------------


def describe_utf_8_bytes(messages: Sequence[bytes], need: int) -> str:
    """Return a sentence if bytes were sent as UTF-8, else "". UTF-8 makes two of each byte above 7F."""
    high = [one for one in messages if not one.isascii()]
    if len(high) < 2:
        return ""
    try:
        sizes = {len(one.decode("utf-8").encode("latin-1")) for one in messages}
    except UnicodeError:
        return ""
    if sizes != {need}:
        return ""
    return (
        f"in {len(high)} of {len(messages)} messages each byte above 7F comes as two, the first C2 or C3 "
        f"(UTF-8); decoded, all messages have {need} bytes"
    )


SEND_BYTES: Final = Remedy(
    "let the partner send bytes, not a string: a Buffer in Node-RED and JavaScript, bytes in Python"
)
