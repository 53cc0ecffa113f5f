"""A recording of TLS: packets are what crossed the wire, and the secrets that open them stand beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.certificates import NEEDS_OPENSSL
from tests.recording.test_recording import NEEDS_TSHARK, tshark
from trcvtui.cli.main import main
from trcvtui.recording.journal import CallRecord
from trcvtui.recording.recording import Recording


def recorded(bench: Path, folder: Path, kernel: str, *options: str) -> Path:
    file = folder / "R.pcapng"
    scenario = bench / "tls-server.toml"
    assert main(["scenario", str(scenario), "--kernel", kernel, "--record", str(file), *options]) == 0
    return file


def _answers(file: Path) -> bytes:
    reads = [
        entry
        for entry in Recording(file).read_entries()
        if isinstance(entry, CallRecord) and entry.call == "recv"
    ]
    return b"".join(entry.answer[1] for entry in reads)  # type: ignore[index]


@NEEDS_OPENSSL
@NEEDS_TSHARK
@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_wireshark_reads_what_was_sent_over_tls(
    secure_bench: Path, tmp_path: Path, kernel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = recorded(secure_bench, tmp_path, kernel)
    assert "R.pcapng holds TLS secrets" in capsys.readouterr().err
    assert tshark(file, "-Y", "_ws.malformed") == ""
    streams = {line for line in tshark(file, "-T", "fields", "-e", "tcp.stream").split() if line}
    followed = [tshark(file, "-q", "-z", f"follow,tls,raw,{number}") for number in streams]
    assert any("\t01020304\n" in text and "\n05060708\n" in text for text in followed)
    assert main(["replay", str(file), "--check"]) == 0
    said = capsys.readouterr()
    assert "the same again" in said.out and "holds TLS secrets" in said.err


@NEEDS_OPENSSL
@NEEDS_TSHARK
def test_without_secrets_nothing_is_plain_and_nothing_is_replayed(
    secure_bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = recorded(secure_bench, tmp_path, "sim", "--no-secrets")
    assert "holds TLS secrets" not in capsys.readouterr().err
    assert tshark(file, "-Y", "tls.handshake.type == 1") and not tshark(file, "-Y", "tls && data")
    assert bytes.fromhex("01020304") not in _answers(file)
    assert main(["replay", str(file), "--check"]) == 1
    assert "--no-secrets: it can be viewed, not replayed" in capsys.readouterr().out
