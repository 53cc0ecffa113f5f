"""Advice on the bytes that a ComBuffer has received: `framing RX`, `framing RD`, `framing RD apply 1`.

Rule: `apply` runs ordinary command lines one by one, so that a saved session contains the lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count as counted
from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.framing import Framing
from trcvtui.blocks.serial.com_buffer import LineRecording
from trcvtui.blocks.table import block_row
from trcvtui.commands.table import format_command
from trcvtui.commands.tokens import Words
from trcvtui.commands.words import CreateBlock
from trcvtui.diagnosis.readings.framing_advice import advise_framings
from trcvtui.diagnosis.readings.proposal import Proposal
from trcvtui.errors import mistake
from trcvtui.project.project import InstanceDecl, Project
from trcvtui.project.tables import expected_name, quote
from trcvtui.udt.literals import format_duration

# Rule: existing variables of prefix and suffix are written if no other instance uses them and they are large
# enough; else new ones are added, and the instance is created again with them.


def framed_instance(name: str, project: Project, where: str) -> InstanceDecl:
    """Return the instance; raise UserError if no instance of that name has a prefix and a suffix."""
    known = {each.name: each for each in project.instances if block_row(each.block).pointers}
    if name not in known:
        raise mistake(where, quote(name), expected_name(name, known, "ReceiveData or ReceiveString"))
    return known[name]


def make_commands(proposal: Proposal, project: Project, name: str, where: str = "framing") -> tuple[str, ...]:
    """Return the lines that set an instance as proposed. Raise UserError if the block cannot do so."""
    decl = framed_instance(name, project, where)
    framing = proposal.framing
    if framing is None:
        raise mistake(where, proposal.title, f"a framing that {decl.block} has: {proposal.instead}")
    is_text = not block_row(decl.block).mark_lengths
    if is_text and not framing.suffix and not framing.timeout_ns:
        raise mistake(where, f"{proposal.title} for a {decl.block}", "a suffix or a gap, or a ReceiveData")
    lines: list[str] = []
    if not is_text:
        lines += _make_resize_command(decl, project, framing)
    lines += _mark_commands(decl, project, framing, is_text)
    return (*lines, f"pulse {name} Reset", _make_set_command(decl, project, framing, is_text))


def _make_resize_command(decl: InstanceDecl, project: Project, framing: Framing) -> Iterator[str]:
    data = project.data_decl(decl.data or "")
    if data is not None and data.size < framing.size:
        yield f"resize {data.name} ARRAY[0..{framing.size - 1}] OF BYTE"


def _mark_commands(decl: InstanceDecl, project: Project, framing: Framing, is_text: bool) -> Iterator[str]:
    pointers = [*decl.pointers, "", ""][:2]
    names = list(pointers)
    for place, mark in enumerate((framing.prefix, framing.suffix)):
        if not mark and not (is_text and pointers[place]):
            continue
        content = mark + b"\0" if is_text else mark
        area = project.data_decl(pointers[place])
        is_written = place == 1 and names[0] == pointers[1] and framing.prefix not in (b"", framing.suffix)
        if area is None or area.size < len(content) or is_written or _is_shared(area.name, decl, project):
            names[place] = _make_unused_name(f"{decl.name}_{('prefix', 'suffix')[place]}", project)
            yield f"add data {names[place]} ARRAY[0..{max(4, len(content)) - 1}] OF BYTE"
        yield f"write {names[place]} hex {content.hex(' ').upper()}"
    if names != pointers:
        yield f"delete {decl.name}"
        yield format_command(CreateBlock(replace(decl, pointers=tuple(names))))


def _is_shared(name: str, decl: InstanceDecl, project: Project) -> bool:
    others = [each for each in project.instances if each.name != decl.name]
    return name == decl.data or any(name in (each.data, *each.pointers) for each in others)


def _make_unused_name(wanted: str, project: Project) -> str:
    known = {each.name for each in project.data} | {each.name for each in project.instances}
    return next(name for n in counted(1) if (name := f"{wanted}{n if n > 1 else ''}") not in known)


def _make_set_command(decl: InstanceDecl, project: Project, framing: Framing, is_text: bool) -> str:
    timeout = f"Timeout={format_duration(framing.timeout_ns)}"
    if is_text:
        return f"set {decl.name} {timeout}"
    data = project.data_decl(decl.data or "")
    room = max(framing.size, data.size if data is not None else 0)
    ends_by_size = not framing.suffix and not framing.timeout_ns
    size = framing.size if ends_by_size else room
    lengths = f"LenPrefix={len(framing.prefix)} LenSuffix={len(framing.suffix)}"
    return f"set {decl.name} {lengths} SizeReceiveData={size} {timeout}"


APPLY: Final = "apply"


def find_buffer(name: str, project: Project, where: str) -> str:
    """Return the ComBuffer of that name, or the ComBuffer that an instance of that name reads."""
    buffers = {each.name: each.name for each in project.combuffers}
    known = buffers | {
        each.name: each.connect for each in project.instances if block_row(each.block).reads_rx_buffer
    }
    if name not in known:
        raise mistake(where, quote(name), expected_name(name, known, "ComBuffer, or instance that reads one"))
    return known[name]


def parse_framing_words(rest: str, project: Project, where: str) -> tuple[str, str, int]:
    """Return the name, its ComBuffer and the number of the proposal to apply; 0: apply none."""
    words = Words(rest, where)
    name = words.next("the name of a ComBuffer, or of an instance that reads one")
    buffer = find_buffer(name, project, where)
    if not words:
        return name, buffer, 0
    word = words.next(APPLY)
    if word != APPLY:
        raise words.error(quote(word), f"{APPLY} and the number of a proposal")
    framed_instance(name, project, where)
    number = words.next("the number of a proposal")
    words.expect_end()
    if not number.isdecimal() or not 0 < int(number) < 100:
        raise words.error(quote(number), "the number of a proposal, such as 1")
    return name, buffer, int(number)


def describe_framings(recording: LineRecording) -> str:
    return advise_framings(recording).text()


def make_proposal_commands(
    recording: LineRecording, project: Project, name: str, number: int, where: str
) -> tuple[str, ...]:
    """Return the lines that apply a proposal. Raise UserError if no proposal has this number."""
    advice = advise_framings(recording)
    numbers = [str(each) for each in range(1, len(advice.proposals) + 1)]
    if not numbers:
        raise mistake(where, f"no proposal ({advice.said})", "a recording that splits into frames")
    if number > len(numbers):
        raise mistake(where, f"proposal {number}", f"one of {', '.join(numbers)}")
    return make_commands(advice.proposals[number - 1], project, name, where)
