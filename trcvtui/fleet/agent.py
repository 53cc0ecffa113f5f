"""`trcvtui agent`, a bench as a service: restarts a failed engine, publishes messages, serves metrics."""

from __future__ import annotations

import platform
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from typing import Final

from trcvtui import __version__, clock, paths
from trcvtui.engine.driver import EngineDriver, ProcessDriver
from trcvtui.errors import UserError, mistake, one_line
from trcvtui.files import make_folder
from trcvtui.fleet.broker import NO_TLS_TEXT, BrokerAccess, BrokerConnection, LastWill
from trcvtui.fleet.disk_queue import DiskQueue
from trcvtui.fleet.lines import NS, AgentBench, AgentInstance
from trcvtui.fleet.publisher import Publisher
from trcvtui.fleet.topics import FleetMessage, StateMessage, Topic, parse_topic
from trcvtui.net.os.forwarder import write_or_drop_line
from trcvtui.net.os.service_manager import notify
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.picture.protocol import EngineStopped
from trcvtui.plc.snapshot import Snapshot
from trcvtui.project.project import Project, TapDecl, WatchDecl
from trcvtui.recording.files import RecordTarget, list_newest_file

TURN_PAUSE_S: Final = 0.1  # between two pictures
IDLE_FIGURES_NS: Final = 60 * NS  # of an idle line
MOVING_FIGURES_NS: Final = 10 * NS  # of a line on which bytes move
FIRST_PAUSE_NS, MOST_PAUSE_NS = NS, 60 * NS  # before an engine is restarted
HEALTHY_NS: Final = 60 * NS  # an engine that ran so long resets the pause
MOST_LINES: Final = 20_000
DOCTOR_PAUSE_NS: Final = 60 * NS  # between two looks of the doctor, if bytes or ERRORs have come
FIRST_LOOK_NS: Final = 10 * NS
REST_FACTOR: Final = 50  # the doctor rests so many times as long as it looked: a look must cost little
RECENT_GAP_NS: Final = 60 * NS  # between two `recent` of an instance: each event is sent at once anyway
PAGE_RETRY_NS: Final = 10 * NS  # before the page's port is tried again
START_TIMEOUT_NS: Final = 30 * NS  # an engine that has not sent its project by then hangs
STALE_NS, HUNG_NS = 5 * NS, 30 * NS  # without a new scan: the state is stale; the engine is restarted
STALE_SCANS: Final = 10  # at least so many scan intervals are needed for stale


@dataclass(frozen=True, slots=True)
class AgentSettings:
    """The options of the agent. `page` is address and port of the metrics page, or None for no page."""

    project: Path
    kernel: str
    site: str
    name: str
    broker: BrokerAccess | None
    page: tuple[str, int] | None
    record: RecordTarget | None
    with_payload: bool = False
    packets: tuple[str, ...] = ()  # the capture program and its arguments


def default_name(project: Path) -> str:
    return f"{platform.node() or 'host'}-{project.stem}"


def prepare_queue_path(site: str, name: str) -> Path | None:
    """Return the file of the queue in the state folder of systemd or of the user.

    If the folder cannot be made, print the error and return None, which means a queue in memory.
    """
    from hashlib import sha256

    folder = paths.state_folder()
    try:
        for each in (*reversed(folder.parents), folder):  # the user of a service may have no home folder
            if not each.is_dir():
                make_folder(each, "the folder of the queue")
    except UserError as refused:
        write_or_drop_line(f"{refused.lines()[0]}; messages for the broker are queued in memory only")
        return None
    return folder / f"queue-{sha256(f'{site}/{name}'.encode()).hexdigest()[:16]}.sqlite"


