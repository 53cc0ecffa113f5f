"""One TCP stream with a session on it: reads the kernel into the session, writes the session's bytes out.

Rule 1: a scan moves a bounded number of bytes, in a bounded number of steps (net/work.py); what has been read
and not looked at comes before what the stack has. What the stack does not take waits here, a message at most.
Rule 2: a message that the partner has begun ends within MESSAGE_LIMIT, or the session does.
"""

from __future__ import annotations

from typing import Final

from trcvtui.net.events import What
from trcvtui.net.kernel import WOULD_BLOCK, Endpoint, Fault, Handle, Kernel, WouldBlock
from trcvtui.net.layer import Message, Session
from trcvtui.net.work import READ, Party

PIECE: Final = 64 * 1024  # bytes of one read
PIECES_A_CALL: Final = 4
MESSAGE_LIMIT: Final = 30_000_000_000  # ns; only while the session takes bytes


class Stream:
    """A session at work. `fault` is what the kernel said last; None with `is_over`: the partner's FIN.

    `party` pays for what is done with the partner's bytes. `is_held_back`: not all was looked at.
    """

    def __init__(
        self, kernel: Kernel, handle: Handle, peer: Endpoint, session: Session, since: int, party: Party
    ) -> None:
        self.party = party
        self.is_held_back = False
        self.handle = handle
        self.peer = peer
        self.session = session
        self.since = since  # ns
        self.fault: Fault | None = None
        self.is_over = False
        self.has_spoken = False
        self.is_told = False  # the reason of its end
        self._kernel = kernel
        self._unfinished = 0  # the number of the message that is watched
        self._begun = since  # ns: since when
        self._output = bytearray()  # handshake and answers
        self._carried: memoryview = memoryview(b"")  # of the data that is being sent
        self._carried_size = self._data_size = self._told = 0
        self.flush()

    # -- in -----------------------------------------------------------------------------------------------

    def pump(self) -> None:
        """Read what has come, as far as the session takes it, and answer."""
        for _ in range(PIECES_A_CALL):
            if self.is_over or not self.session.wants_more or len(self._output) > PIECE:
                self.is_held_back = False
                break
            self.is_held_back = True
            if not self._may_go_on():
                break
            if self.session.has_backlog:
                self._feed(_NOTHING)
            elif not self._read():
                self.is_held_back = False
                break
        self.flush()

    @property
    def has_backlog(self) -> bool:
        """Return whether there is work that no news of the stack tells of."""
        return not self.is_over and self.session.has_backlog

    def _may_go_on(self) -> bool:
        """Return whether this scan has time for one more step."""
        if self.party.left <= 0:
            self.party.wait(str(self.peer))
            return False
        if self.session.is_dear and not self.party.work.may_shake():
            self.party.wait(str(self.peer), What.HANDSHAKES_WAIT)
            return False
        return True

    def _read(self) -> bool:
        """Read one piece from the stack; return whether there was one, and the stream goes on."""
        got = self._kernel.recv(self.handle, memoryview(_SCRATCH))
        if isinstance(got, WouldBlock):
            return False
        if isinstance(got, Fault):
            self.fault, self.is_over = got, True
        elif got == 0:
            self.session.partner_closed()
            self.is_over = True
        else:
            self.has_spoken = True
            self.party.spend(READ)
            self._feed(memoryview(_SCRATCH)[:got])
        return not self.is_over

    def _feed(self, data: memoryview) -> None:
        session, party = self.session, self.party

        def step() -> int:
            return session.feed(data, max(1, party.left))

        party.spend(party.work.shake(party, str(self.peer), step) if session.is_dear else step())
        if session.partner_is_done:  # his last word is answered at once (RFC 5246 7.2.1)
            self.is_over = True
            self.goodbye()

    def take_last_words(self) -> None:
        """Take what a partner has left who went before he could have had an answer: no step is worth it."""
        got = self._kernel.recv(self.handle, memoryview(_SCRATCH))
        if isinstance(got, int) and got:
            self.has_spoken = True
            self.session.feed(memoryview(_SCRATCH)[:got], 0)
        self.session.partner_closed()
        self.is_over = True

    def read(self, into: memoryview) -> Message | None:
        """Take what the session has, after a look at the stream when it has nothing."""
        if not self.session.has_data:
            self.pump()
        return self.session.read(into)

    @property
    def end(self) -> Fault | None:
        """Return what ended the session: the kernel's Fault, or one that names the session's own reason."""
        if self.fault is not None:
            return self.fault
        ended = self.session.ended
        return None if ended is None else Fault("session", ended.error)

    def too_slow(self, why: str) -> None:
        """End a handshake, or a message, that takes too long."""
        self.session.give_up(why)
        self.flush()

    def watch(self, now: int) -> None:
        """End a message that has begun and does not end."""
        session = self.session
        number = session.unfinished if session.is_up and session.wants_more else 0
        if not number or number != self._unfinished or self.is_held_back:  # nobody pays for our own pace
            self._unfinished, self._begun = number, now
        elif now - self._begun >= MESSAGE_LIMIT:
            self.too_slow(f"a message that has not ended in {MESSAGE_LIMIT // 1_000_000_000} s")

    def take_end(self) -> str:
        """Return in words why the session has ended by itself, once; "" while it has not."""
        if self.is_told or self.session.ended is None:
            return ""
        self.is_told = True
        return self.session.ended.detail

    # -- out ----------------------------------------------------------------------------------------------

    def goodbye(self) -> bool:
        """Say the session's last word, not in the middle of data; return whether the stack has taken it."""
        if self._carried or not self.session.say_goodbye():
            return False
        self.flush()
        return not self._output

    def flush(self) -> None:
        """Send what the session has to say."""
        self._output += self.session.take_output()
        while self._output and self.fault is None:
            sent = self._kernel.send(self.handle, memoryview(bytes(self._output)))
            if not isinstance(sent, int):
                return  # not now; a Fault shows at the next read
            del self._output[:sent]

    def send(self, data: memoryview) -> int | WouldBlock | Fault:
        """Send data and return how many bytes of it are with the stack now.

        The caller comes again with the rest of the same data until the stack has all of it. What has been
        encoded must go: the first byte counts as taken even when the stack had no room for any.
        """
        self.flush()
        if self.session.ended is not None:
            return self.end or WOULD_BLOCK
        if self._output:
            return WOULD_BLOCK
        if not self._carried:
            carried = self.session.encode(bytes(data))
            self._carried, self._carried_size = memoryview(carried), len(carried)
            self._data_size, self._told = len(data), 0
        sent = self._kernel.send(self.handle, self._carried)
        if isinstance(sent, Fault) and sent.error == "EAGAIN":  # a plan's
            if self._told or not self.session.can_take_back:
                sent = WOULD_BLOCK
            else:
                self._carried = memoryview(b"")  # else the next job would send this one's bytes
                return sent
        if isinstance(sent, Fault):
            self.pump()  # the partner's last word may have come before
            return sent if self.session.ended is None else self.end or sent
        if isinstance(sent, int):
            self._carried = self._carried[sent:]
        taken = self._taken()
        new, self._told = taken - self._told, taken
        return new or WOULD_BLOCK

    def _taken(self) -> int:
        """Return how many bytes of the data count as gone: all of them only when all that carries them is."""
        if not self._carried:
            return self._data_size
        if self._data_size == 1:  # it cannot be gone in part: what is left of it waits here
            self._output += self._carried
            self._carried = memoryview(b"")
            return 1
        gone = self._carried_size - len(self._carried)
        return min(max(1, self._data_size * gone // self._carried_size), self._data_size - 1)


_SCRATCH = bytearray(PIECE)
_NOTHING = memoryview(b"")
