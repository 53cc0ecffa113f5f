"""The journal of a run: its entries (calls at the seam with their answers), and their bytes.

Rule 1: a run repeats its calls, in the same order, as long as it gets the same answers (replay.py).
Rule 2: the name of a call for a screen (between scans) begins with IN_GAP. A replay may make or skip the
call.
Rule 3: bytes become values by fixed layouts alone (docs/recording-format.md); no length is trusted.
"""

from __future__ import annotations

import struct
import sys
import zlib
from array import array
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import chain
from types import UnionType
from typing import Any, Final, NamedTuple, cast, get_args, get_origin, get_type_hints

from trcvtui import __version__
from trcvtui.errors import UserError, mistake
from trcvtui.net.events import EventKind
from trcvtui.net.kernel import KernelLoss, LocalAddress, NewClient, PathInfo
from trcvtui.net.results import HELD_BACK, WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock
from trcvtui.net.serial_line import OPENING, PortOpening
from trcvtui.plc.containment import EXCEPTION
from trcvtui.plc.ledger import BenchNote, PeerSent

VERSION: Final = 2
MOST_STATE_BYTES: Final = 64 << 20  # bytes of a state; a reader refuses more
MAGIC: Final = b"trcvtui journal\n"
_HEAD: Final = struct.Struct("<16sHI")  # magic, version, CRC-32 of the packets before and of what follows
_COUNTS: Final = struct.Struct("<II")  # number of the block, of different entries
MOST_BLOCK_BYTES: Final = 1 << 20  # bytes of entries that fill a block
MOST_BLOCK_ENTRIES: Final = 1 << 20  # as many entries fill it, too
MOST_NESTING: Final = 8  # values inside values
STEP: Final = "step"  # the call that begins a scan; its answer is the time in ns
SHOWS: Final = "shows"  # the outputs of an instance, after a scan that changed one
MOST_SKIPPED: Final = 1 << 40  # scans in one entry
SKIP: Final = "skip"  # so many idle scans, which are counted and not run
DO, REST, CLOSE = "do", "rest", "close"  # a command in words; peers act beside a scan; the end of the run
IN_GAP: Final = "gap "
RECV: Final = "recv"  # its arguments: a handle, and how many bytes there is room for
FILE_READ: Final = IN_GAP + "read"  # a file read during the run; its bytes, or their SHA-256 as text
SIM_WALL_NS: Final = 946_684_800_000_000_000  # when a simulated run begins: 2000-01-01T00:00:00Z


class CallRecord(NamedTuple):
    """One call and its answer; a replay must repeat the call with these `args`."""

    owner: str
    call: str
    args: tuple[object, ...]
    answer: object


class DeferredWork(NamedTuple):
    """A partner asked for more work than one scan does; `what` is an EventKind."""

    connect: str
    what: str
    partner: str
    why: str


class RunHeader(NamedTuple):
    """The first entry of a journal: what a replay needs to begin the run again without a disk.

    `path` and `options` come from the command line; an option is `PATH=VALUE` of `--set`. `wall_ns` is the
    UTC at time 0 of the run, in ns since 1970. `files` has the requested names and the contents; relative
    names start at `folder`. `digests` has the SHA-256 of certificates and keys.
    """

    program: str
    kernel: str
    seed: int
    wall_ns: int
    is_scenario: bool
    path: str
    options: tuple[str, ...]
    folder: str
    files: tuple[tuple[str, bytes], ...]
    digests: tuple[tuple[str, str], ...]


ENDED_HERE: Final = "the recording was ended here"


class LostEntries(NamedTuple):
    """A gap in the journal: `number` entries were not written, for the reason `why`."""

    number: int
    why: str

    def __str__(self) -> str:
        return f"a gap of {self.number} entries ({self.why})"


