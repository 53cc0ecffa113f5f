"""Members put at given offsets of a STRUCT, with padding members between them where a layout leaves no gap.

Rule: the arithmetic is that of placing.py, asked for a place in place of giving one.
"""

from __future__ import annotations

from trcvtui.udt.layout.layout_tree import PlacedLeaf
from trcvtui.udt.layout.placing import Placing
from trcvtui.udt.types import ELEMENTARY, Array, Member, Type, type_text

BYTE = ELEMENTARY["BYTE"]


class Unreachable(Exception):
    """A place where a layout puts no such member."""

    def __init__(self, path: str, why: str) -> None:
        self.path, self.why = path, why
        super().__init__(f"{path}: {why}")


class Filling:
    """A STRUCT that grows member by member; `cap` is its largest alignment, `taken` the names in it.

    `limit` is the alignment with which it can still have the size that it shall have.
    """

    def __init__(self, placing: Placing, cap: int, taken: set[str], limit: int | None = None) -> None:
        self.placing, self.cap, self.taken, self.limit = placing, cap, taken, limit
        self.rules = placing.rules
        self.members: list[Member] = []
        self.end = 0
        self.align = self.rules.struct_floor
        self.bits = 0  # of the byte in front of `end`
        self._pads = 0

    def put(self, name: str, type_: Type, offset: int, bit: int | None, path: str) -> None:
        """Put a member at an offset; raise Unreachable, with nothing changed."""
        node = self.placing.place(type_, path)
        step = max(min(node.align, self.cap), self.rules.member_floor)
        if isinstance(node, PlacedLeaf) and node.is_bit and bit:
            if (self.bits, self.end) != (bit, offset + 1):
                raise Unreachable(path, f"bit {bit} of byte {offset} does not follow a bit")
            self._add(name, type_, offset, self.end)
            self.bits += 1
            return
        if offset % step:
            layout, what = self.rules.name, type_text(type_)
            raise Unreachable(path, f"{what} at byte {offset}: under {layout} only at a multiple of {step}")
        if self.limit is not None and step > self.limit:
            why = f"{type_text(type_)} makes the size of its STRUCT a multiple of {step}"
            raise Unreachable(path, f"{why} under {self.rules.name}")
        self._fill_to(offset, step, path)
        self.align = max(self.align, step)
        self._add(name, type_, offset, _up(offset + node.size, self.placing.end_floor(type_)))
        self.bits = int(isinstance(node, PlacedLeaf) and node.is_bit)

    def put_raw(self, name: str, offset: int, size: int, is_bit: bool, path: str) -> None:
        """Put bytes in place of a member; those of a bit stand for all bits of the byte."""
        if is_bit and self.end > offset:
            return
        if is_bit:
            self.put(self._free(f"{name}_bits"), BYTE, offset, None, path)
        elif size:
            self.put(name, Array(((0, size - 1),), BYTE), offset, None, path)

    def finish(self, size: int, path: str) -> None:
        """Pad to the size; raise Unreachable when the type cannot have it."""
        if size % self.align:
            layout = self.rules.name
            raise Unreachable(path, f"{size} bytes: under {layout} the size is a multiple of {self.align}")
        if _up(self.end, self.align) != size:
            self._fill_to(size, 1, path)
        if _up(self.end, self.align) != size:
            raise Unreachable(path, f"{size} bytes cannot be reached under {self.rules.name}")

    def overlay(self, name: str, type_: Type, bit: int | None, path: str) -> None:
        """Put a member of a UNION at its begin."""
        node = self.placing.place(type_, path)
        self.align = max(self.align, min(node.align, self.cap), self.rules.member_floor)
        self._add(name, type_, 0, max(self.end, _up(node.size, self.placing.end_floor(type_))))

    def cover(self, size: int, path: str) -> None:
        """Give a UNION its size by a member that is padding; raise Unreachable."""
        if self.end > size or size % self.align:
            why = f"a UNION of {size} bytes: under {self.rules.name} it is a multiple of {self.align}"
            raise Unreachable(path, why)
        if _up(self.end, self.align) != size:
            pad = Array(((0, size - 1),), BYTE)
            self.overlay(self._pad_name(), pad, None, path)
        if _up(self.end, self.align) != size:
            raise Unreachable(path, f"a UNION of {size} bytes cannot be reached under {self.rules.name}")

    def _fill_to(self, offset: int, step: int, path: str) -> None:
        """Add padding until a member with that step comes to lie at the offset."""
        kept = len(self.members), self.end, self.bits, self._pads, self.align
        while self.end <= offset and _up(self.end, step) < offset:
            if not self._pad_once(offset):
                break
        if _up(self.end, step) != offset:
            end = kept[1]
            del self.members[kept[0] :]
            _, self.end, self.bits, self._pads, self.align = kept
            why = f"it shall lie at byte {offset}, under {self.rules.name} what is before it ends at {end}"
            raise Unreachable(path, why)

    def _pad_once(self, offset: int) -> bool:
        """Add one padding member before the offset: an ARRAY where one can lie, else a BYTE."""
        floor, member_floor = self.rules.array_floor, self.rules.member_floor
        size = offset - self.end
        if _up(self.end + size, floor) > offset:
            size -= 1
        array_step = max(min(floor, self.cap), member_floor)
        if size > 1 and self.end % array_step == 0:
            self.align = max(self.align, array_step)
            self._add(
                self._pad_name(),
                Array(((0, size - 1),), BYTE),
                self.end,
                _up(self.end + size, floor),
            )
        else:
            start = _up(self.end, member_floor)
            if start >= offset:
                return False
            self._add(self._pad_name(), BYTE, start, start + 1)
        self.bits = 0
        return True

    def _add(self, name: str, type_: Type, offset: int, end: int) -> None:
        self.members.append(Member(name, type_))
        self.end = end

    def _pad_name(self) -> str:
        self._pads += 1
        return self._free(f"_pad{self._pads}")

    def _free(self, name: str) -> str:
        while name.casefold() in self.taken:
            name += "_"
        self.taken.add(name.casefold())
        return name


def _up(offset: int, align: int) -> int:
    return -(-offset // align) * align
