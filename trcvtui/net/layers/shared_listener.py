"""Listeners whose clients speak before they are accepted: the handshake comes first, then somebody gets them.

Several CONNECTs may share one port: the client's first message says which of them it wants (siemens.md 5.2).
Rule 1: at most CLIENTS_WAITING clients are unfinished at a time, each for HANDSHAKE_LIMIT at most; as many
wait for each CONNECT.
Rule 2: the work of a scan is bounded (net/work.py): who is not accepted yet waits in the stack.
Rule 3: who says nothing delays nobody: the newest client takes the place of the oldest silent one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, Protocol, runtime_checkable

from trcvtui.net.kernel import Accepted, Fault, Handle, Kernel
from trcvtui.net.layer import Session, Settings
from trcvtui.net.layers.stream import Stream
from trcvtui.net.work import ACCEPT, BEGIN_TLS, Party

CLIENTS_WAITING: Final = 16
CLIENTS_QUEUED: Final = 64  # in the stack, between two polls
HANDSHAKE_LIMIT: Final = 5_000_000_000  # ns
Told = Callable[[str, str, str, str], None]  # CONNECT, what happened, the client, why
DROPPED: Final = "client dropped"
IGNORED: Final = "TPDU ignored"
ENDED: Final = "session ended"
GAVE_WAY: Final = f"{CLIENTS_WAITING} clients were there before it was done, and a newer one takes its place"
FULL: Final = f"{CLIENTS_WAITING} clients wait there already, and nobody takes them"


@runtime_checkable
class Choosing(Protocol):
    """A session whose partner asks for one of several: it waits until it is given to somebody, or refused."""

    has_asked: bool

    def names(self, settings: Settings) -> bool:
        """Return whether it asks for the name of this CONNECT, whoever may have it."""
        ...

    def is_for(self, settings: Settings) -> str:
        """Return "" when this CONNECT is the one that is asked for, else why not."""
        ...

    def give_to(self, settings: Settings) -> None:
        """Go on as a session of this CONNECT."""
        ...

    def refuse(self, is_known: bool) -> None:
        """Say no; `is_known`: somebody has that name, but not for this partner, or not now."""
        ...


class Member:
    """One CONNECT that listens: its settings, and who has come for it."""

    def __init__(self, owner: str, settings: Settings) -> None:
        self.owner = owner
        self.settings = settings
        self.ready: deque[Stream | Fault] = deque()


class Listener:
    """One real listener with its members, and the clients that have not finished their handshake."""

    def __init__(self, kernel: Kernel, handle: Handle, told: Told, polls: bool, party: Party) -> None:
        self.handle = handle
        self._party = party
        self.members: dict[Handle, Member] = {}
        self.clients: list[Stream] = []
        self._kernel = kernel
        self._told = told
        self._polls = polls

    def poll(self, now: int) -> None:
        """Take new clients and go on with the handshakes."""
        for client in tuple(self.clients):  # who has come before goes on before
            self._go_on(client, now)
        while not self._keeps_waiting() and self._kernel.readable(self.handle):
            if self._party.left <= 0:
                self._party.wait()
                break
            got = self._kernel.accept(self.handle)
            if not isinstance(got, Accepted):
                if isinstance(got, Fault):
                    self._any_member().ready.append(got)
                break
            self._party.spend(ACCEPT)
            self._welcome(got, now)

    def _keeps_waiting(self) -> bool:
        """Return whether newcomers stay in the stack: their only CONNECT has its fill, and drops nobody.

        Where several share a port, each client is asked whom it wants, and told when that one is full.
        """
        member = self._any_member()
        return not member.settings.shares_port and self._is_full(member)

    def _make_room(self) -> None:
        if len(self.clients) >= CLIENTS_WAITING:
            oldest = next((one for one in self.clients if not one.has_spoken), self.clients[0])
            self._drop(oldest, GAVE_WAY)

    def _welcome(self, got: Accepted, now: int) -> None:
        fault = self._kernel.poll_add(got.handle) if self._polls else None
        if fault is not None:
            self._kernel.abort(got.handle)
            self._any_member().ready.append(fault)
            return
        session = self._any_member().settings.new(is_active=False)
        self._party.spend(BEGIN_TLS if session.is_dear else 0)
        newest = Stream(self._kernel, got.handle, got.peer, session, now, self._party)
        self._make_room()
        self.clients.append(newest)
        self._go_on(newest, now)  # who has something to say is never the one that gives way

    def _go_on(self, client: Stream, now: int) -> None:
        session = client.session
        if session.is_dear and not client.has_spoken and self._kernel.loss(client.handle) is not None:
            client.take_last_words()
        else:
            client.pump()
        for remark in session.take_remarks():
            self._told(self._any_member().owner, IGNORED, str(client.peer), remark)
        if isinstance(session, Choosing) and session.has_asked:
            self._give(client, session)
        elif session.is_up:
            self._hand_over(client, self._any_member())
        elif client.is_over or session.ended is not None:
            self._fail(client, str(session.ended.detail if session.ended else "closed before the handshake"))
        elif now - client.since >= HANDSHAKE_LIMIT:
            client.too_slow("no handshake in 5 s")
            self._fail(client, "no handshake in 5 s")

    def _give(self, client: Stream, session: Choosing) -> None:
        members = list(self.members.values())
        named = [member for member in members if session.names(member.settings)]
        meant = [member for member in named if not session.is_for(member.settings)]
        if meant and not self._is_full(meant[0]):
            self._hand_over(client, meant[0])
            return
        asked = (named or members)[0]
        why = FULL if meant else session.is_for(asked.settings)
        session.refuse(is_known=bool(named))
        client.flush()
        self._drop(client, why, asked)

    def _hand_over(self, client: Stream, member: Member) -> None:
        """Let a client whose handshake is over wait for its CONNECT; without room it stays where it is."""
        if not self._is_full(member):
            self.clients.remove(client)
            member.ready.append(client)

    @staticmethod
    def _is_full(member: Member) -> bool:
        return len(member.ready) >= CLIENTS_WAITING

    def _fail(self, client: Stream, why: str) -> None:
        session: Session = client.session
        member = self._any_member()
        told = session.ended is not None and not isinstance(session, Choosing)
        if session.ended is not None and told and not self._is_full(member):
            member.ready.append(Fault("session", session.ended.error, peer=str(client.peer)))
        self._drop(client, why)

    def _drop(self, client: Stream, why: str, asked: Member | None = None) -> None:
        """Let a client go; `asked`: whom it wanted, where it has said so."""
        self.clients.remove(client)
        self._told((asked or self._any_member()).owner, DROPPED, str(client.peer), why)
        self._kernel.close(client.handle)

    def _any_member(self) -> Member:
        return next(iter(self.members.values()))

    def close(self) -> None:
        """Free the listener and everybody who waits at it."""
        for client in self.clients:
            self._kernel.abort(client.handle)
        self.clients.clear()
        self._kernel.close(self.handle)
