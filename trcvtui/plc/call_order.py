"""Which instances a scan really calls: those that might answer otherwise than in the scan before.

A CONNECT sleeps, and all instances on it, once each of them has given an answer that lasts. What wakes it:
any command, what the poll saw on it, a change made by the communication phase. While it is awake all its
instances are called, so each of them meets the connection in the order of the program. An idle CONNECT costs
nothing, and nobody can see the difference (tests/properties/test_ready_only.py).

A task is due at the multiples of its interval; its instances are called in the first scan that has reached
the time: every 25 ms with scans of 10 ms are the scans at 0, 30, 50, 80, ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence, Set

from trcvtui.plc.containment import RunPart
from trcvtui.plc.instance import Instance
from trcvtui.plc.ledger import StatusEdge


class CallOrder:
    """The instances in call order, each with the interval of its task; times in ns.

    A CONNECT on which no instance is left can change too (PLC STOP): `connects` names them all.
    `failed` puts an instance out of service that has
    raised, and answers whether its outputs differ; `check` raises where a replay has it so.
    """

    def __init__(
        self,
        entries: Sequence[tuple[Instance, int]],
        scan_interval: int,
        connects: Iterable[str],
        failed: Callable[[Instance, Exception], bool],
        check: Callable[[RunPart], None] | None,
    ) -> None:
        self._failed, self._check = failed, check
        self._entries = tuple((instance, interval, instance.decl.connect) for instance, interval in entries)
        self._scan_interval = scan_interval
        self._intervals = frozenset(interval for _, interval in entries)
        self.is_one_task = self._intervals == {scan_interval}  # due in every scan
        # CONNECT -> the places of its instances in the call order
        self._places: dict[str, list[int]] = {connect: [] for connect in connects}
        for place, (_, _, connect) in enumerate(self._entries):
            self._places[connect].append(place)
        self._without = {connect for connect, places in self._places.items() if not places}
        self.awake = set(self._places)
        self._order: list[int] = []  # the places of the CONNECTs in `_ordered`
        self._ordered: set[str] = set()
        self._awake_since = set(self._places)  # which CONNECTs have been awake since `take_awake`

    def wake_all(self) -> None:
        """Call every instance when it is due next."""
        self.awake.update(self._places)
        self._awake_since.update(self._places)

    def wake(self, connects: Iterable[str]) -> None:
        """Call the instances on these CONNECTs when they are due next."""
        self.awake.update(connects)

    def call(self, turn: int) -> list[StatusEdge]:
        """Call who is awake and due, in call order; return the edges of those whose outputs changed."""
        changed: list[StatusEdge] = []
        if not self.awake:
            return changed
        due = None if self.is_one_task else self._due_intervals(turn)
        asleep: set[str] = set()
        awake: set[str] = set()  # beside an instance that sleeps, another one on the same CONNECT
        for place in self._ordered_places():
            instance, interval, connect = self._entries[place]
            if due is not None and interval not in due:
                awake.add(connect)
                continue
            try:
                has_changed = instance.call_block()
                if self._check is not None:
                    self._check(("instance", instance.name))
            except Exception as error:
                has_changed = self._failed(instance, error)
            if has_changed:
                changed.append(instance.edge)
            (asleep if instance.asleep else awake).add(connect)
        self.awake = self.awake - (asleep - awake) - self._without
        return changed

    def places(self, connect: str) -> Sequence[int]:
        return self._places[connect]

    def take_awake(self) -> set[str]:
        """Return the CONNECTs on which anything can have changed since the last time that this was asked."""
        awake, self._awake_since = self._awake_since, set(self.awake)
        return awake

    def instances_on(self, connects: Iterable[str]) -> Iterator[Instance]:
        return (self._entries[place][0] for name in connects for place in self._places.get(name, ()))

    def _ordered_places(self) -> list[int]:
        self._awake_since |= self.awake
        if self.awake != self._ordered:
            self._ordered = self.awake
            self._order = sorted([place for connect in self.awake for place in self._places.get(connect, ())])
        return self._order

    def due_instances(self, turn: int) -> Iterator[Instance]:
        """Return the instances that this turn calls, the sleeping ones among them."""
        due = self._due_intervals(turn)
        return (instance for instance, interval, _ in self._entries if interval in due)

    def _due_intervals(self, turn: int) -> Set[int]:
        if self.is_one_task:
            return self._intervals
        now = turn * self._scan_interval
        before = now - self._scan_interval
        return {interval for interval in self._intervals if now // interval > before // interval}
