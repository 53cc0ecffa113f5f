"""Stores messages for the broker in a file. After a restart the agent continues with this file.

Rule 1: after the start no disk error is raised. `dropped` counts lost messages. A damaged file is renamed,
and a new file is begun. `say` gets one line about each error.
Rule 2: the file belongs to one agent and contains traffic: mode 0600.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final

from trcvtui import clock
from trcvtui.errors import mistake, one_line

MOST_QUEUED: Final = 20_000
EVENT, FIGURES = 0, 1  # kinds of messages
MEMORY: Final = ":memory:"
FILE_SUFFIXES: Final = ("", "-wal", "-shm")  # files of one queue
DAMAGED_CODES: Final = frozenset((sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB))
# The number identifies a sent message, so none is used twice: AUTOINCREMENT continues after an empty queue,
# and a new file starts at the present time.
_SCHEMA: Final = (
    "CREATE TABLE IF NOT EXISTS queue "
    "(n INTEGER PRIMARY KEY AUTOINCREMENT, kind INT, topic TEXT, payload BLOB)",
    "CREATE INDEX IF NOT EXISTS oldest ON queue (kind DESC, n)",
    "CREATE TABLE IF NOT EXISTS retained (topic TEXT PRIMARY KEY)",
    "INSERT INTO sqlite_sequence SELECT 'queue', 1000 * strftime('%s', 'now') "
    "WHERE NOT EXISTS (SELECT 1 FROM sqlite_sequence)",
)


class DiskQueue:
    """A queue in the file `path`, or in memory for None. Raise UserError if another agent uses the file."""

    def __init__(self, path: Path | None, say: Callable[[str], None], most: int = MOST_QUEUED) -> None:
        self._path, self._say, self._most = path, say, most
        self.dropped = {EVENT: 0, FIGURES: 0}
        self.size = 0
        self._last_report = ""
        self._lock = _lock_file(path, self._report)
        self._base = self._open_or_replace(path)

    def _open_or_replace(self, path: Path | None) -> sqlite3.Connection:
        for _ in range(2):  # the second try has a new file
            try:
                return self._open(path)
            except (sqlite3.Error, OSError) as failed:
                self._report(f"{path}: {failed}")
                if path is None or not _is_damaged(failed) or not self._set_aside(path):
                    break
        if path is not None:
            self._report("messages for the broker are queued in memory only")
        return self._open(None)

    def _open(self, path: Path | None) -> sqlite3.Connection:
        if path is not None:
            os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o600))
            for each in filter(os.path.exists, (f"{path}{end}" for end in FILE_SUFFIXES)):
                os.chmod(each, 0o600)  # rule 2, also for older files; sqlite's -wal and -shm copy the mode
        base = sqlite3.connect(path or MEMORY, timeout=1.0, isolation_level=None)
        try:
            base.execute("PRAGMA journal_mode=WAL")
            base.execute("PRAGMA synchronous=NORMAL")  # with a WAL a power cut damages nothing
            for table in _SCHEMA:
                base.execute(table)
            [(self.size,)] = base.execute("SELECT count(*) FROM queue")
            self._taken: list[int] = []  # messages whose DELETE has failed: tried again
        except sqlite3.Error:
            base.close()
            raise
        return base

    def _set_aside(self, path: Path) -> bool:
        aside = path.with_suffix(f".damaged-{clock.utc_ns():x}")
        try:
            for end in FILE_SUFFIXES:
                if os.path.exists(f"{path}{end}"):
                    os.replace(f"{path}{end}", f"{aside}{end}")
        except OSError as failed:
            self._report(f"{path}: {failed.strerror}")
            return False
        self._report(f"{path} is damaged: renamed to {aside.name}, a new queue begins")
        return True

    def _report(self, line: str) -> None:
        if line != self._last_report:
            self._last_report = line
            self._say(one_line(line))

    def _execute(self, text: str, values: Iterable[object] = ()) -> sqlite3.Cursor | None:
        """Run a statement. Return None after a disk error (rule 1)."""
        try:
            return self._base.execute(text, tuple(values))
        except sqlite3.Error as failed:
            self._report(f"the queue: {failed}; the bench keeps running")
            if _is_damaged(failed) and self._path is not None:
                self._base.close()
                self._set_aside(self._path)
                self._base = self._open_or_replace(self._path)
            return None

    def put(self, kind: int, topic: str, payload: bytes) -> bool:
        """Append a message; a full queue drops old figures first, then old events. Return False on error."""
        values = kind, topic, payload
        if self._execute("INSERT INTO queue (kind, topic, payload) VALUES (?, ?, ?)", values) is None:
            return False
        self.size += 1
        if self.size > self._most:
            [(oldest, gone)] = self._fetch("SELECT n, kind FROM queue ORDER BY kind DESC, n LIMIT 1") or [
                (0, kind)
            ]
            self.delete(oldest)
            self.dropped[gone] += 1
        return True

    def _fetch(self, text: str, values: Iterable[object] = ()) -> list[Any]:
        cursor = self._execute(text, values)
        try:
            return [] if cursor is None else cursor.fetchall()
        except sqlite3.Error as failed:  # sqlite reads some pages only now
            self._report(f"the queue: {failed}; the bench keeps running")
            return []

    def list_after(self, number: int, most: int) -> list[tuple[int, str, bytes]]:
        """Return the oldest messages after `number`, at most `most`, as (number, topic, payload)."""
        return self._fetch(
            "SELECT n, topic, payload FROM queue WHERE n > ? ORDER BY n LIMIT ?", (number, most)
        )

    def delete(self, number: int) -> None:
        self._taken.append(number)
        while self._taken and (deleted := self._execute("DELETE FROM queue WHERE n = ?", self._taken[-1:])):
            self._taken.pop()
            self.size -= deleted.rowcount

    # -- topics that the broker retains after the agent's end --------------------------------------------

    def remember_topic(self, topic: str) -> None:
        self._execute("INSERT OR IGNORE INTO retained VALUES (?)", (topic,))

    def forget_topic(self, topic: str) -> None:
        self._execute("DELETE FROM retained WHERE topic = ?", (topic,))

    def list_topics(self) -> list[str]:
        """Return the topics that this agent has ever retained and not cleared."""
        return [topic for (topic,) in self._fetch("SELECT topic FROM retained")]

    def close(self) -> None:
        self._base.close()
        if self._lock is not None:
            os.close(self._lock)


def _is_damaged(failed: Exception) -> bool:
    return getattr(failed, "sqlite_errorcode", 0) & 0xFF in DAMAGED_CODES


def _lock_file(path: Path | None, tell: Callable[[str], None]) -> int | None:
    """Return a lock that ends with this process; raise UserError if another agent holds the lock."""
    try:
        import fcntl
    except ImportError:  # Windows
        return None
    if path is None:
        return None
    try:
        lock = os.open(f"{path}.lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as failed:
        tell(f"{path}: {failed.strerror}")
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise mistake("--site, --name", "another running agent with both", "an unused name") from None
    except OSError:  # a file system without locks: no protection there
        return lock
    return lock
