"""The 32 connections of a T4, all busy both ways at T#10ms beside the real screen, and a 33rd CONNECT.

The 33rd asks again and again in every other window: the others are compared with the windows without it.
"""

from __future__ import annotations

import re
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, ratios, spread
from benchmarks.partners import FRAME, Partners, partners
from benchmarks.scans import Scans, overruns
from benchmarks.terminal import TRCVTUI, Terminal
from trcvtui.clock import now_ns
from trcvtui.engine.engine import TIMING_FILE

CONNECTIONS: Final = 32
INTERVAL_NS: Final = 10_000_000
SCANS_PER_DONE: Final = 2  # of TRCV_C 7006 7008, of TSEND_C 7005 7009
PAIR_S: Final = 10  # a window without and a window beside the 33rd
FIRST_PICTURE: Final = ("T33",)
ALL_BUSY_S: Final = 20.0
ERRORS: Final = re.compile(rb"(\d+) errors?")


@dataclass(frozen=True, slots=True)
class Window:
    """What the partners saw in it: DONE of each TRCV_C and TSEND_C; and what the screen said of T33."""

    began: int
    ended: int
    received: tuple[int, ...]
    sent: tuple[int, ...]
    wrong: int
    refused: int

    @property
    def seconds(self) -> float:
        """Return how long it was."""
        return (self.ended - self.began) / 1e9

    def shares(self, scans: Scans) -> list[float]:
        """Return DONE of each block / the ceiling in the scans that have passed: one DONE in two."""
        ceiling = len(scans.between(self.began, self.ended).scans) / SCANS_PER_DONE
        return [done / ceiling for done in (*self.received, *self.sent)]


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield overruns, lateness and DONE a second, and what the 33rd gets and does to the others."""
    with tempfile.TemporaryDirectory() as folder, partners(CONNECTIONS + 1) as others:
        timing = Path(folder) / "timing.json"
        (Path(folder) / "bench.toml").write_text(project(others.ports))
        command = [str(TRCVTUI), "run", str(Path(folder) / "bench.toml")]
        with Terminal(command, {TIMING_FILE: str(timing)}) as terminal:
            try:
                terminal.wait_for(FIRST_PICTURE)
                _all_busy(terminal, others)
            except TimeoutError as failed:
                yield Figure.missing(f"{CONNECTIONS} busy connections", f"not busy: {failed}")
                return
            began = now_ns()
            pairs = _pairs(terminal, others, effort.minute_s)
            ended = now_ns()
            terminal.end("q")
        scans = Scans.read(timing, INTERVAL_NS).between(began, ended)
    yield overruns(f"{CONNECTIONS} busy beside the screen", scans)
    yield from _rate([window for pair in pairs for window in pair], scans)
    yield _disturbed(pairs, scans)
    yield _refused([beside for beside, _ in pairs])


def _all_busy(terminal: Terminal, others: Partners) -> None:
    end = now_ns() + ALL_BUSY_S * 1e9
    while now_ns() < end:
        progress = others.progress()
        if len(progress) == CONNECTIONS and all(each.received and each.sent for each in progress):
            return
        terminal.read_for(0.1)
    raise TimeoutError(f"{len(progress)} of {CONNECTIONS} connections")


def _pairs(terminal: Terminal, others: Partners, seconds: int) -> list[tuple[Window, Window]]:
    """Return (beside the 33rd, without it), who goes first changes; all together take so many seconds."""
    count = max(1, seconds // PAIR_S)
    length = seconds / count / 2
    pairs = []
    for turn in range(count):
        windows = {beside: _window(terminal, others, beside, length) for beside in _order(turn)}
        pairs.append((windows[True], windows[False]))
    return pairs


def _order(turn: int) -> tuple[bool, bool]:
    return (False, True) if turn % 2 else (True, False)


def _window(terminal: Terminal, others: Partners, beside: bool, seconds: float) -> Window:
    errors, before, began = _errors(terminal), others.progress(), now_ns()
    terminal.type(f":set T33 CONT={beside:d}\r")
    terminal.read_for(seconds)
    after, ended = others.progress(), now_ns()
    moved = list(zip(before, after, strict=True))
    return Window(
        began,
        ended,
        received=tuple(now.received - then.received for then, now in moved),
        sent=tuple(now.sent - then.sent for then, now in moved),
        wrong=sum(now.wrong - then.wrong for then, now in moved),
        refused=_errors(terminal) - errors,
    )


def _errors(terminal: Terminal) -> int:
    """Return how many errors the screen counts for T33, which is the selected instance."""
    found = ERRORS.findall(terminal.written())
    return int(found[-1]) if found else 0


# -- the figures ---------------------------------------------------------------------------------------------


def _rate(windows: Sequence[Window], scans: Scans) -> Iterator[Figure]:
    share = spread([each for window in windows for each in window.shares(scans)])
    received = [done / window.seconds for window in windows for done in window.received]
    sent = [done / window.seconds for window in windows for done in window.sent]
    wrong, frames = sum(window.wrong for window in windows), sum(sum(w.sent) for w in windows)
    note = (
        f"ceiling: one DONE in {SCANS_PER_DONE} scans, 50 a second; DONEs a second of a connection: "
        f"TRCV_C {_words(received)}, TSEND_C {_words(sent)}; {FRAME} B full duplex"
    )
    case = f"{2 * CONNECTIONS} busy blocks: DONE / ceiling of the scans that passed"
    yield Figure.of(case, share, 3, note=note)
    yield Figure("frames that came back wrong", f"{wrong} of {frames}", wrong)


def _words(rates: Sequence[float]) -> str:
    return f"{statistics.median(rates):.1f} (the slowest {min(rates):.1f})"


def _disturbed(pairs: Sequence[tuple[Window, Window]], scans: Scans) -> Figure:
    share = ratios([(sum(beside.shares(scans)), sum(without.shares(scans))) for beside, without in pairs])
    beside, without = (sum(_overran(side, scans) for side in column) for column in zip(*pairs, strict=True))
    case = f"DONE of the {CONNECTIONS} beside the 33rd / without it"
    note = f"windows in turn; overruns beside it {beside}, without {without}"
    return Figure.of(case, share, 3, note=note)


def _overran(window: Window, scans: Scans) -> int:
    return scans.between(window.began, window.ended).overruns


def _refused(windows: Sequence[Window]) -> Figure:
    refused = sum(window.refused for window in windows)
    attempts = sum(int(window.seconds) for window in windows)  # one a second: the dialect's pause
    note = "8080 on the screen, one attempt a second; none reached its partner"
    return Figure("the 33rd: refused / attempts", f"{refused} of {attempts}", refused / attempts, note)


# -- the project ---------------------------------------------------------------------------------------------


def project(ports: Sequence[int]) -> str:
    """Return a T4 of 33 active CONNECTs; T33 comes first in the file, so that the screen shows it."""
    busy = range(1, CONNECTIONS + 1)
    blink = "\n".join(f"set S{number} REQ=blink" for number in busy)
    parts = [
        f'dialect = "baosky"\nmodel = "T4"\nstart = """\n{blink}\n"""',
        '[[task]]\nname = "MAIN"\ninterval = "T#10ms"',
        *(_connect(number, port) for number, port in enumerate(ports, 1)),
        '[[instance]]\nname = "T33"\nblock = "TRCV_C"\nconnect = "C33"',
        *(_both_ways(number) for number in busy),
    ]
    return "\n\n".join(parts) + "\n"


def _connect(number: int, port: int) -> str:
    return (
        f'[[connect]]\nname = "C{number}"\nActiveEstablished = true\nLocalAddress = "127.0.0.1"\n'
        f'RemoteAddress = "127.0.0.1"\nRemotePort = {port}'
    )


def _both_ways(number: int) -> str:
    """Return a TRCV_C and a TSEND_C that share a CONNECT and DATA."""
    return (
        f'[[data]]\nname = "rx{number}"\ntype = "ARRAY[1..{FRAME}] OF BYTE"\n'
        f'[[instance]]\nname = "R{number}"\nblock = "TRCV_C"\nconnect = "C{number}"\n'
        f'data = "rx{number}"\nCONT = true\nEN_R = true\n'
        f'[[instance]]\nname = "S{number}"\nblock = "TSEND_C"\nconnect = "C{number}"\n'
        f'data = "rx{number}"\nCONT = true'
    )
