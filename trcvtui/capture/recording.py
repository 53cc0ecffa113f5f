"""A recording: a run's journal in one pcapng file, which is valid after each flush (docs/recording.md).

Rule 1: a file that is there is refused, unless it is a recording of ours and shall be overwritten.
Rule 2: a block of the journal stands in packets of MOST_PIECE bytes at most: Wireshark takes no larger ones.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from typing import Final

from trcvtui import __version__
from trcvtui.capture.journal import STEP, Answered, BlockWriter, Entry, RunBegins, entries_of
from trcvtui.capture.pcap import RAW_IP, USER0, interface_block, open_capture, packet_block, section_block
from trcvtui.errors import UserError, mistake
from trcvtui.files import FileName, reason_of

JOURNAL: Final = "trcvtui journal"  # the name of the interface
MOST_PIECE: Final = 128 << 10
MOST_BLOCK: Final = 128 << 20  # bytes of a block of the journal that is read
LAST, MORE = b"\0", b"\1"  # the first byte of a packet: whether the block goes on in the next one


class RecordingWriter:
    """Writes the recording of one run; raise UserError where the file is refused."""

    trouble = ""  # what goes wrong is raised

    def __init__(self, path: FileName, overwrite: bool = False) -> None:
        self.size = 0  # bytes of the file
        self._path = path
        self._ns = self._wall_ns = 0
        if os.path.lexists(path):
            _refuse(path, overwrite)
        try:
            if overwrite and os.path.lexists(path):
                os.unlink(path)
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
            self._file = os.open(path, flags, 0o600)
        except OSError as failed:
            raise mistake(str(path), reason_of(failed), "a file that can be written") from None
        self._block = BlockWriter(0)
        head = section_block(f"trcvtui {__version__}"), interface_block(RAW_IP, "wire")
        self._write(b"".join((*head, interface_block(USER0, JOURNAL))))

    def take(self, entries: Iterable[Entry]) -> None:
        """Take entries in their order."""
        for entry in entries:
            self._block.take(entry)
            if isinstance(entry, Answered):
                if entry.call == STEP and isinstance(entry.answer, int):
                    self._ns = self._wall_ns + entry.answer
            elif isinstance(entry, RunBegins):
                self._ns = self._wall_ns = entry.wall_ns
            if self._block.is_full:
                self.flush()

    def flush(self) -> None:
        """Write what there is."""
        if len(self._block):
            block = self._block.block()
            pieces = [block[at : at + MOST_PIECE] for at in range(0, len(block), MOST_PIECE)]
            marks = [MORE] * (len(pieces) - 1) + [LAST]
            packets = zip(marks, pieces, strict=True)
            self._write(b"".join(packet_block(1, self._ns, mark + piece) for mark, piece in packets))
            self._block = BlockWriter(self._block.number + 1)

    def _write(self, content: bytes) -> None:
        left = memoryview(content)
        while left:
            left = left[os.write(self._file, left) :]
        self.size += len(content)

    def close(self) -> None:
        """Write what is left, and end the file."""
        try:
            self.flush()
        finally:
            os.close(self._file)


def _refuse(path: FileName, overwrite: bool) -> None:
    if not overwrite:
        raise mistake(str(path), "a file that is there already", "a new name, or --overwrite for a recording")
    if not is_recording(path):
        raise mistake(str(path), "a file that is no recording of trcvtui", "a recording to overwrite")


def is_recording(path: FileName) -> bool:
    """Return whether a file has a journal of ours."""
    try:
        with open_capture(path) as reader:
            next(iter(reader), None)
            return any(one.link_type == USER0 and one.name == JOURNAL for one in reader.interfaces)
    except UserError:
        return False


class Recording:
    """A recording to read; raise UserError where it is none. `stopped`: why reading ended early, or ""."""

    def __init__(self, path: FileName) -> None:
        self.stopped = ""
        self._path = path
        with open_capture(path):
            pass  # what is no capture says so itself
        if not is_recording(path):
            found = f"no recording of trcvtui: try trcvtui watch {os.fspath(path)}"
            raise mistake(str(path), found, "a recording")

    def entries(self) -> Iterator[Entry]:
        """Yield the entries, as far as they can be read."""
        try:
            yield from entries_of(self._blocks(), str(self._path))
        except UserError as wrong:
            self.stopped = str(wrong)

    def _blocks(self) -> Iterator[bytes]:
        with open_capture(self._path) as reader:
            parts, size = list[bytes](), 0
            for packet in reader:
                if reader.interfaces[packet.interface].name != JOURNAL or not packet.data:
                    continue
                parts.append(packet.data[1:])
                size += len(packet.data)
                if size > MOST_BLOCK:
                    raise mistake(
                        str(self._path), "a larger block of the journal", f"at most {MOST_BLOCK} bytes"
                    )
                if packet.data[:1] == LAST:
                    yield b"".join(parts)
                    parts, size = [], 0
            if reader.trouble is not None:
                self.stopped = str(reader.trouble)
