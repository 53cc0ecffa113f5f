"""The bench commands that edit the project, as frozen values: what runs has it from the next scan on."""

from __future__ import annotations

from dataclasses import dataclass, field

from trcvtui.net.connect_config import ConnectConfig
from trcvtui.net.udp_config import AddrParam, UdpConfig
from trcvtui.plc.project import ComBufferDecl, DataDecl, InstanceDecl, MessageDecl, PeerDecl, SequenceDecl
from trcvtui.plc.tls_words import CertificateDecl

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


@dataclass(frozen=True, slots=True)
class AddData:
    """`add data rx2 ARRAY[0..99] OF BYTE`: one more global variable; its bytes are 0."""

    data: str
    type_name: str
    decl: DataDecl = field(compare=False)
