"""Sixty random cases, the same each time: a small PLC, a partner that speaks by itself, and one question.

Intervals of both runs divide all times at which the scenario acts. No question is for a pin that it writes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from random import Random

from tests.diagnosis.truth.runs import Case

LOCAL = 'LocalAddress = "127.0.0.1"\n'
TCP = f"ActiveEstablished = false\n{LOCAL}LocalPort = 0\n"
CALLS = f'ActiveEstablished = true\n{LOCAL}RemoteAddress = "127.0.0.1"\nRemotePort = "@P1"\n'
ISO = 'type = "TCON_IP_RFC"\nActiveEstablished = false\nLocalTSelector = "E0.02"\nRemoteTSelector = "E0.01"\n'
ISO += "IsoPort = 0\n"
PEER = 'active = true\nremote = "@C1"\nreconnect = "T#100ms"\n'
ISO_PEER = f'iso = true\nlocal_tsap = "E0.01"\nremote_tsap = "E0.02"\n{PEER}'
LISTENS = 'active = false\nlocal = "127.0.0.1:0"\n'
SOURCE = f'[[addr]]\nname = "SOURCE"\n[[udp_config]]\nname = "U1"\n{LOCAL}LocalPort = 0\n'


def array(size: int) -> str:
    return f"ARRAY[0..{size - 1}] OF BYTE"


def pins(**inputs: object) -> str:
    return "".join(f"{name} = {str(value).lower()}\n" for name, value in inputs.items())


def receiver(block: str, data: int, inputs: str, on: str = 'connect = "C1"\n') -> str:
    rx = f'[[data]]\nname = "rx"\ntype = "{array(data)}"\n'
    return f'{rx}[[instance]]\nname = "R"\nblock = "{block}"\n{on}data = "rx"\n{inputs}'


def udp_receiver(data: int, dialect: str, **inputs: object) -> str:
    block, held = ("URECV_C", {"CONT": True}) if dialect == "baosky" else ("TURCV", {})
    on = 'config = "U1"\naddr = "SOURCE"\n'
    return SOURCE + receiver(block, data, pins(**held, **inputs), on)


def sender(size: int) -> str:
    tx = f'[[data]]\nname = "tx"\ntype = "{array(size)}"\n'
    return f'{tx}[[instance]]\nname = "S"\nblock = "TSEND_C"\nconnect = "C1"\ndata = "tx"\nCONT = true\n'


def plc(connect: str, parts: str, peer: str = "", dialect: str = "baosky") -> str:
    """Return a project; `connect` and `peer`: what stands in its CONNECT and its peer."""
    connect = f'[[connect]]\nname = "C1"\n{connect}' if connect else ""
    peer = f'[[peer]]\nname = "P1"\n{peer}\n' if peer else ""
    return f'dialect = "{dialect}"\n{connect}{parts}{peer}'


def scenario(dialect: str, connect: str, parts: str, peer: str, steps: list[str], interval: int = 10) -> str:
    task = f'[[task]]\nname = "MAIN"\ninterval = "T#{interval}ms"\n'
    return f'{plc(connect, task + parts, peer, dialect)}[scenario]\nsteps = """\n{chr(10).join(steps)}\n"""\n'


def says(random: Random, *lengths: int, every: int, cut: bool = True) -> str:
    """Return what the partner says by itself: messages of these lengths in turn, some of them in pieces."""
    told = []
    for length in lengths:
        is_cut = cut and length > 1 and random.random() < 0.3
        told.append(f"random {length} seed={length}")
        told[-1] += f" split={random.randint(1, length - 1)} gap=T#20ms" if is_cut else ""
    return f'says = {str(told).replace(chr(39), chr(34))}\nevery = "T#{every}ms"\n'


STREAM_ENDS = ("peer P1 close", "peer P1 rst", "pulse R COM_RST", "link C1 down\nrun T#200ms\nlink C1 up")


def acts(random: Random, length: int, most: int, ends: tuple[str, ...] = ()) -> list[str]:
    """Return steps: what the partner and the PLC's program do, each at a multiple of 100 ms."""
    may = [f"peer P1 send random {n} seed={n}" for n in (length, length - 1, 3 * length + 2)]
    steps = ["run T#500ms"]
    for _ in range(random.randint(0, most)):
        steps += [random.choice([*may, *ends]), f"run T#{100 * random.randint(2, 8)}ms"]
    return [*steps, "run T#500ms"]


def stream(kind: str, questions: tuple[str, ...], dialects: tuple[str, ...], random: Random) -> Case:
    """A TRCV_C whose LEN and DATA are too small, too large, or right."""
    dialect, question = random.choice(dialects), random.choice(questions)
    message, is_ad_hoc = random.choice([8, 12, 20, 33]), random.random() < 0.5
    data = message + random.choice([-7, -4, -1, 0, 2, 4, 9, 20])
    length = random.choice([0, min(data, message), data - 1, 5]) if question != "DATA" else 0
    length = min(length, data)
    asks: dict[str, list[object]] = {
        "LEN": [n for n in (data, data - 2, message - 4, 6, data + 5) if n != (length or data)],
        "ADHOC": [str(not is_ad_hoc).lower()],
        "DATA": [array(n) for n in (message, message + 1, data + 8) if n != data],
        "EN_R": ["true"],
        "dialect": [d for d in ("baosky", "s7-1500", "s7-1200") if d != dialect],
    }
    asked = random.choice(asks[question])
    parts = receiver("TRCV_C", data, pins(EN_R=question != "EN_R", CONT=True, LEN=length, ADHOC=is_ad_hoc))
    lengths = (message,) if random.random() < 0.7 else (message, message - 3, message + 2)
    calls = random.random() < 0.25
    peer = (LISTENS if calls else PEER) + says(random, *lengths, every=random.choice([70, 100, 150]))
    steps = acts(random, message, 3, STREAM_ENDS[: 2 if calls else 4])
    text = scenario(dialect, CALLS if calls else TCP, parts, peer, steps)
    if question == "dialect":
        return Case(kind, text, (), str(asked))
    path = "data.rx.type" if question == "DATA" else f"instance.R.{question}"
    return Case(kind, text, (f"{path}={asked}",))


