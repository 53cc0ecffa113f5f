"""A bench made of pictures: what the engine would send, written down by hand."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.picture.protocol import EngineStopped
from trcvtui.plc.ledger import Line, Outputs, StatusEdge
from trcvtui.plc.snapshot import ConnectionSnapshot, DataSummary, InstanceSnapshot, Snapshot
from trcvtui.project.file import load_project
from trcvtui.project.project import Project
from trcvtui.snapshots.bench import EngineTiming, LineAnswer, PeerSnapshot

HERE = Path(__file__).parent
MS = 1_000_000
SECOND = 1_000 * MS
TELEGRAM = struct.pack("<ihBxf", 41, 1, 1, 1234.5) + b"\x08\x05hello\x00\x00\x00\x00\x00"


def bench_project() -> Project:
    return load_project(HERE / "bench.toml")


def receiving(have: int = 17, need: int = 24) -> InstanceSnapshot:
    return InstanceSnapshot(
        name="TRCV_C_1",
        block="TRCV_C",
        connect="C1",
        data="rx",
        inputs=(("EN_R", True), ("CONT", True), ("LEN", 0), ("ADHOC", False), ("COM_RST", False)),
        outputs=Outputs(0x7006, busy=True, done=False, error=False, rcvd_len=0),
        condition=str(Condition.RECEIVING),
        cause=Cause(CauseKind.BYTES, "bytes are missing", have=have, need=need),
        since_scan=812,
        have=have,
        need=need,
        adhoc=False,
        last_receive_ns=8 * SECOND,
        jobs_done=3,
        errors=0,
        last_done_scan=811,
        last_rcvd_len=need,
        last_error_status=None,
        last_error_scan=None,
    )


def showing(
    instance: InstanceSnapshot, status: int, busy: bool = False, done: bool = False, error: bool = False
) -> InstanceSnapshot:
    return replace(instance, outputs=Outputs(status, busy, done, error, instance.outputs.rcvd_len))


def connecting() -> InstanceSnapshot:
    return replace(
        receiving(),
        name="TRCV_C_2",
        connect="C2",
        data="small",
        outputs=Outputs(0x7002, busy=False, done=False, error=False, rcvd_len=0),
        condition=str(Condition.ESTABLISHING),
        cause=Cause(CauseKind.WAITING, "before the next attempt", peer="10.0.0.7:2001"),
        since_scan=600,
        have=0,
        need=0,
        last_receive_ns=None,
        jobs_done=0,
        last_done_scan=None,
        last_rcvd_len=None,
    )


def connections() -> tuple[ConnectionSnapshot, ...]:
    up = ConnectionSnapshot(
        name="C1",
        active=False,
        state="connected",
        local="127.0.0.1:2000",
        remote="127.0.0.1:51322",
        incarnation=1,
        bytes_received=89,
        attempts=1,
        retry_in_ns=None,
        keep_alive_s=10,
    )
    down = replace(
        up,
        name="C2",
        active=True,
        state="establishing",
        local="",
        remote="10.0.0.7:2001",
        incarnation=0,
        bytes_received=0,
        attempts=7,
        retry_in_ns=400 * MS,
    )
    return up, down


def peers() -> tuple[PeerSnapshot, ...]:
    one = PeerSnapshot(
        name="P1",
        active=True,
        state="connected",
        local="127.0.0.1:51322",
        remote="127.0.0.1:2000",
        stalled=False,
        messages_sent=4,
        bytes_sent=89,
        bytes_received=0,
        pending=0,
        last_received=b"",
    )
    two = replace(
        one,
        name="P2",
        active=False,
        state="listening",
        local="127.0.0.1:40123",
        remote="",
        messages_sent=0,
        bytes_sent=0,
    )
    return one, two


def picture(
    *instances: InstanceSnapshot,
    scan: int = 920,
    t_ns: int = 9_190 * MS,
    lines: Sequence[Line] = (),
    data: bytes = TELEGRAM,
    partial: bytes = TELEGRAM[:17],
    holding: bool = False,
    running: bool = True,
    answers: Sequence[LineAnswer] = (),
    faults: tuple[str, ...] = (),
    selected: str = "TRCV_C_1",
    skipped: int = 0,
) -> BenchUpdate:
    shown = instances or (receiving(), connecting())
    name = next((i.data for i in shown if i.name == selected), None) or "rx"
    return BenchUpdate(
        snapshot=Snapshot(
            scan=scan,
            t_ns=t_ns,
            running=running,
            dialect="baosky",
            model="T4",
            interval_ns=10 * MS,
            instances=shown,
            connections=connections(),
            data=(DataSummary("rx", "Telegram", 24, 3), DataSummary("small", "ARRAY[0..7] OF BYTE", 8, 0)),
            ledger_seq=lines[-1].seq if lines else 0,
            connections_used=2,
            connections_limit=32,
            faults=faults,
        ),
        lines=tuple(lines),
        lines_skipped=skipped,
        data=((name, data),),
        partial=((selected, partial),),
        peers=peers(),
        answers=tuple(answers),
        timing=EngineTiming(scans=scan, mode="slice"),
        holding=holding,
        kernel="live",
    )


NO_CAUSE = Cause(CauseKind.SEQUENCE, "")


def edge(
    status: int,
    condition: Condition,
    cause: Cause = NO_CAUSE,
    busy: bool = False,
    done: bool = False,
    error: bool = False,
    rcvd_len: int | None = 0,
) -> StatusEdge:
    outputs = Outputs(status, busy, done, error, rcvd_len)
    return StatusEdge("TRCV_C_1", "TRCV_C", outputs, str(condition), cause)


def received(size: int) -> StatusEdge:
    cause = Cause(CauseKind.BYTES, "the frame is complete", have=size, need=size)
    return edge(0x7008, Condition.RECEIVED, done=True, rcvd_len=size, cause=cause)


def armed() -> StatusEdge:
    cause = Cause(CauseKind.BYTES, "nothing received yet")
    return edge(0x7006, Condition.RECEIVING, busy=True, cause=cause)


def written(*events: tuple[int, StatusEdge], first: int = 1) -> tuple[Line, ...]:
    return tuple(Line(first + n, scan, (scan - 1) * 10 * MS, event) for n, (scan, event) in enumerate(events))


def story() -> tuple[Line, ...]:
    start = Cause(CauseKind.INPUT, "CONT rose", pin="CONT", value=1)
    waits = Cause(CauseKind.WAITING, "no partner yet", detail="listening on 127.0.0.1:2000")
    up = Cause(CauseKind.PARTNER, "the partner is connected", peer="127.0.0.1:51322")
    early = Cause(CauseKind.INPUT, "EN_R is 1 without a connection", pin="EN_R", value=1)
    full = Cause(CauseKind.RESOURCE, "buffer full", call="buffer", error="ENOBUFS", injected=True)
    return written(
        (1, edge(0x0001, Condition.CREATING, cause=start)),
        (2, edge(0x7001, Condition.CREATED, cause=Cause(CauseKind.SEQUENCE, "the socket is there"))),
        (3, edge(0x7002, Condition.ESTABLISHING, cause=waits)),
        (4, edge(0x80A1, Condition.NOT_CONNECTED, error=True, cause=early)),
        (5, edge(0x7002, Condition.ESTABLISHING, cause=waits)),
        (400, edge(0x7004, Condition.CONNECTED, cause=up)),
        (401, armed()),
        (512, received(24)),
        (513, armed()),
        (640, edge(0x80A7, Condition.NO_BUFFER, error=True, cause=full)),
        (641, armed()),
        (811, received(24)),
        (812, armed()),
    )


class FakeDriver:
    is_shared = False

    def __init__(self, *pictures: BenchUpdate) -> None:
        self.waiting = list(pictures)
        self.lines: list[str] = []
        self.requests: list[UpdateRequest] = []
        self.stopped = ""
        self.closed = False
        self.restarts = 0

    def describe_quit_cuts(self) -> str:
        return ""

    def restart(self) -> None:
        self.stopped = ""
        self.restarts += 1

    def submit(self, line: str) -> int:
        self.lines.append(line)
        return len(self.lines)

    def request(self, request: UpdateRequest) -> None:
        self.requests.append(request)

    def poll_picture(self) -> BenchUpdate | None:
        if self.stopped:
            raise EngineStopped(self.stopped)
        return self.waiting.pop(0) if self.waiting else None

    def close(self) -> None:
        self.closed = True
