"""Commands to the next scan: frozen values, applied in its phase 1 and nowhere else."""

from __future__ import annotations

from msgspec import Struct

from trcvtui.blocks.pins import PinValue
from trcvtui.net.connection.config import AddrParam, ConnectConfig, UdpConfig
from trcvtui.project.project import ComBufferDecl, DataDecl, InstanceDecl


class SetInput(Struct, frozen=True):
    """Write one input pin; it holds until changed. Ends a blink of that pin."""

    instance: str
    pin: str
    value: PinValue


class PulseInput(Struct, frozen=True):
    """TRUE in exactly the next scan in which the instance is called, FALSE from the one after."""

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
    """CPU RUN: fresh instances; inputs and DATA keep their values."""


class CreateInstance(Struct, frozen=True):
    """A new instance: it is called from this scan on, after the older instances of its task."""

    decl: InstanceDecl
    place: int | None = None  # in the call order of all; None: the last


PartDecl = DataDecl | ConnectConfig | UdpConfig | AddrParam | ComBufferDecl


class AddDeclaration(Struct, frozen=True):
    """One more global variable, CONNECT, UDP_CONFIG, ADDR or ComBuffer; no instance uses it yet."""

    decl: PartDecl


class ReplaceDeclaration(Struct, frozen=True):
    """Another declaration of the same name: every instance that uses it begins anew; inputs stay."""

    before: PartDecl | InstanceDecl
    decl: PartDecl | InstanceDecl


class RemoveDeclaration(Struct, frozen=True):
    """Remove a declaration that no instance uses."""

    decl: PartDecl


class DeleteInstance(Struct, frozen=True):
    """The instance is gone; its connection stays, and so does the lock of a job that runs."""

    instance: str


class DownloadInstance(Struct, frozen=True):
    """Incremental download of a changed initial value: a new instance of the same name (7.15.1, notes).

    Its inputs keep what the program writes to them, so CONT=1 counts as rising.
    """

    instance: str


class ResizeData(Struct, frozen=True):
    """Another type for a global variable; bytes that both sizes have stay, new ones are 0."""

    decl: DataDecl


class FeedBuffer(Struct, frozen=True):
    """Bytes arrive on the simulated line of a ComBuffer; None: its cable is pulled."""

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
