"""ISO-on-TCP and others: python-snap7 exchanges messages with our blocks, tshark reads what we send."""

from __future__ import annotations

import shutil
import struct
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from snap7.connection import ISOTCPConnection
from snap7.error import S7ConnectionError

from tests.bench.iso_desk import PASSIVE, Desk
from trcvtui.net.kernel import Handle
from trcvtui.net.results import Fault, WouldBlock
from trcvtui.net.sim.kernel import SimKernel

LIVE_LIMIT = 5.0  # s


def snap7_partner(desk: Desk, called: int = 0xE002) -> ISOTCPConnection:
    return ISOTCPConnection("127.0.0.1", desk.port(), local_tsap=0xE001, remote_tsap=called)


def test_python_snap7_exchanges_messages_with_trcv_c_and_tsend_c(tmp_path: Path) -> None:
    desk = Desk(PASSIVE, tmp_path, "live")
    desk.say("set S CONT=1", "set R CONT=1 EN_R=1", "run 3")
    partner = snap7_partner(desk)
    with ThreadPoolExecutor(1) as outside:
        connecting = outside.submit(partner.connect, LIVE_LIMIT)
        desk.until(connecting.done)
        connecting.result()
        desk.until_status("R", "7006")
        for message in (b"hello", bytes(range(256)) * 3, b"!"):
            outside.submit(partner.send_data, message).result(LIVE_LIMIT)
            desk.until_done("R")
            assert desk.bench.runtime.outputs("R").rcvd_len == len(message)
            assert desk.bench.runtime.data("rx", len(message)) == message
        desk.say("write tx random 2000 seed=1", "set S LEN=900")
        for _ in range(2):
            desk.say("pulse S REQ")
            desk.until_done("S")
            assert outside.submit(partner.receive_data).result(LIVE_LIMIT) == desk.bench.runtime.data(
                "tx", 900
            )
            desk.say("run 2")
        outside.submit(partner.disconnect).result(LIVE_LIMIT)
        desk.until_status("R", "80C5")
    desk.close()


def test_python_snap7_is_refused_for_a_tsap_that_nobody_has(tmp_path: Path) -> None:
    desk = Desk(PASSIVE, tmp_path, "live")
    desk.say("set R CONT=1", "run 3")
    partner = snap7_partner(desk, called=0xE009)
    with ThreadPoolExecutor(1) as outside:
        connecting = outside.submit(partner.connect, LIVE_LIMIT)
        desk.until(connecting.done)
        with pytest.raises(S7ConnectionError):
            connecting.result()
    assert [note.detail for note in desk.notes("client dropped")] == ["no CONNECT has the TSAP e0 09"]
    desk.close()


# -- tshark -------------------------------------------------------------------------------------------------

ISO_PORT, OTHER_PORT = 102, 50_000


class Wire:
    """What crosses the simulated wire, as a capture file: the called side is port 102."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.called_port = 0
        self._packets: list[bytes] = []
        self._sent = {True: 1, False: 1}  # by "from the called side"
        send = SimKernel.send

        def tapped(kernel: SimKernel, handle: Handle, data: memoryview) -> int | WouldBlock | Fault:
            got = send(kernel, handle, data)
            end = kernel.local_end(handle)
            if isinstance(got, int) and end is not None:
                self._put(end.port == self.called_port, bytes(data[:got]))
            return got

        patch.setattr(SimKernel, "send", tapped)

    def _put(self, is_called: bool, data: bytes) -> None:
        ports = (ISO_PORT, OTHER_PORT) if is_called else (OTHER_PORT, ISO_PORT)
        seq, ack = self._sent[is_called], self._sent[not is_called]
        self._sent[is_called] += len(data)
        tcp = struct.pack(">HHIIBBHHH", *ports, seq, ack, 5 << 4, 0x18, 65535, 0, 0)
        hosts = (b"\x0a\0\0\x02", b"\x0a\0\0\x01") if is_called else (b"\x0a\0\0\x01", b"\x0a\0\0\x02")
        size = 20 + len(tcp) + len(data)
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, size, 0, 0, 64, 6, 0, *hosts)
        self._packets.append(ip + tcp + data)

    def write(self, file: Path) -> None:
        head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 101)
        records = [
            struct.pack("<IIII", n // 1000, n % 1000 * 1000, len(packet), len(packet)) + packet
            for n, packet in enumerate(self._packets)
        ]
        file.write_bytes(head + b"".join(records))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_our_traffic_as_tpkt_and_cotp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wire = Wire(monkeypatch)
    two = PASSIVE + PASSIVE[PASSIVE.index("[[peer]]") :].replace("P1", "P2").replace(
        'remote_tsap = "16#E002"', 'remote_tsap = "16#E009"'
    )
    desk = Desk(two, tmp_path)
    desk.say("set S CONT=1", "set R CONT=1 EN_R=1", "run 3")
    wire.called_port = desk.port()
    desk.say("peer P1 connect")
    desk.until_status("R", "7006")
    desk.say("peer P1 send random 3 seed=1", "run 3", "peer P1 send random 1500 seed=2", "run 3")
    desk.say("write tx random 2000 seed=4", "pulse S REQ", "run 3", "peer P1 close", "run 3")
    desk.say("peer P2 connect", "run 5")
    desk.close()
    capture = tmp_path / "iso.pcap"
    wire.write(capture)
    fields = ("frame.protocols", "cotp.type", "cotp.eot", "_ws.malformed")
    asked = ["tshark", "-n", "-r", str(capture), "-T", "fields", *(w for f in fields for w in ("-e", f))]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=60, check=True)
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert all(":tpkt:cotp" in protocols and not malformed for protocols, _, _, malformed in rows)
    kinds = [kind for _, kinds, _, _ in rows for kind in kinds.split(",")]
    assert kinds == ["0x0e", "0x0d", *["0x0f"] * 5, "0x0e", "0x08"]