class WireCall(NamedTuple):
    """A call of the PLC at the wire; packets are made from it. A wire call is no part of the journal.

    `at` is the run's time in ns. `args` follow the handle. `data` has the bytes that came, or were taken.
    """

    at: int
    owner: str
    call: str
    handle: int
    args: tuple[object, ...]
    answer: object
    data: bytes


SECRETS_WARNING: Final = "holds TLS secrets: with this file anybody can read what was sent"


class Secrets(NamedTuple):
    """Lines of a TLS key log, for the packets after these lines; no part of the journal."""

    key_log: bytes


class Keyframe(NamedTuple):
    """The compressed state of a run after a scan, in the form of the program that made it (state.py).

    `steps` counts the file's scans up to this state. `beyond` counts the entries since the newest scan.
    """

    program: str
    scan: int
    ns: int
    steps: int
    beyond: int
    size: int
    content: bytes

    @staticmethod
    def make(scan: int, ns: int, steps: int, beyond: int, state: bytes) -> Keyframe:
        return Keyframe(__version__, scan, ns, steps, beyond, len(state), zlib.compress(state, 1))

    def decompress_state(self, where: str) -> bytes:
        """Return the state; raise UserError for a state of another version, or damaged content."""
        where = f"{where}: keyframe of scan {self.scan}"
        if self.program != __version__:
            raise mistake(where, f"a state of trcvtui {self.program}", f"one of {__version__}")
        try:
            state = zlib.decompressobj().decompress(self.content, min(self.size, MOST_STATE_BYTES) + 1)
        except zlib.error as failed:
            raise mistake(where, str(failed), "what was compressed") from None
        if len(state) != self.size:  # of a zip bomb just one byte too many is unpacked
            raise mistake(where, f"{len(state)} bytes or more", f"{self.size}, at most {MOST_STATE_BYTES}")
        return state


# Calls at the wire whose first argument after the handle is a view of bytes.
BUFFER_CALLS: Final = frozenset({"recv", "recv_from", "send", "send_to"})
LedgerNote = BenchNote | DeferredWork | PeerSent
NonJournalEntry = WireCall | Secrets | Keyframe
Entry = CallRecord | LedgerNote | RunHeader | LostEntries | NonJournalEntry


# -- what may be answered ----------------------------------------------------------------------------------

NONE_TYPE: Final = type(None)
# The types that may answer each call; `tuple` includes pairs of an answer and its bytes.
ANSWER_TYPES: Final[dict[str, tuple[type, ...]]] = {
    **dict.fromkeys((STEP, "grant", "discard", "unread", "waiting", "dropped"), (int,)),
    **dict.fromkeys((SHOWS, SKIP, DO, REST, CLOSE), (NONE_TYPE,)),
    **dict.fromkeys(("wait", "poll", "set_user_timeout", "port close"), (NONE_TYPE,)),
    **dict.fromkeys((EXCEPTION, "link", "local_addresses", "set_options", "recv", "recv_from"), (tuple,)),
    **dict.fromkeys(("is_free", "readable", "renew", "port arrive"), (bool,)),
    **dict.fromkeys(("set_link", "ended"), (str,)),
    **dict.fromkeys(("arrived", "message"), (bytes,)),
    **dict.fromkeys(("socket", "datagram_socket", "port write"), (int, Fault)),
    **dict.fromkeys(("send", "send_to"), (int, WouldBlock, Fault)),
    "ready_handles": (NONE_TYPE, dict),
    "local_end": (NONE_TYPE, Endpoint),
    "accept": (NewClient, WouldBlock, Fault),
    "resolve": (str, WouldBlock, Fault),
    "connect_result": (NONE_TYPE, WouldBlock, Fault),
    "loss": (NONE_TYPE, KernelLoss),
    "path": (NONE_TYPE, PathInfo),
    **dict.fromkeys(
        ("set_reuse", "bind", "listen", "poll_add", "poll_del", "connect", "shutdown", "probe"),
        (NONE_TYPE, Fault),
    ),
    **dict.fromkeys(("abort", "close", "set_broadcast"), (NONE_TYPE, Fault)),
    "port open": (NONE_TYPE, Fault, PortOpening),
    "port read": (bytes, Fault),
    "port errors": (NONE_TYPE, tuple),
}
# The types inside these pairs.
PAIR_TYPES: Final[dict[str, tuple[tuple[type, ...], ...]]] = {
    "recv": ((int, WouldBlock, Fault), (bytes,)),
    "recv_from": ((Datagram, WouldBlock, Fault), (bytes,)),
    "link": ((str,), (str,)),
    EXCEPTION: ((str,), (bool,)),
}
LIST_TYPES: Final[dict[str, type]] = {"local_addresses": LocalAddress, "set_options": str, "port errors": int}


