"""UDP on the screen: CONFIG and ADDR in the place of CONNECT, and partners without a connection."""

from __future__ import annotations

from msgspec.structs import replace

from tests.scenario.scenarios import CONFIGS
from tests.tui.fakes import connections, peers, picture, receiving
from tests.tui.looking import BOTH, looking
from trcvtui.bench.bench import Bench
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.plc.snapshot import AddrSnapshot
from trcvtui.project.file import load_project
from trcvtui.tui.completion import complete


def udp_picture(end: str = "127.0.0.1:51322") -> BenchUpdate:
    """Return URECV_C_1 on U1 with its last sender in SOURCE, beside a UDP peer."""
    block = replace(
        receiving(),
        name="TRCV_C_1",
        block="URECV_C",
        connect="U1",
        inputs=(("EN_R", True), ("CONT", True), ("LEN", 0)),
        addr="SOURCE",
        on_config=True,
    )
    port = replace(connections()[0], name="U1", state="created", udp=True)
    shown = picture(block)
    snapshot = replace(
        shown.snapshot, connections=(port,), addrs=(AddrSnapshot("SOURCE", end, 1), AddrSnapshot("X", "?", 0))
    )
    peer = replace(peers()[0], active=False, state="listening", udp=True)
    return replace(shown, snapshot=snapshot, peers=(peer,))


@BOTH
async def test_the_block_shows_config_and_the_source_in_addr(size: tuple[int, int]) -> None:
    async with looking(size, udp_picture()) as looker:
        await looker.press("2")
        line = looker.line("CONFIG")
        assert "U1  SOURCE 127.0.0.1:51322" in line
        assert "CONNECT" not in looker.pane("block")
        await looker.show(udp_picture("127.0.0.1:2"))
        assert "SOURCE 127.0.0.1:2 " in looker.line("CONFIG") + " "


@BOTH
async def test_the_list_shows_the_other_end_of_the_last_datagram(size: tuple[int, int]) -> None:
    async with looking(size, udp_picture()) as looker:
        await looker.press("1")
        assert "↔ 127.0.0.1:51322" in looker.line("▸ TRCV_C_1")


@BOTH
async def test_a_udp_peer_is_called_one_and_offered_nothing_that_needs_a_connection(
    size: tuple[int, int],
) -> None:
    async with looking(size, udp_picture()) as looker:
        await looker.press("7", "r", "h", "f")
        assert "UDP" in looker.line("▸ P1") and "passive" not in looker.line("▸ P1")
        buttons = looker.pane("peer")
        for words in ("RST", "Half-close", "FIN", "Every split", "Connect"):
            assert words not in buttons
        for words in ("Send", "Listen", "Close", "Stall", "Reply"):
            assert words in buttons
        assert looker.lines == ["peer P1 close"]


def test_links_and_faults_complete_to_udp_configs_and_a_new_socket_has_nobody_yet() -> None:
    project = load_project(CONFIGS / "udp.toml")
    assert complete("link U", project) == "link U1"
    assert complete("fault send on U", project) == "fault send on U1"
    bench = Bench(project, "sim")
    bench.step()
    (port,) = bench.runtime.snapshot().connections
    bench.close()
    assert (port.udp, port.state, port.remote) == (True, "closed", "")
