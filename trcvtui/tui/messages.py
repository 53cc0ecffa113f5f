"""Messages between the widgets of the screen: selections and requests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from textual.message import Message

from trcvtui.history.messages import MessageRow
from trcvtui.plc.ledger import Line

if TYPE_CHECKING:
    from trcvtui.fleet.fleet_list import Entry


class ScreenCallbacks(NamedTuple):
    """What a pane may do: send a bench command line, open the prompt with lines, show an error."""

    submit: Callable[[str], None]
    open_prompt: Callable[..., None]
    complain: Callable[[str], None]


class PeerSelected(Message):
    """Another peer was selected in the view model: composer and buttons now act on this peer."""


@dataclass
class ByteSelected(Message):
    """The cursor of a hex view moved to the byte at `offset` of the job (`of_job`) or of DATA."""

    offset: int
    of_job: bool


class PastCursorMoved(Message):
    """The cursor moved to another byte or message of the past."""


@dataclass
class MessageChosen(Message):
    """A row of the table of messages was chosen. If `row` is None, the table follows the newest message."""

    row: MessageRow | None


@dataclass
class FieldSelected(Message):
    """A row of the UDT table was chosen. `field` is the range of its member's bytes."""

    field: range


@dataclass
class CurveWanted(Message):
    """Request to draw the member with this path over time."""

    path: str


@dataclass
class EdgeSelected(Message):
    """A STATUS edge of the past was chosen, in the history or in the timing pane; None means now."""

    seq: int | None
    line: Line | None = None


@dataclass
class KeyClicked(Message):
    """A key named on the screen was clicked: run its action."""

    action: str


class ButtonPointed(Message):
    """Another button, or none, is under the cursor or the mouse."""


class ScenarioChosen(Message):
    """Another scenario file was chosen in the list: show its text."""


class LabRowSelected(Message):
    """Another row of the lab's tree was chosen: show its bytes."""


@dataclass
class ProfileChosen(Message):
    """Request to take the profile with this number in the ranking as the sender's profile."""

    number: int


@dataclass
class FleetEntryOpened(Message):
    """A row of the fleet's list was opened: a line, or the head of a group."""

    entry: Entry
