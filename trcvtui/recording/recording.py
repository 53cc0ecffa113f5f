"""The recording file: writes the entries of a run as one pcapng for Wireshark, and reads the entries back.

Rule 1: each write is a whole block, first its packets, then its part of the journal. A file that breaks off
is good up to its last journal block.
Rule 2: bytes in a packet are not written twice. The journal points to them (docs/recording-format.md).
Rule 3: no length in a file is trusted. Only the packets of one block are in memory.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, suppress
from itertools import chain
from typing import IO, Final, NamedTuple

from trcvtui import __version__
from trcvtui.capture import pcap
from trcvtui.capture.packets import TCP
from trcvtui.errors import Problem, UserError, mistake
from trcvtui.files import FileName, create_file, open_private_file, open_to_read, reason_of
from trcvtui.recording.journal import (
    STEP,
    BlockWriter,
    CallRecord,
    Entry,
    Keyframe,
    LostEntries,
    RunHeader,
    Secrets,
    WireCall,
    check_block,
    decode_by_block,
    decode_entries,
)
from trcvtui.recording.run_packets import JOURNAL_PACKET, RunPackets

WIRE_ID, JOURNAL, FIRST_LINE_ID = range(3)  # interfaces; a serial line each from the third on
JOURNAL_NAME: Final = "trcvtui journal"
MOST_PIECE_BYTES: Final = 128 << 10  # bytes of a packet of the journal: Wireshark takes no larger ones
LAST, MORE = b"\0", b"\1"  # the first byte of such a packet: does the next one continue its block?
FLUSH_NS: Final = 500_000_000  # of the run's time, at most, between two blocks of the journal
MOST_SCAN_BYTES: Final = 8 << 20  # bytes of journal that end a block even within a scan
MOST_PAYLOAD_BYTES: Final = 4 << 20  # of the packets of one block
MOST_READ_BYTES: Final = 64 << 20  # of one block; a reader refuses more
MOST_UNPACKED_BYTES: Final = 1 << 30  # bytes of a .gz, in memory
INDEX_MAGIC: Final = b"trcvtui index\n\0\0"
KEYFRAME_MAGIC: Final = b"trcvtui state\n\0\0"
IS_KEYFRAME: Final = (1 << 64) - 1  # in a row of the index, in place of the block of the journal
_KEYFRAME_HEAD: Final = struct.Struct("<IqIIII")  # scan, ns; scans and entries before; bytes; of the text
_ROW: Final = struct.Struct("<QQIq")  # byte of the block's first packet, of the journal; scans before; ns
_LENGTH: Final = struct.Struct("<I")
_HEAD: Final = struct.Struct("<II")
_PACKET_HEAD: Final = struct.Struct("<IIII")
_HEADER_BYTES: Final = {True: 40, False: 28}  # bytes before the payload of a TCP segment, of a datagram
SERIAL_HEADER_BYTES: Final = 12
AT_DATA: Final = 28  # of a block with a packet


class BlockPlace(NamedTuple):
    """The place of a journal block. Before it, `scans` scans had begun, and the run's time was `ns`."""

    packets_at: int
    journal_at: int
    scans: int
    ns: int


