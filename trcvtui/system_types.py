"""System data types of Siemens, one row a field: for `udt`, and for the bytes of a CONNECT (STEP 7 help).

Rule: names and offsets stand here alone. Where no page shows the offsets, `is_verified` is False.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple

LONGEST_SELECTOR: Final = 32
LONGEST_NAME: Final = 254
SELECTOR_SIZE: Final = 2 + LONGEST_SELECTOR
NAME_SIZE: Final = 2 + LONGEST_NAME


class FieldType(StrEnum):
    NUMBER = "UINT"
    TRUTH = "BOOL"
    ADDRESS = "IP_V4"
    SELECTOR = "TSelector"  # UINT length and 32 bytes
    NAME = "STRING[254]"
    BYTES = "ARRAY OF BYTE"


class DescriptionField(NamedTuple):
    """One field of a structure; offset and size in bytes. `data_type` is what STEP 7 calls its type."""

    name: str
    offset: int
    type: FieldType
    size: int
    data_type: str


class Structure(NamedTuple):
    """One system type; `size` in bytes, of which the last `spare` may be missing.

    The first fields may be those of the structure `head`, which are one member, ConnPara, in STEP 7.
    """

    name: str
    size: int
    fields: tuple[DescriptionField, ...]
    spare: int = 0
    head: str = ""
    is_verified: bool = True

    def field(self, name: str) -> DescriptionField | None:
        return next((field for field in self.fields if field.name == name), None)


NUMBER, TRUTH, BYTES = FieldType.NUMBER, FieldType.TRUTH, FieldType.BYTES

# Numbers of 16 bits that stand for something of the CPU.
HANDLES: Final = (
    *("HW_ANY", "HW_IO", "HW_DEVICE", "HW_SUBMODULE", "HW_INTERFACE", "CONN_OUC", "PORT"),
    *("DB_ANY", "OB_ANY", "EVENT_ANY"),
)
UNSURE_HANDLES: Final = ("EVENT_ANY",)  # elsewhere it is taken for a DWORD
ENUMERATIONS: Final = {
    "TDiag_State": {"Down": 1, "ActiveTrying": 2, "PassiveWaiting": 3, "Established": 4, "Closing": 5},
    "TDiag_Kind": {"Configured": 1, "Programmed": 3},
}
_TYPES: Final = {
    **dict.fromkeys(("UINT", "WORD", *HANDLES), (NUMBER, 2)),
    **dict.fromkeys(("BYTE", "USINT", *ENUMERATIONS), (NUMBER, 1)),
    "UDINT": (NUMBER, 4),
    "BOOL": (TRUTH, 1),
    "IP_V4": (FieldType.ADDRESS, 4),
    "ARRAY[1..4] OF USINT": (FieldType.ADDRESS, 4),
    "TSelector": (FieldType.SELECTOR, SELECTOR_SIZE),
    "STRING[254]": (FieldType.NAME, NAME_SIZE),
    "ARRAY[1..4] OF BYTE": (BYTES, 4),
    "ARRAY[1..6] OF BYTE": (BYTES, 6),
    "ARRAY[1..6] OF USINT": (BYTES, 6),
    "ARRAY[1..16] OF BYTE": (BYTES, 16),
    "ARRAY[1..32] OF BYTE": (BYTES, LONGEST_SELECTOR),
}


def _fields(*rows: tuple[int, str, str]) -> tuple[DescriptionField, ...]:
    """Return fields of offset, name and type."""
    return tuple([DescriptionField(name, at, *_TYPES[type_], type_) for at, name, type_ in rows])


_HEAD: Final = _fields((0, "InterfaceId", "HW_ANY"), (2, "ID", "CONN_OUC"), (4, "ConnectionType", "BYTE"))
_OPEN: Final = (*_HEAD, *_fields((5, "ActiveEstablished", "BOOL")))
_IP_V4: Final = (
    *_OPEN,
    *_fields((6, "RemoteAddress", "IP_V4"), (10, "RemotePort", "UINT"), (12, "LocalPort", "UINT")),
)
_QDN: Final = (
    *_OPEN,
    *_fields((6, "RemoteQDN", "STRING[254]"), (262, "RemotePort", "UINT"), (264, "LocalPort", "UINT")),
)


def _secure(at: int) -> tuple[DescriptionField, ...]:
    return _fields(
        (at, "ActivateSecureConn", "BOOL"),
        (at + 1, "TLSServerReqClientCert", "BOOL"),
        (at + 2, "ExtTLSCapabilities", "WORD"),
        (at + 4, "TLSServerCertRef", "UDINT"),
        (at + 8, "TLSClientCertRef", "UDINT"),
    )


_PARAM: Final = _fields(
    (0, "block_length", "UINT"),
    (2, "id", "CONN_OUC"),
    (4, "connection_type", "USINT"),
    (5, "active_est", "BOOL"),
    (6, "local_device_id", "USINT"),
    (7, "local_tsap_id_len", "USINT"),
    (8, "rem_subnet_id_len", "USINT"),
    (9, "rem_staddr_len", "USINT"),
    (10, "rem_tsap_id_len", "USINT"),
    (11, "next_staddr_len", "USINT"),
    (12, "local_tsap_id", "ARRAY[1..16] OF BYTE"),
    (28, "rem_subnet_id", "ARRAY[1..6] OF USINT"),
    (34, "rem_staddr", "ARRAY[1..6] OF USINT"),
    (40, "rem_tsap_id", "ARRAY[1..16] OF BYTE"),
    (56, "next_staddr", "ARRAY[1..6] OF BYTE"),
    (62, "spare", "WORD"),
)
_RFC: Final = (
    *_OPEN,
    *_fields(
        (8, "RemoteAddress", "IP_V4"),
        (12, "RemoteTSelector", "TSelector"),
        (46, "LocalTSelector", "TSelector"),
    ),
)
_DIAGNOSIS: Final = (
    *_OPEN,
    *_fields(
        (6, "State", "TDiag_State"),
        (7, "Kind", "TDiag_Kind"),
        (8, "SentBytes", "UDINT"),
        (12, "ReceivedBytes", "UDINT"),
    ),
)

CONNECTIONS: Final = {
    structure.name: structure
    for structure in (
        Structure("TCON_IP_v4", 14, _IP_V4),
        Structure("TCON_IP_RFC", 80, _RFC, is_verified=False),
        Structure("TCON_QDN", 266, _QDN, is_verified=False),
        Structure("TCON_IP_V4_SEC", 26, (*_IP_V4, *_secure(14)), head="TCON_IP_v4", is_verified=False),
        Structure("TCON_QDN_SEC", 278, (*_QDN, *_secure(266)), head="TCON_QDN", is_verified=False),
        Structure("TCON_Param", 64, _PARAM),
        Structure("TCON_Configured", 6, _HEAD, spare=1),
    )
}
_TO: Final = _fields(
    (0, "rem_ip_addr", "ARRAY[1..4] OF USINT"), (4, "rem_port_nr", "UINT"), (6, "reserved", "WORD")
)
_TO_NAME: Final = _fields(
    (0, "RemoteQDN", "STRING[254]"), (256, "RemotePort", "UINT"), (258, "reserved", "WORD")
)
_FROM: Final = _fields(
    (0, "RemoteAddress", "ARRAY[1..16] OF BYTE"),
    (16, "RemotePort", "UINT"),
    (18, "type", "BYTE"),
    (19, "reserved", "BYTE"),
)
ADDRESSES: Final = {
    structure.name: structure
    for structure in (
        Structure("TADDR_Param", 8, _TO),
        Structure("TADDR_SEND_QDN", 260, _TO_NAME),
        Structure("TADDR_RCV_IP", 20, _FROM),
    )
}
# Each after those that it has members of.
STRUCTURES: Final = (
    Structure("IP_V4", 4, _fields((0, "ADDR", "ARRAY[1..4] OF BYTE"))),
    Structure("TSelector", 34, _fields((0, "TSelLength", "UINT"), (2, "TSel", "ARRAY[1..32] OF BYTE"))),
    *CONNECTIONS.values(),
    *ADDRESSES.values(),
    Structure("TDiag_Status", 16, _DIAGNOSIS),
)
