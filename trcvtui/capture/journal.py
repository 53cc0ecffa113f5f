"""The journal of a run: what was asked at the seam and what it answered, kept by `SeamRecorder`; its bytes.

Rule 1: a run asks the same again, in the same order, as long as it gets the same answers (replay.py).
Rule 2: calls inside a call (of a layer to the network) are not kept; what they told the ledger is.
Rule 3: what is asked in a gap between two scans (a screen wants to know it) has a call that begins with
GAP. A replay that asks it gets the answer; one that does not goes on.
Rule 4: bytes become values by fixed layouts alone (docs/recording.md); no length is trusted.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from typing import Final, Protocol, TypeVar

from trcvtui.errors import UserError, mistake
from trcvtui.net.events import What
from trcvtui.net.kernel import Accepted, KernelLoss, LocalAddress, PathInfo
from trcvtui.net.results import HELD_BACK, WOULD_BLOCK, Datagram, Endpoint, Fault
from trcvtui.net.serial_line import OPENING
from trcvtui.plc.ledger import BenchNote
from trcvtui.records import NamedTuple

T = TypeVar("T")
VERSION: Final = 1
MAGIC: Final = b"trcvtui journal\n"
_HEAD: Final = struct.Struct("<16sHI")  # magic, version, number of the block
MOST_BLOCK: Final = 1 << 20  # bytes of a block that is begun; one entry more may stand in it
MOST_ENTRIES: Final = 1 << 20  # of one block
DEEPEST: Final = 8  # tuples in tuples
BENCH: Final = "bench"  # who asks the calls of the bench itself
STEP: Final = "step"  # the call that begins a scan; its answer is the time in ns
DO, REST, CLOSE = "do", "rest", "close"  # a command in words; the peers go on in a hold; the end of the run
GAP: Final = "gap "
READ: Final = GAP + "read"  # a file that was read on the way: its name; its bytes, or a SHA-256 in words
SIM_WALL_NS: Final = 946_684_800_000_000_000  # when a simulated run begins: 2000-01-01T00:00:00Z


class Answered(NamedTuple):
    """One call and its answer; `args` are what a replay has to ask again."""

    owner: str
    call: str
    args: tuple[object, ...]
    answer: object


class WorkWaits(NamedTuple):
    """That a partner has asked for more work than one scan does; `what` is a word of `What`."""

    connect: str
    what: str
    partner: str
    why: str


class RunBegins(NamedTuple):
    """The first entry of a journal: what is needed to run again, without a disk.

    `path` and `options` (`PATH=VALUE` of `--set`) are those of the command line; `wall_ns` is UTC at time 0
    of the run, from 1970. `files` are contents by the names that were asked for, with relative names begun in
    `folder`; of certificates and keys `digests` has the SHA-256.
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


class EntriesLost(NamedTuple):
    """A gap in the journal: so many entries were not written, and why."""

    number: int
    why: str


Note = BenchNote | WorkWaits
Entry = Answered | Note | RunBegins | EntriesLost


class Seam(Protocol):
    """Where a bench asks what is not its own: a recorder does it and keeps the answer, a replay answers."""

    @property
    def answers(self) -> bool:
        """Return whether the answers come from a record, so that nothing is really asked."""
        ...

    tell: Callable[[Note], None]  # writes a note into the ledger
    is_busy: bool  # False in the gaps between what the bench is told to do

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        """Return the answer."""
        ...

    def told(self, note: Note) -> None:
        """Take what has just been written into the ledger."""
        ...


class SeamRecorder:
    """Does what is asked and hands each entry to `keep`."""

    answers = False
    is_busy = True

    def __init__(self, keep: Callable[[Entry], None]) -> None:
        self._keep = keep
        self.tell: Callable[[Note], None] = lambda note: None
        self._is_inside = False

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        """Do it and keep the answer."""
        if self._is_inside:
            return do()
        self._is_inside = True
        try:
            answer = do()
        finally:
            self._is_inside = False
        self._keep(Answered(owner, call if self.is_busy else GAP + call, args, answer))
        return answer

    def told(self, note: Note) -> None:
        """Keep what a call told before it answered; what the PLC or the bench tells, a replay tells again."""
        if self._is_inside:
            self._keep(note)


# -- bytes -----------------------------------------------------------------------------------------------

_NONE, _FALSE, _TRUE, _INT, _TEXT, _BYTES, _TUPLE, _MAPPING, _SINGLE = range(9)
_SINGLES: Final = (WOULD_BLOCK, HELD_BACK, OPENING)
# Each record with the types of its fields in their order. No new field without a new version.
_RECORDS: Final[tuple[tuple[type, tuple[tuple[type, ...], ...]], ...]] = (
    (Endpoint, ((str,), (int,))),
    (Fault, ((str,), (str,), (bool,), (str,), (str,))),
    (Accepted, ((int,), (Endpoint,))),
    (KernelLoss, ((Fault, type(None)), (int,))),
    (PathInfo, ((int,), (int,), (int,), (bool,))),
    (Datagram, ((int,), (Endpoint,), (int,))),
    (LocalAddress, ((str,), (str,), (bool,), (bool,), (str,))),
    (BenchNote, ((str,), (str,), (str,), (str,), (bool,))),
    (WorkWaits, ((str,), (str,), (str,), (str,))),
    (
        RunBegins,
        ((str,), (str,), (int,), (int,), (bool,), (str,), (tuple,), (str,), (tuple,), (tuple,)),
    ),
    (EntriesLost, ((int,), (str,))),
)
_WORDS: Final = frozenset(map(str, What))
_FIRST_RECORD: Final = 16  # the tag of the first of them
_TAGS: Final = {kind: _FIRST_RECORD + at for at, (kind, _) in enumerate(_RECORDS)}


