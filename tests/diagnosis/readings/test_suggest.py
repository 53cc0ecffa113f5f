"""`doctor --suggest`: a project from bytes alone, which then takes each message as a job."""

from __future__ import annotations

import json
import random
import struct
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from tests.diagnosis.doctor_cases import MS, Built, S, Telegrams, Wire, begin, healthy_iso, healthy_tls
from tests.recording.wire import udp
from trcvtui.cli.main import main
from trcvtui.diagnosis.readings.members import find_message_type
from trcvtui.udt.layout.layout import LAYOUTS, lay_out
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join_declarations


def said(messages: Sequence[bytes], cuts: Sequence[int] = (), plc_calls: bool = False) -> Built:
    """Return a capture in which the partner says messages, 50 ms apart; each cut at these places."""
    r = random.Random(1)
    built = Built("healthy")
    wire = Wire(r, built, begin(r), plc_calls=plc_calls).open()
    for message in messages:
        for start, end in zip((0, *cuts), (*cuts, len(message)), strict=True):
            wire.say("partner", message[start:end])
            wire.wait(2 * MS)
        wire.wait(50 * MS)
    wire.wait(S)
    wire.fin("partner")
    return built


class Suggested:
    """What is suggested for a capture, and what the project shows on it."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.capture, self.path = folder / "line.pcapng", folder / "new.toml"
        self._capsys = capsys

    def of(self, built: Built) -> str:
        self.capture.write_bytes(built.file())
        main(["doctor", str(self.capture), "--suggest", str(self.path)])
        return self._capsys.readouterr().err

    def dones(self, block: str) -> list[int]:
        """Return RCVD_LEN, or the size, of each DONE that the project shows on the capture."""
        assert main(["watch", str(self.capture), "--project", str(self.path), "--format", "jsonl"]) == 0
        out, errors = self._capsys.readouterr()
        assert "unassigned" not in errors
        found = [json.loads(line) for line in out.splitlines()]
        return [one.get("RCVD_LEN", 0) for one in found if one.get("block") == block and one["DONE"]]


@pytest.fixture
def suggested(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Suggested:
    return Suggested(tmp_path, capsys)


def telegrams(mark: str, count: int) -> list[bytes]:
    """Return messages of 18 bytes: head, counter, REAL, whole number, constant, counter of 4 bytes."""
    r = random.Random(3)
    return [
        b"\xaa\x55"
        + struct.pack(f"{mark}HfhH", 60_000 + n, 20 + r.random() * 5, 700 + r.randrange(-60, 60), 0x1234)
        + struct.pack(f"{mark}I", 70_000 + 10 * n)
        + bytes([7, 7])
        for n in range(count)
    ]


@pytest.mark.parametrize(("mark", "order"), [(">", "big"), ("<", "little")])
@pytest.mark.parametrize("plc_calls", [False, True])
def test_messages_of_one_size_are_static_jobs_with_their_members(
    mark: str, order: str, plc_calls: bool, suggested: Suggested
) -> None:
    told = suggested.of(said(telegrams(mark, 40), plc_calls=plc_calls))
    assert "messages of 18 bytes: 39 of 39" in told
    made = tomllib.loads(suggested.path.read_text())
    assert made["data"][0]["byte_order"] == order
    assert made["instance"][0]["LEN"] == 18
    types = suggested.path.with_suffix(".st").read_text()
    for member in ("counter_2 : UINT", "value_4 : REAL", "number_8 : INT", "counter_12 : UDINT"):
        assert member in types, types
    assert "always AA 55" in types
    assert suggested.dones("TRCV_C") == [18] * 40


def test_lines_of_text_in_a_stream_are_cut_by_receivedata(suggested: Suggested) -> None:
    r = random.Random(5)
    lines = [f"{r.random() * 1000:+.{r.randrange(1, 5)}f} kg\r\n".encode() for _ in range(40)]
    told = suggested.of(said(lines, cuts=(3,)))
    assert "suffix 0D 0A (CR LF)" in told
    made = tomllib.loads(suggested.path.read_text())
    assert made["dialect"] == "twincat"
    assert len(suggested.dones("ReceiveData")) == 40


def test_messages_of_any_size_are_received_ad_hoc(suggested: Suggested) -> None:
    r = random.Random(7)
    messages = [bytes(r.randrange(256) for _ in range(r.randrange(5, 60))) for _ in range(30)]
    told = suggested.of(said(messages))
    assert "came in one piece" in told
    assert suggested.dones("TRCV_C") == [len(one) for one in messages]


def test_datagrams_are_received_by_urecv_c(suggested: Suggested) -> None:
    built = Built("healthy")
    sizes = [8 + n % 5 for n in range(12)]
    built.packets = [(S + n * 100 * MS, udp(bytes([n]) * size)) for n, size in enumerate(sizes)]
    assert "messages of 8 to 12 bytes" in suggested.of(built)
    assert suggested.dones("URECV_C") == sizes


@pytest.mark.parametrize("make", [healthy_tls, healthy_iso])
def test_for_what_is_inside_a_session_nothing_is_suggested(
    make: Callable[[random.Random, Built], None], suggested: Suggested
) -> None:
    built = Built("healthy")
    make(random.Random(2), built)
    assert "expected a capture with 3 messages" in suggested.of(built)
    assert not suggested.path.exists()


def test_a_file_that_is_there_is_kept(suggested: Suggested) -> None:
    suggested.path.write_text("mine")
    told = suggested.of(said(telegrams("<", 10)))
    assert "new.toml" in told
    assert suggested.path.read_text() == "mine"
    assert not suggested.path.with_suffix(".st").exists()


def test_random_bytes_have_no_members() -> None:
    for seed in range(40):
        r = random.Random(seed)
        found = find_message_type([r.randbytes(32) for _ in range(60)])
        assert found is None, found


def test_a_type_that_is_found_has_the_size_of_the_message_whatever_is_in_it() -> None:
    for seed in range(60):
        r = random.Random(seed)
        size = r.randrange(1, 90)
        device = Telegrams(r, size)
        messages = [device.next() for _ in range(r.randrange(4, 40))]
        found = find_message_type(messages)
        if found is not None:
            assert sum(one.size for one in found.members) == size
            type_ = join_declarations([read_st(found.st("T"), "t.st")], "t.st").get_type("T", "t.st")
            assert lay_out(type_, LAYOUTS["packed"], "T").size == size
