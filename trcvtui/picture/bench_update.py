"""What the screen gets when it asks the engine: one frozen update of the bench; and what it may ask for."""

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
from trcvtui.snapshots.scenario import PlayerSnapshot, TrialSnapshot

if TYPE_CHECKING:  # the screen's process starts the engine before it knows what a project is
    from trcvtui.project.project import Project

NO_DOCTOR_SNAPSHOT, NO_TIMING = DoctorSnapshot(), EngineTiming()
MostItems = Meta(max_length=64)  # a picture is made at once: what a screen asks for is bounded


class UpdateRequest(Struct, frozen=True):
    """What the screen wants: the ledger's news after `since_seq`, the bytes of these variables and jobs.

    `waves` are the instances whose pins are drawn over time, with the number of the last change it knows.
    `bench` and `project` are the numbers of those that the screen knows, as the last picture told them.
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
    doctor: bool = False  # whether it shall look
    messages: tuple[str, int, int] | None = None  # rows of an instance, from a number on, up to a scan


MOST_NUMBER: Final = 1 << 32  # of lines of a screen
_REQUEST_DECODER: Final = Decoder(tuple[Annotated[int, Meta(ge=1, lt=MOST_NUMBER)], bytes] | UpdateRequest)


def decode_request(content: bytes) -> tuple[int, str] | UpdateRequest:
    """Return what a screen says; raise ValueError or MsgspecError. A file it names may be no text."""
    said = _REQUEST_DECODER.decode(content)
    return said if isinstance(said, UpdateRequest) else (said[0], said[1].decode(errors="surrogatepass"))


class BenchUpdate(Struct, frozen=True):
    """The bench after its last scan. `holding` is True while no scans pass.

    `bench` counts the fresh benches, `project_number` what its project has become; `project` comes only where
    the screen does not know it yet. `player` is there while a scenario is loaded, `trial` from the first
    `try-splits` on. `facts` come of the instances in `partial_of`. `armed` is the trigger that is waited for;
    with `fired` this is the picture of the very scan in which one fired, and the PLC has gone on since.
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
    trial: TrialSnapshot | None = None
    waves: tuple[WaveformDelta, ...] = ()
    history: HistoryWindow | None = None
    unsaved: int = 0  # edits of the project that are in no file
    unsaved_word: str = "addition"
    facts: tuple[tuple[str, ConnectFacts], ...] = ()
    armed: str = ""
    fired: TriggerEvent | None = None
    recorded: str = ""  # the file that the run is recorded in with its size, or why nothing is recorded
    is_recording: bool = False  # by the black box, so that `record stop` ends it
    recordings: tuple[tuple[str, LineRecording], ...] = ()  # of the ComBuffers that were asked for
    over: str = ""  # why nothing more comes from the line that is shown
    position: ReplayPosition | None = None  # of a replay in its recording
    shadows: frozenset[str] = frozenset()  # instances that look on at conversations of others
    talks: tuple[ConversationSnapshot, ...] = ()  # these conversations, the newest first
    doctor: DoctorSnapshot = NO_DOCTOR_SNAPSHOT
    messages: MessagesDelta | None = None
    begun_ns: int | None = None  # UTC of time 0, None: simulated time


UNSAVED_COMMANDS: Final = ("create ", "delete ", "resize ")  # `save project` leaves these out


def restore_commands(snapshot: Snapshot, project: Project) -> Iterator[str]:
    """Yield the lines that bring a fresh bench to where this one stood: its inputs, what TCON had built.

    A pin whose edge does something is left out: nothing is sent or reset once more.
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
