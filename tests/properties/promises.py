"""What may stand on the pins of a block after a call, and who may own a direction (design section 3)."""

from __future__ import annotations

from collections.abc import Iterable

from tests.properties.byte_model import ByteModel, Ends
from trcvtui.blocks.table import block_row
from trcvtui.dialects.baosky.status import STATUS
from trcvtui.net.connection.connection import LOSS_REASONS
from trcvtui.net.events import BytesDropped, ConnectionChanged, EventKind
from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot, Snapshot

LISTED = {
    block: {row.code for row in STATUS if block in row.blocks} for row in STATUS for block in row.blocks
}
CONNECTING = {0x0000, 0x0001, 0x7000, 0x7001, 0x7002, 0x7003, 0x7004, 0x7007, 0x8000}
BUSY, DONE = {0x7005, 0x7006}, {0x7008, 0x7009}
BEHIND = {0x7001: 0x0001, 0x7007: 0x7003, 0x7008: 0x7006, 0x7009: 0x7005}  # a code -> the scan before
NO_BUFFER, IN_USE = 0x80A7, 0x80C3
GONE = " (gone)"
MAX_LEN = 65535


def check_outputs(out: StatusEdge, before: StatusEdge | None) -> None:
    pins = out.outputs
    assert pins.status in LISTED[out.block], f"{out.block} lists no {pins.status:04X}"
    assert pins.busy + pins.done + pins.error <= 1
    assert not pins.rcvd_len or pins.done
    assert not (pins.done and before and before.outputs.done), "DONE lasts one scan"
    assert pins.error == (pins.status >= 0x8080)
    if block_row(out.block).uses_network:
        assert pins.busy == (pins.status in BUSY)
        assert pins.done == (pins.status in DONE)
        assert pins.status not in CONNECTING or not (pins.busy or pins.done)
    if pins.status in BEHIND:
        assert before is not None and before.outputs.status == BEHIND[pins.status]


def check_owners(picture: Snapshot, model: ByteModel, levels: dict[str, int]) -> None:
    """Check that each direction has one owner a level (a priority), and that whoever works owns."""
    for connection in picture.connections:
        link = model.links.get((connection.name, connection.incarnation))
        for owners, jobs in (
            (connection.receivers, model.receiving),
            (connection.senders, model.sending),
        ):
            held = [levels[name.removesuffix(GONE)] for name in owners]
            assert len(held) == len(set(held)), f"{owners} of {connection.name}"
            for name, job in jobs.items():
                assert job.link is not link or job.link.is_over or name in owners
            assert not owners or (link is not None and not link.is_over)
        for name in connection.senders:
            assert name.endswith(GONE) or name in model.sending, f"{name} holds its lock without a job"


def check_orphans(before: Snapshot, after: Snapshot) -> None:
    """Check that the lock of an instance that is gone stays as long as its connection does."""
    for then in before.connections:
        now = after.connection(then.name)
        assert now is not None
        if (now.state, now.incarnation) == ("connected", then.incarnation):
            for old, new in ((then.receivers, now.receivers), (then.senders, now.senders)):
                assert {name for name in old if name.endswith(GONE)} <= set(new)


def check_in_use(out: StatusEdge, before: Snapshot, after: Snapshot, began: list[str]) -> None:
    """Check that 80C3 has a reason: somebody else, or an instance that is gone, holds the CONNECT.

    `began`: who may have taken a lock in this scan; it may have come and gone within it.
    """
    if out.outputs.status != IN_USE:
        return
    sends = out.block.startswith("TSEND")
    connect = next(i.connect for i in after.instances if i.name == out.instance)
    holders = {
        i.name
        for i in after.instances
        if i.name in began and i.connect == connect and i.block.startswith("TSEND") == sends
    }
    for picture in (before, after):
        connection = picture.connection(connect)
        assert connection is not None
        holders.update(connection.senders if sends else connection.receivers)
    assert holders - {out.instance}, f"{out.instance} is kept out by nobody"


class FramesKept:
    """No whole frame is dropped with a lost connection while a reader stands; nobody resets a successor.

    A reader stands as long as its pins ask, its job could start, no fault is planned, and no owner of its
    level (a priority) keeps it out who can start none himself.
    """

    def __init__(self) -> None:
        self._asked: dict[str, dict[str, int]] = {}  # CONNECT -> reader -> the least bytes of a frame
        self._incarnations: dict[str, int] = {}
        self._partners: dict[str, Ends] = {}
        self._ended: set[Ends] = set()
        self._successors: set[tuple[Ends, str]] = set()  # who has come after whose end

    def comes(self, client: Ends) -> None:
        """A client has connected: those who have ended by now came before him."""
        self._successors |= {(ended, client[0]) for ended in self._ended}

    def goes(self, client: Ends) -> None:
        """A client has sent FIN or RST."""
        self._ended.add(client)

    def check(
        self, news: Iterable[Line], picture: Snapshot, levels: dict[str, int], is_disturbed: bool
    ) -> None:
        """Check one scan; `is_disturbed`: a fault was, or is, planned."""
        now = {c.name: {} if is_disturbed else _readers(picture, c.name, levels) for c in picture.connections}
        for line in news:
            match line.event:
                case ConnectionChanged(name, _, EventKind.CONNECTED, local, peer):
                    self._partners[name] = peer, local
                    self._asked[name] = now[name]
                case ConnectionChanged(name, _, EventKind.REPLACED):
                    self._asked[name] = {}
                case ConnectionChanged(name, _, EventKind.SECOND_CLIENT, _, peer):
                    assert (self._partners[name], peer) not in self._successors, "he comes after the end"
                case BytesDropped(name, _, -1, size, reason) if reason in LOSS_REASONS.values():
                    for reader, least in self._asked.get(name, {}).items():
                        stands = now[name].get(reader) == least
                        assert not stands or size < least, f"{reader} asked for {least} of {size} bytes"
        for name, readers in self._asked.items():
            self._asked[name] = dict(readers.items() & now.get(name, {}).items())


def _readers(picture: Snapshot, connect: str, levels: dict[str, int]) -> dict[str, int]:
    """Return whose job on this CONNECT can start, kept out by nobody, and how many bytes it needs."""
    readers, connection = _able(picture, connect), picture.connection(connect)
    owners = () if connection is None else connection.receivers
    barred = {levels[name] for name in owners if not name.endswith(GONE) and name not in readers}
    return {name: least for name, least in readers.items() if levels[name] not in barred}


def _able(picture: Snapshot, connect: str) -> dict[str, int]:
    """Return whose pins and DATA let a job start, and with how many bytes it is complete."""
    connection = picture.connection(connect)
    if connection is None or any(name.endswith(GONE) for name in connection.receivers):
        return {}
    sizes = {data.name: data.size for data in picture.data}
    readers = {}
    for instance in picture.instances:
        size = sizes.get(instance.data or "", 0)
        if instance.connect == connect and _asks(instance):
            length = int(instance.pin("LEN") or 0)
            if size > 0 and max(length, 1) <= size and (length or size) <= MAX_LEN:
                readers[instance.name] = 1 if instance.pin("ADHOC") else length or size
    return readers


def _asks(instance: InstanceSnapshot) -> bool:
    return bool(instance.pin("EN_R")) and instance.pin("CONT") in (None, True)
