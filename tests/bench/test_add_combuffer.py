"""`add combuffer`: one more line of a running bench, with the blocks on it, as good as one of the file."""

from __future__ import annotations

from pathlib import Path

from tests import golden
from tests.local_driver import LocalDriver
from trcvtui.commands.table import parse_line
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project

EMPTY = 'dialect = "twincat"\n'


def desk(folder: Path) -> LocalDriver:
    file = folder / "empty.toml"
    file.write_text(EMPTY, encoding="utf-8")
    return LocalDriver(fresh_bench(load_project(file), "sim"), pause=1)


def test_a_cable_that_is_added_carries_what_an_added_block_sends(tmp_path: Path) -> None:
    console = desk(tmp_path)
    console.do(
        "add combuffer TX per_cycle=1",
        "add combuffer RX source=TX",
        "add instance SB block=SendByte TxBuffer=TX SendByte=65",
        "add instance RB block=ReceiveByte RxBuffer=RX",
    )
    console.do("pulse SB EN")
    console.scan()
    assert console.bench.runtime.outputs("RB").byte == 65


def test_a_stream_can_be_added_after_blocks_that_run(tmp_path: Path) -> None:
    console = desk(tmp_path)
    console.do(
        "add connect C1 LocalAddress=127.0.0.1",
        "add data piece ARRAY[0..7] OF BYTE",
        "add data out ARRAY[0..7] OF BYTE",
        "add data text STRING[20]",
        "add instance T block=TRCV_C connect=C1 data=piece ADHOC=1 CONT=1 EN_R=1",
        "add instance S block=TSEND_C connect=C1 data=out CONT=1",
        "add peer P remote=@C1",
    )
    console.do("add combuffer RX source=T", "add combuffer TX line=S")
    console.do("add instance SS block=SendString TxBuffer=TX data=text", "write text 'hello there'")
    for _ in range(5):
        console.scan()
    console.do("peer P connect")
    console.do("pulse SS EN", 'peer P send text "hi"')
    for _ in range(12):
        console.scan()
    assert console.bench.peers["P"].has_received(b"hello there")
    recording = console.bench.runtime.recording("RX")
    assert (recording.source, [chunk.payload for chunk in recording.chunks]) == ("tcp", [b"hi"])


def test_what_is_no_combuffer_is_refused(tmp_path: Path) -> None:
    console = desk(tmp_path)
    console.do("add connect C9")
    project = console.bench.project
    golden.mistakes("lines that add a ComBuffer", lambda line: parse_line(line, project, "w"))
