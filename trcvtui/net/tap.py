"""What describes a tap: its two places, its events, and the orders that observers give."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import Final, NamedTuple

from trcvtui.errors import mistake
from trcvtui.net.results import parse_end
from trcvtui.net.serial_line import SerialSettings

LOCALHOST: Final = "127.0.0.1"
WAY_TO, WAY_BACK = 0, 1  # ways: from the end at LISTEN to the end at CONNECT, and back
MOST_EVENT_BYTES: Final = 1 << 20  # bytes of one event
NEWEST: Final = 0  # in an order, in place of a conversation's number
PLACE_SYNTAX: Final = "[ADDR:]PORT, udp:[ADDR:]PORT or serial:DEVICE[,9600,8N1]"
_PARITIES: Final = {"N": "none", "E": "even", "O": "odd", "M": "mark", "S": "space"}


class TapPlace(NamedTuple):
    """A place where a tap listens or connects. `kind` is tcp, udp or serial. Only serial has a `line`."""

    kind: str
    address: str
    port: int
    line: SerialSettings | None = None

    def __str__(self) -> str:
        """Return the place as the user writes it, without the settings of a serial port."""
        if self.line is not None:
            return f"serial:{self.line.port}"
        return ("udp:" if self.kind == "udp" else "") + format_end(self.address, self.port)


class Route(NamedTuple):
    """One tap: its name and its two places."""

    name: str
    listen: TapPlace
    to: TapPlace


def format_end(address: str, port: int) -> str:
    """Return `10.0.0.5:2000` or `[fd00::1]:2000`."""
    return f"[{address}]:{port}" if ":" in address else f"{address}:{port}"


def parse_place(text: str, where: str) -> TapPlace:
    """Return the place that a text names. A UserError says that the text came from `where`."""
    kind, colon, rest = text.partition(":")
    if kind == "serial" and colon:
        return TapPlace("serial", "", 0, _parse_serial_line(rest, where, text))
    rest = rest if kind == "udp" and colon else text
    if rest.isascii() and rest.isdigit() and int(rest) < 65536:
        return TapPlace("udp" if rest != text else "tcp", LOCALHOST, int(rest))
    from ipaddress import ip_address

    free = rest.endswith(":0")  # any free port; `parse_end` refuses port 0
    found = parse_end(rest[:-1] + "1" if free else rest)
    if found is None or found[1] is None:
        raise mistake(where, f"'{text}'", PLACE_SYNTAX)
    return TapPlace("udp" if rest != text else "tcp", str(ip_address(found[0])), 0 if free else found[1])


def _parse_serial_line(rest: str, where: str, text: str) -> SerialSettings:
    device, *settings = rest.split(",")
    baud, frame = (*settings, *("9600", "8N1")[len(settings) :])[:2]
    known = baud.isascii() and baud.isdigit() and int(baud) > 0 and len(frame) >= 3
    if not device or len(settings) > 2 or not known or frame[0] not in "5678" or frame[1] not in _PARITIES:
        raise mistake(where, f"'{text}'", PLACE_SYNTAX)
    if frame[2:] not in ("1", "1.5", "2"):
        raise mistake(where, f"'{text}'", PLACE_SYNTAX)
    return SerialSettings(device, int(baud), int(frame[0]), _PARITIES[frame[1]], float(frame[2:]))


def make_route(name: str, listen: str, to: str, where: tuple[str, str]) -> Route:
    """Return a tap; raise UserError if its places are the same, or are of different kinds."""
    route = Route(name, parse_place(listen, where[0]), parse_place(to, where[1]))
    if route.listen.kind != route.to.kind:
        raise mistake(where[1], f"'{to}' after '{listen}'", "two places of one kind")
    if str(route.listen) == str(route.to) or (route.to.line is None and not route.to.port):
        raise mistake(where[1], f"'{to}'", "a place other than LISTEN")
    return route


# -- events ----------------------------------------------------------------------------------------------


class TapEventKind(IntEnum):
    """Kinds of events. The comments say what `at` and `data` mean for each kind."""

    OPEN = 1  # an end has come: `kind|near address|port|far address|port`; `at` 1: it came earlier
    ANSWERED = 2  # the far end has answered
    BYTES = 3  # forwarded to the other end; `at`: how many were forwarded before
    FIN = 4
    RST = 5
    ENDED = 6  # nothing more comes of it
    INTERVENTION = 7  # an intervention, in words
    REFUSED = 8  # an order that cannot be done: why
    NOW = 11  # the time, 20 times a second: it is the clock of shadows, and a sign of life
    HELD = 12  # a direction holds `at` bytes; the data: the first of them; no data: it holds nothing now
    FIGURES = 13  # what the stack says of the end that a direction goes to: see FIGURES_DATA
    LACK = 14  # of a tap, not of a conversation: `at` clients wait for a descriptor, in words
    LOST = 9  # how many events and bytes the reader missed; the numbers of the open conversations


END_KINDS: Final = (TapEventKind.FIN, TapEventKind.RST, TapEventKind.ENDED)


class TapEvent(NamedTuple):
    """One event. `route` is the tap's number, from 0. `number` is the conversation's number, from 1."""

    kind: int
    way: int
    route: int
    number: int
    at: int
    ns: int
    data: bytes


MOST_HELD_SHOWN: Final = 256  # of the held bytes so many are in the event, after a mark of one byte
EVENT_HEAD: Final = struct.Struct("<BBHIQQI")  # and `size` bytes
LOSS: Final = struct.Struct("<QQ")
FIGURES_DATA: Final = struct.Struct("<IIQ")  # round trip in us, window, bytes retransmitted by the tap


def read_events(read: Callable[[int], bytes]) -> Iterator[list[TapEvent]]:
    """Yield the events that are complete after each `read`. Stop when `read` returns b""."""
    waiting = b""
    head, unpack = EVENT_HEAD.size, EVENT_HEAD.unpack_from
    while got := read(MOST_EVENT_BYTES):
        waiting = waiting + got if waiting else got
        at, end, found = 0, len(waiting), []
        while end - at >= head:
            kind, way, route, number, offset, ns, size = unpack(waiting, at)
            if end - at - head < size:  # the rest of the event comes with the next read
                break
            at += head + size
            found.append(TapEvent(kind, way, route, number, offset, ns, waiting[at - size : at]))
        waiting = waiting[at:]
        yield found


# -- orders ----------------------------------------------------------------------------------------------


class TapOrder(NamedTuple):
    """An order to change one direction: hold, go, drop, insert, edit, delay, split, rst, fin.

    `sizes` has the bytes to drop, the offset to edit, the ns to delay, or the sizes of split pieces.
    """

    route: int
    number: int
    way: int
    verb: str
    sizes: tuple[int, ...] = ()
    data: bytes = b""

    def encode(self) -> bytes:
        sizes = ",".join(map(str, self.sizes))
        return f"{self.route} {self.number} {self.way} {self.verb} {sizes};{self.data.hex()}\n".encode()


RELEASE_LINE: Final = b"release"  # in place of an order: stop holding and delaying in all directions
USER_LINE: Final = b"! "  # begins a line that the process that serves observers has for the user
MOST_NUMBER: Final = (1 << 32) - 1
MOST_SIZE: Final = 3_600_000_000_000  # the ns of an hour
# How many sizes each verb takes, -1: one or more.
VERB_SIZES: Final = {
    "hold": 0, "go": 0, "drop": 1, "insert": 0, "edit": 1, "delay": 1, "split": -1, "rst": 0, "fin": 0
}  # fmt: skip


def parse_order(line: bytes, routes: int) -> TapOrder:
    """Return the order in a line. Raise ValueError if the line has no order. There are `routes` taps."""
    route, number, way, verb, rest = line.decode("ascii").split(" ")
    sizes, _, data = rest.partition(";")
    numbers = tuple([int(size) for size in sizes.split(",") if size])
    made = TapOrder(int(route), int(number), int(way), verb, numbers, bytes.fromhex(data))
    wanted = VERB_SIZES.get(verb)
    fits = len(numbers) == wanted or (wanted == -1 and numbers)
    is_placed = (  # observers are other programs: an order is checked, never trusted
        made.way in (WAY_TO, WAY_BACK) and 0 <= made.route < routes and 0 <= made.number <= MOST_NUMBER
    )
    if not (fits and is_placed and all(0 <= each <= MOST_SIZE for each in numbers)):
        raise ValueError(f"'{line[:80].decode()}'")
    return made
