"""`framing RX`, `framing RD apply 1`: what a ComBuffer has received is told, and an instance set so."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests import golden
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import EngineTiming, LineAnswer

CONFIGS = Path(__file__).parents[3] / "configs"
PLAIN = """
dialect = "twincat"
[[data]]
name = "rx"
type = "ARRAY[0..7] OF BYTE"
[[data]]
name = "text"
type = "STRING[40]"
[[data]]
name = "short"
type = "STRING[1]"
[[combuffer]]
name = "RX"
[[combuffer]]
name = "RX2"
[[instance]]
name = "RD"
block = "ReceiveData"
RxBuffer = "RX"
data = "rx"
SizeReceiveData = 8
[[instance]]
name = "RS"
block = "ReceiveString"
RxBuffer = "RX2"
data = "text"
Suffix = "short"
[[instance]]
name = "SB"
block = "SendByte"
TxBuffer = "RX2"
"""


def desk(file: Path) -> Controller:
    return Controller(fresh_bench(load_project(file), "sim"))


@pytest.fixture
def plain(tmp_path: Path) -> Controller:
    file = tmp_path / "plain.toml"
    file.write_text(PLAIN, encoding="utf-8")
    return desk(file)


def say(console: Controller, line: str) -> LineAnswer:
    console.handle_line(1, line)
    return console.picture(UpdateRequest(), EngineTiming(), 0).answers[-1]


def feed(console: Controller, buffer: str, numbers: range) -> None:
    """Let lines arrive, one each 200 ms."""
    for number in numbers:
        assert say(console, f'feed {buffer} text "\\x02code {number * 37}\\r\\n"').error == ""
        for _ in range(20):
            console.scan()


@pytest.mark.parametrize("name", ["RX", "RD"])
def test_the_advice_is_told_of_a_combuffer_and_of_its_reader(name: str) -> None:
    console = desk(CONFIGS / "twincat-line.toml")
    feed(console, "RX", range(8))
    told = say(console, f"framing {name}").message.splitlines()
    assert told[:3] == [
        "84 bytes in 8 chunks of a simulated line",
        "1. prefix 02 (STX), suffix 0D 0A (CR LF)",
        "   8 of 8 frames end in 0D 0A (CR LF); 0D 0A occurs nowhere else",
    ]


def test_a_proposal_that_is_applied_writes_the_marks_and_the_next_frame_comes_so() -> None:
    console = desk(CONFIGS / "twincat-line.toml")
    feed(console, "RX", range(8))
    assert say(console, "framing RD apply 1").message == (
        "write prefix hex 02; write suffix hex 0D 0A; pulse RD Reset; "
        "set RD LenPrefix=1 LenSuffix=2 SizeReceiveData=16 Timeout=T#0ms"
    )
    console.scan()
    say(console, 'feed RX text "noise\\x024006381\\r\\nnext"')
    console.scan()
    out = console.bench.runtime.outputs("RD")
    assert (out.done, out.rcvd_len, console.bench.runtime.data("rx", 10)) == (True, 10, b"\x024006381\r\n")


def test_where_no_variable_holds_the_marks_new_ones_do_and_a_larger_data_the_frame(plain: Controller) -> None:
    feed(plain, "RX", range(10, 20))
    assert say(plain, "framing RD apply 1").message.split("; ") == [
        "resize rx ARRAY[0..10] OF BYTE",
        "add data RD_prefix ARRAY[0..3] OF BYTE",
        "write RD_prefix hex 02",
        "add data RD_suffix ARRAY[0..3] OF BYTE",
        "write RD_suffix hex 0D 0A",
        "delete RD",
        "create ReceiveData RD RxBuffer=RX data=rx pPrefix=RD_prefix pSuffix=RD_suffix task=MAIN "
        "SizeReceiveData=8",
        "pulse RD Reset",
        "set RD LenPrefix=1 LenSuffix=2 SizeReceiveData=11 Timeout=T#0ms",
    ]
    plain.scan()
    feed(plain, "RX", range(21, 22))
    assert plain.bench.runtime.data("rx") == b"\x02code 777\r\n"


def test_a_receivestring_gets_its_marks_as_texts(plain: Controller) -> None:
    feed(plain, "RX2", range(10, 20))
    assert say(plain, "framing RS apply 2").message.split("; ") == [
        "add data RS_suffix ARRAY[0..3] OF BYTE",
        "write RS_suffix hex 0D 0A 00",
        "delete RS",
        "create ReceiveString RS RxBuffer=RX2 data=text Suffix=RS_suffix task=MAIN",
        "pulse RS Reset",
        "set RS Timeout=T#0ms",
    ]
    plain.scan()
    feed(plain, "RX2", range(21, 22))
    assert plain.bench.runtime.data("text", 12) == b"\x02code 777\r\n\0"


def test_a_mistake_is_one_line(plain: Controller) -> None:
    golden.answers("framing", lambda line: [say(plain, line).error])


def test_where_nothing_fits_apply_says_so(plain: Controller) -> None:
    say(plain, f"feed RX hex {random.Random(3).randbytes(40).hex(' ')}")
    plain.scan()
    assert say(plain, "framing RD apply 1").error == (
        "prompt: found no proposal (nothing fits: in 40 bytes no mark, length, size or pause separates "
        "frames), expected a recording that splits into frames"
    )


def test_a_number_after_the_last_is_answered_with_those_there_are(plain: Controller) -> None:
    feed(plain, "RX", range(10, 20))
    wrong = say(plain, "framing RD apply 9").error
    assert wrong.startswith("prompt: found proposal 9, expected one of 1, 2")


SHARED = """
dialect = "twincat"
start = "write crlf '$R$L'"
[[data]]
name = "crlf"
type = "STRING[3]"
[[data]]
name = "one"
type = "STRING[80]"
[[data]]
name = "two"
type = "STRING[80]"
[[combuffer]]
name = "RX"
[[combuffer]]
name = "RX2"
[[instance]]
name = "R1"
block = "ReceiveString"
RxBuffer = "RX"
data = "one"
Suffix = "crlf"
[[instance]]
name = "R2"
block = "ReceiveString"
RxBuffer = "RX2"
data = "two"
Suffix = "crlf"
"""


def test_a_mark_that_another_instance_has_too_is_left_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "shared.toml"
    file.write_text(SHARED, encoding="utf-8")
    console = desk(file)
    for number in range(12):
        say(console, f'feed RX text "\x02code {number * 37}\x03"')
        for _ in range(20):
            console.scan()
    assert say(console, "framing R1 apply 1").message.split("; ") == [
        "add data R1_prefix ARRAY[0..3] OF BYTE",
        "write R1_prefix hex 02 00",
        "add data R1_suffix ARRAY[0..3] OF BYTE",
        "write R1_suffix hex 03 00",
        "delete R1",
        "create ReceiveString R1 RxBuffer=RX data=one Prefix=R1_prefix Suffix=R1_suffix task=MAIN",
        "pulse R1 Reset",
        "set R1 Timeout=T#0ms",
    ]
    assert console.bench.runtime.data("crlf", 3) == b"\r\n\0"
    say(console, 'feed RX2 text "left alone\r\n"')
    console.scan()
    assert console.bench.runtime.data("two", 12) == b"left alone\r\n"
    again = say(console, "framing R1 apply 1").message.split("; ")
    assert again[:2] == ["write R1_prefix hex 02 00", "write R1_suffix hex 03 00"]  # these are its own


def test_one_variable_at_both_pins_holds_a_mark_that_both_begins_and_ends(plain: Controller) -> None:
    for number in range(12):
        body = random.Random(number).randbytes(4 + number % 5).replace(b"~", b"")
        say(plain, f"feed RX hex 7E {body.hex(' ')} 7E")
        plain.scan()
    for line in ("add data flag ARRAY[0..1] OF BYTE", "delete RD"):
        say(plain, line)
    say(
        plain,
        "create ReceiveData RD RxBuffer=RX data=rx pPrefix=flag pSuffix=flag task=MAIN SizeReceiveData=8",
    )
    assert say(plain, "framing RD apply 1").message.split("; ") == [
        "resize rx ARRAY[0..9] OF BYTE",
        "write flag hex 7E",
        "write flag hex 7E",
        "pulse RD Reset",
        "set RD LenPrefix=1 LenSuffix=1 SizeReceiveData=10 Timeout=T#0ms",
    ]


def test_what_receivedata_cannot_do_is_not_applied(plain: Controller) -> None:
    for number, size in enumerate((3, 9, 5, 17, 9, 4, 11, 6, 5, 8, 12, 7)):
        body = random.Random(number).randbytes(size)
        say(plain, f"feed RX hex 00 07 00 00 00 {size:02X} {body.hex(' ')}")
        for _ in range(20):
            plain.scan()
    assert say(plain, "framing RX").message.splitlines()[1].startswith("1. length field: 2 bytes")
    answer = say(plain, "framing RD apply 1")
    assert "cannot be set: ReceiveData has no length field" in answer.error


def test_the_recording_of_a_combuffer_is_in_the_picture_that_asks_for_it(plain: Controller) -> None:
    feed(plain, "RX", range(3))
    ((name, recording),) = plain.picture(UpdateRequest(recordings_of=("RX",)), EngineTiming(), 0).recordings
    assert (name, recording.size, [chunk.t_ns for chunk in recording.chunks]) == (
        "RX",
        29,
        [0, 200_000_000, 400_000_000],
    )
