"""The list of facts, and how a check gets into it."""

from __future__ import annotations

from collections.abc import Callable

from tests.net.net_bench import Bench

Fact = Callable[[Bench], None]
FACTS: list[Fact] = []
NEEDS_RDHUP: list[Fact] = []  # facts of a system that can show a FIN after unread data
OF_THE_WIRE: list[Fact] = []  # facts that take real time and in which the poll set has no part


def fact(check: Fact) -> Fact:
    FACTS.append(check)
    return check


def needs_rdhup(check: Fact) -> Fact:
    """Mark a fact that select alone cannot show."""
    NEEDS_RDHUP.append(check)
    return check


def on_the_wire(check: Fact) -> Fact:
    """Put a check into the list that one kind of poll set is enough for."""
    OF_THE_WIRE.append(check)
    return fact(check)
