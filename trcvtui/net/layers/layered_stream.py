"""One TCP stream with a session. The session gets the received bytes. The stream sends the session's bytes.

Rule 1: the bytes and the steps of a scan are limited (ScanBudget). The session decodes its backlog before
it takes bytes from the stack. Bytes that the stack does not take wait here. These bytes are at most one
message.
Rule 2: if a message takes longer than MESSAGE_LIMIT_NS, the session is ended.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from trcvtui.net.connection.resources import ACCEPT_UNITS, BEGIN_TLS_UNITS, READ_UNITS, BudgetShare
from trcvtui.net.events import EventKind
from trcvtui.net.kernel import Handle, Kernel, NewClient
from trcvtui.net.layer import LayerMessage, LayerSession, LayerSettings
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault, WouldBlock

READ_BYTES: Final = 64 * 1024  # bytes of one read
READS_A_CALL: Final = 4
MESSAGE_LIMIT_NS: Final = 30_000_000_000  # ns; counted only while the session takes bytes


class LayeredStream:
    """A session at work. If `is_over` and `fault` is None, the partner has sent FIN or close_notify.

    `party` pays for the work on the partner's bytes. If `is_held_back`, bytes may still be unread.
    """

    def __init__(
        self,
        kernel: Kernel,
        handle: Handle,
        peer: Endpoint,
        session: LayerSession,
        since: int,
        party: BudgetShare,
    ) -> None:
        self.party = party
        self.is_held_back = False
        self.handle, self.peer, self.session = handle, peer, session
        self.since = since  # ns
        self.fault: Fault | None = None
        self.is_over = False
        self.has_spoken = False
        self.is_end_reported = False  # whether the reason of its end was reported
        self.has_failed = False
        self._kernel = kernel
        self._unfinished = 0  # the number of the message whose time is checked
        self._begun = since  # ns: when that message began
        self._output = bytearray()  # handshake and answers
        self._carried: memoryview = memoryview(b"")  # encoded bytes of the data that the stack has not taken
        self._carried_size = self._data_size = self._reported = 0
        self.flush()

    # -- in -----------------------------------------------------------------------------------------------

    def pump(self) -> None:
        """Read received bytes, as many as the session takes; send the session's answers."""
        for _ in range(READS_A_CALL):  # Rule 1
            # A partner that asks and reads no answer would fill `_output`.
            if self.is_over or not self.session.wants_more or len(self._output) > READ_BYTES:
                self.is_held_back = False
                break
            self.is_held_back = True
            if not self._may_work():
                break
            if self.session.has_backlog:  # Rule 1: before new bytes
                self._feed(_NO_BYTES)
            elif not self._read():
                self.is_held_back = False
                break
        self.flush()

    @property
    def has_backlog(self) -> bool:
        """Return whether the session has bytes to look at, even if the stack has no new bytes."""
        return not self.is_over and self.session.has_backlog

    def _may_work(self) -> bool:
        if self.party.units_left <= 0:
            self.party.note_waiting(str(self.peer))
            return False
        if self.session.next_is_costly and not self.party.work.may_handshake():
            self.party.note_waiting(str(self.peer), EventKind.HANDSHAKES_WAIT)
            return False
        return True

    def _read(self) -> bool:
        got = self._kernel.recv(self.handle, memoryview(_SCRATCH))
        if isinstance(got, WouldBlock):
            return False
        if isinstance(got, Fault):
            self.fault, self.is_over = got, True
        elif got == 0:
            self.session.note_partner_end()
            self.is_over = True
        else:
            self.has_spoken = True
            self.party.spend(READ_UNITS)
            self._feed(memoryview(_SCRATCH)[:got])
        return not self.is_over

    def _feed(self, data: memoryview) -> None:
        session, party = self.session, self.party

        def feed() -> int:
            return session.feed(data, max(1, party.units_left))

        party.spend(
            party.work.run_handshake_step(party, str(self.peer), feed) if session.next_is_costly else feed()
        )
        if session.partner_is_done:  # its close_notify is answered at once (RFC 5246 7.2.1)
            self.is_over = True
            self.send_goodbye()

    def read_last_bytes(self) -> None:
        """Take the last bytes of a partner whose stream ended before our answer. Do no handshake step."""
        got = self._kernel.recv(self.handle, memoryview(_SCRATCH))
        if isinstance(got, int) and got:
            self.has_spoken = True
            self.session.feed(memoryview(_SCRATCH)[:got], 0)  # 0: a handshake with it would be wasted time
        self.session.note_partner_end()
        self.is_over = True

    def read(self, into: memoryview) -> LayerMessage | None:
        """Move the session's data into the view; if the session has none yet, first read the stream."""
        if not self.session.has_data:
            self.pump()
        return self.session.read(into)

    @property
    def end_fault(self) -> Fault | None:
        """Return why the session ended: the kernel's Fault, or a Fault with the session's reason."""
        if self.fault is not None:
            return self.fault
        ended = self.session.ended
        return None if ended is None else Fault("session", ended.error, words=ended.words)

    def fail(self) -> None:
        """End the stream after an exception; the session is not called again."""
        self.fault, self.is_over, self.has_failed = self.fault or Fault("session", "EPROTO"), True, True

    def time_out(self, why: str) -> None:
        self.session.time_out(why)
        self.flush()

    def limit_message_time(self, now: int) -> None:
        """End the session if a message does not end in time (Rule 2)."""
        session = self.session
        number = session.open_message if session.is_up and session.wants_more else 0
        if not number or number != self._unfinished or self.is_held_back:  # held back: the delay is our own
            self._unfinished, self._begun = number, now
        elif now - self._begun >= MESSAGE_LIMIT_NS:
            self.time_out(f"a message that has not ended in {MESSAGE_LIMIT_NS // 1_000_000_000} s")

    def take_end_text(self) -> str:
        """Return why the session has ended by itself, but only once. Otherwise return ""."""
        if self.is_end_reported or self.session.ended is None:
            return ""
        self.is_end_reported = True
        return self.session.ended.detail

    # -- out ----------------------------------------------------------------------------------------------

    def send_goodbye(self) -> bool:
        """Send the session's goodbye (close_notify); return whether the stack has taken it."""
        # Inside half-sent data it would be read as a part of it: then the stream ends without a goodbye.
        if self._carried or self.has_failed or not self.session.say_goodbye():
            return False
        self.flush()
        return not self._output

    def flush(self) -> None:
        if self.has_failed:
            return
        self._output += self.session.take_output()
        while self._output and self.fault is None:
            sent = self._kernel.send(self.handle, memoryview(bytes(self._output)))
            if not isinstance(sent, int):
                return  # no room now; the next read reports a Fault
            del self._output[:sent]

    def send(self, data: memoryview) -> int | WouldBlock | Fault:
        """Send data and return how many bytes of it the stack has taken now.

        The caller repeats the call with the rest of the data until the stack has all of it. Encoded data
        must be sent: the first byte counts as taken even if the stack had no room.
        """
        self.flush()
        if self.session.ended is not None:
            return self.end_fault or WOULD_BLOCK
        if self._output:  # the session's own bytes come first: they were encoded before this data
            return WOULD_BLOCK
        if not self._carried:
            carried = self.session.encode(bytes(data))
            self._carried, self._carried_size = memoryview(carried), len(carried)
            self._data_size, self._reported = len(data), 0
        sent = self._kernel.send(self.handle, self._carried)
        if isinstance(sent, Fault) and sent.error == "EAGAIN":  # only a fault plan answers that
            if self._reported or not self.session.can_take_back:
                sent = WOULD_BLOCK
            else:
                self._carried = memoryview(b"")  # else the next job would send this one's bytes
                return sent
        if isinstance(sent, Fault):
            self.pump()  # the partner's reason (alert, DR) may be unread: it says more than the errno
            return sent if self.session.ended is None else self.end_fault or sent
        if isinstance(sent, int):
            self._carried = self._carried[sent:]
        taken = self._count_taken()
        new, self._reported = taken - self._reported, taken
        return new or WOULD_BLOCK

    def _count_taken(self) -> int:
        """Return how many bytes count as sent; the last of several only when all encoded bytes are sent."""
        if not self._carried:
            return self._data_size
        if self._data_size == 1:  # its first byte, which counts as taken, is its last: the rest waits here
            self._output += self._carried
            self._carried = memoryview(b"")
            return 1
        gone = self._carried_size - len(self._carried)
        return min(max(1, self._data_size * gone // self._carried_size), self._data_size - 1)


_SCRATCH = bytearray(READ_BYTES)
_NO_BYTES = memoryview(b"")


# -- several CONNECTs at one port: the client's first message says which of them it wants -----------------
#
# Rule 1: at most MOST_WAITING_CLIENTS clients are in a handshake at a time, each for HANDSHAKE_LIMIT_NS at
# most; at most MOST_WAITING_CLIENTS finished ones wait for each CONNECT.
# Rule 2: the work of a scan is bounded (ScanBudget): clients that are not accepted yet wait in the stack.
# Rule 3: a silent client delays no other one: the newest client takes the place of the oldest silent one.

MOST_WAITING_CLIENTS: Final = 16
CLIENTS_QUEUED: Final = 64  # in the stack, between two polls
HANDSHAKE_LIMIT_NS: Final = 5_000_000_000  # ns


class LayerNote(NamedTuple):
    """What happened to a client of a CONNECT, and why. `for_all` notes concern all CONNECTs at the port."""

    connect: str
    what: str
    client: str
    why: str
    for_all: bool = False


NoteSink = Callable[[LayerNote], None]
ErrorHandler = Callable[[str, Exception], None]  # (CONNECT, the exception of its session)


def raise_error(owner: str, error: Exception) -> None:
    raise error


CLIENT_DROPPED: Final = "client dropped"
TPDU_IGNORED: Final = "TPDU ignored"
SESSION_ENDED: Final = "session ended"
GAVE_WAY_TEXT: Final = (
    f"{MOST_WAITING_CLIENTS} clients are in a handshake; a newer one takes the place of this one"
)
QUEUE_FULL_TEXT: Final = f"the queue is full: {MOST_WAITING_CLIENTS} clients wait to be accepted"


class ConnectChoiceSession(Protocol):
    """A session whose partner asks for one of several CONNECTs. It waits for `accept_for` or `refuse`."""

    has_asked: bool

    def asks_for_name_of(self, settings: LayerSettings) -> bool:
        """Return whether the partner asks for this CONNECT's name; several CONNECTs may have one name."""

    def find_mismatch(self, settings: LayerSettings) -> str:
        """Return "" if the partner asks for this CONNECT. Otherwise return what differs."""

    def accept_for(self, settings: LayerSettings) -> None: ...

    def refuse(self, is_known: bool) -> None:
        """Refuse the partner. If `is_known`, a CONNECT has the name, but for another partner or not now."""


def find_asking_session(session: object) -> ConnectChoiceSession | None:
    """Return the session if its partner has asked for a CONNECT, or else None."""
    found: ConnectChoiceSession | None = session if getattr(session, "has_asked", False) else None  # type: ignore[assignment]
    return found


class ListeningConnect:
    """One CONNECT that listens: its settings, and the clients that it can accept."""

    def __init__(self, owner: str, settings: LayerSettings) -> None:
        self.owner = owner
        self.settings = settings
        self.ready: deque[LayeredStream | Fault] = deque()


class SharedListener:
    """One listening socket, its CONNECTs, and the clients whose handshake is not finished."""

    def __init__(
        self,
        kernel: Kernel,
        handle: Handle,
        report_note: NoteSink,
        polls: bool,
        party: BudgetShare,
        report_error: ErrorHandler,
    ) -> None:
        self.handle = handle
        self._report_error, self.has_failed = report_error, False
        self._party = party
        self.members: dict[Handle, ListeningConnect] = {}
        self.clients: list[LayeredStream] = []
        self._kernel, self._report_note, self._polls = kernel, report_note, polls

    def poll(self, now: int) -> None:
        for client in tuple(self.clients):  # earlier clients before new ones
            self._advance_safely(client, now)
        while not self._keeps_clients_waiting() and self._kernel.readable(self.handle):
            if self._party.units_left <= 0:  # Rule 2
                self._party.note_waiting()
                break
            got = self._kernel.accept(self.handle)
            if not isinstance(got, NewClient):
                if isinstance(got, Fault):
                    self._any_member().ready.append(got)
                break
            self._party.spend(ACCEPT_UNITS)
            try:
                self._add_client(got, now)
            except Exception as error:
                self._report_error(self.owner, error)
                self._kernel.abort(got.handle)

    def _keeps_clients_waiting(self) -> bool:
        """Return whether new clients wait in the stack, because the port's only CONNECT is full.

        If CONNECTs share the port, each client is accepted. A client is refused if its CONNECT is full.
        """
        member = self._any_member()
        return not member.settings.shares_port and self._is_full(member)

    def _make_room(self) -> None:
        if len(self.clients) >= MOST_WAITING_CLIENTS:  # Rules 1 and 3
            oldest = next((one for one in self.clients if not one.has_spoken), self.clients[0])
            self._drop_client(oldest, GAVE_WAY_TEXT)

    def _add_client(self, got: NewClient, now: int) -> None:
        fault = self._kernel.poll_add(got.handle) if self._polls else None
        if fault is not None:
            self._kernel.abort(got.handle)
            self._any_member().ready.append(fault)
            return
        session = self._any_member().settings.make_session(is_active=False)
        self._party.spend(BEGIN_TLS_UNITS if session.next_is_costly else 0)
        newest = LayeredStream(self._kernel, got.handle, got.peer, session, now, self._party)
        self._make_room()
        self.clients.append(newest)
        self._advance_safely(newest, now)  # at once: if it has sent bytes it is not the silent one of Rule 3

    def _advance_safely(self, client: LayeredStream, now: int) -> None:
        try:
            self._advance(client, now)
        except Exception as error:
            self._report_error(self.owner, error)
            client.fail()
            self._drop_client(client, "an internal error of this program")

    def _advance(self, client: LayeredStream, now: int) -> None:
        session = client.session
        # A client that left before its first bytes were read costs no handshake (the attack: connect and go).
        if session.next_is_costly and not client.has_spoken and self._kernel.loss(client.handle) is not None:
            client.read_last_bytes()
        else:
            client.pump()
        for remark in session.take_remarks():
            self._report_note(LayerNote(self.owner, TPDU_IGNORED, str(client.peer), remark))
        if (choice := find_asking_session(session)) is not None:
            self._assign_client(client, choice)
        elif session.is_up:
            self._hand_over(client, self._any_member())
        elif client.is_over or session.ended is not None:
            self._fail(client, str(session.ended.detail if session.ended else "closed before the handshake"))
        elif now - client.since >= HANDSHAKE_LIMIT_NS:  # Rule 1
            client.time_out("no handshake in 5 s")
            self._fail(client, "no handshake in 5 s")

    def _assign_client(self, client: LayeredStream, session: ConnectChoiceSession) -> None:
        members = list(self.members.values())
        named = [member for member in members if session.asks_for_name_of(member.settings)]
        meant = [member for member in named if not session.find_mismatch(member.settings)]
        if meant and not self._is_full(meant[0]):
            self._hand_over(client, meant[0])
            return
        asked = (named or members)[0]  # an unknown name: any member, with `for_all`
        why = QUEUE_FULL_TEXT if meant else session.find_mismatch(asked.settings)
        session.refuse(is_known=bool(named))
        client.flush()
        self._drop_client(client, why, asked, for_all=not named)

    def _hand_over(self, client: LayeredStream, member: ListeningConnect) -> None:
        if not self._is_full(member):  # else it stays among the unfinished, up to its time limit
            self.clients.remove(client)
            member.ready.append(client)

    @staticmethod
    def _is_full(member: ListeningConnect) -> bool:
        return len(member.ready) >= MOST_WAITING_CLIENTS

    def _fail(self, client: LayeredStream, why: str) -> None:
        session: LayerSession = client.session
        member = self._any_member()
        ended = session.ended
        # Not for a ConnectChoiceSession: its partner has not said which CONNECT it wants.
        if ended is not None and not hasattr(session, "has_asked") and not self._is_full(member):
            member.ready.append(Fault("session", ended.error, words=ended.words, peer=str(client.peer)))
        self._drop_client(client, why)

    def _drop_client(
        self, client: LayeredStream, why: str, asked: ListeningConnect | None = None, for_all: bool = False
    ) -> None:
        """Close a client. `asked` is what it asked for, if known. With `for_all`, no CONNECT has it."""
        self.clients.remove(client)
        owner = (asked or self._any_member()).owner
        self._report_note(LayerNote(owner, CLIENT_DROPPED, str(client.peer), why, for_all))
        self._kernel.close(client.handle)

    @property
    def owner(self) -> str:
        return self._any_member().owner  # for notes that concern all of them

    def _any_member(self) -> ListeningConnect:
        return next(iter(self.members.values()))

    def close(self) -> None:
        for client in self.clients:
            self._kernel.abort(client.handle)
        self.clients.clear()
        self._kernel.close(self.handle)
