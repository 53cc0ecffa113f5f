"""Panes 2 to 4 of the lab: the bytes with their gaps, the ranking of profiles, the cure; two dialogs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Final, cast

from textual.binding import Binding

from trcvtui.history.waveform_text import merge_pieces
from trcvtui.tui.formatting import clip, plain, wrap_text
from trcvtui.tui.lab.collapsible_tree import Place, TreeRow
from trcvtui.tui.lab.lab import OURS, THEIRS, Lab
from trcvtui.tui.lab.lab_fix import CURE_KINDS, CURE_LANGUAGES, KIND_TITLES, RECEIVER, SENDER, Cure, make_cure
from trcvtui.tui.messages import ProfileChosen
from trcvtui.tui.widgets.dialogs import FieldsDialog, FormField, ResultScreen
from trcvtui.tui.widgets.hex_view import HexView
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, TextView, row
from trcvtui.udt.compare.fit_report import reading_title, same_readings_text
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.literals import parse_integer


class ProblemsScreen(ResultScreen):
    BINDINGS: ClassVar = [Binding("w", "leave", show=False)]

    def __init__(self, problems: Sequence[str]) -> None:
        detail = f"{len(problems)} in the type files; esc closes"
        super().__init__("problems", "Problems", detail, lambda width: problem_rows(problems, width))


def problem_rows(problems: Sequence[str], width: int) -> list[Row]:
    return [
        row(("  " if number else "✗ ", "error"), (line, ""))
        for problem in problems
        for number, line in enumerate(wrap_text(problem, width - 2))
    ]


MOST_FIELDS: Final = 32
NAME: Final = 34


class NumberField(FormField):
    """The field for the value of one constant; if it is empty, the value is still unknown."""

    def __init__(self, name: str) -> None:
        super().__init__(placeholder="whole number")
        self.constant = name

    async def action_submit(self) -> None:
        cast("ConstantsForm", self.screen).submit_field(self)

    @property
    def number(self) -> int | None:
        text = self.value.strip()
        return parse_integer(text) if text else None


class ConstantsForm(FieldsDialog[dict[str, int], NumberField]):
    """The form of the constants. The answer is the values that you entered, none if you leave the form."""

    DEFAULT_CSS = """
    ConstantsForm #form { width: 72; }
    ConstantsForm .name { width: 34; }
    """

    def __init__(self, names: Sequence[str], where: str) -> None:
        title = clip(f"Constants that {plain(where)} uses", 66)
        rows = [({"name": clip(plain(name), NAME - 1)}, NumberField(name)) for name in names[:MOST_FIELDS]]
        super().__init__({}, title, "↑↓ field · enter take · esc leave", rows)

    def _check_fields(self) -> None:
        bad = [field for field in self._fields if field.value.strip() and field.number is None]
        for field in self._fields:
            field.set_class(field in bad, "-bad")
        wrong = "✗ not a whole number such as 10 or 16#0A"
        about = "bounds of arrays such as ARRAY[1..MAX]; `save project` saves them"
        self._line.update(wrong if bad else about)

    def submit_field(self, field: NumberField) -> None:
        """Go to the next empty field; after the last one, close the form with the values."""
        empty = [field for field in self._fields if not field.value.strip()]
        if field.value.strip() and empty:
            self.set_focus(empty[0])
            return
        given = {field.constant: field.number for field in self._fields if field.value.strip()}
        numbers = {name: number for name, number in given.items() if number is not None}
        if len(numbers) == len(given):
            self.dismiss(numbers)


GAP: Final = "░"
THEIR_GAP_SIGN: Final = "▒"
MOST_REASONS: Final = 12
MOST_GAP_ROWS: Final = 64  # rows whose gaps are cached
MOST_CURED_LEAVES: Final = 20_000  # the cure of a larger type is written only when you ask for it


class LabHex(HexView):
    """Bytes. Signs in the text column mark our padding, and padding that only the sender's layout has."""

    KEYS: ClassVar = (("hjkl", "byte"), ("b", "which bytes"), ("[ ]", "message"))

    def __init__(self, lab: Lab) -> None:
        super().__init__("lab-hex", shows_job=False)
        self._lab = lab
        self.their_link = range(0)
        self._gaps: dict[tuple[int, int, int], dict[int, str]] = {}
        self._revision = -1

    def show(self) -> None:
        if self._revision != self._lab.revision:
            self._revision = self._lab.revision
            self._gaps.clear()
        super().show()

    def show_row(self, found: TreeRow | None) -> None:
        lab = self._lab
        sizes = [layout.size for side in (OURS, THEIRS) if (layout := lab.layout(side)) is not None]
        row = found if found is not None and found.key else None
        self.link = _bytes_of(row.ours) if row is not None else range(0)
        theirs = _bytes_of(row.theirs) if row is not None and lab.layout(THEIRS) else range(0)
        self.their_link = theirs if theirs != self.link else range(0)
        self.show_bytes(lab.bytes.content, max(sizes, default=0), frozenset())

    @property
    def link_text(self) -> str:
        sides = (("", self.link), ("theirs ", self.their_link))
        return "".join(f"{side}{link.start}-{link.stop - 1} · " for side, link in sides if link)

    def _gap_signs(self, start: int, stop: int) -> dict[int, str]:
        key = start, stop, self._lab.revision
        if key not in self._gaps:
            if len(self._gaps) > MOST_GAP_ROWS:
                self._gaps.clear()
            ours, theirs = self._lab.layout(OURS), self._lab.layout(THEIRS)
            signs = {place: THEIR_GAP_SIGN for place in range(start, stop) if _is_gap(theirs, place)}
            self._gaps[key] = signs | {place: GAP for place in range(start, stop) if _is_gap(ours, place)}
        return self._gaps[key]

    def _style_of(self, offset: int) -> str:
        style = super()._style_of(offset)
        row_start = offset // self.per_row * self.per_row
        if self._gap_signs(row_start, row_start + self.per_row).get(offset) == GAP:
            style = style.replace("null", "ghost")
        return style + (" match" if offset in self.their_link else "")

    def _text(self, start: int, styles: list[str]) -> list[Part]:
        bar, *rest = super()._text(start, styles)
        signs = self._gap_signs(start, start + self.per_row)
        text = "".join(part for part, _ in rest)
        marked = [
            (signs.get(start + n, c), style) for n, (c, style) in enumerate(zip(text, styles, strict=True))
        ]
        return [bar, *merge_pieces(marked)]


