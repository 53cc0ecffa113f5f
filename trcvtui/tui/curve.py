"""The curve: a member over the known messages, a second one on the same time axis, ERRORs below."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import accumulate, groupby
from typing import ClassVar, Final, NamedTuple

from trcvtui.errors import UserError
from trcvtui.tui.view_model.member_numbers import NOT_KNOWN, MemberNumbers, Number, is_number
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.curves import Curve, braille, curve
from trcvtui.tui.widgets.dialogs import ViewDialog
from trcvtui.tui.widgets.line_view import Part, Row, TextView, hidden_bindings, row
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.layout.value_text import value_text
from trcvtui.wording import count, stamp_text, utc_text

AXIS_WIDTH: Final = 11  # columns beside a curve
ROWS_BELOW: Final = 3  # rows: time axis, marks, times; then one for each member
LEAST_WIDTH, LEAST_HEIGHT = 32, 8
LEAST_UTC_WIDTH: Final = 90  # columns
SHORTEST_WINDOW_NS: Final = 1_000_000
STEPS_PER_WINDOW: Final = 8  # an arrow key moves by one step
TRACE_STYLES: Final = "busy", "warn"  # of the first member, of the second one
ERROR, CUT = "▲", "×"  # in one column the greater one wins (`max`)


class TimeWindow:
    """The window of time in view, in ns. `span` None is the whole time, `end` None follows new messages."""

    def __init__(self) -> None:
        self.span: int | None = None
        self.end: int | None = None
        self.whole = 0, SHORTEST_WINDOW_NS

    @property
    def bounds(self) -> tuple[int, int]:
        first, last = self.whole
        span = min(self.span or last - first, last - first)
        end = last if self.end is None else max(first + span, min(self.end, last))
        return end - span, end

    def zoom(self, by: float) -> None:
        """Multiply the time in view. The middle stays, or the end if the view follows new messages."""
        begin, end = self.bounds
        span = max(SHORTEST_WINDOW_NS, int((end - begin) * by))
        is_whole = span >= self.whole[1] - self.whole[0]
        self.span, self.end = (None, None) if is_whole else (span, self.end and (begin + end + span) // 2)

    def move(self, steps: int) -> None:
        begin, end = self.bounds
        end += steps * ((end - begin) // STEPS_PER_WINDOW)
        self.end = end if self.span and end < self.whole[1] else None  # at the end: follow new messages again


class MemberTrace(NamedTuple):
    """A drawn member. `now` is the newest message's value. If `curve` is None, no value is in view."""

    leaf: Leaf
    style: str
    now: Number | None
    curve: Curve | None


