"""TURCV and TUSEND in front of socat: one datagram a job, one too large, and an answer to the sender.

Once on a UDP_CONFIG, once on a connection description of UDP that TCON has set up.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.terminal import need
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.plc import commands
from trcvtui.project.file import load_project
from trcvtui.scenario.command import LivePace

MOST_SCANS = 500


class Plc:
    """A bench on real sockets whose TUSEND_1 answers to the ADDR that TURCV_1 writes."""

    def __init__(self, folder: Path, project: str, local: str) -> None:
        self.local = local
        text = (CONFIGS / project).read_text().replace('addr = "TARGET"', 'addr = "SOURCE"')
        file = folder / "udp.toml"
        file.write_text(text)
        self.bench, self.pace = Bench(load_project(file), "live"), LivePace()

    def shows(self, instance: str, *codes: int) -> list[int]:
        """Let scans pass until these codes have shown, in this order; return what was between."""
        wanted, seen = list(codes), []
        for _ in range(MOST_SCANS):
            self.pace.next_scan(self.bench)
            seen.append(self.bench.runtime.outputs(instance).status)
            if seen[-1] == wanted[0]:
                wanted.pop(0)
            if not wanted:
                return seen
        raise AssertionError(f"never: {[f'{code:04X}' for code in seen[-20:]]}")


@pytest.fixture(params=["UDP_CONFIG", "CONNECT"])
def plc(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Plc]:
    if request.param == "UDP_CONFIG":
        made = Plc(tmp_path, "s7-udp.toml", "U1")
    else:
        made = Plc(tmp_path, "s7-udp-connect.toml", "C1")
        made.bench.runtime.submit(commands.PulseInput("TCON_1", "REQ"))
        made.shows("TCON_1", 0x7001, 0x7002, 0x0000)
    yield made
    made.bench.close()
    assert made.bench.leaks() == ()


def test_socat_sends_too_much_then_a_right_datagram_and_gets_the_answer(plc: Plc) -> None:
    runtime = plc.bench.runtime
    runtime.submit(commands.SetInput("TURCV_1", "EN_R", True))
    plc.shows("TURCV_1", 0x7001, 0x7002)
    end = f"UDP4:127.0.0.1:{runtime.listening_port(plc.local)},bind=127.0.0.1"
    with subprocess.Popen(
        [need("socat"), end, "STDIO"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as socat:
        assert socat.stdin is not None and socat.stdout is not None
        os.write(socat.stdin.fileno(), b"123456789")  # DATA has 8 bytes
        plc.shows("TURCV_1", 0x80C9, 0x7001, 0x7002)
        assert runtime.data("rx") == bytes(8)
        os.write(socat.stdin.fileno(), b"12345")
        plc.shows("TURCV_1", 0x0000)
        assert runtime.outputs("TURCV_1").rcvd_len == 5
        assert runtime.data("rx") == b"12345\0\0\0"

        runtime.submit(commands.WriteData("tx", 0, b"good"))
        runtime.submit(commands.PulseInput("TUSEND_1", "REQ"))
        assert plc.shows("TUSEND_1", 0x7001, 0x0000) == [0x7001, 0x0000]
        assert os.read(socat.stdout.fileno(), 100) == b"good"
        socat.terminate()


def test_a_broadcast_of_socat_is_heard_as_any_datagram(plc: Plc) -> None:
    runtime = plc.bench.runtime
    runtime.submit(commands.SetInput("TURCV_1", "EN_R", True))
    plc.shows("TURCV_1", 0x7001, 0x7002)
    end = f"UDP4-DATAGRAM:127.255.255.255:{runtime.listening_port(plc.local)},broadcast,bind=127.0.0.1"
    with subprocess.Popen(
        [need("socat"), end, "STDIO"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as socat:
        assert socat.stdin is not None and socat.stdout is not None
        os.write(socat.stdin.fileno(), b"all")
        plc.shows("TURCV_1", 0x0000)
        assert runtime.data("rx") == b"all\0\0\0\0\0"
        runtime.submit(commands.WriteData("tx", 0, b"good"))
        runtime.submit(commands.PulseInput("TUSEND_1", "REQ"))
        plc.shows("TUSEND_1", 0x7001, 0x0000)
        assert os.read(socat.stdout.fileno(), 100) == b"good"  # to the source that stands in ADDR
        socat.terminate()
