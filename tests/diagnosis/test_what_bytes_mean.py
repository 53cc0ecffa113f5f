"""What the bytes of messages are, where the receiver declares something else; each beside a right twin."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from functools import reduce
from operator import xor
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.bench.bench_lines import do
from tests.diagnosis.doctor_cases import MS, Built, Wire, begin, cotp, static, verdicts_of
from tests.recording.wire import udp
from trcvtui.cli.main import main
from trcvtui.diagnosis.message_joints import find_length_field
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.diagnosis.serial import list_framing_warnings
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.udt.layout.layout import LAYOUTS, lay_out
from trcvtui.udt.layout.values import encode
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import ELEMENTARY, Array, StringType

SCALE = "status : WORD; net : REAL; tare : REAL; serial : UDINT;"
MIXED = "state : BYTE; weight : LREAL; count : INT; value : REAL; mode : BYTE; number : DINT;"
OURS = LAYOUTS["baosky"]


def receiver_of(members: str, **more: object) -> Receiver:
    type_ = join_declarations(
        [read_st(f"TYPE T : STRUCT {members} END_STRUCT END_TYPE", "t.st")], "t.st"
    ).get_type("T")
    size = lay_out(type_, OURS, "T").size
    return static(size, data="rx", room=size, type_name="T", type=type_, rules=OURS, **more)


def of_type(type_: Any, need: int, **more: object) -> Receiver:
    return static(need, data="rx", room=need, type=type_, rules=LAYOUTS["s7-standard"], **more)


def frames(receiver: Receiver, layout: str = "baosky") -> list[bytes]:
    theirs = lay_out(receiver.type, LAYOUTS[layout], "T")  # type: ignore[arg-type]
    found = []
    for k in range(14):
        values = {
            leaf.path: 10 + k + n if leaf.size < 4 else 12.5 * (n + 1) + k
            for n, leaf in enumerate(theirs.leaves())
        }
        whole = {
            path: value if "REAL" in kind(theirs, path) else int(value) for path, value in values.items()
        }
        found.append(encode(theirs, whole))
    return found


def kind(layout: Any, path: str) -> str:
    return next(str(leaf.type.name) for leaf in layout.leaves() if leaf.path == path)


def found_with(
    folder: Path, receiver: Receiver, messages: list[bytes], pause: int = 300 * MS
) -> dict[str, Any]:
    made = Built("")
    r = Random(59)
    if receiver.is_datagram:
        at = begin(r)
        made.packets = [(at + n * pause, udp(one)) for n, one in enumerate(messages)]
    else:
        wire = Wire(r, made, begin(r)).open()
        wire.delayed = 0
        for one in messages:
            wire.say("partner", one)
            wire.wait(pause)
    path = folder / "case.pcapng"
    path.write_bytes(made.file())
    (verdict,) = verdicts_of(path, receivers=(receiver,))
    return verdict


def causes(verdict: dict[str, Any]) -> list[str]:
    return [one["cause"] for one in verdict["findings"]]


def mends(verdict: dict[str, Any]) -> str:
    return " | ".join(one["text"] for one in verdict["findings"][0]["mend"])


# -- a frame with front and back -----------------------------------------------------------------------------


def with_bcc(frame: bytes) -> bytes:
    return b"\x02" + frame + b"\x03" + bytes((reduce(xor, frame + b"\x03"),))


def with_length(frame: bytes) -> bytes:
    return struct.pack(">H", len(frame) + 2) + frame + b"\r\n"


@pytest.mark.parametrize(
    ("layout", "dress", "cause", "named"),
    [
        ("baosky", with_bcc, "header", ["1 byte before", "STX", "2 bytes after", "ETX", "BCC"]),
        ("baosky", with_length, "header", ["2 bytes before", "the length", "2 bytes after", "CR LF"]),
        ("packed", with_length, "header", ["2 bytes before", "CR LF", "lay DATA out", "packed"]),
        ("packed", lambda frame: frame + bytes(12), "padding", ["12 bytes after", "zeros", "packed"]),
        ("baosky", lambda frame: frame + b"\r\n", "frame-long", ["2 bytes after", "CR LF"]),
        (
            "baosky",
            lambda frame: b"\xaa\x55\x10" + frame + b"\x77\x99",
            "header",
            ["3 bytes", "AA 55 10", "77 99"],
        ),
    ],
)
def test_the_first_difference_is_the_cause_and_one_remedy_names_all(
    layout: str, dress: Callable[[bytes], bytes], cause: str, named: list[str], tmp_path: Path
) -> None:
    receiver = receiver_of(MIXED if layout == "packed" else SCALE)
    verdict = found_with(tmp_path, receiver, [dress(one) for one in frames(receiver, layout)])
    assert causes(verdict)[0] == cause
    (mend,) = verdict["findings"][0]["mend"]
    assert [word for word in named if word not in mend["text"]] == []


def test_the_same_frames_bare_are_healthy(tmp_path: Path) -> None:
    receiver = receiver_of(SCALE)
    assert found_with(tmp_path, receiver, frames(receiver))["verdict"] == "healthy"


# -- text ----------------------------------------------------------------------------------------------------

LINES = [f"ST,GS,+{n / 7:07.2f}kg\r\n".encode() for n in range(20, 34)]
DIGITS = [f"{n * 37:08d}{n * 11:08d}".encode() for n in range(20, 34)]
CHARS = Array(((0, 17),), ELEMENTARY["CHAR"])


@pytest.mark.parametrize("messages", [LINES, DIGITS], ids=["lines", "digits"])
def test_text_is_told_where_numbers_are_declared_and_only_there(
    messages: list[bytes], tmp_path: Path
) -> None:
    assert causes(found_with(tmp_path, receiver_of(SCALE), messages))[0] == "text"
    assert causes(found_with(tmp_path, of_type(CHARS, len(messages[0])), messages)) == []


def test_numbers_of_which_all_bytes_are_letters_are_no_text(tmp_path: Path) -> None:
    messages = [struct.pack("<8h", *(0x4141 + n + k for k in range(8))) for n in range(14)]
    assert "text" not in causes(found_with(tmp_path, receiver_of("a : ARRAY[0..7] OF INT;"), messages))


def string(text: str, most: int = 20, places: int = 20) -> bytes:
    return bytes((most, len(text))) + text.encode().ljust(places, b"\0")


TEXTS = ["START 1", "START 2", "STOP 17", "RESET 1"]


def test_a_string_without_its_header_is_received_as_characters(tmp_path: Path) -> None:
    verdict = found_with(tmp_path, of_type(StringType(20), 22), [text.encode() for text in TEXTS * 3])
    assert causes(verdict) == ["frame-short"]
    (mend,) = verdict["findings"][0]["mend"]
    assert "no STRING header" in mend["text"] and mend["set"] == "data.rx.type=ARRAY[0..6] OF CHAR"
    assert mend["tried"]


def test_a_string_of_the_same_size_without_header_has_odd_values(tmp_path: Path) -> None:
    verdict = found_with(
        tmp_path, of_type(StringType(20), 22), [text.ljust(22).encode() for text in TEXTS * 3]
    )
    assert causes(verdict) == ["odd-values"] and "no STRING header" in mends(verdict)


def test_len_alone_never_makes_a_text_without_header_healthy(tmp_path: Path) -> None:
    receiver = of_type(StringType(20), 22)._replace(need=7)
    assert causes(found_with(tmp_path, receiver, [text.encode() for text in TEXTS * 3])) == ["odd-values"]


def test_the_header_of_a_longer_string_tells_its_type(tmp_path: Path) -> None:
    verdict = found_with(tmp_path, of_type(StringType(20), 22), [string(text, 40, 40) for text in TEXTS * 3])
    assert verdict["findings"][0]["mend"][0]["set"] == "data.rx.type=STRING[40]"


def test_a_string_with_its_header_is_healthy_and_a_remark_where_characters_are_declared(
    tmp_path: Path,
) -> None:
    messages = [string(text) for text in TEXTS * 3]
    assert found_with(tmp_path, of_type(StringType(20), 22), messages)["verdict"] == "healthy"
    other = found_with(tmp_path, of_type(Array(((0, 21),), ELEMENTARY["CHAR"]), 22), messages)
    assert causes(other) == [] and [one["cause"] for one in other["remarks"]] == ["header"]


# -- UTF-8 of bytes ------------------------------------------------------------------------------------------

BYTES_13 = Array(((0, 12),), ELEMENTARY["BYTE"])
TELEGRAMS = [bytes((170, 85, 129, 8, n, 0, 126, 37, 0, 200 + n % 50, 0, 6, 187)) for n in range(14)]


@pytest.mark.parametrize("is_datagram", [True, False])
def test_bytes_that_were_sent_as_a_string_are_told_and_data_is_not_enlarged(
    is_datagram: bool, tmp_path: Path
) -> None:
    receiver = of_type(BYTES_13, 13, is_datagram=is_datagram)
    verdict = found_with(tmp_path, receiver, [one.decode("latin-1").encode() for one in TELEGRAMS])
    assert causes(verdict) == ["encoding"] and "bytes, not a string" in mends(verdict)
    assert causes(found_with(tmp_path, receiver, TELEGRAMS)) == []


def test_utf_8_that_turned_back_has_another_size_is_no_encoding(tmp_path: Path) -> None:
    receiver = of_type(BYTES_13, 13, is_datagram=True)
    found = found_with(tmp_path, receiver, [(one + b"\x80").decode("latin-1").encode() for one in TELEGRAMS])
    assert causes(found) == ["datagram-size"]


# -- where messages join and part ----------------------------------------------------------------------------


def several(messages: list[bytes], often: int = 3) -> Iterator[bytes]:
    r, at = Random(5), 0
    while at < len(messages):
        size = r.choice((1, 1, 2, 3)) if at % often else 1
        yield b"".join(messages[at : at + size])
        at += size


def of_length(r: Random, number: int) -> bytes:
    body = r.randbytes(r.randrange(5, 60))
    return b"\x47\x11" + struct.pack(">H", len(body) + 1) + bytes((number,)) + body


RECORDS = [of_length(Random(n), n) for n in range(60)]
WEIGHTS = [f"ST,GS,+{n * 1.37:.2f}kg\r\n".encode() for n in range(60)]
AD_HOC = static(400, adhoc=True, room=400)


@pytest.mark.parametrize("messages", [RECORDS, WEIGHTS], ids=["length", "delimiter"])
def test_messages_of_many_sizes_are_merged_by_what_parts_them(messages: list[bytes], tmp_path: Path) -> None:
    assert causes(found_with(tmp_path, AD_HOC, [*several(messages)])) == ["merged"]
    assert causes(found_with(tmp_path, AD_HOC, messages)) == []


def test_sizes_that_divide_another_by_chance_are_not_merged(tmp_path: Path) -> None:
    r = Random(3)
    messages = [r.randbytes(r.choice((8, 8, 16, 24))) for _ in range(40)]
    assert "merged" not in causes(found_with(tmp_path, AD_HOC, messages))


def in_two(bodies: list[bytes], head: Callable[[bytes], bytes], folder: Path) -> dict[str, Any]:
    made, r = Built(""), Random(23)
    wire = Wire(r, made, begin(r)).open()
    wire.delayed = 0
    for body in bodies:
        for part, pause in ((head(body), r.randrange(40, 71)), (body, r.randrange(350, 380))):
            wire.say("partner", part)
            wire.wait(pause * MS)
    path = folder / "two.pcapng"
    path.write_bytes(made.file())
    (verdict,) = verdicts_of(path, receivers=(static(128, adhoc=True, room=128),))
    return verdict


def test_a_head_and_its_body_in_two_pieces_are_split_by_an_ad_hoc_job(tmp_path: Path) -> None:
    r = Random(7)
    same, many = (
        [r.randbytes(size() if callable(size) else size) for _ in range(20)]
        for size in (60, lambda: r.randrange(9, 90))
    )

    def head(body: bytes) -> bytes:
        return b"\x47\x11" + struct.pack(">H", len(body))

    found = in_two(same, head, tmp_path)
    assert causes(found) == ["adhoc-splits"] and found["findings"][0]["mend"][0]["tried"]
    assert causes(in_two(many, head, tmp_path)) == ["adhoc-splits"]
    assert causes(in_two(same, lambda _: r.randbytes(4), tmp_path)) == []  # two kinds of messages in turns


# -- plain TCP where ISO-on-TCP is spoken --------------------------------------------------------------------


def test_plain_tcp_at_an_iso_connect_is_a_finding(tmp_path: Path) -> None:
    iso = static(10, is_whole=True)
    verdict = found_with(tmp_path, iso, [b"HELLO PLC\r\n"])
    assert causes(verdict) == ["plain-tcp"] and "48 ('H')" in verdict["findings"][0]["evidence"][0]
    assert causes(found_with(tmp_path, iso, [cotp(0xE0, b"\x01\x00", b"\x03\x02")])) == []


# -- a string that is never full of one text -----------------------------------------------------------------

SERIAL = """
dialect = "twincat"
[[data]]
name = "text"
type = "STRING"
[[combuffer]]
name = "RX"
source = "sim"
[[instance]]
name = "RS"
block = "ReceiveString"
RxBuffer = "RX"
data = "text"
Timeout = "T#200ms"
"""


def test_texts_that_follow_each_other_without_a_gap_are_told_with_their_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(SERIAL)
    steps = "".join(f"feed RX hex {one.hex(' ')}\nrun T#100ms\n" for one in LINES * 3)
    text = f"project = 'p.toml'\n[scenario]\nname = 'scale'\nsteps = '''\n{steps}doctor RS framing\n'''\n"
    (tmp_path / "s.toml").write_text(text)
    assert main(["scenario", str(tmp_path / "s.toml")]) == 0
    (tmp_path / "s.toml").write_text(text.replace("doctor RS framing", "doctor healthy"))
    assert main(["scenario", str(tmp_path / "s.toml")]) == 1
    told = capsys.readouterr().out
    assert "suffix 0D 0A (CR LF)  [framing RS apply 1]" in told and "without the suffix" not in told


def test_the_card_points_to_the_framing_between_the_errors(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(SERIAL)
    bench = fresh_bench(load_project(tmp_path / "p.toml"), "sim")
    for one in LINES:
        do(bench, f"feed RX hex {one.hex(' ')}", scans=10)
    (told,) = list_framing_warnings(bench.runtime.snapshot(), bench.project, "RS")
    bench.close()
    assert "a gap of 200 ms never comes" in told and "key B" in told


# -- a project from bytes alone ------------------------------------------------------------------------------


def modbus(n: int) -> bytes:
    body = bytes((255, 4, 0, n % 250, 0, 1)) if n % 3 else bytes((255, 16, 0, n % 250, 0, 2, 4, 1, 2, 3, 4))
    return struct.pack(">HHH", n * 7, 0, len(body)) + body


def session(n: int) -> bytes:
    data = Random(n).randbytes(4 + n * 17 % 57)
    return (
        struct.pack("<HHI", 0x6F, len(data), 0xD4C3B2A1)
        + bytes(4)
        + struct.pack("<Q", n * 999)
        + bytes(4)
        + data
    )


@pytest.mark.parametrize(("make", "said"), [(modbus, (4, 2, "big", 6)), (session, (2, 2, "little", 24))])
def test_a_length_field_is_that_which_is_right_in_each_message(
    make: Callable[[int], bytes], said: tuple[object, ...], tmp_path: Path
) -> None:
    messages = [make(n) for n in range(120)]
    assert find_length_field(messages) == said
    assert suggested(messages, tmp_path)[0].startswith("# length field: 2 bytes")


def test_a_suffix_that_stands_inside_messages_is_refused_with_what_speaks_against_it(tmp_path: Path) -> None:
    r = Random(4)
    messages = [r.randbytes(r.randrange(1, 9)) + b"\r\nQ7" + r.randbytes(3) for _ in range(150)]
    lines = suggested(messages, tmp_path)
    assert lines[0].startswith("# messages of ") and any("0 of 149 pauses follow" in one for one in lines)


def suggested(messages: list[bytes], folder: Path) -> list[str]:
    made, r = Built(""), Random(6)
    wire = Wire(r, made, begin(r)).open()
    wire.delayed = 0
    for one in messages:
        wire.say("partner", one)
        wire.wait(50 * MS)
    (folder / "c.pcapng").write_bytes(made.file())
    (folder / "new.toml").unlink(missing_ok=True)
    main(["doctor", str(folder / "c.pcapng"), "--suggest", str(folder / "new.toml")])
    return [line for line in (folder / "new.toml").read_text().splitlines() if line.startswith("# ")][1:]


# -- bad input -----------------------------------------------------------------------------------------------


def test_a_message_set_is_judged_within_two_seconds(tmp_path: Path) -> None:
    r = Random(8)
    kinds = ("INT", "DINT", "REAL", "LREAL", "WORD", "BYTE", "BOOL")
    large = receiver_of(" ".join(f"m{n} : {r.choice(kinds)};" for n in range(256)))
    of_one_size = [r.randbytes(large.need + 37) for _ in range(40)]
    of_all = [r.randbytes(1 + n % 1400) for n in range(10_000)]
    for messages in (of_one_size, of_all, [b"\x02"] * 50, [b"\xc3"] * 50):
        for adhoc in (False, True):
            start = time.process_time()
            found_with(tmp_path, large._replace(adhoc=adhoc), messages, 20 * MS)
            spent = time.process_time() - start
            assert spent < 2 + len(messages) / 5_000, (len(messages), spent)  # reading the file aside
