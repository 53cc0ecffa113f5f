"""Captures with one known fault each, and healthy ones: sizes, rates and habits at random, from a seed."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.recording.wire import ACK, FIN, PSH, RST, SYN, tcp, udp
from trcvtui.capture.pcap import RAW_IP, interface_block, packet_block, section_block
from trcvtui.diagnosis.doctor import DoctorQuestion, as_json, judge_capture
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.udt.layout.layout import LAYOUTS, lay_out
from trcvtui.udt.layout.rules import LayoutChoice
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.type_set import join_declarations
from trcvtui.wording import json_text

MSS = 1460
MS = 1_000_000
S = 1_000_000_000


@dataclass
class Built:
    """A capture: its packets by time, what the doctor is told beside it, what it should say."""

    cause: str
    packets: list[tuple[int, bytes]] = field(default_factory=list)
    receiver: Receiver | None = None
    what: str = ""
    first_packet: int = 0
    host: int = 5  # of the PLC end
    plc: str | None = None  # as --plc names it

    def file(self, cut: int = 0) -> bytes:
        found = sorted(self.packets, key=lambda one: one[0])[self.first_packet :]
        blocks = [packet_block(0, ns, data[:cut] if cut else data, (), len(data)) for ns, data in found]
        return b"".join((section_block("tests"), interface_block(RAW_IP, "t"), *blocks))


class Wire:
    """One TCP connection, said packet by packet."""

    def __init__(self, r: random.Random, built: Built, at: int, caller_port: int = 0, **ends: object) -> None:
        self.r, self.built, self.now = r, built, at
        port = ends.get("port", 2000)
        self.plc = (f"10.0.0.{built.host}", port if isinstance(port, int) else 2000)
        self.partner = (f"10.0.0.{built.host + 4}", caller_port or r.randrange(20000, 60000))
        self.plc_calls = bool(ends.get("plc_calls"))
        self.seq = {"plc": r.randrange(1 << 32), "partner": r.randrange(1 << 32)}
        self.window = {
            "plc": r.choice((8192, 4096, 29200, 64240, 501)),
            "partner": r.choice((8192, 64240, 1024)),
        }
        self.rtt = r.randrange(50_000, 2 * MS)
        self.delayed = r.choice((0, 0, 40 * MS, 200 * MS))  # how long the PLC end waits with an ACK

    def put(
        self, who: str, data: bytes = b"", flags: int = ACK, seq: int | None = None, at: int | None = None,
        window: int | None = None,
    ) -> None:  # fmt: skip
        ends = (self.plc, self.partner) if who == "plc" else (self.partner, self.plc)
        other = "partner" if who == "plc" else "plc"
        packet = tcp(
            data, self.seq[who] if seq is None else seq, self.seq[other] if flags & ACK else 0, flags,
            self.window[who] if window is None else window, *ends,
        )  # fmt: skip
        self.built.packets.append((self.now if at is None else at, packet))

    @property
    def caller(self) -> str:
        return "plc" if self.plc_calls else "partner"

    @property
    def listener(self) -> str:
        return "partner" if self.plc_calls else "plc"

    def open(self) -> Wire:
        self.put(self.caller, flags=SYN)
        self.seq[self.caller] += 1
        self.wait(self.rtt)
        self.put(self.listener, flags=SYN | ACK)
        self.seq[self.listener] += 1
        self.wait(self.rtt // 4)
        self.put(self.caller)
        self.wait(self.r.randrange(1 * MS, 20 * MS))
        return self

    def wait(self, ns: float) -> None:
        self.now += int(ns)

    def say(self, who: str, data: bytes, ack: bool = True) -> None:
        """Say bytes in segments; the other end acknowledges soon, or some time later."""
        other = "partner" if who == "plc" else "plc"
        for at in range(0, len(data), MSS):
            part = data[at : at + MSS]
            self.put(who, part, ACK | PSH)
            self.seq[who] += len(part)
            self.wait(20_000)
        if ack:
            wait = self.delayed if self.delayed and len(data) < MSS else self.rtt
            self.put(other, at=self.now + wait - 20_000)
            self.wait(wait if self.delayed == 0 else 0)

    def again(self, who: str, data: bytes) -> None:
        self.put(who, data, ACK | PSH, self.seq[who] - len(data))

    def ask_to_connect(self, answer: str = "") -> None:
        """Send the caller's SYN; `rst`: it is refused."""
        self.put(self.caller, flags=SYN)
        if answer == "rst":
            self.seq[self.caller] += 1
            self.wait(self.rtt)
            self.rst(self.listener)

    def insist(self, times: int, wait: int, act: Callable[[], object], first: bool = False) -> None:
        """Do it so often, each time after twice the time; `first`: once before the first wait."""
        for _ in range(times):
            if first:
                act()
            self.wait(wait)
            if not first:
                act()
            wait *= 2

    def fin(self, who: str) -> None:
        other = "partner" if who == "plc" else "plc"
        self.wait(max(self.delayed + MS, self.rtt))
        self.put(who, flags=FIN | ACK)
        self.seq[who] += 1
        self.wait(self.rtt)
        self.put(other, flags=FIN | ACK)
        self.seq[other] += 1
        self.wait(self.rtt)
        self.put(who)

    def rst(self, who: str) -> None:
        self.put(who, flags=RST | ACK)

    def keep_alive(self, who: str, answered: bool = True) -> None:
        self.put(who, flags=ACK, seq=self.seq[who] - 1)
        if answered:
            self.put("partner" if who == "plc" else "plc", at=self.now + self.rtt)


