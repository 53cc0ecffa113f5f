"""Sixty random cases, the same each time: a small PLC, a partner that speaks by itself, and one question.

Intervals of both runs divide all times at which the scenario acts. No question is for a pin that it writes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from random import Random

from tests.rig.truth.runs import Case

LOCAL = 'LocalAddress = "127.0.0.1"\n'
TCP = f"ActiveEstablished = false\n{LOCAL}LocalPort = 0\n"
CALLS = f'ActiveEstablished = true\n{LOCAL}RemoteAddress = "127.0.0.1"\nRemotePort = "@P1"\n'
ISO = 'type = "TCON_IP_RFC"\nLocalTSelector = "E0.02"\nRemoteTSelector = "E0.01"\nIsoPort = 0\n'
ISO += "ActiveEstablished = false\n"
PEER = 'active = true\nremote = "@C1"\nreconnect = "T#100ms"\n'
ISO_PEER = f'iso = true\nlocal_tsap = "E0.01"\nremote_tsap = "E0.02"\n{PEER}'
LISTENS = 'active = false\nlocal = "127.0.0.1:0"\n'
SOURCE = f'[[addr]]\nname = "SOURCE"\n[[udp_config]]\nname = "U1"\n{LOCAL}LocalPort = 0\n'


def array(size: int) -> str:
    return f"ARRAY[0..{size - 1}] OF BYTE"


def pins(**inputs: object) -> str:
    return "".join(f"{name} = {str(value).lower()}\n" for name, value in inputs.items() if value is not None)


def receiver(block: str, data: int, inputs: str, on: str = 'connect = "C1"\n') -> str:
    return (
        f'[[data]]\nname = "rx"\ntype = "{array(data)}"\n'
        f'[[instance]]\nname = "R"\nblock = "{block}"\n{on}data = "rx"\n{inputs}'
    )


def scenario(dialect: str, connect: str, parts: str, peer: str, steps: list[str], interval: int = 10) -> str:
    connect = f'[[connect]]\nname = "C1"\n{connect}' if connect else ""
    return (
        f'dialect = "{dialect}"\n[[task]]\nname = "MAIN"\ninterval = "T#{interval}ms"\n{connect}{parts}'
        f'[[peer]]\nname = "P1"\n{peer}[scenario]\nsteps = """\n{chr(10).join(steps)}\n"""\n'
    )


def says(random: Random, *lengths: int, every: int, cut: bool = True) -> str:
    """Return what the partner says by itself: messages of these lengths in turn, some of them in pieces."""
    options = [
        f" split={random.randint(1, max(1, n - 1))} gap=T#20ms" if cut and random.random() < 0.3 else ""
        for n in lengths
    ]
    told = [f'"random {n} seed={n}{option}"' for n, option in zip(lengths, options, strict=True)]
    return f'says = [{", ".join(told)}]\nevery = "T#{every}ms"\n'


def acts(random: Random, length: int, count: int, instance: str = "R", stream: bool = True) -> list[str]:
    """Return steps: what the partner and the PLC's program do, each at a multiple of 100 ms."""
    of_streams = [
        "peer P1 close",
        "peer P1 rst",
        f"pulse {instance} COM_RST",
        "link C1 down\nrun T#200ms\nlink C1 up",
    ]
    may = [f"peer P1 send random {n} seed={n}" for n in (length, length - 1, 3 * length + 2)]
    may += of_streams if stream else []
    steps = ["run T#500ms"]
    for _ in range(count):
        steps += [random.choice(may), f"run T#{100 * random.randint(2, 8)}ms"]
    return [*steps, "run T#500ms"]


def near(random: Random, length: int) -> int:
    """Return a length that is a little too small, too large, or right."""
    return max(1, length + random.choice([-7, -4, -1, 0, 2, 4, 9]))


