"""The targets in words, what measures each, and what is aimed at in each case."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Final

from benchmarks import (
    attacked,
    busy,
    captures,
    fleet_load,
    growth,
    hex_export,
    hex_view,
    key_paint,
    lateness,
    ledger_cost,
    live_line,
    recording_on,
    replayed,
    start_up,
    tapped,
    throughput,
    udt_decode,
)
from benchmarks.figures import Effort, Figure

COMPARE: Final = {">=": operator.ge, "<=": operator.le}
AIM: Final = re.compile(r"(>=|<=) ([\d.]+)")


@dataclass(frozen=True, slots=True)
class Aim:
    """What is aimed at: `text` is a sign and a number in the figure's unit, or "" for no aim.

    `case` is a pattern. `before`: what was reached before the work on speed. `in_the_way`: one line on what
    stands in the way and what was tried; the page has it where the aim is missed.
    """

    case: str
    text: str
    before: str = ""
    in_the_way: str = ""

    def verdict(self, figure: Figure) -> str:
        """Return `reached`, `not reached` or `machine limit`; "" where nothing is held against anything."""
        found = AIM.match(self.text)
        if found is None or figure.number is None:
            return ""
        if COMPARE[found[1]](figure.number, float(found[2])):
            return "reached"
        return "machine limit" if figure.at_limit else "not reached"


@dataclass(frozen=True, slots=True)
class Target:
    """One target: its name, what it promises, what measures it, and the aims of its cases."""

    name: str
    promise: str
    measure: Callable[[Effort], Iterator[Figure]]
    aims: tuple[Aim, ...]


def aim_of(target: Target, figure: Figure) -> Aim | None:
    """Return the first aim whose pattern has the figure's case."""
    return next((aim for aim in target.aims if fnmatchcase(figure.case, aim.case)), None)


# More than one row has these in its way.
FLOOR: Final = "two scans and five events for each DONE, in pure Python without the engine: {}"
KERNEL: Final = (
    "a kernel without preemption and two cores: an engine under SCHED_FIFO itself reaches 162 to 303 us; "
    "affinity, a session of its own, nice 19 and SCHED_IDLE for the screen gained nothing"
)

READERS: Final = (
    "the readers of the ledger (waves, history, statistics) still take 2 to 2.5 ms for 640 lines in the gap; "
    "half of what they took; a picture of 256 busy instances is collected in 4 ms"
)
PICTURE: Final = (
    "the screen that has just been written to has the processor when the scan is due; writing in smaller "
    "parts and pictures at most ten times a second below T#5ms were tried"
)
PAINT: Final = (
    "a picture costs the screen 25 to 30 ms of processor time, half of it Textual's compositor, and a key "
    "waits for the one that is under way; letting keys go before pictures was tried and made the panes late"
)

