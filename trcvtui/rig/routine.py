"""What a peer does by itself: connect again after a pause, and say its messages in turn."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.errors import Problem, UserError
from trcvtui.plc.project import PeerDecl, Project
from trcvtui.rig.bench import parse_line
from trcvtui.rig.bench_reply import MOST_RULES, read_rule
from trcvtui.rig.bench_tokens import Words
from trcvtui.rig.bench_words import PeerSend, ReplyOn
from trcvtui.rig.udp_peer import AnyPeer


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
        where = f"{project.path}: peer {decl.name}: replies"
        if len(decl.replies) > MOST_RULES:
            problems.append(Problem(where, f"{len(decl.replies)} rules", f"at most {MOST_RULES}"))
        for number, text in enumerate(decl.replies, 1):
            try:
                rules.append(read_rule(Words(text, f"{where} #{number}"), project, decl.name))
            except UserError as wrong:
                problems += wrong.problems
    if problems:
        raise UserError(problems)
    return tuple(rules)


def read_routines(project: Project) -> dict[str, Routine]:
    """Return what the peers of a project do by themselves; raise UserError with every wrong message."""
    problems: list[Problem] = []
    routines = {
        decl.name: Routine(_read_says(decl, project, problems), decl.every_ns, decl.reconnect_ns)
        for decl in project.peers
        if decl.says or decl.reconnect_ns
    }
    if problems:
        raise UserError(problems)
    return routines


def _read_says(decl: PeerDecl, project: Project, problems: list[Problem]) -> tuple[PeerSend, ...]:
    read = []
    for number, text in enumerate(decl.says, 1):
        where = f"{project.path}: peer {decl.name}: says #{number}"
        try:
            command = parse_line(f"peer {decl.name} send {text}", project, where)
        except UserError as wrong:
            problems += wrong.problems
            continue
        if isinstance(command, PeerSend):
            read.append(command)
    return tuple(read)


class SelfActing:
    """A peer and its routine; `step` comes before the peer's own."""

    def __init__(self, peer: AnyPeer, routine: Routine) -> None:
        self._peer = peer
        self._routine = routine
        self._turn = 0
        self._next_word = 0
        self._next_attempt = 0

    def step(self, now: int) -> None:
        """Connect again or say the next message, when it is due."""
        if self._peer.can_send:
            self._next_attempt = now + self._routine.reconnect_ns
            self._say(now)
        elif self._routine.reconnect_ns and self._peer.state != "connecting":
            self._connect(now)

    def _connect(self, now: int) -> None:
        if now >= self._next_attempt:
            self._next_attempt = now + self._routine.reconnect_ns
            self._peer.connect(now)

    def _say(self, now: int) -> None:
        says = self._routine.says
        if says and now >= self._next_word and not self._peer.unsent:
            self._next_word = now + self._routine.every_ns
            self._peer.send(says[self._turn % len(says)], now, self._turn)
            self._turn += 1
