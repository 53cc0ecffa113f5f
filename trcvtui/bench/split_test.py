"""Tries every split of a message: first the whole message, then two chunks for each possible cut.

Rule: a trial lets no scan pass. `run` yields for each scan, and a scenario or a screen lets the scan pass.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Final

from msgspec import Struct, field
from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.commands.words import PeerSend, TrySplits
from trcvtui.snapshots.scenario import SplitRow, SplitTestSnapshot
from trcvtui.wording import format_columns

GAP_SCANS: Final = 3  # so that two whole scans pass between a chunk and the next one
SETTLE_SCANS: Final = 2  # after the last byte: then DONE is 0 again, and the next job is armed
PATIENCE_NS: Final = 2_000_000_000  # how long to wait for bytes on their way
RUNNING, FINISHED, CANCELLED, FAILED = "running", "finished", "cancelled", "failed"
MOST_LENGTHS: Final = 6  # RCVD_LENs that are shown


class _RunResult(Struct):
    """The result of one run: STATUS and ERROR of each scan, RCVD_LEN and DATA of each frame."""

    scans: list[tuple[int, bool]] = field(default_factory=list)
    frames: list[tuple[int, bytes]] = field(default_factory=list)

    @property
    def received_size(self) -> int:
        return sum(size for size, _ in self.frames)

    def status_text(self) -> str:
        parts = []
        for (status, error), run in groupby(self.scans):
            parts.append(f"{status:04X}{'!' * error}{'+' * (len(list(run)) > 1)}")
        return " ".join(parts)

    def lengths_text(self) -> str:
        runs = [(size, len(list(run))) for size, run in groupby(size for size, _ in self.frames)]
        texts = [f"{size}×{times}" if times > 1 else str(size) for size, times in runs]
        return ", ".join(texts[:MOST_LENGTHS]) + ", …" * (len(texts) > MOST_LENGTHS)


class SplitTest:
    """One trial on one bench. `snapshot` is the table of results so far."""

    def __init__(self, bench: Bench, command: TrySplits) -> None:
        self._bench = bench
        self._command = command
        self._gap_ns = command.gap_ns or GAP_SCANS * bench.runtime.interval_ns
        decl = bench.project.instance(command.instance)
        self._data = decl.data if decl is not None else None
        self._state = RUNNING
        self._problem = ""
        self._rows: tuple[SplitRow, ...] = ()
        self._runs = self._differing = 0
        self._whole: _RunResult | None = None

    # -- the run ---------------------------------------------------------------------------------------

    def run(self) -> Iterator[None]:
        """Try all splits; each time this yields, the caller lets one scan pass."""
        yield from self._wait_until_armed()
        for cut in range(len(self._command.payload)):
            if self._state != RUNNING:
                return
            yield from self._try_cut(cut)
        if self._state == RUNNING:
            self._state = FINISHED

    def cancel(self) -> None:
        if self._state == RUNNING:
            self._state = CANCELLED

    @property
    def is_running(self) -> bool:
        return self._state == RUNNING

    def verdict(self) -> str:
        """Return what is wrong with the trial, or "" if the number of differing splits is as expected."""
        if self._problem:
            return self._problem
        expected = self._command.differ
        if expected is None or expected == self._differing:
            return ""
        odd = next((row for row in self._rows if row.first and not row.same), None)
        example = f"; cut at {odd.first}: {row_text(odd)}" if odd else ""
        return f"{self._differing} of {len(self._command.payload) - 1} splits differ from the whole{example}"

    def _wait_until_armed(self) -> Iterator[None]:
        for _ in range(self._scans_in(PATIENCE_NS)):
            if self._obstacle() == "":
                return
            yield
        self._fail(self._obstacle())

    def _obstacle(self) -> str:
        """Return why the instance cannot receive a message from its first byte on, or ""."""
        name, peer = self._command.instance, self._bench.peers[self._command.peer]
        runtime = self._bench.runtime
        if not peer.can_send:
            return f"{self._command.peer} is {peer.state}, not connected"
        if not runtime.inputs(name).get("EN_R", True):
            return f"EN_R of {name} is 0: it receives nothing"
        out = runtime.outputs(name)
        if not out.busy or out.error:
            return f"{name} is not receiving: STATUS {out.status:04X}"
        held = len(runtime.job_bytes(name))
        return f"the job of {name} already holds {held} bytes" if held else ""

    def _try_cut(self, cut: int) -> Iterator[None]:
        """Send the message whole or cut after `cut` bytes, and record how the instance receives it."""
        command, run = self._command, _RunResult()
        split = (cut,) if cut else ()
        wrong = self._bench.do(PeerSend(command.peer, command.payload, split, self._gap_ns))
        if wrong:
            self._fail(wrong)
            return
        settled, patience = 0, self._scans_in(PATIENCE_NS)
        while settled < SETTLE_SCANS and patience and self._state == RUNNING:
            yield
            self._record_scan(run)
            partial = len(self._bench.runtime.job_bytes(command.instance))
            if run.received_size + partial >= len(command.payload):
                settled += 1
            elif not self._bench.peers[command.peer].unsent:
                patience -= 1
        if self._state == RUNNING:
            self._add_result(cut, run)

    def _record_scan(self, run: _RunResult) -> None:
        for out in self._bench.runtime.due_edges:
            if out.instance == self._command.instance:
                run.scans.append((out.outputs.status, out.outputs.error))
                if out.outputs.done:
                    size = out.outputs.rcvd_len or 0
                    data = self._bench.runtime.data(self._data)[:size] if self._data else b""
                    run.frames.append((size, data))

    def _add_result(self, cut: int, run: _RunResult) -> None:
        if self._whole is None:
            self._whole = run
        same = run.frames == self._whole.frames
        equal = bool(run.frames) and run.frames[-1][1] == self._command.payload
        self._append(SplitRow(cut, cut, run.status_text(), len(run.frames), run.lengths_text(), equal, same))
        self._runs += 1
        self._differing += not same
        held = len(self._bench.runtime.job_bytes(self._command.instance))
        if held and self._runs < len(self._command.payload):
            name, size = self._command.instance, len(self._command.payload)
            self._fail(f"after a message of {size} bytes the job of {name} holds {held}: it waits for more")

    def _append(self, row: SplitRow) -> None:
        last = self._rows[-1] if self._rows else None
        if last is not None and last.first and replace(row, first=last.first) == replace(last, last=row.last):
            self._rows = (*self._rows[:-1], replace(last, last=row.last))
        else:
            self._rows = (*self._rows, row)

    def _fail(self, problem: str) -> None:
        self._state, self._problem = FAILED, problem

    def _scans_in(self, ns: int) -> int:
        return max(1, ns // self._bench.runtime.interval_ns)

    # -- the table -------------------------------------------------------------------------------------

    def snapshot(self) -> SplitTestSnapshot:
        return SplitTestSnapshot(
            peer=self._command.peer,
            instance=self._command.instance,
            payload=self._command.payload,
            state=self._state,
            problem=self._problem,
            runs=self._runs,
            differing=self._differing,
            rows=self._rows,
        )


def row_text(row: SplitRow) -> str:
    data = "DATA equal" if row.data_equal else "DATA differs"
    return f"{row.walk}, DONE {row.done}, RCVD_LEN {row.lengths or 0}, {data}"


def trial_text(trial: SplitTestSnapshot) -> str:
    """Return the table as text, one line for each row."""
    size = len(trial.payload)
    lines = [f"{trial.peer}: {size} bytes to {trial.instance}, every split · {trial.summary()}"]
    rows = [(row.span(), "same" if row.same else "differs", row_text(row)) for row in trial.rows]
    return "\n".join((*lines, *format_columns(rows, "rll"))) + "\n"


class ScreenSplitTest:
    """Runs at most one trial at a time for a screen. `advance` continues the trial before each scan."""

    def __init__(self) -> None:
        self._trial: SplitTest | None = None
        self._under_way: Iterator[None] = iter(())

    def begin(self, bench: Bench, command: TrySplits) -> str:
        if self._trial is not None and self._trial.is_running:
            return f"a trial is running; `peer {command.peer} try-splits stop` ends it"
        self._trial = SplitTest(bench, command)
        self._under_way = self._trial.run()
        next(self._under_way, None)
        return ""

    def stop(self) -> str:
        """End the running trial. If the trial has ended already, close its table."""
        if self._trial is not None and self._trial.is_running:
            self._trial.cancel()
        else:
            self._trial = None
        return ""

    def advance(self) -> None:
        next(self._under_way, None)

    def snapshot(self) -> SplitTestSnapshot | None:
        return self._trial.snapshot() if self._trial is not None else None
