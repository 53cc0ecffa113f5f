"""T_DIAG: what stands in RESULT, field by field."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from tests.bench.iso_desk import Desk
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode

BENCH = """
dialect = "s7-1500"

[[data]]
name = "diag"
type = "ARRAY[0..19] OF BYTE"

[[data]]
name = "tx"
type = "ARRAY[0..4] OF BYTE"

[[connect]]
name = "C1"
{connect}

[[instance]]
name = "TCON_1"
block = "TCON"
connect = "C1"

[[instance]]
name = "TSEND_1"
block = "TSEND"
connect = "C1"
data = "tx"

[[instance]]
name = "T_DIAG_1"
block = "T_DIAG"
connect = "C1"
data = "diag"

[[peer]]
name = "P1"
active = true
remote = "@C1"
"""
PLAIN = 'LocalAddress = "127.0.0.1"\nLocalPort = 0'
IP_V4 = 'type = "TCON_IP_v4"\nInterfaceId = 65\nID = 4095\nConnectionType = 17\n' + PLAIN.replace(
    "= 0", "= 2000"
)
PARAM = (
    'type = "TCON_Param"\nid = 300\nactive_est = false\nLocalAddress = "127.0.0.1"\n'
    'local_tsap_id_len = 2\nlocal_tsap_id = "07 D0"\nrem_tsap_id_len = 0'
)


def read(desk: Desk) -> tuple[int, ...]:
    """Return InterfaceId, ID, ConnectionType, ActiveEstablished, State, Kind, SentBytes, ReceivedBytes."""
    desk.say("pulse T_DIAG_1 REQ", "run 3")
    assert desk.status("T_DIAG_1") == "0000"
    return struct.unpack_from(">HHBBBBII", desk.bench.runtime.data("diag"))


@pytest.mark.parametrize(
    ("connect", "described"), [(IP_V4, (65, 4095, 17)), (PARAM, (64, 300, 17)), (PLAIN, (64, 1, 11))]
)
def test_it_tells_who_the_connection_is_how_it_stands_and_what_it_has_moved(
    connect: str, described: tuple[int, int, int], tmp_path: Path
) -> None:
    desk = Desk(BENCH.format(connect=connect), tmp_path)
    desk.say("pulse TCON_1 REQ", "run 3")
    assert read(desk) == (*described, 0, 3, 3, 0, 0)
    desk.say("peer P1 connect", "run 3", "pulse TSEND_1 REQ", "run 2")
    assert read(desk) == (*described, 0, 4, 3, 5, 0)
    desk.close()


def test_what_stands_after_the_answer_is_left_as_it_was(tmp_path: Path) -> None:
    desk = Desk(BENCH.format(connect=PLAIN), tmp_path)
    desk.say("write diag random 20 seed=1", "pulse TCON_1 REQ", "run 3")
    before = desk.bench.runtime.data("diag")
    desk.say("pulse T_DIAG_1 REQ", "run 2")
    assert desk.bench.runtime.data("diag") == before  # nothing is written before DONE
    desk.say("run 1")
    after = desk.bench.runtime.data("diag")
    assert after[:16] != before[:16] and after[16:] == before[16:]
    desk.close()


def test_a_tdiag_status_names_state_and_kind(tmp_path: Path) -> None:
    typed = BENCH.replace("ARRAY[0..19] OF BYTE", "TDiag_Status")
    desk = Desk(typed.format(connect=IP_V4 + "\nListenPort = 0"), tmp_path)
    desk.say("pulse TCON_1 REQ", "run 3", "pulse T_DIAG_1 REQ", "run 4")
    decl = desk.bench.project.data_decl("diag")
    assert decl is not None and decl.size == 16
    values = decode(decl.layout, desk.bench.runtime.data("diag"))
    pairs = zip(decl.layout.leaves(), values, strict=True)
    shown = {leaf.path.rpartition(".")[2]: value_text(leaf, value) for leaf, value in pairs}
    assert shown["State"] == "3 (PassiveWaiting)" and shown["Kind"] == "3 (Programmed)"
    assert shown["ID"] == "4095" and shown["ActiveEstablished"] == "FALSE"
    desk.close()


def test_a_tdiag_status_of_the_users_own_comes_first(tmp_path: Path) -> None:
    (tmp_path / "own.st").write_text(
        "TYPE TDiag_Status : STRUCT mine : ARRAY[0..31] OF BYTE; END_STRUCT END_TYPE"
    )
    typed = BENCH.replace("ARRAY[0..19] OF BYTE", "TDiag_Status") + '\n[[udt]]\nfile = "own.st"\n'
    desk = Desk(typed.format(connect=PLAIN), tmp_path)
    decl = desk.bench.project.data_decl("diag")
    assert decl is not None and decl.size == 32
    desk.close()
