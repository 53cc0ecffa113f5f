"""The self-checking traffic of one peer: frames go out at a rate; DATA and what comes back are judged."""

from __future__ import annotations

from trcvtui.rig.commands.check_frames import Checker, frame
from trcvtui.rig.commands.words import CheckOn, PeerSend
from trcvtui.rig.peers.routine import next_due
from trcvtui.rig.peers.udp_peer import AnyPeer
from trcvtui.rig.snapshots import CheckSnapshot


class Checking:
    """One `check on`; it ends with the next one, or with `check off`."""

    def __init__(self, peer: AnyPeer, command: CheckOn) -> None:
        self._peer = peer
        self._command = command
        self._data = Checker(command.size) if command.instance else None
        self._echo = Checker(command.size)
        self._sent = 0
        self._next = 0
        peer.inbox.checker = self._echo

    @property
    def instance(self) -> str:
        """Return the instance whose DATA is judged, "" where none is."""
        return self._command.instance

    def step(self, now: int) -> None:
        """Send the next frame, when it is due."""
        if self._peer.can_send and now >= self._next and not self._peer.unsent:
            self._next = next_due(self._next or now, self._command.every_ns, now)
            self._peer.send(PeerSend(self._command.peer, frame(self._sent, self._command.size)), now)
            self._sent += 1

    def received(self, data: bytes) -> None:
        """Judge the DATA of one DONE."""
        if self._data is not None:
            self._data.take(data)

    def end(self) -> None:
        """Judge no more."""
        self._peer.inbox.checker = None

    def snapshot(self) -> CheckSnapshot:
        """Return what was sent and what has become of it."""
        data = self._data.tally() if self._data is not None else None
        return CheckSnapshot(self._sent, data, self._echo.tally())
