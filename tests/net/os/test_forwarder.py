"""The tap's loop, turned by hand: who looks on, what is held, what does not answer, serial ports."""

from __future__ import annotations

import os
import select
import socket
import tty
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from trcvtui.net.os import tap_ends, tap_lane
from trcvtui.net.os.forwarder import Forwarder
from trcvtui.net.os.system_calls import RESET_ON_CLOSE, PollList
from trcvtui.net.tap import (
    WAY_BACK,
    WAY_TO,
    TapEvent,
    TapEventKind,
    TapOrder,
    make_route,
    parse_place,
    read_events,
)

pytestmark = pytest.mark.live
TURNS = 2000


def told_in(whole: bytes) -> list[TapEvent]:
    """Return the events but for signs of life and figures."""
    parts = iter([whole, b""])
    found = [event for some in read_events(lambda _: next(parts)) for event in some]
    return [event for event in found if event.kind not in (TapEventKind.NOW, TapEventKind.FIGURES)]


class Stand:
    """A loop with one TCP tap, a door of the far end, one the process that serves observers."""

    def __init__(self, poll: object = None) -> None:
        self.door = socket.create_server(("127.0.0.1", 0))
        self.door.setblocking(False)
        self.begin("", self.door, poll)

    def begin(self, scheme: str, far: socket.socket, poll: object = None) -> None:
        """Make the loop with a tap in front of a far end, and what it tells events."""
        self.said: list[str] = []
        self.loop = Forwarder(self.said.append, poll)
        to = f"{scheme}127.0.0.1:{far.getsockname()[1]}"
        self.loop.open_route(make_route("T", f"{scheme}127.0.0.1:0", to, ("LISTEN", "CONNECT")))
        ours, self.looks = socket.socketpair()
        self.looks.setblocking(False)
        self.loop.attach_server(ours, lambda: self.said.append("ended"))
        self._sockets = [far, self.looks]

    def until(self, is_done: Callable[[], object]) -> None:
        """Let the loop turn until something is so."""
        for _ in range(TURNS):
            if is_done():
                return
            self.loop.run_once(0.01)
        raise AssertionError("never")

    def talk(self) -> tuple[socket.socket, socket.socket]:
        address = self.loop.routes[0].address
        assert address is not None
        near = socket.socket()
        near.setblocking(False)
        near.connect_ex(address)
        far: list[socket.socket] = []

        def comes() -> bool:
            with suppress(BlockingIOError):
                far.append(self.door.accept()[0])
            return bool(far)

        self.until(comes)
        self.until(lambda: any(talk.lanes for talk in self.loop.routes[0].talks.values()))
        far[0].setblocking(False)
        self._sockets += [near, far[0]]
        return near, far[0]

    def read(self, sock: socket.socket, size: int) -> bytes:
        got = bytearray()

        def is_whole() -> bool:
            with suppress(BlockingIOError):
                while len(got) < size and (part := sock.recv(size - len(got))):
                    got.extend(part)
            return len(got) >= size

        self.until(is_whole)
        return bytes(got)

    def is_quiet(self, sock: socket.socket) -> bool:
        """Return whether nothing comes to an end while the loop has work."""
        for _ in range(5):
            self.loop.run_once(0.005)
        return not select.select((sock,), (), (), 0)[0]

    def order(self, way: int, verb: str, *sizes: int, data: bytes = b"", number: int = 0) -> TapEvent:
        """Give an order; return what was told of it."""
        self.looks.sendall(TapOrder(0, number, way, verb, sizes, data).encode())
        answers: list[TapEvent] = []

        def is_told() -> bool:
            kinds = TapEventKind.INTERVENTION, TapEventKind.REFUSED
            answers.extend(event for event in self.events() if event.kind in kinds)
            return bool(answers)

        self.until(is_told)
        return answers[0]

    def events(self) -> list[TapEvent]:
        whole = bytearray()
        with suppress(BlockingIOError):
            while part := self.looks.recv(1 << 20):
                whole += part
        return told_in(bytes(whole))

    def close(self) -> None:
        with suppress(Exception):
            self.loop.close()
        for sock in self._sockets:
            sock.close()


