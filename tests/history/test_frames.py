"""The frames of a ComBuffer as one stream: each byte that came stands in it, with what became of it."""

from __future__ import annotations

from tests.scenario.scenarios import CONFIGS
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.history.records import HistoryRequest, HistoryWindow
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import EngineTiming

MARKS = ("prefix RD hex 02", "suffix RD hex 0D 0A", "set RD Timeout=50")


def line(*lines: str) -> Controller:
    console = Controller(fresh_bench(load_project(CONFIGS / "twincat-line.toml"), "sim"))
    for text in lines:
        fed(console, text, scans=0)
    return console


def fed(console: Controller, text: str, scans: int = 1) -> None:
    console.handle_line(0, text)
    for _ in range(scans):
        console.scan()


def seen(console: Controller) -> HistoryWindow:
    picture = console.picture(UpdateRequest(history=HistoryRequest("RX", 0, 8192)), EngineTiming(), 100)
    console.bench.close()
    assert picture.history is not None
    assert not [answer.error for answer in picture.answers if answer.error]
    return picture.history


def test_noise_frames_and_dropped_parts_stand_in_the_order_in_which_they_came() -> None:
    console = line(*MARKS)
    for text, scans in (("FF EE 02 41 0D", 1), ("0A 01 02 55", 8), ("02 66", 1)):
        fed(console, f"feed RX hex {text}", scans)
    fed(console, "set RD Reset=1")
    window = seen(console)
    assert window.content == bytes.fromhex("FFEE 02410D0A 01 0255 0266")
    told = [(span.size, span.done, span.prefix, span.suffix, span.reason) for span in window.jobs]
    assert told == [
        (2, False, 0, 0, "noise before the prefix"),
        (4, True, 1, 2, ""),
        (1, False, 0, 0, "noise before the prefix"),
        (2, True, 1, 0, "ended by a gap"),
        (2, False, 0, 0, "incomplete, Reset"),
    ]
    assert [(span.position, span.size, span.number) for span in window.recvs] == [
        (0, 5, 1),
        (5, 4, 2),
        (9, 2, 3),
    ]


def test_all_bytes_of_much_noise_stand_there() -> None:
    console = line("prefix RD hex 02", "suffix RD hex 0A")
    fed(console, f"feed RX hex {'FF ' * 200} {'EE ' * 99}")
    window = seen(console)
    (noise,) = window.jobs
    assert (noise.whole, noise.size, noise.is_kept) == (299, 299, True)
    assert window.content == b"\xff" * 200 + b"\xee" * 99


def test_what_waits_and_what_never_had_room_stand_where_they_came() -> None:
    console = line("set RD SizeReceiveData=0")
    fed(console, "feed RX random 310")
    waiting, lost = seen(console).jobs
    assert (waiting.size, waiting.is_open) == (300, True)
    assert (lost.position, lost.whole, lost.is_kept, lost.reason) == (300, 10, True, "the ComBuffer is full")
