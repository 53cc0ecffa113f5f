"""`prefix RD hex 02`, `suffix RD hex 0D 0A`: the marks of a receiving block, bytes and length in one scan."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.table import MARKS, block_row
from trcvtui.project.project import InstanceDecl, Project
from trcvtui.rig.commands.read_conditions import read_instance
from trcvtui.rig.commands.read_payload import read_payload
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.words import NONE, SetMark
from trcvtui.rig.wording import count

PREFIX, SUFFIX = MARKS
LONGEST: Final = 255  # LenPrefix is a BYTE


def read_prefix(words: Words, project: Project) -> SetMark:
    """Return `prefix RD hex 02`, `prefix RD text "x"` or `prefix RD none`; raise UserError."""
    return _mark(PREFIX, words, project)


def read_suffix(words: Words, project: Project) -> SetMark:
    """Return `suffix RD hex 0D 0A`; raise UserError."""
    return _mark(SUFFIX, words, project)


def _mark(mark: str, words: Words, project: Project) -> SetMark:
    instance = read_instance(words, project)
    if not block_row(instance.block).pointers:
        found = f"'{instance.name}', a {instance.block}"
        raise words.wrong(found, "a block with prefix and suffix, such as ReceiveData")
    variable = _variable(instance, mark, words)
    decl = project.data_decl(variable)
    assert decl is not None
    payload, text = b"", NONE
    if words.peek() == NONE:
        words.next(NONE)
    else:
        given = read_payload(words, project)
        payload, text = given.content, given.text
    lengths = block_row(instance.block).mark_lengths
    pin = lengths[MARKS.index(mark)] if lengths else ""  # a STRING tells its own length
    room = min(decl.size, LONGEST) if pin else decl.size - 1
    if len(payload) > room:
        found = count(len(payload), "byte")
        raise words.wrong(found, f"at most {room}: '{variable}' is {decl.type_name} (`resize` changes it)")
    return SetMark(instance.name, mark, payload, variable, pin, decl.size, text)


def _variable(instance: InstanceDecl, mark: str, words: Words) -> str:
    """Return the variable that holds a mark; raise UserError where the pointer is 0."""
    number = MARKS.index(mark)
    pointer = block_row(instance.block).pointers[number]
    name = instance.pointers[number] if number < len(instance.pointers) else ""
    if not name:
        found = f"{pointer} of '{instance.name}', which is 0"
        raise words.wrong(found, f"`{pointer}` naming a variable in the project, or at `create`")
    return name