@pytest.fixture(params=[None, PollList])
def stand(request: pytest.FixtureRequest) -> Iterator[Stand]:
    made = Stand(request.param and request.param())
    yield made
    made.close()


def test_what_passes_is_told_with_its_direction_and_its_place_in_the_stream(stand: Stand) -> None:
    near, far = stand.talk()
    for part in (b"one", b"three"):
        near.send(part)
        assert stand.read(far, len(part)) == part
    far.send(b"back")
    assert stand.read(near, 4) == b"back"
    near.close()
    stand.until(lambda: select.select((far,), (), (), 0)[0])
    told = [(event.kind, event.way, event.at, event.data) for event in stand.events()]
    assert told[1:] == [
        (TapEventKind.ANSWERED, WAY_BACK, 0, b""),
        (TapEventKind.BYTES, WAY_TO, 0, b"one"),
        (TapEventKind.BYTES, WAY_TO, 3, b"three"),
        (TapEventKind.BYTES, WAY_BACK, 0, b"back"),
        (TapEventKind.FIN, WAY_TO, 8, b""),
    ]
    assert told[0][3].split(b"|")[:2] == [b"tcp", b"127.0.0.1"]


@pytest.mark.parametrize(("waits_ns", "gets_all"), [(60_000_000_000, True), (30_000_000, False)])
def test_before_a_reset_what_was_read_is_delivered_for_a_time(
    stand: Stand, monkeypatch: pytest.MonkeyPatch, waits_ns: int, gets_all: bool
) -> None:
    monkeypatch.setattr(tap_lane, "RESET_WAIT_NS", waits_ns)
    stand.door.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
    near, far = stand.talk()
    lane, sent = stand.loop.routes[0].talks[1].lanes[WAY_TO], 0
    while select.select((), (near,), (), 0)[1]:  # until the far end, the stacks and the tap are full
        with suppress(BlockingIOError):
            sent += near.send(bytes(1 << 16))
        stand.loop.run_once(0)
    near.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
    near.close()
    stand.until(lambda: lane.end is TapEventKind.RST)
    if not gets_all:
        stand.until(lambda: not stand.loop.routes[0].talks)
    size, is_reset = 0, False
    for _ in range(TURNS * 10):
        for _ in range(5):  # the tap is quicker than who reads
            stand.loop.run_once(0)
        try:
            size += len(far.recv(1 << 16))
        except BlockingIOError:
            stand.loop.run_once(0.01)
        except ConnectionResetError:
            is_reset = True
            break
    assert (is_reset, size == lane.at) == (True, gets_all)
    assert 0 < size <= lane.at <= sent


def test_a_held_frame_is_edited_and_let_go(stand: Stand) -> None:
    near, far = stand.talk()
    stand.order(WAY_TO, "hold")
    near.send(bytes(range(10)))
    stand.until(lambda: stand.loop.routes[0].talks[1].lanes[WAY_TO].held)
    stand.order(WAY_TO, "edit", 2, data=b"\xaa\xbb")
    stand.order(WAY_TO, "drop", 1)
    stand.order(WAY_TO, "insert", data=b"\xff")
    assert stand.is_quiet(far)
    assert stand.order(WAY_TO, "go").kind is not TapEventKind.REFUSED
    assert stand.read(far, 10) == b"\xff\x01\xaa\xbb" + bytes(range(4, 10))
    far.send(b"the other way was never held")
    assert stand.read(near, 28)


def test_a_held_direction_holds_its_end_and_no_more_than_it_may(stand: Stand) -> None:
    near, far = stand.talk()
    stand.order(WAY_TO, "hold")
    lane = stand.loop.routes[0].talks[1].lanes[WAY_TO]
    sent = 0
    while lane.room():
        with suppress(BlockingIOError):
            sent += near.send(bytes(1 << 16))
        stand.loop.run_once(0)
    while select.select((), (near,), (), 0)[1]:  # what the stacks take
        with suppress(BlockingIOError):
            sent += near.send(bytes(1 << 16))
        stand.loop.run_once(0)
    assert len(lane.held or b"") == 1 << 20
    near.close()
    assert stand.is_quiet(far)
    stand.order(WAY_TO, "go")
    assert len(stand.read(far, sent)) == sent
    stand.until(lambda: select.select((far,), (), (), 0)[0])
    assert far.recv(1) == b""


