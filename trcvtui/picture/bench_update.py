"""The screen's request to the engine, and the answer: a picture, one frozen update of the bench."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Final

from msgspec import Meta, Struct
from msgspec.msgpack import Decoder

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.serial.com_buffer import LineRecording
from trcvtui.blocks.table import block_row
from trcvtui.history.messages import MessagesDelta
from trcvtui.history.pin_waveform import WaveformDelta
from trcvtui.history.records import ConnectFacts, HistoryRequest, HistoryWindow
from trcvtui.net.connection.connection import State
from trcvtui.plc.ledger import Line
from trcvtui.plc.snapshot import Snapshot
from trcvtui.snapshots.bench import EngineTiming, LineAnswer, PeerSnapshot, TriggerEvent
from trcvtui.snapshots.conversations import ConversationSnapshot
from trcvtui.snapshots.doctor import DoctorSnapshot
from trcvtui.snapshots.replay import ReplayPosition
from trcvtui.snapshots.scenario import PlayerSnapshot, SplitTestSnapshot

if TYPE_CHECKING:  # the screen's process starts the engine before it knows what a project is
    from trcvtui.project.project import Project

NO_DOCTOR_SNAPSHOT, NO_TIMING = DoctorSnapshot(), EngineTiming()
MostItems = Meta(max_length=64)  # a request is bounded, so that a picture costs the scans little


class UpdateRequest(Struct, frozen=True):
    """A request for the ledger lines after `since_seq`, and for what the other fields name.

    `waves` has each instance whose pins are drawn, with the number of its last change on the screen.
    `bench` and `project` are the numbers in the last picture. If `bench` is old, `since_seq` counts as 0.
    """

    since_seq: int = 0
    data: Annotated[tuple[str, ...], MostItems] = ()
    partial_of: Annotated[tuple[str, ...], MostItems] = ()
    most_lines: Annotated[int, Meta(le=20_000)] = 2000
    bench: int = 0
    project: int = 0
    waves: Annotated[tuple[tuple[str, int], ...], MostItems] = ()
    history: HistoryRequest | None = None
    recordings_of: Annotated[tuple[str, ...], MostItems] = ()  # ComBuffers
    doctor: bool = False  # the doctor shall look
    messages: tuple[str, int, int] | None = None  # rows of an instance, from a number on, up to a scan


MOST_NUMBER: Final = 1 << 32  # of the command lines of a screen
_REQUEST_DECODER: Final = Decoder(tuple[Annotated[int, Meta(ge=1, lt=MOST_NUMBER)], bytes] | UpdateRequest)


def decode_request(content: bytes) -> tuple[int, str] | UpdateRequest:
    """Return a screen's numbered command line or request. Raise ValueError or MsgspecError."""
    found = _REQUEST_DECODER.decode(content)
    if isinstance(found, UpdateRequest):
        return found
    return found[0], found[1].decode(errors="surrogatepass")  # a file name in a line may be no valid text


class BenchUpdate(Struct, frozen=True):
    """The bench after its last scan. `holding` means that the scans are held.

    `bench` is the number of the bench, `project_number` that of the project's version. `project` comes only
    if the screen does not have this version. `player` is None without a scenario, `trial` before the first
    `try-splits`. `facts` are about the instances in the request's `partial_of`. `armed` is the waiting
    trigger. With `fired` the picture shows the scan in which a trigger fired, even if later scans have run.
    """

    snapshot: Snapshot
    peers: tuple[PeerSnapshot, ...]
    kernel: str
    lines: tuple[Line, ...] = ()
    lines_skipped: int = 0
    data: tuple[tuple[str, bytes], ...] = ()
    partial: tuple[tuple[str, bytes], ...] = ()
    answers: tuple[LineAnswer, ...] = ()
    timing: EngineTiming = NO_TIMING
    holding: bool = False
    bench: int = 0
    project_number: int = 0
    project: Project | None = None
    player: PlayerSnapshot | None = None
    trial: SplitTestSnapshot | None = None
    waves: tuple[WaveformDelta, ...] = ()
    history: HistoryWindow | None = None
    unsaved: int = 0  # edits of the project that are not saved
    unsaved_word: str = "addition"
    facts: tuple[tuple[str, ConnectFacts], ...] = ()
    armed: str = ""
    fired: TriggerEvent | None = None
    recorded: str = ""  # the recording's file with its size, or why nothing is recorded
    is_recording: bool = False  # by the black box, so that `record stop` ends it
    recordings: tuple[tuple[str, LineRecording], ...] = ()  # of the ComBuffers in `recordings_of`
    over: str = ""  # why the line on the screen brings nothing more
    position: ReplayPosition | None = None  # of a replay
    shadows: frozenset[str] = frozenset()  # instances that follow a conversation of other programs
    talks: tuple[ConversationSnapshot, ...] = ()  # these conversations, the newest first
    doctor: DoctorSnapshot = NO_DOCTOR_SNAPSHOT
    messages: MessagesDelta | None = None
    begun_ns: int | None = None  # UTC of time 0, None: simulated time


UNSAVED_COMMANDS: Final = ("create ", "delete ", "resize ")  # `save project` leaves these out


def restoring_commands(snapshot: Snapshot, project: Project) -> Iterator[str]:
    """Yield the bench commands that restore inputs and TCON connections on a new bench.

    Pins that act on a rising edge are left out: nothing is sent or reset again.
    """
    for instance in snapshot.instances:
        levels = {pin.name for pin in project.pins(instance.block) if not pin.edge}
        pins = [f"{name}={int(value)}" for name, value in instance.inputs if name in levels]
        if pins:
            yield f"set {instance.name} {' '.join(pins)}"
        link = snapshot.connection(instance.connect)
        builds = block_row(instance.block).runs_as is Condition.ESTABLISHING
        if builds and link is not None and link.state != State.CLOSED:
            yield f"pulse {instance.name} REQ"
