"""The vocabulary of the screen: what a widget asks for, and what it says was chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from textual.message import Message

from trcvtui.history.messages import MessageRow
from trcvtui.plc.ledger import Line

if TYPE_CHECKING:
    from trcvtui.fleet.fleet_list import Entry


class PaneActions(NamedTuple):
    """Send a bench command line; open the prompt with one, or with several; say what is missing."""

    submit: Callable[[str], None]
    open_prompt: Callable[..., None]
    complain: Callable[[str], None]


class PeerSelected(Message):
    """Another peer was selected in the view_model: composer and buttons speak for it."""


@dataclass
class ByteSelected(Message):
    """The cursor of a hex view went to the byte at `offset`; `of_job` tells the job's bytes from DATA."""

    offset: int
    of_job: bool


class PastSelected(Message):
    """The cursor of the history went to another byte."""


@dataclass
class MessageChosen(Message):
    """A row of the table of messages was chosen; None: the newest is followed."""

    row: MessageRow | None


@dataclass
class FieldSelected(Message):
    """A row of the UDT table was chosen: its bytes."""

    field: range


@dataclass
class CurveWanted(Message):
    """The member of this path shall be drawn over time."""

    path: str


@dataclass
class EdgeSelected(Message):
    """A STATUS edge of the past was chosen, in the history or over time; None: back to now."""

    seq: int | None
    line: Line | None = None


@dataclass
class KeyClicked(Message):
    """A key named on the screen was clicked: its action shall be carried out."""

    action: str


class ButtonPointed(Message):
    """Another button is under the cursor or the mouse, or none is any more."""


class ScenarioChosen(Message):
    """Another scenario file was chosen in the list: its text shall be shown."""


class RowSelected(Message):
    """Another row of the lab's tree was chosen: its bytes."""


@dataclass
class FitWanted(Message):
    """A profile of the ranking shall be theirs."""

    number: int


@dataclass
class FleetEntryOpened(Message):
    """A row of the fleet's list was opened: a line, or the head of a group."""

    entry: Entry
