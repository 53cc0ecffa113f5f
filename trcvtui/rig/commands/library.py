"""The library of a project: `peer P1 send message NAME`, `peer P1 play NAME`; every entry is checked."""

from __future__ import annotations

from typing import Final

from trcvtui.errors import Problem, UserError
from trcvtui.project.names import expected_name
from trcvtui.project.project import MessageDecl, Project, SequenceDecl
from trcvtui.project.tables import shown
from trcvtui.rig.commands.send import read_send
from trcvtui.rig.commands.tokens import Words, duration
from trcvtui.rig.commands.words import PeerPlay, PeerSend

MESSAGE: Final = "message"


def read_any_send(words: Words, project: Project, peer: str) -> PeerSend:
    """Return `send message NAME`, or what a payload and its options say; raise UserError."""
    if words.peek() != MESSAGE:
        return read_send(words, project, peer)
    words.next("")
    name = words.next("the name of a message")
    words.finish()
    return _send_of(_message(name, peer, project, words), peer, project, _place(project, name))


def read_play(words: Words, project: Project, peer: str) -> PeerPlay:
    """Return `play NAME`; raise UserError."""
    name = words.next("the name of a sequence")
    words.finish()
    known = {sequence.name: sequence for sequence in project.sequences}
    if name not in known:
        raise words.wrong(shown(name), expected_name(name, known, "sequence"))
    return PeerPlay(peer, name, _steps_of(known[name], peer, project, words))


def _message(name: str, peer: str, project: Project, words: Words) -> MessageDecl:
    known = {m.name: m for m in project.messages if m.peer in ("", peer)}
    if name not in known:
        raise words.wrong(shown(name), expected_name(name, known, "message"))
    return known[name]


def _place(project: Project, message: str) -> str:
    return f"{project.path}: {MESSAGE} {message}"


def _send_of(message: MessageDecl, peer: str, project: Project, where: str) -> PeerSend:
    send = read_send(Words(message.text, where), project, peer)
    return PeerSend(
        peer,
        send.payload,
        send.split,
        send.gap_ns,
        send.repeat,
        send.every_ns,
        f"{MESSAGE} {message.name}",
        send.gaps_ns,
        send.fills,
    )


def _steps_of(
    sequence: SequenceDecl, peer: str, project: Project, words: Words
) -> tuple[tuple[int, PeerSend], ...]:
    """Return each message with the pause before it in ns."""
    steps, pause = [], 0
    for step in sequence.steps:
        if "#" in step:
            pause += duration(step, "", words.where)
        else:
            message = _message(step, peer, project, words)
            steps.append((pause, _send_of(message, peer, project, _place(project, step))))
            pause = 0
    return tuple(steps)


def check_library(project: Project) -> None:
    """Raise UserError with every mistake in the messages and sequences of a project."""
    problems: list[Problem] = []
    for message in project.messages:
        try:
            check_message(message, project, _place(project, message.name))
        except UserError as wrong:
            problems += wrong.problems
    for sequence in project.sequences:
        try:
            check_sequence(sequence, project, f"{project.path}: sequence {sequence.name}")
        except UserError as wrong:
            problems += wrong.problems
    if problems:
        raise UserError(problems)


def check_message(message: MessageDecl, project: Project, where: str) -> None:
    """Raise UserError when a message says nothing that can be sent."""
    first = project.peers[0].name if project.peers else ""
    _send_of(message, message.peer or first, project, where)


def check_sequence(sequence: SequenceDecl, project: Project, where: str) -> None:
    """Raise UserError with every step that is no message and no pause."""
    problems: list[Problem] = []
    names = [message.name for message in project.messages]
    for number, step in enumerate(sequence.steps, 1):
        place = f"{where}: steps #{number}"
        try:
            if "#" in step:
                duration(step, "", place)
            elif step not in names:
                expected = f"{expected_name(step, names, 'message')}, or a pause such as T#100ms"
                problems.append(Problem(place, shown(step), expected))
        except UserError as wrong:
            problems += wrong.problems
    if problems:
        raise UserError(problems)