class RecordingWriter:
    """Writes one file with mode 0600. Raises UserError if the file cannot be made or written.

    An existing file is refused, unless it is a recording and `overwrite` is set. `file` is already open.
    """

    trouble = ""  # errors are raised
    first_scan = 0
    is_followed, lack = False, ""

    def __init__(self, path: FileName, overwrite: bool = False, file: IO[bytes] | None = None) -> None:
        self._path = str(path)
        if overwrite and os.path.lexists(path):  # raises for another file
            Recording(path)
        self._file: IO[bytes] = create_file(path, "--record", overwrite) if file is None else file
        self.size = 0  # bytes that the file has
        self._lines: dict[str, int] = {}  # interface of each serial line
        self._index: list[BlockPlace] = []
        self._packets = RunPackets()
        self._wall_ns = self._now = self._flushed = 0
        self._scans = self._block_scans = self._block_ns = 0
        self._secrets = b""  # of the packets of this block
        self._block = BlockWriter(0)
        self._blocks = 0
        self._write(
            pcap.section_block(f"trcvtui {__version__}", ("a recording of trcvtui",))
            + pcap.interface_block(pcap.RAW_IP, "wire")
            + pcap.interface_block(pcap.USER0, JOURNAL_NAME)
        )

    def continue_connections(self, packets: RunPackets, old: Iterable[Entry]) -> None:
        for entry in old:
            self._add_entry(entry)
        packets.wire.wall_ns, self._packets = self._wall_ns, packets
        for entry in packets.begin_file():
            self._add_entry(entry)
        self.flush()

    def add_entries(self, entries: Iterable[Entry]) -> None:
        for entry in entries:
            if type(entry) is CallRecord:
                self._add_entry(self._packets.process_entry(entry))
            elif isinstance(entry, WireCall):
                self._packets.add_wire_call(entry)
            elif isinstance(entry, Secrets):
                self._secrets += entry.key_log
            elif isinstance(entry, Keyframe):
                self.add_keyframe(entry)
            else:
                if isinstance(entry, LostEntries) and entry.number and self._blocks + len(self._block) < 2:
                    self.lack = "no keyframe"  # entries are lost at the beginning: a replay needs one
                if isinstance(entry, RunHeader):
                    self._wall_ns = self._packets.wire.wall_ns = entry.wall_ns
                self._add_entry(entry)

    def _add_entry(self, entry: Entry) -> None:
        if type(entry) is CallRecord and entry[1] == STEP and isinstance(entry[3], int):
            self._begin_scan(entry[3])
        self._block.add_entry(entry)
        if self._block.size >= MOST_SCAN_BYTES:
            self.flush()

    def _begin_scan(self, now: int) -> None:
        if now - self._flushed >= FLUSH_NS or self._block.is_full or self._packets.size >= MOST_PAYLOAD_BYTES:
            self.flush()
            self._flushed = now
        self._now = now
        self._scans += 1

    def flush(self) -> None:
        """Write the entries that have come as one block of the journal."""
        if not len(self._block):
            return
        check, written = 0, [pcap.secrets_block(self._secrets)] if self._secrets else []
        self._secrets = b""
        for number, packet in enumerate(self._packets.packets):
            if packet.line and packet.line not in self._lines:
                self._lines[packet.line] = FIRST_LINE_ID + len(self._lines)
                written.append(pcap.interface_block(pcap.RTAC_SERIAL, packet.line))
            interface = self._lines[packet.line] if packet.line else WIRE_ID
            comments = tuple(self._packets.comments.get(number, ()))
            block = pcap.packet_block(interface, packet.ns, packet.data, comments, sent=packet.sent)
            check = zlib.crc32(block[8 : AT_DATA + len(packet.data)], check)  # without options
            written.append(block)
        packets = b"".join(written)
        of_journal = self._packets.comments.get(JOURNAL_PACKET, ())
        journal = self._encode_journal(self._block.encode(check), of_journal)
        row = BlockPlace(self.size, self.size + len(packets), self._block_scans, self._block_ns)
        self._write(packets + journal)
        self._index.append(row)
        self._blocks += 1
        self._block_scans, self._block_ns = self._scans, self._now
        self._block = BlockWriter(self._blocks)
        self._packets.begin_block()

    def add_keyframe(self, frame: Keyframe) -> None:
        """Write a keyframe of the scans so far."""
        self.lack = ""
        self.flush()
        program = frame.program.encode()
        content = _KEYFRAME_HEAD.pack(*frame[1:6], len(program)) + program + frame.content
        row = BlockPlace(self.size, IS_KEYFRAME, frame.scan, frame.ns)
        self._write(self._encode_journal(_add_checksum(KEYFRAME_MAGIC, content)))
        self._index.append(row)

    def _encode_journal(self, block: bytes, comments: Iterable[str] = ()) -> bytes:
        pieces = [block[at : at + MOST_PIECE_BYTES] for at in range(0, len(block), MOST_PIECE_BYTES)]
        marks = [MORE] * (len(pieces) - 1) + [LAST]
        ns = self._wall_ns + self._now
        texts = [tuple(comments), *[()] * (len(pieces) - 1)]
        parts = zip(marks, pieces, texts, strict=True)
        return b"".join([pcap.packet_block(JOURNAL, ns, mark + piece, text) for mark, piece, text in parts])

    def _write(self, data: bytes) -> None:
        """Append all or nothing; if the disk refuses the data, end the file here and raise UserError."""
        try:
            rest = memoryview(data)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as failed:
            self._file.truncate(self.size)  # Rule 1: no half block
            self._file.close()
            expected = f"room for it: the recording ends after {self.size} bytes"
            raise mistake(self._path, reason_of(failed), expected) from None
        self.size += len(data)

    def close(self) -> None:
        """Write the waiting entries and the index."""
        if self._file.closed:
            return
        self.flush()
        self._index.append(BlockPlace(self.size, self.size, self._scans, self._now))  # of itself
        rows = b"".join(_ROW.pack(*row) for row in self._index)
        self._write(self._encode_journal(_add_checksum(INDEX_MAGIC, rows)))
        self._file.close()


