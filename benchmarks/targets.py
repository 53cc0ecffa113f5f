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
    message_curve,
    message_rows,
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

    `case` is a pattern. `before`: what was reached before, on a machine of this kind. `in_the_way`: one line
    on what stands in the way and what was tried; the page has it where the aim is missed.
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


# "Before" is what stood on the page before the fast lane, records.py and the aims of then were taken out.
PAINT: Final = (
    "a picture takes 25 to 30 ms of processor time, half of it Textual's compositor, and a key waits for it"
)

TARGETS: Final = (
    Target("M1", "free-running engine against a bare recv_into loop", throughput.measure, (
        Aim("1 x 64 KiB", ">= 0.3", "0.75"),
        Aim("16 x 64 KiB", ">= 0.3", "0.87"),
        Aim("64 x 64 KiB", ">= 0.3", "0.77"),
        Aim("64 x 256 B", "", "0.86"),
    )),
    Target("M2", "one DONE in two scans at T#10ms; no overrun by the engine", busy.measure, (
        Aim("256 x 64 KiB in step: DONE / ceiling", "", "0.968"),
        Aim("256 x 64 KiB in turn: DONE / ceiling", "", "1.000"),
        Aim("256 x 64 KiB in *: overruns", ""),
        Aim("*: overruns", "<= 0", "3 beside the screen"),
        Aim("frames that came back wrong", "<= 0", "0"),
        Aim("the 33rd: refused / attempts", ">= 1", "1"),
        Aim("64 busy blocks: *", ">= 0.99", "1.000"),
        Aim("DONE of the 32 *", ">= 0.99", "0.999"),
    )),
    Target("M3", "1000 idle instances cost little of a 1 ms scan, trace unchanged", growth.idle, (
        Aim("1000 idle / a 1 ms scan", "<= 0.1", "0.0024"),
    )),
    Target("M4", "start lateness beside the screen against cyclictest beside it", lateness.measure, (
        Aim("* SCHED_OTHER, T#10ms", "<= 1.0", "0.5"),
        Aim("overruns, T#10ms", "<= 0 %", "0"),
        Aim("*", ""),
    )),
    Target("M5", "key to paint; the screen's share of a core", key_paint.measure, (
        Aim("key to paint p50, 8 *", "<= 25 ms", "", PAINT),
        Aim("key to paint p99, 8 *", "<= 60 ms", "", PAINT),
        Aim("key to paint p99, 256 *", "<= 150 ms", "74 ms", PAINT),
        Aim("key to paint p50, 256 *", "", "31 ms"),
    )),
    Target("M6", "a page at the far end as quick as one at the head", hex_view.measure, (
        Aim("private memory of *", "<= 5 MB", "0.0 MB"),
        Aim("* of 1 GiB / 64 KiB*", "<= 1.1", "1.00 to 1.02"),
    )),
    Target("M7", "hex export identical to hexdump -v -C", hex_export.measure, (
        Aim("same text as hexdump -v -C, 2 MiB", ">= 1 (yes)", "yes"),
        Aim("export / *", "", "2.19 of xxd, 15.3 of hexdump"),
    )),
    Target("M8", "UDT decode 20 times as quick as construct; a large type in a second", udt_decode.measure, (
        Aim("decode / construct", ">= 20", "101.8"),
        Aim("udt show of 65535 *: processor time", "<= 1 s"),
        Aim("udt *: peak memory", "<= 256 MiB", "13 to 21 MiB"),
    )),
    Target("M9", "how long you wait for the first screen, and for a command", start_up.measure, (
        Aim("first full screen / empty Textual app", "<= 3.0", "2.26"),
        Aim("trcvtui status / python -c pass", "<= 10", "6.22"),
        Aim("trcvtui udt show / python -c pass", "<= 10", "3.28"),
        Aim("trcvtui conversations / python -c pass", "<= 10", "3.6"),
        Aim("trcvtui scenario / python -c pass", "<= 20", "9.58"),
    )),
    Target("M10", "a ledger event against a timestamp; the journal", ledger_cost.measure, (
        Aim("journal, events a second", ">= 0.3 M", "1.02 M"),
    )),
    Target("M11", "in an attack 8 good connections lose < 5 % of DONEs; no overrun", attacked.measure, (
        Aim("*: DONE beside / alone", ">= 0.95", "0.997 to 1.003"),
        Aim("*: overruns", "<= 0", "0"),
    )),
    Target("M12", "10,000 messages: key to paint in the table, a picture of a curve", message_curve.measure, (
        Aim("key to paint in the table p50", "<= 30 ms", "16 ms", PAINT),
        Aim("key to paint in the table p99", "<= 80 ms", "", PAINT),
        Aim("a picture of a curve p50", "<= 10 ms", "4 ms"),
        Aim("a picture of a curve p99", ""),
    )),
    Target("R1", "a run on record scans nearly as quickly, and all of it is kept", recording_on.measure, (
        Aim("scan p99, recorded / not recorded", "<= 1.7", "1.37"),
        Aim("DONEs that the file has not", "<= 0", "0"),
        Aim("the highest rate that is kept, MB/s", "", "77"),
    )),
    # R2 to R6: at most 1.3 times what was measured before.
    Target("R2", "a recording runs again", replayed.measure_speed, (
        Aim("replay / the simulated run, speed", ">= 0.56", "0.73"),
    )),
    Target("R3", "a screen goes to any scan of a recording in a second", replayed.measure, (
        Aim("opening, s", "<= 0.04", "0.03"),
        Aim("to any scan that was seen, s: the longest", "<= 0.92", "0.71"),
    )),
    Target("R4", "a capture is read and reassembled nearly as quickly as dpkt reads it", captures.measure, (
        Aim("pcapng: reading and reassembly / dpkt's bare reader", ">= 1.01", "1.32"),
        Aim("pcap: reading and reassembly / dpkt's bare reader", ">= 0.75", "0.97"),
        Aim("a capture of 1 GiB: peak memory", "<= 256 MiB", "21 MiB"),
    )),
    Target("R5", "a tap costs what socat costs, and its recording keeps up", tapped.measure, (
        Aim("round trip of 64 bytes / through socat, p*", "<= 1.38", "1.06"),
        Aim("one stream / socat -b 65536", ">= 0.89", "1.16"),
        Aim("recorded, nothing left out, MB/s", ">= 115", "150"),
    )),
    Target("R6", "a line of 200 conversations is watched live on a core", live_line.measure, (
        Aim("reading and shadows, of one core", "<= 0.86", "0.66"),
        Aim("messages lost", "<= 0", "0"),
        Aim("a packet is shown after, ms: the longest", "<= 66", "51"),
    )),
    Target("R7", "the doctor judges 1 GiB of captures in 18 s on two cores", captures.measure_doctor, (
        Aim("1 GiB of captures, --jobs 2", "<= 18 s", "13 s"),
        Aim("peak memory of a process", "<= 200 MiB", "120 MiB"),
    )),
    Target("R8", "100,000 messages of a capture become csv nearly as if by hand", message_rows.measure, (
        Aim("messages --udt to csv / struct and csv by hand", "<= 6", "7.9"),
        Aim("messages --udt: peak memory", "<= 64 MiB"),
    )),
    Target("F1", "1,000 lines of 20 agents on one Mosquitto and one screen", fleet_load.measure, (
        Aim("first list of 1000 lines", "<= 3 s"),
        Aim("first list of 10000 lines", "", "2.63 s"),
    )),
    Target("growth", "cost depends on what is busy, not on how much exists", growth.measure, (
        Aim("*", ""),
    )),
)  # fmt: skip
