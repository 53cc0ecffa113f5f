"""What a dialect is: a name, an answered questionnaire, a STATUS table, and the layout of its UDTs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.rules import Rules
from trcvtui.blocks.status import StatusRow

SwitchValue = str | int | bool


@dataclass(frozen=True, slots=True)
class Switch:
    """One point that the manual leaves open. `kind` is choice, bool, duration (ns) or count.

    `values` are the words of a choice; `least` and `most` bound a count. `text` says what it decides.
    """

    name: str
    kind: str
    default: SwitchValue
    text: str
    values: tuple[str, ...] = ()
    least: int = 0
    most: int = 1_000_000


# Every vendor's listeners have a queue. Linux cuts one that is longer than net.core.somaxconn without a word.
BACKLOG: Final = Switch(
    "backlog",
    "count",
    128,
    "clients that wait at a listener; who comes when it is full gets no answer, and tries again by himself",
    least=1,
    most=4096,
)


def codes_of(rows: Iterable[StatusRow]) -> dict[str, dict[Condition, int]]:
    """Return what each block shows for each condition, as the rows say."""
    codes: dict[str, dict[Condition, int]] = {}
    for row in rows:
        for block in row.blocks:
            codes.setdefault(block, {}).update(dict.fromkeys(row.conditions, row.code))
    return codes


@dataclass(frozen=True, slots=True)
class Dialect:
    """One vendor's blocks. `models` maps a PLC model to its connection budget; the first is the default.

    `describes_connects`: a CONNECT is a connection description (TCON_IP_v4, ...), no TCP_CONNECTCONFIG.
    `structures`: the connection descriptions that it takes, () all of them.
    `types`: in ST, those that its library brings along.
    `folder`: where its scenarios lie, when that has another name.
    `follows`: the document that its course stands in, where dialects with one table differ in that.
    `words`: what it calls a condition whose neutral word is another vendor's.
    """

    name: str
    title: str
    blocks: tuple[str, ...]
    status: tuple[StatusRow, ...]
    switches: tuple[Switch, ...]
    models: Mapping[str, int]
    default_model: str
    layout: str
    answer: Callable[[Mapping[str, SwitchValue]], Rules]
    describes_connects: bool = False
    structures: tuple[str, ...] = ()
    folder: str = ""
    types: str = ""
    follows: str = ""
    words: Mapping[str, str] = field(default_factory=dict)

    def label(self, condition: str) -> str:
        """Return a condition in two or three words, in a column beside its code."""
        return self.words.get(condition, condition)

    @property
    def shelf(self) -> str:
        """Return the folder of its scenarios."""
        return self.folder or self.name

    def row(self, code: int, block: str | None = None) -> StatusRow | None:
        """Return the row of a code, for one block or for any."""
        return next((r for r in self.status if r.code == code and (block is None or block in r.blocks)), None)

    def row_of(self, condition: Condition) -> StatusRow | None:
        """Return the row that shows a condition."""
        return next((r for r in self.status if condition in r.conditions), None)
