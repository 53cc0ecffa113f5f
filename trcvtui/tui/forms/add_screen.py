"""The forms that add or change a part of the project: fields with choices, which make a command."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import ClassVar, cast

from textual.binding import Binding
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.errors import UserError
from trcvtui.files import FilesRead, substitute_disk, write_file
from trcvtui.project.edit import FormRow, fields_of, propose_name
from trcvtui.project.project import Project
from trcvtui.tui.completion import complete
from trcvtui.tui.formatting import plain, wrap_text
from trcvtui.tui.forms.fields import (
    KIND_TITLES,
    ProjectPart,
    fields_to_change,
    format_value,
    kinds_of,
    make_add,
    make_set_line,
    values_of,
)
from trcvtui.tui.forms.pasted_type import prepare_pasted_type
from trcvtui.tui.view_model.validity import find_mistake, preview_edit
from trcvtui.tui.widgets.dialogs import FormDialog, FormField
from trcvtui.udt.sources import type_files_in

HINT_WIDTH, HINT_ROWS = 27, 2  # columns, lines
FILE_KEY, ADD_UDT = "type file", "add udt "  # the key of its field, and its line
FILE_HINT = "a file of types: tab completes its path, ↑↓ choose one beside the project; or paste a STRUCT"


class ChoiceField(FormField):
    """One field. If a field has `choices`, the keys up and down walk through them."""

    def __init__(self, key: str, choices: tuple[str, ...], value: str, proposed: str = "") -> None:
        super().__init__(value)
        self.key, self.proposed = key, proposed
        self._choices = choices

    async def action_submit(self) -> None:
        cast("AddScreen", self.screen).submit()

    def convert_paste(self, text: str) -> str:
        """Give a pasted STRUCT to the form, and put the name of the future file into this field."""
        is_type = self.key == FILE_KEY and (len(text.splitlines()) > 1 or "END_STRUCT" in text.upper())
        return cast("AddScreen", self.screen).keep_type(text) if is_type else super().convert_paste(text)

    async def handle_change(self) -> None:
        await cast("AddScreen", self.screen).handle_field_change(self)

    def action_step(self, step: int) -> None:
        if not self._choices:
            super().action_step(step)
            return
        known = self.value in self._choices
        at = (self._choices.index(self.value) + step) % len(self._choices) if known else 0
        self.choose(self._choices[at])

    def choose(self, value: str) -> None:
        self.value, self.cursor_position = value, len(value)


class AddScreen(FormDialog[str]):
    """A form that returns the command, or "" if you leave the form."""

    ENTER_VERB: ClassVar = "add"
    BINDINGS: ClassVar = [Binding("tab", "complete", show=False)]
    DEFAULT_CSS = """
    AddScreen #form { width: 76; max-height: 100%; }
    AddScreen VerticalScroll { max-height: 70vh; }
    AddScreen .name { width: 23; }
    AddScreen .hint { width: 30; color: $text-muted; padding: 0 0 0 1; }
    AddScreen #form-line { height: auto; min-height: 3; color: $text-muted; margin: 1 0 0 0; }
    AddScreen:ansi ChoiceField { text-style: underline; }
    """

    def __init__(self, project: Callable[[], Project], kind: str, given: Mapping[str, str]) -> None:
        super().__init__("")
        self._project, self._given, self.kind = project, given, kind
        self._kind_field = ChoiceField("kind", kinds_of(project()), kind)
        self._block = given.get("block", "")
        self._fields: list[ChoiceField] = []
        self._rows = VerticalScroll(can_focus=False)
        self._paste, self._is_pasted = (Path(), ""), False  # file and content of a paste; the line names it

    def compose(self) -> Iterator[Widget]:
        with Vertical(id="form") as form:
            form.border_subtitle = f"tab field · ↑↓ choose · enter {self.ENTER_VERB} · esc leave"
            yield from self._first_rows()
            yield self._rows
            yield self._line

    def _first_rows(self) -> Iterator[Widget]:
        yield _field_row("add", self._kind_field, "↑↓ another kind")

    async def on_mount(self) -> None:
        await self._lay_out()
        self.set_focus(self._fields[0])

    async def _lay_out(self) -> None:
        specs = self._field_specs(self._project())
        self._fields = [
            ChoiceField(s.key, s.choices, self._given.get(s.key, s.first), s.first) for s in specs
        ]
        self._block = next((field.value for field in self._fields if field.key == "block"), "")
        self.query_one("#form").border_title = plain(self._heading())
        rows = [_field_row(s.key, field, _hint_text(s)) for s, field in zip(specs, self._fields, strict=True)]
        await self._rows.remove_children()
        await self._rows.mount_all(rows)
        self._check_fields()

    def _field_specs(self, project: Project) -> list[FormRow]:
        if self.kind == "udt":
            known = [each.name for each in project.udts]
            files = tuple([name for name in type_files_in(project.base) if name not in known])
            return [FormRow(FILE_KEY, "no new type file beside the project", files)]
        name = FormRow("name", "a name of its own", first=propose_name(self.kind, project, self._block))
        return [name, *fields_of(self.kind, project, self._block)]

    def _heading(self) -> str:
        return f"Add {KIND_TITLES[self.kind]}"

    @property
    def name_of_part(self) -> str:
        return self._fields[0].value.strip()

    @property
    def line(self) -> str:
        name, *others = self._fields
        return make_add(self.kind, name.value, {field.key: field.value for field in others}, self._project())

    def action_complete(self) -> None:
        """Complete the path of a type file; in any other field go to the next field."""
        field, found = self._fields[0], None
        if self.focused is field and field.key == FILE_KEY:
            found = complete(ADD_UDT + field.value, self._project())
        if found is None:
            self.focus_next()
        else:
            field.choose(found.removeprefix(ADD_UDT))

    def keep_type(self, text: str) -> str:
        """Keep a pasted type. Return the name of the file that enter writes, or "" for a bad type."""
        try:
            self._paste = prepare_pasted_type(text, self._project().base)
        except UserError as refused:
            self._check_fields(refused.lines()[0])
            return ""
        self._fields[0].clear()
        return self._paste[0].name

    def _check_fields(self, fault: str = "") -> bool:
        """Show the effect or the mistake of the line; return whether the engine would take the line."""
        line, (file, text) = self.line, self._paste
        is_empty = line == ADD_UDT and not fault
        self._is_pasted = line == f"{ADD_UDT}{file.name}"
        as_if_there = FilesRead(contents=[(os.fspath(file), text.encode())])  # enter writes the file
        with substitute_disk(as_if_there) if self._is_pasted else nullcontext():
            fault = fault or (find_mistake(line, self._project()) if line and not is_empty else "")
            effect = FILE_HINT if is_empty else "\n".join(map(plain, self._describe_line()))
        place = fault.removeprefix(f"{self.kind} {self.name_of_part}: ")
        for field in self._fields:
            field.set_class(place.startswith((f"{field.key}:", f"found '{field.key}=")), "-bad")
        self._line.update(f"✗ {plain(fault)}" if fault else effect)
        self._line.set_class(bool(fault), "-bad")
        return not fault and not is_empty

    def _describe_line(self) -> list[str]:
        made, *more = preview_edit(self.line, self._project()).split("\n")
        return [f"▸ {self.line}{made and f' · {made}'}", *more]

    async def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        if isinstance(event.input, ChoiceField) and event.input.is_attached:
            await self.handle_field_change(event.input)
            self._check_fields()

    async def handle_field_change(self, field: ChoiceField) -> None:
        """Show the fields of a new kind or a new block; typed values stay if only the block changes."""
        project = self._project()
        if field is self._kind_field:
            if field.value in kinds_of(project) and field.value != self.kind:  # not while it is half typed
                self.kind, self._given, self._block = field.value, {}, ""
                await self._lay_out()
        elif field.key == "block" and field.value != self._block and field.value in project.dialect.blocks:
            typed = {each.key: each.value for each in self._fields if each.value != each.proposed}
            self._given, self._block = {**typed, "block": field.value}, field.value
            at = field.cursor_position
            await self._lay_out()
            block = next(field for field in self._fields if field.key == "block")
            block.cursor_position = at
            self.set_focus(block)

    def submit(self) -> None:
        try:
            if self._check_fields():
                if self._is_pasted:
                    write_file(*self._paste, "paste", is_new=True)
                self.dismiss(self.line)
        except UserError as refused:
            self._check_fields(refused.lines()[0])


def _field_row(name: str, field: ChoiceField, hint: str) -> Horizontal:
    lines = wrap_text(hint, HINT_WIDTH)
    return Horizontal(
        Static(name, markup=False, classes="name"),
        field,
        Static("\n".join(lines[:HINT_ROWS]) + " …" * bool(lines[HINT_ROWS:]), markup=False, classes="hint"),
    )


def _hint_text(field: FormRow) -> str:
    return f"↑↓ {', '.join(field.choices)}" if field.choices else field.hint


class ChangeScreen(AddScreen):
    """A form that returns the command, or "" if you leave the form or have changed nothing."""

    ENTER_VERB: ClassVar = "change"

    def __init__(self, project: Callable[[], Project], part: ProjectPart) -> None:
        super().__init__(project, part.kind, {})
        self._part, self._now = part, values_of(part, project())
        self._block = format_value(self._now.get("block", ""))

    def _first_rows(self) -> Iterator[Widget]:
        yield from ()

    def _field_specs(self, project: Project) -> list[FormRow]:
        return fields_to_change(self._part, self._now, project, self._block)

    def _heading(self) -> str:
        return f"Change {self._part}"

    @property
    def name_of_part(self) -> str:
        return self._part.name

    @property
    def line(self) -> str:
        texts = {field.key: field.value for field in self._fields}
        return make_set_line(self._part, self._now, texts, self._project())

    def _describe_line(self) -> list[str]:
        line = self.line
        return [f"▸ {line}", preview_edit(line, self._project())] if line else ["no change yet"]
