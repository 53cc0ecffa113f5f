"""The curve: a member over the messages that are known, a second one on the same time axis, ERRORs below."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate, groupby
from typing import ClassVar, Final, NamedTuple

from textual.binding import Binding

from trcvtui.errors import UserError
from trcvtui.plc.ledger import StatusEdge
from trcvtui.tui.view_model.member_numbers import MemberNumbers, Number, is_number
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.curves import Curve, Spans, braille, curve
from trcvtui.tui.widgets.dialogs import ListDialog
from trcvtui.tui.widgets.line_view import LineView, Part, Row, row
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.value_text import value_text
from trcvtui.wording import count, stamp, utc_text

AXIS: Final = 11  # columns beside a curve
BELOW: Final = 3  # rows: time axis, marks, times; then one for each member
LEAST_WIDTH, LEAST_HEIGHT = 8, 2
SHORTEST_NS: Final = 1_000_000  # that a window may be
STEPS: Final = 8  # of a window: an arrow goes one
STYLES: Final = "busy", "warn"  # of the first member, of the second one
ERROR, CUT = "▲", "×"
FIRST_ERROR: Final = 0x8000  # STATUS


class TimeWindow:
    """The part of the time in view; without `span` all of it, without `end` what comes is followed."""

    def __init__(self) -> None:
        self.span: int | None = None
        self.end: int | None = None
        self._whole = 0, 1

    def within(self, first: int, last: int) -> tuple[int, int]:
        """Return from when to when, of all that is known."""
        first = min(first, last - SHORTEST_NS)
        self._whole = first, last
        span = min(self.span or last - first, last - first)
        end = last if self.end is None else max(first + span, min(self.end, last))
        return end - span, end

    def zoom(self, by: float) -> None:
        """Take so many times as much time into view; its middle stays, or its end where that is followed."""
        begin, end = self.within(*self._whole)
        span = max(SHORTEST_NS, int((end - begin) * by))
        self.span = span if span < self._whole[1] - self._whole[0] else None
        if self.end is not None:
            self.end = (begin + end + span) // 2

    def move(self, steps: int) -> None:
        begin, end = self.within(*self._whole)
        end += steps * max(1, (end - begin) // STEPS)
        self.end = end if end < self._whole[1] else None


class Trace(NamedTuple):
    """A member of the picture: its number after the newest message, and its curve, None: none in view."""

    leaf: Leaf
    now: Number | None
    curve: Curve | None
    style: str


class CurveView(LineView, inherit_bindings=False):
    """`path` is the member, `other` the second one; they are looked up anew when the type has changed."""

    BINDINGS: ClassVar = [
        Binding("plus", "zoom(0.5)", show=False),
        Binding("minus", "zoom(2)", show=False),
        Binding("left", "step(-1)", show=False),
        Binding("right", "step(1)", show=False),
        Binding("home,g", "step(-1000000)", show=False),
        Binding("end,G", "follow", show=False),
        Binding("p", "other", show=False),
    ]

    def __init__(self, view_model: ViewModel, path: str) -> None:
        super().__init__(id="curve")
        self._view_model = view_model
        self.instance, self.path = view_model.selected, path
        self.other: str | None = None
        self.window = TimeWindow()
        self._numbers: dict[str, MemberNumbers] = {}
        self._numbers_of: tuple[object, ...] = ()
        self._gaps: Spans = ()
        self._rows: list[Row] = []
        self._drawn: tuple[object, ...] = ()  # what the rows were made from

    def row_count(self) -> int:
        return len(self._rows)

    def row_at(self, y: int) -> Row:
        return self._rows[y]

    def show(self) -> None:
        view, known = self._view_model, self._view_model.known_messages
        instance, edges = view.instance, view.history.of(self.instance)
        self._gaps = view.stream_index.down_times(instance.connect) if instance is not None else ()
        state = known, known.stop, known.oldest, view.selected, instance is None, view.declaration
        look = self.line_width, self.container_size.height, self.window.span, self.window.end, self.other
        drawn = *state, *look, view.frozen_at, self._gaps, edges[-1].seq if edges else 0
        if drawn != self._drawn and self.container_size.height:
            self._rows = self._make_rows()
            self._drawn = drawn
        super().show()

    # -- words ------------------------------------------------------------------------------------------

    def _make_rows(self) -> list[Row]:
        about = (self.instance, self._messages(), self._stands())
        self.set_title(None, self.path or "curve", " · ".join(filter(None, about)))
        declared, known = self._view_model.declaration, self._view_model.known_messages
        if self.instance != self._view_model.selected or self._view_model.instance is None:
            return _said(f"{self.instance or 'the instance'} is not there any more")
        if declared is None:
            return _said(f"{self.instance} has no DATA: no message has values")
        if self._numbers_of != (known, declared):
            self._numbers_of, self._numbers = (known, declared), {}
        layout = declared.layout
        leaf = _leaf_at(layout, self.path)
        if leaf is None:
            return _said(f"{declared.type_name} has no member {self.path} any more")
        if not is_number(layout, leaf):
            return _said(f"{self.path or declared.type_name} is no number: it has no curve")
        if known.instance != self.instance or not known.rows:
            return _said("no message has ended yet")
        other = _leaf_at(layout, self.other) if self.other is not None else None
        width = self.line_width - AXIS * (1 if other is None else 2)
        height = self.container_size.height - BELOW - (1 if other is None else 2)
        if width < LEAST_WIDTH or height < LEAST_HEIGHT:
            return _said("too small for a curve")
        return self._picture([leaf] if other is None else [leaf, other], layout, width, height)

    def _messages(self) -> str:
        known = self._view_model.known_messages
        place, left_out = (
            known.oldest - known.first,
            f" ({known.left_out} left out)" if known.left_out else "",
        )
        told = f"{count(known.count, 'message')}{left_out}"
        if not known.rows or not known.oldest:
            return told
        if place >= len(known.rows):
            return f"{told}, their bytes are gone"
        return f"{told}, values from {known.rows[place].number} on"

    def _stands(self) -> str:
        frozen = self._view_model.frozen_at
        if frozen is not None:
            return f"frozen in scan {frozen}"
        return "" if self.window.end is None else "stands: end follows again"

    # -- the picture --------------------------------------------------------------------------------------

    def _picture(self, leaves: Sequence[Leaf], layout: Layout, width: int, height: int) -> list[Row]:
        known = self._view_model.known_messages
        times = list(accumulate((each.t_ns for each in known.rows), max))  # a capture may go back in time
        window = self.window.within(times[min(known.oldest - known.first, len(times) - 1)], times[-1])
        traces = [
            self._trace(leaf, style, layout, times, window, (width, height))
            for leaf, style in zip(leaves, STYLES, strict=False)
        ]
        if all(trace.curve is None for trace in traces):
            return _said(f"no message {'in view ' if self.window.span else ''}has a number in {self.path}")
        errors, cut = self._marks(window)
        in_view = bisect_right(times, window[1]) - bisect_left(times, window[0])
        rows = list(_curves(traces, width, height))
        rows.append(row((" " * (AXIS - 1) + "└", "faint"), (self._axis(window, width), "faint")))
        rows.append(row((" " * AXIS, ""), *_marked(errors, cut, window, width)))
        begin, end = (self._clock(t_ns) for t_ns in window)
        rows.append(row((" " * AXIS + begin + end.rjust(max(1, width - len(begin))), "dim")))
        rows += [_numbers(trace) for trace in traces]
        marks = f"{count(len(errors), 'ERROR')} {ERROR}, {len(cut)} cut {CUT}"
        told = f" · {count(in_view, 'message')} in view, {marks}"
        return [*rows[:-1], Row((*rows[-1].parts, (told, "dim")))]

    def _trace(
        self, leaf: Leaf, style: str, layout: Layout, times: Sequence[int], window: tuple[int, int],
        size: tuple[int, int],
    ) -> Trace:  # fmt: skip
        known = self._view_model.known_messages
        numbers = self._numbers.setdefault(leaf.path, MemberNumbers(layout, leaf)).follow(known, known.stop)
        now = next((number for number in reversed(numbers) if number is not None), None)
        return Trace(leaf, now, curve(times, numbers, window, *size, self._gaps), style)

    def _axis(self, window: tuple[int, int], width: int) -> str:
        """Return the time axis, broken where the connection was down."""
        down = [(_column(begin, window, width), _column(end, window, width)) for begin, end in self._gaps]
        return "".join("╌" if any(a <= x <= b for a, b in down if b >= 0) else "─" for x in range(width))

    def _marks(self, window: tuple[int, int]) -> tuple[list[int], list[int]]:
        """Return when ERRORs came, and when messages were cut."""
        edges = [
            (line.scan, line.t_ns)
            for line in self._view_model.history.of(self.instance)
            if isinstance(line.event, StatusEdge)
            and line.event.outputs.error
            and not line.event.cause.is_expected
        ]
        known = self._view_model.known_messages.rows
        rows = [(each.scan, each.t_ns) for each in known if each.status >= FIRST_ERROR]
        errors = dict((*rows, *edges)).values()
        cut = [each.t_ns for each in known if each.reason]
        begin, end = window
        return [t for t in errors if begin <= t <= end], [t for t in cut if begin <= t <= end]

    def _clock(self, t_ns: int) -> str:
        position = self._view_model.position
        if position is None or position.first_ns is None:
            return f"{stamp(t_ns)} s"
        return utc_text(position.first_ns + t_ns)[:-4]

    # -- keys -----------------------------------------------------------------------------------------------

    def action_zoom(self, by: float) -> None:
        self.window.zoom(by)
        self.show()

    def action_step(self, steps: int) -> None:
        self.window.move(steps)
        self.show()

    def action_follow(self) -> None:
        self.window.end = None
        self.show()

    def action_other(self) -> None:
        """Draw the next number of the type beside the member; after the last one none."""
        declared = self._view_model.declaration
        if declared is None:
            return
        layout = declared.layout
        own = _leaf_at(layout, self.path)
        shown = _leaf_at(layout, self.other) if self.other is not None else None
        first = layout.number_of(shown.path) + 1 if shown is not None else 0
        leaves = (layout.leaf(number) for number in range(first, layout.leaf_count))
        self.other = next((leaf.path for leaf in leaves if leaf != own and is_number(layout, leaf)), None)
        self.show()


def _said(text: str) -> list[Row]:
    return [row((text, "warn"))]


def _leaf_at(layout: Layout, path: str) -> Leaf | None:
    try:
        return layout.leaf(layout.number_of(path))
    except UserError:
        return None


def _curves(traces: Sequence[Trace], width: int, height: int) -> Iterator[Row]:
    """Yield the rows of the curves: where they meet, the colour is that of the first one."""
    drawn = [trace.curve.cells if trace.curve is not None else [[0] * width] * height for trace in traces]
    for y in range(height):
        cells: list[Part] = []
        for own, others in zip(drawn[0][y], drawn[-1][y], strict=True):
            cells.append((braille(own | others), traces[0 if own else -1].style))
        parts = [("".join(text for text, _ in some), style) for style, some in groupby(cells, lambda p: p[1])]
        left, right = (_label(trace, y, height) for trace in (traces[0], traces[-1]))
        ends = [(f" {right}", traces[-1].style)] if len(traces) > 1 else []
        yield row(
            (left.rjust(AXIS - 2) + " ", traces[0].style), ("┤" if left else "│", "faint"), *parts, *ends
        )


def _label(trace: Trace, y: int, height: int) -> str:
    """Return what stands beside row `y`: the ends of the axis, of one number the number in the middle."""
    if trace.curve is None:
        return ""
    low, high = trace.curve.axis
    return _short({0: high, height - 1: low}.get(y) if low != high else {height // 2: low}.get(y))


def _short(number: Number | None) -> str:
    if number is None:
        return ""
    text = str(number) if isinstance(number, int) else f"{number:.6g}"
    return text if len(text) <= AXIS - 2 else f"{number:.2e}"


def _column(t_ns: int, window: tuple[int, int], width: int) -> int:
    return min(width - 1, (t_ns - window[0]) * width // (window[1] - window[0]))


def _marked(errors: Sequence[int], cut: Sequence[int], window: tuple[int, int], width: int) -> Iterator[Part]:
    signs = dict.fromkeys((_column(t_ns, window, width) for t_ns in cut), CUT)
    signs |= dict.fromkeys((_column(t_ns, window, width) for t_ns in errors), ERROR)
    for sign, some in groupby(signs.get(column, " ") for column in range(width)):
        yield "".join(some), "error" if sign == ERROR else "warn"


def _numbers(trace: Trace) -> Row:
    """Return the row with the figures of a member."""
    now = value_text(trace.leaf, trace.now) if trace.now is not None else "-"
    parts: list[Part] = [(f"{trace.leaf.path or 'value'} ", trace.style), (f"now {now}", "strong")]
    if trace.curve is not None:
        least, most = (value_text(trace.leaf, number) for number in (trace.curve.least, trace.curve.most))
        parts.append((f" · min {least} · max {most}", ""))
    return row(*parts)


class CurveScreen(ListDialog[None]):
    """Escape closes it; its keys are its own, whatever screen is below."""

    DEFAULT_CSS = "CurveScreen CurveView { width: 100%; height: 100%; border-subtitle-color: $foreground; }"

    def __init__(self, view_model: ViewModel, path: str) -> None:
        self.view = CurveView(view_model, path)
        self.view.border_subtitle = "+ - zoom · ←→ move · end follow · p second · esc"
        super().__init__(self.view, None)

    def show(self) -> None:
        if self.is_mounted:
            self.view.show()
