"""The codec of capture files. It reads pcapng and pcap, and writes packets and other blocks as pcapng.

Rule 1: a file is read block by block. No length in a file is trusted. No block above `MOST_BLOCK` is kept.
Rule 2: time is integer nanoseconds since 1970, whatever the file counts in.
Rule 3: reading ends where a file cannot be read. `trouble` says where. All earlier packets are good.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Final, NamedTuple

from trcvtui.errors import Problem, UserError, mistake
from trcvtui.files import FileName, open_to_read, reason_of

# Link types, as tcpdump.org lists them.
NULL: Final = 0
ETHERNET: Final = 1
RAW_IP: Final = 101
LOOP: Final = 108
LINUX_SLL: Final = 113
USER0: Final = 147
IPV4: Final = 228
IPV6: Final = 229
RTAC_SERIAL: Final = 250
LINUX_SLL2: Final = 276

# Block types.
INTERFACE_BLOCK: Final = 1
OLD_PACKET: Final = 2
SIMPLE_PACKET: Final = 3
ENHANCED_PACKET: Final = 6
STATISTICS_BLOCK: Final = 5
SECRETS_BLOCK: Final = 10
SECTION: Final = 0x0A0D0D0A

TLS_KEY_LOG: Final = 0x544C534B
COMMENT: Final = 1  # option code
OWN_PREFIX: Final = "trcvtui: "  # begins the comment of a packet that a tap of ours has changed or made
NOTES: Final = "trcvtui tap"  # a tap's interface for events and notes that are no packets of the line
NAME_OPTION: Final = 2  # of an interface
FLAGS_OPTION: Final = 2  # of a packet
INBOUND, OUTBOUND = 1, 2  # the two lowest bits of its flags
TIME_RESOLUTION: Final = 9
TIME_OFFSET: Final = 14
DROPPED_OPTIONS: Final = (5, 7)  # of statistics: packets that interface and system did not pass on

MOST_BLOCK: Final = 16 << 20  # what Wireshark takes
MOST_INTERFACES: Final = 65_536
CHUNK_BYTES: Final = 256 << 10
GZIP_MAGIC: Final = b"\x1f\x8b"  # begins a .gz

_LITTLE_MAGIC: Final = b"\x4d\x3c\x2b\x1a"
_BIG_MAGIC: Final = b"\x1a\x2b\x3c\x4d"
_PCAP_MAGICS: Final = {  # magic -> byte order, nanoseconds a tick, bytes before the data of a record
    b"\xd4\xc3\xb2\xa1": ("<", 1000, 16),
    b"\xa1\xb2\xc3\xd4": (">", 1000, 16),
    b"\x4d\x3c\xb2\xa1": ("<", 1, 16),
    b"\xa1\xb2\x3c\x4d": (">", 1, 16),
    b"\x34\xcd\xb2\xa1": ("<", 1000, 24),  # Kuznetzov's: interface, protocol, kind after the usual head
    b"\xa1\xb2\xcd\x34": (">", 1000, 24),
}
_EXPECTED_TEXT: Final = "a capture: pcapng or pcap, also as .gz"


class Interface(NamedTuple):
    """An interface of a capture. ns = ticks * `numerator` // `denominator` + `offset_ns`."""

    link_type: int
    snaplen: int  # 0: no limit
    name: str = ""
    comments: tuple[str, ...] = ()
    numerator: int = 1000
    denominator: int = 1
    offset_ns: int = 0


class Packet(NamedTuple):
    """One packet of `length` bytes on the wire; `data` may have fewer. `at` is its offset in the file.

    `sent` is True for packets from the PLC, False for packets to the PLC, None if unknown. Only our own
    recordings (interface of USER0) set `sent`. Other direction flags are the capturing host's.
    """

    ns: int
    interface: int  # index of `CaptureReader.interfaces`
    data: bytes
    length: int
    comments: tuple[str, ...]
    at: int
    sent: bool | None = None


