"""Formats in which you can yank the contents of a pane, and the menu of these formats."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding

from trcvtui.diagnosis.link import describe_condition
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.project.project import DataDecl, Project
from trcvtui.tui.formatting import clip, plain, status_word
from trcvtui.tui.view_model.explain import explain_status
from trcvtui.tui.widgets.dialogs import ViewDialog
from trcvtui.tui.widgets.line_view import ARROW_KEYS, LineView, Row, row
from trcvtui.udt.byte_text import hex_lines, iec_list
from trcvtui.udt.report import csv_lines, decoded_json, member_rows
from trcvtui.wording import count, format_columns, stamp_text

if TYPE_CHECKING:
    from trcvtui.tui.view_model.view_model import ViewModel

MOST_MEMBERS: Final = 70_000


@dataclass(frozen=True, slots=True)
class CopySource:
    """What a pane shows: bytes with their type, and the STATUS history of their instance."""

    project: Project
    content: bytes
    declared: DataDecl | None
    edges: tuple[Line, ...]
    title: str = ""  # which bytes these are
    message: bytes = b""  # under the cursor of the stream
    from_mark: bytes = b""  # of the stream, from the marked message to the cursor


def make_copy_source(
    view_model: ViewModel, of_job: bool, of_peer: bool, past: tuple[str, int, bytes] | None = None
) -> CopySource:
    """Return the bytes of the job or of DATA. `of_peer` asks for the last bytes that the peer has received.

    `past` has the instance, number and bytes of an earlier job. With number 0, the bytes were thrown away.
    """
    content, declared, job, name = view_model.job_bytes, view_model.declaration, "running job", ""
    peer = view_model.peer_snapshot
    if of_peer and peer is not None and peer.last_received:
        name, job, content, declared = peer.name, "", peer.last_received, None
    elif past is not None:
        instance, number, content = past
        job = f"job {number}" if number else "thrown away"
        if instance != view_model.selected:
            job = f"{instance} {job}"
        declared = declared if number and instance == view_model.selected else None
    elif not of_job and declared is not None:
        name, job, content = declared.name, "", view_model.data
    edges = tuple(view_model.history.list_edges(view_model.selected))
    is_of_now = past is None and not of_peer  # only then the holes belong to these bytes
    holes = view_model.stream_index.list_missing(view_model.selected, of_job) if is_of_now else ()
    lacks = sum(map(len, holes))  # of a capture
    size = count(len(content), "byte") + f" ({lacks} not captured, shown as 00)" * bool(lacks)
    title = "" if not content and past is None else f"{job}, {size}" if job else f"{size} of {name}"
    return CopySource(view_model.project, content, declared, edges, title)


@dataclass(frozen=True, slots=True)
class CopyFormat:
    """One format. `letter` chooses the format in the menu. A file in this format gets `suffix`."""

    letter: str
    name: str
    write: Callable[[CopySource], str]
    suffix: str = ".txt"


# -- STATUS history ---------------------------------------------------------------------------------------


def _format_history(of: CopySource) -> str:
    rows = [("scan", "t in s", "STATUS", "lamp", "why")]
    for line in of.edges:
        if isinstance(line.event, StatusEdge):
            condition = describe_condition(of.project, line.event.instance, line.event)
            word = f"{status_word(line.event.outputs.status)} {condition}"
            reason = plain(explain_status(line.event))
            rows.append((str(line.scan), stamp_text(line.t_ns), word, _lamp_names(line.event), reason))
    return "\n".join(format_columns(rows, "l" * len(rows[0]))) if len(rows) > 1 else ""


def _lamp_names(edge: StatusEdge) -> str:
    lit = (("ERROR", edge.outputs.error), ("DONE", edge.outputs.done), ("BUSY", edge.outputs.busy))
    return " ".join([name for name, on in lit if on][: 2 if edge.outputs.error and edge.outputs.done else 1])


# -- members -----------------------------------------------------------------------------------------------


def _list_members(of: CopySource) -> Iterator[tuple[str, ...]]:
    if of.declared is not None and of.content:
        layout, name = of.declared.layout, of.declared.name
        yield from member_rows(layout, of.content, name, missing="", most=MOST_MEMBERS)


def _format_json(of: CopySource) -> str:
    if of.declared is None or not of.content:
        return ""
    return decoded_json(of.declared.layout, of.content, of.declared.name, MOST_MEMBERS)


FORMATS: Final = (
    CopyFormat("h", "bytes as hex", lambda of: hex_lines(of.content)),
    CopyFormat("i", "bytes as 16#.. list", lambda of: iec_list(of.content)),
    CopyFormat(
        "v",
        "members as CSV",
        lambda of: "".join(f"{line}\n" for line in csv_lines(_list_members(of))),
        ".csv",
    ),
    CopyFormat("j", "members as JSON", _format_json, ".json"),
    CopyFormat("s", "STATUS history as text", _format_history),
    CopyFormat("m", "message at the cursor as hex", lambda of: hex_lines(of.message)),
    CopyFormat("r", "from the mark to the cursor as hex", lambda of: hex_lines(of.from_mark)),
)
MESSAGES_CSV: Final = CopyFormat("c", "messages as CSV", lambda of: "", ".csv")  # the table makes its text
PANE_LETTERS: Final = {"udt": "v", "history": "s", "status": "s"}  # the first choice, by the focused pane
FIRST: Final = "h"


NAME: int = 34
FORMAT_LETTERS = tuple(form.letter for form in FORMATS)


class YankList(LineView, inherit_bindings=False):
    """One row per format, pale if it has no text. Letters choose formats, so `j` and `k` move no cursor."""

    BINDINGS: ClassVar = [Binding("enter", "screen.take_chosen", show=False), *ARROW_KEYS[:2]]

    def __init__(self, subject: CopySource, first: str) -> None:
        super().__init__(id="yank")
        self.texts = {form.letter: form.write(subject) for form in FORMATS}
        self.cursor = FORMAT_LETTERS.index(first) if self.texts[first] else self._next_writable(-1, 1)

    def _next_writable(self, place: int, step: int) -> int:
        """Return the next format that has a text. If none has a text, return the same place."""
        for away in range(1, len(FORMATS) + 1):
            candidate = (place + step * away) % len(FORMATS)
            if self.texts[FORMAT_LETTERS[candidate]]:
                return candidate
        return max(0, place)

    def row_count(self) -> int:
        return len(FORMATS)

    def row_at(self, y: int) -> Row:
        form = FORMATS[y]
        text = self.texts[form.letter]
        begins = " ".join(text[:200].split()) if text else "nothing to yank"
        chosen = y == self.cursor
        return row(
            ("▸ " if chosen else "  ", "key"),
            (f"{form.letter}  ", "key" if text else "faint"),
            (form.name.ljust(NAME), "" if text else "faint"),
            (clip(begins, max(8, self.line_width - NAME - 5)), "dim" if text else "faint"),
            style="cursor" if chosen else "",
        )

    def action_move(self, rows: int) -> None:
        self.cursor = self._next_writable(self.cursor, 1 if rows > 0 else -1)
        self.show()

    def click(self, x: int, y: int) -> None:
        self.screen.run_worker(self.screen.run_action(f"take('{FORMAT_LETTERS[y]}')"))


class YankScreen(ViewDialog[tuple[CopyFormat, str] | None]):
    """Returns the chosen format and its text. A letter chooses at once, `y` the row at the cursor."""

    BINDINGS: ClassVar = [
        *[Binding(letter, f"take('{letter}')", show=False) for letter in FORMAT_LETTERS],
        Binding("y,enter", "take_chosen", show=False),
    ]
    DEFAULT_CSS = "YankScreen YankList { width: 96; height: auto; }"

    def __init__(self, subject: CopySource, first: str) -> None:
        self._list = YankList(subject, first)
        self._list.set_title(None, "Yank", subject.title)
        super().__init__(self._list, None)

    def action_take_chosen(self) -> None:
        self.action_take(FORMAT_LETTERS[self._list.cursor])

    def action_take(self, letter: str) -> None:
        form = FORMATS[FORMAT_LETTERS.index(letter)]
        text = self._list.texts[letter]
        if text:
            self.dismiss((form, text))