class CurveView(TextView, inherit_bindings=False):
    """`path` is the first member, `other` the second. If the type has changed, both are looked up again."""

    BINDINGS: ClassVar = hidden_bindings({
        "plus": "zoom(0.5)", "minus": "zoom(2)", "left": "step(-1)", "right": "step(1)",
        "home,g": "step(-1_000_000_000)", "end,G": "step(1_000_000_000)", "p": "other",
    })  # fmt: skip

    def __init__(self, view_model: ViewModel, path: str) -> None:
        super().__init__(id="curve")
        self._view_model = view_model
        self.instance, self.path = view_model.selected, path
        self.other: str | None = None
        self.window = TimeWindow()
        self._numbers: dict[str, MemberNumbers] = {}
        self._numbers_of: tuple[object, ...] = ()
        self._drawn: tuple[object, ...] = ()  # the inputs of the rows: unchanged, they are not drawn again

    def show(self) -> None:
        view, known = self._view_model, self._view_model.known_messages
        of = view.selected, view.instance is None, view.message_type, view.frozen_scan
        state = known, known.next_number, known.first_full, known.gaps, known.errors
        look = self.line_width, self.container_size.height, self.window.span, self.window.end, self.other
        drawn = *of, *state, *look
        if drawn != self._drawn and self.container_size.height:
            self._drawn = drawn
            self.set_title(None, self.path or "curve", self._describe_messages())
            lack = self._explain_lack()
            self._rows = [row((lack, "warn"))] if lack else self._chart_rows()
        super().show()

    # -- words ------------------------------------------------------------------------------------------

    def _describe_messages(self) -> str:
        known, frozen = self._view_model.known_messages, self._view_model.frozen_scan
        words = self.instance, count(known.count, "message"), *known.list_remarks()
        state = f"frozen in scan {frozen}" if frozen is not None else ""
        window = "paused: press end to follow" if self.window.end is not None else ""
        return " · ".join(filter(None, (*words, state, window)))

    def _explain_lack(self) -> str:
        """Return why there is no curve, "" if there is one."""
        view, known = self._view_model, self._view_model.known_messages
        if self.instance != view.selected or view.instance is None:
            return f"{self.instance or 'the instance'} does not exist any more"
        declared = view.message_type
        if declared is None:
            return f"{self.instance} has no DATA: its messages have no values"
        leaf = _leaf_at(declared.layout, self.path)
        if leaf is None:
            return f"{declared.type_name} has no member {self.path} any more"
        if not is_number(declared.layout, leaf):
            return f"{self.path or declared.name} is not a number: it has no curve"
        if known.instance != self.instance or not known.rows:
            return "no message has ended yet"
        small = self.line_width < LEAST_WIDTH or self.container_size.height < LEAST_HEIGHT
        return "too small for a curve" if small else ""

    # -- the picture --------------------------------------------------------------------------------------

    def _chart_rows(self) -> list[Row]:
        declared, known = self._view_model.message_type, self._view_model.known_messages
        assert declared is not None
        if self._numbers_of != (known, declared):
            self._numbers_of, self._numbers = (known, declared), {}
        times = list(accumulate((each.t_ns for each in known.rows), max))  # a capture may go back in time
        gone = known.first_full - known.first
        self.window.whole = min(times[min(gone, len(times) - 1)], times[-1] - SHORTEST_WINDOW_NS), times[-1]
        found = [_leaf_at(declared.layout, path) for path in (self.path, self.other) if path is not None]
        leaves = [leaf for leaf in found if leaf is not None]
        width = self.line_width - AXIS_WIDTH * len(leaves)
        height = self.container_size.height - ROWS_BELOW - len(leaves)
        traces = []
        for leaf, style in zip(leaves, TRACE_STYLES, strict=False):
            kept = self._numbers.setdefault(leaf.path, MemberNumbers(declared.layout, leaf))
            numbers = kept.update_numbers(known, known.next_number)
            now = next((number for number in reversed(numbers[gone:]) if number is not None), None)
            drawn = curve(times, numbers, self.window.bounds, width, height, known.gaps)
            traces.append(MemberTrace(leaf, style, now, drawn))
        begin, end = self.window.bounds
        begins, ends = self._format_time(begin), self._format_time(end)
        in_view = bisect_right(times, end) - bisect_left(times, begin)
        return [
            *_curve_rows(traces, width, height),
            row((" " * (AXIS_WIDTH - 1), ""), ("└" + "─" * width, "faint")),
            row((" " * AXIS_WIDTH, ""), *self._mark_parts(width)),
            row((f"{'':{AXIS_WIDTH}}{begins}{ends:>{width - len(begins)}}", "dim")),
            *(_legend_row(trace, in_view) for trace in traces),
        ]

    def _mark_parts(self, width: int) -> Iterator[Part]:
        """Yield a sign for each column with an ERROR or a cut message, blanks for the others."""
        (begin, end), known = self.window.bounds, self._view_model.known_messages
        signs = {each.t_ns: CUT for each in known.rows if each.reason} | dict.fromkeys(known.errors, ERROR)
        columns = dict[int, str]()
        for t_ns, sign in signs.items():
            column = min(width - 1, (t_ns - begin) * width // (end - begin)) if t_ns <= end else width
            columns[column] = max(sign, columns.get(column, ""))
        for sign, some in groupby(columns.get(column, " ") for column in range(width)):
            yield "".join(some), "error" if sign == ERROR else "warn"

    def _format_time(self, t_ns: int) -> str:
        begun_ns = self._view_model.live.begun_ns if self._view_model.live is not None else None
        if begun_ns is None or self.line_width < LEAST_UTC_WIDTH:
            return f"{stamp_text(t_ns)} s"
        return f"{stamp_text(t_ns)} s · {utc_text(begun_ns + t_ns)[:-4]}"

    # -- keys -----------------------------------------------------------------------------------------------

    def action_zoom(self, by: float) -> None:
        self.window.zoom(by)
        self.show()

    def action_step(self, steps: int) -> None:
        self.window.move(steps)
        self.show()

    def action_other(self) -> None:
        """Draw the next numeric member as the second curve; after the last one, draw no second curve."""
        declared = self._view_model.message_type
        leaves = declared.layout.leaves(0, declared.layout.leaf_count) if declared is not None else ()
        numbers = [leaf.path for leaf in leaves if declared and is_number(declared.layout, leaf)]
        paths = [None, *(path for path in numbers if path != self.path)]
        place = paths.index(self.other) if self.other in paths else 0
        self.other = paths[(place + 1) % len(paths)]
        self.show()


def _leaf_at(layout: Layout, path: str) -> Leaf | None:
    with suppress(UserError):
        return layout.leaf(layout.leaf_number(path))
    return None


def _curve_rows(traces: Sequence[MemberTrace], width: int, height: int) -> Iterator[Row]:
    """Yield the rows of the curves: where they meet, the sign has the first curve's colour."""
    first, other = traces[0], traces[-1]
    drawn = [trace.curve.cells if trace.curve is not None else [[0] * width] * height for trace in traces]
    for y in range(height):
        both = list(zip(drawn[0][y], drawn[-1][y], strict=True))
        # Blanks are separate parts: an SVG renderer may make a run of blanks narrow.
        styles = groupby(both, lambda cells: first.style if cells[0] else other.style if cells[1] else "")
        parts = [("".join(braille(own | others) for own, others in some), style) for style, some in styles]
        label = _axis_label(first, y, height)
        ends = [(f" {_axis_label(other, y, height)}", other.style)] if len(traces) > 1 else []
        axis = (f"{label:>{AXIS_WIDTH - 2}} ", first.style), ("┤" if label else "│", "faint")
        yield row(*axis, *parts, *ends)


def _axis_label(trace: MemberTrace, y: int, height: int) -> str:
    """Return the axis text of row `y`: an end, or in the middle row the number that both ends share."""
    low, high = trace.curve.axis if trace.curve is not None else (None, None)
    number = {0: high, height - 1: low}.get(y) if low != high else {height // 2: low}.get(y)
    text = f"{number:.6g}" if isinstance(number, float) else "" if number is None else str(int(number))
    return text if number is None or len(text) <= AXIS_WIDTH - 2 else f"{number:.2e}"


def _legend_row(trace: MemberTrace, in_view: int) -> Row:
    leaf, drawn = trace.leaf, trace.curve
    now = "-" if trace.now is None else "?" if trace.now is NOT_KNOWN else value_text(leaf, trace.now)
    parts = (f"{leaf.path or 'value'} ", trace.style), (f"now {now}", "strong")
    if drawn is None:
        return row(*parts, (" · no number in view", "warn"))
    values = f" · min {value_text(leaf, drawn.least)} · max {value_text(leaf, drawn.most)}"
    signs = f" · {count(in_view, 'message')} in view · {ERROR} ERROR {CUT} cut"
    return row(*parts, (values, ""), (signs, "dim"))


class CurveScreen(ViewDialog[None]):
    DEFAULT_CSS = "CurveScreen CurveView { width: 100%; height: 100%; border-subtitle-color: $foreground; }"

    def __init__(self, view_model: ViewModel, path: str) -> None:
        self.view = CurveView(view_model, path)
        self.view.border_subtitle = "+ - zoom · ←→ move · end follow · p second · esc"
        super().__init__(self.view, None)

    def show(self) -> None:
        if self.is_mounted:
            self.view.show()
