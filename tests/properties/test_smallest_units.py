"""The smallest and the largest unit of each carrier, in bursts and from strangers: nothing ends."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.bench.iso_desk import PASSIVE, Desk
from tests.bench.test_iso_unruly import connect_by_hand
from tests.scenario.scenarios import CONFIGS
from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.results import Endpoint, Fault

LOOPBACK = "127.0.0.1"
SIZES = (0, 0, 0, 0, 1, 8, 9, 65_507)
ROUNDS = 30
ON_CONNECT = (CONFIGS / "s7-udp-connect.toml").read_text()
ON_CONFIG = (CONFIGS / "udp.toml").read_text()
BY_FIELD = 'type = "TCON_IP_v4"\nConnectionType = 19\nLocalPort = 2000\n'
BY_PARAM = 'type = "TCON_Param"\nconnection_type = 19\nactive_est = false\nlocal_tsap_id = "07 d0"\n'
DIALECTS = {
    "s7-1500": ON_CONNECT,
    "s7-1200": ON_CONNECT.replace("s7-1500", "s7-1200"),
    "s7-1200-legacy": ON_CONNECT.replace("s7-1500", "s7-1200-legacy").replace(BY_FIELD, BY_PARAM),
    "baosky": ON_CONFIG,
    "s7 on a config": (CONFIGS / "s7-udp.toml").read_text(),
}
RECEIVERS = ("TRCV_C_1", "TURCV_1", "URECV_C_1")
EMPTY_DT = "03 00 00 07 02 f0 80 "
EIGHT = "03 00 00 0f 02 f0 80 01 02 03 04 05 06 07 08"


class Strangers:
    """Sockets that the project does not know, on the kernel of the bench's network."""

    def __init__(self, desk: Desk) -> None:
        self.kernel: Kernel = desk.bench.network if desk.bench.kernel_name == "sim" else OsKernel()
        self.handles = [self._opened() for _ in range(3)]

    def _opened(self) -> Handle:
        handle = self.kernel.datagram_socket("stranger")
        assert not isinstance(handle, Fault)
        assert self.kernel.bind(handle, Endpoint(LOOPBACK, 0)) is None
        return handle

    def send(self, draw: random.Random, port: int, sizes: list[int]) -> None:
        for size in sizes:
            end = Endpoint(LOOPBACK, port)
            self.kernel.send_to(draw.choice(self.handles), memoryview(bytes(size)), end)

    def close(self) -> None:
        for handle in self.handles:
            self.kernel.close(handle)


def opened(text: str, folder: Path, kernel: str) -> tuple[Desk, list[tuple[str, str]]]:
    """Return the bench with all its receivers armed, and each with the name of its CONNECT or UDP_CONFIG."""
    desk = Desk(text, folder, kernel)
    receivers = [(i.name, i.connect) for i in desk.bench.project.instances if i.name in RECEIVERS]
    desk.say(*["pulse TCON_1 REQ"] * (desk.bench.project.instance("TCON_1") is not None))
    for name, _ in receivers:
        desk.say(f"set {name} EN_R=1" + " CONT=1" * ("CONT" in desk.bench.runtime.inputs(name)))
    desk.until(lambda: all(desk.bench.runtime.listening_port(connect) for _, connect in receivers))
    return desk, receivers


@pytest.fixture(params=["sim", "live"])
def kernel(request: pytest.FixtureRequest) -> Iterator[str]:
    yield request.param


@pytest.mark.parametrize("dialect", DIALECTS)
def test_datagrams_of_any_size_in_bursts_from_strangers_end_nothing(
    tmp_path: Path, kernel: str, dialect: str
) -> None:
    desk, receivers = opened(DIALECTS[dialect], tmp_path, kernel)
    strangers, draw, lengths = Strangers(desk), random.Random(f"{dialect} {kernel}"), []
    for name, connect in receivers:
        port = desk.port(connect)
        bursts = [draw.choices(SIZES, k=draw.randint(1, 6)) for _ in range(ROUNDS)]
        for burst in (*bursts, [0] * 20):
            strangers.send(draw, port, burst)
            for _ in range(draw.choice((0, 1, 2, 40))):
                desk.bench.step()
                out = desk.bench.runtime.outputs(name)
                lengths += [out.rcvd_len] * out.done
        strangers.send(draw, port, [8])
        while desk.bench.runtime.outputs(name).rcvd_len != 8:
            desk.until_done(name)
        assert set(lengths) >= {0, 1, 8}
    strangers.close()
    desk.close()


def test_an_empty_datagram_that_lies_there_is_a_done_as_one_that_comes_alone(
    tmp_path: Path, kernel: str
) -> None:
    desk, [(name, connect), *_] = opened(ON_CONNECT, tmp_path, kernel)
    strangers, draw = Strangers(desk), random.Random(1)
    for burst in ([0], [0, 0], [0, 0, 0, 8, 0]):
        strangers.send(draw, desk.port(connect), burst)
        shown: list[int | None] = []
        for _ in burst:
            desk.until_done(name)
            shown.append(desk.bench.runtime.outputs(name).rcvd_len)
        assert shown == burst
    strangers.close()
    desk.close()


def test_empty_frames_of_iso_on_tcp_are_none_and_the_next_message_is_received(
    tmp_path: Path, kernel: str
) -> None:
    raw = '[[peer]]\nname = "RAW0"\nremote = "@C1"\n'
    desk = Desk(PASSIVE + raw, tmp_path, kernel)
    desk.say("set R CONT=1 EN_R=1", "run 3")
    connect_by_hand(desk)
    for _ in range(ROUNDS):
        desk.say(f"peer RAW0 send hex {EMPTY_DT * 20 + EIGHT}")
        desk.until_done("R")
        assert desk.bench.runtime.outputs("R").rcvd_len == 8  # an empty message is none
    desk.close()


@pytest.mark.parametrize("length", [1, 2, 4])
def test_nothing_but_prefixes_to_receive_data_ends_nothing(tmp_path: Path, length: int) -> None:
    text = (CONFIGS / "twincat-line.toml").read_text()
    desk = Desk(text, tmp_path)
    prefix = bytes(range(2, 2 + length)).hex()
    desk.say(f"write prefix hex {prefix}", "write suffix hex 0a", f"set RD LenPrefix={length} LenSuffix=1")
    desk.say("run 2", *[f"feed RX hex {prefix * 40}", "run 2"] * 30)
    desk.say("run 300", f"feed RX hex 0a{prefix}4142430a")
    desk.until(lambda: desk.bench.runtime.data("rx")[length : length + 3] == b"ABC", most=300)
    desk.close()