def _bytes_of(place: Place) -> range:
    return range(place.offset, place.offset + place.size)


def _is_gap(layout: Layout | None, place: int) -> bool:
    return layout is not None and place < layout.size and layout.leaf_number_at(place) is None


class FitList(LineView):
    KEYS: ClassVar = (("↑↓", "profile"), ("enter", "as theirs"), ("f", "judge again"))
    BINDINGS: ClassVar = [Binding("enter,space", "apply", show=False)]

    def __init__(self, lab: Lab) -> None:
        super().__init__(id="lab-fit")
        self._lab = lab
        self.cursor = 0
        self._rows: list[tuple[Row, int | None]] = []
        self._drawn: tuple[object, ...] = ()

    def show(self) -> None:
        self._draw()
        super().show()

    def _draw(self) -> None:
        fits, width = self._lab.fits, max(20, self.line_width)
        known = id(fits), self._lab.fitted_by, self.cursor, self.has_focus, width, len(fits)
        if known == self._drawn:
            return
        self._drawn = known
        self.cursor = max(0, min(self.cursor, len(fits) - 1))
        head = self._lab.judgement or "press f to rank the profiles by how they fit the bytes"
        self._rows = [(row((line, "strong" if fits else "dim")), None) for line in wrap_text(head, width)]
        for number, found in enumerate(fits):
            chosen = number == self.cursor
            parts = [("▸" if chosen else " ", "key"), (f"{found.rank:>2} ", "dim")]
            parts += [(f"{found.score:+6.1f}  ", "strong"), (clip(reading_title(found), width - 12), "")]
            self._rows.append((row(*parts, style=self.cursor_style(chosen)), number))
            if chosen and found.same:
                twins = wrap_text(f"reads the same values as {same_readings_text(found)}", width - 5)
                self._rows += [(row((f"     {line}", "warn")), number) for line in twins]
            for reason in found.reasons[:MOST_REASONS] if chosen else ():
                self._rows += self._reason_rows(reason.points, reason.path, reason.text, width, number)

    def _reason_rows(
        self, points: float, path: str, text: str, width: int, number: int
    ) -> list[tuple[Row, int | None]]:
        sign, style = ("+", "done") if points > 0 else ("-", "error")
        head = f"     {sign}{abs(points):.1f} "
        reason = text if text.startswith(path) else f"{plain(path)}: {text}"
        first, *rest = wrap_text(reason, width - len(head))
        lines = [row((head, style), (first, ""))] + [row((" " * len(head) + line, "")) for line in rest]
        return [(line, number) for line in lines]

    def row_count(self) -> int:
        return len(self._rows)

    def row_at(self, y: int) -> Row:
        return self._rows[y][0] if y < len(self._rows) else EMPTY

    def action_move(self, rows: int) -> None:
        self.cursor = max(0, min(len(self._lab.fits) - 1, self.cursor + rows))
        self.show()
        mine = [y for y, (_, number) in enumerate(self._rows) if number == self.cursor]
        for y in (mine[-1:] + mine[:1]) if mine else []:
            self.keep_in_view(y)

    def action_apply(self) -> None:
        if self._lab.fits:
            self.post_message(ProfileChosen(self.cursor))

    def click(self, x: int, y: int) -> None:
        number = self._rows[y][1]
        if number is None:
            return
        if number == self.cursor:
            self.action_apply()
        self.cursor = number
        self.show()


