"""A copy of a recording to hand on: what was left out is nowhere in it, and Wireshark finds no fault."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from tests.recording.test_recording import LONGEST, NEEDS_TSHARK, begins, mutated, tshark, written
from trcvtui.capture.pcap import (
    RAW_IP,
    USER0,
    interface_block,
    make_block,
    open_capture,
    packet_block,
    secrets_block,
    section_block,
)
from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.recording.journal import WireCall
from trcvtui.recording.recording import JOURNAL_NAME, Recording, RecordingWriter
from trcvtui.recording.strip import StripOptions, strip_recording

BAD = "_ws.malformed || ip.checksum.status == 0 || tcp.checksum.status == 0 || tcp.analysis.flags"
CHECKED = ("-o", "tcp.check_checksum:TRUE", "-o", "ip.check_checksum:TRUE")
ALL = StripOptions(payload=True, secrets=True, names=True)


@pytest.fixture(scope="module")
def a_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("strip") / "run.pcapng"
    written(LONGEST, target)
    return target


def payloads(path: Path) -> list[bytes]:
    with open_capture(path) as capture:
        return [packet.data[40:] for packet in capture if packet.data[:1] == b"E"]


def test_a_copy_without_payload_and_names_has_neither_and_wireshark_finds_no_fault(
    a_file: Path, tmp_path: Path
) -> None:
    target = tmp_path / "copy.pcapng"
    said = list(strip_recording(str(a_file), str(target), ALL))
    assert said == [f"{target}: a capture for Wireshark and trcvtui watch; it cannot be replayed"]
    assert stat.S_IMODE(target.stat().st_mode) == 0o600
    content = target.read_bytes()
    assert b"TRCV_C_1: 16#" in a_file.read_bytes()
    for gone in (b"TRCV_C_1", b"en_r_dropped", b"[[instance]]"):
        assert gone not in content
    assert [len(data) for data in payloads(target)] == [len(data) for data in payloads(a_file)]
    assert any(any(data) for data in payloads(a_file))
    assert not any(any(data) for data in payloads(target))


@NEEDS_TSHARK
def test_wireshark_finds_no_fault_in_a_copy(a_file: Path, tmp_path: Path) -> None:
    target = tmp_path / "copy.pcapng"
    list(strip_recording(str(a_file), str(target), ALL))
    assert tshark(target, *CHECKED, "-Y", BAD) == ""
    lengths = [tshark(path, "-T", "fields", "-e", "tcp.len", "-Y", "tcp") for path in (a_file, target)]
    assert lengths[0] == lengths[1] != ""


def test_each_address_gets_the_same_other_address_and_loopback_stays(tmp_path: Path) -> None:
    source, target = tmp_path / "run.pcapng", tmp_path / "copy.pcapng"
    with source.open("wb") as file:
        file.write(section_block("trcvtui", ("a recording of trcvtui",)))
        file.write(interface_block(RAW_IP, "wire") + interface_block(USER0, JOURNAL_NAME))
        for sender, receiver in (("192.168.7.20", "127.0.0.1"), ("127.0.0.1", "192.168.7.20")):
            ends = bytes(map(int, f"{sender}.{receiver}".split(".")))
            head = bytes.fromhex("45000030000040004006 0000".replace(" ", "")) + ends
            file.write(
                packet_block(
                    0, 1, head + bytes.fromhex("07d0c000" + "00" * 8 + "5018ffff00000000") + b"recipe 7", ()
                )
            )
    said = list(
        strip_recording(str(source), str(target), StripOptions(payload=False, secrets=False, names=True))
    )
    assert "the payload is kept, with names and addresses in it; --no-payload removes it" in said[-1]
    with open_capture(target) as capture:
        packets = [packet.data for packet in capture]
    assert [packet[12:20] for packet in packets] == [
        bytes((10, 0, 0, 1, 127, 0, 0, 1)),
        bytes((127, 0, 0, 1, 10, 0, 0, 1)),
    ]
    assert [packet[40:] for packet in packets] == [b"recipe 7"] * 2


def test_a_name_that_somebody_wrote_into_the_file_later_is_gone_too(a_file: Path, tmp_path: Path) -> None:
    source, target = tmp_path / "run.pcapng", tmp_path / "copy.pcapng"
    name = bytes.fromhex("01000c00c0a80714") + b"meier-2\0" + bytes(4)  # Wireshark keeps what DNS answered
    with source.open("wb") as file:
        file.write(section_block("trcvtui", ("Meier's line",)))
        file.write(
            interface_block(RAW_IP, "wire") + interface_block(USER0, JOURNAL_NAME) + make_block(4, name)
        )
        for comment in ("Meier's pump", "begins in the middle: 5 bytes to the PLC and 0 from it came before"):
            file.write(packet_block(0, 1, bytes(40), (comment,)))
    list(strip_recording(str(source), str(target), StripOptions(payload=False, secrets=False, names=True)))
    assert b"eier" in source.read_bytes() and b"eier" not in target.read_bytes()
    with open_capture(target) as capture:
        assert [len(packet.comments) for packet in capture] == [0, 1]


def test_serial_lines_lose_bytes_and_names(tmp_path: Path) -> None:
    source, target = tmp_path / "run.pcapng", tmp_path / "copy.pcapng"
    writer = RecordingWriter(source)
    writer.add_entries([begins(LONGEST), WireCall(5, "scale", "port read", 1, (), None, b"12.5 kg")])
    writer.close()
    list(strip_recording(str(source), str(target), ALL))
    assert b"12.5 kg" in source.read_bytes()
    assert b"scale" in source.read_bytes()
    content = target.read_bytes()
    assert b"12.5 kg" not in content
    assert b"scale" not in content


def test_a_copy_without_secrets_alone_can_be_replayed_where_there_were_none(
    a_file: Path, tmp_path: Path
) -> None:
    target = tmp_path / "copy.pcapng"
    out = StripOptions(payload=False, secrets=True, names=False)
    assert list(strip_recording(str(a_file), str(target), out)) == []
    assert list(Recording(target).read_entries()) == list(Recording(a_file).read_entries())


@pytest.mark.parametrize("left_out", ["payload", "secrets", "names"])
def test_secrets_are_gone_and_the_journal_with_them(left_out: str, a_file: Path, tmp_path: Path) -> None:
    source, target = tmp_path / "tls.pcapng", tmp_path / "copy.pcapng"
    source.write_bytes(a_file.read_bytes() + secrets_block(b"CLIENT_RANDOM 00 11\n"))
    out = StripOptions(*(each == left_out for each in ("payload", "secrets", "names")))
    said = list(strip_recording(str(source), str(target), out))
    assert "it cannot be replayed" in said[0]
    assert b"CLIENT_RANDOM" not in target.read_bytes()
    assert len(payloads(target)) == len(payloads(a_file))


def test_nothing_to_leave_out_and_a_file_that_is_there_are_refused(
    a_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "copy.pcapng"
    asked = ["recording", "strip", str(a_file)]
    assert main([*asked, str(target)]) == 2
    assert main([*asked, str(a_file), "--no-payload"]) == 2
    target.write_bytes(b"mine")
    assert main([*asked, str(target), "--no-payload"]) == 2
    assert target.read_bytes() == b"mine"
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert "nothing to leave out, expected --no-payload, --no-secrets or --anonymise" in lines[0]


def test_a_copy_of_a_broken_recording_is_made_or_refused_with_a_line(
    a_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.fsync", lambda _: None)  # a thousand times a second on a busy disk
    source = tmp_path / "changed.pcapng"
    for number, content in enumerate(mutated(a_file.read_bytes()[:20_000])):
        source.write_bytes(content)
        target = tmp_path / f"{number}.pcapng"
        try:
            for line in strip_recording(str(source), str(target), ALL):
                assert "\n" not in line
            assert b"TRCV_C_1: 16#7" not in target.read_bytes()
            target.unlink()
        except UserError as told:
            assert "\n" not in str(told)


@NEEDS_TSHARK
def test_wireshark_shows_the_journal_in_words(
    a_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recording", "dissector"]) == 0
    script = tmp_path / "journal.lua"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    shown = tshark(a_file, "-X", f"lua_script:{script}", "-V", "-Y", "trcvtui")
    assert "cannot be read" not in shown
    assert "RunHeader(" in shown
    assert "C1: recv " in shown
    summary = tshark(a_file, "-X", f"lua_script:{script}", "-Y", "trcvtui")
    assert "block 0 of the journal: " in summary
    assert "index of " in summary


@NEEDS_TSHARK
def test_a_broken_journal_is_told_in_wireshark_too(
    a_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["recording", "dissector"])
    script, target = tmp_path / "journal.lua", tmp_path / "changed.pcapng"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    content = bytearray(a_file.read_bytes())
    at = content.index(b"trcvtui journal\n") + 40
    content[at : at + 64] = b"\xff" * 64
    target.write_bytes(content)
    shown = tshark(target, "-X", f"lua_script:{script}", "-V", "-Y", "trcvtui")
    assert "cannot be read" in shown
    assert "Lua Error" not in shown
