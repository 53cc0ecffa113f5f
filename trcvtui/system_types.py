"""System data types of Siemens (STEP 7 help), a row for each field, for `udt` and the bytes of a CONNECT.

Rule: names and offsets are kept only here. If no page of the help shows offsets, `is_verified` is False.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple

LONGEST_SELECTOR: Final = 32
LONGEST_NAME: Final = 254


class FieldType(StrEnum):
    NUMBER = "UINT"
    TRUTH = "BOOL"
    ADDRESS = "IP_V4"
    SELECTOR = "TSelector"  # UINT length and 32 bytes
    NAME = "STRING[254]"
    BYTES = "ARRAY OF BYTE"


class DescriptionField(NamedTuple):
    """One field of a structure. Offset and size are in bytes. `data_type` is its type's name in STEP 7."""

    name: str
    offset: int
    type: FieldType
    size: int
    data_type: str


class Structure(NamedTuple):
    """One system type. `size` is in bytes. The last `spare` bytes may be missing.

    `head` names a structure that has the first fields. In STEP 7 these fields are one member, ConnPara.
    """

    name: str
    size: int
    fields: tuple[DescriptionField, ...]
    spare: int = 0
    head: str = ""
    is_verified: bool = True

    def field(self, name: str) -> DescriptionField | None:
        return next((field for field in self.fields if field.name == name), None)


HANDLE_TYPES: Final = (  # numbers of 16 bits, each the handle of an object in the CPU
    *("HW_ANY", "HW_IO", "HW_DEVICE", "HW_SUBMODULE", "HW_INTERFACE", "CONN_OUC", "PORT"),
    *("DB_ANY", "OB_ANY", "EVENT_ANY"),
)
UNSURE_HANDLE_TYPES: Final = ("EVENT_ANY",)  # 32 bits in other sources
ENUMERATIONS: Final = {
    "TDiag_State": {"Down": 1, "ActiveTrying": 2, "PassiveWaiting": 3, "Established": 4, "Closing": 5},
    "TDiag_Kind": {"Configured": 1, "Programmed": 3},
}
_FIELD_TYPES: Final = {
    **dict.fromkeys(("UINT", "WORD", *HANDLE_TYPES), (FieldType.NUMBER, 2)),
    **dict.fromkeys(("BYTE", "USINT", *ENUMERATIONS), (FieldType.NUMBER, 1)),
    "UDINT": (FieldType.NUMBER, 4),
    "BOOL": (FieldType.TRUTH, 1),
    **dict.fromkeys(("IP_V4", "ARRAY[1..4] OF USINT"), (FieldType.ADDRESS, 4)),
    "TSelector": (FieldType.SELECTOR, 2 + LONGEST_SELECTOR),
    "STRING[254]": (FieldType.NAME, 2 + LONGEST_NAME),
    **{f"ARRAY[1..{size}] OF BYTE": (FieldType.BYTES, size) for size in (4, 6, 16, 32)},
}


def _parse(rows: str) -> tuple[DescriptionField, ...]:
    """Return the fields of rows such as `0 ID CONN_OUC, 2 Port UINT`: offset in bytes, name, type."""
    cells = [row.split(maxsplit=2) for row in rows.split(",")]
    return tuple([DescriptionField(name, int(at), *_FIELD_TYPES[of], of) for at, name, of in cells])


def _secure_fields(at: int) -> tuple[DescriptionField, ...]:
    return _parse(
        f"{at} ActivateSecureConn BOOL, {at + 1} TLSServerReqClientCert BOOL, "
        f"{at + 2} ExtTLSCapabilities WORD, {at + 4} TLSServerCertRef UDINT, {at + 8} TLSClientCertRef UDINT"
    )


_HEAD_FIELDS: Final = _parse("0 InterfaceId HW_ANY, 2 ID CONN_OUC, 4 ConnectionType BYTE")
_OPEN: Final = (*_HEAD_FIELDS, *_parse("5 ActiveEstablished BOOL"))
_IP_V4: Final = (*_OPEN, *_parse("6 RemoteAddress IP_V4, 10 RemotePort UINT, 12 LocalPort UINT"))
_QDN_FIELDS: Final = (*_OPEN, *_parse("6 RemoteQDN STRING[254], 262 RemotePort UINT, 264 LocalPort UINT"))
_RFC: Final = _parse("8 RemoteAddress IP_V4, 12 RemoteTSelector TSelector, 46 LocalTSelector TSelector")
_PARAM_FIELDS: Final = _parse(
    "0 block_length UINT, 2 id CONN_OUC, 4 connection_type USINT, 5 active_est BOOL, 6 local_device_id USINT,"
    "7 local_tsap_id_len USINT, 8 rem_subnet_id_len USINT, 9 rem_staddr_len USINT, 10 rem_tsap_id_len USINT,"
    "11 next_staddr_len USINT, 12 local_tsap_id ARRAY[1..16] OF BYTE, 28 rem_subnet_id ARRAY[1..6] OF BYTE,"
    "34 rem_staddr ARRAY[1..6] OF BYTE, 40 rem_tsap_id ARRAY[1..16] OF BYTE,"
    "56 next_staddr ARRAY[1..6] OF BYTE, 62 spare WORD"
)
_FROM_FIELDS: Final = _parse(
    "0 RemoteAddress ARRAY[1..16] OF BYTE, 16 RemotePort UINT, 18 type BYTE, 19 reserved BYTE"
)
_STATUS: Final = _parse("6 State TDiag_State, 7 Kind TDiag_Kind, 8 SentBytes UDINT, 12 ReceivedBytes UDINT")


def _index_by_name(*structures: Structure) -> dict[str, Structure]:
    return {structure.name: structure for structure in structures}


CONNECTIONS: Final = _index_by_name(
    Structure("TCON_IP_v4", 14, _IP_V4),
    Structure("TCON_IP_RFC", 80, (*_OPEN, *_RFC), is_verified=False),
    Structure("TCON_QDN", 266, _QDN_FIELDS, is_verified=False),
    Structure("TCON_IP_V4_SEC", 26, (*_IP_V4, *_secure_fields(14)), head="TCON_IP_v4", is_verified=False),
    Structure("TCON_QDN_SEC", 278, (*_QDN_FIELDS, *_secure_fields(266)), head="TCON_QDN", is_verified=False),
    Structure("TCON_Param", 64, _PARAM_FIELDS),
    Structure("TCON_Configured", 6, _HEAD_FIELDS, spare=1),
)
ADDRESSES: Final = _index_by_name(
    Structure(
        "TADDR_Param", 8, _parse("0 rem_ip_addr ARRAY[1..4] OF USINT, 4 rem_port_nr UINT, 6 reserved WORD")
    ),
    Structure(
        "TADDR_SEND_QDN", 260, _parse("0 RemoteQDN STRING[254], 256 RemotePort UINT, 258 reserved WORD")
    ),
    Structure("TADDR_RCV_IP", 20, _FROM_FIELDS),
)
UNVERIFIED_NOTE: Final = "offsets not verified"
# Each one after the structures of its members.
STRUCTURES: Final = (
    Structure("IP_V4", 4, _parse("0 ADDR ARRAY[1..4] OF BYTE")),
    Structure("TSelector", 2 + LONGEST_SELECTOR, _parse("0 TSelLength UINT, 2 TSel ARRAY[1..32] OF BYTE")),
    *CONNECTIONS.values(),
    *ADDRESSES.values(),
    Structure("TDiag_Status", 16, (*_OPEN, *_STATUS)),
)
