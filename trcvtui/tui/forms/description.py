"""A connection description byte for byte: the DB's content, and the errors that a CPU finds there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import ClassVar, Final

from trcvtui.project.connect_view import (
    ConnectConfig,
    DescriptionRow,
    DescriptionView,
    connect_declaration,
    description_view,
)
from trcvtui.tui.formatting import pad, plain, wrap_text
from trcvtui.tui.widgets.dialogs import ViewDialog
from trcvtui.tui.widgets.line_view import EMPTY, Row, TextView, hidden_bindings, row
from trcvtui.udt.byte_text import hex_lines

OFFSET_WIDTH, FIELD_WIDTH, BYTES_PER_LINE = 7, 24, 8  # columns, columns, bytes a line
BYTES_WIDTH: Final = 3 * BYTES_PER_LINE + 1
INDENT: Final = " " * (OFFSET_WIDTH + 2)
MOST_ZERO_LINES: Final = 2  # more lines of zeros are shown as one: `00 × N`


def description_rows(view: DescriptionView, width: int) -> list[Row]:
    """Return all rows of the view; a sign and a style mark the field that has the flaw."""
    rows = [row((line, "strong")) for line in wrap_text(f"{view.structure} · {view.says}", width)]
    if view.warning:
        rows += [row((line, "error strong")) for line in wrap_text(f"! {view.warning}", width)]
    if view.flaw:
        rows += [row((line, "error")) for line in wrap_text(f"✗ {view.flaw}", width)]
    rows.append(EMPTY)
    for each in view.rows:
        if each.field or each.data:  # else: a flaw of the whole, shown above
            rows += _field_rows(each, width)
    return rows


def _field_rows(each: DescriptionRow, width: int) -> Iterator[Row]:
    is_flaw = each.remark.startswith("! ")
    field = each.field or ("(no field)" if each.data else "")
    style = "error strong" if is_flaw else "faint" if not each.field else ""
    lines = list(_byte_lines(each.data)) or [(0, "")]
    values = wrap_text(each.value, width - 2 - OFFSET_WIDTH - FIELD_WIDTH - BYTES_WIDTH)
    for number, (part, value) in enumerate(zip_longest(lines, values)):
        offset, text = part or (None, "")
        where = "" if offset is None else f"{each.offset + offset:>{OFFSET_WIDTH - 3}}"
        yield row(
            ("✗ " if is_flaw and not number else "  ", "error strong"),
            (pad(where, OFFSET_WIDTH), "dim"),
            (pad("" if number else field, FIELD_WIDTH), style),
            (pad(text, BYTES_WIDTH), "printable"),
            (value or "", "strong"),
        )
    if each.remark:
        text = f"✗ {each.remark[2:]}" if is_flaw else each.remark
        for line in wrap_text(text, width - len(INDENT)):
            yield row((INDENT, ""), (line, "error" if is_flaw else "dim"))


def _byte_lines(data: bytes) -> Iterator[tuple[int, str]]:
    """Yield offset and hex text line by line; a long stretch of zeros is one line."""
    at = 0
    while at < len(data):
        zeros = len(data[at:]) - len(data[at:].lstrip(b"\0"))
        if zeros > MOST_ZERO_LINES * BYTES_PER_LINE and at % BYTES_PER_LINE == 0:
            yield at, f"00 × {zeros}"
            at += zeros
            continue
        yield at, data[at : at + BYTES_PER_LINE].hex(" ")
        at += BYTES_PER_LINE


class DescriptionText(TextView):
    def __init__(self) -> None:
        super().__init__(id="description")
        self.config: ConnectConfig | None = None
        self._listens = ""

    def show_description(self, config: ConnectConfig, listens: str) -> None:
        """Show another description from its start. `listens` is where the CONNECT listens now, or ""."""
        self.config, self._listens = config, listens
        self.scroll_to(y=0, animate=False)
        self.draw()

    def make_rows(self) -> list[Row]:
        view = description_view(self.config, self._listens) if self.config is not None else None
        return description_rows(view, max(40, self.line_width - 1)) if view is not None else []


class DescriptionScreen(ViewDialog[None]):
    """Escape closes the screen; ← → show the other descriptions of the project."""

    BINDINGS: ClassVar = hidden_bindings({
        "right": "other(1)", "left": "other(-1)", "y": "yank", "s": "source", "C": "leave",
    })  # fmt: skip
    DEFAULT_CSS = """
    DescriptionScreen DescriptionText {
        width: 100; height: auto; max-height: 100%; border-subtitle-color: $foreground;
    }
    """

    def __init__(self, configs: Sequence[ConnectConfig], name: str, listens: Mapping[str, str]) -> None:
        self._text = DescriptionText()
        super().__init__(self._text, None)
        self._configs = configs
        self._listens = listens  # the end where a CONNECT listens now, by its name
        self._place = next((n for n, each in enumerate(configs) if each.name == name), 0)

    def on_mount(self) -> None:
        self._draw()

    @property
    def _config(self) -> ConnectConfig:
        return self._configs[self._place]

    def _draw(self) -> None:
        config, many = self._config, len(self._configs) > 1
        size = len(config.description.data) if config.description is not None else 0
        which = f" {self._place + 1}/{len(self._configs)}" if many else ""
        self._text.set_title(None, config.name, f"{size} bytes{which}")
        self._text.show_description(config, self._listens.get(config.name, ""))
        self._show_subtitle("y hex  s SCL  " + ("← → other CONNECT  " if many else "") + "esc")

    def _show_subtitle(self, words: str) -> None:
        self._text.border_subtitle = plain(words).replace("[", "\\[")

    def action_other(self, step: int) -> None:
        self._place = (self._place + step) % len(self._configs)
        self._draw()

    def action_yank(self) -> None:
        description = self._config.description
        if description is not None:
            self._yank_text("the description as hex", hex_lines(description.data, self._config.name), ".txt")

    def action_source(self) -> None:
        if self._config.description is not None:
            self._yank_text("the description in SCL", connect_declaration(self._config) + "\n", ".scl")

    def _yank_text(self, name: str, text: str, suffix: str) -> None:
        from trcvtui.tui.clipboard_and_files import yank  # read when first asked for
        from trcvtui.tui.copy_formats import CopyFormat

        form = CopyFormat("h", name, lambda of: text, suffix)
        self.run_worker(yank(self.app, form, text, self._show_subtitle, self._show_subtitle))
