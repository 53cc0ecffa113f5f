"""The queues of a peer: received bytes, bytes to send, and the rules by which it answers.

Inbox: the last bytes that came on a connection, and how many bytes came in all.
Outbox: pauses begin at the planned time of the chunk before, so that delays do not add up. A send waits
until the send before it has ended, so messages of two sends never mix.
Replies: a rule matches the received stream, in whatever pieces the stream comes. A rule stores fewer bytes
than the pattern. A rule on a field stores at most one UDT. A match without room to answer is missed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Final

from msgspec import Struct

from trcvtui.commands.counters_and_checksums import FrameChecker, fill_message
from trcvtui.commands.peer import MOST_RULES
from trcvtui.commands.table import rule_text
from trcvtui.commands.tokens import KEPT_BYTES, chunks
from trcvtui.commands.words import AddReply, Contains, FieldIs, Match, PeerSend, StartsWith
from trcvtui.plc.ledger import BenchNote, Event, PeerSent
from trcvtui.snapshots.bench import ReplyRuleSnapshot, SentMessage
from trcvtui.udt.layout.values import decode_leaves

READ_BYTES: Final = 65536  # of one read; no datagram is larger
KEPT_SENT_MESSAGES, SHOWN_BYTES = 5, 32  # messages in a snapshot, and bytes of each


class Inbox:
    """The received stream of the current or last connection; bounded, whatever arrives."""

    def __init__(self) -> None:
        self.total = 0  # of all connections
        self.count = 0  # of this one
        self._last = bytearray()
        self._checked = 0  # the count when an expectation last held
        self._held: tuple[bytes, int] | None = None
        self.checker: FrameChecker | None = None  # of self-checking traffic

    def begin_connection(self) -> None:
        self.count = self._checked = 0
        self._held = None
        self._last.clear()
        if self.checker is not None:
            self.checker.begin_stream()

    def add_bytes(self, arrived: memoryview) -> None:
        self.total += len(arrived)
        self.count += len(arrived)
        self._last += arrived
        if self.checker is not None:
            self.checker.check_bytes(bytes(arrived))
        if len(self._last) > 2 * KEPT_BYTES:  # cut rarely: a cut moves all kept bytes
            del self._last[:-KEPT_BYTES]

    @property
    def last_bytes(self) -> bytes:
        """Return the last bytes of this connection, at most 65536."""
        return bytes(self._last[-KEPT_BYTES:])

    def match_exactly(self, payload: bytes) -> bool:
        """Return whether `payload` is all that came on this connection, or all since the last match.

        A match stays true until more bytes arrive.
        """
        if self._held == (payload, self.count):
            return True
        if len(payload) not in (self.count, self.count - self._checked):
            return False
        if len(payload) > len(self._last) or not self._last.endswith(payload):
            return False
        self._checked, self._held = self.count, (payload, self.count)
        return True


MOST_WAITING_ANSWERS: Final = 256  # bounds memory if a partner asks but does not read


class _SendProgress:
    """One `send` in progress, with its current message, its current chunk and the rest of that chunk."""

    def __init__(self, send: PeerSend, now: int, number: int, pause_ns: int) -> None:
        self.send = send
        self._pause_ns = pause_ns
        self._number = number  # of the running message, for its fills
        self._gaps = send.gaps_ns or (send.gap_ns,)
        self.left = send.repeat  # messages to come, the running one included
        self.due = self.began = now + pause_ns
        self._pieces = self._make_pieces()
        self._piece = 0
        self.rest = self._pieces[0]
        self.is_fresh = True  # no byte of the running message is sent yet

    @property
    def first_bytes(self) -> bytes:
        return b"".join(piece[:SHOWN_BYTES] for piece in self._pieces[:SHOWN_BYTES])[:SHOWN_BYTES]

    def schedule(self, now: int) -> None:
        self.due = self.began = max(self.due, now + self._pause_ns)

    def count_sent(self, count: int, now: int) -> None:
        """Count bytes that the stack took, and plan the next chunk."""
        self.is_fresh = False
        self.rest = self.rest[count:]
        if len(self.rest):
            self.due = now  # the stack was full: later chunks are planned from now on
            return
        self._piece += 1
        if self._piece < len(self._pieces):
            self.due += self._gaps[min(self._piece, len(self._gaps)) - 1]
            self.rest = self._pieces[self._piece]
        else:
            self._begin_message()

    def _begin_message(self) -> None:
        self.left -= 1
        pause_over = self.due + self.send.gap_ns
        self.due = max(self.began + self.send.every_ns, self.due) if self.send.every_ns else pause_over
        self.began = self.due
        if self.send.fills and self.left:
            self._number += 1
            self._pieces = self._make_pieces()
        self._piece, self.rest, self.is_fresh = 0, self._pieces[0], True

    def _make_pieces(self) -> tuple[memoryview, ...]:
        return chunks(fill_message(self.send.payload, self.send.fills, self._number), self.send.split)

    @property
    def unsent(self) -> int:
        """Return how many bytes are not sent yet, in all repetitions together."""
        running = len(self.rest) + sum(map(len, self._pieces[self._piece + 1 :]))
        return running + (self.left - 1) * len(self.send.payload)


class Outbox:
    """All sends that are not finished, in the order of their commands."""

    def __init__(self) -> None:
        self._sendings: deque[_SendProgress] = deque()

    def put(self, send: PeerSend, now: int, number: int = 0, pause_ns: int = 0) -> None:
        """Queue a send. The first chunk is due `pause_ns` after now, or after the end of earlier sends.

        `number` is the number of the first message of this send, for messages that contain their number.
        """
        self._sendings.append(_SendProgress(send, now, number, pause_ns))

    @property
    def answer_room(self) -> int:
        """Return how many more answers may wait."""
        return max(0, MOST_WAITING_ANSWERS - len(self._sendings))

    def next_due(self, now: int) -> int | None:
        """Return when the next chunk is due, or None if no chunk waits or a chunk is due already."""
        return self._sendings[0].due if self._sendings and self._sendings[0].due > now else None

    def due_bytes(self, now: int) -> memoryview | None:
        """Return the bytes to send now, None if none are due."""
        if not self._sendings or self._sendings[0].due > now:
            return None
        return self._sendings[0].rest

    @property
    def message_start(self) -> tuple[int, bytes]:
        """If the due bytes begin a message, return its size and first bytes, else 0 and no bytes."""
        first = self._sendings[0]
        return (len(first.send.payload), first.first_bytes) if first.is_fresh else (0, b"")

    def count_sent(self, count: int, now: int) -> None:
        first = self._sendings[0]
        first.count_sent(count, now)
        if not first.left:
            self._sendings.popleft()
            if self._sendings:
                self._sendings[0].schedule(now)

    def clear(self) -> int:
        """Drop everything; return how many bytes will not be sent."""
        unsent = self.unsent
        self._sendings.clear()
        return unsent

    @property
    def unsent(self) -> int:
        return sum(sending.unsent for sending in self._sendings)


# Matchers: `count_matches` returns how often a match is found, now that these bytes have arrived.


class _ContentMatcher:
    def __init__(self, match: Contains) -> None:
        self._wanted = match.payload
        self._kept = b""

    def reset(self) -> None:
        self._kept = b""

    def count_matches(self, arrived: bytes, now: int) -> int:
        content, hits, at = self._kept + arrived, 0, 0
        while (place := content.find(self._wanted, at)) >= 0:
            hits, at = hits + 1, place + len(self._wanted)
        self._kept = content[max(at, len(content) - len(self._wanted) + 1) :]
        return hits


class _StartMatcher:
    """Compares each scan's first bytes with a pattern; an incomplete match continues in the next scan."""

    def __init__(self, match: StartsWith) -> None:
        self._wanted = match.payload
        self.reset()

    def reset(self) -> None:
        self._found = 0  # bytes of the beginning, -1 once it is over
        self._at = -1

    def count_matches(self, arrived: bytes, now: int) -> int:
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


