"""The STATUS table of the Siemens blocks from version 3.0; errors of pins."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility, StatusRow, unreached_row
from trcvtui.dialects.siemens.connection_errors import CONNECTION_ERRORS, JOB_ERRORS
from trcvtui.dialects.siemens.description_errors import DESCRIPTION_ERRORS, TLS_ERRORS
from trcvtui.dialects.siemens.states import C_BLOCKS, JOBS, RCV_C, RECEIVE, SEND, SET_UP, STATES, TCON, UDP

_NO_MEMORY: Final = "a pin is bound to a global variable by name, so no pointer, DB number or access can fail"
_ACCESS_ERRORS: Final = {
    0x22: ("no such area", "the area that the pin points to does not exist, or ends too early"),
    0x32: ("DB number too high", "a pointer names a data block with a number that the CPU does not have"),
    0x3A: ("no access", "the data block is not loaded, or may not be read or written here"),
    0x7F: (
        "internal error",
        "the CPU could not evaluate the pin, for instance in a reference that is not valid",
    ),
}


def _make_unreached_rows(
    pin: str, first: int, kinds: tuple[int, ...], blocks: tuple[str, ...], manual: str
) -> list[StatusRow]:
    """Return the rows 16#8xyy of one pin: codes that a bench without memory areas cannot show."""
    return [
        unreached_row(
            first + kind,
            blocks,
            f"{pin}: {_ACCESS_ERRORS[kind][0]}",
            (_ACCESS_ERRORS[kind][1], "a pointer that is put together at run time has a wrong part"),
            (
                f"the variable at {pin}, and the data block that it stands in: loaded, and accessible?",
                "all parts of the pointer, one by one; or the symbol itself at the pin",
            ),
            manual,
            unreached=_NO_MEMORY,
        )
        for kind in kinds
    ]


