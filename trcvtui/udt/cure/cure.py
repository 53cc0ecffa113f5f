"""The cure for a pair of profiles: the corrective type of either side, and swap code where orders differ."""

from __future__ import annotations

from typing import NamedTuple

from trcvtui.udt.cure.padded_type import Corrective, all_raw, corrective, told
from trcvtui.udt.cure.swap import Language, Swap, language_of, swap_code
from trcvtui.udt.cure.unpack import Unpacking, unpack_code
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.st_write import scl_text, st_text


class Cure(NamedTuple):
    """What helps a receiver (ours) and a sender (theirs) that do not agree; one side is enough.

    `receiver` lies under our rules as theirs does, `sender` under their rules as ours. `unpacking` reads what
    is raw in `receiver`, in the sender's byte order as it is. `swap` is for the sender, None where both have
    the same order; it goes with `receiver` where that is possible, else with `sender`.
    """

    ours: Layout
    theirs: Layout
    receiver: Corrective
    sender: Corrective
    unpacking: Unpacking | None
    swap: Swap | None


def cure(ours: Layout, theirs: Layout, language: Language | None = None) -> Cure:
    """Return the cure; `language` is that of the sender's code. Both layouts are of the same declaration."""
    language = language or language_of(theirs.rules)
    receiver, sender = corrective(theirs, ours.rules), corrective(ours, theirs.rules)
    unpacking, swap = None, None
    are_swapped = ours.rules.byte_order != theirs.rules.byte_order
    if not receiver.is_possible:
        if are_swapped:  # then no member reads right where it lies: all comes out of the bytes
            receiver = all_raw(theirs, ours.rules, receiver.unreached[0].why)
        unpacking = unpack_code(receiver, theirs, language_of(ours.rules))
    if are_swapped and (receiver.is_possible or sender.is_possible):
        swap = swap_code(theirs if receiver.is_possible else sender.layout, language)
    return Cure(ours, theirs, receiver, sender, unpacking, swap)


def cure_text(found: Cure, language: Language | None = None) -> str:
    """Return everything as one text to copy: comments say what is for whom."""
    ours, theirs = found.ours, found.theirs
    language = language or language_of(theirs.rules)
    head = f"Receiver, under {ours.rules.name}: lies as {theirs.rules.name}"
    parts = _side(head, found.receiver, language_of(ours.rules))
    if found.unpacking:
        parts += [found.unpacking.types, found.unpacking.code]
        parts += [f"// {path}: to be converted by hand\n" for path in found.unpacking.left_out]
    parts += _side(
        f"Or the sender, under {theirs.rules.name}: lies as {ours.rules.name}", found.sender, language
    )
    if found.swap:
        orders = f"from {theirs.rules.byte_order}- to {ours.rules.byte_order}-endian"
        orders += ", with the type for the " + ("receiver" if found.receiver.is_possible else "sender")
        parts += [f"// Sender: bytes turned round, {orders}\n", found.swap.text]
    return "\n".join(part for part in parts if part)


def _side(head: str, found: Corrective, language: Language) -> list[str]:
    write = st_text if language == "st" else scl_text
    lines = [f"// {head}, {found.layout.size} bytes", *(f"// {line}" for line in told(found))]
    return ["\n".join(lines), write(found.type, found.layout.name)]
