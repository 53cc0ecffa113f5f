"""The bench commands as frozen values: one class for each command and each condition.

`text` is kept as written, for display and saving. Equality of commands ignores `text`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

from msgspec import Struct

from trcvtui.blocks.pins import PinValue
from trcvtui.commands.counters_and_checksums import Fill
from trcvtui.commands.patterns import TracePattern
from trcvtui.plc import commands
from trcvtui.project.project import DataDecl, Declaration, InstanceDecl
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout import Layout


@dataclass(frozen=True, slots=True)
class AddEntry:
    """`add connect C3 LocalPort=2001`, `add peer P2 remote=@C1`: a new entry of the project."""

    decl: Declaration
    with_it: tuple[Declaration, ...] = field(default=(), compare=False)  # parts created for it, before it
    text: str = field(default="", compare=False)  # the line as written, if parts are created
    port: int = field(default=0, compare=False)  # that was chosen for it; `text` ends with it


@dataclass(frozen=True, slots=True)
class AddVariable:
    """`add data rx2 ARRAY[0..99] OF BYTE`: a new global variable. Its bytes are 0."""

    data: str
    type_name: str
    decl: DataDecl = field(compare=False)


@dataclass(frozen=True, slots=True)
class Change:
    """`set connect C2 LocalPort=2500`: new values for an entry. Parts that use the entry are built anew."""

    kind: str
    name: str
    written: str  # `LocalPort=2500`
    before: Declaration = field(compare=False)
    decl: Declaration = field(compare=False)


@dataclass(frozen=True, slots=True)
class Remove:
    """`remove connect C2`: removes an entry that is not in use."""

    kind: str
    name: str
    decl: Declaration = field(compare=False)


class UndoEdit(Struct, frozen=True):
    """`undo`: takes the newest edit of the project back."""


EditCommand = AddEntry | AddVariable | Change | Remove | UndoEdit
EDIT_COMMANDS = (AddEntry, AddVariable, Change, Remove, UndoEdit)


@dataclass(frozen=True, slots=True)
class Contains:
    """`contains hex 05`: these bytes come anywhere in the stream, in one piece or in several."""

    payload: bytes
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class StartsWith:
    """`starts hex 01 02`: the connection or a scan begins with these bytes."""

    payload: bytes
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class FieldIs:
    """`field Telegram.id = 7`: a Telegram has this value. Telegrams are cut from the first byte on."""

    type_name: str
    path: str
    value: Value
    layout: Layout = field(compare=False, repr=False)


Match = Contains | StartsWith | FieldIs


NO_MARK: Final = "none"


@dataclass(frozen=True, slots=True)
class SetFrameMark:
    """`suffix RD hex 0D 0A`, `prefix RD none`. `pin` is the input for the length, or "" for a STRING."""

    instance: str
    mark: str
    payload: bytes
    data: str
    pin: str
    size: int  # of the variable
    text: str = field(default="", compare=False)

    def orders(self) -> tuple[commands.Command, ...]:
        """Return the orders for the PLC; all take effect in the same scan."""
        content = self.payload if self.pin else (self.payload + b"\0")[: self.size]
        write = (commands.WriteData(self.data, 0, content),) if content else ()
        length = (commands.SetInput(self.instance, self.pin, len(self.payload)),) if self.pin else ()
        return (*write, *length)

    def line(self) -> str:
        written = self.text or (f"hex {self.payload.hex(' ')}" if self.payload else NO_MARK)
        return f"{self.mark} {self.instance} {written}"


DEFAULT_LIMIT_NS: Final = 10_000_000_000
DEFAULT_CHECK_NS: Final = 100_000_000
DEFAULT_CHECK_SIZE: Final = 64
TIMES_FOREVER: Final = 0  # FaultOn.times
PEER_STATES: Final = ("connected", "listening", "closed", "reset", "refused")


class SetInputs(Struct, frozen=True):
    """`set TRCV_C_1 CONT=1 EN_R=1 REQ=blink`: write inputs."""

    instance: str
    pins: tuple[tuple[str, PinValue | Literal["blink"]], ...]


class PulsePin(Struct, frozen=True):
    """`pulse TSEND_C_1 REQ`: TRUE for one call, then FALSE."""

    instance: str
    pin: str


@dataclass(frozen=True, slots=True)
class WriteBytes:
    """`write rx hex 01 02`, `write rx+4 hex 03`, `write rx.speed 12.5`: write bytes of a DATA variable."""

    data: str
    offset: int
    payload: bytes
    text: str = field(default="", compare=False)


class CreateBlock(Struct, frozen=True):
    """`create TRCV_C TRCV_C_2 connect=C1 data=rx EN_R=1`: a new instance."""

    decl: InstanceDecl


class DeleteBlock(Struct, frozen=True):
    """`delete TRCV_C_1`: removes the instance, but not its connection or the lock of a running job."""

    instance: str


class DownloadBlock(Struct, frozen=True):
    """`download TRCV_C_1`: incremental download of a changed initial value. The instance is made anew."""

    instance: str


@dataclass(frozen=True, slots=True)
class Retype:
    """`resize rx ARRAY[0..9] OF BYTE`: another type for a DATA variable, while the program runs."""

    data: str
    type_name: str
    decl: DataDecl = field(compare=False)


class PlcStop(Struct, frozen=True):
    """`plc stop`: CPU STOP."""


class PlcRun(Struct, frozen=True):
    """`plc run`: CPU RUN."""


class PeerAction(Struct, frozen=True):
    """`peer P1 connect`: a verb without arguments, see `SIMPLE_VERBS` in commands/peer.py."""

    peer: str
    verb: str


@dataclass(frozen=True, slots=True)
class PeerSend:
    """`peer P1 send hex 01 02 split=1 gap=T#20ms repeat=10 every=T#50ms`.

    `split` has the sizes of the first chunks, in bytes. Times are in ns; 0 means at once. `text` is the
    payload as written. If the pauses after the chunks differ, `gaps_ns` lists them. The last pause,
    `gap_ns`, is used for all further chunks. Each message gets new values of `fills`.
    """

    peer: str
    payload: bytes
    split: tuple[int, ...] = ()
    gap_ns: int = 0
    repeat: int = 1
    every_ns: int = 0
    text: str = field(default="", compare=False)
    gaps_ns: tuple[int, ...] = ()
    fills: tuple[Fill, ...] = ()


@dataclass(frozen=True, slots=True)
class PeerPlaySequence:
    """`peer P1 play start_up`: the messages of a sequence, each with the pause before it in ns."""

    peer: str
    name: str
    steps: tuple[tuple[int, PeerSend], ...] = field(default=(), compare=False)


class NumberedFramesOn(Struct, frozen=True):
    """`peer P1 check on size=64 every=T#100ms on TRCV_C_1`: numbered frames, checked where they arrive."""

    peer: str
    size: int = DEFAULT_CHECK_SIZE
    every_ns: int = DEFAULT_CHECK_NS
    instance: str = ""


class NumberedFramesOff(Struct, frozen=True):
    """`peer P1 check off`: no more frames."""

    peer: str


class AddReply(Struct, frozen=True):
    """`peer P1 reply on contains hex 05 send hex 06`: one more rule by which a peer answers."""

    peer: str
    match: Match
    send: PeerSend


class RemoveReplies(Struct, frozen=True):
    """`peer P1 reply off` removes all rules, with `number` 0. `reply off 2` removes rule 2."""

    peer: str
    number: int = 0


@dataclass(frozen=True, slots=True)
class TrySplits:
    """`peer P1 try-splits hex 01 02 03 on TRCV_C_1`: the message whole, then in two chunks for each cut.

    A `gap_ns` of 0 means three intervals of the fastest task. `differ` is the expected number of splits
    with another result than the whole message, or None for any number.
    """

    peer: str
    payload: bytes
    instance: str
    gap_ns: int = 0
    differ: int | None = 0
    text: str = field(default="", compare=False)


class StopTrySplits(Struct, frozen=True):
    """`peer P1 try-splits stop`: ends the running trial, or closes the table of the last trial."""

    peer: str


@dataclass(frozen=True, slots=True)
class FeedSerial:
    """`feed RX hex 01 02`: bytes arrive on a ComBuffer's simulated line. `feed RX break` cuts the line."""

    buffer: str
    payload: bytes | None
    text: str = field(default="", compare=False)


