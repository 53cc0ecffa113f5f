"""A form for a part of the project: its keys of now, and the `set` that changes some of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import ClassVar

from textual.widget import Widget

from trcvtui.project.project import Project
from trcvtui.tui.forms.add_described import AddField
from trcvtui.tui.forms.add_screen import AddScreen
from trcvtui.tui.forms.change_fields import Part, fields_to_change, set_line, text_of, values_of
from trcvtui.tui.view_model.validity import said_before


class ChangeScreen(AddScreen):
    """Ends with the command, "" when it is left, or when nothing was changed."""

    TAKES: ClassVar = "change"

    def __init__(self, project: Callable[[], Project], part: Part) -> None:
        super().__init__(project, part.kind, {})
        self._part, self._now = part, values_of(part, project())
        self._block = text_of(self._now.get("block", ""))

    def _first_rows(self) -> Iterator[Widget]:
        yield from ()

    def _specs(self, project: Project) -> list[AddField]:
        return fields_to_change(self._part, self._now, project, self._block)

    def _heading(self) -> str:
        return f"Change {self._part}"

    @property
    def name_of_part(self) -> str:
        """Return the name, which stays."""
        return self._part.name

    @property
    def line(self) -> str:
        """Return the command that the fields make, "" while all of them are as they were."""
        texts = {field.key: field.value for field in self._fields}
        return set_line(self._part, self._now, texts, self._project())

    def _said(self) -> list[str]:
        """Return the command, and below it what it changes and who begins anew."""
        line = self.line
        return [f"▸ {line}", said_before(line, self._project())] if line else ["nothing is changed yet"]