class _FieldMatcher:
    def __init__(self, match: FieldIs) -> None:
        self._match = match
        self._number = match.layout.leaf_number(match.path)
        self._frame = bytearray()

    def reset(self) -> None:
        self._frame.clear()

    def count_matches(self, arrived: bytes, now: int) -> int:
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


def _make_matcher(match: Match) -> _ContentMatcher | _StartMatcher | _FieldMatcher:
    match match:
        case Contains():
            return _ContentMatcher(match)
        case StartsWith():
            return _StartMatcher(match)
        case FieldIs():
            return _FieldMatcher(match)


class _ReplyRule(Struct):
    command: AddReply
    looking: _ContentMatcher | _StartMatcher | _FieldMatcher
    text: str
    hits: int = 0
    missed: int = 0


class ReplyRules:
    """The rules of one peer, in the order of their commands."""

    def __init__(self) -> None:
        self._rules: list[_ReplyRule] = []

    def add(self, command: AddReply) -> str:
        """Add a rule for bytes that arrive from now on. Return what is wrong, or ""."""
        if len(self._rules) == MOST_RULES:
            return f"{command.peer} has {MOST_RULES} rules already; `reply off` removes them"
        self._rules.append(_ReplyRule(command, _make_matcher(command.match), rule_text(command)))
        return ""

    def remove(self, number: int, peer: str) -> str:
        """Remove the rule of this number, counted from 1; 0 removes all rules."""
        if number > len(self._rules):
            return f"{peer} has {len(self._rules)} rules, no number {number}"
        if number:
            del self._rules[number - 1]
        else:
            self._rules.clear()
        return ""

    def reset_matchers(self) -> None:
        for rule in self._rules:
            rule.looking.reset()

    def find_answers(self, arrived: bytes, now: int, room: int) -> Iterator[tuple[PeerSend, int]]:
        """Yield at most `room` answers to the arrived bytes, each as a message and its number from 0."""
        for rule in self._rules:
            hits = rule.looking.count_matches(arrived, now)
            answers = min(hits, room)
            room -= answers
            rule.missed += hits - answers
            for _ in range(answers):
                rule.hits += 1
                yield rule.command.send, rule.hits - 1

    def __bool__(self) -> bool:
        return bool(self._rules)

    def snapshot(self) -> tuple[ReplyRuleSnapshot, ...]:
        return tuple([ReplyRuleSnapshot(rule.text, rule.hits, rule.missed) for rule in self._rules])


