"""Commands to the next scan: frozen values, applied in its phase 1 and nowhere else."""

from __future__ import annotations

from msgspec import Struct

from trcvtui.blocks.pins import PinValue
from trcvtui.net.connection.config import AddrParam, ConnectConfig, UdpConfig
from trcvtui.project.project import ComBufferDecl, DataDecl, InstanceDecl


class SetInput(Struct, frozen=True):
    """Write one input pin; the value holds until it is changed. If the pin was blinking, it stops."""

    instance: str
    pin: str
    value: PinValue


class PulseInput(Struct, frozen=True):
    """Make the pin TRUE in the next call of the instance only, and FALSE from the following call on."""

    instance: str
    pin: str


class BlinkInput(Struct, frozen=True):
    """Toggle the pin in every scan, as the manual's ST example does with REQ."""

    instance: str
    pin: str


class WriteData(Struct, frozen=True):
    """Write the bytes `payload` into the global variable `data`, from byte `offset` on."""

    data: str
    offset: int
    payload: bytes


class StopPlc(Struct, frozen=True):
    """CPU STOP: blocks are not called, connections close, STATUS 0000, outputs FALSE."""


class RunPlc(Struct, frozen=True):
    """CPU RUN makes fresh instances. Inputs and DATA keep their values."""


class CreateInstance(Struct, frozen=True):
    """Create an instance; from this scan on it is called after the older instances of its task."""

    decl: InstanceDecl
    place: int | None = None  # in the call order of all; None: the last


PartDecl = DataDecl | ConnectConfig | UdpConfig | AddrParam | ComBufferDecl


class AddDeclaration(Struct, frozen=True):
    """One more global variable, CONNECT, UDP_CONFIG, ADDR or ComBuffer; no instance uses it yet."""

    decl: PartDecl


class ReplaceDeclaration(Struct, frozen=True):
    """A new declaration of the same name. Instances that use it begin anew and keep their inputs."""

    before: PartDecl | InstanceDecl
    decl: PartDecl | InstanceDecl


class RemoveDeclaration(Struct, frozen=True):
    """Remove a declaration that no instance uses."""

    decl: PartDecl


class DeleteInstance(Struct, frozen=True):
    """Delete the instance. The instance's connection stays, and so does the lock of its running job."""

    instance: str


class DownloadInstance(Struct, frozen=True):
    """An incremental download of a changed initial value: a new instance of the same name (7.15.1, notes).

    Inputs keep the values that the program has written, so CONT=1 counts as a rising edge.
    """

    instance: str


class ResizeData(Struct, frozen=True):
    """Give a global variable another type; bytes within both sizes stay, new bytes are 0."""

    decl: DataDecl


class FeedBuffer(Struct, frozen=True):
    """Bytes arrive on the simulated line of a ComBuffer; None: the cable of this line is pulled."""

    buffer: str
    payload: bytes | None


Command = (
    SetInput
    | PulseInput
    | BlinkInput
    | WriteData
    | StopPlc
    | RunPlc
    | CreateInstance
    | AddDeclaration
    | ReplaceDeclaration
    | RemoveDeclaration
    | DeleteInstance
    | DownloadInstance
    | ResizeData
    | FeedBuffer
)