def intervals(was: int, asked: int, every: int, random: Random) -> Case:
    """Both runs listen before the partner comes: a client that is refused would come another time."""
    message = random.choice([8, 10, 20])
    parts = receiver("TRCV_C", message, pins(EN_R=True, CONT=True, ADHOC=random.random() < 0.3))
    peer = 'active = true\nremote = "@C1"\n' + says(random, message, every=every, cut=False)
    ends = random.choice([["run T#100ms"], ["peer P1 close"], ["peer P1 rst"]])
    steps = ["run T#500ms", "peer P1 connect", *acts(random, message, 2), *ends, "run T#500ms"]
    text = scenario("baosky", TCP, parts, peer, steps, was)
    return Case(f"{was} ms/{every}", text, (f"task.MAIN.interval=T#{asked}ms",), interval=was)


def late_en_r(random: Random) -> Case:
    """EN_R comes late, by the program; or it never does, and is asked for."""
    message, is_asked = random.choice([8, 20, 33]), random.random() < 0.5
    data = message + random.choice([-4, 0, 2])
    parts = receiver("TRCV_C", data, pins(CONT=True, **({"EN_R": False} if is_asked else {})))
    late = ["run T#400ms", "set R EN_R=1"], ["set R EN_R=0", "run T#400ms", "set R EN_R=1"]
    begins, drops = ([], []) if is_asked else late
    ends = random.choice([[], ["peer P1 close"], ["peer P1 rst"]])
    steps = [*begins, *acts(random, message, 2), *ends, *drops, "run T#1s"]
    peer = PEER + says(random, message, every=random.choice([100, 150]))
    asks = ["instance.R.EN_R=true"] if is_asked else [f"instance.R.LEN={data - 2}", "instance.R.ADHOC=true"]
    return Case("late EN_R", scenario("baosky", TCP, parts, peer, steps), (random.choice(asks),))


def duplex(random: Random) -> Case:
    """A sender and a receiver on one CONNECT; some partners answer what comes."""
    message, data = random.choice([8, 20]), random.choice([7, 16, 22])
    replies = f"replies = ['contains hex 00 send random {message} seed=3']\n" if random.random() < 0.4 else ""
    peer = PEER + replies + says(random, message, every=100)
    sends = [s for n in range(3) for s in ("run T#300ms", f"write tx hex {n:02X} {n + 1:02X}", "pulse S REQ")]
    asks = [f"instance.R.LEN={data - 2}", "instance.R.ADHOC=true", f"data.rx.type={array(data + 4)}"]
    asks += ["instance.S.LEN=6"] if random.random() < 0.4 else []
    parts = sender(8) + receiver("TRCV_C", data, pins(EN_R=True, CONT=True))
    steps = [*sends, *acts(random, message, 2, STREAM_ENDS[:2])]
    text = scenario(random.choice(["baosky", "baosky", "s7-1500"]), TCP, parts, peer, steps)
    return Case("duplex", text, (random.choice(asks),))


def whole_messages(kind: str, random: Random) -> Case:
    """ISO-on-TCP and UDP: a job takes a message, whatever its length."""
    message, is_late, is_small = random.choice([8, 16, 40]), random.random() < 0.4, random.random() < 0.5
    data = message - 3 if is_small else message + 2
    dialect = random.choice(["baosky", "s7-1500"]) if kind == "UDP" else "s7-1500"
    if kind == "UDP":
        connect, own, peer = "", udp_receiver(data, dialect, EN_R=not is_late), 'udp = true\nremote = "@U1"\n'
    else:
        connect, own, peer = ISO, receiver("TRCV_C", data, pins(EN_R=not is_late, CONT=True)), ISO_PEER
    peer += says(random, message, message - 5, every=random.choice([50, 90]), cut=False)
    steps = acts(random, message, 3, () if kind == "UDP" else STREAM_ENDS[:2])
    asked = f"data.rx.type={array(message)}" if is_small else f"instance.R.LEN={message - 4}"
    asked = "instance.R.EN_R=true" if is_late else asked
    return Case(kind, scenario(dialect, connect, own, peer, steps), (asked,))


B, S7 = ("baosky",), ("s7-1500", "s7-1200")
# recorded interval, asked one, how often the partner speaks: at multiples of both, of one, of none
TIMES = (10, 50, 100), (10, 20, 60), (10, 100, 200), (20, 100, 300), (10, 50, 30), (10, 100, 70), (10, 20, 33)
KINDS: tuple[tuple[int, Callable[[Random], Case]], ...] = (
    (9, partial(stream, "static", ("LEN",), B)),
    (9, partial(stream, "ad hoc", ("ADHOC",), B)),
    (8, partial(stream, "DATA", ("DATA",), B)),
    (4, partial(stream, "s7", ("LEN", "ADHOC", "DATA", "EN_R"), S7)),
    (4, partial(stream, "dialect", ("dialect",), B + S7)),
    *((1, partial(intervals, *times)) for times in (*TIMES, (50, 10, 30))),
    (6, late_en_r),
    (4, duplex),
    (4, partial(whole_messages, "ISO")),
    (4, partial(whole_messages, "UDP")),
)


def cases() -> Iterator[Case]:
    each = [make for count, make in KINDS for _ in range(count)]
    for number, make in enumerate(each):
        yield make(Random(f"case {number}"))
