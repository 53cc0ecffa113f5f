"""Who is ready, asked of the system: one epoll on Linux, else poll or select over a list of descriptors."""

from __future__ import annotations

import errno
import select
from typing import Final, Protocol

# poll and epoll share these numbers.
IN: Final = 0x1
OUT: Final = 0x4
ERR: Final = 0x8
HUP: Final = 0x10
RDHUP: Final = getattr(select, "EPOLLRDHUP", 0)
HAS_POLL: Final = hasattr(select, "poll")
GONE: Final = ERR | HUP | RDHUP
# An ICMP message raises ERR alone while an attempt to connect goes on: no verdict (3.3).
# select has no HUP: there ERR is how a refusal shows (section 4, Windows).
VERDICT: Final = OUT | HUP if HAS_POLL else OUT | ERR


class PollSet(Protocol):
    """What select.epoll offers."""

    def register(self, fd: int, mask: int) -> None: ...
    def unregister(self, fd: int) -> None: ...
    def poll(self, timeout: float, maxevents: int) -> list[tuple[int, int]]: ...
    def close(self) -> None: ...


class PollList:
    """The poll set of a system without epoll."""

    def __init__(self) -> None:
        self._wanted: dict[int, int] = {}

    def register(self, fd: int, mask: int) -> None:
        """Take fd in; EEXIST when it is in."""
        if fd in self._wanted:
            raise OSError(errno.EEXIST, "already in the poll set")
        self._wanted[fd] = mask

    def unregister(self, fd: int) -> None:
        """Take fd out; ENOENT when it is not in."""
        if self._wanted.pop(fd, None) is None:
            raise OSError(errno.ENOENT, "not in the poll set")

    def poll(self, timeout: float, maxevents: int) -> list[tuple[int, int]]:
        """Return (descriptor, events) of those that are ready now."""
        return look_at(self._wanted) if self._wanted else []

    def close(self) -> None:
        """Forget all."""
        self._wanted.clear()


def new_poll_set() -> PollSet:
    """Return an empty poll set; raises OSError (EMFILE) when the system has no descriptor for it."""
    return select.epoll() if hasattr(select, "epoll") else PollList()


def look_at(wanted: dict[int, int]) -> list[tuple[int, int]]:
    """Return (descriptor, events) of those that are ready now, without waiting."""
    if HAS_POLL:
        poller = select.poll()
        for fd, mask in wanted.items():
            poller.register(fd, mask)
        return poller.poll(0)
    return _select(wanted)


def _select(wanted: dict[int, int]) -> list[tuple[int, int]]:
    readers = [fd for fd, mask in wanted.items() if mask & IN]
    writers = [fd for fd, mask in wanted.items() if mask & OUT]
    seen: dict[int, int] = {}
    for fds, mask in zip(select.select(readers, writers, list(wanted), 0), (IN, OUT, ERR), strict=True):
        for fd in fds:
            seen[fd] = seen.get(fd, 0) | mask
    return list(seen.items())