class SetLink(Struct, frozen=True):
    """`link C1 down` silences the wire, without FIN or RST. `link C1 up` ends this silence."""

    connect: str
    up: bool


class TapAct(Struct, frozen=True):
    """`tap T to-plc edit 3 hex 0A conversation 2`: a tap acts on the bytes of one direction.

    `sizes` are for drop, edit (offset), delay (ns) or split (pieces). `conversation` 0 is the newest.
    """

    tap: str
    to_plc: bool
    verb: str
    sizes: tuple[int, ...] = ()
    payload: bytes = b""
    text: str = ""
    conversation: int = 0


class AskDoctor(Struct, frozen=True):
    """`doctor TRCV_C_1 frame-short`: what is wrong with an instance or a CONNECT. A `name` of "" means all.

    `cause` is the expected first finding or `healthy`. If `cause` is "", any result will do.
    """

    name: str = ""
    cause: str = ""


class FaultOn(Struct, frozen=True):
    """`fault bind EADDRINUSE on C1 nth=1 times=1`: a kernel call fails.

    `error` None: the call's usual error. `on` None: any CONNECT. `times` 0: until the fault is cleared.
    """

    call: str
    error: str | None = None
    on: str | None = None
    nth: int = 1
    times: int = 1


class FaultClear(Struct, frozen=True):
    """`fault clear`: forget all faults."""


