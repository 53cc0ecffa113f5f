"""The newest recording of an agent over the broker: who asks names a number, and gets pieces under it.

Rule: only an agent started with `--allow-fetch` answers, one request at a time, never a retained one.
Who asks believes nothing: sizes are bounded, the whole is checked by its hash before it is kept.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from trcvtui import clock
from trcvtui.errors import UserError, mistake
from trcvtui.files import write_file
from trcvtui.fleet.topics import ROOT, encoded

PIECE: Final = 1 << 18  # bytes of the recording in one message
MOST_FETCHED: Final = 64 << 20
MOST_REQUEST: Final = 1000  # bytes
MOST_MINUTES: Final = 24 * 60
AHEAD: Final = 4  # pieces that the broker has not taken yet
PATIENCE_NS: Final = 20_000_000_000  # without a piece
NONCE: Final = re.compile(r"[0-9a-f]{16}")
NAME: Final = re.compile(r"[\w.-]{1,100}\.pcapng")
NS: Final = 1_000_000_000
Publish = Callable[[str, bytes], int | None]  # returns a number that is acknowledged, None: not now


def request_topic(site: str, agent: str) -> str:
    """Return where an agent hears requests."""
    return f"{ROOT}/{encoded(site)}/{encoded(agent)}/request"


def answer_topic(site: str, agent: str, nonce: str) -> str:
    return f"{ROOT}/{encoded(site)}/{encoded(agent)}/answer/{nonce}"


# -- the agent -----------------------------------------------------------------------------------------------


class FetchDesk:
    """Answers requests from a folder of numbered files; `say` tells who runs the agent, a line each."""

    def __init__(self, folder: Path, site: str, agent: str, say: Callable[[str], None]) -> None:
        self.topic = request_topic(site, agent)
        self._folder, self._site, self._agent, self._say = folder, site, agent, say
        self._parts: list[tuple[Path, int, int]] = []  # file, from which byte, how many
        self._head: dict[str, Any] = {}
        self._topic, self._sent, self._of = "", 0, 0
        self._underway: set[int] = set()
        self._is_told = False  # that another one was asked for meanwhile

    def hear(self, topic: str, payload: bytes, is_retained: bool) -> None:
        """Take a message; begin to answer where it is a request, and nothing is under way."""
        if topic != self.topic or is_retained or len(payload) > MOST_REQUEST:
            return
        try:
            asked = json.loads(payload)
            nonce, minutes = asked["nonce"], asked["minutes"]
        except (ValueError, KeyError, TypeError, RecursionError):
            return
        is_right = isinstance(nonce, str) and NONCE.fullmatch(nonce) and isinstance(minutes, int | float)
        if not is_right or not 0 < minutes <= MOST_MINUTES:
            return
        if self._of:
            if not self._is_told:  # once: there may be thousands
                self._say("a recording was asked for while another one is on its way: not answered")
            self._is_told = True
            return
        self._begin(answer_topic(self._site, self._agent, nonce), minutes)

    def _begin(self, topic: str, minutes: float) -> None:
        self._topic, self._sent, self._of, self._is_told = topic, 0, 1, False
        self._parts, self._head = [], {"error": "nothing is recorded yet"}
        files = self._newest(minutes)
        if not files:
            return
        try:
            self._read(files)
        except OSError as gone:  # the ring has let it go
            self._parts, self._head = [], {"error": gone.strerror or "no recording"}

    def _read(self, files: list[Path]) -> None:
        whole = sha256()
        sizes = []
        for file in files:
            size = 0
            with file.open("rb") as opened:
                while size < MOST_FETCHED and (data := opened.read(PIECE)):
                    whole.update(data)
                    self._parts.append((file, size, len(data)))
                    size += len(data)
                    if len(data) < PIECE:
                        break  # its end, as it is now
            sizes.append([file.name, size])
        if not self._parts:
            return
        self._of = len(self._parts)
        self._head = {"of": self._of, "files": sizes, "sha256": whole.hexdigest()}
        self._say(f"a recording is asked for over the broker: {', '.join(file.name for file in files)}")

    def _newest(self, minutes: float) -> list[Path]:
        try:
            ordered = sorted(self._folder.glob("*.pcapng"), key=os.path.getmtime)
            since = clock.wall_ns() / NS - minutes * 60
            fits = [file for file in ordered if file.stat().st_mtime >= since] or ordered[-1:]
            while fits[1:] and sum(file.stat().st_size for file in fits) > MOST_FETCHED:
                fits.pop(0)
        except OSError:
            return []
        return fits

    def acknowledged(self, number: int) -> None:
        """Take that the broker has one of our messages."""
        self._underway.discard(number)

    def forget(self) -> None:
        """Take that the connection is lost, and who asked with it."""
        self._of = self._sent = 0
        self._underway.clear()

    def turn(self, publish: Publish) -> None:
        """Send what may be sent."""
        while self._of and len(self._underway) < AHEAD:
            head = {"n": self._sent, **self._head} if self._sent == 0 else {"n": self._sent}
            number = publish(self._topic, json.dumps(head).encode() + b"\n" + self._piece())
            if number is None:
                return
            self._underway.add(number)
            self._sent += 1
            if self._sent >= self._of:
                self._of = self._sent = 0

    def _piece(self) -> bytes:
        if not self._parts:
            return b""
        file, at, size = self._parts[self._sent]
        try:
            with file.open("rb") as opened:
                opened.seek(at)
                return opened.read(size)
        except OSError:  # the ring has let it go
            return b""


# -- who asks ------------------------------------------------------------------------------------------------


class Fetch:
    """One recording on its way. `told`: how far it is, or what went wrong; `path`: it is here."""

    def __init__(self, site: str, agent: str, folder: Path, now: int) -> None:
        self.nonce = os.urandom(8).hex()
        self.topic = answer_topic(site, agent, self.nonce)
        self.path: Path | None = None
        self.is_over = False
        self.told = f"{agent} was asked for its recording"
        self.agent, self._folder, self._heard_at = agent, folder, now
        self._pieces: list[bytes] = []
        self._size = self._of = 0
        self._files: list[tuple[str, int]] = []
        self._hash = ""

    def request(self, minutes: float) -> bytes:
        """Return what is published to ask."""
        return json.dumps({"nonce": self.nonce, "minutes": minutes}).encode()

    def take(self, payload: bytes, now: int) -> None:
        """Take a piece; the last one lets the recording be written."""
        if self.is_over:
            return
        self._heard_at = now
        try:
            self._take(payload)
        except UserError as wrong:
            self._end(wrong.lines()[0])

    def look(self, now: int) -> None:
        """Give up where nothing comes any more."""
        if not self.is_over and now > self._heard_at + PATIENCE_NS:
            self._end(f"{self.agent} does not answer: expected one with --record and --allow-fetch")

    def _end(self, told: str) -> None:
        self.is_over, self.told = True, told
        self._pieces.clear()

    def _take(self, payload: bytes) -> None:
        line, _, data = payload.partition(b"\n")
        try:
            head = json.loads(line[: MOST_REQUEST * 20])
            number = head["n"]
        except (ValueError, KeyError, TypeError, RecursionError):
            raise mistake(self.agent, "no piece of a recording", "one with its number") from None
        if number == 0 and "error" in head:
            raise mistake(self.agent, str(head["error"])[:100], "a recording")
        if number == 0 and not self._pieces:
            self._begin(head)
        if number != len(self._pieces) or len(data) > PIECE or number >= self._of:
            if isinstance(number, int) and number < len(self._pieces):
                return  # QoS 1 may bring it twice
            raise mistake(self.agent, f"piece {number!r}"[:40], f"piece {len(self._pieces)}")
        self._pieces.append(data)
        self._size += len(data)
        self.told = f"{self.agent}: {self._size >> 10} KiB, piece {len(self._pieces)} of {self._of}"
        if len(self._pieces) == self._of:
            self._finish()

    def _begin(self, head: dict[str, Any]) -> None:
        files, self._hash = head.get("files"), str(head.get("sha256"))
        if not isinstance(files, list) or not 0 < len(files) <= MOST_REQUEST // 10:
            raise mistake(self.agent, "no list of files", "one")
        for each in files:
            match each:
                case [str(name), int(size)] if NAME.fullmatch(name) and 0 <= size <= MOST_FETCHED:
                    self._files.append((name, size))
                case _:
                    raise mistake(self.agent, "a strange file", "a name and its size")
        total = sum(size for _, size in self._files)
        self._of = sum(-(-size // PIECE) for _, size in self._files)
        if total > MOST_FETCHED or not self._of or head.get("of") != self._of:
            raise mistake(self.agent, f"{total} bytes", f"{MOST_FETCHED} at most")

    def _finish(self) -> None:
        whole = b"".join(self._pieces)
        if sha256(whole).hexdigest() != self._hash:
            raise mistake(self.agent, "another hash", "the recording as it was sent: it goes on, ask again")
        for name, size in self._files:
            data, whole = whole[:size], whole[size:]
            path = self._folder / f"fetched-{self.nonce[:8]}-{name}"
            write_file(path, data, "the recording", is_own=True)
            self.path = path
        self._end(f"{self._files[-1][0]} is here as {self.path.name}" if self.path else "")