# -- what is said --------------------------------------------------------------------------------------------


class Telegrams:
    """Messages of one kind of device: constant head, counter, values that wander."""

    def __init__(self, r: random.Random, size: int) -> None:
        self.r, self.size, self.number = r, size, r.randrange(1000)
        self.head = bytes(r.randrange(256) for _ in range(min(4, size // 3)))

    def next(self, size: int = 0) -> bytes:
        size = size or self.size
        self.number += 1
        body = self.head + struct.pack("<H", self.number & 0xFFFF)
        rest = bytes(self.r.randrange(256) for _ in range(max(size - len(body), 0)))
        return (body + rest)[:size]


def period(r: random.Random) -> int:
    """Return a time between messages in ns."""
    return int(10 ** r.uniform(6.3, 9.8))  # 2 ms to 6 s


def size_of(r: random.Random, most: int = 400) -> int:
    return r.choice(
        (r.randrange(6, 40), r.randrange(12, most), r.choice((4, 16, 20, 24, 32, 64, 100, 200, 1400, 3000)))
    )


def jitter(r: random.Random, ns: int) -> int:
    return int(ns * r.uniform(0.9, 1.1))


def talk(r: random.Random, wire: Wire, telegrams: Telegrams, n: int, every: int, style: str = "") -> None:
    """Let the partner say n messages: alone, or answered by the PLC, or asked for."""
    style = style or r.choice(("alone", "answered", "asked"))
    reply = Telegrams(r, r.randrange(4, 60))
    for _ in range(n):
        start = wire.now
        if style == "asked":
            wire.say("plc", reply.next(), ack=False)
            wire.wait(r.randrange(1 * MS, 8 * MS))
        wire.say("partner", telegrams.next(), ack=style == "alone")
        if style == "answered":
            wire.wait(r.randrange(1 * MS, 15 * MS))
            wire.say("plc", reply.next(), ack=False)
            wire.wait(wire.rtt)
            wire.put("partner", at=wire.now)
        wire.now = max(wire.now, start + jitter(r, every))


def begin(r: random.Random) -> int:
    return 1_700_000_000 * S + r.randrange(S)


def static(need: int, **more: object) -> Receiver:
    return Receiver("TRCV_C_1", "C1", need, local_port=2000, interval_ns=10 * MS, is_only=True, **more)  # type: ignore[arg-type]


def say_each(r: random.Random, wire: Wire, messages: Iterable[bytes], every: int) -> None:
    for message in messages:
        wire.say("partner", message)
        wire.wait(jitter(r, every))


Make = Callable[[random.Random, Built], None]


# -- healthy lines -------------------------------------------------------------------------------------------


def healthy_fixed(r: random.Random, b: Built) -> None:
    size = size_of(r)
    w = Wire(r, b, begin(r), plc_calls=r.random() < 0.3).open()
    every = period(r)
    talk(r, w, Telegrams(r, size), r.randrange(5, 80), every)
    if r.random() < 0.5:
        w.fin(r.choice(("plc", "partner")))
    is_slow = every > 15 * MS  # slower than a job a scan
    b.receiver = r.choice((None, static(size) if is_slow and not w.plc_calls else None))


def healthy_end_by_rst(r: random.Random, b: Built) -> None:
    size = size_of(r)
    w = Wire(r, b, begin(r)).open()
    talk(r, w, Telegrams(r, size), r.randrange(4, 40), period(r), "answered")
    w.wait(w.delayed + 20 * MS)
    w.rst(r.choice(("plc", "partner")))  # closed with bytes that it has not read


def healthy_middle(r: random.Random, b: Built) -> None:
    healthy_fixed(r, b)
    b.first_packet = r.randrange(3, 12)


def healthy_ad_hoc(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, 20)
    every, most = period(r), r.randrange(40, 900)
    say_each(r, w, (t.next(r.randrange(6, most)) for _ in range(r.randrange(5, 60))), every)
    b.receiver = r.choice((None, static(most, adhoc=True)))


def healthy_pieces(r: random.Random, b: Built) -> None:
    size = r.randrange(12, 300)
    w, t, every = Wire(r, b, begin(r)).open(), Telegrams(r, size), period(r)
    for _ in range(r.randrange(5, 40)):
        data = t.next()
        cut = r.randrange(1, size)
        w.say("partner", data[:cut], ack=False)
        w.wait(r.randrange(5 * MS, 30 * MS))
        w.say("partner", data[cut:])
        w.wait(jitter(r, every + 200 * MS))
    b.receiver = r.choice((None, static(size)))


def healthy_even_pieces(r: random.Random, b: Built) -> None:
    size, every = r.randrange(12, 300), period(r)
    cut = r.randrange(1, size)
    cut += 2 * cut == size
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size)
    for _ in range(r.randrange(5, 40)):
        data = t.next()
        say_each(r, w, (data[:cut], data[cut:]), every)
    b.receiver = static(size)


def healthy_several_in_a_message(r: random.Random, b: Built) -> None:
    size, k = r.randrange(8, 60), r.randrange(2, 5)
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size)
    every = period(r) + 100 * MS
    say_each(r, w, (b"".join(t.next() for _ in range(k)) for _ in range(r.randrange(5, 40))), every)
    b.receiver = static(size)


def healthy_stream(r: random.Random, b: Built) -> None:
    w = Wire(r, b, begin(r)).open()
    for _ in range(r.randrange(20, 200)):
        w.say(
            r.choice(("partner", "plc", "partner")),
            bytes(r.randrange(256) for _ in range(r.randrange(1, 5000))),
        )
        w.wait(r.expovariate(1 / (20 * MS)))


def healthy_idle(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size_of(r))
    probes = r.random() < 0.7
    for _ in range(r.randrange(2, 5)):
        talk(r, w, t, 3, period(r))
        for _ in range(r.randrange(3, 12)):
            w.wait(10 * S)
            if probes:
                w.keep_alive(r.choice(("plc", "partner")))
        w.wait(S)


def healthy_two_clients(r: random.Random, b: Built) -> None:
    at = begin(r)
    for n in range(r.randrange(2, 5)):
        w = Wire(r, b, at + n * r.randrange(1, 5 * S))
        w.partner = (f"10.0.0.{20 + n}", r.randrange(20000, 60000))
        talk(r, w.open(), Telegrams(r, size_of(r)), r.randrange(4, 30), period(r), "answered")


def healthy_one_loss(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size_of(r))
    n, lost = r.randrange(250, 400), r.randrange(20, 200)
    for k in range(n):
        data = t.next()
        w.say("partner", data, ack=k != lost)
        if k == lost:
            w.wait(200 * MS)
            w.again("partner", data)
            w.wait(w.rtt)
            w.put("plc")
        w.wait(jitter(r, 100 * MS + w.delayed))


def healthy_short_full(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size_of(r))
    talk(r, w, t, r.randrange(5, 30), period(r), "alone")
    w.wait(250 * MS)
    w.put("plc", window=0)
    w.wait(r.randrange(1 * MS, 60 * MS))
    w.put("plc")
    w.wait(20 * MS)
    talk(r, w, t, r.randrange(5, 30), period(r), "alone")


def healthy_new_connection(r: random.Random, b: Built) -> None:
    at, size = begin(r), size_of(r)
    for _ in range(r.randrange(2, 4)):
        w = Wire(r, b, at).open()
        talk(r, w, Telegrams(r, size), r.randrange(4, 30), period(r))
        w.fin(r.choice(("plc", "partner")))
        at = w.now + r.randrange(S, 60 * S)


def healthy_late_syn(r: random.Random, b: Built) -> None:
    w = Wire(r, b, begin(r))
    w.put("partner", flags=SYN)
    w.wait(S)
    w.open()
    talk(r, w, Telegrams(r, size_of(r)), r.randrange(4, 30), period(r))


def healthy_cut(r: random.Random, b: Built) -> None:
    healthy_fixed(r, b)
    b.receiver, b.what = None, "cut"


def healthy_udp(r: random.Random, b: Built) -> None:
    at, size = begin(r), size_of(r)
    t, every, most = Telegrams(r, size), period(r), r.randrange(size, size + 500)
    for _ in range(r.randrange(4, 60)):
        b.packets.append((at, udp(t.next())))
        at += jitter(r, every)
    b.receiver = r.choice((None, static(most, is_datagram=True)))


def healthy_members(r: random.Random, b: Built) -> None:
    b.receiver, frames = members(r)
    say_frames(r, b, frames)


def healthy_iso(r: random.Random, b: Built) -> None:
    w = Wire(r, b, begin(r), port=102).open()
    w.say("partner", cotp(0xE0, b"\x01\x00", b"\x03\x02"), ack=False)
    w.wait(3 * MS)
    w.say("plc", cotp(0xD0, b"\x01\x00", b"\x03\x02"))
    t, every = Telegrams(r, size_of(r)), period(r)
    for _ in range(r.randrange(4, 30)):
        body = t.next()
        w.say("partner", b"\x03\x00" + struct.pack(">H", len(body) + 7) + b"\x02\xf0\x80" + body)
        w.wait(jitter(r, every))


def healthy_tls(r: random.Random, b: Built) -> None:
    w = Wire(r, b, begin(r)).open()
    hello(r, w)
    w.wait(4 * MS)
    w.say(
        "plc",
        record(22, bytes(90)) + record(20, b"\x01") + record(23, bytes(r.randrange(700, 1400))),
        ack=False,
    )
    w.wait(4 * MS)
    w.say("partner", record(20, b"\x01") + record(23, bytes(53)))
    for _ in range(r.randrange(4, 30)):
        w.wait(jitter(r, 100 * MS))
        w.say("partner", record(23, bytes(r.randrange(256) for _ in range(60))))
    if r.random() < 0.5:
        w.say("partner", record(23, bytes(19)), ack=False)
        w.fin("partner")


# -- faults --------------------------------------------------------------------------------------------------


def refused(r: random.Random, b: Built) -> None:
    at, every = begin(r), r.choice((S, 2 * S, 5 * S, 100 * MS))
    for _ in range(r.randrange(1, 12)):
        w = Wire(r, b, at, plc_calls=b.what == "plc")
        w.ask_to_connect("rst")
        at += jitter(r, every)


def filtered(r: random.Random, b: Built) -> None:
    at, calls = begin(r), r.random() < 0.4
    for _ in range(r.randrange(1, 4)):
        w = Wire(r, b, at, plc_calls=calls)
        w.insist(r.randrange(2, 6), S, w.ask_to_connect, first=True)
        at = w.now + r.randrange(5 * S)


def resets(r: random.Random, b: Built) -> None:
    size = size_of(r)
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size)
    talk(r, w, t, r.randrange(3, 40), period(r))
    b.receiver = r.choice((None, static(size)))
    is_mid_frame = b.receiver is None or r.random() < 0.7  # else nothing is on its way
    if is_mid_frame:
        w.say("partner", t.next()[: r.randrange(1, size)])
    w.wait(r.randrange(1 * MS, 300 * MS) + w.delayed)
    w.rst(r.choice(("plc", "partner", "partner")))
    if r.random() < 0.4 or not is_mid_frame:
        v = Wire(r, b, w.now + r.randrange(S, 8 * S)).open()
        talk(r, v, t, r.randrange(3, 20), period(r))


