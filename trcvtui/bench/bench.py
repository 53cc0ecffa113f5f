"""The bench: one PLC and its peers, on one kernel and one clock. `step` lets one scan pass."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar, cast

from msgspec.structs import replace

from trcvtui import clock
from trcvtui.bench.peers.peer import AutomaticPeer, Peer, next_due
from trcvtui.bench.program import Program, read_program
from trcvtui.commands import words
from trcvtui.commands.counters_and_checksums import FrameChecker, make_frame
from trcvtui.commands.edit import make_edits
from trcvtui.commands.peer import read_replies, read_routines
from trcvtui.commands.reader import project_after
from trcvtui.commands.table import find_record_row
from trcvtui.commands.words import EditCommand, NumberedFramesOn, PeerSend
from trcvtui.errors import mistake
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.resources import BufferPool, ConnectionBudget, JobQueue, Resources, ScanBudget
from trcvtui.net.events import EventKind
from trcvtui.net.faults import FaultPlan, FaultyKernel, FaultyPort
from trcvtui.net.kernel import Kernel
from trcvtui.net.layers.layer_kernel import LayerKernel, ReadyListKernel
from trcvtui.net.layers.layered_stream import LayerNote
from trcvtui.net.results import Endpoint, Fault
from trcvtui.net.serial_line import SerialPort, SerialSettings, SimSerialPort
from trcvtui.net.sim.kernel import SimKernel
from trcvtui.plc import commands
from trcvtui.plc.containment import COMMAND, EXCEPTION, INTERNAL_ERROR, Containment, ExceptionNote, RunPart
from trcvtui.plc.ledger import BenchNote, PeerSent, StatusEdge
from trcvtui.plc.runtime import Runtime
from trcvtui.project.project import ComBufferDecl, Edit, InstanceDecl, PeerDecl, Project, SimDecl
from trcvtui.project.tables import LEAST_INTERVAL_NS
from trcvtui.snapshots.bench import PeerSnapshot, TrafficCheckSnapshot

if TYPE_CHECKING:
    from trcvtui.net.os.kernel import OsKernel
    from trcvtui.recording.journal import LedgerNote
    from trcvtui.recording.replay import ReplaySeam
    from trcvtui.recording.seam import Seam, SeamKernel

NO_ADDRESSES: Final = SimDecl()
NEVER: Final = 1 << 62


def enter_own_network(kernel: str, sim: SimDecl = NO_ADDRESSES) -> None:
    """Move this process into a new network with the addresses in `sim`. Raise UserError if that fails."""
    if kernel != "live":
        raise mistake("--netns", f"--kernel {kernel}", "--kernel live: only that one uses a real network")
    from trcvtui.net.os.network import enter_namespace

    wrong = enter_namespace(sim.addresses, sim.not_ethernet)
    if wrong:
        raise mistake("--netns", wrong, "a system that lets a program have its own network")


def set_link(kernel: Kernel, connect: str, up: bool) -> tuple[str, str]:
    """Cut or mend the wire of a CONNECT. Return an error or "", and how the wire was cut or mended."""
    if isinstance(kernel, SimKernel):
        return kernel.set_link(connect, up), "simulated wire"
    from trcvtui.net.os.network import LOOPBACK_INTERFACE, has_own_network, set_loopback

    if has_own_network():  # then no other program uses its loopback
        how = "up" if up else "down: it carries every CONNECT and peer"
        return set_loopback(up), f"interface {LOOPBACK_INTERFACE} {how}"
    return kernel.set_link(connect, up), "packets pass again" if up else "packets dropped at the sockets"


def find_peer_link(peer: PeerDecl, project: Project) -> str:
    """Return the name of the CONNECT or UDP_CONFIG that leads to a peer, or "" if there is none."""
    end = peer.remote if peer.udp else peer.end
    if isinstance(end, str):
        return end.removeprefix("@")
    for config in project.connects:
        if config.remote_port == f"@{peer.name}":
            return config.name
    for addr in project.addrs:
        if addr.remote_port == f"@{peer.name}":
            return next((i.connect for i in project.instances if i.addr == addr.name), "")
    if end is None:
        return ""
    ports = [(c.name, c.local.port if peer.active else c.remote_port) for c in project.connects]
    return next((name for name, port in ports if port == end.port != 0), "")


def _connects_by_instance(project: Project) -> dict[str, str]:
    return {each.name: each.connect for each in project.instances}


class TrafficCheck:
    """A check of numbered frames, from one `check on` to the next `check on` or `check off`."""

    def __init__(self, peer: Peer, command: NumberedFramesOn) -> None:
        self._peer = peer
        self._command = command
        self._data = FrameChecker(command.size) if command.instance else None
        self._echo = FrameChecker(command.size)
        self._sent = 0
        self._next = 0
        peer.queues.inbox.checker = self._echo

    @property
    def instance(self) -> str:
        """Return the instance whose DATA is checked, "" for none."""
        return self._command.instance

    def due_at(self, now: int) -> int | None:
        return self._next if self._peer.can_send and not self._peer.unsent else None

    def step(self, now: int) -> None:
        if self._peer.can_send and now >= self._next and not self._peer.unsent:
            self._next = next_due(self._next or now, self._command.every_ns, now)
            self._peer.send(PeerSend(self._command.peer, make_frame(self._sent, self._command.size)), now)
            self._sent += 1

    def check_data(self, data: bytes) -> None:
        if self._data is not None:
            self._data.check_bytes(data)

    def end(self) -> None:
        self._peer.queues.inbox.checker = None

    def snapshot(self) -> TrafficCheckSnapshot:
        data = self._data.tally() if self._data is not None else None
        return TrafficCheckSnapshot(self._sent, data, self._echo.tally())


T = TypeVar("T")
KERNEL_NAMES: Final = ("sim", "live")


def _make_os_kernel() -> OsKernel:
    from trcvtui.net.os.kernel import OsKernel  # loads the socket library: a simulated bench needs none

    return OsKernel()


class Bench:
    """PLC and peers on one kernel. The caller passes the time, in ns from the start of the run."""

    def __init__(self, project: Project, kernel: str, seam: Seam | None = None) -> None:
        self.project = project
        self._works_on = _connects_by_instance(project)
        self.kernel_name = kernel
        self.lines: dict[str, SimSerialPort] = {}  # simulated ones by their ComBuffer, for a test's partners
        self.on_tap: Callable[[words.TapAct], str] | None = None  # set if a tap feeds this bench
        self._seam = seam  # records each call and its result, or answers calls from a recording
        self._note_arrivals = _do_nothing
        self._unrecorded: tuple[StatusEdge, ...] = ()  # changes of the last scan that are not recorded yet
        self.plan = FaultPlan()
        self.now = 0
        self.late_ns = self.late_scans = 0  # on real sockets: how late this scan began; how many were late
        self._scan_at = NEVER  # when the next scan shall begin; NEVER after a hold, which is no lateness
        self._is_replay = seam is not None and seam.has_answers
        self._sim = _make_sim_kernel(project) if kernel == "sim" or self._is_replay else None
        self._kernel: SimKernel | OsKernel = self._sim or _make_os_kernel()
        self._faulty = FaultyKernel(self._kernel, self.plan)
        now_ns = clock.now_ns if self._sim is None else self._time  # measures the handshakes of a scan
        self._work, self._peers_work = self._make_budget(now_ns), ScanBudget(now_ns)
        self.reports: Path | None = None  # folder for reports of internal errors, None: the state folder
        is_due = getattr(seam, "fails_next", None)  # of a replay
        self.containment = Containment(
            self._record_exception, self._report_error, self._note, is_due, self._do_past_seam
        )
        self._has_sessions = any(config.session is not None for config in project.connects)
        self.runtime = Runtime(
            project,
            self._make_plc_kernel(),
            self._make_resources(project),
            self._peer_port,
            self._make_serial_port,
            self.containment,
        )
        if seam is not None:
            seam.write_note, self._on_wait, self._work.report_wait = (
                self._write,
                self._work.report_wait,
                self._report_wait,
            )
        self._peers_work.set_interval(self.runtime.interval_ns)
        self.plan.fired = self._report_fault
        self.peers = {decl.name: self._new_peer(decl) for decl in project.peers}
        self._links = [find_peer_link(decl, project) for decl in project.peers]
        self._down: set[str] = set()
        self._checks: dict[str, TrafficCheck] = {}
        self._self_acting = {
            name: AutomaticPeer(self.peers[name], routine) for name, routine in read_routines(project).items()
        }
        self._program = Program(read_program(project), self)
        for rule in read_replies(project):
            self.peers[rule.peer].replies.add(rule)
        for peer in self.peers.values():
            if not peer.decl.active and (wrong := peer.listen()):
                self.close()
                raise mistake(f"{project.path}: peer {peer.decl.name}: local", wrong, "a free end")
        if seam is not None:
            seam.is_busy = False

    def _new_peer(self, decl: PeerDecl) -> Peer:
        policy, journal = self.project.rules.policy, self.runtime.ledger.write
        return Peer(decl, self._make_peer_kernel(decl), self._listening_end, journal, policy)

    def _make_budget(self, now_ns: Callable[[], int]) -> ScanBudget:
        if self._seam is None:
            return ScanBudget(now_ns)
        from trcvtui.recording.seam import SeamBudget

        return SeamBudget(self._seam, now_ns)

    def _time(self) -> int:
        return self.now

    def _make_plc_kernel(self) -> ReadyListKernel:
        make = self._make_layer_kernel if self._has_sessions else self._wire_kernel
        if self._seam is None:
            return make()
        kernel = self._wrap(self._seam, "PLC", make, is_noted=True)
        self._note_arrivals = kernel.note_arrivals
        return kernel

    def _wire_kernel(self) -> ReadyListKernel:
        if self._seam is None:
            return self._faulty
        from trcvtui.recording.seam import make_wire_kernel

        return make_wire_kernel(self._seam, self._faulty, is_next=not self._has_sessions)

    @staticmethod
    def _wrap(seam: Seam, label: str, make: Callable[[], Kernel], is_noted: bool = False) -> SeamKernel:
        from trcvtui.recording.seam import wrap_kernel  # only a recorded bench needs it

        return wrap_kernel(seam, label, make, is_noted)

    def _make_layer_kernel(self) -> LayerKernel:
        """Return the layer between the PLC and its kernel that handles the sessions of the CONNECTs."""
        for config in self.project.connects:
            if config.session is not None:  # made once now, so that no scan loads library and certificates
                config.session.make_session(config.active)
        return LayerKernel(self._wire_kernel(), self._time, self._note_layer, self._on_error, work=self._work)

    def _make_peer_kernel(self, decl: PeerDecl) -> Kernel:
        if self._seam is None:
            return self._make_inner_kernel(decl)
        return self._wrap(self._seam, decl.name, lambda: self._make_inner_kernel(decl))

    def _make_inner_kernel(self, decl: PeerDecl) -> Kernel:
        if decl.session is None:
            return self._kernel
        of, work = self._note_layer, self._peers_work
        return LayerKernel(self._kernel, self._time, of, self._on_error, polls=False, work=work)

    def _make_serial_port(self, owner: str, settings: SerialSettings) -> SerialPort:
        if self._seam is None:
            return self._make_inner_port(owner, settings)
        from trcvtui.recording.seam import SeamPort

        return SeamPort(self._seam, owner, lambda: self._make_inner_port(owner, settings))

    def _make_inner_port(self, owner: str, settings: SerialSettings) -> SerialPort:
        if self._sim is not None:
            line = self.lines[owner] = SimSerialPort()
            return FaultyPort(line, self.plan, owner)
        from trcvtui.net.os.serial import OsSerialPort

        return FaultyPort(OsSerialPort(settings), self.plan, owner)

    def _on_error(self, owner: str, error: Exception) -> None:
        self.containment.record_error(("session", owner), error)

    def _note_layer(self, note: LayerNote) -> None:
        self._note(BenchNote(note.connect, note.what, note.why, note.client, note.for_all))

    def _report_wait(self, connect: str, what: EventKind, partner: str, why: str) -> None:
        from trcvtui.recording.journal import DeferredWork

        self._note(DeferredWork(connect, what, partner, why))

    def _report_fault(self, owner: str, fault: object) -> None:
        self._note(BenchNote(owner, "fault fired", str(fault)))

    def _note(self, note: LedgerNote) -> None:
        if self._seam is not None:
            self._seam.handle_ledger_note(note)
        self._write(note)

    def _write(self, note: LedgerNote) -> None:
        if isinstance(note, BenchNote | PeerSent):
            if self._is_replay and isinstance(note, BenchNote) and note.what == INTERNAL_ERROR:
                self.containment.add_message(f"{note.subject}: {note.detail}")
            self.runtime.ledger.write(note)
        else:
            self._on_wait(note.connect, EventKind(note.what), note.partner, note.why)

    def _record_exception(self, part: RunPart, report: Callable[[], ExceptionNote]) -> ExceptionNote | None:
        return self._do_by_seam(part[1], EXCEPTION, part[:1], report)

    def _do_past_seam(self, do: Callable[[], object]) -> None:
        is_busy = self._seam is not None and self._seam.is_busy
        if self._seam is not None:
            self._seam.is_busy = False
        try:
            do()
        finally:
            if self._seam is not None:
                self._seam.is_busy = is_busy

    def _report_error(self, error: BaseException) -> ExceptionNote:
        from trcvtui.bench.error_report import MOST_LEDGER_LINES, report_error  # only after an error

        lines = self.runtime.ledger.lines_since(0, MOST_LEDGER_LINES)
        return report_error(error, self.project, lines, self.reports)

    def _do_by_seam(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        return do() if self._seam is None else self._seam.ask(owner, call, args, do)

    def _make_resources(self, project: Project) -> Resources:
        return Resources(
            JobQueue(project.rules.queue, self.plan.take_fault),
            BufferPool(project.rules.buffers, self.plan.take_fault),
            ConnectionBudget(project.connection_limit),
            self._work,
        )

    def _listening_end(self, connect: str) -> Endpoint | None:
        port = self.runtime.listening_port(connect)
        config = self.project.connect(connect) or self.project.udp_config(connect)
        return Endpoint(config.local.address, port) if config and port is not None else None

    def is_free(self, end: Endpoint) -> bool:
        return self._do_by_seam("bench", "is_free", (end,), lambda: self._is_free(end))

    def _is_free(self, end: Endpoint) -> bool:
        handle = self._kernel.socket("bench")
        if isinstance(handle, Fault):
            return True
        self._kernel.set_reuse(handle)
        failed = self._kernel.bind(handle, end)
        self._kernel.close(handle)
        return failed is None or failed.error != "EADDRINUSE"

    def _peer_port(self, name: str) -> int | None:
        peer = self.peers.get(name)
        return peer.transport.last_port if peer else None

    @property
    def network(self) -> SimKernel:
        """Return the simulated network; a test can put its own partners into the network."""
        assert self._sim is not None
        return self._sim

    def quiet_until(self) -> int | None:
        """Return `now` with checks, peers, sessions or a running program, else what the runtime returns."""
        is_alone = self._program.is_over and not (self._checks or self.peers or self._has_sessions)
        return self.runtime.quiet_until() if is_alone else self.now

    # -- time ---------------------------------------------------------------------------------------

    def step(self, now: int | None = None) -> None:
        """Let a scan pass at `now` (None: next multiple of the interval); peers act before and after it."""
        due = self.runtime.scans * self.runtime.interval_ns if now is None else now
        if self.peers and self._sim is not None:
            while isinstance(at := self._find_next_peer_time(due), int):
                self._record_and_do("rest", at, partial(self._step_peers_at, at))
        if self._seam is None:
            self._run_scan(due)
            return
        self.record_outputs()
        self._seam.is_busy = True  # its calls are recorded as of a scan, not of a gap
        self._run_scan(self._seam.ask("bench", "step", (), lambda: due))
        self._unrecorded = self.runtime.changed
        self._seam.is_busy = False
        if self._is_replay:
            self.record_outputs()

    def record_outputs(self) -> None:
        """Record what the last scan changed. Call this first in the gap between two scans."""
        if self._seam is not None and self._unrecorded:
            self._seam.is_busy = True
            for edge in self._unrecorded:
                works_on = self._works_on.get(edge.instance, "")
                self._seam.ask(edge.instance, "shows", (works_on, *edge.outputs), _do_nothing)
            self._unrecorded = ()
            self._seam.is_busy = False

    def _run_scan(self, now: int) -> None:
        late, interval = now - self._scan_at, self.runtime.interval_ns
        self.late_ns = late if late > interval // 2 else 0  # less is usual jitter
        self.late_scans += late > interval // 2
        self.now, self._scan_at = now, now + interval if self.kernel_name == "live" else NEVER
        if self._sim is not None and not self._is_replay:
            self._sim.advance(self.now)
        self.step_peers()
        if not self._program.is_over:
            self.containment.attempt_unless_out(("program", "program"), self._program.advance)
        self.runtime.scan(self.now)
        self._note_arrivals()
        if self._checks:
            self.containment.attempt_unless_out(("check", "check"), self._check_data)
        self.step_peers()

    def _check_data(self) -> None:
        for out in self.runtime.due_edges if any(check.instance for check in self._checks.values()) else ():
            for check in self._checks.values() if out.outputs.done else ():
                decl = self.project.instance(out.instance)
                if check.instance == out.instance and decl is not None and decl.data is not None:
                    check.check_data(self.runtime.data(decl.data)[: out.outputs.rcvd_len])

    def step_peers(self) -> None:
        self._peers_work.begin_scan(self.now)
        now, contained = self.now, self.containment
        for steps in (self._self_acting, self._checks, self.peers):
            for name, each in steps.items():
                if contained.out and ("peer", name) in contained.out:
                    continue
                try:
                    each.step(now)
                    if contained.is_due is not None:
                        contained.raise_recorded(("peer", name))
                except Exception as error:
                    contained.record_error(("peer", name), error)
                    contained.attempt(("peer", name), self.peers[name].end)
                    contained.out.add(("peer", name))

    def step_peers_alone(self) -> None:
        self._scan_at = NEVER
        self._record_and_do("rest", 0, self.step_peers)

    def _find_next_peer_time(self, scan: int) -> object:
        """Return when a peer or the simulated network acts next; None if nothing acts before `scan`."""
        if self._is_replay:
            entry = cast("ReplaySeam", self._seam).peek_call()
            return entry.args[0] if entry is not None and entry.call == "rest" and entry.args else None
        assert self._sim is not None
        due = min(scan, self._sim.wire.agenda.next_due or scan, *self._due_times())
        at = max(-(-due // LEAST_INTERVAL_NS), self.now // LEAST_INTERVAL_NS + 1) * LEAST_INTERVAL_NS
        return at if at < scan else None

    def _step_peers_at(self, at: int) -> None:
        self.now = at
        if self._sim is not None and not self._is_replay:
            self._sim.advance(at)
        self.step_peers()
        if any(due <= at for due in self._due_times()):  # a peer connected, or sent its last byte, just now
            self.step_peers()

    def _due_times(self) -> Iterator[int]:
        for steps in (self._self_acting, self._checks, self.peers):
            for name, each in steps.items():
                due = each.due_at(self.now)
                if due is not None and ("peer", name) not in self.containment.out:
                    yield due

    def _record_and_do(self, call: str, line: str | int, do: Callable[[], T]) -> T:
        if self._seam is None or self._seam.is_busy:
            return do()
        self.record_outputs()
        self._seam.is_busy = True
        try:
            self._seam.ask("bench", call, (line,) if line else (), _do_nothing)
            return do()
        finally:
            self._seam.is_busy = False

    def faults(self) -> tuple[str, ...]:
        return tuple([str(fault) for fault in self.plan.entries()])

    def peer_snapshots(self) -> tuple[PeerSnapshot, ...]:
        return tuple(
            replace(
                peer.snapshot(),
                link=link,
                silent=link in self._down,
                check=self._checks[peer.decl.name].snapshot() if peer.decl.name in self._checks else None,
            )
            for peer, link in zip(self.peers.values(), self._links, strict=True)
        )

    # -- commands -------------------------------------------------------------------------------------

    def do(self, command: words.BenchCommand) -> str:
        """Carry out a command that lets no scan pass. Return what is wrong, or ""."""
        row = find_record_row(type(command))
        act = row.act
        if act is None:
            return f"{type(command).__name__} lets scans pass"
        line = "" if self._seam is None or self._seam.is_busy else row.write(command)
        self.containment.restore_parts(("peer", getattr(command, "peer", "")))  # a failed peer gets a new try
        wrong = self._record_and_do(
            "do", line, lambda: self.containment.attempt(COMMAND, lambda: act(self, command))
        )
        return INTERNAL_ERROR if wrong is None else wrong

    def filter_program(self, left_of: Callable[[words.BenchCommand], words.BenchCommand | None]) -> None:
        self._program.filter_steps(left_of)

    def skip(self, scans: int) -> None:
        """Count scans in which nothing happens, without running them."""
        if self._seam is not None:
            self._seam.is_busy = True
            self._seam.ask("bench", "skip", (scans,), _do_nothing)
            self._seam.is_busy = False
        self.runtime.skip(scans)

    def record_line(self, line: str) -> None:
        """Record a line that was typed on the screen; the bench does not carry the line out."""
        self._record_and_do("do", line, _do_nothing)

    def submit(self, *orders: commands.Command) -> str:
        for order in orders:
            self.runtime.submit(order)
        return ""

    def apply_change(self, command: words.BenchCommand, order: commands.Command) -> str:
        self.project = project_after(command, self.project)
        return self.submit(order)

    def replace_project(self, project: Project) -> None:
        """Take over a project with added or changed parts; the PLC uses them from its next scan on."""
        orders: list[commands.Command] = []
        for kind in ("connects", "udp_configs", "addrs", "combuffers", "data"):
            had = {each.name: each for each in getattr(self.project, kind)}
            for each in getattr(project, kind):
                before = had.get(each.name)
                if before != each:
                    new = commands.AddDeclaration(each)
                    orders.append(new if before is None else commands.ReplaceDeclaration(before, each))
        for decl in project.instances:
            known = self.project.instance(decl.name)
            if known != decl:
                made = commands.CreateInstance(decl)
                orders.append(made if known is None else commands.ReplaceDeclaration(known, decl))
        self.project, self._works_on = project, _connects_by_instance(project)
        self.submit(*orders)

    def edit_project(self, command: EditCommand) -> str:
        edited = project_after(command, self.project)
        for edit in make_edits(command, self.project):
            wrong = self._apply_edit(edit, edited)
            if wrong:
                return wrong
        self.project, self._works_on = edited, _connects_by_instance(edited)
        if isinstance(command, words.AddEntry | words.Change | words.Remove | words.UndoEdit):
            self._renew_peer_routines()
        self.peers = {decl.name: self.peers[decl.name] for decl in edited.peers}
        self._links = [find_peer_link(decl, edited) for decl in edited.peers]
        return ""

    def _apply_edit(self, edit: Edit, edited: Project) -> str:
        if edit.kind == "peer":
            before, decl = edit.before, edit.after
            assert isinstance(before, PeerDecl | None) and isinstance(decl, PeerDecl | None)
            return self._apply_peer_edit(before, decl, edited)
        change = _make_plc_command(edit, edited)
        if change is None:
            self.note(*_describe_edit(edit))
            return ""
        self._enable_sessions(edit.after)
        if edit.after is None:
            self._down.discard(edit.name)
        return self.submit(change)

    def _apply_peer_edit(self, before: PeerDecl | None, decl: PeerDecl | None, edited: Project) -> str:
        old = self.peers.get(before.name) if before is not None else None
        if old is not None:
            old.end()
        wrong = self._add_peer(decl, edited) if decl is not None else ""
        if wrong and old is not None:  # the edit is refused: the old peer is needed again
            old.listen()
        if not wrong and before is not None:
            self.stop_check(words.NumberedFramesOff(before.name))
            if decl is None:
                del self.peers[before.name]
                self._self_acting.pop(before.name, None)
                self.note(before.name, "removed")
        return wrong

    def _renew_peer_routines(self) -> None:
        routines = read_routines(self.project)
        for decl in self.project.peers:
            if any(text.startswith("message ") for text in decl.says):  # the library may have changed
                self._self_acting[decl.name] = AutomaticPeer(self.peers[decl.name], routines[decl.name])

    def _enable_sessions(self, decl: object) -> None:
        if isinstance(decl, ConnectConfig) and decl.session is not None and not self._has_sessions:
            self._has_sessions = True
            self.runtime.use_kernel(self._make_plc_kernel())

    def _add_peer(self, decl: PeerDecl, edited: Project) -> str:
        peer = self._new_peer(decl)
        wrong = "" if decl.active else peer.listen()
        if wrong:
            peer.end()
            return wrong
        alone = replace(edited, peers=(decl,))
        for rule in read_replies(alone):
            peer.replies.add(rule)
        self._self_acting.pop(decl.name, None)
        self._self_acting |= {n: AutomaticPeer(peer, routine) for n, routine in read_routines(alone).items()}
        self.peers[decl.name] = peer
        return ""

    def start_check(self, command: words.NumberedFramesOn) -> str:
        self._checks[command.peer] = TrafficCheck(self.peers[command.peer], command)
        return ""

    def stop_check(self, command: words.NumberedFramesOff) -> str:
        check = self._checks.pop(command.peer, None)
        if check is not None:
            check.end()
        return ""

    def set_link(self, command: words.SetLink) -> str:
        wrong, how = self._do_by_seam(
            command.connect,
            "link",
            (command.up,),
            lambda: set_link(self._kernel, command.connect, command.up),
        )
        if not wrong:
            (self._down.discard if command.up else self._down.add)(command.connect)
            self.note(command.connect, "link up" if command.up else "link down", how)
        return wrong

    def order_tap(self, command: words.TapAct) -> str:
        """Send the order to the tap that feeds this bench; events say later what the tap did."""
        return self.on_tap(command) if self.on_tap else f"no tap runs here: `trcvtui tap` runs {command.tap}"

    def arm_fault(self, command: words.FaultOn) -> str:
        times = None if command.times == words.TIMES_FOREVER else command.times
        self.plan.add(command.call, command.error, on=command.on, nth=command.nth, times=times)
        self.note(command.on or "any CONNECT", f"fault on {command.call}", command.error or "")
        return ""

    def clear_faults(self) -> str:
        self.plan.clear()
        self.note("bench", "faults cleared")
        return ""

    def note(self, subject: str, what: str, detail: str = "") -> None:
        """Write into the ledger something that happened outside of the PLC."""
        self.runtime.ledger.write(BenchNote(subject, what, detail))

    def close(self) -> None:
        self._record_and_do("close", "", self._close)

    def _close(self) -> None:
        self.runtime.close()
        for name, peer in self.peers.items():
            self.containment.attempt(("peer", name), peer.end)
        if not isinstance(self._kernel, SimKernel):
            self._kernel.close_all()

    def leaks(self) -> tuple[str, ...]:
        return self._kernel.leaks()


def _do_nothing() -> None:
    """Do nothing; only the recording of the call and its arguments matters."""


def _make_sim_kernel(project: Project) -> SimKernel:
    sim = project.sim
    names = None if sim.names is None else dict(sim.names)
    return SimKernel(sim.seed, sim.addresses, sim.not_ethernet, sim.latency_ns, sim.fragment, names)


def _make_plc_command(edit: Edit, edited: Project) -> commands.Command | None:
    """Return the PLC command for an edit, None if the edit does not concern the PLC."""
    before, decl = edit.before, edit.after
    if isinstance(decl, ComBufferDecl):
        decl = edited.combuffer(decl.name)  # with is_written and is_fed, which depend on other entries
    match before, decl:
        case (None, InstanceDecl()):
            return commands.CreateInstance(decl, edit.place)
        case (InstanceDecl(), None):
            return commands.DeleteInstance(edit.name)
        case (InstanceDecl(), InstanceDecl()):
            return commands.ReplaceDeclaration(before, decl)
    was, now = (each if isinstance(each, commands.PartDecl) else None for each in (before, decl))
    if now is None:
        return commands.RemoveDeclaration(was) if was is not None else None
    return commands.AddDeclaration(now) if was is None else commands.ReplaceDeclaration(was, now)


def _describe_edit(edit: Edit) -> tuple[str, str]:
    is_file = edit.kind in ("certificate", "udt")
    subject = f"{edit.kind} {edit.name}" if is_file else edit.name
    if edit.after is None:
        return subject, "removed"
    if edit.before is not None:
        return subject, "declared anew"
    return subject, "added" if is_file else "in the library"
