"""A wire that goes silent, on real sockets and without privileges: a packet filter that lets nothing in.

Linux lets a program put a classic BPF filter on its own sockets. "Take 0 bytes" on every socket of a CONNECT,
and on the bench's own sockets at the other end of them, silences that wire both ways without FIN or RST; the
stack's own timers find out. A partner outside this bench still hears the PLC's segments, only his answers are
dropped; a socket that is already closed (TIME_WAIT, an unfinished FIN) keeps what it had.
"""

from __future__ import annotations

import ctypes
import socket
import struct
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Final

from trcvtui.net.os.options import error_name

CAN_CUT: Final = sys.platform == "linux"
CANNOT_CUT: Final = "this system cannot drop packets at a socket: link works on Linux and with --kernel sim"
SO_ATTACH_FILTER: Final = 26
SO_DETACH_FILTER: Final = 27
RETURN_0: Final = struct.pack("HBBI", 0x06, 0, 0, 0)  # one struct sock_filter: BPF_RET | BPF_K, take 0 bytes

_program: Final = ctypes.create_string_buffer(RETURN_0)
_filter: Final = struct.pack("HP", 1, ctypes.addressof(_program))  # struct sock_fprog

Ends = tuple[object, object]


class CutLinks:
    """Whose wires are cut, and which sockets are deaf because of whom."""

    def __init__(self, sockets: Mapping[int, socket.socket]) -> None:
        self._sockets = sockets
        self._owners: dict[int, str] = {}
        self._down: set[str] = set()
        self._deaf: dict[int, set[str]] = {}

    def owner(self, handle: int) -> str:
        """Return on whose behalf the handle exists."""
        return self._owners.get(handle, "")

    def is_down(self, handle: int) -> bool:
        """Return whether the wire of the handle's owner is cut."""
        return bool(self._down) and self.owner(handle) in self._down

    def made(self, handle: int, owner: str) -> None:
        """Take in a new handle; on a cut wire it is born deaf."""
        self._owners[handle] = owner
        if self._down:
            self._deafen_wires([handle])

    def freed(self, handle: int) -> None:
        """Forget a handle."""
        self._owners.pop(handle, None)
        self._deaf.pop(handle, None)

    def set_link(self, owner: str, up: bool) -> str:
        """Cut the wire of all handles of an owner, or mend it; return what is wrong, or ""."""
        if not CAN_CUT:
            return CANNOT_CUT
        if up:
            self._mend(owner)
            return ""
        self._down.add(owner)
        refused = self._deafen_wires(list(self._sockets))
        if refused:
            self._mend(owner)
            return f"the system refuses a packet filter: {refused}"
        return ""

    def _deafen_wires(self, handles: Iterable[int]) -> str:
        """Let both ends of each cut wire among these hear nothing; return the errno of a refusal, or ""."""
        by_ends = {ends: handle for handle, sock in self._sockets.items() if (ends := _ends(sock))}
        refused = ""
        for handle in handles:
            ends = _ends(self._sockets[handle])
            partner = by_ends.get((ends[1], ends[0])) if ends else None
            both = {handle, handle if partner is None else partner}
            for owner in {self.owner(end) for end in both} & self._down:
                for end in both:
                    refused = self._deafen(end, owner) or refused
        return refused

    def _deafen(self, handle: int, because_of: str) -> str:
        owners = self._deaf.setdefault(handle, set())
        if not owners:
            try:
                self._sockets[handle].setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, _filter)
            except (OSError, ValueError) as problem:
                del self._deaf[handle]
                return error_name(problem)
        owners.add(because_of)
        return ""

    def _mend(self, owner: str) -> None:
        self._down.discard(owner)
        for handle, owners in list(self._deaf.items()):
            owners.discard(owner)
            if not owners:
                del self._deaf[handle]
                _hear_again(self._sockets[handle])


def _ends(sock: socket.socket) -> Ends | None:
    """Return local and remote end of a connection, None while there is none."""
    try:
        return sock.getsockname(), sock.getpeername()
    except (OSError, ValueError):
        return None


def _hear_again(sock: socket.socket) -> None:
    with suppress(OSError, ValueError):  # a descriptor that is gone has nothing left to hear
        sock.setsockopt(socket.SOL_SOCKET, SO_DETACH_FILTER, 0)
