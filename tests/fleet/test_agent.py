"""The agent: what it tells of a bench, what it keeps while the broker is away, how it ends."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import NoReturn
from urllib.request import urlopen

import pytest

from tests.cli.test_cli import ENVIRONMENT
from tests.fleet.mosquitto import Mosquitto, needs_mosquitto
from tests.local_driver import LocalDriver
from tests.waiting import children_of, until
from trcvtui.engine.controller import fresh_bench
from trcvtui.fleet import agent as fleet_agent
from trcvtui.fleet.agent import Agent, AgentSettings
from trcvtui.fleet.broker import BrokerAccess, BrokerConnection, ConnAck, IncomingMessage
from trcvtui.fleet.disk_queue import DiskQueue
from trcvtui.fleet.lines import AgentBench
from trcvtui.fleet.publisher import Publisher
from trcvtui.fleet.topics import StateMessage, StatusMessage, parse_message, parse_topic
from trcvtui.net.os.forwarder import write_or_drop_line
from trcvtui.net.os.service_manager import notify
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.recording.files import RecordTarget
from trcvtui.scenario.scenario import load_bench_project

ROOT = Path(__file__).parents[2]
PROJECT = ROOT / "configs" / "active.toml"
SECOND = 1_000_000_000


# -- a bench to messages ---------------------------------------------------------------------------------


def test_each_error_edge_is_an_event_with_the_next_number_and_its_cause() -> None:
    project = load_bench_project(PROJECT)
    driver = LocalDriver(fresh_bench(project, "sim"))
    seen = AgentBench("b00", project.dialect.label)
    told = []
    for line in ("set TRCV_C_1 EN_R=1 CONT=1", "peer P1 rst", "peer P1 rst", "peer P1 rst"):
        driver.submit(line)
        driver.scan(2000)
    update = driver.shown(UpdateRequest(most_lines=20_000))
    errors = update.snapshot.instances[0].errors
    changed, events, moved = seen.handle_update(update, 1000.0)
    told = [event for _, event in events]
    assert errors > 0 and len(told) == errors
    assert [event.id for event in told] == [f"b00-{n}" for n in range(1, errors + 1)]
    assert all(event.status and event.cause["text"] and event.t < 1000.0 for event in told)
    assert [each.name for each in changed] == ["TRCV_C_1"] and [line.name for line in moved] == ["C1"]
    assert seen.lines["C1"].take_figures(1000.0).errors_an_hour == errors
    assert seen.instances["TRCV_C_1"].recent_message(1000.0).count == errors


# -- on a broker -----------------------------------------------------------------------------------------


def started(broker: Mosquitto, folder: Path) -> subprocess.Popen[bytes]:
    """Start an agent; its words go to a file."""
    words = f"agent {PROJECT} --site s --name n --mqtt mqtt://127.0.0.1:{broker.port}"
    with (folder / "said").open("ab") as said:
        return subprocess.Popen(
            [sys.executable, "-m", "trcvtui", *words.split()],
            cwd=ROOT,
            env=ENVIRONMENT | {"STATE_DIRECTORY": str(folder)},
            stderr=said,
        )


def reader_of(broker: Mosquitto) -> tuple[BrokerConnection, dict[str, bytes]]:
    """Return a reader, and what it will have heard last of each topic."""
    connection = BrokerConnection(
        BrokerAccess("127.0.0.1", broker.port, False), "reader", topics=("trcvtui/v1/#",)
    )
    connection.start()
    return connection, {}


def state_is(connection: BrokerConnection, heard: dict[str, bytes], wanted: str) -> bool:
    for news in connection.take_events():
        if isinstance(news, IncomingMessage):
            heard[news.topic] = news.payload
    payload = heard.get("trcvtui/v1/s/n/state", b"")
    message = parse_message(parse_topic("trcvtui/v1/s/n/state"), payload)
    return isinstance(message, StateMessage) and message.state == wanted


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


@needs_mosquitto
@pytest.mark.live
@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc")
def test_an_agent_comes_back_with_its_broker_starts_its_engine_anew_and_its_death_shows_at_once(
    broker: Mosquitto, tmp_path: Path
) -> None:
    agent = started(broker, tmp_path)
    connection, heard = reader_of(broker)
    status = "trcvtui/v1/s/n/C1/TRCV_C_1/status"
    try:
        until(lambda: state_is(connection, heard, "online") and status in heard)
        message = parse_message(parse_topic(status), heard[status])
        assert isinstance(message, StatusMessage) and message.text
        broker.kill()
        heard.clear()
        assert broker.start()  # it has forgotten all
        until(lambda: state_is(connection, heard, "online") and status in heard)
        engines = children_of(agent.pid)
        for engine in engines:
            os.kill(engine, signal.SIGKILL)
        until(lambda: state_is(connection, heard, "online") and "trcvtui/v1/s/n/C1/TRCV_C_1/event" in heard)
        until(lambda: [pid for pid in children_of(agent.pid) if is_alive(pid) and pid not in engines])
        left = children_of(agent.pid)
        agent.kill()
        until(lambda: state_is(connection, heard, "offline"))
        until(lambda: not any(map(is_alive, left)))
    finally:
        agent.kill()
        agent.wait()
        connection.close()
    said = (tmp_path / "said").read_text()
    assert "the engine has ended" in said and "Traceback" not in said


@needs_mosquitto
@pytest.mark.live
@pytest.mark.slow
def test_sigterm_ends_an_agent_cleanly_and_says_offline(broker: Mosquitto, tmp_path: Path) -> None:
    agent = started(broker, tmp_path)
    connection, heard = reader_of(broker)
    try:
        until(lambda: state_is(connection, heard, "online"))
        agent.terminate()
        assert agent.wait() == 0
        until(lambda: state_is(connection, heard, "offline"))
    finally:
        agent.kill()
        connection.close()
    assert (tmp_path / "said").read_text().count("\n") == 2  # no TLS; connected to the broker


# -- what fails beside it --------------------------------------------------------------------------------


def agent_without_a_broker(page: tuple[str, int] | None = None) -> Agent:
    settings = AgentSettings(PROJECT, "sim", "s", "n", None, page, None)
    return Agent(settings, load_bench_project(PROJECT))


@pytest.mark.live
@pytest.mark.slow
def test_an_engine_that_hangs_is_told_as_stale_and_started_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_agent, "STALE_NS", SECOND)
    monkeypatch.setattr(fleet_agent, "HUNG_NS", 2 * SECOND)
    agent = agent_without_a_broker()
    with ExitStack() as opened:
        opened.callback(agent._end_engine)

        def turned() -> bool:
            agent._run_once(opened)
            return agent.is_running and bool(agent.seen.instances)

        until(turned)
        first = agent._engine
        assert first is not None and first.pid is not None
        os.kill(first.pid, signal.SIGSTOP)
        until(lambda: not turned() and agent.is_stale and agent.restarts == 0)
        until(lambda: turned() and agent.restarts == 1)
        assert agent._engine is not first


@pytest.mark.live
def test_a_page_whose_place_is_taken_is_tried_again_and_ends_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(fleet_agent, "PAGE_RETRY_NS", 0)
    with socket.create_server(("127.0.0.1", 0)) as rival:
        place = rival.getsockname()[:2]
        agent = agent_without_a_broker(place)
        with ExitStack() as opened:
            opened.callback(agent._end_engine)
            agent._run_once(opened)
            assert (
                agent.is_running
                and f"Address already in use at 127.0.0.1:{place[1]}" in capsys.readouterr().err
            )
            rival.close()
            agent._run_once(opened)
            assert urlopen(f"http://127.0.0.1:{place[1]}/metrics").status == 200


class DeadEnd(BrokerConnection):
    """A connection that has stood, and whose every call the system refuses now."""

    def publish(self, topic: str, payload: bytes, is_retained: bool = False) -> int | None:
        raise OSError(24, "Too many open files")


@pytest.mark.live
@pytest.mark.slow
def test_a_bench_scans_on_while_everything_beside_it_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """EMFILE at the first engine, the page, the broker and the recordings; a queue whose file is gone."""
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    monkeypatch.setattr(fleet_agent, "FIRST_PAUSE_NS", 0)
    monkeypatch.setattr(fleet_agent, "PAGE_RETRY_NS", 0)
    monkeypatch.setattr(fleet_agent, "FIRST_LOOK_NS", 0)

    def fails(*_: object, **__: object) -> NoReturn:
        raise OSError(24, "Too many open files")

    monkeypatch.setattr("trcvtui.fleet.metrics.start_page_server", fails)
    monkeypatch.setattr(fleet_agent, "list_newest_file", fails)
    record = RecordTarget(tmp_path / "runs")
    settings = AgentSettings(PROJECT, "sim", "s", "n", None, ("127.0.0.1", 1), record)
    agent = Agent(settings, load_bench_project(PROJECT))
    queue = DiskQueue(tmp_path / "queue.sqlite", write_or_drop_line)
    queue._base.close()  # every call of it is an error from now on
    connection = DeadEnd(BrokerAccess("127.0.0.1", 1, False), "x")
    connection._add_event(ConnAck())
    agent._publisher = Publisher(connection, queue, write_or_drop_line)
    with ExitStack() as opened, monkeypatch.context() as broken:
        opened.callback(agent._end_engine)
        broken.setattr(fleet_agent, "EngineDriver", fails)
        agent._run_once(opened)
        assert agent.restarts == 1
        broken.undo()
        agent._pause = agent._start_at = 0

        def has_scanned(scans: int) -> bool:
            agent._run_once(opened)
            return agent._scan > scans

        until(lambda: has_scanned(0))
        first = agent._scan
        until(lambda: has_scanned(first + 50))
        assert agent.restarts == 1 and not queue.put(0, "e", b"")
    assert "Traceback" not in capsys.readouterr().err


def test_a_service_manager_hears_that_an_agent_is_ready(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notify("READY=1")  # there is none
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        notify("READY=1")
        assert manager.recv(100) == b"READY=1"