def is_valid_answer(entry: CallRecord) -> bool:
    _, call, args, answer = entry
    if call == FILE_READ:
        return len(args) == 1 and type(args[0]) is str and type(answer) in (bytes, str)
    if call == SKIP:
        return len(args) == 1 and type(args[0]) is int and 0 < args[0] <= MOST_SKIPPED and answer is None
    if call == DO:
        return len(args) == 1 and type(args[0]) is str and answer is None
    call = call.removeprefix(IN_GAP)
    if type(answer) not in ANSWER_TYPES.get(call, ()):
        return False
    if not isinstance(answer, tuple):
        return True
    if call in LIST_TYPES:
        return all(type(each) is LIST_TYPES[call] for each in answer)
    inside = PAIR_TYPES[call]
    if len(answer) != len(inside) or any(type(a) not in k for a, k in zip(answer, inside, strict=True)):
        return False
    if call in ("link", EXCEPTION):
        return True
    got, data = cast(tuple[object, bytes], answer)
    size = got if isinstance(got, int) else got.size if isinstance(got, Datagram) else 0
    most = args[1] if len(args) > 1 else None
    return size == len(data) and isinstance(most, int) and size <= most  # it goes into a buffer of `most`


# -- bytes -----------------------------------------------------------------------------------------------

_NONE, _FALSE, _TRUE, _INT, _TEXT, _BYTES, _TUPLE, _MAPPING, _SINGLE, _PLACED = range(10)
_SINGLETONS: Final = (WOULD_BLOCK, HELD_BACK, OPENING)
_WIRE_ANSWER_TYPES: Final = (NONE_TYPE, int, Fault, NewClient, Endpoint, Datagram, KernelLoss, tuple)
# No new record or field without a new version.
_RECORD_TYPES: Final[tuple[type, ...]] = (
    *(Endpoint, Fault, NewClient, KernelLoss, PathInfo, Datagram, LocalAddress, BenchNote, DeferredWork),
    *(RunHeader, LostEntries, WireCall, Secrets, Keyframe, PeerSent),
)
_EVENT_KINDS: Final = frozenset(map(str, EventKind))
_FIRST_RECORD_TAG: Final = 16  # the tag of the first of them
_PACK_RUN: Final = struct.Struct("<III").pack
_RECORD_TAGS: Final = {kind: _FIRST_RECORD_TAG + at for at, kind in enumerate(_RECORD_TYPES)}


@cache
def _fields_of(record: type) -> tuple[tuple[str, tuple[type, ...]], ...]:
    """Return the name of each field and the types that its value may have."""
    return tuple([(name, _list_hint_types(hint)) for name, hint in get_type_hints(record).items()])


def _list_hint_types(hint: Any) -> tuple[type, ...]:
    if hint is object:  # of a call at the wire
        return _WIRE_ANSWER_TYPES
    some = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    return tuple([get_origin(each) or getattr(each, "__supertype__", each) for each in some])


