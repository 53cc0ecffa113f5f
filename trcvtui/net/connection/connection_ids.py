"""Who has which connection ID: one connection an ID, as long as its endpoint is there (siemens.md 4.4).

A connection without a description has no ID, and meets nobody here.
"""

from __future__ import annotations

from enum import StrEnum

from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.description_check import meaning


class Taken(StrEnum):
    """How the connection that has the ID stands to the one that asks for it."""

    BUILDING = "being built"  # the same description, not established yet
    SAME = "same description"
    OTHER = "other description"


class Holder:
    """One CONNECT's hold on its ID; `has_been_up` since it took it."""

    def __init__(self, config: ConnectConfig) -> None:
        self.name = config.name
        self.description = config.description
        self.identity = meaning(config.description).identity if config.description is not None else 0
        self.has_been_up = False


class Identities:
    """The IDs of one PLC."""

    def __init__(self) -> None:
        self._holders: dict[int, Holder] = {}

    def take(self, asking: Holder) -> tuple[Taken, str] | None:
        """Take the ID, or return how it is taken and by which CONNECT."""
        if asking.description is None:
            return None
        held = self._holders.setdefault(asking.identity, asking)
        if held is asking:
            return None
        if held.description != asking.description:
            return Taken.OTHER, held.name
        return (Taken.SAME if held.has_been_up else Taken.BUILDING), held.name

    def give_back(self, holder: Holder) -> None:
        """Free the ID; a holder that has none is nothing."""
        holder.has_been_up = False
        if self._holders.get(holder.identity) is holder:
            del self._holders[holder.identity]