class Agent:
    """One project without a screen: its engine, its publisher and its metrics page."""

    def __init__(self, settings: AgentSettings, project: Project) -> None:
        self._settings = settings
        rows: tuple[WatchDecl | TapDecl, ...] = (*project.watches, *project.taps)
        names: dict[str, str] = {}
        for row in rows:
            for connect, name in ((row.connect, row.name), (row.back, f"{row.name} back")):
                names[connect] = f"{names[connect]}, {name}" if connect in names else name
        names.pop("", None)
        boot = f"{clock.utc_ns():x}"
        self.seen = AgentBench(boot, project.dialect.label, self._recording_file, names)
        self._engine: ProcessDriver | None = None
        self._has_taps = bool(project.taps)
        self._has_shadows = self._has_taps or bool(settings.packets)
        self._has_asked = False  # a picture was requested from this engine
        self._publisher: Publisher | None = None
        self._started_at = self._start_at = clock.now_ns()
        self._pause = FIRST_PAUSE_NS
        self._figures_at: dict[str, int] = {}
        self._doctor_at = self._asked_at = 0  # time of the doctor's next look, and of its last request
        self._looks = 0
        self._judged_at: tuple[object, ...] = ()  # `activity_key` at that request
        self.restarts: int = 0
        self._scan, self._scanned_at = -1, clock.now_ns()  # the last scan, and when its picture came
        self._patience = STALE_NS
        self._state = ""
        self._has_cleared = False
        self._page_at = 0
        self._failure = ""  # of publishing, the last reported one

    # -- values of the metrics page ----------------------------------------------------------------------

    @property
    def is_running(self) -> bool:
        return self._engine is not None and not self.is_stale

    @property
    def is_stale(self) -> bool:
        """Return whether the values are old: no new scan for a while."""
        return clock.now_ns() > self._scanned_at + self._patience

    @property
    def scan_age_s(self) -> float:
        return round((clock.now_ns() - self._scanned_at) / NS, 1)

    @property
    def is_broker_up(self) -> bool:
        return self._publisher is not None and self._publisher.is_up

    @property
    def queued(self) -> int:
        return self._publisher.queue.size if self._publisher is not None else 0

    @property
    def dropped(self) -> int:
        return sum(self._publisher.queue.dropped.values()) if self._publisher is not None else 0

    # -- the loop ----------------------------------------------------------------------------------------

    def run(self) -> int:
        ended: list[int] = []
        for name in ("SIGTERM", "SIGINT", "SIGHUP"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), lambda number, _: ended.append(number))
        with ExitStack() as opened:
            if self._settings.broker is not None:
                self._connect(self._settings.broker, opened)
            opened.callback(self._end_engine)
            notify("READY=1")  # to systemd
            while not ended:
                self._run_once(opened)
                notify("WATCHDOG=1")
                if not ended:
                    clock.sleep_until(clock.now_ns() + int(TURN_PAUSE_S * NS))
        return 0

    def _connect(self, broker: BrokerAccess, opened: ExitStack) -> None:
        if not broker.has_tls:
            write_or_drop_line(NO_TLS_TEXT)
        topic = self._topic("state")
        settings = self._settings
        client_id = f"{settings.site}/{settings.name}"
        connection = BrokerConnection(broker, client_id, LastWill(topic, self._state_message("offline")))
        queue = DiskQueue(prepare_queue_path(settings.site, settings.name), write_or_drop_line)
        opened.callback(queue.close)
        self._publisher = Publisher(connection, queue, write_or_drop_line)
        self._publish_state()
        connection.start()
        opened.callback(lambda: connection.close(LastWill(topic, self._state_message("offline"))))

    def _run_once(self, opened: ExitStack) -> None:
        now = clock.now_ns()
        if self._settings.page is not None and now >= self._page_at >= 0:
            self._open_page(*self._settings.page, opened, now)
        try:
            if self._engine is None and now >= self._start_at:
                self._start_engine(now)
            if self._engine is not None:
                self._poll_engine(self._engine, now)
        except (EngineStopped, UserError, OSError) as stopped:  # OSError: out of processes or files
            self._handle_failure(stopped, now)
        with self._contain_failures():
            if self._publisher is not None:
                self._publish_state()
                if not self.is_stale:
                    self._publish_figures(now)
                self._publisher.advance(now)

    @contextmanager
    def _contain_failures(self) -> Iterator[None]:
        """Report an error of publishing; such an error never ends the bench."""
        try:
            yield
        except Exception as failed:
            line = f"publishing has failed: {type(failed).__name__} {failed}; the bench keeps running"
            if line != self._failure:
                self._failure = line
                write_or_drop_line(line)

    def _open_page(self, address: str, port: int, opened: ExitStack, now: int) -> None:
        """Open the metrics page. If its port is in use, the agent tries again later; the bench goes on."""
        from trcvtui.fleet.metrics import start_page_server

        try:
            server = start_page_server(address, port, self)
        except OSError as failed:
            if not self._page_at:  # report it once
                why = f"{failed.strerror} at {address}:{port}; retrying every {PAGE_RETRY_NS // NS} s"
                write_or_drop_line(f"--metrics: {why}")
            self._page_at = now + PAGE_RETRY_NS
            return
        self._page_at = -1
        opened.callback(server.server_close)
        opened.callback(server.shutdown)

    def _start_engine(self, now: int) -> None:
        self._started_at, self._doctor_at, self._looks = now, now + FIRST_LOOK_NS, 0
        self._scan = -1
        self._engine = self._new_engine()
        if self._has_taps:
            write_or_drop_line("the tap is up")
        self.seen.begin_run()
        self._has_asked = False

    def _new_engine(self) -> ProcessDriver:
        settings = self._settings
        if not self._has_shadows:
            return EngineDriver(settings.project, settings.kernel, record=settings.record)
        from trcvtui.line.live_screen import RunningTapDriver, capture_main

        if self._has_taps:
            return RunningTapDriver(settings.project)
        return ProcessDriver(capture_main, settings.packets, (settings.project, None, None))

    def _handle_failure(self, stopped: Exception, now: int) -> None:
        self._end_engine()
        if now > self._started_at + HEALTHY_NS:
            self._pause = FIRST_PAUSE_NS
        why = one_line(str(stopped).strip().rpartition("\n")[2])
        if isinstance(stopped, EngineStopped) and stopped.is_internal:
            from trcvtui.bench.error_report import write_report

            why += f"; {write_report(str(stopped), None, (), stopped.folder)}"
        write_or_drop_line(f"the engine has ended: {why}; it restarts in {self._pause // NS} s")
        with self._contain_failures():
            for instance in self.seen.instances.values():
                cause: dict[str, object] = {"text": f"the engine has ended: {why}"}
                self._publish_event(
                    instance, instance.add_event(self.seen.boot, _utc_s(), "note", None, cause)
                )
        self._start_at = now + self._pause
        self._pause = min(2 * self._pause, MOST_PAUSE_NS)
        self.restarts += 1

    def _end_engine(self) -> None:
        engine, self._engine = self._engine, None
        if engine is not None:
            engine.close()

    def _poll_engine(self, engine: ProcessDriver, now: int) -> None:
        if not self._has_asked and (self._has_shadows or engine.has_begun()):
            self._has_asked, self._started_at = True, now
            engine.request(UpdateRequest(most_lines=MOST_LINES))
        update = engine.poll_picture() if self._has_asked else None
        if update is not None:
            self._note_scan(update.snapshot, now)
        elif self._scan < 0 and self._has_shadows:
            self._scanned_at = now  # a watched line has its first scan with its first packet
        silence = now - max(self._scanned_at, self._started_at)
        if silence > (max(HUNG_NS, 2 * self._patience) if self._has_asked else START_TIMEOUT_NS):
            raise EngineStopped(f"no scan for {silence // NS} s")
        if update is None:
            return
        if update.over:
            raise EngineStopped(update.over)
        with self._contain_failures():
            self._publish_update(update, now)
        known = UpdateRequest(
            since_seq=self.seen.seq,
            most_lines=MOST_LINES,
            bench=update.bench,
            project=update.project_number,
            doctor=self._is_doctor_due(now),
        )
        engine.request(known)

    def _publish_update(self, update: BenchUpdate, now: int) -> None:
        changed, events, moved = self.seen.handle_update(update, _utc_s())
        for instance in changed:
            if instance.status is not None:
                self._publish_retained(instance.status, instance.line, instance.name)
        for instance, event in events:
            self._publish_event(instance, event)
        for line in moved:
            self._figures_at.pop(line.name, None)  # a new state is published at once
        for instance, event in self.seen.make_finding_events(
            update.doctor, _utc_s(), self._settings.with_payload
        ):
            self._publish_event(instance, event)
        if update.doctor.looks != self._looks:
            self._looks = update.doctor.looks
            self._doctor_at = max(self._doctor_at, now + REST_FACTOR * (now - self._asked_at))
        if self._publisher is not None and not self._has_cleared:
            self._has_cleared = True
            self._publisher.clear_all_but(self._is_used)

    def _note_scan(self, snapshot: Snapshot, now: int) -> None:
        """Note the time of a new scan; with shadows, note the time of any picture."""
        if snapshot.scan != self._scan or self._has_shadows:  # an idle watched line has no new scans
            self._scan, self._scanned_at = snapshot.scan, now
            self._patience = max(STALE_NS, STALE_SCANS * snapshot.interval_ns)

    def _is_used(self, topic: str) -> bool:
        of = parse_topic(topic)
        instance = self.seen.instances.get(of.instance)
        is_its = not of.instance or (instance is not None and instance.line == of.line)
        return of.kind == "state" or (of.line in self.seen.lines and is_its)

    def _recording_file(self) -> str:
        record = self._settings.record
        if record is None:
            return ""
        try:
            return "".join(list_newest_file(record.target.resolve()))
        except OSError:  # the ring of files has deleted it meanwhile
            return ""

    def _is_doctor_due(self, now: int) -> bool:
        if now < self._doctor_at:
            return False
        self._doctor_at, self._asked_at = now + DOCTOR_PAUSE_NS, now
        came = self.seen.activity_key()
        is_due, self._judged_at = came != self._judged_at, came
        return is_due

    def _publish_event(self, instance: AgentInstance, event: FleetMessage) -> None:
        if self._publisher is not None:
            self._publisher.send_event(self._topic("event", instance.line, instance.name), event.to_json())
            recent = self._topic("recent", instance.line, instance.name)
            self._publisher.retain(recent, lambda: instance.recent_message(_utc_s()).to_json(), RECENT_GAP_NS)

    def _publish_figures(self, now: int) -> None:
        assert self._publisher is not None
        for line in self.seen.lines.values():
            gap = MOVING_FIGURES_NS if line.has_moved else IDLE_FIGURES_NS
            last = self._figures_at.get(line.name)
            if last is None or now >= last + gap:
                self._figures_at[line.name] = now
                self._publisher.send_figures(
                    self._topic("figures", line.name), line.take_figures(_utc_s()).to_json()
                )

    def _publish_retained(self, message: FleetMessage, line: str, instance: str) -> None:
        if self._publisher is not None:
            self._publisher.retain(self._topic(message.KIND, line, instance), message.to_json())

    def _topic(self, kind: str, line: str = "", instance: str = "") -> str:
        return str(Topic(self._settings.site, self._settings.name, line, instance, kind))

    def _publish_state(self) -> None:
        state = "stale" if self.is_stale else "online"
        if state != self._state and self._publisher is not None:
            self._state = state
            self._publisher.retain(self._topic("state"), self._state_message(state))
            if state == "stale":
                write_or_drop_line(f"no scan for {self._patience // NS} s: the published values are old")

    def _state_message(self, state: str) -> bytes:
        return StateMessage(state, _utc_s(), __version__, platform.node()).to_json()


def run_agent(settings: AgentSettings, project: Project) -> int:
    """Run a project until SIGTERM or Ctrl+C; raise UserError if it cannot run with these settings."""
    where, program = settings.project, settings.packets[:1]
    if project.taps and project.watches:
        raise mistake(f"{where}", "[[watch]] beside [[tap]]", "only one of the two in a project")
    if project.taps and settings.record is not None:
        raise mistake("--record", "[[tap]] beside it", "a bench; for a tap use `trcvtui tap --record`")
    if project.watches and not program:
        raise mistake(f"{where}: [[watch]]", "no packets", '--packets "dumpcap -q -i eth0 -w -"')
    if program and not project.watches:
        raise mistake("--packets", f"no [[watch]] in {where}", "a row that names the line")
    if program and settings.record is not None:
        raise mistake("--record", "--packets beside it", "a bench; let the capture program keep files")
    if program and which(program[0]) is None:
        raise mistake("--packets", f"no program '{program[0]}'", "one that writes packets, such as dumpcap")
    return Agent(settings, project).run()


def _utc_s() -> float:
    return round(clock.utc_ns() / NS, 3)
