"""An exception planted in one part of a run: that part is out of service, the traces of the others stay."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.bench.bench_lines import do, run
from trcvtui.bench.bench import Bench
from trcvtui.bench.peers.peer import Peer
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.tcp.compact_blocks import TrcvC
from trcvtui.cli.main import main
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.history.stream_index import StreamIndex
from trcvtui.net.connection.connection import Connection
from trcvtui.net.layers.iso_on_tcp import IsoSession
from trcvtui.net.layers.layered_stream import SharedListener
from trcvtui.plc.containment import EXCEPTIONS_VARIABLE, INTERNAL_ERROR
from trcvtui.plc.ledger import BenchNote
from trcvtui.plc.serial_line_control import PortExchange
from trcvtui.project.file import load_project

PLANTED = "0102030405"  # in the words of the exception: no payload stands in a report
STOPPED = "8FFF"
CONNECT = {"baosky": 'LocalAddress = "127.0.0.1"\n', "s7-1500": 'type = "TCON_IP_v4"\nListenPort = 0\n'}
ISO = 'type = "TCON_IP_RFC"\nLocalTSelector = "16#E002"\nIsoPort = 0\n'
OF_ISO = 'iso = true\nlocal_tsap = "16#E001"\nremote_tsap = "16#E002"\n'
SHARING = ("A", "B")


def four(dialect: str, iso: bool = False) -> str:
    """Return a project with four instances: A and B on C1, C on C2, D on C3, and a peer for each CONNECT."""
    parts = [f'dialect = "{dialect}"\nstart = "set A EN_R=1 CONT=1\\nset B CONT=1\\nset C EN_R=1 CONT=1\\n'
             'set D EN_R=1 CONT=1"\n[scenario]\nname = "four"\nsteps = "run T#2s"\n']  # fmt: skip
    for number in (1, 2, 3):
        own = ISO if iso and number == 1 else CONNECT[dialect]
        parts.append(f'[[connect]]\nname = "C{number}"\n{own}')
        speaks = OF_ISO if iso and number == 1 else ""
        parts.append(f'[[peer]]\nname = "P{number}"\nactive = true\nremote = "@C{number}"\n{speaks}')
        parts.append('reconnect = "T#100ms"\nsays = ["hex 01 02 03 04 05 06 07 08"]\nevery = "T#50ms"\n')
    for name, connect in (("A", "C1"), ("B", "C1"), ("C", "C2"), ("D", "C3")):
        block = "TSEND_C" if name == "B" else "TRCV_C"
        parts.append(f'[[data]]\nname = "d{name}"\ntype = "ARRAY[0..7] OF BYTE"\n')
        parts.append(
            f'[[instance]]\nname = "{name}"\nblock = "{block}"\nconnect = "{connect}"\ndata = "d{name}"\n'
        )
    return "".join(parts)


def raising(
    monkeypatch: pytest.MonkeyPatch, kind: type, name: str, is_meant: Callable[[Any], bool], after: int = 9
) -> None:
    """Let a method raise from its call number `after` on, of the objects that are meant."""
    inside, calls = getattr(kind, name), 0

    def planted(self: Any, *args: Any) -> Any:
        nonlocal calls
        calls += is_meant(self)
        if calls > after and is_meant(self):
            raise KeyError(PLANTED)
        return inside(self, *args)

    monkeypatch.setattr(kind, name, planted)


PLACES: dict[str, tuple[str, tuple[str, ...], Callable[[pytest.MonkeyPatch], None]]] = {
    # what -> the project, the instances that are stopped, the exception
    "a block": (
        four("baosky"), ("A",), lambda m: raising(m, TrcvC, "call", lambda b: b.job._instance == "A", 20)),
    "a block of Siemens": (
        four("s7-1500"), ("A",), lambda m: raising(m, TrcvC, "call", lambda b: b.job._instance == "A", 20)),
    "a connection that a block calls": (
        four("baosky"), ("A",), lambda m: raising(m, Connection, "receive", lambda c: c.config.name == "C1")),
    "a connection between scans": (
        four("baosky"), SHARING,
        lambda m: raising(m, Connection, "serve_listener", lambda c: c.config.name == "C1", 0)),
    "a connection halfway": (
        four("baosky"), ("A",),
        lambda m: raising(m, Connection, "_begin_incarnation", lambda c: c.config.name == "C1", 0)),
    "a layer": (
        four("s7-1500", iso=True), (), lambda m: raising(m, IsoSession, "feed", lambda s: not s._messages)),
    "the last word of a layer": (
        four("s7-1500", iso=True), (), lambda m: raising(m, IsoSession, "say_goodbye", lambda s: True, 0)),
    "a listener": (
        four("s7-1500", iso=True), (), lambda m: raising(m, SharedListener, "poll", lambda s: True, 30)),
    "a peer": (four("baosky"), (), lambda m: raising(m, Peer, "step", lambda p: p.decl.name == "P1", 20)),
}  # fmt: skip


@pytest.fixture(autouse=True)
def contained(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    monkeypatch.setenv(EXCEPTIONS_VARIABLE, "")
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    monkeypatch.setattr("trcvtui.bench.error_report._written_reports", {})
    yield


def edges(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, list[dict[str, Any]]]:
    """Run a command line; return the STATUS edges that it prints, by instance."""
    main([*words, "--format", "jsonl"])
    found: dict[str, list[dict[str, Any]]] = {}
    for line in capsys.readouterr().out.splitlines():
        record = json.loads(line)
        if "STATUS" in record:
            found.setdefault(record["instance"], []).append(record | {"scenario": "", "cause": ""})
    return found


@pytest.mark.parametrize("what", PLACES)
def test_the_others_have_the_trace_that_they_would_have_had_and_a_replay_is_the_same(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    text, stopped, plant = PLACES[what]
    file, kept = tmp_path / "four.toml", tmp_path / "four.pcapng"
    file.write_text(text)
    good = edges(capsys, "scenario", str(file))
    with monkeypatch.context() as planted:
        plant(planted)
        bad = edges(capsys, "scenario", str(file), "--record", str(kept))
    with monkeypatch.context() as planted:
        plant(planted)
        again = edges(capsys, "replay", str(kept))
    mended = edges(capsys, "replay", str(kept))
    for name in "CD":
        assert bad[name] == good[name]
    assert {name for name in bad if bad[name][-1]["STATUS"] == STOPPED} == {*stopped}
    assert [[r["scan"], r["STATUS"]] for n in "ABCD" for r in again[n]] == [
        [r["scan"], r["STATUS"]] for n in "ABCD" for r in bad[n]
    ]
    assert mended == again
    [report, *_] = sorted(tmp_path.glob("trcvtui-error-*.txt"))
    told = report.read_text()
    assert "KeyError" in told and "name='C1'" in told and "[ledger]" in told
    assert PLANTED not in told and "hex 01 02" not in told


def test_a_scenario_with_an_internal_error_has_not_passed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "four.toml"
    file.write_text(four("baosky"))
    PLACES["a peer"][2](monkeypatch)
    assert main(["scenario", str(file)]) == 1
    assert (
        "found: an internal error of peer P1: KeyError in test_internal_errors.py" in capsys.readouterr().out
    )


def test_a_what_if_guesses_from_the_scan_on_in_which_the_recorded_run_alone_had_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, kept = tmp_path / "four.toml", tmp_path / "four.pcapng"
    file.write_text(four("baosky"))
    with monkeypatch.context() as planted:
        PLACES["a block"][2](planted)
        bad = edges(capsys, "scenario", str(file), "--record", str(kept))
    scan = bad["A"][-1]["scan"]
    assert main(["replay", str(kept), "--set", "instance.D.LEN=4"]) == 0
    told = capsys.readouterr().out
    assert f"scan {scan}: A had an internal error only in the recorded run" in told
    assert f"from scan {scan} on the what-if is a guess" in told


def said(bench: Bench) -> list[str]:
    return [line.event.subject for line in bench.runtime.ledger
            if isinstance(line.event, BenchNote) and line.event.what == INTERNAL_ERROR]  # fmt: skip


@pytest.mark.parametrize("kernel", ["sim", "live"])
@pytest.mark.parametrize("remedy", [("plc stop", "plc run"), ("download A",)])
def test_a_stopped_instance_holds_nothing_and_comes_back_after_stop_and_run_or_a_download(
    kernel: str, remedy: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "four.toml").write_text(four("baosky").replace("set B CONT=1\\n", ""))
    bench = fresh_bench(load_project(tmp_path / "four.toml"), kernel)
    with monkeypatch.context() as planted:
        PLACES["a block"][2](planted)
        run(bench, 100)
        link = bench.runtime.snapshot().connection("C1")
        assert link is not None
        assert (bench.runtime.outputs("A").status, link.state, link.receivers) == (0x8FFF, "closed", ())
        assert bench.runtime.listening_port("C1") is None
        assert said(bench) == ["A"]
    before = bench.runtime.snapshot().instance("C")
    for line in remedy:
        do(bench, line, scans=1)
    run(bench, 100)
    snapshot = bench.runtime.snapshot()
    back, other = snapshot.instance("A"), snapshot.instance("C")
    assert back is not None and other is not None and before is not None
    assert back.jobs_done > 0
    assert other.jobs_done > before.jobs_done or "plc run" in remedy
    bench.close()
    assert bench.leaks() == ()


def test_a_reader_of_the_ledger_that_raises_leaves_the_scans_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "four.toml").write_text(four("baosky"))
    raising(monkeypatch, StreamIndex, "_handle_received", lambda index: True)
    console = Controller(fresh_bench(load_project(tmp_path / "four.toml"), "sim"))
    for _ in range(200):
        console.scan()
    alone = fresh_bench(load_project(tmp_path / "four.toml"), "sim")
    run(alone, 200)
    for name in "ABCD":
        one, other = (b.runtime.snapshot().instance(name) for b in (console.bench, alone))
        assert one == other
    assert said(console.bench) == ["history"]


def test_a_serial_line_that_raises_is_closed_and_the_tcp_blocks_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = four("baosky").replace('"baosky"', '"twincat"')
    text += '[[combuffer]]\nname = "RX"\nsource = "serial"\nport = "/dev/null"\n'
    (tmp_path / "four.toml").write_text(text)
    raising(monkeypatch, PortExchange, "receive", lambda port: True)
    bench = fresh_bench(load_project(tmp_path / "four.toml"), "sim")
    run(bench, 100)
    assert said(bench) == ["RX"]
    assert not bench.runtime.snapshot().combuffers[0].is_up
    assert all(i.jobs_done for i in bench.runtime.snapshot().instances if i.name in "ACD")
    bench.close()


def test_a_command_that_raises_is_an_answer_and_in_the_scan_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "four.toml").write_text(four("baosky"))
    raising(monkeypatch, Peer, "stall", lambda peer: True, 0)
    raising(monkeypatch, DataArea, "resize", lambda area: True, 0)
    console = Controller(fresh_bench(load_project(tmp_path / "four.toml"), "sim"))
    console.handle_line(1, "peer P1 stall")
    console.scan()
    assert console._answers[-1].error == INTERNAL_ERROR
    console.handle_line(2, "resize dA ARRAY[0..3] OF BYTE")
    console.scan()
    assert said(console.bench) == ["command", "command"]
    console.scan()
    assert console.bench.runtime.scans == 3