class Recording:
    """A recording to read. Raises UserError if the file cannot be opened or is no recording.

    If reading ended before the end of the file, `stopped` says why. Places in a .gz count unpacked bytes.
    """

    def __init__(self, path: FileName) -> None:
        self.path = str(path)
        self.stopped = ""
        self.has_secrets = False  # of TLS, as far as it has been read
        self._memory, self._unpacked, self._torn = ExitStack(), "", ""  # of a .gz; why it breaks off
        with self._open_file() as file:
            self._check_head(file)
        self._index: list[BlockPlace] | None = None
        self._keyframes: list[BlockPlace] = []

    def _open_file(self) -> IO[bytes]:
        try:
            with open_to_read(self.path) as file:
                if not self._unpacked and os.read(file.fileno(), 2) == pcap.GZIP_MAGIC:
                    self._unpack(file)
                return open(self._unpacked or os.dup(file.fileno()), "rb")
        except (OSError, ValueError) as failed:
            raise mistake(self.path, reason_of(failed), "a recording that can be read") from None

    def _unpack(self, packed: IO[bytes]) -> None:
        handle, self._unpacked = self._memory.enter_context(open_private_file())
        read, size = pcap.gunzip(packed.read, pcap.GZIP_MAGIC), 0
        try:
            while piece := read(pcap.CHUNK_BYTES):
                size += os.write(handle, piece)
                if size > MOST_UNPACKED_BYTES:  # a zip bomb would fill the memory
                    expected = f"at most {MOST_UNPACKED_BYTES} bytes: unpack it with gunzip first"
                    raise mistake(self.path, "more bytes in the .gz", expected)
        except EOFError as failed:
            self._torn = str(failed)

    def _check_head(self, file: IO[bytes]) -> None:
        """Raise UserError if the interface of our journal is missing."""
        found = []
        for kind, body, _ in self._read_blocks(file, 0):
            if kind == pcap.INTERFACE_BLOCK:
                found.append(body)
            elif kind != pcap.SECTION:
                break
            if len(found) > JOURNAL:
                break
        self.stopped = ""  # only the head was read
        is_ours = len(found) > JOURNAL and found[JOURNAL][:2] == struct.pack("<H", pcap.USER0)
        if not is_ours or JOURNAL_NAME.encode() not in found[JOURNAL]:
            expected = f"a recording; for a capture use trcvtui watch {self.path}"
            raise mistake(self.path, "no journal of trcvtui", expected)

    def _read_blocks(self, file: IO[bytes], at: int) -> Iterator[tuple[int, bytes, int]]:
        """Yield type, body and place of the blocks from byte `at` on. `stopped` says why no more follow."""
        file.seek(at)
        while head := file.read(8):
            if len(head) < 8:
                break
            kind, size = _HEAD.unpack(head)
            if size < 12 or size & 3 or size > pcap.MOST_BLOCK:  # Rule 3
                self._note_stop(at, f"a block of {size} bytes", f"{pcap.MOST_BLOCK} at most")
                return
            body = file.read(size - 8)
            if len(body) < size - 8:
                break
            if body[-4:] != head[4:]:
                self._note_stop(at, "a block with two different lengths", str(size))
                return
            if kind == pcap.SECTION and at:
                self._note_stop(at, "a second capture after the first", "the end of the file")
                return
            yield kind, body[:-4], at
            at += size
        if self._torn:
            self._note_stop(at, self._torn, "a whole file")
        elif head:
            self._note_stop(at, "the end of the file", "the rest of a block")

    def _note_stop(self, at: int, found: str, expected: str) -> None:
        self.stopped = str(Problem(f"{self.path}: byte {at}", found, expected))

    def read_blocks(self) -> Iterator[tuple[int, bytes]]:
        with self._open_file() as file:
            for kind, body, _ in self._read_blocks(file, 0):
                yield kind, body

    def find_damage(self) -> str:
        """Read the whole file; return the first damaged place, or "" for none."""
        found: list[int] = []
        try:
            for block, place in self._blocks(0, []):
                where = f"{self.path}: byte {place.journal_at}"
                found.append(place.journal_at)
                if block.startswith(KEYFRAME_MAGIC):
                    _parse_keyframe(block, where)
                elif block.startswith(INDEX_MAGIC):
                    rows = _parse_index(block, place.packets_at, where)
                    if rows and [max(set(row[:2]) - {IS_KEYFRAME}) for row in rows] != found:
                        raise mistake(where, "an index of other blocks", "one of the blocks before it")
        except UserError as wrong:
            return str(wrong)
        return self.stopped

    def read_entries(self, first: int = 0) -> Iterator[Entry]:
        """Yield the entries of the journal from block number `first` on, as far as they can be read.

        Raise UserError if not even the first entry can be read.
        """
        return chain.from_iterable(self._read_by_block(first))

    def _read_by_block(self, first: int) -> Iterator[Iterator[Entry]]:
        at = self.read_index()[first].packets_at if first else 0
        payloads: list[bytes] = []
        found = self._blocks(at, payloads, first)
        blocks = (block for block, _ in found if not block.startswith((INDEX_MAGIC, KEYFRAME_MAGIC)))
        number = first
        try:
            for block in decode_by_block(blocks, self.path, payloads, first):
                number += 1
                yield block
        except UserError as wrong:
            if not number:  # else the blocks before it are good
                raise
            self.stopped = str(wrong)

    def _blocks(self, at: int, payloads: list[bytes], number: int = 0) -> Iterator[tuple[bytes, BlockPlace]]:
        """Yield the journal's blocks from `number` on, the keyframes and the index, with their places.

        Before each block, `payloads` gets the payloads of its packets. Raise UserError for a changed block.
        """
        pieces: list[bytes] = []
        begun, journal_at, kept, check, is_over = -1, 0, 0, 0, False
        with self._open_file() as file:
            for kind, body, place in self._read_blocks(file, at):
                self.has_secrets |= kind == pcap.SECRETS_BLOCK
                if kind != pcap.ENHANCED_PACKET or len(body) < AT_DATA - 8:
                    continue
                interface, _, _, size = _PACKET_HEAD.unpack_from(body)
                data = body[AT_DATA - 8 : AT_DATA - 8 + size]
                begun = place if begun < 0 else begun
                kept += len(data)
                if kept > MOST_READ_BYTES:  # Rule 3
                    expected = f"a block of the journal after {MOST_READ_BYTES} bytes at most"
                    raise mistake(f"{self.path}: byte {place}", "packets and no journal", expected)
                if is_over or (interface == JOURNAL and data[:1] not in (LAST, MORE)):
                    expected = "the end of the file" if is_over else "a piece of the journal"
                    raise mistake(f"{self.path}: byte {place}", "another packet", expected)
                if interface != JOURNAL:
                    payloads.append(_get_payload(interface, data))
                    check = zlib.crc32(body[: AT_DATA - 8 + size], check)
                    continue
                journal_at = place if not pieces else journal_at
                pieces.append(data[1:])
                if data[:1] == LAST:
                    block = b"".join(pieces)
                    is_over = block.startswith(INDEX_MAGIC)
                    if not block.startswith((INDEX_MAGIC, KEYFRAME_MAGIC)):
                        check_block(block, number, check, f"{self.path}: byte {begun}")
                        number += 1
                    yield block, BlockPlace(begun, journal_at, 0, 0)
                    payloads.clear()
                    pieces, begun, kept, check = [], -1, 0, 0

    def read_index(self) -> list[BlockPlace]:
        """Return where the blocks of the journal are: from the index, or by reading the whole file."""
        if self._index is None:
            with self._open_file() as file:
                rows = _read_written_index(file)
            if rows:
                self._keyframes = [row for row in rows if row.journal_at == IS_KEYFRAME]
                self._index = [row for row in rows if row.journal_at != IS_KEYFRAME]
            else:
                self._index = self._rebuild_index()
        return self._index

    def _rebuild_index(self) -> list[BlockPlace]:
        rows: list[BlockPlace] = []
        payloads: list[bytes] = []
        scans = ns = 0
        try:
            for block, row in self._blocks(0, payloads):
                if block.startswith(KEYFRAME_MAGIC):
                    with suppress(UserError):  # a broken one is left out: the one before will do
                        frame = _parse_keyframe(block, self.path)
                        self._keyframes.append(BlockPlace(row.packets_at, IS_KEYFRAME, frame.scan, frame.ns))
                elif not block.startswith(INDEX_MAGIC):
                    row = row._replace(scans=scans, ns=ns)
                    for entry in decode_entries([block], self.path, payloads, len(rows)):
                        if (
                            isinstance(entry, CallRecord)
                            and entry.call == STEP
                            and isinstance(entry.answer, int)
                        ):
                            scans, ns = scans + 1, entry.answer
                    rows.append(row)
        except UserError as wrong:
            self.stopped = str(wrong)
        return rows

    def list_keyframes(self) -> list[BlockPlace]:
        """Return the places of the keyframes, in order. `scans` counts the scans since the run began."""
        self.read_index()
        return self._keyframes

    def read_keyframe(self, place: BlockPlace) -> Keyframe:
        """Return a keyframe; raise UserError."""
        where = f"{self.path}: byte {place.packets_at}"
        found = next(self._blocks(place.packets_at, []), None)
        if found is not None and (frame := _parse_keyframe(found[0], where)).scan == place.scans:
            return frame
        raise mistake(where, "no keyframe", "one, as the index says")