class CaptureReader:
    """The packets of one file in their order. Memory holds about two chunks of the file.

    `read(n)` returns at most n bytes, and b"" at the end. A pipe may return fewer than n bytes.
    Raise UserError if the file does not begin as a capture.
    """

    def __init__(self, read: Callable[[int], bytes], name: str) -> None:
        self.name = name
        self.interfaces: list[Interface] = []  # of all sections, one after the other
        self.link_types: list[int] = []  # of the interfaces
        self._dropped: dict[tuple[bytes, int], int] = {}  # by interface and counter
        self.trouble: Problem | None = None
        self.last_ns = 0  # of the newest packet that was taken, as of the last `read`
        self._read = read
        self._buffer = b""
        self._start = 0  # byte of the file at which the buffer begins
        self._bad_input: Problem | None = None  # of the file below: a broken .gz, a disk error
        magic = self._fill_buffer(0, 4)
        if magic[:2] == GZIP_MAGIC:
            self._read, self._buffer = gunzip(read, magic), b""
            magic = self._fill_buffer(0, 4)
        if magic[:4] in _PCAP_MAGICS:
            self._packets = self._read_pcap()
        elif magic[:4] == b"\x0a\x0d\x0d\x0a":
            self._packets = self._read_pcapng()
        else:
            from trcvtui.udt.other_files import refuse_other_file

            if magic and self._bad_input is None:
                refuse_other_file(name, magic, _EXPECTED_TEXT)
            found = "an empty file" if not magic else f"a file that begins with 16#{magic[:4].hex().upper()}"
            raise UserError(self._bad_input or Problem(name, found, _EXPECTED_TEXT))

    def interface_name(self, interface: int) -> str:
        """Return the name of an interface, or its number if it has no name."""
        return self.interfaces[interface].name or str(interface)

    def __iter__(self) -> Iterator[Packet]:
        return self._packets

    def _fill_buffer(self, at: int, wanted: int) -> bytes:
        """Drop the bytes before `at`. Return at least `wanted` bytes from `at` on, or fewer at the end."""
        self._start += at
        parts = [self._buffer[at:]]
        has = len(parts[0])
        while has < wanted:
            try:
                part = self._read(CHUNK_BYTES)
            except (OSError, EOFError, ValueError) as failed:
                self._bad_input = Problem(self.name, f"'{failed}'", "a file that can be read")
                break
            if not part:
                break
            parts.append(part)
            has += len(part)
        self._buffer = b"".join(parts)
        return self._buffer

    @property
    def drop_count(self) -> int:
        return sum(self._dropped.values())

    def _read_drops(self, body: bytes, order: str) -> None:
        for code, value in parse_options(body, 12, len(body), order):
            if code in DROPPED_OPTIONS and len(value) == 8:
                self._dropped[body[:4], code] = int.from_bytes(value, "little" if order == "<" else "big")

    def _fail(self, at: int, found: str, expected: str) -> None:
        self.trouble = self._bad_input or Problem(f"{self.name}: byte {self._start + at}", found, expected)

    def _note_cut(self, at: int) -> None:
        """If the file ends inside the packet or block at `at`, note this."""
        left = len(self._buffer) - at
        if left or self._bad_input:
            self._fail(at, f"the end of the file after {left} bytes of a packet or block", "the rest of it")

    def _read_pcap(self) -> Iterator[Packet]:
        order, scale, head = _PCAP_MAGICS[self._buffer[:4]]
        buffer = self._fill_buffer(0, 24)
        if len(buffer) < 24:
            return self._note_cut(0)
        snaplen, link = struct.unpack_from(order + "II", buffer, 16)
        self.interfaces.append(Interface(link & 0xFFFF, snaplen, numerator=scale))
        self.link_types.append(link & 0xFFFF)
        unpack = struct.Struct(order + "IIII").unpack_from
        at, end, make, start, ns = 24, len(buffer), tuple.__new__, 0, 0
        while True:
            data_at = at + head
            if data_at > end:
                self.last_ns = ns
                buffer = self._fill_buffer(at, head)
                at, end, start, data_at = 0, len(buffer), self._start, head
                if end < head:
                    return self._note_cut(0)
            seconds, parts, kept, length = unpack(buffer, at)
            if kept > MOST_BLOCK:
                return self._fail(at, f"a packet of {kept} bytes", f"at most {MOST_BLOCK}")
            after = data_at + kept
            if after > end:
                self.last_ns = ns
                buffer = self._fill_buffer(at, head + kept)
                at, end, start, data_at, after = 0, len(buffer), self._start, head, head + kept
                if after > end:
                    return self._note_cut(0)
            ns = seconds * 1_000_000_000 + parts * scale
            data = buffer[data_at:after]
            yield make(Packet, (ns, 0, data, length if length > kept else kept, (), start + at, None))
            at = after

    def _read_pcapng(self) -> Iterator[Packet]:
        buffer, at, end, start = self._buffer, 0, len(self._buffer), 0
        order, base, ns, make = "<", 0, 0, tuple.__new__
        unpack = struct.Struct("<IIIIIII").unpack_from  # type, length, then what a packet begins with
        unpack_one = struct.Struct("<I").unpack_from
        clocks: list[tuple[int, int, int]] = []
        while True:
            if at + 28 > end:
                self.last_ns = ns
                buffer = self._fill_buffer(at, 28)
                at, end, start = 0, len(buffer), self._start
                if end < 12:
                    return self._note_cut(0)
                if end < 28:  # the last block, shorter than a packet's head
                    buffer += bytes(28 - end)
            if buffer[at : at + 4] == b"\x0a\x0d\x0d\x0a":
                mark = buffer[at + 8 : at + 12]
                if mark not in (_LITTLE_MAGIC, _BIG_MAGIC):
                    return self._fail(at, "a section whose byte order is unknown", "1A2B3C4D")
                order = "<" if mark == _LITTLE_MAGIC else ">"
                unpack = struct.Struct(order + "IIIIIII").unpack_from
                unpack_one = struct.Struct(order + "I").unpack_from
                base, clocks = len(self.interfaces), []
            kind, size, interface, high, low, kept, length = unpack(buffer, at)
            if size < 12 or size & 3 or size > MOST_BLOCK:
                return self._fail(at, f"a block of {size} bytes", f"12 to {MOST_BLOCK}, in steps of 4")
            after = at + size
            if after > end:
                self.last_ns = ns
                buffer = self._fill_buffer(at, size)
                at, end, start, after = 0, len(buffer), self._start, size
                if after > end:
                    return self._note_cut(0)
            if unpack_one(buffer, after - 4)[0] != size:
                return self._fail(at, "a block with two different lengths", f"{size} at both ends")
            comments: tuple[str, ...] = ()
            sent = None
            if kind in (ENHANCED_PACKET, OLD_PACKET):
                if kind == OLD_PACKET:
                    interface = struct.unpack_from(order + "H", buffer, at + 8)[0]
                options = at + 28 + ((kept + 3) & ~3)
                if size < 32 or options > after - 4:
                    return self._fail(at, f"a packet of {kept} bytes in a block of {size}", "a larger block")
                if interface >= len(clocks):
                    return self._fail(at, f"interface {interface}", f"one of {len(clocks)}")
                numerator, denominator, offset = clocks[interface]
                ns = (high << 32 | low) * numerator // denominator + offset
                if options + 4 < after:
                    some = [*parse_options(buffer, options, after - 4, order)]
                    comments = tuple([_text(value) for code, value in some if code == COMMENT])
                    if USER0 in self.link_types:
                        sent = parse_sent_flag(dict(some).get(FLAGS_OPTION), order)
                data = buffer[at + 28 : at + 28 + kept]
            elif kind == SIMPLE_PACKET:
                if not clocks or size < 16:
                    return self._fail(at, "a packet without an interface", "an interface before it")
                length, interface, limit = interface, 0, self.interfaces[base].snaplen
                kept = min(length, size - 16, limit or length)
                data = buffer[at + 12 : at + 12 + kept]  # it has no time: that of the packet before it
            else:
                if kind == INTERFACE_BLOCK:
                    found = _parse_interface(buffer, at, after, order)
                    if found is None or len(self.interfaces) == MOST_INTERFACES:
                        return self._fail(at, "a broken interface", f"one of {MOST_INTERFACES} at most")
                    self.interfaces.append(found)
                    self.link_types.append(found.link_type)
                    clocks.append((found.numerator, found.denominator, found.offset_ns))
                elif kind == STATISTICS_BLOCK:
                    self._read_drops(buffer[at + 8 : after - 4], order)
                    if USER0 in self.link_types and interface < len(clocks):  # time of a tap of ours
                        numerator, denominator, offset = clocks[interface]
                        ns = max(ns, (high << 32 | low) * numerator // denominator + offset)
                at = after
                continue
            if length < kept:
                length = kept
            yield make(Packet, (ns, base + interface, data, length, comments, start + at, sent))
            at = after


def _parse_interface(buffer: bytes, at: int, after: int, order: str) -> Interface | None:
    """Return the interface of a block; None: the block is too short."""
    if after - at < 20:
        return None
    link, _reserved, snaplen = struct.unpack_from(order + "HHI", buffer, at + 8)
    name, comments, numerator, denominator, offset = "", [], 1000, 1, 0
    for code, value in parse_options(buffer, at + 16, after - 4, order):
        if code == NAME_OPTION:
            name = _text(value)
        elif code == COMMENT:
            comments.append(_text(value))
        elif code == TIME_RESOLUTION and value:
            power = value[0] & 0x7F
            ticks = 2**power if value[0] & 0x80 else 10**power
            numerator, denominator = 1_000_000_000, ticks
            if not numerator % ticks:
                numerator, denominator = numerator // ticks, 1
        elif code == TIME_OFFSET and len(value) == 8:
            offset = int(struct.unpack(order + "q", value)[0]) * 1_000_000_000
    return Interface(link, snaplen, name, tuple(comments), numerator, denominator, offset)


def parse_options(buffer: bytes, at: int, end: int, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield code and value of the options from `at` to `end`. Stop at an option that does not fit."""
    unpack = struct.Struct(order + "HH").unpack_from
    while at + 4 <= end:
        code, size = unpack(buffer, at)
        at += 4
        if not code or at + size > end:
            return
        yield code, buffer[at : at + size]
        at += (size + 3) & ~3


def parse_sent_flag(flags: bytes | None, order: str) -> bool | None:
    """Return True for an outbound packet, False for an inbound one, None if the flags do not say."""
    bits = int.from_bytes(flags or b"", "little" if order == "<" else "big") & (INBOUND | OUTBOUND)
    return {INBOUND: False, OUTBOUND: True}.get(bits)


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")


def gunzip(read: Callable[[int], bytes], first: bytes) -> Callable[[int], bytes]:
    """Return a function that reads all unpacked bytes of a .gz, with EOFError if a member is cut off."""
    import zlib

    unpacker = zlib.decompressobj(31)
    packed = first
    is_fresh = False  # no byte of the current member has come

    def unpacked(most: int) -> bytes:
        nonlocal unpacker, packed, is_fresh
        while True:
            if not packed:
                packed = read(CHUNK_BYTES)
                if not packed and not is_fresh:
                    raise EOFError("the .gz ends in the middle")
                if not packed:
                    return b""
            if is_fresh and not packed.startswith(b"\x1f"):
                if packed.strip(b"\0"):
                    raise EOFError("other bytes after the .gz")
                return b""  # padding after the last member
            is_fresh = False
            try:
                data = unpacker.decompress(packed, most)
            except zlib.error as failed:
                raise EOFError(f"the .gz is broken: {failed}") from None
            packed = unpacker.unconsumed_tail
            if unpacker.eof:
                packed, unpacker, is_fresh = unpacker.unused_data, zlib.decompressobj(31), True
            if data:
                return data

    return unpacked


# -- writing: each function returns one block -----------------------------------------------------------


def section_block(application: str, comments: tuple[str, ...] = ()) -> bytes:
    """Return the first block of a file: little-endian, length unknown (-1)."""
    options = [*_notes(comments), _option(4, application.encode())]
    return make_block(SECTION, _LITTLE_MAGIC + struct.pack("<HHq", 1, 0, -1), options)


def interface_block(link_type: int, name: str, comments: tuple[str, ...] = (), snaplen: int = 0) -> bytes:
    """Return the block of an interface that counts nanoseconds; the first one of a section has index 0."""
    options = [*_notes(comments), _option(NAME_OPTION, name.encode()), _option(TIME_RESOLUTION, b"\x09")]
    return make_block(INTERFACE_BLOCK, struct.pack("<HHI", link_type, 0, snaplen), options)


def packet_block(
    interface: int,
    ns: int,
    data: bytes,
    comments: tuple[str, ...] = (),
    length: int | None = None,
    sent: bool | None = None,
) -> bytes:
    """Return a packet block. `length` and `sent` are as in Packet."""
    size = len(data)
    if not comments:
        padding = -size & 3
        options = _SENT_OPTIONS[sent]
        total = 32 + size + padding + len(options)
        head = _HEAD(ENHANCED_PACKET, total, interface, ns >> 32, ns & 0xFFFFFFFF, size, length or size)
        return b"".join((head, data, _PADDINGS[padding], options, total.to_bytes(4, "little")))
    head = struct.pack("<IIIII", interface, ns >> 32, ns & 0xFFFFFFFF, size, length or size)
    options = b"".join(_notes(comments)) + (_SENT_OPTIONS[sent] or _END_OF_OPTIONS)
    return make_block(ENHANCED_PACKET, head + data + _PADDINGS[-size & 3] + options)


def secrets_block(key_log: bytes) -> bytes:
    """Return a block with lines of a TLS key log, for the packets after this block."""
    return make_block(SECRETS_BLOCK, struct.pack("<II", TLS_KEY_LOG, len(key_log)) + key_log)


def statistics_block(interface: int, ns: int, dropped: int) -> bytes:
    """Return a block that says how many packets of an interface the file lacks so far."""
    body = struct.pack("<III", interface, ns >> 32, ns & 0xFFFFFFFF)
    return make_block(STATISTICS_BLOCK, body, [_option(DROPPED_OPTIONS[0], struct.pack("<Q", dropped))])


_HEAD: Final = struct.Struct("<IIIIIII").pack
_PADDINGS: Final = (b"", b"\0", b"\0\0", b"\0\0\0")
_END_OF_OPTIONS: Final = b"\0\0\0\0"  # of options
_SENT_OPTIONS: Final = {
    None: b"",
    False: struct.pack("<HHI", FLAGS_OPTION, 4, INBOUND) + _END_OF_OPTIONS,
    True: struct.pack("<HHI", FLAGS_OPTION, 4, OUTBOUND) + _END_OF_OPTIONS,
}


def _notes(comments: tuple[str, ...]) -> list[bytes]:
    return [_option(COMMENT, text.encode()) for text in comments]


def _option(code: int, value: bytes) -> bytes:
    value = value[:65535]
    return struct.pack("<HH", code, len(value)) + value + _PADDINGS[-len(value) & 3]


def make_block(kind: int, body: bytes, options: list[bytes] | None = None) -> bytes:
    """Return a block of any type. `body` is its content before the options."""
    parts = [body, _PADDINGS[-len(body) & 3]]
    if options:
        parts += [*options, _END_OF_OPTIONS]
    content = b"".join(parts)
    size = struct.pack("<I", len(content) + 12)
    return b"".join((struct.pack("<I", kind), size, content, size))


@contextmanager
def open_capture(path: FileName) -> Iterator[CaptureReader]:
    """Open a file and yield its reader. Raise UserError if the file cannot be opened or is no capture."""
    with ExitStack() as opened:
        try:
            file = opened.enter_context(open_to_read(path))
        except (OSError, ValueError) as failed:
            raise mistake(str(path), reason_of(failed), "a capture that can be read") from None
        yield CaptureReader(file.read, str(path))