def _break_line(line: str, width: int) -> list[str]:
    if len(line) <= width:
        return [line]
    inner = " " * min(width // 2, len(line) - len(line.lstrip()) + 4)
    first, *rest = wrap_text(line.lstrip(), width - len(inner))
    return [line[: len(line) - len(line.lstrip())] + first, *(inner + part for part in rest)]


class CureText(TextView):
    """The padded type or the swap code, ready to paste."""

    KEYS: ClassVar = (("c", "type | swap"), ("d", "ST | SCL"), ("y", "yank"))

    def __init__(self, lab: Lab) -> None:
        super().__init__(id="lab-cure")
        self._lab = lab
        self.kind = RECEIVER
        self.language = CURE_LANGUAGES[0]
        self.is_requested = False
        self.found = Cure((), "")
        self._known: tuple[object, ...] = ()

    def show(self) -> None:
        known = self._lab.revision, self.kind, self.language, self.is_requested, self.line_width
        if known != self._known and self.size.height:
            self._known = known
            self._write_rows()
        super().show()

    def build_cure(self) -> Cure:
        sides = (OURS, THEIRS) if self.kind == SENDER else (THEIRS, OURS)
        wanted = self._lab.layout(sides[0])
        if wanted is None:
            return Cure((f"{sides[0]} has no layout",), "")
        return make_cure(wanted, self._lab.rules(sides[1]), self.kind, self.language)

    def _write_rows(self) -> None:
        self.set_title(4, "Cure", f"{KIND_TITLES[self.kind]}, {self.language.upper()}")
        ours = self._lab.layout(OURS)
        if not self.is_requested and ours is not None and ours.leaf_count > MOST_CURED_LEAVES:
            self._rows = [row(("the type is large: c writes the cure", "dim"))]
            return
        self.found = self.build_cure()
        width = max(20, self.line_width)
        comments = [f"// {line}" for line in self.found.comments]
        self._rows = [row((line, "dim")) for text in comments for line in wrap_text(text, width)]
        source = [plain(line) for line in self.found.text.rstrip("\n").split("\n")]
        self._rows += [row((part, "")) for line in source for part in _break_line(line, width)]

    def next_kind(self) -> None:
        self.kind = CURE_KINDS[(CURE_KINDS.index(self.kind) + 1) % len(CURE_KINDS)]
        self.is_requested = True
        self.show()

    def next_language(self) -> None:
        self.language = CURE_LANGUAGES[1 - CURE_LANGUAGES.index(self.language)]
        self.is_requested = True
        self.show()
