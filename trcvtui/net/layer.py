"""What may run on a TCP stream between the blocks and the kernel: ISO-on-TCP, TLS. Bytes in, bytes out.

Rule: a session never touches a socket and never raises, whatever comes; it holds bounded memory.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol


class Message(NamedTuple):
    """One message: its first bytes up to the session's cap, and how many it had."""

    data: bytes
    whole: int


class Ended(NamedTuple):
    """Why a session is over: the word that a dialect maps to a code, and what a person should read."""

    error: str
    detail: str


class Session(Protocol):
    """One end of a session."""

    ended: Ended | None
    can_take_back: bool  # what `encode` returned need not be sent

    @property
    def is_up(self) -> bool:
        """Return whether the handshake is over and data may flow."""
        ...

    @property
    def has_data(self) -> bool:
        """Return whether something can be read."""
        ...

    @property
    def wants_more(self) -> bool:
        """Return whether bytes may be fed."""
        ...

    @property
    def held(self) -> int:
        """Return how many bytes are kept, read and unread."""
        ...

    def feed(self, data: memoryview, most: int = ...) -> int:
        """Take bytes that the partner has sent, and do at most `most` units of work on what is here.

        Return how many units it was (net/work.py). Nothing is lost: what was not looked at is a backlog.
        """
        ...

    @property
    def has_backlog(self) -> bool:
        """Return whether a feed of nothing would go on: something waits here that was not looked at."""
        ...

    @property
    def is_dear(self) -> bool:
        """Return whether the next step is one of a handshake that costs real time."""
        ...

    @property
    def partner_is_done(self) -> bool:
        """Return whether the partner has said, inside the session, that nothing more comes."""
        ...

    def partner_closed(self) -> None:
        """Note the end of the partner's bytes."""
        ...

    @property
    def unfinished(self) -> int:
        """Return the number of the message that has begun and not ended, 0: there is none, or no limit."""
        ...

    def give_up(self, why: str) -> None:
        """End a handshake, or a message, that takes too long, where the session has a word for that."""
        ...

    def take_remarks(self) -> list[str]:
        """Return what the partner has sent that was passed over, in words, once; a few of each session."""
        ...

    def say_goodbye(self) -> bool:
        """Tell the partner, once, that nothing more comes; return whether the session has a word for it."""
        ...

    def take_output(self) -> bytes:
        """Return what must be sent to the partner, once."""
        ...

    def read(self, into: memoryview) -> Message | None:
        """Put the next message, or the next bytes, into `into` and return it; None: nothing is there."""
        ...

    def encode(self, data: bytes) -> bytes:
        """Return the bytes that carry this data."""
        ...

    def drop_data(self) -> int:
        """Drop what could be read and return how many bytes it was."""
        ...


class Settings(Protocol):
    """How to make a session: what a CONNECT says about it."""

    @property
    def is_message_oriented(self) -> bool:
        """Return whether a read gives one message."""
        ...

    @property
    def shares_port(self) -> bool:
        """Return whether several passive CONNECTs listen on one port: the partner says which it wants."""
        ...

    def new(self, is_active: bool) -> Session:
        """Return a fresh session."""
        ...
