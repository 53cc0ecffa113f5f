"""Pane 6: the members of the UDT with offset, type and value. Only the rows in view are decoded.

Padding is shown on the row of the member before the padding, so each row has the number of its leaf. A
table of any size takes no more time than one page.
"""

from __future__ import annotations

from typing import ClassVar, Final

from textual import events
from textual.binding import Binding

from trcvtui.project.project import DataDecl
from trcvtui.tui.formatting import clip, measure, pad
from trcvtui.tui.messages import CurveWanted, FieldSelected, KeyClicked
from trcvtui.tui.view_model.member_numbers import MemberNumbers, is_number
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.curves import sparkline
from trcvtui.tui.widgets.hex_view import HOLE, NOT_CAPTURED
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.rules import NO_CHOICE
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode_leaves
from trcvtui.udt.types import type_text

OFFSET_WIDTH: Final = 6
TYPE_WIDTH: Final = 11
VALUE_WIDTH: Final = 13  # columns kept for a value before its sparkline grows
LEAST_SPARKS, MOST_SPARKS = 8, 60  # messages of a sparkline
SPARK_STYLE: Final = "busy"
MOST_KEPT_MEMBERS: Final = 1024  # members whose numbers are kept


class UdtTable(LineView):
    """DATA of the selected instance, decoded. If `shows_job`, the bytes of the running job are decoded."""

    KEYS: ClassVar = (("↑↓", "member"), ("enter", "curve"), ("D", "messages"), ("v", "DATA | job"))
    BINDINGS: ClassVar = [
        Binding("enter", "curve", "curve: values of the member over time, its trend as a graph", show=False)
    ]

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="udt")
        self._view_model = view_model
        self.shows_job = False
        self.cursor: int | None = None
        # A job of the past: its number and its bytes; number 0: they were thrown away.
        self.past: tuple[int, bytes] | None = None
        self._page: tuple[int, int] = (0, 0)
        self._declared: DataDecl | None = None  # DATA of the leaves: before `show` another may be selected
        self._leaves: tuple[Leaf, ...] = ()
        self._values: tuple[Value | None, ...] = ()
        self._holes: tuple[range, ...] = ()
        self._sparks: dict[int, tuple[MemberNumbers, int, str]] = {}  # by leaf; up to which message
        self._sparks_of: tuple[object, ...] = ()  # the messages, instance and DATA that they show
        self._sparks_stop = 0  # the message that follows the last one of each sparkline

    # -- what is shown ------------------------------------------------------------------------------

    def show(self) -> None:
        declared = self._view_model.declaration
        self._show_title(declared)
        self._decode(declared)
        super().show()

    def _show_title(self, declared: DataDecl | None) -> None:
        if declared is None:
            self.set_title(6, "Members", "no DATA" if self._view_model.instance else "")
            return
        name = clip(declared.type_name, 32)
        room = self.outer_size.width - measure(name) - 9  # the corners, the digit, the dot
        self.set_title(6, name, self._source_text(declared, room))

    def _source_text(self, declared: DataDecl, room: int) -> str:
        """Return which bytes are decoded, and which bytes the key `v` would decode instead."""
        rules, job = declared.layout.rules, self._job_text()
        if self.was_thrown_away:
            return f"{len(self.past[1]) if self.past else 0} B thrown away, never in {declared.name}"
        if self.past is not None:
            return f"job {self.past[0]} of the past, {len(self.past[1])} B"
        if self.shows_job:
            return f"{job or 'no job running'} · v: DATA"
        other = f" · v: {job}" if job and self._view_model.job_bytes else ""
        full = f"{declared.name}, {rules.name}, {rules.byte_order}-endian{other}"
        if measure(full) > room and declared.choice != NO_CHOICE:
            return f"{rules.name}, {rules.byte_order}-endian"
        return full if measure(full) <= room else f"{clip(declared.name, 24)}{other}"

    def _job_text(self) -> str:
        instance = self._view_model.instance
        return f"job, {instance.have} of {instance.need} B" if instance and instance.need else ""

    def _decode(self, declared: DataDecl | None) -> None:
        top = self.scroll_offset.y
        self._page = (top, min(top + max(1, self.size.height), self.row_count()))
        self._declared = declared
        if declared is None:
            self._leaves, self._values = (), ()
            return
        # One leaf more than is shown: padding is the distance to the next one.
        stop = min(self._page[1] + 1, declared.layout.leaf_count)
        self._leaves = declared.layout.leaves(top, stop)
        self._values = decode_leaves(declared.layout, self._bytes(), top, stop)
        self._choose_spark_messages(declared)
        index, selected = self._view_model.stream_index, self._view_model.selected
        self._holes = index.list_missing(selected, self.shows_job) if self.past is None else ()

    @property
    def was_thrown_away(self) -> bool:
        """Return whether the bytes of the past are noise, or part of a frame that was never completed."""
        return self.past is not None and not self.past[0]

    def _bytes(self) -> bytes:
        if self.was_thrown_away:
            return b""
        if self.past is not None:
            return self.past[1]
        return self._view_model.job_bytes if self.shows_job else self._view_model.data

    def row_count(self) -> int:
        declared = self._view_model.declaration
        return declared.layout.leaf_count if declared else 0

    def row_at(self, y: int) -> Row:
        if not self._page[0] <= y < self._page[1] or self._view_model.declaration is not self._declared:
            # Scrolled, or another instance is selected, since `show`.
            self._decode(self._view_model.declaration)
        index = y - self._page[0]
        if not 0 <= index < len(self._leaves):
            return EMPTY
        return row(*self._member(index, y == self.cursor), style=self.cursor_style(y == self.cursor))

    def _member(self, index: int, chosen: bool) -> list[Part]:
        leaf = self._leaves[index]
        name_width = max(8, (self.line_width - OFFSET_WIDTH - TYPE_WIDTH) * 2 // 5)
        shared, own = _split_shared(leaf.path, self._leaves[index - 1].path if index else "")
        if measure(shared) + measure(own) > name_width - 1:
            shared, own = "", clip(leaf.path, name_width - 1)
        parts: list[Part] = [
            ("▸" if chosen else " ", "key"),
            (f"{leaf.offset:>{OFFSET_WIDTH - 2}} ", "dim"),
            (shared, "faint"),
            (pad(own, name_width - measure(shared)), "strong" if chosen else ""),
            (pad(clip(type_text(leaf.type), TYPE_WIDTH - 1), TYPE_WIDTH), "dim"),
            *self._value(index, leaf),
            (self._describe_padding(index), "faint"),
        ]
        used = sum(measure(text) for text, _ in parts)
        most = max(LEAST_SPARKS, self.line_width - OFFSET_WIDTH - name_width - TYPE_WIDTH - VALUE_WIDTH)
        room = min(most, self.line_width - used - 1)
        sparks = self._sparkline(self._page[0] + index, leaf)[-room:] if room >= LEAST_SPARKS else ""
        gap = self.line_width - used - len(sparks)
        return [*parts, (" " * gap, ""), (sparks, SPARK_STYLE)] if sparks else parts

    def _value(self, index: int, leaf: Leaf) -> list[Part]:
        value, content = self._values[index], self._bytes()
        if any(hole.start < leaf.offset + leaf.size and leaf.offset < hole.stop for hole in self._holes):
            return [(f"? {NOT_CAPTURED}", HOLE)]
        if value is not None:
            return [(value_text(leaf, value, content[leaf.offset : leaf.offset + leaf.size]), "printable")]
        present = max(0, min(leaf.size, len(content) - leaf.offset))
        return [(f"{present} of {leaf.size} B" if present else "-", "ghost")]

    # -- over time ----------------------------------------------------------------------------------

    def _choose_spark_messages(self, declared: DataDecl) -> None:
        """Find the messages for the sparklines; the last one is the message that the table shows."""
        view, known = self._view_model, self._view_model.known_messages
        about = known, known.instance, declared
        if about != self._sparks_of or len(self._sparks) > MOST_KEPT_MEMBERS:
            self._sparks_of = about
            self._sparks.clear()
        stop = known.next_number if view.position is None else known.number_after(view.position.scan)
        if self.past is not None:
            number, content = self.past  # an instance that was added again counts from 1: compare bytes, too
            rows = zip(range(known.next_number, known.first, -1), reversed(known.rows), strict=True)
            of_job = (
                at for at, row in rows if row.number == number and content.startswith(row.content or b"")
            )
            stop = next(of_job, 0)
        has_none = self.shows_job or known.instance != view.selected or view.message_type is None
        self._sparks_stop = 0 if has_none else stop

    def _sparkline(self, number: int, leaf: Leaf) -> str:
        """Return a member's sparkline over the newest messages; make it again if the last one changes."""
        known, stop, declared = self._view_model.known_messages, self._sparks_stop, self._declared
        if declared is None or not stop or not is_number(declared.layout, leaf):
            return ""
        kept = self._sparks.get(number) or (MemberNumbers(declared.layout, leaf, MOST_SPARKS), 0, "")
        if kept[1] != stop:
            some = kept[0].update_numbers(known, stop)
            self._sparks[number] = kept = kept[0], stop, sparkline(some) if len(some) > 1 else ""
        return kept[2]

    def action_curve(self) -> None:
        declared, number = self._view_model.declaration, self.cursor or 0
        is_there = declared is not None and number < declared.layout.leaf_count
        self.post_message(CurveWanted(declared.layout.leaf(number).path if declared and is_there else ""))

    def _describe_padding(self, index: int) -> str:
        """Return how many bytes of padding follow the leaf at `index` of the page."""
        declared, leaf = self._view_model.declaration, self._leaves[index]
        if declared is None:
            return ""
        last = self._page[0] + index + 1 >= declared.layout.leaf_count
        after = declared.layout.size if last else self._leaves[index + 1].offset
        gap = after - leaf.offset - leaf.size
        return f"  + {gap} B padding" if gap > 0 else ""

    # -- both ways ----------------------------------------------------------------------------------

    def select_member_at(self, offset: int) -> range:
        """Select the member at a byte, else the one before. Return its range, or range(0) for padding."""
        declared = self._view_model.declaration
        if declared is None or offset < 0:
            return range(0)
        place = offset
        while (number := declared.layout.leaf_number_at(place)) is None and place > 0:
            place -= 1
        self.cursor = number
        if number is None:
            return range(0)
        self.keep_in_view(number)
        self.show()
        leaf = declared.layout.leaf(number)
        inside = offset < leaf.offset + leaf.size
        return range(leaf.offset, leaf.offset + leaf.size) if inside else range(0)

    def action_move(self, rows: int) -> None:
        last = self.row_count() - 1
        if last >= 0:
            self._choose(0 if self.cursor is None else max(0, min(last, self.cursor + rows)))

    def on_click(self, event: events.Click) -> None:
        """Choose the member under the mouse; a click on the title switches between DATA and the job."""
        place = self.place_of(event)
        if event.y == 0:
            self.post_message(KeyClicked("members"))
        elif place is not None and place[1] < self.row_count():
            self._choose(place[1])
            sparks, style = self.row_at(place[1]).parts[-1]
            if style == SPARK_STYLE and place[0] >= self.line_width - len(sparks):
                self.action_curve()

    def _choose(self, number: int) -> None:
        if self._view_model.declaration is None:
            return
        self.cursor = number
        self.keep_in_view(number)
        self.show()
        self.post_message(FieldSelected(self.chosen_field()))

    def chosen_field(self) -> range:
        declared = self._view_model.declaration
        if declared is None or self.cursor is None:
            return range(0)
        leaf = declared.layout.leaf(self.cursor)
        return range(leaf.offset, leaf.offset + leaf.size)


def _split_shared(path: str, before: str) -> tuple[str, str]:
    dot = path.rfind(".") + 1
    return (path[:dot], path[dot:]) if dot and before.startswith(path[:dot]) else ("", path)
