"""Who works on one direction of a connection: the lock behind "CONNECT in use" (design 6, row 15).

Rule 1: a claim is one instance's; it is given back, or ends with the connection.
Rule 2: a claim whose instance is gone is an orphan: it keeps others out, but nobody works under it.
Rule 3: tasks of one priority see each other's claims. A task of another priority comes in between look and
take, so each sees its own (manual 7.15.1 and 7.15.2, notes: never share a CONNECT between such tasks).
"""

from __future__ import annotations


class Claim:
    """One instance's hold; `priority` is its task's, None where every task sees every claim.

    `has_frame`: its job has read all that it needs, and shows it in its next call. `is_refused`: its last
    call could start no job, so that it reads nothing, though it keeps others out.
    """

    __slots__ = ("has_frame", "instance", "is_orphan", "is_refused", "priority")

    def __init__(self, instance: str, priority: int | None = None) -> None:
        self.instance = instance
        self.priority = priority
        self.is_orphan = self.has_frame = self.is_refused = False


class Direction:
    """The claims on one direction of one connection: who takes it is the only one of its priority."""

    def __init__(self) -> None:
        self._claims: list[Claim] = []

    def take(self, claim: Claim) -> Claim | None:
        """Take this direction, or return the claim that is in the way."""
        for held in self._claims:
            if held is claim:
                return None
            if held.priority == claim.priority:
                return held
        self._claims.append(claim)
        return None

    def hold(self, claim: Claim) -> None:
        """Hold it beside others: who builds a connection keeps nobody of his own priority out."""
        if claim not in self._claims:
            self._claims.append(claim)

    def of_another_priority(self, claim: Claim) -> Claim | None:
        """Return a claim of a task of another priority."""
        return next((held for held in self._claims if held.priority != claim.priority), None)

    def give_back(self, claim: Claim) -> None:
        """End a claim; one that is not held is nothing."""
        if claim in self._claims:
            self._claims.remove(claim)

    def is_anybodys_but(self, claim: Claim | None) -> bool:
        """Return whether an instance that is still there works here, other than this one.

        To one that is refused itself, those who are refused too do not count: else each would wait for the
        other.
        """
        only_at_work = self.holds_refused(claim)
        return any(
            held is not claim and not held.is_orphan and not (only_at_work and held.is_refused)
            for held in self._claims
        )

    def holds_refused(self, claim: Claim | None) -> bool:
        """Return whether this claim is held by somebody who can do nothing with it."""
        return claim is not None and claim.is_refused and claim in self._claims

    def has_frame(self) -> bool:
        """Return whether somebody who works here has a whole frame that has not shown yet."""
        return any(held.has_frame for held in self._claims)

    def is_barred(self, claim: Claim, waits: bool) -> bool:
        """Return whether one that is gone keeps this one out; `waits` False: or one that is refused."""
        return any(
            held.priority == claim.priority
            and held is not claim
            and (held.is_orphan or (not waits and held.is_refused))
            for held in self._claims
        )

    def holds(self, claim: Claim | None) -> bool:
        """Return whether this claim is held."""
        return claim in self._claims

    def owners(self) -> tuple[str, ...]:
        """Return the instances that hold it, orphans with their old names."""
        return tuple(held.instance + " (gone)" * held.is_orphan for held in self._claims)

    def end(self) -> None:
        """End every claim: the connection is gone."""
        self._claims.clear()
