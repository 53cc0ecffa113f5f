"""Which message of a peer a received byte belongs to, as the ledger tells both ends of a connection.

Rule: two ends can meet again on a later connection; the peer's stream then begins anew with byte 0, and each
incarnation of the CONNECT has the messages of its own connection only.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import Final

from trcvtui.net.events import ConnectionNote, What
from trcvtui.plc.ledger import PeerSent
from trcvtui.rig.history.records import MessageSpan

MOST_KEPT: Final = 20_000  # messages of one connection; beyond them the older half is forgotten
MOST_CONNECTIONS: Final = 128

Ends = tuple[str, str]
Link = tuple[str, int]  # CONNECT, incarnation
_Said = tuple[int, int, int, str]  # offset, size, number, peer
_BEHIND: Final = (1 << 62, 0, "")


class SentMessages:
    """The messages of every connection, by the byte of the stream with which they begin."""

    def __init__(self) -> None:
        self._said: dict[tuple[Ends, int], list[_Said]] = {}
        self._newest: dict[Ends, int] = {}  # how many times these ends have met
        self._claimed: dict[Ends, int] = {}
        self._links: dict[Link, tuple[Ends, int]] = {}

    def sent(self, event: PeerSent) -> None:
        """Take a message that a peer has begun to send."""
        ends = event.local, event.remote
        turn = self._newest.get(ends, 0)
        said = self._said.get((ends, turn))
        if said and event.offset <= said[-1][0]:
            turn += 1
            said = None
        if said is None:
            turn = max(turn, self._claimed.get(ends, 0))
            said = self._begin((ends, turn))
        said.append((event.offset, event.size, event.message, event.peer))
        if len(said) > MOST_KEPT:
            del said[: MOST_KEPT // 2]

    def _begin(self, key: tuple[Ends, int]) -> list[_Said]:
        if len(self._said) >= MOST_CONNECTIONS:
            del self._said[next(iter(self._said))]
        self._newest[key[0]] = key[1]
        return self._said.setdefault(key, [])

    def noted(self, event: ConnectionNote) -> None:
        """Take the note that an incarnation of a CONNECT has its partner."""
        if event.what is not What.CONNECTED:
            return
        ends = event.peer, event.local
        newest, claimed = self._newest.get(ends, 0), self._claimed.get(ends, -1)
        turn = newest if newest > claimed else claimed + 1
        self._claimed[ends] = turn
        self._links[event.connection, event.incarnation] = ends, turn
        if len(self._links) > MOST_CONNECTIONS:
            del self._links[next(iter(self._links))]

    def within(self, link: Link, offset: int, size: int, position: int) -> list[MessageSpan]:
        """Return the messages in `size` bytes from `offset` of a connection, placed from `position` on."""
        key = self._links.get(link)
        said = self._said.get(key) if key is not None else None
        if not said:
            return []
        found: list[MessageSpan] = []
        place = max(0, bisect_right(said, (offset, *_BEHIND)) - 1)
        while place < len(said) and said[place][0] < offset + size:
            begin, length, number, peer = said[place]
            first = max(begin, offset)
            part = min(begin + length, offset + size) - first
            if part > 0:
                found.append(
                    MessageSpan(position + first - offset, part, peer, number, first - begin, length)
                )
            place += 1
        return found