def encode_value(value: object) -> bytes:
    """Return the bytes of a value: a tag of one byte, then the content in the form of this tag."""
    match value:
        case None:
            return bytes([_NONE])
        case bool():
            return bytes([_TRUE if value else _FALSE])
        case int():
            return struct.pack("<Bq", _INT, value)
        case str():
            text = value.encode("utf-8", "surrogatepass")
            return struct.pack("<BI", _TEXT, len(text)) + text
        case bytes():
            return struct.pack("<BI", _BYTES, len(value)) + value
        case dict():
            parts = [encode_value(each) for pair in value.items() for each in pair]
            return struct.pack("<BH", _MAPPING, len(value)) + b"".join(parts)
        case PacketRuns(runs):
            return struct.pack("<BH", _PLACED, len(runs)) + b"".join([_PACK_RUN(*run) for run in runs])
    if value in _SINGLETONS:
        return bytes([_SINGLE, _SINGLETONS.index(value)])
    kind: type = type(value)
    if kind in _RECORD_TAGS:
        return bytes([_RECORD_TAGS[kind]]) + b"".join(
            [encode_value(getattr(value, name)) for name, _ in _fields_of(kind)]
        )
    assert isinstance(value, tuple), value
    return struct.pack("<BH", _TUPLE, len(value)) + b"".join(map(encode_value, value))


class PacketRuns(NamedTuple):
    """Byte sequences in the packets before a block. Each: first packet, bytes to skip there, and size."""

    runs: tuple[tuple[int, int, int], ...]


