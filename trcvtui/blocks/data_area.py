"""DATA: the bytes of one global variable, as receive jobs and commands write them."""

from __future__ import annotations

from enum import Enum, auto
from typing import Final, NamedTuple


class ElementKind(Enum):
    BITS = auto()  # BOOL, ARRAY OF BOOL
    BYTES = auto()  # elements of 8 bits
    OTHER = auto()


class LeastTextLens(NamedTuple):
    """The smallest LEN apart from 0 for a variable that is a single STRING or WSTRING."""

    sent: int = 0
    received: int = 0


NO_TEXT_LENS: Final = LeastTextLens()


class DataArea:
    """One global variable: its IEC type as text, its size and its bytes. `generation` counts the writes.

    `newest` is the byte offset at which the newest write ended, `longest` the largest end of all writes.
    If `symbolic`, the variable is in an optimized block, where its bytes have no defined order.
    """

    def __init__(
        self,
        name: str,
        type_name: str,
        size: int,
        elements: ElementKind = ElementKind.OTHER,
        symbolic: bool = False,
        text_lens: LeastTextLens = NO_TEXT_LENS,
    ) -> None:
        self.name = name
        self.type_name = type_name
        self.size = size
        self.elements = elements
        self.symbolic = symbolic
        self.text_lens = text_lens
        self.content = bytearray(size)
        self.generation = self.newest = self.longest = 0

    def write(self, offset: int, payload: bytes | memoryview) -> None:
        """Overwrite bytes from `offset` on. Bytes beyond the end of the variable are left out."""
        room = max(0, self.size - offset)
        self.content[offset : offset + min(room, len(payload))] = payload[:room]
        self._note_write(min(self.size, offset + len(payload)))

    def swap(self, content: bytearray) -> bytearray:
        """Take `content`, of the same size, as the new bytes and return the old bytes, without a copy."""
        old, self.content = self.content, content
        self._note_write(self.size)
        return old

    def _note_write(self, newest: int) -> None:
        self.generation += 1
        self.newest, self.longest = newest, max(newest, self.longest)

    @property
    def shape(self) -> tuple[str, int]:
        """Return type and size; jobs compare them to notice that the DATA has changed."""
        return self.type_name, self.size

    def resize(
        self,
        type_name: str,
        size: int,
        elements: ElementKind = ElementKind.OTHER,
        text_lens: LeastTextLens = NO_TEXT_LENS,
    ) -> None:
        """Change the type; bytes up to the smaller size stay, added bytes are 0."""
        self.type_name, self.size, self.elements, self.text_lens = type_name, size, elements, text_lens
        self.content = self.content[:size] + bytes(max(0, size - len(self.content)))
        self.newest = self.longest = 0
        self.generation += 1
