"""What the screen may say and see: one line in, one answer out; one request in, one picture out."""

from __future__ import annotations

from collections import deque
from typing import Final

from trcvtui.errors import UserError
from trcvtui.rig import bench_words as words
from trcvtui.rig.assembly import Bench
from trcvtui.rig.bench import parse_line
from trcvtui.rig.conditions import found, holds
from trcvtui.rig.picture import Answer, EngineTiming, Picture, PictureRequest

MOST_ANSWERS: Final = 64
MOST_DATA: Final = (
    65_536  # of one variable in a picture: as much as a job can write; more would block the pipe
)
SCAN_CONTROL: Final = ("hold", "go")


class Console:
    """The bench as the screen drives it. While `holding`, only the scans in `wanted` pass."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.holding = False
        self.wanted = 0
        self._answers: deque[Answer] = deque(maxlen=MOST_ANSWERS)

    def take(self, number: int, line: str) -> None:
        """Carry out one line; its answer is in the next picture."""
        self._answers.append(Answer(number, line, self._carry_out(line.strip())))

    def _carry_out(self, line: str) -> str:
        if line in SCAN_CONTROL:
            self.holding, self.wanted = line == "hold", 0
            return ""
        try:
            command = parse_line(line, self.bench.project, "prompt")
        except UserError as error:
            return error.lines()[0]
        return self._act(command) if command is not None else ""

    def _act(self, command: words.BenchCommand) -> str:
        match command:
            case words.RunScans(scans):
                return self._pass(scans)
            case words.RunFor(ns):
                return self._pass(ns // self.bench.runtime.interval_ns)
            case words.Expect(condition, None):
                return "" if holds(self.bench, condition) else f"found {found(self.bench, condition)}"
            case words.Wait() | words.Expect() | words.ExpectTrace():
                return "waits and traces belong into a scenario file"
            case _:
                return self.bench.do(command)

    def _pass(self, scans: int) -> str:
        if not self.holding:
            return "scans are passing already; `hold` stops them"
        self.wanted += scans
        return ""

    def may_scan(self) -> bool:
        """Return whether the next scan may pass, and count it."""
        if not self.holding:
            return True
        if self.wanted == 0:
            return False
        self.wanted -= 1
        return True

    def picture(self, request: PictureRequest, timing: EngineTiming, most_lines: int) -> Picture:
        """Return the bench after its last scan; at most `most_lines` of the ledger's news, the newest."""
        runtime = self.bench.runtime
        fresh = runtime.ledger.last_seq - request.since_seq
        lines = runtime.ledger.since(request.since_seq, min(most_lines, request.most_lines))
        answers = tuple(self._answers)
        self._answers.clear()
        return Picture(
            snapshot=runtime.snapshot(tuple(str(fault) for fault in self.bench.plan.entries())),
            lines=lines,
            lines_skipped=max(0, fresh - len(lines)),
            data=tuple((name, runtime.data(name)[:MOST_DATA]) for name in request.data),
            partial=tuple((name, runtime.partial(name)) for name in request.partial_of),
            peers=tuple(peer.snapshot() for peer in self.bench.peers.values()),
            answers=answers,
            timing=timing,
            holding=self.holding,
            kernel=self.bench.kernel_name,
        )
