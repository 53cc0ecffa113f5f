"""ComBuffers on the screen: frames and gap timer below the box of a block, and the lines that you feed."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final, NamedTuple

from trcvtui.commands.words import FeedSerial
from trcvtui.errors import UserError
from trcvtui.plc.snapshot import ComBufferSnapshot, FramerSnapshot, InstanceSnapshot, block_row
from trcvtui.project.project import SERIAL, SIMULATED
from trcvtui.tui.formatting import bar, clip, pad
from trcvtui.tui.messages import ScreenCallbacks
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import LineView, Part, Row, hidden_bindings, row
from trcvtui.wording import count, format_ns

GAP_BAR_WIDTH: Final = 12
NO_GAP_TIMER: Final = "Timeout is 0: no gap ends a frame"


class GapTimer(NamedTuple):
    """Time since the last byte, and its limit. If the timer does not run, `reason` says why."""

    elapsed_ns: int
    limit_ns: int
    reason: str


def find_gap_timer(view_model: ViewModel, instance: InstanceSnapshot) -> GapTimer | None:
    framer, snapshot = instance.framer, view_model.snapshot
    if framer is None or snapshot is None:
        return None
    limit = framer.timeout_ns
    if not limit:
        return GapTimer(0, 0, NO_GAP_TIMER)
    if not instance.outputs.busy or instance.last_receive_ns is None:
        return GapTimer(0, limit, "waits for a first byte")
    elapsed = max(0, view_model.t_ns - instance.last_receive_ns)
    return GapTimer(elapsed, limit, _explain_stop(view_model, snapshot.running))


def _explain_stop(view_model: ViewModel, running: bool) -> str:
    if not running:
        return "frozen: the PLC is in STOP"
    if view_model.is_frozen:
        return "frozen view: F goes back to live"
    if view_model.picture is not None and view_model.picture.holding:
        return "frozen: the scans are held"
    return ""


def gap_parts(gap: GapTimer) -> list[tuple[str, str]]:
    """Return the timer as a bar with its times, and why it does not run."""
    if not gap.limit_ns:
        return [("─" * GAP_BAR_WIDTH, "faint"), (f" {gap.reason}", "dim")]
    full, empty = bar(min(gap.elapsed_ns, gap.limit_ns), gap.limit_ns, GAP_BAR_WIDTH)
    near = gap.elapsed_ns * 4 >= gap.limit_ns * 3  # the last quarter is drawn as a warning
    times = f" {format_ns(gap.elapsed_ns)} of {format_ns(gap.limit_ns)}"
    parts = [(full, "warn" if near else "busy"), (empty, "faint"), (times, "strong" if full else "dim")]
    return [*parts, (f" · {gap.reason}", "dim")] if gap.reason else parts


LABEL_WIDTH: Final = 9
QUEUE_BAR_WIDTH: Final = 8
TIGHT_DIVISOR: Final = 4  # less than a quarter of a ComBuffer's room is a warning
ROOMY: Final = 72


def framer_lines(view_model: ViewModel, instance: InstanceSnapshot, width: int) -> list[Row]:
    """Return the lines below the box of a block, none for a block that has no ComBuffer."""
    if not block_row(instance.block).buffer_pin:
        return []
    rows = [_buffer(view_model, instance, width)]
    data = row(_label("data"), *data_parts(view_model, instance))
    if instance.framer is None:
        return [*rows, _jobs(instance), data, row()]
    rows.append(_frames(instance.framer))
    gap = find_gap_timer(view_model, instance)
    if gap is not None:
        rows += _labelled("gap", gap_parts(gap), width)
    return [*rows, *_noise_rows(instance.framer, width), data, row()]


def _label(text: str) -> Part:
    return f" {text:<{LABEL_WIDTH - 1}}", "dim"


def _labelled(label: str, parts: list[Part], width: int) -> list[Row]:
    whole = [_label(label), *parts]
    if sum(len(text) for text, _ in whole) <= width or len(parts) < 2:
        return [row(*whole)]
    text, style = parts[-1]
    return [row(*whole[:-1]), row(_label(""), (clip(text.strip(" ·"), width - LABEL_WIDTH), style))]


def _buffer(view_model: ViewModel, instance: InstanceSnapshot, width: int) -> Row:
    buffer = view_model.snapshot.combuffer(instance.connect) if view_model.snapshot is not None else None
    if buffer is None:
        return row(_label("queue"), (instance.connect, "strong"))
    full, empty = bar(buffer.count, buffer.size, QUEUE_BAR_WIDTH)
    tight = buffer.size - buffer.count < buffer.size // TIGHT_DIVISOR
    parts = [
        _label("queue"), (buffer.name, "strong"), (" ", ""), (full, "warn" if tight else "busy"),
        (empty, "faint"), (f" {buffer.count}/{buffer.size} B", "strong" if buffer.count else ""),
    ]  # fmt: skip
    if buffer.lost:
        parts.append((f"  {buffer.lost} lost", "error"))
    if not buffer.is_up:
        parts.append(("  port is missing", "error"))
    elif width >= ROOMY or not buffer.lost:
        parts.append((f"  {source_words(buffer)}", "dim"))
    return row(*parts)


def source_words(buffer: ComBufferSnapshot) -> str:
    known = {SIMULATED: "simulated", SERIAL: "serial port"}
    return known.get(buffer.source, f"from {buffer.source}")


def data_parts(view_model: ViewModel, instance: InstanceSnapshot) -> list[Part]:
    declared = view_model.declaration
    if declared is None:
        return [("not wired", "warn")] if instance.data_pin else [("none", "dim")]
    size = f"  {clip(declared.type_name, 24)}, {declared.size} B"
    return [(declared.name, "strong"), (size, "dim")]


def _jobs(instance: InstanceSnapshot) -> Row:
    errors = f"  {count(instance.errors, 'error')}"
    return row(_label("jobs"), (f"{instance.jobs_done} done", "strong"), (errors, "dim"))


def _frames(framer: FramerSnapshot) -> Row:
    tally = framer.tally
    parts: list[Part] = [_label("frames"), (f"{tally.good} good", "strong")]
    parts.append((f"  {tally.gaps} by a gap", "warn" if tally.gaps else "dim"))
    parts.append((f"  {count(tally.overruns, 'overrun')}", "error" if tally.overruns else "dim"))
    return row(*parts)


def _noise_rows(framer: FramerSnapshot, width: int) -> list[Row]:
    """Return the rows about bytes outside frames: noise before a prefix, and dropped parts of frames."""
    tally = framer.tally
    if not framer.discarded and not tally.parts:
        return [row(_label("noise"), ("nothing thrown away", "dim"))]
    parts: list[Part] = [(f"{framer.discarded} B thrown away", "warn" if framer.discarded else "dim")]
    if tally.parts:
        parts.append((f"  {count(tally.parts, 'part')} of frames", "warn"))
    parts.append(("  X shows them", "dim"))
    rows = [row(_label("noise"), *parts)]
    if framer.discarded:
        room = max(3, (width - LABEL_WIDTH - 2) // 3)
        newest = framer.noise[-room:]
        lead = "…" if framer.discarded > len(newest) else ""
        rows.append(row(_label(""), (lead + newest.hex(" ").upper(), "ghost")))
    return rows


FEED_VERB: Final = "feed"
LINE_BAR_WIDTH: Final = 10
MOST_KEPT_BYTES: Final = 65_536  # bytes of a fed message, kept to be fed again
FED: Final = "›"  # drawn between the bytes that were fed and those still to be fed


class SerialLineList(LineView):
    """One row for each ComBuffer; below them, the last bytes fed to the ComBuffer under the cursor."""

    KEYS: ClassVar = (
        ("enter", "type bytes"), ("s", "again"), ("→", "next byte"), ("b", "break"), ("↑↓", "line"),
    )  # fmt: skip
    BINDINGS: ClassVar = hidden_bindings({
        "enter,i": "type", "s": "again", "right": "piece", "left": "back", "b": "break",
    })  # fmt: skip
    DEFAULT_CSS = "SerialLineList { height: auto; max-height: 8; min-height: 1; }"

    def __init__(self, view_model: ViewModel, actions: ScreenCallbacks) -> None:
        super().__init__(id="lines")
        self._view_model = view_model
        self._actions = actions
        self._cursor = 0
        self._fed: dict[str, tuple[bytes, int]] = {}  # by ComBuffer: the message, bytes of it that were fed

    @property
    def names(self) -> list[str]:
        return [
            b.name
            for b in self._view_model.project.combuffers
            if b.source in (SIMULATED, SERIAL) and not b.line
        ]

    @property
    def choice(self) -> str:
        names = self.names
        return names[min(self._cursor, len(names) - 1)] if names else ""

    def row_count(self) -> int:
        return len(self.names) + 2 if self.names else 0

    def row_at(self, y: int) -> Row:
        names = self.names
        if y < len(names):
            return self._line(names[y])
        if y == len(names):
            return self._fed_row()
        keys = "enter: type bytes · s: feed again · →: next byte · b: pull the cable"
        return row((clip(keys, self.line_width), "dim"))

    def _line(self, name: str) -> Row:
        chosen = name == self.choice
        parts: list[Part] = [("▸ " if chosen else "  ", "key"), (pad(clip(name, 12), 13), "strong")]
        snapshot = self._view_model.snapshot
        buffer = snapshot.combuffer(name) if snapshot is not None else None
        if buffer is not None:
            parts += _fill_parts(buffer)
        return row(*parts, style=self.cursor_style(chosen))

    def _fed_row(self) -> Row:
        payload, fed = self._fed.get(self.choice, (b"", 0))
        if not payload:
            return row(("  nothing was fed yet", "dim"))
        room = max(4, (self.line_width - 26) // 3)
        first = max(0, min(fed - room // 2, len(payload) - room))
        before, after = payload[first:fed].hex(" "), payload[fed : first + room].hex(" ")
        lead, tail = "…" * (first > 0), "…" * (first + room < len(payload))
        parts: list[Part] = [("  last  ", "dim"), (lead + before, ""), (FED, "key"), (after + tail, "ghost")]
        return row(*parts, (f"  {fed} of {len(payload)} B fed", "dim"))

    # -- what is fed -------------------------------------------------------------------------------------

    def wrap(self, submit: Callable[[str], None]) -> Callable[[str], None]:
        """Return a function that calls `submit`, and also keeps the bytes of `feed` lines."""

        def submit_and_note(line: str) -> None:
            self._note_fed_bytes(line)
            submit(line)

        return submit_and_note

    def _note_fed_bytes(self, line: str) -> None:
        if not line.startswith(f"{FEED_VERB} "):
            return
        from trcvtui.commands.table import parse_line  # imported with the first fed line

        try:
            command = parse_line(line, self._view_model.project, FEED_VERB)
        except UserError:
            return  # the engine reports the mistake
        if isinstance(command, FeedSerial) and command.payload and len(command.payload) <= MOST_KEPT_BYTES:
            self._fed[command.buffer] = command.payload, len(command.payload)
            self.show()

    def action_type(self) -> None:
        if self.choice:
            self._actions.open_prompt(f"{FEED_VERB} {self.choice} hex ")

    def action_again(self) -> None:
        payload, _ = self._fed.get(self.choice, (b"", 0))
        self._feed(payload, len(payload))

    def action_piece(self) -> None:
        """Feed the next byte of the message. After its last byte, feed the first byte again."""
        payload, fed = self._fed.get(self.choice, (b"", 0))
        place = fed % len(payload) if payload else 0
        self._feed(payload, place + 1, place)

    def action_back(self) -> None:
        payload, _ = self._fed.get(self.choice, (b"", 0))
        self._fed[self.choice] = payload, 0
        self.show()

    def _feed(self, payload: bytes, stop: int, start: int = 0) -> None:
        if not payload:
            self.action_type()
            return
        self._fed[self.choice] = payload, stop
        self._actions.submit(f"{FEED_VERB} {self.choice} hex {payload[start:stop].hex(' ')}")
        self.show()

    def action_break(self) -> None:
        """Pull the cable: a half-received frame gets no end."""
        if self.choice:
            self._actions.submit(f"{FEED_VERB} {self.choice} break")

    def action_move(self, rows: int) -> None:
        self._cursor = max(0, min(len(self.names) - 1, self._cursor + rows))
        self.show()


def _fill_parts(buffer: ComBufferSnapshot) -> list[Part]:
    full, empty = bar(buffer.count, buffer.size, LINE_BAR_WIDTH)
    return [
        (f"{source_words(buffer)}  ", "dim"), (full, "busy"), (empty, "faint"),
        (f" {buffer.count}/{buffer.size} B", ""), (f"  {buffer.arrived} B arrived", "dim"),
        (f"  {buffer.lost} lost" if buffer.lost else "", "error"),
    ]  # fmt: skip
