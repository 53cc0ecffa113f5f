"""Keyframes of a run: its whole state at some scans, in the memory of this process, and the run from there.

Rule 1: a keyframe never leaves the process that made it, and none is read from a file.
Rule 2: what belongs to the program, to the project or to nobody stays one object, before and after.
"""

from __future__ import annotations

import gc
import io
import pickle
import sys
import zlib
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from enum import Enum
from inspect import CO_NESTED
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any, Final, Protocol

from trcvtui.capture.journal import STEP, Answered, Entry
from trcvtui.capture.recording import BlockPlace
from trcvtui.rig.replay.run_again import RunAgain

SPACING: Final = 2_000  # scans from one to the next, at first
MOST_BYTES: Final = 96 << 20  # of all keyframes; beyond them every second one is forgotten
PACKAGE: Final = __name__.partition(".")[0]
_ATOMS: Final = (str, bytes, int, float, type(None), type, FunctionType, ModuleType)
_CONTAINERS: Final = (tuple, list, dict, set, frozenset)


class Journal(Protocol):
    """What a run is made of: its entries from a block on, and where its blocks stand."""

    def entries(self, first: int = 0) -> Iterator[Entry]:
        """Yield the entries from this block on."""
        ...

    def index(self) -> Sequence[BlockPlace]:
        """Return where the blocks stand."""
        ...


class EntriesFrom:
    """The entries of a journal; it knows its place, and begins again there after so many."""

    def __init__(self, journal: Journal, steps: int = 0, beyond: int = 0) -> None:
        self._journal = journal
        self.steps = self.beyond = 0  # scans that have begun, entries since then
        first = 0
        if steps:  # the last block before that scan begins
            before = bisect_right(journal.index(), steps - 1, key=lambda row: row.scans)
            first = max(0, before - 1)
            self.steps = journal.index()[first].scans if first else 0
        self._entries = journal.entries(first)
        while self.steps < steps or self.beyond < beyond:
            next(self)

    def __iter__(self) -> EntriesFrom:
        return self

    def __next__(self) -> Entry:
        entry = next(self._entries)
        if type(entry) is Answered and entry.call == STEP:
            self.steps, self.beyond = self.steps + 1, 0
        else:
            self.beyond += 1
        return entry


def _made(place: int, defaults: Any, closure: tuple[CellType, ...] | None) -> FunctionType:
    """Return a function that was defined in another one, with what it has from there."""
    code, names = _CODES[place]
    return FunctionType(code, names, None, defaults, closure)


def _cell() -> CellType:
    return CellType()


def _fill(cell: CellType, content: tuple[object]) -> None:
    cell.cell_contents = content[0]


_CODES: Final[list[tuple[CodeType, dict[str, Any]]]] = []  # of functions that have no name of their own
_PLACES: Final[dict[CodeType, int]] = {}


class _RunWriter(pickle.Pickler):
    """Writes a run; `shared` are objects that stay who they are, by id."""

    def __init__(self, file: io.BytesIO, shared: dict[int, int]) -> None:
        super().__init__(file, 5)
        self._shared = shared

    def persistent_id(self, one: object) -> int | None:
        return self._shared.get(id(one))

    def reducer_override(self, one: Any) -> Any:
        kind = type(one)
        if kind is FunctionType:
            code = one.__code__
            if not (code.co_flags & CO_NESTED or code.co_name == "<lambda>"):
                return NotImplemented
            if code not in _PLACES:
                _PLACES[code] = len(_CODES)
                _CODES.append((code, one.__globals__))
            return _made, (_PLACES[code], one.__defaults__, one.__closure__)
        if kind is CellType:
            return _cell, (), (one.cell_contents,), None, None, _fill
        if kind is memoryview:
            return _view_of(one)
        if kind is EntriesFrom:
            return EntriesFrom, (one._journal, one.steps, one.beyond)
        return NotImplemented


def _view_of(view: memoryview) -> tuple[Any, ...]:
    try:
        whole = view.nbytes == memoryview(view.obj).nbytes
    except ValueError:  # released: nobody reads it any more
        return memoryview, (b"",)
    if whole:
        return memoryview, (view.obj,)
    if isinstance(view.obj, bytes):
        return memoryview, (bytes(view),)
    raise pickle.PicklingError("a part of a buffer")


class _RunReader(pickle.Unpickler):
    def __init__(self, content: bytes, shared: list[object]) -> None:
        super().__init__(io.BytesIO(content))
        self._shared = shared

    def persistent_load(self, place: int) -> object:
        return self._shared[place]


class Keyframes:
    """Keyframes of one run, as far as it was seen."""

    def __init__(self, journal: Journal) -> None:
        self._scans: list[int] = []
        self._kept: list[bytes] = []
        self._size = 0
        self._spacing = SPACING
        self._shared: list[object] = []
        self._places: dict[int, int] = {}
        self._journal = journal

    def seen(self, run: RunAgain) -> None:
        """Keep the state of a run after a scan, where one is due."""
        scan = run.bench.runtime.scans
        if scan % self._spacing == 0:
            self._keep(scan, run)

    def _keep(self, scan: int, run: RunAgain) -> None:
        if not self._shared:
            self._share(run)
        file = io.BytesIO()
        try:
            _RunWriter(file, self._places).dump(run)
        except (pickle.PicklingError, TypeError):  # a state that cannot be kept: the scans before it can
            return
        content = zlib.compress(file.getbuffer(), 1)
        self._scans.append(scan)
        self._kept.append(content)
        self._size += len(content)
        while self._size > MOST_BYTES and len(self._kept) > 1:
            self._spacing *= 2
            del self._scans[::2], self._kept[::2]
            self._size = sum(map(len, self._kept))

    def _share(self, run: RunAgain) -> None:
        """Note what is one object for the whole program."""
        waiting = [self._journal, run.bench.project, run.begins]
        for name, module in [*sys.modules.items()]:
            if name.partition(".")[0] == PACKAGE:
                waiting += vars(module).values()
        while waiting:
            one = waiting.pop()
            if isinstance(one, (*_ATOMS, Enum)) or id(one) in self._places:
                continue
            self._places[id(one)] = len(self._shared)
            self._shared.append(one)
            if isinstance(one, _CONTAINERS) or hasattr(one, "__record_fields__"):
                waiting += gc.get_referents(one)

    def before(self, scan: int) -> int:
        """Return the last scan up to this one that has a keyframe, 0: none."""
        found = bisect_right(self._scans, scan)
        return self._scans[found - 1] if found else 0

    def run_at(self, scan: int) -> RunAgain:
        """Return the run as it stood at a scan that has a keyframe."""
        content = zlib.decompress(self._kept[self._scans.index(scan)])
        run: RunAgain = _RunReader(content, self._shared).load()
        return run
