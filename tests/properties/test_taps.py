"""Two plain programs through a tap, and the same two without it: bytes and ends are the same.

Each side has a random plan: how it writes, how it reads, how it ends. `make soak` draws 10^4 conversations.
"""

from __future__ import annotations

import errno
import os
import random
import socket
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import NamedTuple

import pytest

from tests.e2e.tapping import PATIENCE, Tap, calling, exactly, listening, reset

CONVERSATIONS = 10_000 if "TRCVTUI_SOAK" in os.environ else 80
AT_ONCE = 50
NAME_BYTES = 4

pytestmark = [pytest.mark.live, pytest.mark.timeout(3600)]


class SidePlan(NamedTuple):
    """What one side does: pieces that it writes, bytes of one read, how it ends after how many read.

    `end`: FIN after its last piece, and it reads on; RST when it has read `resets_after` bytes. `late`: it
    reads nothing before it has written all, so that the other end meets closed windows.
    """

    pieces: tuple[int, ...]
    read: int
    small_window: bool
    end: str
    resets_after: int
    late: bool = False


class Seen(NamedTuple):
    """What one side has read, and how the conversation ended for it."""

    data: bytes
    end: str


def drawn(number: int) -> tuple[SidePlan, SidePlan]:
    """Return the plans of both sides of a conversation; at most one side resets."""
    chance = random.Random(number)
    resets = chance.choice(("", "", "", "near", "far"))
    plans = []
    for side in ("near", "far"):
        most = chance.choice((1, 20, 1460, 5000, 70_000))
        pieces = tuple(chance.randint(1, most) for _ in range(chance.randint(0, 12)))
        read = chance.choice((1 << 16, 4096, max(most // 3, 64)))
        plans.append(SidePlan(pieces, read, chance.random() < 0.2, "RST" if resets == side else "FIN", 0))
    for n in (0, 1):
        if sum(plans[1 - n].pieces) > 20_000:  # a small window lets so much through in seconds only
            plans[n] = plans[n]._replace(small_window=False)
        if plans[n].end == "RST":
            plans[n] = plans[n]._replace(resets_after=chance.randint(0, sum(plans[1 - n].pieces)))
    if chance.random() < 0.06 and not resets:
        plans[0] = plans[0]._replace(pieces=tuple(chance.randint(1, 2_500_000) for _ in range(5)))
        plans[1] = plans[1]._replace(late=True, small_window=False, read=1 << 16)
    return plans[0], plans[1]


def bytes_of(number: int, side: int, size: int) -> bytes:
    return random.Random(number * 2 + side).randbytes(size)


def acted(sock: socket.socket, plan: SidePlan, data: bytes) -> Seen:
    """Play a plan at one end; return what it saw."""
    saw_reset = threading.Event()
    if plan.small_window:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)

    def write() -> None:
        at = 0
        try:
            for piece in plan.pieces:
                sock.sendall(data[at : at + piece])
                at += piece
            if plan.end == "FIN":
                sock.shutdown(socket.SHUT_WR)
        except OSError as failed:
            if not isinstance(failed, ConnectionError) and failed.errno != errno.ENOTCONN:
                raise
            saw_reset.set()

    writer = threading.Thread(target=write)
    writer.start()
    got = bytearray()
    if plan.late:
        writer.join()
    try:
        while plan.end == "FIN" or len(got) < plan.resets_after:
            most = plan.read if plan.end == "FIN" else min(plan.read, plan.resets_after - len(got))
            part = sock.recv(most)
            if not part:
                break
            got += part
    except ConnectionError:
        saw_reset.set()
    writer.join()
    reset(sock) if plan.end == "RST" else sock.close()
    return Seen(bytes(got), "own RST" if plan.end == "RST" else "RST" if saw_reset.is_set() else "FIN")


class Lines:
    """A door whose accepted ends play the far sides, by the number that each caller names first."""

    def __init__(self) -> None:
        self.door, self.port = listening()
        self.door.listen(512)
        self.door.settimeout(None)
        self.seen: dict[int, Seen] = {}
        self._pool = ThreadPoolExecutor(AT_ONCE * 2)
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                self._pool.submit(self._far, self.door.accept()[0])

    def _far(self, sock: socket.socket) -> None:
        sock.settimeout(PATIENCE)
        number = int.from_bytes(exactly(sock, NAME_BYTES), "big")
        plan = drawn(number)[1]
        self.seen[number] = acted(sock, plan, bytes_of(number, 1, sum(plan.pieces)))

    def near(self, number: int, port: int) -> Seen:
        plan = drawn(number)[0]
        sock = calling(port)
        sock.sendall(number.to_bytes(NAME_BYTES, "big"))
        return acted(sock, plan, bytes_of(number, 0, sum(plan.pieces)))

    def played(self, port: int) -> dict[int, tuple[Seen, Seen]]:
        """Play all conversations over a port, many at once; return what both sides saw."""
        with ThreadPoolExecutor(AT_ONCE) as pool:
            near = list(pool.map(lambda n: self.near(n, port), range(CONVERSATIONS)))
        self.door.close()
        self._pool.shutdown()
        return {n: (near[n], self.seen[n]) for n in range(CONVERSATIONS)}


def is_told_alike(number: int, through: tuple[Seen, Seen], direct: tuple[Seen, Seen]) -> bool:
    """Return whether both ran as promised: all bytes, or before an RST a prefix of them, then the reset."""
    plans = drawn(number)
    sent = [bytes_of(number, side, sum(plans[side].pieces)) for side in (0, 1)]
    if all(plan.end == "FIN" for plan in plans):
        whole = Seen(sent[1], "FIN"), Seen(sent[0], "FIN")
        return through == whole == direct
    return all(
        sent[1 - side].startswith(seen[side].data)
        and seen[side].end == ("own RST" if plans[side].end == "RST" else "RST")
        and (plans[side].end == "FIN" or len(seen[side].data) == plans[side].resets_after)
        for seen in (through, direct)
        for side in (0, 1)
    )


def test_a_conversation_through_a_tap_is_that_without_it() -> None:
    bare = Lines()
    direct = bare.played(bare.port)
    tapped = Lines()
    with Tap(str(tapped.port)) as tap:
        through = tapped.played(tap.port)
        assert tap.end()[0] == 0
    differ = [n for n in range(CONVERSATIONS) if not is_told_alike(n, through[n], direct[n])]
    assert [(n, drawn(n), [(len(s.data), s.end) for s in (*through[n], *direct[n])]) for n in differ] == []
