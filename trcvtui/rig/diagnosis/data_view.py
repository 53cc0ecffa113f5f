"""Another layout in which DATA would take what came: by the size of a message, or by its values.

Rule: an offer needs evidence: a size that no other reading of the type has to explain, or a clear suspicion.
"""

from __future__ import annotations

from typing import NamedTuple

from trcvtui.project.project import DataDecl
from trcvtui.rig.diagnosis.byte_order import byte_order_suspicion
from trcvtui.rig.wording import count
from trcvtui.udt.layout.layout import Layout, profiles_for, same_layouts
from trcvtui.udt.layout.rules import NO_CHOICE, LayoutChoice, rules_for


class Offer(NamedTuple):
    """A layout for DATA, and what speaks for it."""

    choice: LayoutChoice
    why: str


def offer_for(decl: DataDecl, size: int | None, content: bytes) -> Offer | None:
    """Return what to read DATA as: messages of `size` bytes came, `content` is the newest one, or its part.

    None where the layout fits, where several sizes came, or where nothing else fits better.
    """
    if size is not None and size != decl.size:
        found = _of_size(decl, size)
        if found is None:
            return None
        order = _order(found, content)
        name = found.rules.name
        why = f"in {name} {decl.type_name} has {count(size, 'byte')}, as what came"
        return Offer(_choice(name, order), why)
    suspicion = byte_order_suspicion(decl.layout, content)
    if suspicion is None:
        return None
    choice = decl.choice._replace(byte_order=suspicion.other)
    return Offer(choice, f"its members make sense as {suspicion.other}-endian")


def _of_size(decl: DataDecl, size: int) -> Layout | None:
    """Return the type in the first layout that gives it this size; the byte order stays, where it can."""
    own = decl.layout.rules
    laid_out = same_layouts(decl.type, profiles_for(decl.type))
    found = [layout for _, layout in laid_out if layout.size == size]
    same = [layout for layout in found if layout.rules.byte_order == own.byte_order]
    return next(iter([*same, *found]), None)


def _order(layout: Layout, content: bytes) -> str:
    suspicion = byte_order_suspicion(layout, content)
    return layout.rules.byte_order if suspicion is None else suspicion.other


def _choice(name: str, order: str) -> LayoutChoice:
    return LayoutChoice(name, None if rules_for(name).byte_order == order else order)


def view_line(decl: DataDecl, choice: LayoutChoice) -> str:
    """Return the line that gives DATA this layout, and takes back what it had of its own."""
    words = []
    for name, now, wanted in zip(choice._fields, decl.choice, choice, strict=True):
        if wanted != now:
            words.append(f"{name}={'' if wanted is None else str(wanted).lower()}")
    return f"set data {decl.name} {' '.join(words)}" if words else ""


def chosen(layout: str, byte_order: str, text: str) -> LayoutChoice:
    """Return the choice that gives these rules, without what the layout says by itself."""
    rules = rules_for(layout)
    return LayoutChoice(
        layout,
        None if rules.byte_order == byte_order else byte_order,
        None if text in ("", rules.text.name) else text,
    )


def own_line(decl: DataDecl) -> str:
    """Return the line that lets DATA lie as the PLC lays it out again, "" where it does."""
    return view_line(decl, NO_CHOICE)
