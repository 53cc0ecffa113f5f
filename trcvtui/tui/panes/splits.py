"""Where a message is cut and how long each cut pauses: to and from `split` and `gap` of a send command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Final

from trcvtui.tui.formatting import MS
from trcvtui.udt.literals import format_time

if TYPE_CHECKING:  # the screen composes lines, it seldom reads one
    from trcvtui.rig.commands.words import PeerSend

PAUSES: Final = (0, 1, 2, 5, 10, 20, 30, 50, 100, 200, 500, 1000, 2000, 5000)  # ms
FIRST_PAUSE: Final = 20 * MS


@dataclass(frozen=True, slots=True)
class Cuts:
    """The places of the cuts, each with its pause in ns: a cut at 3 stands before the byte of offset 3."""

    pauses: Mapping[int, int] = field(default_factory=dict)

    @property
    def places(self) -> tuple[int, ...]:
        """Return the places in order."""
        return tuple(sorted(self.pauses))

    def toggled(self, place: int) -> Cuts:
        """Return these with a cut more or less; a new one pauses as the one before it, or behind it."""
        if place in self.pauses:
            return Cuts({at: ns for at, ns in self.pauses.items() if at != place})
        near = [at for at in self.places if at < place][-1:] or list(self.places[:1])
        return Cuts({**self.pauses, place: self.pauses[near[0]] if near else FIRST_PAUSE})

    def paused(self, place: int, step: int) -> Cuts:
        """Return these with the next longer or shorter pause at a cut."""
        now = self.pauses[place]
        longer = [ms * MS for ms in PAUSES if ms * MS > now]
        shorter = [ms * MS for ms in PAUSES if ms * MS < now]
        then = longer[:1] if step > 0 else shorter[-1:]
        return Cuts({**self.pauses, place: then[0] if then else now})

    def pause_text(self, place: int) -> str:
        """Return the pause of a cut as commands write it."""
        return format_time(self.pauses[place])

    @property
    def split(self) -> str:
        """Return what stands behind `split=`."""
        return ",".join(str(b - a) for a, b in pairwise((0, *self.places)))

    @property
    def gap(self) -> str:
        """Return what stands behind `gap=`, "" where nothing pauses."""
        pauses = [self.pauses[at] for at in self.places]
        if not any(pauses):
            return ""
        return ",".join(map(format_time, pauses[:1] if len(set(pauses)) == 1 else pauses))


def cuts_of(send: PeerSend) -> Cuts:
    """Return the cuts of a send command; one behind the message cuts nothing."""
    gaps = send.gaps_ns or (send.gap_ns,)
    places = [at for at in accumulate(send.split) if at < len(send.payload)]
    return Cuts({at: gaps[min(n, len(gaps) - 1)] for n, at in enumerate(places)})