def stream(random: Random, question: str, dialect: str = "baosky") -> tuple[str, str]:
    """Return a TRCV_C with a partner and a question about it."""
    message, is_ad_hoc = random.choice([8, 12, 20, 33]), random.random() < 0.5
    data = near(random, message) if random.random() < 0.6 else message + 20
    length = (
        random.choice([0, min(data, message), min(data, near(random, message))]) if question != "DATA" else 0
    )
    now = {"LEN": length, "ADHOC": is_ad_hoc}
    other = random.choice(
        [n for n in (message, data, data + 5, max(1, message - 4)) if n != (length or data)]
    )
    sizes = [n for n in (message, message + 1, data + 8) if n != data]
    asks = {
        "LEN": f"instance.R.LEN={other}",
        "ADHOC": f"instance.R.ADHOC={str(not is_ad_hoc).lower()}",
        "DATA": f"data.rx.type={array(random.choice(sizes))}",
        "EN_R": "instance.R.EN_R=true",
    }
    parts = receiver("TRCV_C", data, pins(EN_R=question != "EN_R", CONT=True, **now))
    every = random.choice([70, 100, 150])
    lengths = (message,) if random.random() < 0.7 else (message, max(1, message - 3), message + 2)
    calls = random.random() < 0.25
    peer = (LISTENS if calls else PEER) + says(random, *lengths, every=every)
    few = [step for step in acts(random, message, random.randint(0, 3)) if not (calls and "COM_RST" in step)]
    return scenario(dialect, CALLS if calls else TCP, parts, peer, few), asks[question]


def intervals(was: int, asked: int, every: int, random: Random) -> Case:
    """Both runs listen before the partner comes: a client that is refused would come another time."""
    message = random.choice([8, 10, 20])
    parts = receiver("TRCV_C", message, pins(EN_R=True, CONT=True, ADHOC=random.random() < 0.3))
    peer = 'active = true\nremote = "@C1"\n' + says(random, message, every=every, cut=False)
    steps = ["run T#500ms", "peer P1 connect", *acts(random, message, random.randint(0, 2), stream=False)]
    ends = random.choice([[], ["peer P1 close"], ["peer P1 rst"]])
    text = scenario("baosky", TCP, parts, peer, [*steps, *ends, "run T#500ms"], was)
    return Case(f"{was} ms/{every}", text, (f"task.MAIN.interval=T#{asked}ms",), interval=was)


def late_en_r(random: Random) -> Case:
    """EN_R comes late, by the program; or it never does, and is asked for."""
    message = random.choice([8, 20, 33])
    is_asked, data = random.random() < 0.5, near(random, message)
    parts = receiver("TRCV_C", data, pins(CONT=True, EN_R=None if not is_asked else False))
    late = [] if is_asked else [f"run T#{100 * random.randint(3, 12)}ms", "set R EN_R=1"]
    dropped = [] if is_asked else ["set R EN_R=0", "run T#400ms", "set R EN_R=1"]
    ends = random.choice([[], ["peer P1 close"], ["peer P1 rst"]])
    steps = [*late, *acts(random, message, 1, stream=False), *ends, *dropped, "run T#1s"]
    peer = PEER + says(random, message, every=random.choice([100, 150]))
    own = random.choice([f"instance.R.LEN={min(data, message) - 2}", "instance.R.ADHOC=true"])
    asked = "instance.R.EN_R=true" if is_asked else own
    return Case("late EN_R", scenario("baosky", TCP, parts, peer, steps), (asked,))


def duplex(random: Random) -> Case:
    """A sender and a receiver on one CONNECT; the partner answers what comes."""
    dialect = random.choice(["baosky", "baosky", "s7-1500"])
    message, sent = random.choice([8, 20]), random.choice([4, 16])
    data = near(random, message)
    tx = f'[[data]]\nname = "tx"\ntype = "{array(sent)}"\n[[instance]]\nname = "S"\nblock = "TSEND_C"\n'
    tx += 'connect = "C1"\ndata = "tx"\nCONT = true\n'
    parts = tx + receiver("TRCV_C", data, pins(EN_R=True, CONT=True))
    replies = f"replies = ['regex \".\" send random {message} seed=3']\n" if random.random() < 0.4 else ""
    peer = PEER + replies + says(random, message, every=100)
    steps = [s for n in range(3) for s in ("run T#300ms", f"write tx hex {n:02X} {n + 1:02X}", "pulse S REQ")]
    asked = [
        f"instance.R.LEN={min(data, message) - 2}",
        "instance.R.ADHOC=true",
        f"data.rx.type={array(message)}",
    ]
    if data == message:
        asked[-1] = f"data.rx.type={array(message + 4)}"
    asked += [f"instance.S.LEN={sent - 2}"] if random.random() < 0.3 else []
    return Case(
        "duplex",
        scenario(dialect, TCP, parts, peer, [*steps, *acts(random, message, 1, "S")]),
        (random.choice(asked),),
    )


