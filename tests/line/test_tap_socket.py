"""A tap that is a program of its own, and its observers: they come, hang and die, and bytes go on whole."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from urllib.request import urlopen

import pytest

from tests.cli.test_cli import ENVIRONMENT
from tests.fleet.test_agent import SECOND, is_alive
from tests.fleet.test_agent_lines import LINE, TAP, written
from tests.local_driver import wait_for
from tests.waiting import children_of, until
from trcvtui.capture.pcap import USER0, CaptureReader, Packet
from trcvtui.capture.reassembly import Conversations
from trcvtui.errors import UserError
from trcvtui.fleet import agent as fleet_agent
from trcvtui.fleet.agent import Agent, AgentSettings
from trcvtui.line import live_screen
from trcvtui.line.live_screen import RunningTapDriver
from trcvtui.line.tap_socket import make_socket_path, open_connection
from trcvtui.net.os import observers
from trcvtui.net.os.observers import MOST_PATH_BYTES, PEER_CREDENTIALS, is_trusted, listen_at
from trcvtui.net.tap import WAY_TO, TapOrder
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.scenario.scenario import load_bench_project

ROOT = Path(__file__).parents[2]
MEGABYTES = 10
pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="no Unix sockets"),
]


class TapService:
    """`trcvtui tap --project` between a device and a PLC, both of which the test plays."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.project = written(folder, LINE + TAP.format(port=self._listener.getsockname()[1]))
        self.socket = make_socket_path(self.project)
        self._said = folder / "said"
        with self._said.open("wb") as said:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "trcvtui", "tap", "--project", str(self.project), *options],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said,
                cwd=ROOT, env=environment(folder),
            )  # fmt: skip
        until(lambda: self.said.startswith("T: ") and self._is_served(), lambda: self.said)
        self.port = int(self.said.split()[1].rpartition(":")[2])

    def _is_served(self) -> bool:
        with suppress(UserError), socket.socket(fileno=open_connection(self.project)):
            return True
        return False

    @property
    def said(self) -> str:
        return self._said.read_text()

    def connect(self) -> tuple[socket.socket, socket.socket]:
        device = socket.create_connection(("127.0.0.1", self.port))
        return device, self._listener.accept()[0]

    def observer(self) -> socket.socket:
        return socket.socket(fileno=open_connection(self.project))

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.terminate()
        self.process.wait()
        self._listener.close()


def environment(folder: Path) -> dict[str, str]:
    return ENVIRONMENT | {"RUNTIME_DIRECTORY": str(folder / "r"), "STATE_DIRECTORY": str(folder)}


@pytest.fixture
def short(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder in which a socket's name is short enough, and which is the runtime folder here, too."""
    folder = tmp_path_factory.mktemp("t")
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(folder / "r"))
    return folder


@pytest.fixture
def tap(short: Path) -> Iterator[TapService]:
    made = TapService(short)
    yield made
    made.close()


def exactly(end: socket.socket, size: int) -> bytes:
    got = bytearray()
    while len(got) < size and (part := end.recv(min(1 << 16, size - len(got)))):
        got += part
    return bytes(got)


def events_in(packets: list[Packet], link_types: list[int]) -> list[tuple[object, bytes]]:
    events: list[tuple[object, bytes]] = []
    found = Conversations(lambda event: events.append((event.kind, bytes(event.data))))
    found.add_packets(iter(packets), link_types)
    found.close()
    return events


def packets_of(observer: socket.socket) -> tuple[CaptureReader, Iterator[Packet]]:
    reader = CaptureReader(observer.recv, "tap")
    return reader, iter(reader)