class _BlockReader:
    """Reads values from the bytes of one block. Raises UserError if the bytes are no values.

    `payloads` has what the packets before the block carry.
    """

    def __init__(self, where: str, block: bytes, payloads: Sequence[bytes]) -> None:
        self._where, self._block, self._payloads, self.at = where, block, payloads, 0

    def error(self, found: object, expected: str) -> UserError:
        return mistake(f"{self._where}: journal, byte {self.at}", found, expected)

    def read_head(self, expected: int) -> tuple[int, int]:
        """Return the CRC-32 in a block's head, and how many different entries the block has."""
        where = f"{self._where}: journal"
        magic, version, check = _HEAD.unpack(self.read_bytes(_HEAD.size))
        if magic != MAGIC:
            raise mistake(where, "another interface's packet", "a block of our journal")
        if version != VERSION:
            raise mistake(where, f"version {version}", f"version {VERSION}, the only one that is known")
        number, unlike = _COUNTS.unpack(self.read_bytes(_COUNTS.size))
        if number != expected:
            raise mistake(where, f"block {number}", f"block {expected}")
        return check, unlike

    def read_bytes(self, size: int) -> bytes:
        left = len(self._block) - self.at
        if size > left:
            raise self.error(f"a length of {size}", f"at most the {left} bytes that are left")
        self.at += size
        return self._block[self.at - size : self.at]

    def _read_number(self, size: int) -> int:
        return int.from_bytes(self.read_bytes(size), "little")

    def read_order(self, most: int) -> array[int]:
        """Return the order of the entries, the rest of the block: numbers below `most`."""
        order = array("I")
        rest = self.read_bytes(len(self._block) - self.at)
        if len(rest) % order.itemsize:
            raise self.error(f"{len(rest)} bytes", f"numbers of {order.itemsize} bytes")
        order.frombytes(rest)
        if sys.byteorder == "big":
            order.byteswap()
        if order and max(order) >= most:
            raise self.error(f"entry {max(order)}", f"one of the {most} of this block")
        return order

    def read_value(self, depth: int = 0) -> object:
        tag = self._read_number(1)
        if depth > MOST_NESTING:  # a file could nest until the stack is full
            raise self.error("values inside values", f"at most {MOST_NESTING} deep")
        match tag:
            case 0:
                return None
            case 1 | 2:
                return tag == _TRUE
            case 3:
                return int.from_bytes(self.read_bytes(8), "little", signed=True)
            case 4:
                return self._decode_text(self.read_bytes(self._read_number(4)))
            case 5:
                return self.read_bytes(self._read_number(4))
            case 6:
                return tuple([self.read_value(depth + 1) for _ in range(self._read_number(2))])
            case 7:
                return dict([self._read_pair(depth) for _ in range(self._read_number(2))])
            case 8 if (at := self._read_number(1)) < len(_SINGLETONS):
                return _SINGLETONS[at]
            case 9:
                return self._read_packet_bytes()
        if not 0 <= tag - _FIRST_RECORD_TAG < len(_RECORD_TYPES):
            raise self.error(f"tag {tag}", "a tag that this version knows")
        kind = _RECORD_TYPES[tag - _FIRST_RECORD_TAG]
        made: object = kind(*[self._read_field(name, kinds, depth) for name, kinds in _fields_of(kind)])
        return made

    def _read_packet_bytes(self) -> bytes:
        found: list[bytes] = []
        for _ in range(self._read_number(2)):
            number, skip, left = self._read_number(4), self._read_number(4), self._read_number(4)
            while left and number < len(self._payloads):
                found.append(self._payloads[number][skip : skip + left])
                left, number, skip = left - len(found[-1]), number + 1, 0
            if left:
                raise self.error(f"{left} bytes less in packets", "those of the journal")
        return b"".join(found)

    def _decode_text(self, raw: bytes) -> str:
        try:
            return raw.decode("utf-8", "surrogatepass")
        except UnicodeDecodeError:
            raise self.error("bytes that are no UTF-8", "text") from None

    def _read_pair(self, depth: int) -> tuple[int, str]:
        handle, owner = self.read_value(depth + 1), self.read_value(depth + 1)
        if type(handle) is not int or type(owner) is not str:
            raise self.error("another value", "a handle and its owner")
        return handle, owner

    def _read_field(self, name: str, kinds: tuple[type, ...], depth: int) -> object:
        value = self.read_value(depth + 1)
        if type(value) not in kinds:
            raise self.error("a value of another type", f"what field {name} is")
        return value

    def read_entry(self, known: list[Entry]) -> Entry:
        """Return the next entry. `known` has the earlier entries of the block."""
        if self._block[self.at : self.at + 1] == _REPEATED_CALL_TAG:
            return self._read_repeated_call(known)
        value = self.read_value()
        match value:
            case BenchNote() | PeerSent():
                return value
            case DeferredWork(_, what) if what in _EVENT_KINDS:
                return value
            case LostEntries() | WireCall() | Secrets() | Keyframe():
                return value
            case RunHeader() if _is_valid_header(value):
                return value
            case (str(owner), str(call), tuple(args), answer):
                return self._require_valid_call(CallRecord(owner, call, args, answer))
        raise self.error("another value", "a call or a note")

    def _require_valid_call(self, made: CallRecord) -> CallRecord:
        if not is_valid_answer(made):
            raise self.error(f"{made.call} of {made.owner}", "an answer that this call can give")
        return made

    def _read_repeated_call(self, known: list[Entry]) -> CallRecord:
        self.at += 1
        first = self._read_number(4)
        before = known[first] if first < len(known) else None
        if not isinstance(before, CallRecord):
            raise self.error(f"the question of entry {first}", "a question before it")
        owner, call, args, _ = before
        return self._require_valid_call(CallRecord(owner, call, args, self.read_value()))


def decode_value(content: bytes, where: str) -> object:
    """Return the value that encode_value wrote; raise UserError that begins with `where`."""
    return _BlockReader(where, content, ()).read_value()


def _is_valid_header(begins: RunHeader) -> bool:
    pairs = (*((each, bytes) for each in begins.files), *((each, str) for each in begins.digests))
    return all(type(option) is str for option in begins.options) and all(
        type(pair) is tuple and [*map(type, pair)] == [str, kind] for pair, kind in pairs
    )


_NEVER_SHARED: Final = (Fault, KernelLoss, dict)  # equal faults may have different peers
_REPEATED_CALL: Final = 10  # a tag: the call of an earlier entry with another answer
_REPEATED_CALL_TAG: Final = bytes([_REPEATED_CALL])
_REPEATED_HEAD: Final = struct.Struct("<BI")


