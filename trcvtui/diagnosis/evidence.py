"""The evidence for an answer to "why?": all that is known of one instance, now or in a past scan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from trcvtui.blocks.outcome import Cause
from trcvtui.blocks.pins import PinValue
from trcvtui.history.records import PAUSE_SCANS, ConnectFacts, ScanStamp
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.plc.snapshot import ComBufferSnapshot, ConnectionSnapshot
from trcvtui.snapshots.bench import PeerSnapshot

if TYPE_CHECKING:  # the screen has a picture before it imports a project
    from trcvtui.project.project import Project


NO_FACTS = ConnectFacts()


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that is known of one instance at one moment. If `is_past`, the moment is a past edge."""

    instance: str
    block: str
    condition: str
    cause: Cause
    at: ScanStamp
    interval_ns: int
    is_past: bool = False
    pins: tuple[tuple[str, PinValue], ...] = ()
    data: str = ""
    data_size: int = 0
    have: int = 0
    need: int = 0
    adhoc: bool = False
    last_bytes_ns: int | None = None
    done_scan: int | None = None
    done_len: int | None = None
    link: ConnectionSnapshot | None = None
    config: ConnectConfig | None = None
    facts: ConnectFacts = NO_FACTS
    peers: tuple[PeerSnapshot, ...] = ()
    callers: tuple[str, ...] = ()  # the active peers of this bench that are meant for this CONNECT
    budget: tuple[int, int] = (0, 0)  # connections in use, and their limit
    has_adhoc: bool = True  # an ADHOC pin; without one a LEN of 65535 is ad hoc
    adhoc_at_once: bool = False  # it acts on the job that runs
    is_stopped: bool = False  # the PLC is in STOP
    buffer: ComBufferSnapshot | None = None  # what a block of serial lines works on

    def pin(self, name: str) -> PinValue | None:
        return next((value for pin, value in self.pins if pin == name), None)

    def ns_since(self, moment: ScanStamp) -> int:
        return max(0, self.at.t_ns - moment.t_ns)

    @property
    def is_datagram(self) -> bool:
        """Return whether the instance uses UDP: a CONNECT for UDP, or a UDP_CONFIG."""
        if self.config is not None:
            return self.config.is_datagram
        return self.link is not None and self.link.udp

    @property
    def has_messages(self) -> bool:
        """Return whether messages over its connection arrive whole, one per job (ISO-on-TCP)."""
        return self.config is not None and self.config.is_message_oriented and not self.is_datagram

    @property
    def is_arriving(self) -> bool:
        """Return whether bytes still come: no pause has been long enough to end a burst."""
        return self.quiet_ns is not None and self.quiet_ns <= PAUSE_SCANS * self.interval_ns

    @property
    def quiet_ns(self) -> int | None:
        """Return for how long no byte has come, in ns, or None if no byte has come yet."""
        return None if self.last_bytes_ns is None else max(0, self.at.t_ns - self.last_bytes_ns)


def make_current_evidence(picture: BenchUpdate, project: Project, name: str) -> Evidence | None:
    """Return the evidence of an instance after the last scan, or None if there is no such instance."""
    snapshot = picture.snapshot
    instance = snapshot.instance(name)
    if instance is None:
        return None
    data = next((d for d in snapshot.data if d.name == instance.data), None)
    return Evidence(
        instance=name,
        block=instance.block,
        condition=instance.condition,
        cause=instance.cause,
        at=ScanStamp(snapshot.scan, snapshot.t_ns),
        interval_ns=snapshot.interval_ns,
        pins=instance.inputs,
        data=instance.data or "",
        data_size=data.size if data else 0,
        have=instance.have if instance.need else instance.cause.have or 0,
        need=instance.need or instance.cause.need or 0,
        adhoc=instance.adhoc,
        last_bytes_ns=instance.last_receive_ns,
        done_scan=instance.last_done_scan,
        done_len=instance.last_rcvd_len,
        link=snapshot.connection(instance.connect),
        config=project.connect(instance.connect),
        facts=next((facts for known, facts in picture.facts if known == name), NO_FACTS),
        peers=picture.peers,
        callers=_list_active_peers(project, instance.connect),
        budget=(snapshot.connections_used, snapshot.connections_limit),
        has_adhoc=_has_adhoc(project, instance.block),
        adhoc_at_once=project.rules.adhoc_at_once,
        is_stopped=not snapshot.running,
        buffer=snapshot.combuffer(instance.connect),
    )


def _has_adhoc(project: Project, block: str) -> bool:
    return any(pin.name == "ADHOC" for pin in project.pins(block))


def _list_active_peers(project: Project, connect: str) -> tuple[str, ...]:
    config = project.connect(connect)
    ends = (f"@{connect}", config.local if config is not None else None)
    return tuple(peer.name for peer in project.peers if peer.active and not peer.udp and peer.end in ends)


def make_past_evidence(
    line: Line, edge: StatusEdge, facts: ConnectFacts, until: ScanStamp, project: Project, interval_ns: int
) -> Evidence:
    """Return the evidence of a past edge from ledger and `facts`. The STATUS lasted until `until`."""
    need = edge.cause.need or 0
    have = edge.cause.have or 0
    if edge.outputs.busy and need and facts.job_offset is not None:
        have = max(0, min(need, facts.received - facts.job_offset))
    decl = project.instance(edge.instance)
    data = project.data_decl(decl.data) if decl and decl.data else None
    return Evidence(
        instance=edge.instance,
        block=edge.block,
        condition=edge.condition,
        cause=edge.cause,
        at=until,
        interval_ns=interval_ns,
        is_past=True,
        data=data.name if data else "",
        data_size=data.size if data else 0,
        have=have,
        need=need,
        adhoc=facts.job_adhoc if facts.job_began else bool(decl and dict(decl.inputs).get("ADHOC")),
        config=project.connect(decl.connect) if decl else None,
        facts=facts,
        has_adhoc=_has_adhoc(project, edge.block),
        adhoc_at_once=project.rules.adhoc_at_once,
    )
