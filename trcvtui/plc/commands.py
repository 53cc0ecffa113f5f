"""What is asked of the next scan: frozen values, applied in phase 1 and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.blocks.pins import PinValue
from trcvtui.net.connection.config import AddrParam, ConnectConfig, UdpConfig
from trcvtui.project.project import ComBufferDecl, DataDecl, InstanceDecl


@dataclass(frozen=True, slots=True)
class SetInput:
    """Write one input pin; it holds until changed. Ends a blink of that pin."""

    instance: str
    pin: str
    value: PinValue


@dataclass(frozen=True, slots=True)
class PulseInput:
    """TRUE in exactly the next scan in which the instance is called, FALSE from the one after."""

    instance: str
    pin: str


@dataclass(frozen=True, slots=True)
class BlinkInput:
    """Toggle the pin in every scan, as the manual's ST example does with REQ."""

    instance: str
    pin: str


@dataclass(frozen=True, slots=True)
class WriteData:
    """Overwrite `payload` bytes of the global variable `data` from byte `offset`."""

    data: str
    offset: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class StopPlc:
    """CPU STOP: blocks are not called, connections close, STATUS 0000, outputs FALSE."""


@dataclass(frozen=True, slots=True)
class RunPlc:
    """CPU RUN: fresh instances; inputs and DATA keep their values."""


@dataclass(frozen=True, slots=True)
class CreateInstance:
    """A new instance: it is called from this scan on, after those of its task that are there already."""

    decl: InstanceDecl
    place: int | None = None  # in the call order of all; None: the last


Part = DataDecl | ConnectConfig | UdpConfig | AddrParam | ComBufferDecl


@dataclass(frozen=True, slots=True)
class AddDeclaration:
    """One more global variable, CONNECT, UDP_CONFIG, ADDR or ComBuffer; no instance has it yet."""

    decl: Part


@dataclass(frozen=True, slots=True)
class ReplaceDeclaration:
    """Another declaration of the same name: what has it, or is called on it, begins anew; inputs stay."""

    before: Part | InstanceDecl
    decl: Part | InstanceDecl


@dataclass(frozen=True, slots=True)
class RemoveDeclaration:
    """A declaration is gone that no instance has."""

    decl: Part


@dataclass(frozen=True, slots=True)
class DeleteInstance:
    """The instance is gone; its connection stays, and so does the lock of a job that runs."""

    instance: str


@dataclass(frozen=True, slots=True)
class DownloadInstance:
    """Incremental download of a changed initial value: a new instance of the same name (7.15.1, notes).

    Its inputs keep what the program writes to them, so CONT=1 counts as rising.
    """

    instance: str


@dataclass(frozen=True, slots=True)
class ResizeData:
    """Another type for a global variable; bytes that both sizes have stay, new ones are 0."""

    decl: DataDecl


@dataclass(frozen=True, slots=True)
class FeedBuffer:
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
