"""Which instances a scan really calls: those that might answer otherwise than in the scan before.

A CONNECT sleeps, and all instances on it, once each of them has given an answer that lasts. What wakes it:
any command, what the poll saw on it, a change made by the communication phase. While it is awake all its
instances are called, so each of them meets the connection in the order of the program. An idle CONNECT costs
nothing, and nobody can see the difference (tests/properties/test_ready_only.py).

A task is due at the multiples of its interval; its instances are called in the first scan that has reached
the time: every 25 ms with scans of 10 ms are the scans at 0, 30, 50, 80, ...
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence, Set

from trcvtui.net.kernel import Handle
from trcvtui.plc.fast_lane import Lane, lane_of
from trcvtui.plc.instance import Instance
from trcvtui.plc.ledger import Ledger


class CallOrder:
    """The instances in call order, each with the interval of its task; times in ns.

    A CONNECT on which no instance is left can change too (PLC STOP): `connects` names them all.
    `ledger`: where fast lanes write; None: there are none.
    """

    def __init__(
        self,
        entries: Sequence[tuple[Instance, int]],
        scan_interval: int,
        connects: Iterable[str],
        ledger: Ledger | None,
    ) -> None:
        self._entries = tuple((instance, interval, instance.decl.connect) for instance, interval in entries)
        self._scan_interval = scan_interval
        self._intervals = frozenset(interval for _, interval in entries)
        self._one_task = self._intervals == {scan_interval}  # due in every scan
        # CONNECT -> the places of its instances in the call order
        self._places: dict[str, list[int]] = {connect: [] for connect in connects}
        for place, (_, _, connect) in enumerate(self._entries):
            self._places[connect].append(place)
        self._awake = set(self._places)
        self._order: list[int] = []  # the places of the CONNECTs in `_ordered`
        self._ordered: set[str] = set()
        self._ledger = ledger
        self._lanes: dict[int, Lane] = {}  # by place
        self._awake_since = set(self._places)  # which CONNECTs have been awake since `take_awake`

    def wake_all(self) -> None:
        """Call every instance when it is due next, each the usual way."""
        self.end_lanes()
        self._awake.update(self._places)
        self._awake_since.update(self._places)

    def wake(self, connects: Iterable[str]) -> None:
        """Call the instances on these CONNECTs when they are due next."""
        self._awake.update(connects)

    def end_lanes(self, connect: str | None = None) -> None:
        """Call the instances on a CONNECT the usual way; None: all instances."""
        for place in tuple(self._lanes) if connect is None else self._places.get(connect, ()):
            lane = self._lanes.pop(place, None)
            if lane is not None:
                lane.hand_over()

    def call(self, turn: int, ready: Container[Handle], scan: int, now: int) -> list[Instance]:
        """Call who is awake and due, in call order; return those whose outputs changed."""
        changed, awake, due = [], set(), self._due_intervals(turn)
        entries, lanes = self._entries, self._lanes
        for place in self._in_order():
            instance, interval, connect = entries[place]
            if interval not in due:
                awake.add(connect)
                continue
            has_changed = lanes[place].scan(ready, scan, now) if place in lanes else None
            if has_changed is None:
                has_changed = self._call(place, instance)
            if has_changed:
                changed.append(instance)
            if not instance.asleep:
                awake.add(connect)
        self._awake = awake
        return changed

    def _call(self, place: int, instance: Instance) -> bool:
        """Call one instance the usual way; after a DONE its lane may begin."""
        self.end_lanes(instance.decl.connect)
        has_changed = instance.scan()
        if self._ledger is not None and instance.outputs.done and instance.called:
            is_alone = len(self._places[instance.decl.connect]) == 1
            lane = lane_of(instance, self._ledger) if is_alone else None
            if lane is not None:
                self._lanes[place] = lane
        return has_changed

    def take_awake(self) -> set[str]:
        """Return the CONNECTs on which anything can have changed since the last time that this was asked."""
        awake, self._awake_since = self._awake_since, set(self._awake)
        return awake

    def _in_order(self) -> list[int]:
        self._awake_since |= self._awake
        if self._awake != self._ordered:
            self._ordered = self._awake
            self._order = sorted(
                [place for connect in self._awake for place in self._places.get(connect, ())]
            )
        return self._order

    def due(self, turn: int) -> Iterator[Instance]:
        """Return the instances that this turn calls, the sleeping ones among them."""
        due = self._due_intervals(turn)
        return (instance for instance, interval, _ in self._entries if interval in due)

    def _due_intervals(self, turn: int) -> Set[int]:
        if self._one_task:
            return self._intervals
        now = turn * self._scan_interval
        before = now - self._scan_interval
        return {interval for interval in self._intervals if now // interval > before // interval}