def test_an_observer_reads_the_conversation_and_what_the_tap_itself_does(short: Path) -> None:
    tap = TapService(short, "--allow-orders", "--record", str(short / "kept.pcapng"))
    observer = tap.observer()
    device, plc = tap.connect()
    plc_end = plc.getsockname()
    device.sendall(b"one")
    assert exactly(plc, 3) == b"one"
    observer.sendall(TapOrder(0, 0, WAY_TO, "insert", (), b"!!").encode() + b"9 9 9 no order\n")
    assert exactly(plc, 2) == b"!!"
    until(lambda: "gives an invalid order" in tap.said)
    device.close()
    assert plc.recv(1) == b""
    plc.close()
    tap.close()
    reader, packets = packets_of(observer)
    notes: list[Packet] = []
    wire: list[Packet] = []
    for packet in packets:
        (notes if reader.link_types[packet.interface] == USER0 else wire).append(packet)
    observer.close()
    told = [json.loads(note.data) for note in notes]
    assert [note["note"] for note in told if note["note"] != "figures"] == ["taps", "open", "ours", "end"]
    assert told[1]["ends"][1] == list(plc_end) and told[1]["new"] and told[1]["kind"] == "tcp"
    with (short / "kept.pcapng").open("rb") as kept:
        recorded = CaptureReader(kept.read, "kept")
        pairs = (wire, reader.link_types), ([*recorded], recorded.link_types)
    seen = [events_in(some, link_types) for some, link_types in pairs]
    assert seen[0] == seen[1] and b"".join(data for _, data in seen[0]) == b"one!!"


def test_no_order_ends_the_tap_and_what_an_observer_holds_goes_on_when_it_dies(short: Path) -> None:
    tap = TapService(short, "--allow-orders")
    reads, dies = tap.observer(), tap.observer()
    device, plc = tap.connect()
    wrong = ["0 99999999999 0 rst ;", "0 -1 0 rst ;", "0 0 0 delay 9000000000000000000;", "0 0 0 drop ;"]
    wrong.append("! words of the process that serves")
    dies.sendall("".join(f"{line}\n" for line in wrong).encode() + TapOrder(0, 0, WAY_TO, "hold").encode())
    until(lambda: tap.said.count("gives an invalid order") == len(wrong))
    device.sendall(b"held")
    dies.close()  # with bytes unread, as a program that was killed
    assert exactly(plc, 4) == b"held"
    for end in (device, plc, reads):
        end.close()
    tap.close()


def test_an_observer_without_leave_gives_no_orders(tap: TapService) -> None:
    observer = tap.observer()
    device, plc = tap.connect()
    observer.sendall(TapOrder(0, 0, WAY_TO, "rst").encode())
    until(lambda: "--allow-orders" in tap.said)
    device.sendall(b"still")
    assert exactly(plc, 5) == b"still"
    for end in (device, plc, observer):
        end.close()


def pumped(tap: TapService) -> Iterator[tuple[str, str]]:
    """Send megabytes in both directions; yield what was sent and what came, as digests."""
    device, plc = tap.connect()
    data = os.urandom(MEGABYTES << 20)
    senders = [threading.Thread(target=_send, args=(end, data)) for end in (device, plc)]
    got: list[bytes] = [b"", b""]
    readers = [threading.Thread(target=_keep, args=(got, n, end)) for n, end in enumerate((plc, device))]
    for thread in (*senders, *readers):
        thread.start()
    yield "", ""
    for thread in (*senders, *readers):
        thread.join()
    for end in (device, plc):
        end.close()
    for each in got:
        yield hashlib.sha256(data).hexdigest(), hashlib.sha256(each).hexdigest()


def _send(end: socket.socket, data: bytes) -> None:
    for at in range(0, len(data), 1 << 14):
        end.sendall(data[at : at + (1 << 14)])


def _keep(got: list[bytes], number: int, end: socket.socket) -> None:
    got[number] = exactly(end, MEGABYTES << 20)


def test_an_observer_that_does_not_read_loses_packets_which_are_counted_and_bytes_go_on_whole(
    tap: TapService,
) -> None:
    observer = tap.observer()
    observer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 12)
    for _ in range(2):
        assert all(sent == came for sent, came in pumped(tap))
    reader, packets = packets_of(observer)
    next(packets)
    device, plc = tap.connect()
    device.sendall(b"x")
    threading.Thread(target=lambda: [None for _ in packets], daemon=True).start()
    until(lambda: reader.drop_count > 0)
    for end in (device, plc, observer):
        end.close()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGABRT])