class RunScans(Struct, frozen=True):
    """`run 5`: let scans of the fastest task pass."""

    scans: int


class RunFor(Struct, frozen=True):
    """`run T#200ms`: let the scans pass that fit into this time (in ns)."""

    ns: int


class PinsAre(Struct, frozen=True):
    """`TRCV_C_1 STATUS=7008 DONE=1`: these inputs and outputs have these values."""

    instance: str
    pins: tuple[tuple[str, PinValue], ...]


class PeerIs(Struct, frozen=True):
    """`peer P1 connected`: the peer is in this state, see `Peer.is_in`."""

    peer: str
    state: str


@dataclass(frozen=True, slots=True)
class PeerHasReceived:
    """`peer P1 received hex 01 02`, `peer P1 received nothing`: see `Peer.has_received`."""

    peer: str
    payload: bytes
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class DataIs:
    """`rx hex 01 02` or `rx+4 hex 01`: the variable holds these bytes from `offset` on."""

    data: str
    offset: int
    payload: bytes
    text: str = field(default="", compare=False)


class MemberIs(Struct, frozen=True):
    """`rx.speed 12.5`: the member at `path` (empty: the variable itself) decodes to `value`."""

    data: str
    path: str
    value: Value


Condition = PinsAre | PeerIs | PeerHasReceived | DataIs | MemberIs


class Wait(Struct, frozen=True):
    """`wait TRCV_C_1 STATUS=7004 within T#2s`: let scans pass until the condition holds, at most 2 s."""

    condition: Condition
    within_ns: int = DEFAULT_LIMIT_NS


class Expect(Struct, frozen=True):
    """`expect ...`: the condition holds now, or within a time in ns."""

    condition: Condition
    within_ns: int | None = None


class ExpectTrace(Struct, frozen=True):
    """`expect TRCV_C_1 trace 0001 7001 7002+`: the STATUS per scan since the previous trace."""

    instance: str
    pattern: TracePattern


BenchCommand = (
    SetInputs | PulsePin | WriteBytes | CreateBlock | DeleteBlock | EditCommand | DownloadBlock | Retype
    | PlcStop | PlcRun | PeerAction | PeerSend | PeerPlaySequence | NumberedFramesOn | NumberedFramesOff
    | AddReply | RemoveReplies | TrySplits | StopTrySplits | FeedSerial | SetFrameMark | SetLink | TapAct
    | AskDoctor | FaultOn | FaultClear | RunScans | RunFor | Wait | Expect | ExpectTrace
)  # fmt: skip


class Step(Struct, frozen=True):
    """One command of a script: its number from 1, its line, and the command."""

    number: int
    line: str
    command: BenchCommand