def read_run_header(path: FileName) -> RunHeader | None:
    """Return the first entry of a recording, None if the file is no recording."""
    try:
        first = next(iter(Recording(path).read_entries()), None)
    except UserError:
        return None
    return first if isinstance(first, RunHeader) else None


def _add_checksum(magic: bytes, content: bytes) -> bytes:
    return magic + _LENGTH.pack(zlib.crc32(content)) + content


def _verify_content(magic: bytes, block: bytes, where: str) -> bytes:
    """Return the content of a keyframe or an index; raise UserError if the content was changed."""
    content = block[len(magic) + _LENGTH.size :]
    if _add_checksum(magic, content) != block:
        raise mistake(where, "another checksum", "that of the content")
    return content


def _parse_keyframe(block: bytes, path: str) -> Keyframe:
    where = f"{path}: keyframe"
    content = _verify_content(KEYFRAME_MAGIC, block, where)
    if len(content) < _KEYFRAME_HEAD.size:
        raise mistake(where, f"{len(content)} bytes", "a keyframe")
    scan, ns, steps, beyond, size, length = _KEYFRAME_HEAD.unpack_from(content)
    at = _KEYFRAME_HEAD.size + length
    program = content[_KEYFRAME_HEAD.size : at].decode(errors="replace")
    return Keyframe(program, scan, ns, steps, beyond, size, content[at:])