def test_bytes_are_delayed_in_order_and_split_where_asked(stand: Stand) -> None:
    near, far = stand.talk()
    stand.order(WAY_TO, "delay", 30_000_000)
    near.send(b"late")
    assert not select.select((far,), (), (), 0)[0]
    assert stand.read(far, 4) == b"late"
    stand.order(WAY_TO, "delay", 0)
    stand.order(WAY_TO, "split", 3, 2)
    stand.events()
    near.send(b"aaabbcccc")
    assert stand.read(far, 9) == b"aaabbcccc"
    pieces = [event.data for event in stand.events() if event.kind == TapEventKind.BYTES]
    assert pieces == [b"aaa", b"bb", b"cccc"]
    near.send(b"whole")
    assert stand.read(far, 5) == b"whole"


@pytest.mark.parametrize(("verb", "ends"), [("fin", (False, True)), ("rst", (True, True))])
def test_our_own_end_passes_and_is_marked_as_ours(stand: Stand, verb: str, ends: tuple[bool, bool]) -> None:
    near, far = stand.talk()
    near.send(b"before")
    assert stand.read(far, 6) == b"before"
    answer = stand.order(WAY_TO, verb)
    assert (answer.kind, answer.data, answer.at) == (TapEventKind.INTERVENTION, verb.encode(), 6)
    stand.until(lambda: select.select((far,), (), (), 0)[0])
    if verb == "rst":
        with pytest.raises(ConnectionResetError):
            far.recv(1)
    else:
        assert far.recv(1) == b""
        near.send(b"nobody gets this")
        far.send(b"still heard")
        assert stand.read(near, 11) == b"still heard"


@pytest.mark.parametrize(
    ("verb", "sizes", "said"),
    [
        ("drop", (9,), "only 4 of 9 bytes held"),
        ("edit", (3,), "byte 3 is the last held: there is no byte 4"),
        ("insert", (), "the tap holds at most 1 MiB of each direction"),
    ],
)
def test_an_order_that_cannot_be_done_says_why(
    stand: Stand, monkeypatch: pytest.MonkeyPatch, verb: str, sizes: tuple[int, ...], said: str
) -> None:
    monkeypatch.setattr(tap_lane, "MOST_HELD_BYTES", 5)
    near, _ = stand.talk()
    stand.order(WAY_TO, "hold")
    near.send(b"four")
    stand.until(lambda: stand.loop.routes[0].talks[1].lanes[WAY_TO].held)
    answer = stand.order(WAY_TO, verb, *sizes, data=b"xy")
    assert (answer.kind, answer.data.decode()) == (TapEventKind.REFUSED, said)


def test_an_order_without_a_conversation_says_so(stand: Stand) -> None:
    assert stand.order(WAY_TO, "hold").data == b"a conversation is not there"
    assert stand.order(WAY_TO, "hold", number=7).data == b"conversation 7 is not there"


def test_all_is_let_go_when_who_gives_the_orders_is_gone(stand: Stand) -> None:
    near, far = stand.talk()
    stand.order(WAY_TO, "hold")
    near.send(b"held")
    assert stand.is_quiet(far)
    stand.looks.close()
    assert stand.read(far, 4) == b"held"
    assert stand.said == ["ended"]


