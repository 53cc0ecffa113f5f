"""What a peer answers by itself: rules over the stream it receives, in whatever pieces that comes.

Bounds: a rule keeps less than what it looks for, a pattern no byte but where it stands (stream_pattern), a
field one UDT. What there is no room to answer is counted as missed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from trcvtui.rig.commands.lines import rule_text
from trcvtui.rig.commands.reply import MOST_RULES
from trcvtui.rig.commands.stream_pattern import StreamPattern
from trcvtui.rig.commands.words import Contains, FieldIs, Match, Matches, PeerSend, ReplyOn, Starts
from trcvtui.rig.snapshots import ReplySnapshot
from trcvtui.udt.layout.values import decode_leaves


class Looking(Protocol):
    """One match at work on a stream."""

    def begin(self) -> None:
        """Begin with a new stream."""
        ...

    def take(self, arrived: bytes, now: int) -> int:
        """Return how often it is found, now that these bytes have arrived."""
        ...


class _Contained:
    def __init__(self, match: Contains) -> None:
        self._wanted = match.payload
        self._kept = b""

    def begin(self) -> None:
        self._kept = b""

    def take(self, arrived: bytes, now: int) -> int:
        content, hits, at = self._kept + arrived, 0, 0
        while (place := content.find(self._wanted, at)) >= 0:
            hits, at = hits + 1, place + len(self._wanted)
        self._kept = content[max(at, len(content) - len(self._wanted) + 1) :]
        return hits


class _Beginning:
    """A beginning that has come in part goes on in the next scan; a whole or a wrong one is over."""

    def __init__(self, match: Starts) -> None:
        self._wanted = match.payload
        self.begin()

    def begin(self) -> None:
        self._found = 0  # bytes of the beginning, -1 once it is over
        self._at = -1

    def take(self, arrived: bytes, now: int) -> int:
        if self._found < 0 and now != self._at:
            self._found = 0
        self._at = now
        if self._found < 0:
            return 0
        piece = self._wanted[self._found : self._found + len(arrived)]
        if not arrived.startswith(piece):
            self._found = -1
            return 0
        self._found += len(piece)
        if self._found < len(self._wanted):
            return 0
        self._found = -1
        return 1


class _Matched:
    def __init__(self, match: Matches) -> None:
        self._pattern = StreamPattern(match.pattern.encode())

    def begin(self) -> None:
        self._pattern.begin()

    def take(self, arrived: bytes, now: int) -> int:
        return self._pattern.take(arrived)


class _Frames:
    def __init__(self, match: FieldIs) -> None:
        self._match = match
        self._number = match.layout.number_of(match.path)
        self._frame = bytearray()

    def begin(self) -> None:
        self._frame.clear()

    def take(self, arrived: bytes, now: int) -> int:
        size, hits, at = self._match.layout.size, 0, 0
        while at < len(arrived):
            piece = arrived[at : at + size - len(self._frame)]
            self._frame += piece
            at += len(piece)
            if len(self._frame) == size:
                hits += self._holds(bytes(self._frame))
                self._frame.clear()
        return hits

    def _holds(self, frame: bytes) -> bool:
        value = decode_leaves(self._match.layout, frame, self._number, self._number + 1)[0]
        return value == self._match.value


def _looking(match: Match) -> Looking:
    match match:
        case Contains():
            return _Contained(match)
        case Starts():
            return _Beginning(match)
        case Matches():
            return _Matched(match)
        case FieldIs():
            return _Frames(match)


@dataclass(slots=True)
class _Rule:
    command: ReplyOn
    looking: Looking
    text: str
    hits: int = 0
    missed: int = 0


class Replies:
    """The rules of one peer, in the order in which they were given."""

    def __init__(self) -> None:
        self._rules: list[_Rule] = []

    def add(self, command: ReplyOn) -> str:
        """Take one more rule; it sees what comes from now on. Return what is wrong, or ""."""
        if len(self._rules) == MOST_RULES:
            return f"{command.peer} has {MOST_RULES} rules already; `reply off` ends them"
        self._rules.append(_Rule(command, _looking(command.match), rule_text(command)))
        return ""

    def remove(self, number: int, peer: str) -> str:
        """Forget a rule, counted from 1, or with 0 all of them."""
        if number > len(self._rules):
            return f"{peer} has {len(self._rules)} rules, no number {number}"
        if number:
            del self._rules[number - 1]
        else:
            self._rules.clear()
        return ""

    def begin(self) -> None:
        """Begin with a new connection, or with a new datagram."""
        for rule in self._rules:
            rule.looking.begin()

    def take(self, arrived: bytes, now: int, room: int) -> Iterator[tuple[PeerSend, int]]:
        """Yield each message to be sent and its number, from 0, at most `room`, for what has arrived."""
        for rule in self._rules:
            hits = rule.looking.take(arrived, now)
            answers = min(hits, room)
            room -= answers
            rule.missed += hits - answers
            for _ in range(answers):
                rule.hits += 1
                yield rule.command.send, rule.hits - 1

    def __bool__(self) -> bool:
        """Return whether there is a rule."""
        return bool(self._rules)

    def snapshot(self) -> tuple[ReplySnapshot, ...]:
        """Return every rule and how often it was found."""
        return tuple([ReplySnapshot(rule.text, rule.hits, rule.missed) for rule in self._rules])