# -- all queues --------------------------------------------------------------------------------------------


class PeerQueues:
    """The queues of one peer over all its connections, with counts of the messages and bytes sent."""

    def __init__(self, name: str, journal: Callable[[Event], None]) -> None:
        self.inbox = Inbox()
        self.outbox = Outbox()
        self.replies = ReplyRules()
        self.messages = self.bytes_sent = 0
        self.last_sent: deque[SentMessage] = deque(maxlen=KEPT_SENT_MESSAGES)
        self.landing = memoryview(bytearray(READ_BYTES))  # a transport reads into it
        self._name = name
        self._journal = journal

    def begin_connection(self) -> None:
        self.inbox.begin_connection()
        self.replies.reset_matchers()

    def handle_received(self, size: int, now: int, may_answer: bool = True) -> None:
        """Take the first `size` bytes of the buffer `landing` as received. Queue the answers to them."""
        self.inbox.add_bytes(self.landing[:size])
        if self.replies:
            room = self.outbox.answer_room if may_answer else 0
            for send, number in self.replies.find_answers(bytes(self.landing[:size]), now, room):
                self.outbox.put(send, now, number)

    def note_sent(self, count: int, local: str, remote: str, offset: int) -> None:
        """Count bytes of the due chunk as sent. If these bytes begin a message, record it with `offset`."""
        size, begin = self.outbox.message_start
        if size:
            self.messages += 1
            self.last_sent.appendleft(SentMessage(self.messages, size, begin))
            self._journal(PeerSent(self._name, self.messages, local, remote, offset, size))
        self.bytes_sent += count

    def drop_unsent(self) -> None:
        """Drop what is not sent yet; note in the ledger how many bytes were dropped."""
        unsent = self.outbox.clear()
        if unsent:
            self.note("not sent", f"{unsent} bytes")

    def note(self, what: str, detail: str = "", end: str = "") -> None:
        """Write an event into the journal. `end` is the peer's own address, or "" if unimportant."""
        self._journal(BenchNote(self._name, what, detail, end))
