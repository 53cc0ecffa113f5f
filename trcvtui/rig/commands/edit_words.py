"""The bench commands that edit the project, as frozen values: what runs has it from the next scan on."""

from __future__ import annotations

from dataclasses import dataclass, field

from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.udp_config import AddrParam, UdpConfig
from trcvtui.project.project import (
    ComBufferDecl,
    DataDecl,
    Declaration,
    Edits,
    InstanceDecl,
    MessageDecl,
    PeerDecl,
    SequenceDecl,
)
from trcvtui.project.tls_words import CertificateDecl

AddedDecl = (
    ConnectConfig
    | UdpConfig
    | AddrParam
    | ComBufferDecl
    | InstanceDecl
    | PeerDecl
    | MessageDecl
    | SequenceDecl
    | CertificateDecl
)


@dataclass(frozen=True, slots=True)
class Add:
    """`add connect C3 LocalPort=2001`, `add peer P2 remote=@C1`: one more entry of the project."""

    decl: AddedDecl
    with_it: tuple[Declaration, ...] = field(default=(), compare=False)  # made before it, on the way
    text: str = field(default="", compare=False)  # as it was written, where more is made on the way
    port: int = field(default=0, compare=False)  # that was chosen for it; it stands at the end of `text`


@dataclass(frozen=True, slots=True)
class AddData:
    """`add data rx2 ARRAY[0..99] OF BYTE`: one more global variable; its bytes are 0."""

    data: str
    type_name: str
    decl: DataDecl = field(compare=False)


@dataclass(frozen=True, slots=True)
class Change:
    """`set connect C2 LocalPort=2500`: other keys of an entry; what runs on it is built anew."""

    kind: str
    name: str
    written: str  # `LocalPort=2500`
    before: Declaration = field(compare=False)
    decl: Declaration = field(compare=False)


@dataclass(frozen=True, slots=True)
class Remove:
    """`remove connect C2`: an entry that nobody uses is there no more."""

    kind: str
    name: str
    decl: Declaration = field(compare=False)


@dataclass(frozen=True, slots=True)
class Undo:
    """`undo`: the newest edit of the project is taken back."""

    edits: Edits = field(compare=False)


Mend = Add | AddData | Change | Remove | Undo
MENDS = (Add, AddData, Change, Remove, Undo)
