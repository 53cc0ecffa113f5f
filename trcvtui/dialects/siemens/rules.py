"""Siemens S7-1500, S7-1200, and S7-1200 with instructions before 3.0: the answered questionnaires."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.rules import DataAreaRules, NotConnectedRule, StatusRules, VendorRules
from trcvtui.blocks.status import Reproducibility, StatusRow
from trcvtui.dialects.dialect import BACKLOG_SWITCH, INTERNAL_FAULT, Dialect, Switch, SwitchValue, map_codes
from trcvtui.dialects.siemens.connection_errors import LEGACY_ERRORS
from trcvtui.dialects.siemens.states import ALL_BLOCKS, C_BLOCKS
from trcvtui.dialects.siemens.status import STATUS
from trcvtui.net.connection.config import ConnectionPolicy
from trcvtui.net.connection.connection import LossKind
from trcvtui.net.connection.description_check import Flaw
from trcvtui.net.connection.resources import IdConflict
from trcvtui.net.connection.set_up import SetUpStage
from trcvtui.net.layer import TlsError

# One sequence for all of them; each dialect below adds its limits and a few differences.

_TLS_CONDITIONS: Final[dict[str, Condition]] = {
    TlsError.PLAIN: Condition.TLS_MESSAGE,
    TlsError.HANDSHAKE: Condition.TLS_HANDSHAKE,
    TlsError.SILENT: Condition.TLS_HANDSHAKE,
    TlsError.REFUSED: Condition.TLS_HANDSHAKE,
    TlsError.WRONG_NAME: Condition.TLS_HANDSHAKE,
    TlsError.NO_CERTIFICATE: Condition.TLS_UNSUPPORTED,
    TlsError.UNSUPPORTED: Condition.TLS_UNSUPPORTED,
    TlsError.DISCARDED: Condition.TLS_DISCARDED,
    TlsError.NO_CA: Condition.TLS_NO_CA,
    TlsError.EXPIRED: Condition.TLS_EXPIRED,
    TlsError.INTEGRITY: Condition.TLS_INTEGRITY,
    TlsError.EXTENSION: Condition.TLS_EXTENSION,
    TlsError.REFERENCE: Condition.TLS_REFERENCE,
}
_INTEGRITY_CONDITIONS: Final = {"EBADMSG": Condition.TLS_INTEGRITY}  # by a planned fault
_NAME_CONDITIONS: Final = {
    "EAI_AGAIN": Condition.NO_RESOLVER,
    "EAI_NONAME": Condition.NAME_UNKNOWN,
    "EAI_FAIL": Condition.NAME_UNKNOWN,
}
SECURE_SET_UP: Final[dict[tuple[SetUpStage, str], Condition]] = {
    **{
        (stage, error): shows
        for stage in (SetUpStage.CONNECT, SetUpStage.ACCEPT)
        for error, shows in (_TLS_CONDITIONS | _INTEGRITY_CONDITIONS).items()
    },
    **{(SetUpStage.CONNECT, error): shows for error, shows in _NAME_CONDITIONS.items()},
    (SetUpStage.DESCRIPTION, Flaw.SERVER_BARE): Condition.TLS_SERVER_BARE,
    (SetUpStage.DESCRIPTION, Flaw.SECURE_DATAGRAMS): Condition.TLS_DATAGRAMS,
    (SetUpStage.DESCRIPTION, Flaw.CLIENT_ASKS): Condition.TLS_CLIENT_ASKS,
    (SetUpStage.DESCRIPTION, Flaw.SERVER_CHECKS): Condition.TLS_SERVER_CHECKS,
    (SetUpStage.DESCRIPTION, Flaw.CERTIFICATE): Condition.TLS_REFERENCE,
}


SECOND: Final = 1_000_000_000  # ns
# The help has DONE at TRCV_C, the FAQ NDR at both.
PIN_LABELS: Final = {"TRCV_C": {"DONE": "DONE (NDR)"}, "TRCV": {"DONE": "NDR"}, "TURCV": {"DONE": "NDR"}}

SWITCHES: Final = (
    Switch(
        "retry",
        "duration",
        SECOND,
        "pause after a failed attempt to connect, or after an active connection lost before a byte moved",
    ),
    Switch("attempt_limit", "duration", 5 * SECOND, "longest time that one attempt to connect may take"),
    Switch("busy_while_connecting", "bool", False, "BUSY is 1 in 7001, 7002 and 7003 of the _C blocks"),
    Switch("status_0001_always", "bool", False, "0001 shows for each connection, also when no job waits"),
    Switch("teardown_before_error", "bool", False, "7003 shows before the code of a loss that ends a job"),
    Switch(
        "cont_mode",
        "choice",
        "level",
        "level: CONT builds and closes the connection; manual: REQ and EN_R build it too, and with CONT = 0 "
        "it ends after the job; oneshot is the older word for manual",
        ("level", "manual", "oneshot"),
    ),
    Switch("com_rst_autoclear", "bool", True, "the block writes COM_RST back to FALSE when the reset starts"),
    Switch(
        "rcv_lag",
        "bool",
        True,
        "of two _C blocks, the one called second in a scan sees the connection one scan later",
    ),
    Switch("silent_connect", "bool", False, "a failed attempt to connect shows no ERROR scan"),
    Switch(
        "en_r_falls",
        "choice",
        "by_cont_mode",
        "EN_R becomes 0 while a receive job runs (keeps: the job waits for data; drops: it ends; "
        "by_cont_mode: level keeps the job, manual drops it if it has no data yet)",
        ("by_cont_mode", "keeps", "drops"),
    ),
    Switch(
        "receive_faults",
        "choice",
        "each_call",
        "a receive job is refused (each_call: ERROR in each call; once: ERROR again if EN_R or LEN changes)",
        ("each_call", "once"),
    ),
    Switch("buffers", "count", 64, "jobs that can run at the same time; one more shows 80C3"),
    Switch("queue", "count", 64, "connects, closes and resets that one scan takes; one more shows 80C3"),
    Switch(
        "iso_tpdu_default",
        "count",
        1024,
        "bytes in a DT to an ISO-on-TCP partner that names no TPDU size; at most our own 1024",
        least=128,
        most=65531,
    ),
    BACKLOG_SWITCH,
    INTERNAL_FAULT,
    Switch(
        "keep_alive",
        "count",
        30,
        "seconds between probes of a silent partner if KeepAliveTimeInterval is 0: a dead link shows "
        "after 2 to 3 of them; 30 is from memory, unverified",
        least=1,
        most=32767,
    ),
    Switch("small_buffers", "bool", False, "smallest socket buffers, so that 7005 lasts for seconds"),
)

# Refused or closed by the partner is 80C5, unreachable is 80C6; a port in use is 80A1.
SET_UP: Final = {
    (SetUpStage.DESCRIPTION, Flaw.NO_DESCRIPTION): Condition.NO_DESCRIPTION,
    (SetUpStage.DESCRIPTION, Flaw.STRUCTURE): Condition.DESCRIPTION_LENGTH,
    (SetUpStage.DESCRIPTION, Flaw.LENGTH): Condition.DESCRIPTION_LENGTH,
    (SetUpStage.DESCRIPTION, Flaw.ID): Condition.ID_WRONG,
    (SetUpStage.DESCRIPTION, Flaw.INTERFACE): Condition.INTERFACE_WRONG,
    (SetUpStage.DESCRIPTION, Flaw.NO_LOCAL_ADDRESS): Condition.INTERFACE_BARE,
    (SetUpStage.DESCRIPTION, Flaw.TYPE): Condition.TYPE_WRONG,
    (SetUpStage.DESCRIPTION, Flaw.NEEDS_ADDR): Condition.NEEDS_ADDR,
    (SetUpStage.DESCRIPTION, Flaw.UDP_ACTIVE): Condition.UDP_ACTIVE,
    (SetUpStage.DESCRIPTION, Flaw.TSAP): Condition.TSAP_WRONG,
    (SetUpStage.DESCRIPTION, Flaw.PARAMETER): Condition.PARAMETER_WRONG,
    (SetUpStage.DESCRIPTION, Flaw.PORT_RESERVED): Condition.PORT_RESERVED,
    (SetUpStage.DESCRIPTION, Flaw.REMOTE): Condition.REMOTE_WRONG,
    (SetUpStage.DESCRIPTION, Flaw.NAME_EMPTY): Condition.NAME_EMPTY,
    (SetUpStage.DESCRIPTION, Flaw.NAME_NOT_FULL): Condition.NAME_NOT_FULL,
    (SetUpStage.DESCRIPTION, Flaw.NO_RESOLVER): Condition.NO_RESOLVER,
    (SetUpStage.DESCRIPTION, Flaw.NAME_UNKNOWN): Condition.NAME_UNKNOWN,
    (SetUpStage.IDENTITY, IdConflict.SAME): Condition.ENDPOINT_THERE,
    (SetUpStage.IDENTITY, IdConflict.BUILDING): Condition.ID_BUILDING,
    (SetUpStage.IDENTITY, IdConflict.OTHER): Condition.ID_OTHER,
    (SetUpStage.SOCKET, ""): Condition.NO_SOCKET,
    (SetUpStage.ADDRESS, ""): Condition.WRONG_LOCAL_ADDRESS,
    (SetUpStage.REUSE, ""): Condition.NOT_NOW,
    (SetUpStage.BIND, ""): Condition.NOT_NOW,
    (SetUpStage.BIND, "EADDRINUSE"): Condition.PORT_IN_USE,
    (SetUpStage.BIND, "EACCES"): Condition.PORT_RESERVED,
    (SetUpStage.POLL_ADD, ""): Condition.NOT_NOW,
    (SetUpStage.ACCEPT, ""): Condition.NOT_NOW,
    (SetUpStage.CONNECT, ""): Condition.NOT_NOW,
    (SetUpStage.CONNECT, "ECONNREFUSED"): Condition.REFUSED,
    (SetUpStage.CONNECT, "ECONNRESET"): Condition.REFUSED,
    (SetUpStage.CONNECT, "ETIMEDOUT"): Condition.UNREACHABLE,
    (SetUpStage.CONNECT, "ENETUNREACH"): Condition.UNREACHABLE,
    (SetUpStage.CONNECT, "EHOSTUNREACH"): Condition.UNREACHABLE,
    **SECURE_SET_UP,
}
JOB_LOSS: Final = {
    LossKind.CLOSED_BY_PARTNER: Condition.PARTNER_CLOSED,
    LossKind.RESET_BY_PARTNER: Condition.PARTNER_CLOSED,
    LossKind.REFUSED: Condition.PARTNER_CLOSED,  # TSEND, TRCV: their tables have no 80E1
    LossKind.LINK_DEAD: Condition.LINK_DEAD,
}


class CpuLimits(NamedTuple):
    """One CPU: limits in bytes, connections for programs, and which symbolic DATA takes ad-hoc data."""

    max_len: int
    max_datagram: int
    connections: int
    symbolic_bytes: bool = False  # only elements of 8 bits (STEP 7 help, TRCV_C)
    narrow_tsaps: bool = False  # S7-1200 System Manual


BUILDING_CONDITIONS: Final = frozenset(
    {Condition.CREATING, Condition.CREATED, Condition.ESTABLISHING, Condition.CLOSING}
)


def make_rules(chosen: Mapping[str, SwitchValue], cpu: CpuLimits) -> VendorRules:
    return VendorRules(
        status={},
        status_of=map_codes(STATUS),
        course=make_sequence(chosen),
        single_instructions=True,
        not_connected=NotConnectedRule.NEVER,
        short_frame_shown=False,
        area=DataAreaRules(
            missing=Condition.DATA_MISSING,
            longer=Condition.LEN_OVER_DATA,
            refuses_bits=True,
            symbolic_alone=True,
            symbolic_bytes=cpu.symbolic_bytes,
            must_stay=True,
            texts_whole=True,
            datagram_needs_len=True,
        ),
        labels=PIN_LABELS,
        also_busy=BUILDING_CONDITIONS if chosen["busy_while_connecting"] else frozenset(),
        com_rst_autoclear=bool(chosen["com_rst_autoclear"]),
        lock_outlives=False,  # no code table has such a lock
        one_class=True,
        max_len=cpu.max_len,
        max_datagram=cpu.max_datagram,
        datagram_too_long=Condition.MESSAGE_TOO_LONG,
        policy=ConnectionPolicy(
            retry_ns=int(chosen["retry"]),
            pauses_after_idle=True,
            listens_at_once=True,  # 7002: passive, it waits for the partner
            attempt_limit_ns=int(chosen["attempt_limit"]),
            backlog=int(chosen["backlog"]),
            small_buffers=bool(chosen["small_buffers"]),
            tpdu_default=int(chosen["iso_tpdu_default"]),
            keep_alive_s=int(chosen["keep_alive"]),
            narrow_tsaps=cpu.narrow_tsaps,
            broadcasts=True,  # System Manual, TUSEND: by the address in ADDR
        ),
        buffers=int(chosen["buffers"]),
        queue=int(chosen["queue"]),
        internal_fault=int(str(chosen["internal_fault"]), 16),
    )


def make_sequence(chosen: Mapping[str, SwitchValue]) -> StatusRules:
    """Return which STATUS shows when, with these switch values."""
    by_manual, en_r_falls = chosen["cont_mode"] != "level", chosen["en_r_falls"]
    if en_r_falls == "by_cont_mode":
        en_r_falls = "drops until data" if by_manual else "keeps"
    return StatusRules(
        job_begins=Condition.JOB_BEGINS,
        established=Condition.ESTABLISHED if chosen["status_0001_always"] else None,
        waiting_req_sends=True,
        en_r_keeps_job=en_r_falls == "keeps",
        first_data_keeps_job=en_r_falls == "drops until data",
        second_lags=bool(chosen["rcv_lag"]),
        reset=(Condition.CLOSING,),
        reset_ends_send=Condition.RESET_IN_JOB,
        rebuilding=(Condition.CREATING,),
        let_go=(Condition.CONNECTED, Condition.LET_GO),
        closes_together=True,
        idle_loss=Condition.FOUND_CLOSED,
        job_loss=JOB_LOSS,
        still_asked=Condition.STILL_ASKED,
        teardown=bool(chosen["teardown_before_error"]),
        silent_connect=bool(chosen["silent_connect"]),
        request_connects=by_manual,
        faults_once=chosen["receive_faults"] == "once",
        set_up=SET_UP,
    )


# This manual has no code for a socket: 7001 begins to connect, 7002 continues.
CONDITION_WORDS: Final[Mapping[str, str]] = {
    Condition.CREATING: "connecting begins",
    Condition.CREATED: "connecting",
    Condition.NO_SOCKET: "no resources",
}


def replace_default(name: str, value: SwitchValue) -> tuple[Switch, ...]:
    return tuple(replace(one, default=value) if one.name == name else one for one in SWITCHES)


def _cpu_rules(
    cpu: CpuLimits, switches: tuple[Switch, ...], chosen: Mapping[str, SwitchValue]
) -> VendorRules:
    return make_rules({switch.name: switch.default for switch in switches} | dict(chosen), cpu)


def _dialect(
    name: str, title: str, cpu: CpuLimits, follows: str, switches: tuple[Switch, ...] = SWITCHES
) -> Dialect:
    return Dialect(
        name=name,
        title=title,
        blocks=ALL_BLOCKS,
        status=STATUS,
        switches=switches,
        models={"CPU": cpu.connections},
        default_model="CPU",
        layout="s7-standard",
        describes_connects=True,
        folder="siemens",
        words=CONDITION_WORDS,
        follows=follows,
        answer=partial(_cpu_rules, cpu, switches),
    )


SEQUENCES_DOCUMENT: Final = "the document of the status sequences (cont_mode level)"
S7_1500: Final = _dialect(
    "s7-1500", "Siemens S7-1500, Open User Communication", CpuLimits(65536, 2048, 128), SEQUENCES_DOCUMENT
)
S7_1200: Final = _dialect(
    "s7-1200",
    "Siemens S7-1200, Open User Communication",
    CpuLimits(8192, 1472, 8, True, True),
    "the S7-1200 page on TSEND_C and TRCV_C (cont_mode manual)",
    replace_default("cont_mode", "manual"),
)

AD_HOC: Final = frozenset({65535})  # LEN of TRCV_C and TRCV, which have no ADHOC pin; 0: switch legacy_len0
LEGACY_CPU: Final = CpuLimits(8192, 1472, 8, True, True)
UNSURE_TEXT: Final = "the help of instructions before 3.0 tells it otherwise: switch status_sequence"

LEGACY_BLOCKS: Final = tuple(block for block in S7_1200.blocks if block != "T_DIAG")
_NEWER_ID_ERROR: Final = 0x80C8  # 80A5 here


# cont_mode: the status sequences are of instructions V2.0, so they apply here, and no later manual does.
LEGACY_SWITCHES: Final = (
    *replace_default("silent_connect", True),
    Switch(
        "status_sequence",
        "choice",
        "figures",
        "figures: 7001 7002 0001 7005 7006 as in the figures of the status sequences; help: as in the help "
        "of these instructions, 7001 until the connection is up, then 0000 with DONE; 7002 while bytes move",
        ("figures", "help"),
    ),
    Switch(
        "legacy_len0",
        "choice",
        "data",
        "LEN = 0 at TRCV_C and TRCV (data: the size of DATA, S7-1200 System Manual 11/2011 and Easy Book; "
        "adhoc: as LEN = 65535, STEP 7 help before 3.0)",
        ("data", "adhoc"),
    ),
)


def _row(code: int, block: str) -> StatusRow:
    return next(row for row in STATUS if row.code == code and block in row.blocks)


def _adapt_row(row: StatusRow, *also: Condition, by_help: str) -> StatusRow:
    causes = (*row.causes[:3], f"switch status_sequence = help: {by_help}")
    manual = f"{row.manual}; STEP 7 help, TSEND_C and TRCV_C before V3.0"
    row = replace(row, also=(*row.also, *also), causes=causes, manual=manual)
    return replace(row, blocks=C_BLOCKS, unsure=UNSURE_TEXT)


OWN_ROWS: Final = (
    _adapt_row(
        _row(0x0000, "TSEND_C"), Condition.LINK_DONE,
        by_help="DONE shows once more, in the first scan of each connection",
    ),
    _adapt_row(_row(0x7001, "TSEND_C"), by_help="it stays until the connection is up"),
    _adapt_row(
        _row(0x7002, "TSEND_C"),
        by_help="a job sends (7005 otherwise), or some bytes of the frame are here (7006)",
    ),
    replace(
        _row(0x7006, "TRCV_C"),
        causes=(
            "nothing has come: normal with EN_R at 1; a cut line or a partner without power looks the same "
            "until keep-alive ends it",
            "LEN is 65535: ad hoc, what is there ends the job; any other LEN is awaited whole (0: DATA)",
            "EN_R fell, and the job goes on all the same until data is there",
        ),
        checks=(
            "the partner's length against LEN: bytes here against bytes wanted",
            "frames of varying length: LEN = 65535, or ISO-on-TCP, which keeps their ends",
            "shifted values: one rising edge at COM_RST, then watch the first frame",
        ),
        unsure=f"{UNSURE_TEXT}; LEN = 0 is ad hoc there: switch legacy_len0",
    ),
)  # fmt: skip
# switch status_sequence = help: conditions with another code than in the figures.
HELP_CODES: Final[dict[str, dict[Condition, int]]] = {
    block: dict.fromkeys((Condition.CREATED, Condition.ESTABLISHING), 0x7001) | {moves: 0x7002}
    for block, moves in (("TSEND_C", Condition.SENDING), ("TRCV_C", Condition.RECEIVING_PART))
}
_OWN_CODES: Final = {(row.code, block) for row in OWN_ROWS for block in row.blocks}


# Words about newer instructions or structures, and their replacements here.
_REWORDINGS: Final = {
    "; 65535 was ad hoc before 3.0": "",
    "; T_DIAG shows State 4 while it stands": "",
    "; T_DIAG after TDISCON ends here, too": "",
    " (T_DIAG: RESULT)": "",
    ": T_DIAG tells whether it stands": ": a TSEND or TRCV tells whether it stands",
    "ADHOC = 1 into a symbolic DATA": "LEN = 65535, ad hoc, into a symbolic DATA",
}
_ONLY_TCON_PARAM: Final = "a TCON_Param, which is all these instructions take, has no name and no certificate"
_NAMES_AND_TLS: Final = range(0x80D0, 0x80F0)


def _clean(lines: tuple[str, ...]) -> tuple[str, ...]:
    for theirs, ours in _REWORDINGS.items():
        lines = tuple(line.replace(theirs, ours) for line in lines)
    return tuple(line for line in lines if "T_DIAG" not in line and "instructions before 3.0" not in line)


def _mark_unreached(row: StatusRow) -> StatusRow:
    if row.code not in _NAMES_AND_TLS:
        return row
    why = row.unreached or _ONLY_TCON_PARAM
    return replace(row, condition=None, also=(), reach=Reproducibility.NEVER, unreached=why)


def _adapt(row: StatusRow) -> StatusRow | None:
    gone = {block for block in row.blocks if (row.code, block) in _OWN_CODES or block not in LEGACY_BLOCKS}
    gone |= set(row.blocks) if row.code == _NEWER_ID_ERROR else set()
    blocks = tuple(block for block in row.blocks if block not in gone)
    return (
        replace(row, blocks=blocks, causes=_clean(row.causes), checks=_clean(row.checks)) if blocks else None
    )


_SHOWN: Final = (*(kept for row in STATUS if (kept := _adapt(row)) is not None), *OWN_ROWS, *LEGACY_ERRORS)
LEGACY_STATUS: Final = tuple(sorted(map(_mark_unreached, _SHOWN), key=lambda row: row.code))


def make_legacy_rules(values: Mapping[str, SwitchValue]) -> VendorRules:
    chosen = {switch.name: switch.default for switch in LEGACY_SWITCHES} | dict(values)
    newer = make_rules(chosen, LEGACY_CPU)
    rules = replace(
        newer,
        status_of=map_codes(_SHOWN),
        lacks=frozenset({"ADHOC"}),
        types={"LEN": "UINT", "RCVD_LEN": "UINT"},
        area=replace(newer.area, adhoc_lens=AD_HOC | ({0} if chosen["legacy_len0"] == "adhoc" else set())),
        course=replace(newer.course, reset_closes=True),
    )
    return _adapt_to_help(rules) if chosen["status_sequence"] == "help" else rules


def _adapt_to_help(rules: VendorRules) -> VendorRules:
    done = Condition.LINK_DONE
    return replace(
        rules,
        status_of={block: codes | HELP_CODES.get(block, {}) for block, codes in map_codes(_SHOWN).items()},
        receiving_part=Condition.RECEIVING_PART,
        course=replace(rules.course, job_begins=done, established=done),
    )


S7_1200_LEGACY: Final = Dialect(
    name="s7-1200-legacy",
    title="Siemens S7-1200 up to V4.0, instructions before 3.0",
    blocks=LEGACY_BLOCKS,
    status=LEGACY_STATUS,
    switches=LEGACY_SWITCHES,
    models=S7_1200.models,
    default_model=S7_1200.default_model,
    layout=S7_1200.layout,
    describes_connects=S7_1200.describes_connects,
    structures=("TCON_Param",),
    folder="siemens-legacy",
    words=CONDITION_WORDS,
    follows=SEQUENCES_DOCUMENT,
    answer=make_legacy_rules,
)
