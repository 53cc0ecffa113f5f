"""What the peers of a project file do by themselves, read: `says`, `replies`, `reconnect`."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.errors import Problem, UserError
from trcvtui.project.project import PeerDecl, Project
from trcvtui.rig.commands.library import read_any_send
from trcvtui.rig.commands.reply import MOST_RULES, read_rule
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.words import PeerSend, ReplyOn


@dataclass(frozen=True, slots=True)
class Routine:
    """The messages of one peer, read; times in ns (0: never)."""

    says: tuple[PeerSend, ...]
    every_ns: int
    reconnect_ns: int


def read_replies(project: Project) -> tuple[ReplyOn, ...]:
    """Return the reply rules that the peers of a project begin with; raise UserError with all mistakes."""
    problems: list[Problem] = []
    rules: list[ReplyOn] = []
    for decl in project.peers:
        rules += _read_rules(decl, project, f"{project.path}: peer {decl.name}", problems)
    if problems:
        raise UserError(problems)
    return tuple(rules)


def read_routines(project: Project) -> dict[str, Routine]:
    """Return what the peers of a project do by themselves; raise UserError with every wrong message."""
    problems: list[Problem] = []
    routines = {
        decl.name: Routine(
            _read_says(decl, project, f"{project.path}: peer {decl.name}", problems),
            decl.every_ns,
            decl.reconnect_ns,
        )
        for decl in project.peers
        if decl.says or decl.reconnect_ns
    }
    if problems:
        raise UserError(problems)
    return routines


def check_routine(decl: PeerDecl, project: Project, where: str) -> None:
    """Raise UserError with every mistake in what a peer does by itself."""
    problems: list[Problem] = []
    _read_rules(decl, project, where, problems)
    _read_says(decl, project, where, problems)
    if problems:
        raise UserError(problems)


def _read_rules(decl: PeerDecl, project: Project, where: str, problems: list[Problem]) -> list[ReplyOn]:
    rules = []
    if len(decl.replies) > MOST_RULES:
        problems.append(Problem(f"{where}: replies", f"{len(decl.replies)} rules", f"at most {MOST_RULES}"))
    for number, text in enumerate(decl.replies, 1):
        try:
            rules.append(read_rule(Words(text, f"{where}: replies #{number}"), project, decl.name))
        except UserError as wrong:
            problems += wrong.problems
    return rules


def _read_says(decl: PeerDecl, project: Project, where: str, problems: list[Problem]) -> tuple[PeerSend, ...]:
    read = []
    for number, text in enumerate(decl.says, 1):
        words = Words(text, f"{where}: says #{number}")
        try:
            send = read_any_send(words, project, decl.name)
            words.finish()
        except UserError as wrong:
            problems += wrong.problems
            continue
        read.append(send)
    return tuple(read)
