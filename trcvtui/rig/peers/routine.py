"""What a peer does by itself: connect again after a pause, and say its messages in turn.

Rule: messages are planned from the first one on, so that late scans do not add up to a drift; those that a
connection of now has missed are not made up for.
"""

from __future__ import annotations

from trcvtui.rig.commands.routine import Routine
from trcvtui.rig.peers.udp_peer import AnyPeer


def next_due(planned: int, every_ns: int, now: int) -> int:
    """Return when what was planned and is done now comes again: by the plan, anew where that has passed."""
    due = planned + every_ns
    return due if due > now else now + every_ns


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
            return
        if now > self._next_word:
            self._next_word = 0  # nobody was there for it: the next connection begins a new beat
        if self._routine.reconnect_ns and self._peer.state != "connecting":
            self._connect(now)

    def _connect(self, now: int) -> None:
        if now >= self._next_attempt:
            self._next_attempt = now + self._routine.reconnect_ns
            self._peer.connect(now)

    def _say(self, now: int) -> None:
        says = self._routine.says
        if says and now >= self._next_word and not self._peer.unsent:
            self._next_word = next_due(self._next_word or now, self._routine.every_ns, now)
            self._peer.send(says[self._turn % len(says)], now, self._turn)
            self._turn += 1