def iso(random: Random) -> Case:
    message = random.choice([8, 16, 40])
    data = random.choice([message, message - 3, message - 2])
    peer = ISO_PEER + says(random, message, max(1, message - 5), every=random.choice([80, 130]), cut=False)
    asked = random.choice(
        [
            f"data.rx.type={array(data + 3)}",
            f"instance.R.LEN={min(data, message) - 2}",
            "instance.R.EN_R=true",
        ]
    )
    parts = receiver("TRCV_C", data, pins(EN_R="EN_R" not in asked, CONT=True))
    return Case(
        "ISO", scenario("s7-1500", ISO, parts, peer, acts(random, message, random.randint(0, 2))), (asked,)
    )


def udp(random: Random) -> Case:
    is_baosky = random.random() < 0.5
    message = random.choice([8, 20])
    data = random.choice([message, message - 3, message + 6])
    on = 'config = "U1"\naddr = "SOURCE"\n'
    held = pins(EN_R=random.random() < 0.7, CONT=True if is_baosky else None)
    parts = SOURCE + receiver("URECV_C" if is_baosky else "TURCV", data, held, on)
    peer = 'udp = true\nremote = "@U1"\n' + says(
        random, message, max(1, message - 5), every=random.choice([50, 90]), cut=False
    )
    asked = random.choice([f"data.rx.type={array(data + 3)}", f"instance.R.LEN={min(data, message) - 2}"])
    asked = asked if "EN_R = true" in held else "instance.R.EN_R=true"
    steps = acts(random, message, 2, stream=False)
    return Case("UDP", scenario("baosky" if is_baosky else "s7-1500", "", parts, peer, steps), (asked,))


def of_streams(kind: str, question: str, dialect: str = "baosky") -> Callable[[Random], Case]:
    def make(random: Random) -> Case:
        text, asked = stream(random, question, dialect)
        return Case(kind, text, (asked,))

    return make


def siemens(random: Random) -> Case:
    dialect = random.choice(["s7-1500", "s7-1200"])
    text, asked = stream(random, random.choice(["LEN", "ADHOC", "DATA", "EN_R"]), dialect)
    return Case(dialect, text, (asked,))


def dialects(random: Random) -> Case:
    was, asked = random.choice(
        [("s7-1500", "s7-1200"), ("baosky", "s7-1500"), ("s7-1200", "baosky"), ("baosky", "s7-1200")]
    )
    text, _ = stream(random, "LEN", was)
    return Case("dialect", text, (), asked)


# recorded interval, asked one, how often the partner speaks: at multiples of both, of one, of none
TIMES = [
    (10, 50, 100),
    (10, 20, 60),
    (10, 100, 200),
    (20, 100, 300),
    (10, 50, 30),
    (10, 100, 70),
    (10, 20, 33),
    (50, 10, 30),
]
KINDS: tuple[Callable[[Random], Case], ...] = (
    *[of_streams("static", "LEN")] * 9,
    *[of_streams("ad hoc", "ADHOC")] * 9,
    *[of_streams("DATA", "DATA")] * 8,
    *[partial(intervals, *times) for times in TIMES],
    *[late_en_r] * 6,
    *[duplex] * 5,
    *[iso] * 4,
    *[udp] * 4,
    *[siemens] * 4,
    *[dialects] * 3,
)


def cases() -> Iterator[Case]:
    for number, make in enumerate(KINDS):
        yield make(Random(f"case {number}"))
