"""ISO-on-TCP on the bench: both kernels alike, the ledger, messages of any size, and what each costs."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.iso_desk import PASSIVE, Desk
from tests.scenario.scenarios import CONFIGS, failures, play
from tests.scenario.test_every_scenario import walk
from trcvtui.bench.bench import Bench
from trcvtui.net.faults import FaultyKernel
from trcvtui.net.layers.layer_kernel import LayerKernel
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.file import load_project

SCENARIOS = sorted(CONFIGS.glob("scenarios/siemens/iso-*.toml"))


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_real_sockets_give_the_status_walk_of_the_simulated_ones_for_the_same_causes(path: Path) -> None:
    live, sim = play(path, "live"), play(path, "sim")
    assert live.verdict.has_passed, failures(live.verdict)
    assert walk(live.records()) == walk(sim.records())
    assert live.causes() == sim.causes()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_the_ledger_names_a_dropped_client_and_why(tmp_path: Path, kernel: str) -> None:
    text = PASSIVE + '[[peer]]\nname = "RAW"\nremote = "@C1"\n'
    desk = Desk(text, tmp_path, kernel)
    desk.say("set R CONT=1", "run 3", "peer RAW connect")
    desk.until(lambda: desk.bench.peers["RAW"].state == "connected")
    desk.say('peer RAW send text "hello"')
    desk.until(lambda: desk.notes("client dropped"))
    (note,) = desk.notes("client dropped")
    assert note.subject == "C1"
    assert note.end.startswith("127.0.0.1:")
    assert note.detail == "TPKT version 104"
    assert desk.status("R") == "7002"
    desk.close()


@pytest.mark.parametrize("kernel", ["sim", "live"])
@pytest.mark.parametrize("size", [1, 1021, 1022, 2000])
def test_a_message_is_the_same_on_both_ends_whatever_its_size(tmp_path: Path, kernel: str, size: int) -> None:
    desk = Desk(PASSIVE, tmp_path, kernel)
    desk.say("set R CONT=1 EN_R=1", "set S CONT=1", "run 3", "peer P1 connect")
    desk.until_status("R", "7006")
    desk.say(f"peer P1 send random {size} seed=3")
    desk.until_done("R")
    assert desk.bench.runtime.outputs("R").rcvd_len == size
    desk.say("write tx random 2000 seed=9", f"set S LEN={size}", "pulse S REQ")
    desk.until_done("S")
    desk.until(lambda: desk.bench.peers["P1"].snapshot().bytes_received == size)
    received = desk.bench.peers["P1"].snapshot().last_received
    assert received == desk.bench.runtime.data("tx")[:size]
    desk.close()


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_message_waits_at_7005_until_the_stack_has_all_of_it(tmp_path: Path, kernel: str) -> None:
    text = PASSIVE.replace("ARRAY[0..1999]", "ARRAY[0..59999]").replace(
        'dialect = "s7-1500"', 'dialect = "s7-1500"\n[options]\nsmall_buffers = true'
    )
    desk = Desk(text, tmp_path, kernel)
    desk.say("set S CONT=1", "run 3", "peer P1 connect")
    desk.until_status("S", "7004")
    desk.say("peer P1 stall", "write tx random 60000 seed=5", "pulse S REQ", "run 20")
    assert desk.status("S") == "7005"
    assert desk.bench.peers["P1"].snapshot().bytes_received == 0
    desk.say("peer P1 resume")
    desk.until_done("S")
    desk.until(lambda: desk.bench.peers["P1"].snapshot().bytes_received == 60000)
    assert desk.bench.peers["P1"].has_received(desk.bench.runtime.data("tx"))
    desk.close()


def test_adhoc_changes_nothing_where_messages_are_whole(tmp_path: Path) -> None:
    desk = Desk(PASSIVE, tmp_path)
    desk.say("set R CONT=1 EN_R=1 ADHOC=1", "run 3", "peer P1 connect")
    desk.until_status("R", "7006")
    desk.say("peer P1 send hex 01 02 03")
    desk.until_done("R")
    assert desk.bench.runtime.outputs("R").rcvd_len == 3
    desk.close()


def test_com_rst_drops_messages_that_wait_and_builds_the_connection_again(tmp_path: Path) -> None:
    desk = Desk(PASSIVE, tmp_path)
    desk.say("set R CONT=1", "run 3", "peer P1 connect")
    desk.until_status("R", "7004")
    desk.say("peer P1 send hex 01 02 03", "run 3", "set R COM_RST=1", "run 5", "peer P1 connect")
    desk.until_status("R", "7004")
    desk.say("set R EN_R=1", "run 5")
    assert desk.status("R") == "7006"  # nothing of the first connection is left
    desk.close()


def test_stop_frees_the_shared_port_and_run_takes_it_again(tmp_path: Path) -> None:
    desk = Desk(PASSIVE, tmp_path, "live")
    desk.say("set R CONT=1", "run 3")
    port = desk.port()
    desk.say("plc stop", "run 1", "plc run", "run 3")
    assert desk.port() == port
    desk.close()


def test_a_forbidden_port_is_80a2_with_the_call_that_failed(tmp_path: Path) -> None:
    desk = Desk(PASSIVE.replace("IsoPort = 0", "IsoPort = 102"), tmp_path)
    desk.say("fault bind EACCES on C1", "set R CONT=1", "run 3")
    edges = [line.event for line in desk.bench.runtime.ledger if isinstance(line.event, StatusEdge)]
    (failed,) = [edge for edge in edges if edge.outputs.error]
    assert f"{failed.outputs.status:04X}" == "80A2"
    assert (failed.cause.call, failed.cause.error) == ("bind", "EACCES")
    assert failed.cause.detail == "this user may not use 127.0.0.1:102: IsoPort sets another port"
    desk.close()


def test_without_a_session_no_kernel_stands_in_front_of_the_kernel(tmp_path: Path) -> None:
    plain = Bench(load_project(CONFIGS / "s7-receiver.toml"), "sim")
    assert isinstance(plain.runtime._kernel, FaultyKernel)
    plain.close()
    iso = Bench(load_project(CONFIGS / "s7-iso-passive.toml"), "sim")
    assert isinstance(iso.runtime._kernel, LayerKernel)
    iso.close()