def _get_payload(interface: int, data: bytes) -> bytes:
    if interface == WIRE_ID:
        return data[_HEADER_BYTES[data[9:10] == bytes([TCP])] :]
    return data[SERIAL_HEADER_BYTES:]


def _read_written_index(file: IO[bytes]) -> list[BlockPlace]:
    """Return the rows of the index at the end of a file; [] if it has no valid index."""
    pieces: list[bytes] = []
    end = file.seek(0, os.SEEK_END)
    while not (pieces and pieces[0].startswith(INDEX_MAGIC)):  # backwards: a block ends with its length
        file.seek(max(0, end - _LENGTH.size))
        (size,) = _LENGTH.unpack(file.read(_LENGTH.size).ljust(_LENGTH.size, b"\0"))
        if not AT_DATA < size <= min(end, 2 * MOST_PIECE_BYTES):
            return []
        end -= size
        file.seek(end)
        block = file.read(size)
        kind, _, interface, _, _, kept = struct.unpack_from("<IIIIII", block)
        if kind != pcap.ENHANCED_PACKET or interface != JOURNAL or kept > size - AT_DATA - _LENGTH.size:
            return []
        if block[AT_DATA : AT_DATA + 1] != (MORE if pieces else LAST):
            return []
        pieces.insert(0, block[AT_DATA + 1 : AT_DATA + kept])
    with suppress(UserError):
        return _parse_index(b"".join(pieces), end, "")[:-1]
    return []


def _parse_index(block: bytes, at: int, where: str) -> list[BlockPlace]:
    """Return the rows of an index; [] if it is for another place. Raise UserError if it is damaged."""
    content = _verify_content(INDEX_MAGIC, block, f"{where}: index")
    if len(content) % _ROW.size:
        raise mistake(f"{where}: index", f"{len(content)} bytes", f"rows of {_ROW.size} bytes")
    rows = [BlockPlace(*row) for row in _ROW.iter_unpack(content)]
    places = [place for row in rows for place in row[:2] if place != IS_KEYFRAME]
    return rows if places == sorted(places) and places[-1:] == [at] else []