def test_the_death_of_an_agent_and_all_its_processes_ends_no_connection(
    tap: TapService, number: signal.Signals
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        page = f"127.0.0.1:{free.getsockname()[1]}"
    words = f"agent {tap.project} --site s --name n --metrics {page}"
    agent = subprocess.Popen(
        [sys.executable, "-m", "trcvtui", *words.split()], cwd=ROOT, env=environment(tap.folder),
        start_new_session=True, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        device, plc = tap.connect()
        until(lambda: sees_a_job(page, device))
        took = exactly(plc, 4)
        pump = pumped(tap)
        next(pump)
        os.killpg(agent.pid, number)
        assert all(sent == came for sent, came in pump)
        device.sendall(b"on")
        until(lambda: "an observer has ended" in tap.said)
        while took != b"on":
            took = (took + plc.recv(1))[-2:]  # the bytes of `sees_a_job` stand before it
        for end in (device, plc):
            end.close()
    finally:
        with suppress(ProcessLookupError):
            os.killpg(agent.pid, signal.SIGKILL)
        agent.wait()


def sees_a_job(page: str, device: socket.socket) -> bool:
    """Send a job's bytes; return whether the agent's page tells of one."""
    device.sendall(bytes(4))
    with suppress(OSError):
        shown = urlopen(f"http://{page}/metrics").read().decode()
        return bool(re.search(r'trcvtui_jobs_done_total\{line="T",name="R"\} [1-9]', shown))
    return False


@pytest.mark.parametrize("how", ["killed", "without its socket"])
def test_observers_are_served_again_when_their_process_or_their_socket_is_gone(
    tap: TapService, how: str
) -> None:
    device, plc = tap.connect()
    [server] = [pid for pid in children_of(tap.process.pid) if is_alive(pid)]
    if how == "killed":
        os.kill(server, signal.SIGKILL)
        until(lambda: "no observers: their process has ended" in tap.said)
    else:
        tap.socket.unlink()
    device.sendall(b"on")
    assert exactly(plc, 2) == b"on"

    def comes() -> bool:
        with suppress(UserError), tap.observer() as observer:
            return exactly(observer, 4) == b"\x0a\x0d\x0d\x0a"
        return False

    until(comes)
    for end in (device, plc):
        end.close()


def test_observers_that_hang_are_told_as_stale_and_read_again_when_they_go_on(
    tap: TapService, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(live_screen, "MOST_SILENT_NS", 3 * SECOND)
    monkeypatch.setattr(fleet_agent, "MOST_PAUSE_NS", SECOND)
    agent = Agent(
        AgentSettings(tap.project, "sim", "s", "n", None, None, None), load_bench_project(tap.project)
    )
    device, plc = tap.connect()
    [server] = [pid for pid in children_of(tap.process.pid) if is_alive(pid)]
    with ExitStack() as opened:
        opened.callback(agent._end_engine)
        opened.callback(os.kill, server, signal.SIGCONT)

        def turned() -> bool:
            agent._run_once(opened)
            return agent.is_running and bool(agent.seen.instances)

        def sees_bytes() -> bool:
            device.sendall(bytes(4))
            return turned()

        until(sees_bytes)
        first = agent._scan
        until(lambda: turned() and agent._scan > first + 300)  # nothing passes: signs of life are its time
        assert agent.restarts == 0
        os.kill(server, signal.SIGSTOP)
        until(lambda: not turned() and agent.is_stale)
        said = capsys.readouterr().err
        assert "found nothing for 3 s" in said and "found a tap that sends nothing" in said
        os.kill(server, signal.SIGCONT)
        until(lambda: sees_bytes() and not agent.is_stale)
    for end in (device, plc):
        end.close()


def test_shadows_of_an_agent_show_what_passes_a_tap_and_say_where_there_is_none(tap: TapService) -> None:
    driver = RunningTapDriver(tap.project)
    try:
        device, plc = tap.connect()

        def comes() -> bool:
            device.sendall(bytes(4))  # the driver may have come when the first of them were through
            driver.request(UpdateRequest())
            driver.wait_for_message(0.05)
            picture = driver.poll_picture()
            return picture is not None and picture.snapshot.instances[0].jobs_done >= 3

        until(comes)
        for end in (device, plc):
            end.close()
        tap.close()
        assert wait_for(driver, lambda picture: bool(picture.over)).over == "the packets have ended"
    finally:
        driver.close()
    with pytest.raises(UserError, match="found no tap, expected `trcvtui tap --project"):
        open_connection(tap.project)


def test_the_socket_is_the_users_alone_and_a_dead_one_is_replaced(tap: TapService, short: Path) -> None:
    assert tap.socket.stat().st_mode & 0o777 == 0o600
    with pytest.raises(UserError, match="another tap that listens there"):
        listen_at(tap.socket)
    tap.process.kill()
    tap.process.wait()
    until(lambda: not tap.socket.exists())
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(tap.socket))
    listen_at(tap.socket).close()
    tap.socket.unlink()
    with pytest.raises(UserError, match=f"at most {MOST_PATH_BYTES}"):
        listen_at(short / ("x" * 100))


def _link(folder: Path, _: pytest.MonkeyPatch) -> None:
    folder.rename(folder.with_name("other"))
    folder.symlink_to(folder.with_name("other"))


def _let_others_in(folder: Path, _: pytest.MonkeyPatch) -> None:
    folder.chmod(0o750)


def _be_another_user(_: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: own + 1)


@pytest.mark.parametrize("change", [_link, _let_others_in, _be_another_user])
def test_a_folder_that_others_may_have_made_is_refused_at_both_ends(
    change: Callable[[Path, pytest.MonkeyPatch], None], short: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = make_socket_path(written(short, LINE))
    path.parent.mkdir(mode=0o700)
    with socket.socket(socket.AF_UNIX) as tap:
        tap.bind(str(path))
        tap.listen()
        change(path.parent, monkeypatch)
        for ask in (lambda: open_connection(short / "line.toml"), lambda: listen_at(path)):
            with pytest.raises(UserError, match="expected a folder of yours, mode 700"):
                ask()


class Peer:
    """A socket at whose other end a user is."""

    def __init__(self, user: int) -> None:
        self._user = user

    def getsockopt(self, *_: int) -> bytes:
        return PEER_CREDENTIALS.pack(1, self._user, 1)


@pytest.mark.skipif(not hasattr(socket, "SO_PEERCRED"), reason="the system does not tell")
def test_we_and_root_are_trusted_and_no_other_user(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = socket.socketpair()
    with one, other:
        assert is_trusted(one)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    trusted = [is_trusted(Peer(user)) for user in (0, 1000, 1001, 65534)]  # type: ignore[arg-type]
    assert trusted == [True, True, False, False]


STRANGERS = """
import sys
from trcvtui.line.tap_socket import serve_observers
from trcvtui.net.os import observers
observers.is_trusted = lambda peer: False
serve_observers(*sys.argv[2:], sys.argv[1], "1", "{}")
"""


def test_neither_end_speaks_to_another_user(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_socket_path(written(short, LINE))
    tap, events = socket.socketpair()
    ways, their_ways = socket.socketpair()
    with ways, their_ways, events, tap:
        fds = [events.fileno(), their_ways.fileno()]
        words = [sys.executable, "-c", STRANGERS, str(path), *map(str, fds)]
        with subprocess.Popen(words, pass_fds=fds, env=ENVIRONMENT) as server:
            events.close()
            until(path.exists)
            with socket.socket(socket.AF_UNIX) as stranger:
                until(lambda: stranger.connect_ex(str(path)) == 0)
                assert stranger.recv(1) == b""
            monkeypatch.setattr(observers, "is_trusted", lambda _: False)
            with pytest.raises(UserError, match="found a tap of another user"):
                open_connection(short / "line.toml")
            tap.close()
    assert server.returncode == 0
