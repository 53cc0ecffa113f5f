"""What a recording knows beside its packets: what the instances expect, and what its program did wrong."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import JobStarted, SendEnded, SendStarted
from trcvtui.blocks.table import block_row
from trcvtui.capture.journal import GAP, Answered, Entry
from trcvtui.capture.recording import Recording
from trcvtui.errors import UserError
from trcvtui.net.events import BytesDropped, BytesReceived
from trcvtui.plc.ledger import InputEdge, StatusEdge
from trcvtui.rig.diagnosis.doctor import JobTrouble, RecordedFacts
from trcvtui.rig.diagnosis.lint import receivers_of
from trcvtui.rig.replay.keyframes import Keyframes
from trcvtui.rig.replay.run_again import RunAgain, restored_state

LARGER: Final = "larger than LEN or DATA"
UNREAD: Final = GAP + "unread"
SECOND: Final = 1_000_000_000
GROWING: Final = 4  # seconds, one after the other
MOST_SCANS: Final = 1_000_000


class _Backlog:
    """What waits in the stack for each CONNECT, as the gaps of a run ask: the least of each second."""

    def __init__(self, run: RunAgain) -> None:
        self._run = run
        self._least: dict[str, dict[int, int]] = {}
        self._read: dict[str, set[int]] = {}
        run.replay.entries = self._noted(run.replay.entries)

    def _noted(self, entries: Iterator[Entry]) -> Iterator[Entry]:
        for entry in entries:
            if isinstance(entry, Answered) and entry.call == UNREAD and isinstance(entry.answer, int):
                known = self._least.setdefault(entry.owner, {})
                second = self._run.bench.now // SECOND
                known[second] = min(known.get(second, entry.answer), entry.answer)
            yield entry

    def read(self, connect: str, t_ns: int) -> None:
        """Take that a job has got bytes."""
        self._read.setdefault(connect, set()).add(t_ns // SECOND)

    def floods(self) -> Iterator[tuple[str, int, int]]:
        """Yield each CONNECT for which more waits each second although jobs run: since when, for how long."""
        for connect, least in self._least.items():
            read = self._read.get(connect, set())
            since, run = 0, 0
            for before, second in pairwise(sorted(least)):
                grows = least[second] > least[before] and second in read and second == before + 1
                since, run = (since or second, run + 1) if grows else (0, 0)
                if run == GROWING:
                    yield connect, since, sum(least[s] > least[s - 1] for s in least if s - 1 in least)
                    break


def recorded_facts(path: str) -> RecordedFacts | None:
    """Return what a recording of ours knows; None: it is none, or it cannot run."""
    try:
        run = Keyframes(Recording(Path(path)), path).begin()
        with restored_state(run.is_restored, path):
            return _facts_of(run)
    except UserError:
        return None


def _facts_of(run: RunAgain) -> RecordedFacts:
    project = run.bench.project
    connects = [each for each in project.connects if not each.is_datagram]
    calls = bool(connects) and all(each.active for each in connects)
    troubles = _troubles(run)  # until it ends
    until_ns = run.begins.wall_ns + run.bench.now
    return RecordedFacts(receivers_of(project), calls, troubles, until_ns)


def _troubles(run: RunAgain) -> tuple[JobTrouble, ...]:
    """Run it again, and count edges of REQ in a running job, and jobs without a connection."""
    found: dict[tuple[str, str], JobTrouble] = {}
    sends, asked = set[str](), set[str]()
    dropped: dict[tuple[str, int], tuple[int, int]] = {}
    streams = {each.name for each in run.bench.project.connects if not each.is_message_oriented}
    receivers = {each.name for each in run.bench.project.instances if block_row(each.block).receives}
    takers = {each.connect: each.name for each in run.bench.project.instances if each.name in receivers}
    seq, wall_ns = 0, run.begins.wall_ns
    ledger, backlog = run.bench.runtime.ledger, _Backlog(run)

    def tell(cause: str, instance: str, scan: int, t_ns: int) -> None:
        known = found.get((cause, instance))
        first = known or JobTrouble(cause, instance, scan, wall_ns + t_ns, 0)
        found[cause, instance] = first._replace(times=first.times + 1)

    try:
        while run.scan() and run.bench.runtime.scans < MOST_SCANS:
            if ledger.last_seq == seq:
                continue
            news, seq = ledger.stamped_since(seq), ledger.last_seq
            for scan, t_ns, event in news:
                match event:
                    case InputEdge(instance, "REQ", value) if value and instance in sends:
                        tell("request-too-fast", instance, scan, t_ns)
                    case BytesReceived():
                        backlog.read(event.connection, t_ns)
                    case SendStarted():
                        sends.add(event.instance)
                    case SendEnded():
                        sends.discard(event.instance)
                    case StatusEdge() if event.outputs.error and event.condition == Condition.NOT_CONNECTED:
                        tell("not-connected-request", event.instance, scan, t_ns)
                    case InputEdge(instance, "EN_R", _) if scan > 1:
                        asked.add(instance)
                    case BytesDropped(connection, _, _, _, reason) if reason == LARGER:
                        tell("datagram-size", takers.get(connection, connection), scan, t_ns)
                    case BytesDropped() if event.offset >= 0:
                        dropped[event.connection, event.incarnation] = scan, t_ns
                    case JobStarted() if not event.adhoc:
                        lost = dropped.pop((event.connection, event.incarnation), None)
                        if lost is not None and event.connection in streams:
                            tell("shifted", event.instance, *lost)
                    case _:
                        pass
    except UserError:
        pass  # the recording ends here
    for connect, since, seconds in backlog.floods():
        scan = since * SECOND // run.bench.runtime.interval_ns + 1
        first = JobTrouble("flood", takers.get(connect, connect), scan, wall_ns + since * SECOND, seconds)
        found["flood", connect] = first
    # EN_R that is 1 from the beginning costs nothing: the job begins when the connection stands.
    return tuple(
        [
            one
            for one in found.values()
            if one.times > 1 or one.cause == "datagram-size" or one.instance not in receivers - asked
        ]
    )