def closes_each_message(r: random.Random, b: Built) -> None:
    at, size, every = begin(r), size_of(r), r.randrange(500 * MS, 20 * S)
    for _ in range(r.randrange(3, 25)):
        w = Wire(r, b, at).open()
        w.say("partner", Telegrams(r, size).next())
        if r.random() < 0.2:
            w.say("plc", b"OK\r\n", ack=False)
        w.wait(r.randrange(MS, 50 * MS))
        w.fin("partner")
        at = max(w.now + 50 * MS, at + jitter(r, every))
    b.receiver = r.choice((None, static(size)))


def reconnect_storm(r: random.Random, b: Built) -> None:
    at, every, who = begin(r), r.randrange(300 * MS, 12 * S), r.choice(("plc", "partner"))
    by_rst, n = r.random() < 0.5, r.randrange(0, 4)
    size = size_of(r)
    n = 2 if n == 1 and who == "partner" and not by_rst else n
    for _ in range(r.randrange(5, 30)):
        w = Wire(r, b, at).open()
        talk(r, w, Telegrams(r, size), n, min(every // 6, 80 * MS), "alone")
        w.wait(w.delayed + r.randrange(MS, 20 * MS))
        w.rst(who) if by_rst else w.fin(who)
        at = max(w.now + 20 * MS, at + jitter(r, every))


def dead_link(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size_of(r))
    talk(r, w, t, r.randrange(4, 40), period(r))
    w.wait(w.delayed + MS)
    who = r.choice(("partner", "plc"))
    data, wait = t.next(), r.choice((200 * MS, 300 * MS))
    w.say(who, data, ack=False)
    w.insist(r.randrange(4, 9), wait, lambda: w.again(who, data))
    if r.random() < 0.3:
        w.wait(S)
        w.rst(who)


def no_keep_alive(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size_of(r))
    talk(r, w, t, r.randrange(3, 20), period(r))
    w.wait(r.randrange(60, 4000) * S)
    kind = r.randrange(3)
    if kind == 0:
        w.say("partner", t.next(), ack=False)
        w.wait(w.rtt)
        w.rst("plc")
    elif kind == 1:
        data = t.next()
        w.say("partner", data, ack=False)
        w.insist(r.randrange(4, 8), 200 * MS, lambda: w.again("partner", data))
    v = Wire(r, b, w.now + r.randrange(100 * MS, 3 * S)).open()
    talk(r, v, t, r.randrange(2, 20), period(r))


def not_reading(r: random.Random, b: Built, who: str) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, r.randrange(50, 1000))
    other = "partner" if who == "plc" else "plc"
    for window in (8192, 5000, 2600, 900):
        w.say(other, t.next(), ack=False)
        w.wait(w.rtt)
        w.put(who, window=window)
        w.wait(jitter(r, 60 * MS))
    w.window[who] = 0
    w.say(other, t.next(), ack=False)
    w.wait(w.rtt)
    w.put(who)

    def probe() -> None:
        w.keep_alive(other, answered=False)
        w.wait(w.rtt)
        w.put(who)

    w.insist(r.randrange(4, 8), 200 * MS, probe)
    if r.random() < 0.4:
        w.put(who, window=8192)
        w.wait(w.rtt)
        w.window[who] = 8192
        w.say(other, t.next())


def plc_not_reading(r: random.Random, b: Built) -> None:
    not_reading(r, b, "plc")


def partner_not_reading(r: random.Random, b: Built) -> None:
    not_reading(r, b, "partner")


def flood(r: random.Random, b: Built) -> None:
    size = r.randrange(40, 500)
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size)
    w.rtt, w.delayed = 300_000, 0
    room = full = r.choice((4096, 8192))
    for _ in range(r.randrange(4, 14)):
        while room >= size:
            w.say("partner", t.next(), ack=False)
            room -= size
            w.put("plc", window=max(room, 0) if room >= size else 0)
            w.wait(r.randrange(300_000, 2 * MS))
        w.wait(r.randrange(20 * MS, 300 * MS))
        room = r.randrange(full // 3, full)
        w.put("plc", window=room)
        w.wait(w.rtt)
    b.receiver = static(size)


def second_client(r: random.Random, b: Built) -> None:
    at = begin(r)
    w = Wire(r, b, at).open()
    t, every = Telegrams(r, size_of(r)), period(r)
    talk(r, w, t, r.randrange(10, 30), every, "answered")
    kind = b.what
    until = w.now
    v = Wire(r, b, at + r.randrange(50 * MS, max((until - at) // 2, 60 * MS)))
    v.partner = ("10.0.0.11", 40_000) if r.random() < 0.6 else v.partner
    if kind == "refused":
        v.ask_to_connect("rst")
    elif kind == "filtered":
        v.insist(r.randrange(3, 6), S, v.ask_to_connect, first=True)
    else:
        v.open()
        if r.random() < 0.5:
            v.say("partner", t.next())
        v.wait(r.randrange(MS, 200 * MS))
        v.rst("plc") if r.random() < 0.7 else v.fin("plc")


def slow_ack(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, r.randrange(20, 200))
    w.delayed = r.choice((40, 100, 150, 200)) * MS
    who, other = r.choice((("partner", "plc"), ("plc", "partner")))
    for _ in range(r.randrange(6, 40)):
        data = t.next()
        cut = r.randrange(2, len(data) - 2)
        w.say(who, data[:cut], ack=False)
        w.wait(w.delayed + r.randrange(-3 * MS, 3 * MS))
        w.put(other)
        w.wait(r.randrange(20_000, 400_000))
        w.say(who, data[cut:], ack=False)
        w.wait(r.randrange(MS, 5 * MS))
        w.say(other, b"ok", ack=False)
        w.wait(r.randrange(20 * MS, 500 * MS))


def loss(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size_of(r, 1400))
    who, share = r.choice((("partner", "plc"), ("plc", "partner"))), r.uniform(0.04, 0.25)
    seen, lost = r.random() < 0.6, 0
    for k in range(r.randrange(50, 150)):
        data = t.next()
        if (r.random() < share and k > 3) or (k == 30 and not lost) or (k in (35, 40) and lost < 3):
            lost += 1
            if seen:
                w.say(who[0], data, ack=False)
            else:
                w.seq[who[0]] += len(data)
            w.wait(2 * MS)
            more = t.next()
            w.say(who[0], more, ack=False)
            w.wait(w.rtt)
            w.seq[who[0]] -= len(data) + len(more)
            w.put(who[1])
            w.seq[who[0]] += len(data) + len(more)
            w.wait(r.choice((200 * MS, 30 * MS)))
            w.put(who[0], data, ACK | PSH, w.seq[who[0]] - len(data) - len(more))
            w.wait(w.rtt)
            w.put(who[1])
        else:
            w.say(who[0], data)
        w.wait(jitter(r, 60 * MS) + w.delayed)


def healthy_but_in_the_capture(r: random.Random, b: Built) -> None:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size_of(r, 1400))
    holes = set(r.sample(range(4, 50), r.randrange(2, 12)))
    for k in range(60):
        data = t.next()
        if k in holes:
            w.seq["partner"] += len(data)
            w.wait(w.rtt)
            w.put("plc")
        else:
            w.say("partner", data)
        w.wait(jitter(r, 80 * MS) + w.delayed)


def record(kind: int, body: bytes) -> bytes:
    return bytes((kind, 3, 3)) + struct.pack(">H", len(body)) + body


def hello(r: random.Random, w: Wire) -> None:
    w.say(
        "partner",
        record(22, b"\x01" + bytes(r.randrange(256) for _ in range(r.randrange(150, 500)))),
        ack=False,
    )


def tls_refused(r: random.Random, b: Built) -> None:
    at = begin(r)
    for _ in range(r.randrange(1, 5)):
        w = Wire(r, b, at).open()
        kind = r.randrange(4)
        hello(r, w) if kind < 3 else w.say("partner", Telegrams(r, 30).next(), ack=False)
        w.wait(4 * MS)
        code = r.choice((40, 42, 46, 48, 70, 116))
        if kind == 0 or kind == 3:
            w.say("plc", record(21, bytes((2, 10 if kind == 3 else code))), ack=False)
            w.fin("plc")
        elif kind == 1:
            w.say("plc", record(22, bytes(90)) + record(22, bytes(900)) + record(22, bytes(4)), ack=False)
            w.wait(3 * MS)
            w.say("partner", record(21, bytes((2, code))), ack=False)
            w.fin("partner")
        else:
            w.rst("plc") if r.random() < 0.5 else w.fin("plc")
        at = w.now + r.randrange(S, 5 * S)


def cotp(kind: int, calling: bytes, called: bytes) -> bytes:
    if kind == 0x80:
        body = b"\x80\x00\x01\x00\x00" + calling[:1]
    else:
        body = (bytes((kind,)) + b"\x00\x00\x00\x01\x00\xc0\x01\x0a\xc1" + bytes((len(calling),)) + calling
                + b"\xc2" + bytes((len(called),)) + called)  # fmt: skip
    whole = bytes((len(body),)) + body
    return b"\x03\x00" + struct.pack(">H", len(whole) + 4) + whole


def wrong_tsap(r: random.Random, b: Built) -> None:
    at, calls = begin(r), r.random() < 0.4
    for _ in range(r.randrange(1, 6)):
        w = Wire(r, b, at, port=102, plc_calls=calls).open()
        w.say(w.caller, cotp(0xE0, b"\x01\x00", bytes((3, r.randrange(16)))), ack=False)
        w.wait(2 * MS)
        if r.random() < 0.8:
            w.say(w.listener, cotp(0x80, bytes((r.choice((0, 3, 0x88)),)), b""), ack=False)
        w.fin(w.listener)
        at = w.now + r.randrange(S, 5 * S)


def address(r: random.Random, b: Built) -> None:
    at = begin(r)
    if r.random() < 0.5:  # both call, nobody listens
        for _ in range(r.randrange(2, 8)):
            for calls in (False, True):
                w = Wire(r, b, at, plc_calls=calls)
                w.partner = (w.partner[0], 2000) if calls else w.partner
                if calls:
                    w.plc = (w.plc[0], r.randrange(20000, 60000))
                w.ask_to_connect("rst")
                at += jitter(r, S)
        return
    w = Wire(r, b, at, plc_calls=False).open()
    talk(r, w, Telegrams(r, 20), 5, period(r))
    b.plc = f"10.0.0.{b.host}"
    b.receiver = static(20)._replace(active=True, local_port=0, remote_port=w.partner[1])


def fixed(r: random.Random, b: Built, size: int, n: int = 0) -> tuple[Wire, Telegrams]:
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size)
    talk(r, w, t, n or r.randrange(6, 60), period(r))
    return w, t


def frame_short(r: random.Random, b: Built) -> None:
    size = size_of(r)
    fixed(r, b, size)
    need = size + r.randrange(1, size + 20)
    b.receiver = static(need + (need % size == 0))


def frame_long(r: random.Random, b: Built) -> None:
    if b.what == "members":
        b.receiver, frames = members(r)
        end = r.choice((b"\r\n", b"\r\n", b"\x03", r.randbytes(3)))
        say_frames(r, b, [frame + end for frame in frames])
        return
    need = size_of(r)
    size = need + r.randrange(1, need + 20)
    fixed(r, b, size + (size % need == 0))
    b.receiver = static(need)


def adhoc_missing(r: random.Random, b: Built) -> None:
    w, t, every = Wire(r, b, begin(r)).open(), Telegrams(r, 20), period(r)
    low, most = r.randrange(4, 30), r.randrange(40, 600)
    some = [r.randrange(low, most) for _ in range(r.choice((3, 5, 20)))]
    say_each(r, w, (t.next(r.choice(some)) for _ in range(r.randrange(8, 60))), every)
    b.receiver = static(r.choice((most, max(some))))


def adhoc_splits(r: random.Random, b: Built) -> None:
    size = r.randrange(12, 500)
    w, t = Wire(r, b, begin(r)).open(), Telegrams(r, size)
    often = r.choice((1.0, 0.6, 0.4))
    pause, every = r.randrange(12 * MS, 60 * MS), r.randrange(500 * MS, 3 * S)
    for _ in range(r.randrange(8, 50)):
        data = t.next()
        cut = r.randrange(1, size)
        if r.random() < often:
            w.say("partner", data[:cut], ack=False)
            w.wait(jitter(r, pause))
            w.say("partner", data[cut:])
        else:
            w.say("partner", data)
        w.wait(jitter(r, every))
    b.receiver = static(r.choice((size, size + 50)), adhoc=True)


def merged(r: random.Random, b: Built) -> None:
    size = r.randrange(8, 200)
    w, t, every = Wire(r, b, begin(r)).open(), Telegrams(r, size), period(r)
    often = r.uniform(0.2, 0.6)
    for k in range(r.randrange(15, 60)):
        n = r.randrange(2, 5) if r.random() < often or k in (4, 6, 8, 10) else 1
        w.say("partner", b"".join(t.next() for _ in range(n)))
        w.wait(jitter(r, every))
    b.receiver = static(size * 5, adhoc=True)


def shifted(r: random.Random, b: Built) -> None:
    size = r.randrange(8, 300)
    w, t = fixed(r, b, size, r.randrange(2, 20))
    w.wait(w.delayed + 50 * MS)
    w.say("partner", t.next(r.randrange(1, size)))
    w.wait(r.randrange(100 * MS, S))
    talk(r, w, t, r.randrange(5, 30), period(r))
    b.receiver = static(size)


def datagram_size(r: random.Random, b: Built) -> None:
    at, need, t, every = begin(r), size_of(r), Telegrams(r, 20), period(r)
    for k in range(r.randrange(4, 60)):
        b.packets.append((at, udp(t.next(need + r.randrange(1, 60) if k % 3 == 1 else need))))
        at += jitter(r, every)
    b.receiver = static(need, is_datagram=True)


# -- members -------------------------------------------------------------------------------------------------

TYPES = ("INT", "DINT", "REAL", "UINT", "REAL", "DINT", "LREAL", "WORD", "BYTE", "BOOL", "STRING[10]")


def members(r: random.Random, theirs: LayoutChoice | None = None) -> tuple[Receiver, list[bytes]]:
    """Return a receiver with a random type, and frames as a sender with another layout has them."""
    while True:
        names = ["BYTE", *[r.choice(TYPES) for _ in range(r.randrange(4, 10))], "REAL", "DINT"]
        text = "".join(f"  m{n} : {name};\n" for n, name in enumerate(names))
        source = f"TYPE T : STRUCT\n{text}END_STRUCT END_TYPE"
        types = join_declarations([read_st(source, "t.st")], "t.st")
        type_ = types.get_type("T", "t.st")
        ours = lay_out(type_, LAYOUTS["baosky"], "T")
        layout = lay_out(type_, (theirs or LayoutChoice()).rules(LAYOUTS["baosky"]), "T")
        if theirs is None or layout.size != ours.size or theirs.byte_order:
            break
    from trcvtui.udt.layout.values import encode

    start = [r.uniform(1, 500) for _ in names]
    frames = []
    for k in range(r.randrange(6, 24)):
        values: dict[str, object] = {}
        for n, name in enumerate(names):
            number = start[n] + k * (n + 1) * r.uniform(0.9, 1.1)
            values[f"m{n}"] = (
                f"PART {k}" if name.startswith("STRING") else round(number, 2) if "REAL" in name
                else r.random() < 0.5 if name == "BOOL" else int(number) % (200 if name == "BYTE" else 30_000)
            )  # fmt: skip
        frames.append(encode(layout, values))
    receiver = static(ours.size, data="D", type_name="T", type=type_, rules=LAYOUTS["baosky"])
    return receiver, frames


def say_frames(r: random.Random, b: Built, frames: list[bytes]) -> None:
    say_each(r, Wire(r, b, begin(r)).open(), frames, period(r))


def byte_order(r: random.Random, b: Built) -> None:
    b.receiver, frames = members(r, LayoutChoice(byte_order="big"))
    say_frames(r, b, frames)


def padding(r: random.Random, b: Built) -> None:
    b.receiver, frames = members(r, LayoutChoice(layout=r.choice(("packed", "codesys-8", "codesys-2"))))
    say_frames(r, b, frames)


def header(r: random.Random, b: Built) -> None:
    b.receiver, frames = members(r)
    n, has_end = r.choice((2, 3, 4, 6, 8, 12, 20)), r.random() < 0.3
    head, end = bytes(r.randrange(1, 256) for _ in range(n - 1)), b"\r\n" if has_end else b""
    say_frames(r, b, [head + bytes((k + 1,)) + frame + end for k, frame in enumerate(frames)])


# -- all of them ---------------------------------------------------------------------------------------------

HEALTHY: tuple[Make, ...] = (
    healthy_fixed, healthy_end_by_rst, healthy_middle, healthy_ad_hoc, healthy_pieces, healthy_even_pieces,
    healthy_several_in_a_message,
    healthy_stream, healthy_idle, healthy_two_clients, healthy_one_loss, healthy_short_full,
    healthy_new_connection, healthy_late_syn, healthy_cut, healthy_udp, healthy_members, healthy_iso,
    healthy_tls, healthy_but_in_the_capture,
)  # fmt: skip
SEVERAL_KINDS: dict[Make, tuple[str, ...]] = {
    refused: ("", "plc"),
    second_client: ("refused", "filtered", "reset"),
    frame_long: ("", "members"),
}
WITH_A_FAULT: tuple[Make, ...] = (
    refused, filtered, resets, closes_each_message, reconnect_storm, dead_link, no_keep_alive,
    plc_not_reading, partner_not_reading, flood, second_client, slow_ack, loss, tls_refused, wrong_tsap,
    address, frame_short, frame_long, adhoc_missing, adhoc_splits, merged, shifted, datagram_size,
    byte_order, padding, header,
)  # fmt: skip
FAULTS: tuple[tuple[str, Make, tuple[str, ...]], ...] = tuple(
    (make.__name__.replace("_", "-"), make, SEVERAL_KINDS.get(make, ("",))) for make in WITH_A_FAULT
)


def built(cause: str, make: Make, what: str, seed: int) -> Built:
    made = Built(cause, what=what)
    make(random.Random(f"{cause} {make.__name__} {what} {seed}"), made)
    return made


def in_noise(made: Built, seed: int) -> Built:
    """Return the capture as a busy mirror port shows it: some packets twice, some exchanged, other lines."""
    r = random.Random(f"noise {seed}")
    packets = sorted(made.packets, key=lambda one: one[0])
    for number in range(1, len(packets)):
        if r.random() < 0.003 and packets[number][0] - packets[number - 1][0] < 200_000:
            packets[number - 1 : number + 1] = [
                (packets[number - 1][0], packets[number][1]),
                (packets[number][0], packets[number - 1][1]),
            ]
    twice = r.random() < 0.3
    again = [(ns + r.randrange(1_000, 60_000), data) for ns, data in packets if twice or r.random() < 0.01]
    others = Built("", host=40)
    at = packets[0][0]
    for number in range(3):
        others.host = 40 + 10 * number
        w = Wire(r, others, at + r.randrange(S)).open()
        talk(r, w, Telegrams(r, size_of(r)), 20, period(r))
    more = [(ns, data) for ns, data in others.packets if ns <= packets[-1][0] + S]
    made.packets = packets + again + more
    return made


LATE = (  # faults that show themselves after the first packets
    "resets", "dead-link", "no-keep-alive", "plc-not-reading", "partner-not-reading", "flood", "slow-ack",
    "loss", "frame-short", "frame-long", "adhoc-missing", "adhoc-splits", "merged", "byte-order", "padding",
    "header",
)  # fmt: skip


def in_the_middle(made: Built) -> Built:
    """Return the capture without its first packets: nobody saw how the connection was built."""
    made.first_packet = 4
    return made


def two_faults(seed: int) -> tuple[Built, Built, Built]:
    """Return a capture with two faults on lines of two PLCs, and what each of them is."""
    r = random.Random(f"two {seed}")
    alone = [row for row in FAULTS if row[0] not in ("datagram-size", "address")]
    one, other = (built(*r.choice(alone)[:2], "", seed) for _ in range(2))
    cause, make, _ = r.choice(alone)
    other = Built(cause, host=25)
    make(random.Random(f"other {seed}"), other)
    both = Built("", one.packets + other.packets)
    return both, one, other


def faults(seeds: range) -> Iterator[Built]:
    for seed in seeds:
        for cause, make, kinds in FAULTS:
            yield built(cause, make, kinds[seed % len(kinds)], seed)


def healthy(seeds: range) -> Iterator[Built]:
    for seed in seeds:
        for make in HEALTHY:
            yield built("", make, make.__name__, seed)


Verdicts = list[dict[str, Any]]  # as JSON has them


def verdicts_of(path: Path, plc: str | None = None, receivers: tuple[Receiver, ...] = ()) -> Verdicts:
    verdicts, _, _ = judge_capture(str(path), DoctorQuestion(plc, receivers))
    return [json.loads(json_text(as_json(one))) for one in verdicts]
