"""`framing RX`, `framing RD`, `framing RD apply 1`: the advice on what a ComBuffer has received.

Rule: what `apply` does are lines of other commands, carried out one by one: they stand in a saved session.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.parameters import BUFFER_PIN
from trcvtui.blocks.serial.recording import Recording
from trcvtui.errors import mistake
from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import shown
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.framing_advice.advice import advise
from trcvtui.rig.framing_advice.lines import framed_instance, lines_for

APPLY: Final = "apply"


def buffer_of(name: str, project: Project, where: str) -> str:
    """Return the ComBuffer of that name, or the one that an instance of that name reads."""
    buffers = {each.name: each.name for each in project.combuffers}
    known = buffers | {
        each.name: each.connect for each in project.instances if BUFFER_PIN.get(each.block) == "RxBuffer"
    }
    if name not in known:
        raise mistake(where, shown(name), expected_name(name, known, "ComBuffer, or instance that reads one"))
    return known[name]


def read_framing(rest: str, project: Project, where: str) -> tuple[str, str, int]:
    """Return what stands behind `framing`: its name, its ComBuffer, which proposal to apply (0: none)."""
    words = Words(rest, where)
    name = words.next("the name of a ComBuffer, or of an instance that reads one")
    buffer = buffer_of(name, project, where)
    if not words:
        return name, buffer, 0
    word = words.next(APPLY)
    if word != APPLY:
        raise words.wrong(shown(word), f"{APPLY} and the number of a proposal")
    framed_instance(name, project, where)
    number = words.next("the number of a proposal")
    words.finish()
    if not number.isdecimal() or not 0 < int(number) < 100:
        raise words.wrong(shown(number), "the number of a proposal, such as 1")
    return name, buffer, int(number)


def told(recording: Recording) -> str:
    """Return the advice as lines of text."""
    return advise(recording).text()


def chosen_lines(
    recording: Recording, project: Project, name: str, number: int, where: str
) -> tuple[str, ...]:
    """Return the lines that apply a proposal; raise UserError where there is none of that number."""
    advice = advise(recording)
    numbers = [str(each) for each in range(1, len(advice.proposals) + 1)]
    if not numbers:
        raise mistake(where, f"no proposal ({advice.said})", "a recording that parts into frames")
    if number > len(numbers):
        raise mistake(where, f"proposal {number}", f"one of {', '.join(numbers)}")
    return lines_for(advice.proposals[number - 1], project, name, where)