def test_a_reader_that_is_slow_delays_nothing_and_is_told_what_it_missed_and_what_ended(
    stand: Stand,
) -> None:
    assert stand.loop.pipe is not None
    stand.loop.pipe.most = 1 << 20
    near, far = stand.talk()
    ending = stand.talk()
    size = 0
    for _ in range(400):
        with suppress(BlockingIOError):
            size += near.send(bytes(1 << 16))
        stand.loop.run_once(0)
        with suppress(BlockingIOError):
            while part := far.recv(1 << 20):
                size -= len(part)
    stand.read(far, size)
    for end in (*ending, *stand.talk()):
        end.close()
    stand.until(lambda: [*stand.loop.routes[0].talks] == [1])
    told: list[TapEvent] = []
    whole = bytearray()

    def is_told() -> bool:
        with suppress(BlockingIOError):
            while part := stand.looks.recv(1 << 20):
                whole.extend(part)
        told[:] = told_in(bytes(whole))
        return told[-1].kind == TapEventKind.OPEN and told[-1].at == 1

    stand.until(is_told)
    got = sum(len(event.data) for event in told if event.kind == TapEventKind.BYTES)
    [lost] = [n for n, event in enumerate(told) if event.kind == TapEventKind.LOST]
    ends = [(event.kind, event.number) for event in told[lost + 1 : -1]]
    assert ends == [(kind, 2) for kind in (TapEventKind.FIN, TapEventKind.FIN, TapEventKind.ENDED)]
    lost_bytes = int.from_bytes(told[lost].data[8:16], "little")
    assert (lost_bytes > 0, got + lost_bytes) == (True, stand.loop.routes[0].talks[1].lanes[WAY_TO].at)
    assert (told[-1].number, told[-1].at) == (1, 1)


def test_a_far_end_that_does_not_answer_in_time_shows_as_a_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tap_ends, "CONNECT_LIMIT_NS", 50_000_000)
    full = socket.socket()
    full.bind(("127.0.0.1", 0))
    full.listen(0)
    callers = [socket.socket() for _ in range(4)]
    for caller in callers:  # the door is full: nobody is answered any more
        caller.setblocking(False)
        caller.connect_ex(full.getsockname())
    loop = Forwarder(str)
    loop.open_route(make_route("T", "127.0.0.1:0", f"127.0.0.1:{full.getsockname()[1]}", ("", "")))
    address = loop.routes[0].address
    with socket.create_connection(address or ("", 0)) as near:
        near.setblocking(False)
        for _ in range(TURNS):
            loop.run_once(0.01)
            if select.select((near,), (), (), 0)[0]:
                break
        with pytest.raises(ConnectionResetError):
            near.recv(1)
    loop.close()
    for sock in (full, *callers):
        sock.close()


def test_two_serial_ports_are_joined_and_one_that_is_gone_is_opened_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: object
) -> None:
    monkeypatch.setattr(tap_ends, "REOPEN_PAUSE_NS", 1_000_000)
    pairs = [os.openpty() for _ in range(2)]
    for master, slave in pairs:
        tty.setraw(slave)
        os.set_blocking(master, False)
    said: list[str] = []
    loop = Forwarder(said.append)
    names = [f"serial:{os.ttyname(slave)},19200,8E1" for _, slave in pairs]
    loop.open_route(make_route("T", names[0], names[1], ("LISTEN", "CONNECT")))
    for _, slave in pairs:
        os.close(slave)

    def until(is_done: Callable[[], object]) -> None:
        for _ in range(TURNS):
            if is_done():
                return
            loop.run_once(0.01)
        raise AssertionError("never")

    def comes(master: int) -> Callable[[], bool]:
        got = bytearray()

        def is_whole() -> bool:
            with suppress(BlockingIOError):
                got.extend(os.read(master, 100))
            return bytes(got) == b"\x00\x11\x13\xff over"

        return is_whole

    for one, other in (pairs, pairs[::-1]):
        os.write(one[0], b"\x00\x11\x13\xff over")
        until(comes(other[0]))
    os.close(pairs[0][0])
    until(lambda: said)
    assert said == [f"T: {parse_place(names[0], '')} is gone (EIO): it is opened again"]
    loop.close()
    os.close(pairs[1][0])


class Datagrams(Stand):
    """A loop with one UDP tap, a client and a far end that know each other."""

    def __init__(self) -> None:
        self.near, self.far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for sock in (self.near, self.far):
            sock.bind(("127.0.0.1", 0))
            sock.setblocking(False)
        self.begin("udp:", self.far)
        self._sockets.append(self.near)
        self.near.connect(self.loop.routes[0].address or ("", 0))
        self.near.send(b"first")
        self.until(lambda: select.select((self.far,), (), (), 0)[0])
        self.far.connect(self.far.recvfrom(99)[1])

    def come(self, count: int) -> list[bytes]:
        got: list[bytes] = []

        def are_there() -> bool:
            with suppress(BlockingIOError):
                while len(got) < count:
                    got.append(self.far.recv(99))
            return len(got) == count

        self.until(are_there)
        return got


