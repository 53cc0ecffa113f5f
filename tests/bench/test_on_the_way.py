"""An instance alone: CONNECT and DATA are made on the way, and the first bytes that come are a DONE."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from tests.local_driver import LocalDriver
from trcvtui.dialects import DIALECTS
from trcvtui.engine.controller import fresh_bench
from trcvtui.net.results import Endpoint
from trcvtui.project.edit import fields_of, propose_name
from trcvtui.project.file import load_project
from trcvtui.scenario.scenario import load_bench_project
from trcvtui.tui.forms.fields import make_add
from trcvtui.tui.view_model.validity import find_mistake


def console(tmp_path: Path, dialect: str = "baosky", kernel: str = "sim", more: str = "") -> LocalDriver:
    path = tmp_path / "new.toml"
    path.write_text(f'dialect = "{dialect}"\n{more}', encoding="utf-8")
    return LocalDriver(fresh_bench(load_bench_project(path), kernel), pause=3)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_in_every_dialect_one_line_is_enough_to_receive(tmp_path: Path, dialect: str) -> None:
    bench = console(tmp_path, dialect)
    told = bench.do("add instance R1 block=TRCV_C")
    assert told == "with CONNECT C1 at 127.0.0.1:2000, DATA variable rx1, ARRAY[0..1023] OF BYTE"
    bench.do("set R1 CONT=1", "add peer P1 remote=@C1", "peer P1 connect", "set R1 EN_R=1")
    bench.do("peer P1 send hex 01 02 03")
    assert bench.bench.runtime.data("rx1")[:3] == b"\x01\x02\x03"
    bench.do("save project")
    saved = load_project(tmp_path / "new.toml")
    assert saved.instance("R1") is not None and saved.connect("C1").local.port == 2000  # type: ignore[union-attr]


def test_one_undo_takes_all_of_it_back(tmp_path: Path) -> None:
    bench = console(tmp_path)
    bench.do("add instance R1 block=TRCV_C", "undo")
    project = bench.bench.project
    assert (project.instances, project.connects, project.data) == ((), (), ())


def test_the_next_names_and_the_next_port_are_taken_and_keys_of_the_connect_are_its(tmp_path: Path) -> None:
    bench = console(tmp_path)
    bench.do("add instance R1 block=TRCV_C", "add instance R2 block=TRCV_C")
    bench.do("add instance S1 block=TSEND_C ActiveEstablished=true RemoteAddress=127.0.0.1 RemotePort=@C1")
    project = bench.bench.project
    assert [each.local.port for each in project.connects] == [2000, 2001, 2002]
    assert project.connects[2].active and project.connects[2].remote_port == "@C1"
    assert [each.name for each in project.data] == ["rx1", "rx2", "tx1"]


def test_a_connect_that_is_named_stays_without_data_as_before(tmp_path: Path) -> None:
    bench = console(tmp_path)
    bench.do("add connect C1 LocalPort=0", "add instance R1 block=TRCV_C connect=C1")
    assert bench.bench.project.instance("R1").data is None  # type: ignore[union-attr]


# On what the form proposes C1, where TRCV_C is: for the other direction, and what works on what others built.
SHARED = ("TSEND_C", "TDISCON", "T_RESET", "T_DIAG", "TSEND", "TRCV")


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_second_instance_has_a_connect_and_data_of_its_own(tmp_path: Path, dialect: str) -> None:
    bench = console(tmp_path, dialect)
    bench.do("add instance R1 block=TRCV_C")
    project = bench.bench.project
    for block in project.dialect.blocks:
        fields = {each.key: each.first for each in fields_of("instance", project, block)}
        line = make_add("instance", propose_name("instance", project, block), fields, project)
        assert find_mistake(line, project) == ""
        assert fields.get("connect", "new") == ("C1" if block in SHARED else "" if "TU" in block else "new")
        assert {fields.get(key) or "new" for key in ("data", "config", "addr", "RxBuffer", "TxBuffer")} == {
            "new"
        }
        bench.do(line)
    grown = bench.bench.project
    ports = [each.local.port for each in grown.connects] + [each.local.port for each in grown.udp_configs]
    assert len(ports) == len(set(ports)) > 1


def test_what_is_free_is_proposed_before_a_new_one(tmp_path: Path) -> None:
    bench = console(tmp_path)
    bench.do("add udp_config U1", "add addr A1", "add data big LREAL")
    bench.do("add instance U block=URECV_C config=U1 addr=new", "add addr A3")
    proposed = {each.key: each.first for each in fields_of("instance", bench.bench.project, "USEND_C")}
    assert [proposed[key] for key in ("config", "addr", "data")] == ["U1", "A3", "big"]
    proposed = {each.key: each.first for each in fields_of("instance", bench.bench.project, "URECV_C")}
    assert proposed["config"] == "new"


def test_new_makes_that_one_part_and_what_a_block_has_not_is_refused(tmp_path: Path) -> None:
    bench = console(tmp_path)
    bench.do("add instance R1 block=TRCV_C")
    told = bench.do("add instance S1 block=TSEND_C connect=C1 data=new")
    assert told == "with DATA variable tx1, ARRAY[0..15] OF BYTE"
    for line in (
        "TCON connect=C1 data=new",
        "TSEND_C connect=C1 data=new LocalPort=2100",
        "USEND_C connect=new",
    ):
        assert find_mistake(f"add instance X block={line}", bench.bench.project)


def test_on_real_sockets_a_port_that_somebody_has_is_not_taken(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = other.getsockname()[1]
        bench = console(tmp_path, kernel="live")
        assert not bench.bench.is_free(Endpoint("127.0.0.1", taken))
        bench.do("add instance R1 block=TRCV_C")
        [line] = [entry.line for entry in bench.console.session._entries if entry.line.startswith("add")]
        port = bench.bench.project.connects[0].local.port
        assert line == f"add instance R1 block=TRCV_C LocalPort={port}", "a saved session has the same port"
        bench.bench.close()
