"""The fields of a new CONNECT where it is a connection description: those of the usual structures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from trcvtui.project.edit import names_of, structures_of
from trcvtui.project.project import Project

BOOLS: Final = ("false", "true")


@dataclass(frozen=True, slots=True)
class AddField:
    """One field: its key, what may stand there, what stands there first."""

    key: str
    hint: str
    choices: tuple[str, ...] = ()
    first: str = ""


def connect_fields(project: Project) -> Sequence[AddField]:
    """Return what most descriptions need; the line `add connect` takes every field of every structure."""
    ends = tuple(f"@{name}" for kind in ("peer", "connect") for name in names_of(kind, project))
    numbers = tuple(map(str, project.certificates))
    older = project.dialect.structures == ("TCON_Param",)
    taken = structures_of(project)
    first = [
        AddField("type", "none: plain TCP in what it takes", taken),
        AddField("bytes", "hex of the DB in place of the fields"),
        AddField("LocalAddress", "of the bench, for InterfaceId", first="127.0.0.1"),
        AddField("ListenPort", "of the bench, 0: a free one"),
    ]
    if older:
        return [*first, *_param(ends)]
    return [
        *first,
        AddField("ID", "1 to 4095"),
        AddField("ConnectionType", "11 TCP, 12 ISO, 13 by name, 19 UDP"),
        AddField("ActiveEstablished", "true: the PLC connects", BOOLS),
        AddField("RemoteAddress", "0.0.0.0: anybody"),
        AddField("RemoteQDN", "TCON_QDN: a name with a dot at its end"),
        AddField("RemotePort", "a port, or @NAME", ends),
        AddField("LocalPort", "passive: 1 to 49151"),
        AddField("LocalTSelector", "TCON_IP_RFC: 16#E002, E0.02 or TCP-1"),
        AddField("RemoteTSelector", "that of the partner"),
        AddField("IsoPort", "of the bench, in place of 102", ends),
        AddField("ActivateSecureConn", "SEC: true is TLS", BOOLS),
        AddField("TLSServerCertRef", "the number of a certificate", numbers),
        AddField("TLSClientCertRef", "the number of a certificate", numbers),
    ]


def _param(ends: tuple[str, ...]) -> list[AddField]:
    return [
        AddField("ActiveEstablished", "no type: true, the PLC connects", BOOLS, "false"),
        AddField("RemoteAddress", "no type: 0.0.0.0, anybody"),
        AddField("RemotePort", "no type: a port, or @NAME", ends),
        AddField("LocalPort", "no type: 0, a free one"),
        AddField("id", "TCON_Param: 1 to 4095"),
        AddField("connection_type", "TCON_Param: 17 TCP, 18 ISO, 19 UDP"),
        AddField("active_est", "TCON_Param: true, the PLC connects", BOOLS),
        AddField("rem_staddr", "TCON_Param: 4 bytes of the address"),
        AddField("local_tsap_id", "TCON_Param: port or TSAP in hex"),
        AddField("rem_tsap_id", "TCON_Param: port or TSAP in hex"),
    ]