def _names(kind: type) -> tuple[str, ...]:
    names: tuple[str, ...] = kind.__match_args__  # type: ignore[attr-defined]  # each record has them
    return names


def value_bytes(value: object) -> bytes:
    """Return a value as it stands in a journal: a tag of one byte, then what the tag says."""
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
            parts = [value_bytes(each) for pair in value.items() for each in pair]
            return struct.pack("<BH", _MAPPING, len(value)) + b"".join(parts)
    if value in _SINGLES:
        return bytes([_SINGLE, _SINGLES.index(value)])
    tag = _TAGS.get(type(value))
    if tag is not None:
        return bytes([tag]) + b"".join(value_bytes(getattr(value, name)) for name in _names(type(value)))
    assert isinstance(value, tuple), value
    return struct.pack("<BH", _TUPLE, len(value)) + b"".join(map(value_bytes, value))


class _Cursor:
    """Reads values out of the bytes of one block; raise UserError for what is none."""

    def __init__(self, where: str, block: bytes) -> None:
        self._where, self._block, self.at = where, block, 0

    @property
    def is_at_end(self) -> bool:
        return self.at >= len(self._block)

    def wrong(self, found: object, expected: str) -> UserError:
        return mistake(f"{self._where}: journal, byte {self.at}", found, expected)

    def take(self, size: int) -> bytes:
        left = len(self._block) - self.at
        if size > left:
            raise self.wrong(f"a length of {size}", f"at most the {left} bytes that are left")
        self.at += size
        return self._block[self.at - size : self.at]

    def _number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def value(self, depth: int = 0) -> object:
        """Return the next value."""
        tag = self._number(1)
        if depth > DEEPEST:
            raise self.wrong("values inside values", f"at most {DEEPEST} deep")
        match tag:
            case 0:
                return None
            case 1 | 2:
                return tag == _TRUE
            case 3:
                return int.from_bytes(self.take(8), "little", signed=True)
            case 4:
                return self._text(self.take(self._number(4)))
            case 5:
                return self.take(self._number(4))
            case 6:
                return tuple([self.value(depth + 1) for _ in range(self._number(2))])
            case 7:
                return dict([self._pair(depth) for _ in range(self._number(2))])
            case 8 if (at := self._number(1)) < len(_SINGLES):
                return _SINGLES[at]
        if not 0 <= tag - _FIRST_RECORD < len(_RECORDS):
            raise self.wrong(f"tag {tag}", "a tag that this version knows")
        kind, fields = _RECORDS[tag - _FIRST_RECORD]
        made: object = kind(*[self._field(*field, depth) for field in zip(_names(kind), fields, strict=True)])
        return made

    def _text(self, raw: bytes) -> str:
        try:
            return raw.decode("utf-8", "surrogatepass")
        except UnicodeDecodeError:
            raise self.wrong("bytes that are no UTF-8", "text") from None

    def _pair(self, depth: int) -> tuple[int, str]:
        handle, owner = self.value(depth + 1), self.value(depth + 1)
        if type(handle) is not int or type(owner) is not str:
            raise self.wrong("another value", "a handle and its owner")
        return handle, owner

    def _field(self, name: str, kinds: tuple[type, ...], depth: int) -> object:
        value = self.value(depth + 1)
        if type(value) not in kinds:
            raise self.wrong("a value of another type", f"what field {name} is")
        return value

    def entry(self) -> Entry:
        """Return the next entry."""
        value = self.value()
        match value:
            case BenchNote():
                return value
            case WorkWaits(_, what) if what in _WORDS:
                return value
            case EntriesLost():
                return value
            case RunBegins() if _is_whole(value):
                return value
            case (str(owner), str(call), tuple(args), answer):
                return Answered(owner, call, args, answer)
        raise self.wrong("another value", "a call or a note")


def _is_whole(begins: RunBegins) -> bool:
    pairs = (*((each, bytes) for each in begins.files), *((each, str) for each in begins.digests))
    return all(type(option) is str for option in begins.options) and all(
        type(pair) is tuple and [*map(type, pair)] == [str, kind] for pair, kind in pairs
    )


def blocks(entries: Iterable[Entry]) -> Iterator[bytes]:
    """Return the entries as blocks: each stands for itself and bears its number."""
    number, parts, size = 0, list[bytes](), 0
    for entry in entries:
        parts.append(value_bytes(entry))
        size += len(parts[-1])
        if size >= MOST_BLOCK or len(parts) >= MOST_ENTRIES:
            yield _HEAD.pack(MAGIC, VERSION, number) + b"".join(parts)
            number, parts, size = number + 1, [], 0
    yield _HEAD.pack(MAGIC, VERSION, number) + b"".join(parts)


def entries_of(found: Iterable[bytes], where: str) -> Iterator[Entry]:
    """Return the entries of blocks in their order; raise UserError that begins with `where`."""
    for expected, block in enumerate(found):
        cursor = _Cursor(where, block)
        magic, version, number = _HEAD.unpack(cursor.take(_HEAD.size))
        if magic != MAGIC:
            raise mistake(f"{where}: journal", "another interface's packet", "a block of our journal")
        if version != VERSION:
            raise mistake(
                f"{where}: journal", f"version {version}", f"version {VERSION}, all that is known here"
            )
        if number != expected:
            raise mistake(f"{where}: journal", f"block {number}", f"block {expected}")
        while not cursor.is_at_end:
            yield cursor.entry()