PARAMETER_ERRORS: Final = (
    StatusRow(
        0x8081,
        Condition.ENDPOINT_GONE,
        ("T_RESET",),
        "No connection of this ID",
        (
            "no block was asked to connect it: TCON, TSEND_C or TRCV_C",
            "TDISCON has taken the endpoint away before the reset came",
        ),
        (
            "the line CONNECT of the block: closed means that there is no endpoint",
            "the order of calls: T_RESET after TCON, and not after TDISCON",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: T_RESET",
        unsure="that a closed endpoint counts as unknown (8081), and one that waits as 0001, is inferred",
    ),
    StatusRow(
        0x8085,
        Condition.LENGTH_WRONG,
        (*SEND, "TUSEND"),
        "LEN is out of range",
        (
            "LEN is above the limit of the CPU: 8192 on an S7-1200, 65536 on an S7-1500; UDP 1472, 2048",
            "LEN is 0 and DATA itself is above that limit, or has no byte at all",
            "TUSEND: LEN is 0, which stands for all of DATA only where DATA is symbolic",
        ),
        (
            "pin LEN and the size of DATA; `trcvtui udt show FILE` counts the padding, too",
            "where LEN comes from: a negative number turned into UDINT is huge",
            "a longer message goes in several jobs, each after the DONE of the one before",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TSEND, TUSEND",
        also=(Condition.DATA_EMPTY,),
        unsure="TUSEND with LEN = 0: its list names it, but 0 is the default of all these blocks",
    ),
    StatusRow(
        0x8085,
        Condition.LENGTH_WRONG,
        (*RECEIVE, "TURCV"),
        "LEN is out of range, or was changed",
        (
            "LEN or DATA was changed after the job had begun (BUSY = 1)",
            "LEN is above the limit of the CPU: 8192 on an S7-1200, 65536 on an S7-1500; UDP 1472, 2048",
            "LEN is 0 and DATA has no byte",
            "TRCV_C, TRCV: LEN is 65535, ad hoc in the instructions before 3.0; now ADHOC = 1 is",
        ),
        (
            "what writes LEN: let it change only while EN_R is 0 and BUSY is 0",
            "the ledger: how many bytes the job had collected; they are dropped with it",
            "the next scan begins a job with the new LEN as soon as it fits",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TRCV_C, TRCV, TURCV",
        also=(Condition.DATA_EMPTY, Condition.AREA_CHANGED),
        unsure="what becomes of the bytes of such a job is not documented: here they are lost",
    ),
    unreached_row(
        0x8085,
        TCON,
        "ID belongs to a configured connection",
        (
            "a connection of the hardware configuration has the same ID",
            "an ID above 4095 without a TCONSettings after it",
        ),
        (
            "the connection table of the hardware configuration: which IDs does it use?",
            "another ID for the programmed connection",
        ),
        "STEP 7 help: TCON",
        unreached="the bench has no hardware configuration with connections of its own",
    ),
    StatusRow(
        0x8086,
        Condition.ID_WRONG,
        SET_UP,
        "ID is out of range",
        (
            "ID in the connection description is 0 or above 4095",
            "the bytes of the description are shifted, so that another field stands where ID is read",
        ),
        (
            "field ID of CONNECT, 1 to 4095; as bytes: the third and fourth of a TCON_IP_v4",
            "ConnectionType after it: 0B or 11 there means that the bytes are not shifted",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON, TCON_IP_v4",
    ),
    unreached_row(
        0x8086,
        ("TDISCON", "T_DIAG", "TSEND", "TRCV", *UDP),
        "ID is out of range",
        (
            "pin ID is 0 or above 4095",
            "the tag after ID has not been given its value yet",
        ),
        (
            "the same constant at TCON, TSEND, TRCV and TDISCON",
            "the start-up of the program: which block runs before the ID is written?",
        ),
        "STEP 7 help, Open User Communication",
        unreached="these blocks name their CONNECT, and an ID that is wrong fails at TCON before them",
    ),
    unreached_row(
        0x8087,
        SET_UP,
        "No more connections",
        (
            "the CPU has no programmed connection left",
            "connections of other services (HMI, OPC UA, web server) take the resources",
        ),
        (
            "the CPU's diagnostics: connection resources in use against those reserved",
            "CONT = 0 or TDISCON where a connection is no longer needed",
        ),
        "STEP 7 help: TSEND_C, TCON",
        unreached="the bench shows a full budget as 80C3, which the manual gives for the same case",
    ),
    StatusRow(
        0x8088,
        Condition.LEN_OVER_DATA,
        JOBS,
        "LEN and DATA do not go together",
        (
            "LEN is larger than DATA, often after DATA was made smaller; 65535 was ad hoc before 3.0",
            "DATA is symbolic (in an optimized block) and LEN is not 0",
            "ADHOC = 1 into a symbolic DATA whose elements have more than 8 bits, on an S7-1200",
            "DATA is a STRING or WSTRING, and LEN cuts it (TSEND) or its header (TRCV)",
        ),
        (
            "LEN = 0: then DATA alone decides, whatever its size",
            "key `optimized` of the data in the project file; on the PLC: attributes of the data block",
            "`trcvtui udt show FILE`: the size of DATA with its padding",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help, Open User Communication",
        also=(Condition.DATA_SYMBOLIC, Condition.LEN_OF_TEXT),
        unsure="that LEN of a STRING is bounded is documented; that it shows this code is inferred",
    ),
    StatusRow(
        0x8089,
        Condition.NO_DESCRIPTION,
        SET_UP,
        "CONNECT is no connection description",
        (
            "CONNECT points to something else than a TCON structure",
            "the raw bytes have the size of no description that is known",
        ),
        (
            "the kind of structure and its size: TCON_IP_v4 14 bytes, TCON_Param 64, TCON_IP_RFC 80",
            "let the editor make the description, or take the one from a CONNECT that works",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON, TCON_IP_v4",
    ),
    StatusRow(
        0x8089,
        Condition.RESULT_WRONG,
        ("T_DIAG",),
        "RESULT cannot hold the answer",
        (
            "no variable is bound to RESULT (in a project file: data)",
            "the variable is smaller than a TDiag_Status, which has 16 bytes",
        ),
        (
            "key `data` of the T_DIAG instance, and the size of that variable",
            "declare it as TDiag_Status; ARRAY[0..15] OF BYTE is enough to look at it in hex",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: T_DIAG",
    ),
    StatusRow(
        0x8089,
        Condition.NO_DESCRIPTION,
        UDP,
        "ADDR is of the wrong type",
        (
            "ADDR is no TADDR_Param, TADDR_SEND_QDN (TUSEND; not on this bench) or TADDR_RCV_IP (TURCV)",
            "TUSEND and TURCV share one ADDR, but of a type that only one of them takes",
        ),
        (
            "the declared type of the variable at ADDR",
            "TADDR_Param has 8 bytes: address, port, and two that are 0",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TUSEND, TURCV, TADDR_Param",
    ),
    unreached_row(
        0x8090,
        TCON,
        "The prepared connection does not fit",
        (
            "a connection made with TCONSettings is meant for another protocol or interface",
            "the settings were prepared and CONNECT then changed",
        ),
        (
            "the TCONSettings call against the structure at CONNECT",
            "without TCONSettings: a description with everything in it",
        ),
        "STEP 7 help: TCON",
        unreached="the bench has no TCONSettings",
    ),
    unreached_row(
        0x8091,
        C_BLOCKS,
        "Calls are nested too deep",
        (
            "the block is called at the deepest level that the CPU allows",
            "a chain of function blocks, each calling the next, has grown by one",
        ),
        (
            "the call structure of the program: how deep does this block stand?",
            "call it in the cyclic OB itself, and hand its outputs down",
        ),
        "STEP 7 help: TSEND_C",
        unreached="the bench calls every instance from its task: nothing is nested",
    ),
    *(
        StatusRow(
            code,
            Condition.DATA_MISSING,
            blocks,
            "DATA: no such area",
            (
                "nothing is bound to DATA",
                "DATA points beyond the end of its data block",
            ),
            (
                "pin DATA of the call, in a project file the key `data` of the instance",
                "the size of the data block, if the pointer is built at run time",
            ),
            Reproducibility.LOGIC,
            manual,
            unsure="an open DATA pin does not compile on a PLC; that it counts as a missing area is inferred",
        )
        for code, blocks, manual in (
            (0x8822, (*SEND, "TUSEND"), "STEP 7 help: TSEND_C"),
            (0x8922, (*RECEIVE, "TURCV"), "STEP 7 help: TRCV_C"),
        )
    ),
    StatusRow(
        0x8824,
        Condition.DATA_REFUSED,
        (*SEND, "TUSEND"),
        "DATA: a type that cannot be sent",
        (
            "DATA is a BOOL or an ARRAY OF BOOL",
            "a VARIANT that holds a range which is not allowed",
        ),
        (
            "the type of DATA: a STRUCT may contain BOOLs, a BOOL alone may not be sent",
            "pack the bits into a BYTE or WORD",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C",
        unsure="that BOOL is refused is documented; that it shows this code is inferred",
    ),
    StatusRow(
        0x8924,
        Condition.DATA_REFUSED,
        (*RECEIVE, "TURCV"),
        "DATA: a type that cannot be received into",
        (
            "DATA is a BOOL or an ARRAY OF BOOL",
            "a VARIANT that holds a range which is not allowed",
        ),
        (
            "the type of DATA: a STRUCT may contain BOOLs, a BOOL alone may not be received",
            "receive into a BYTE or WORD and take the bits from there",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TRCV_C",
        unsure="that BOOL is refused is documented; that it shows this code is inferred",
    ),
    *_make_unreached_rows("CONNECT", 0x8700, (0x22, 0x3A, 0x7F), SET_UP, "STEP 7 help: TSEND_C"),
    *_make_unreached_rows("DATA", 0x8800, (0x32, 0x3A, 0x7F), (*SEND, "TUSEND"), "STEP 7 help: TSEND_C"),
    *_make_unreached_rows("DATA", 0x8900, (0x32, 0x3A, 0x7F), (*RECEIVE, "TURCV"), "STEP 7 help: TRCV_C"),
    *_make_unreached_rows("ADDR", 0x8900, (0x3A,), ("TSEND_C", "TUSEND"), "STEP 7 help: TSEND_C"),
    *_make_unreached_rows("ADDR", 0x8A00, (0x3A,), (*RCV_C, "TURCV"), "STEP 7 help: TRCV_C"),
)

STATUS: Final[tuple[StatusRow, ...]] = tuple(
    sorted(
        (*STATES, *PARAMETER_ERRORS, *CONNECTION_ERRORS, *JOB_ERRORS, *DESCRIPTION_ERRORS, *TLS_ERRORS),
        key=lambda row: row.code,
    )
)
