"""A scan calls only the instances whose outcome may differ from that in the last scan.

A CONNECT and its instances sleep once each instance has given a stable outcome. A CONNECT wakes on any
command, a poll event on it, or a change in the communication phase. While the CONNECT is awake, all its
instances are called, in the order of the program. A sleeping CONNECT costs nothing. The outputs are the
same as if nothing slept (tests/properties/test_ready_only.py).

A task is due at the multiples of its interval. The first scan at or after that time calls the task's
instances. So a task of 25 ms with scans of 10 ms is called in the scans at 0, 30, 50, 80, ... ms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence, Set

from trcvtui.plc.containment import RunPart
from trcvtui.plc.instance import Instance
from trcvtui.plc.ledger import StatusEdge


class CallOrder:
    """The instances in call order, each with the interval of its task; times in ns.

    `connects` names all CONNECTs, because a CONNECT without instances can change, too (PLC STOP). `failed`
    is called when an instance has raised an exception. It takes the instance out of service, and returns
    whether its outputs differ. `check` raises where a replay has a recorded exception.
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
        self._empty = {connect for connect, places in self._places.items() if not places}
        self.awake = set(self._places)
        self._order: list[int] = []  # the places of the CONNECTs in `_ordered`
        self._ordered: set[str] = set()
        self._awake_since = set(self._places)  # which CONNECTs have been awake since `take_awakened`

    def wake_all(self) -> None:
        """Wake every instance: `call` calls each of them when its task is due next."""
        self.awake.update(self._places)
        self._awake_since.update(self._places)

    def wake(self, connects: Iterable[str]) -> None:
        """Wake the instances on these CONNECTs: `call` calls each of them when its task is due next."""
        self.awake.update(connects)

    def call(self, turn: int) -> list[StatusEdge]:
        """Call the instances that are awake and due; return an edge for each one with changed outputs."""
        changed: list[StatusEdge] = []
        if not self.awake:
            return changed
        due = None if self.is_one_task else self._due_intervals(turn)
        asleep: set[str] = set()
        awake: set[str] = set()  # with an instance that has to be called again
        for place in self._ordered_places():
            instance, interval, connect = self._entries[place]
            if due is not None and interval not in due:
                awake.add(connect)  # it was not asked whether it sleeps
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
        self.awake = self.awake - (asleep - awake) - self._empty  # empty, or all asleep
        return changed

    def call_positions(self, connect: str) -> Sequence[int]:
        return self._places[connect]

    def take_awakened(self) -> set[str]:
        """Return the CONNECTs on which anything may have changed since the last call of `take_awakened`."""
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
        """Return the instances that are due in this turn, including sleeping ones."""
        due = self._due_intervals(turn)
        return (instance for instance, interval, _ in self._entries if interval in due)

    def _due_intervals(self, turn: int) -> Set[int]:
        if self.is_one_task:
            return self._intervals
        now = turn * self._scan_interval
        before = now - self._scan_interval
        return {interval for interval in self._intervals if now // interval > before // interval}