TARGETS: Final = (
    Target("M1", "free-running engine against a bare recv_into loop", throughput.measure, (
        Aim("1 x 64 KiB", ">= 0.58", "0.49", FLOOR.format("0.59")),
        Aim("16 x 64 KiB", ">= 0.80", "0.53", FLOOR.format("0.79 to 0.88")),
        Aim("64 x 64 KiB", ">= 0.85", "0.61", FLOOR.format("0.90 to 0.92")),
        Aim("64 x 256 B", ">= 0.60", "0.20", FLOOR.format("0.70 to 0.76")),
    )),
    Target("M2", "one DONE in two scans at T#10ms; no overrun by the engine", busy.measure, (
        Aim("256 x 64 KiB in step: DONE / ceiling", ">= 0.95", "0.64",
            "every other scan has all frames: the bare calls alone take half of it and more, see the note"),
        Aim("256 x 64 KiB in step: overruns", ""),
        Aim("256 x 64 KiB in turn: DONE / ceiling", ">= 0.99", "0.49", READERS),
        Aim("256 x 64 KiB in turn: overruns", "<= 0", "half of the scans", READERS),
        Aim("*: overruns", "<= 0", "", READERS),
        Aim("frames that came back wrong", "<= 0", "0"),
        Aim("the 33rd: refused / attempts", ">= 1", "1"),
        Aim("64 busy blocks: *", ">= 0.99", "1.000"),
        Aim("DONE of the 32 *", ">= 0.99", "1.001"),
    )),
    Target("M3", "1000 idle instances cost next to nothing of a 1 ms scan, trace unchanged", growth.idle, (
        Aim("1000 idle / a 1 ms scan", "<= 0.003", "0.0035 to 0.006",
            "2.7 us in good minutes, of which the kernel's poll is 0.8 and two clocks 0.3; 4 us in bad ones"),
    )),
    Target("M4", "start lateness beside the screen against cyclictest beside it", lateness.measure, (
        Aim("* SCHED_OTHER, T#10ms", "<= 0.5", "0.2 to 0.7", PICTURE),
        Aim("* SCHED_FIFO, T#10ms", "<= 2.5", "3.3", KERNEL),
        Aim("* SCHED_OTHER, T#1ms", "<= 1.5", "2 to 5", PICTURE),
        Aim("* SCHED_FIFO, T#1ms", "<= 5", "17", KERNEL),
        Aim("overruns, T#10ms", "<= 0 %", "0", PICTURE),
        Aim("overruns, T#1ms", "<= 0.5 %", "1.9 %", PICTURE),
        Aim("scans late because of a picture, *", "<= 0", "1.4 to 2.1 % at 1 ms", PICTURE),
    )),
    Target("M5", "key to paint with 256 instances; the screen's share of a core", key_paint.measure, (
        Aim("key to paint p50, *", "<= 20 ms", "38 to 63 ms", PAINT),
        Aim("key to paint p99, *", "<= 60 ms", "231 to 1425 ms", PAINT),
        Aim("longest collector pause while keys come, *", "<= 5 ms", "37 to 181 ms",
            "2,000 young objects are looked at in 1 to 2 ms; longer ones waited for the processor"),
        Aim("screen's share of a core, *", "<= 0.3", "0.22 to 0.32", PAINT),
    )),
    Target("M6", "hex view of 1 GiB as fast as of 64 KiB", hex_view.measure, (
        Aim("private memory of *", "<= 5 MB", "0.0 MB"),
        Aim("* of 1 GiB / 64 KiB*", "<= 1.1", "1.00 to 1.02"),
    )),
    Target("M7", "hex export identical to hexdump -v -C, quicker than xxd", hex_export.measure, (
        Aim("same text as hexdump -v -C, 2 MiB", ">= 1 (yes)", "yes"),
        Aim("export / xxd", ">= 1.9", "1.2 to 1.7",
            "writing takes a third of the time and is the same for both; a writer thread gained nothing"),
        Aim("export / hexdump -v -C", ">= 20", "11.2",
            "half is hexlify, a third the strided copies; a thread and a second process gained nothing"),
    )),
    Target("M8", "UDT decode as quick as struct.Struct, 50 times as quick as construct", udt_decode.measure, (
        Aim("decode / struct.Struct", "<= 1.1", "1.02"),
        Aim("decode / construct", ">= 50", "94"),
        Aim("a page of a large UDT / of a small one", "<= 1.2", "0.99"),
        Aim("udt *: processor time", "<= 3 s", "2.3 to 5.0 s",
            "1.9 us a leaf: paths of members are a third, the columns or the quotes another"),
        Aim("udt *: peak memory", "<= 256 MiB"),
    )),
    Target("M9", "how long a person waits for the first screen, and for a command", start_up.measure, (
        Aim("first full screen / empty Textual app", "<= 2.0", "2.8",
            "style sheet, mounting and the first paint are as long as all imports of ours"),
        Aim("trcvtui status / python -c pass", "<= 10", "8 to 11"),
        Aim("trcvtui udt show / python -c pass", "<= 3", "5.6",
            "re, enum and typing of the library take most of it"),
        Aim("trcvtui scenario / python -c pass", "<= 8", "20 to 28",
            "150 modules of ours with 41 regular expressions and 30 enums; records cost a third of before"),
    )),
    Target("M10", "a ledger event against a timestamp; the journal", ledger_cost.measure, (
        Aim("ledger event with its making, flat / a timestamp", "<= 3.5", "8.6"),
        Aim("journal, events a second", ">= 1 M", "not there",
            "reading blocks alone 1.6 M, the file with its packets 0.8 M; each entry goes through both"),
    )),
    Target("M11", "beside one attack 8 good connections lose < 5 % of DONEs; no overrun", attacked.measure, (
        Aim("*: DONE beside / alone", ">= 0.95"),
        Aim("*: overruns", "<= 0", "",
            "attacker, senders and engine share two cores; the work of a scan is bounded: p99 3 to 9 ms"),
    )),
    Target("R1", "a run on record scans as quickly, and all of it is kept", recording_on.measure, (
        Aim("scan p99, recorded / not recorded", "<= 1.05"),
        Aim("DONEs that the file has not", "<= 0"),
        Aim("the highest rate that is kept, MB/s", ""),
    )),
    Target("R2", "a recording runs again as quickly as the simulated run", replayed.measure_speed, (
        Aim("replay / the simulated run, speed", ">= 0.8"),
    )),
    Target("R3", "a screen goes to any scan of a recording in a second", replayed.measure, (
        Aim("opening, s", "<= 2"),
        Aim("to any scan that was seen, s: the longest", "<= 1", "",
            "a keyframe each 2,000 scans, taken while it is seen once in the background: 0.2 ms a scan"),
    )),
    Target("R4", "a capture is read and put together as quickly as dpkt reads it", captures.measure, (
        Aim("*: reading and reassembly / dpkt's bare reader", ">= 1", "",
            "dpkt's reader of classic pcap is two slices a packet; ours parses and joins it besides in 3 us"),
        Aim("a capture of 1 GiB: peak memory", "<= 256 MiB"),
    )),
    Target("R5", "a tap costs what socat costs, and its recording keeps up", tapped.measure, (
        Aim("round trip of 64 bytes / through socat, p50", "<= 1.2"),
        Aim("round trip of 64 bytes / through socat, p99", "<= 1.5"),
        Aim("one stream / socat -b 65536", ">= 0.8"),
        Aim("recorded, nothing left out, MB/s", ">= 100"),
    )),
    Target("R6", "a line of 200 conversations is watched live on a core", live_line.measure, (
        Aim("reading and shadows, of one core", "<= 0.8"),
        Aim("messages lost", "<= 0"),
        Aim("a packet is shown after, ms: the longest", "<= 100"),
    )),
    Target("R7", "the doctor judges 1 GiB of captures in 18 s on two cores", captures.measure_doctor, (
        Aim("1 GiB of captures, --jobs 2", "<= 18 s"),
        Aim("peak memory of a process", "<= 200 MiB"),
    )),
    Target("F1", "10,000 lines of 200 agents on one Mosquitto and one screen", fleet_load.measure, (
        Aim("first list of 10,000 lines", "<= 3 s"),
        Aim("key to paint p99", "<= 100 ms"),
        Aim("an agent's publishing for 50 lines, of a core", "<= 2 %"),
    )),
    Target("growth", "what costs, costs by what is busy, not by what is there", growth.measure, (
        Aim("* 1 busy of 1000 / 1 busy of 1", "<= 1.2", "1.2",
            "the walk over all names for the tuples of a snapshot; what crosses to the screen is by change"),
        Aim("build of one instance, *", "", "2.9"),
        Aim("memory: second half of a simulated day", "<= 1 MB", "0.2 MB in 14 minutes"),
    )),
)  # fmt: skip

# Profiles in words; the shares are those of a run under cProfile, which makes calls dearer than they are.
WHERE_THE_TIME_GOES: Final = """The scan at 64 x 64 KiB: six tenths are recv_into, which is the kernel's copy.
A tenth each is the lane of the steady blocks (looking whether its inputs stand, job states, ledger items) and
the call order that asks who is awake; a twentieth each is handing over the finished buffer, and the poll with
the list of ready connections. At 64 x 256 B recv_into is a seventh, lane and call order are two fifths.

A key press at 256 instances (sampled): while keys come, the screen takes half of a core. Of that, 45 parts
of a hundred are Textual's compositor and its style cache, 25 our panes that look for rows that differ (a
quarter of these the waves), 12 unpickling and taking the picture, 5 the collector at rest; the key itself,
from `obey` to the last pane, 4. So a key waits for the picture that is under way, not for its own work."""
