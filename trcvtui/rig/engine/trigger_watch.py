"""What goes along with every scan for the screen's sake: facts are kept, the trigger is looked at.

When a trigger fires, what the screen gets next is the bench of that very scan, whatever has happened since.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from trcvtui.plc.ledger import Line
from trcvtui.plc.snapshot import Snapshot
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.bench.triggers import Watch, read_trigger
from trcvtui.rig.history.link_statistics import LinkStatistics
from trcvtui.rig.history.received import JobHistory
from trcvtui.rig.history.records import Facts
from trcvtui.rig.picture import Picture
from trcvtui.rig.snapshots import Fired, PeerSnapshot

BEFORE: Final = 2000  # lines of the ledger that a picture of a trigger brings at most
MOST_BYTES: Final = 262_144  # of all DATA in it: they cross in one piece
MOST_INSTANCES: Final = 64

Named = tuple[tuple[str, bytes], ...]


@dataclass(frozen=True, slots=True)
class _Kept:
    """The bench in the scan of a trigger."""

    fired: Fired
    snapshot: Snapshot
    lines: tuple[Line, ...]
    data: Named
    partial: Named
    peers: tuple[PeerSnapshot, ...]
    facts: tuple[tuple[str, Facts], ...]


class Watching:
    """The facts and the trigger of one bench."""

    def __init__(self, bench: Bench, history: JobHistory) -> None:
        self.trigger = Watch(bench)
        self._bench = bench
        self._history = history
        self._statistics = LinkStatistics(history.index)
        self._seq = 0  # of the last line that was read
        self._told = 0  # of the last line that a picture has brought
        self._kept: _Kept | None = None

    def arm(self, text: str, where: str) -> str:
        """Arm a trigger as it is written, or disarm; return what to tell of it; raise UserError."""
        trigger = read_trigger(text, self._bench.project, where)
        self.trigger.arm(trigger)
        if trigger is None:
            return "no trigger is armed"
        again = "; it is so already and fires when it becomes so again"
        return f"armed{again if self.trigger.is_so_already else ''}"

    def scanned(self) -> Fired | None:
        """Read what the last scan has written; return the trigger that fired in it."""
        ledger = self._bench.runtime.ledger
        written = ledger.stamped_since(self._seq)
        self._seq = ledger.last_seq
        if self.trigger.armed is None:
            return None
        fired = self.trigger.scanned(event for _, _, event in written)
        if fired is not None:
            self._kept = self._keep(fired)
        return fired

    def _keep(self, fired: Fired) -> _Kept:
        bench, runtime = self._bench, self._bench.runtime
        names = [instance.name for instance in bench.project.instances[:MOST_INSTANCES]]
        return _Kept(
            fired,
            runtime.snapshot(tuple(str(fault) for fault in bench.plan.entries())),
            runtime.ledger.since(self._told, BEFORE),
            self._data(),
            tuple((name, runtime.partial(name)) for name in names),
            tuple(peer.snapshot() for peer in bench.peers.values()),
            self.facts(tuple(names)),
        )

    def _data(self) -> Named:
        left, taken = MOST_BYTES, []
        for decl in self._bench.project.data:
            if decl.size <= left:
                taken.append((decl.name, self._bench.runtime.data(decl.name)))
                left -= decl.size
        return tuple(taken)

    def facts(self, instances: tuple[str, ...]) -> tuple[tuple[str, Facts], ...]:
        """Return what is known of these instances."""
        self._history.scanned()  # peers and commands write between scans too
        declared = map(self._bench.project.instance, instances)
        return tuple((i.name, self._statistics.facts(i.name, i.connect)) for i in declared if i is not None)

    def completed(self, picture: Picture, instances: tuple[str, ...], since: int) -> Picture:
        """Return the picture with facts and trigger; of a trigger that has fired, the one of its scan."""
        kept, armed = self._kept, self.trigger.armed
        text = armed.text if armed is not None else ""
        if kept is None:
            self._told = max(since, picture.lines[-1].seq if picture.lines else 0)
            return replace(picture, facts=self.facts(instances), armed=text)
        self._kept = None
        lines = tuple(line for line in kept.lines if line.seq > since)
        self._told = lines[-1].seq if lines else since
        return replace(
            picture,
            snapshot=kept.snapshot,
            lines=lines,
            lines_skipped=lines[0].seq - since - 1 if lines else 0,
            data=kept.data,
            partial=kept.partial,
            peers=kept.peers,
            facts=kept.facts,
            armed=text,
            fired=kept.fired,
        )
