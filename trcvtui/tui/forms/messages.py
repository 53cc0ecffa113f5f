"""What a peer can send: a message or sequence of the project's library, or a UDT, filled in as a form."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final, NamedTuple, cast

from textual.binding import Binding

from trcvtui.errors import UserError
from trcvtui.project.project import Project
from trcvtui.tui.formatting import clip, pad, plain
from trcvtui.tui.peer_commands import UDT
from trcvtui.tui.view_model.validity import find_mistake
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.dialogs import FieldsDialog, FormField, ViewDialog
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row
from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.layout_tree import Leaf
from trcvtui.udt.types import StringType, type_text

EMPTY_LIBRARY = "no [[message]] with name and text, no [[sequence]] with name and steps in this project"
PICK_KEYS = "↑↓ choose · enter send or play · esc close"
NAME_WIDTH = 18


class LibraryEntry(NamedTuple):
    """A message or a sequence of the project; `line` is its bench command."""

    kind: str
    name: str
    text: str
    line: str


def entries_for(peer: str, project: Project) -> list[LibraryEntry]:
    messages = [
        LibraryEntry("message", m.name, m.text, f"peer {peer} send message {m.name}")
        for m in project.messages
        if m.peer in ("", peer)
    ]
    sequences = [
        LibraryEntry("sequence", s.name, " → ".join(s.steps), f"peer {peer} play {s.name}")
        for s in project.sequences
    ]
    return messages + sequences


class LibraryList(LineView):
    BINDINGS: ClassVar = [Binding("enter", "choose", show=False)]

    def __init__(self, entries: list[LibraryEntry], choose: Callable[[str], object]) -> None:
        super().__init__(id="messages")
        self._entries = entries
        self._choose = choose
        self.cursor = 0

    def row_count(self) -> int:
        return max(1, len(self._entries))

    def row_at(self, y: int) -> Row:
        if not self._entries:
            return row((EMPTY_LIBRARY, "dim")) if y == 0 else EMPTY
        entry, is_chosen = self._entries[y], y == self.cursor
        return row(
            ("▸ " if is_chosen else "  ", "key"),
            (f"{entry.kind:<10}", "label"),
            (pad(clip(entry.name, NAME_WIDTH - 1), NAME_WIDTH), "strong"),
            (entry.text, "dim"),
            style="cursor" if is_chosen else "",
        )

    def action_move(self, rows: int) -> None:
        self.cursor = max(0, min(len(self._entries) - 1, self.cursor + rows))
        self.scroll_to(y=max(0, self.cursor - self.size.height + 1), animate=False)
        self.show()

    def click(self, x: int, y: int) -> None:
        again = y == self.cursor
        self.action_move(y - self.cursor)
        if again:
            self.action_choose()

    def action_choose(self) -> None:
        if self._entries:
            self._choose(self._entries[self.cursor].line)


class LibraryScreen(ViewDialog[str]):
    """The list of messages. The answer is the command of the chosen entry, "" if you choose none."""

    DEFAULT_CSS = "LibraryScreen LibraryList { width: 110; height: 60%; border-subtitle-color: $text-muted; }"

    def __init__(self, peer: str, project: Project) -> None:
        shown = LibraryList(entries_for(peer, project), self.dismiss)
        shown.set_title(None, f"Messages of {peer}", "")
        shown.border_subtitle = PICK_KEYS
        super().__init__(shown, "")


MOST_FIELDS: Final = 64  # you write more members by hand
NAME, TYPE = 24, 14
FORM_KEYS: Final = "↑↓ member · enter take · esc leave"


class MemberField(FormField):
    """The field of one member; if it is empty, the payload has no such member."""

    def __init__(self, leaf: Leaf, value: str) -> None:
        super().__init__(value, placeholder="''" if isinstance(leaf.type, StringType) else "0")
        self.leaf = leaf

    async def action_submit(self) -> None:
        cast("UdtForm", self.screen).submit()

    @property
    def assignment(self) -> str:
        """Return `path=value`, "" for an empty field."""
        from trcvtui.udt.literals import quote_text  # read when first asked for

        text = self.value.strip()
        if not text:
            return ""
        is_bare = isinstance(self.leaf.type, StringType) and text[0] not in "'\""
        return f"{self.leaf.path}={quote_text(text) if is_bare else text}"


class UdtForm(FieldsDialog[str, MemberField]):
    """The form of one UDT. The answer is the payload of `send udt`, "" if you leave the form."""

    DEFAULT_CSS = """
    UdtForm #form { width: 84; }
    UdtForm .name { width: 24; }
    UdtForm .type { width: 14; color: $text-muted; }
    """

    def __init__(
        self, project: Project, peer: str, name: str, layout: Layout, values: dict[str, str]
    ) -> None:
        leaves = list(layout.leaves(0, MOST_FIELDS))
        rows = [(_column_texts(leaf), MemberField(leaf, values.get(leaf.path, ""))) for leaf in leaves]
        super().__init__("", f"{name}: {len(leaves)} members", FORM_KEYS, rows)
        self._project, self._peer, self._name = project, peer, name
        self._more = layout.leaf_count - len(leaves)

    @property
    def payload(self) -> str:
        return self._format_payload([field.assignment for field in self._fields])

    def _format_payload(self, members: list[str]) -> str:
        return f"{self._name} {{{', '.join(member for member in members if member)}}}"

    def _find_mistake(self, payload: str) -> str:
        return find_mistake(f"peer {self._peer} send udt {payload}", self._project)

    def _check_fields(self) -> None:
        faults = [self._find_mistake(self._format_payload([field.assignment])) for field in self._fields]
        for field, fault in zip(self._fields, faults, strict=True):
            field.set_class(bool(fault), "-bad")
        first = next(filter(None, faults), "")
        more = f" · {self._more} more members, not shown" if self._more else ""
        self._line.update(f"✗ {plain(first)}" if first else f"▸ udt {plain(self.payload)}{more}")
        self._line.set_class(bool(first), "-bad")

    def submit(self) -> None:
        if not self._find_mistake(self.payload):
            self.dismiss(self.payload)


def _column_texts(leaf: Leaf) -> dict[str, str]:
    return {"name": clip(plain(leaf.path), NAME - 1), "type": clip(plain(type_text(leaf.type)), TYPE - 1)}


def make_udt_form(text: str, mode: str, view_model: ViewModel) -> UdtForm | None:
    """Return a form for the payload's UDT, else for DATA's UDT, else for the first UDT, else None."""
    types, declared = view_model.project.types, view_model.declaration
    first = text.split("{")[0].strip() if mode == UDT else ""
    names = [first, declared.type_name if declared else "", *types.names()]
    name = next((name for name in names if name.casefold() in types.types), "")
    if not name:
        return None
    layout = lay_out(types.get_type(name), view_model.project.layout_rules_of(name), name)
    values = _payload_values(text, view_model) if mode == UDT and name == first else {}
    return UdtForm(view_model.project, view_model.peer, name, layout, values)


def _payload_values(text: str, view_model: ViewModel) -> dict[str, str]:
    """Return the text of each member that a payload sets, or {} if the payload has a mistake."""
    from trcvtui.commands.tokens import parse_members  # read when first asked for

    try:
        return dict(parse_members(text[text.index("{") :].strip(), "form"))
    except (UserError, ValueError):
        return {}
