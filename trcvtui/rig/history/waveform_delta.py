"""What the engine tells the screen of an instance's pins: every change, and what they were before it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from trcvtui.blocks.parameters import BUFFER_PIN, SHOWS, outputs_of
from trcvtui.plc.ledger import InputEdge, StatusEdge

LAMPS: Final = ("STATUS", "BUSY", "DONE", "ERROR")
# The outputs of the blocks on a ComBuffer, each with what it shows of an edge.
OUTPUTS: Final = {
    block: tuple((pin.name, SHOWS[pin.name]) for pin in outputs_of(block)) for block in BUFFER_PIN
}

PinValues = tuple[tuple[str, int | None], ...]
NO_PINS: Final[PinValues] = ()


@dataclass(frozen=True, slots=True)
class PinsAre:
    """What these pins are from now on, without an edge of their own; None: nobody can say."""

    values: PinValues


class Change(NamedTuple):
    """What changed in one scan; `seq` is the ledger's, of several in one scan the later one stands."""

    seq: int
    scan: int
    t_ns: int
    event: StatusEdge | InputEdge | PinsAre


@dataclass(frozen=True, slots=True)
class WaveNews:
    """The changes of one instance from its change number `first` on (1: its very first), in order.

    `before` is what every pin was up to then, since `before_scan`; nothing else changed up to `until_scan`.
    """

    instance: str
    first: int
    before_scan: int
    before_ns: int
    before: PinValues
    changes: tuple[Change, ...]
    until_scan: int
    until_ns: int


def up_to(news: WaveNews, scan: int, t_ns: int) -> WaveNews | None:
    """Return the news as they were behind a scan of the past; None: what is left begins later."""
    if news.before and news.before_scan > scan:
        return None
    changes = tuple(change for change in news.changes if change.scan <= scan)
    if len(changes) == len(news.changes) and news.until_scan <= scan:
        return news
    return replace(news, changes=changes, until_scan=scan, until_ns=t_ns)


def pins_of(event: StatusEdge | InputEdge | PinsAre) -> PinValues:
    """Return the pins that an event tells, BOOLs as 0 and 1."""
    if isinstance(event, InputEdge):
        return ((event.pin, int(event.value)),)
    if isinstance(event, PinsAre):
        return event.values
    if event.block in OUTPUTS:
        shown = ((pin, getattr(event, field)) for pin, field in OUTPUTS[event.block])
        return tuple((pin, int(value)) for pin, value in shown if value is not None)
    lamps = event.busy, event.done, event.error
    told = (("STATUS", event.status), *zip(LAMPS[1:], map(int, lamps), strict=True))
    return told if event.rcvd_len is None else (*told, ("RCVD_LEN", event.rcvd_len))