class BlockWriter:
    """The entries of one block: first each different entry once, then the order of all entries."""

    def __init__(self, number: int) -> None:
        self.number = number
        self._known: dict[Entry, int] = {}
        self._parts: list[bytes] = []
        self._questions: dict[tuple[object, ...], int] = {}  # the first entry of each call
        self._order = array("I")
        self.size = 0

    @property
    def is_full(self) -> bool:
        return self.size >= MOST_BLOCK_BYTES or len(self._order) >= MOST_BLOCK_ENTRIES

    def __len__(self) -> int:
        return len(self._order)

    def add_entry(self, entry: Entry) -> None:
        try:
            at = self._known.get(entry)
        except TypeError:  # a mapping in it has no hash
            at = None
        if at is None:
            at = len(self._parts)
            if not isinstance(entry, CallRecord) or type(entry.answer) not in _NEVER_SHARED:
                self._known[entry] = at
            self._parts.append(self._encode_entry(entry, at))
            self.size += len(self._parts[-1])
        self._order.append(at)

    def _encode_entry(self, entry: Entry, place: int) -> bytes:
        if not isinstance(entry, CallRecord):
            return encode_value(entry)
        first = self._questions.setdefault(entry[:3], place)
        if first == place:
            return encode_value(entry)
        return _REPEATED_HEAD.pack(_REPEATED_CALL, first) + encode_value(entry.answer)

    def encode(self, packets: int | None = None) -> bytes:
        """Return the block's bytes. `packets` is the CRC-32 of its packets in the file (None: no check)."""
        order = self._order[:]
        if sys.byteorder == "big":
            order.byteswap()
        counts = _COUNTS.pack(self.number, len(self._parts))
        parts = counts, *self._parts, order.tobytes()
        check = 0 if packets is None else zlib.crc32(b"".join(parts), packets)
        return b"".join((_HEAD.pack(MAGIC, VERSION, check), *parts))


def encode_blocks(entries: Iterable[Entry]) -> Iterator[bytes]:
    """Yield the entries as blocks; each has its number and can be read alone."""
    number, block = 0, BlockWriter(0)
    for entry in entries:
        if isinstance(entry, NonJournalEntry):  # the file has them beside the journal
            continue
        block.add_entry(entry)
        if block.is_full:
            yield block.encode()
            number += 1
            block = BlockWriter(number)
    yield block.encode()


def decode_entries(
    found: Iterable[bytes], where: str, payloads: Sequence[bytes] = (), first: int = 0
) -> Iterator[Entry]:
    """Return the entries of blocks from number `first` on; raise UserError that begins with `where`.

    Before each block, `found` puts the payloads of its packets into `payloads`.
    """
    return chain.from_iterable(decode_by_block(found, where, payloads, first))


def check_block(block: bytes, number: int, packets: int, where: str) -> None:
    """Raise UserError for a changed block or a wrong number. `packets` is as in BlockWriter.encode."""
    check, _ = _BlockReader(where, block, ()).read_head(number)
    if zlib.crc32(block[_HEAD.size :], packets) != check:
        found, expected = f"block {number} with another checksum", "that of its packets and entries"
        raise mistake(f"{where}: journal", found, expected)


def decode_by_block(
    found: Iterable[bytes], where: str, payloads: Sequence[bytes] = (), first: int = 0
) -> Iterator[Iterator[Entry]]:
    for expected, block in enumerate(found, first):
        cursor = _BlockReader(where, block, payloads)
        _, unlike = cursor.read_head(expected)
        if unlike > len(block):  # each takes a byte at least
            raise cursor.error(f"{unlike} entries", f"at most the {len(block)} bytes of a block")
        known: list[Entry] = []
        for _ in range(unlike):
            known.append(cursor.read_entry(known))
        yield map(known.__getitem__, cursor.read_order(unlike))