@pytest.fixture
def datagrams() -> Iterator[Datagrams]:
    made = Datagrams()
    yield made
    made.close()


def test_held_datagrams_are_changed_and_go_on_one_by_one(datagrams: Datagrams) -> None:
    datagrams.order(WAY_TO, "hold")
    lane = datagrams.loop.routes[0].talks[1].lanes[WAY_TO]
    for each in (b"01234", b"", b"abc", b"xyz"):
        datagrams.near.send(each)
    datagrams.until(lambda: len(lane.held or b"") == 11)
    assert datagrams.is_quiet(datagrams.far)
    datagrams.order(WAY_TO, "edit", 4, data=b"!B")  # across two datagrams
    datagrams.order(WAY_TO, "drop", 2)
    datagrams.order(WAY_TO, "insert", data=b"ours")
    datagrams.order(WAY_TO, "go")
    assert datagrams.come(5) == [b"ours", b"23!", b"", b"Bbc", b"xyz"]
    datagrams.far.send(b"back")
    datagrams.until(lambda: select.select((datagrams.near,), (), (), 0)[0])
    assert datagrams.near.recv(9) == b"back"


def test_datagrams_are_delayed_split_and_dropped_whole(datagrams: Datagrams) -> None:
    datagrams.order(WAY_TO, "split", 2)
    datagrams.near.send(b"abcde")
    assert datagrams.come(2) == [b"ab", b"cde"]
    datagrams.order(WAY_TO, "delay", 20_000_000)
    for each in (b"1", b"", b"2"):
        datagrams.near.send(each)
    assert datagrams.come(3) == [b"1", b"", b"2"]
    datagrams.order(WAY_TO, "delay", 0)
    datagrams.order(WAY_TO, "hold")
    datagrams.near.send(b"gone")
    lane = datagrams.loop.routes[0].talks[1].lanes[WAY_TO]
    datagrams.until(lambda: lane.held)
    datagrams.order(WAY_TO, "drop", 4)
    datagrams.order(WAY_TO, "go")
    datagrams.near.send(b"next")
    assert datagrams.come(1) == [b"next"]
    assert b"FIN or RST" in datagrams.order(WAY_TO, "rst").data


def test_held_datagrams_beyond_the_bound_are_lost_and_told(datagrams: Datagrams) -> None:
    datagrams.order(WAY_TO, "hold")
    lane = datagrams.loop.routes[0].talks[1].lanes[WAY_TO]
    told: list[TapEvent] = []
    while not told:
        with suppress(BlockingIOError):
            datagrams.near.send(bytes(60_000))
        datagrams.loop.run_once(0.01)
        told = [each for each in datagrams.events() if each.kind == TapEventKind.INTERVENTION]
    assert told[0].data.startswith(b"drop 60000 bytes: the tap holds at most 1 MiB")
    assert len(lane.held or b"") <= 1 << 20


def test_what_is_held_when_a_tap_of_datagrams_ends_goes_on_before(datagrams: Datagrams) -> None:
    datagrams.order(WAY_TO, "hold")
    lane = datagrams.loop.routes[0].talks[1].lanes[WAY_TO]
    datagrams.near.send(b"last")
    datagrams.until(lambda: lane.held)
    datagrams.loop.close()
    assert datagrams.far.recv(9) == b"last"


def test_a_loop_that_is_ended_by_its_timer_waits_for_nothing_more() -> None:
    """A timer that is due when a turn begins: poll(-1) after it would wait for ever."""

    waited: list[float] = []

    class Poll(PollList):
        def poll(self, timeout: float, maxevents: int = -1) -> list[tuple[int, int]]:
            waited.append(timeout)
            return []

    loop = Forwarder(lambda _: None, Poll())
    loop.call_after(0, loop.stop)
    loop.run_once(-1)
    assert waited == [0]
