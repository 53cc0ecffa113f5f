"""The bytes of a ComBuffer: from and to a serial port, a TRCV_C or a TSEND_C, chunk by chunk.

Rule 1: a new TRCV_C or TSEND_C takes over the connection's state from a deleted instance of the same name.
Rule 2: while the ComBuffer has no room for a whole DATA, the TRCV_C is held (EN_R = 0). Then bytes stay in
the network and slow the sender. A TRCV_C with bytes in its job is not held: if held, it would drop them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.block import Job
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.serial.com_buffer import ComBuffer
from trcvtui.net.connection.connection import Connection, State
from trcvtui.net.results import Fault
from trcvtui.net.serial_line import PortOpening, SerialPort

# A port that is missing or disappears is tried again every RETRY_NS; its incomplete frame ends.

RETRY_NS: Final = 1_000_000_000
MOST_READ_BYTES: Final = 4096  # of one scan; the rest waits in the driver
SLOW_OPEN_NOTE: Final = "port opens slowly"
NO_ANSWER_FAULT: Final = Fault("open", "EINPROGRESS", words="there is no answer yet")


class PortExchange:
    """One port. Received bytes go to `rx`. Bytes in `tx` are sent. `note` writes to the ledger.

    `fault` is the reason why the port is not there, or None while the reason is unknown.
    """

    def __init__(self, port: SerialPort, rx: ComBuffer, note: Callable[[str, str], None]) -> None:
        self.is_open = False
        self.fault: Fault | None = None
        self.tx: ComBuffer | None = None
        self._port = port
        self._rx = rx
        self._note = note
        self._retry_at: int | None = None  # None: at once
        self._reported: Fault | None = None
        self._opening_since: int | None = None

    def inject_bytes(self, payload: bytes) -> None:
        """Let bytes come as if over the line."""
        if not self._port.simulate_arrival(payload):
            self._rx.put(payload)

    def sample_line_errors(self) -> None:
        """Ask the driver for its error counts, so that a recording has them."""
        if self.is_open:
            self._port.line_errors()

    def receive(self, now: int) -> None:
        """Take received bytes; bytes without room in the ComBuffer are lost, as on a real line."""
        if not self._ensure_open(now):
            return
        got = self._port.read(MOST_READ_BYTES)
        if isinstance(got, Fault):
            self._handle_loss(got, now)
        elif got:
            self._rx.put(got)

    def send(self, most: int, now: int) -> None:
        """Send at most `most` waiting bytes, or all if `most` is 0. Without the port, the bytes wait."""
        if self.tx is None or not self.is_open or not self.tx.count:
            return
        payload = self.tx.peek()
        taken = self._port.write(payload[:most] if most else payload)
        if isinstance(taken, Fault):
            self._handle_loss(taken, now)
        else:
            self.tx.read(taken)

    def close(self) -> None:
        self._port.close()
        self.is_open, self._retry_at, self._opening_since = False, None, None
        self.fault = None

    def _ensure_open(self, now: int) -> bool:
        if self.is_open:
            return True
        if self._retry_at is not None and now < self._retry_at:
            return False
        wrong = self._port.open()
        if isinstance(wrong, PortOpening):
            self._report_slow_open(now)
            return False
        self._opening_since = None
        if wrong is None:
            self.is_open, self.fault, self._reported = True, None, None
            self._note("port open", "")
            return True
        self._retry_at = now + RETRY_NS
        self._report_once("port not there", wrong)
        return False

    def _report_slow_open(self, now: int) -> None:
        if self._opening_since is None:
            self._opening_since = now
        elif now - self._opening_since >= RETRY_NS:
            self._report_once(SLOW_OPEN_NOTE, NO_ANSWER_FAULT)

    def _report_once(self, what: str, fault: Fault) -> None:
        self.fault = fault
        if fault != self._reported:
            self._reported = fault
            self._note(what, NO_ANSWER_FAULT.words if fault is NO_ANSWER_FAULT else _format_fault(fault))

    def _handle_loss(self, fault: Fault, now: int) -> None:
        self.close()
        self._retry_at = now + RETRY_NS
        self._rx.mark_connection_end("port gone")
        self.fault = fault
        self._note("port gone", _format_fault(fault))


def _format_fault(fault: Fault) -> str:
    return f"{fault}: {fault.words}" if fault.words else str(fault)


# Rule 3: bytes wait while there is no connection; when one ends, the bytes meant for it are dropped.

READY_TO_SEND: Final = (Condition.CONNECTED, Condition.SENT)  # the last call's, after which REQ may rise


class BufferDrain:
    """Sends a ComBuffer's bytes with a TSEND_C, at most `per_call` bytes a REQ (0: DATA's size)."""

    keeps_awake = True  # bytes arrive without an event

    def __init__(
        self, connection: Connection, data: DataArea | None, buffer: ComBuffer, per_call: int
    ) -> None:
        self._connection = connection
        self._data = data
        self._buffer = buffer
        self._per_call = per_call
        self._incarnation: int | None = None  # of the connection that the bytes are for
        self._size = 0  # of what REQ sends in this call
        self._ready = False

    def prepare_inputs(self, job: Job) -> bool:
        """Put the next bytes into DATA if this call may send; return whether the inputs change."""
        was_asked, self._size = bool(self._size), 0
        self.follow_connection()
        if self._ready and self._data is not None and self._incarnation is not None and not job.running:
            room = min(self._data.size, self._per_call or self._data.size)
            payload = self._buffer.read(room)
            if payload:
                self._data.write(0, payload)
                self._size = len(payload)
        return was_asked or bool(self._size)

    def input_overrides(self) -> dict[str, int]:
        """Return the inputs that replace the program's inputs."""
        return {"req": True, "len": self._size} if self._size else {}

    def handle_outcome(self, outcome: Outcome, asked: bool) -> None:
        """Note whether the next call may send. It may not send while the program itself sets REQ to 1."""
        self._ready = outcome.condition in READY_TO_SEND and not asked

    def continue_from(self, earlier: BufferDrain) -> None:
        """Rule 1: take over from a deleted TSEND_C of the same name."""
        if earlier._connection is self._connection:
            self._incarnation = earlier._incarnation
        else:
            earlier.leave_connection()

    def note_deleted(self) -> None:
        """Do nothing when the TSEND_C is deleted: waiting bytes may still go over its connection."""

    def leave_connection(self) -> None:
        """Leave this connection; the bytes that waited for it are dropped."""
        if self._incarnation is not None:
            self._buffer.discard_all("connection closed")
            self._incarnation = None

    def stop(self) -> None:
        """PLC STOP: the connection is closed."""
        self._incarnation, self._size, self._ready = None, 0, False

    def follow_connection(self) -> None:
        """Drop the ComBuffer's bytes if they were for a connection that has ended."""
        connection = self._connection
        is_up = connection.state is State.CONNECTED
        if not is_up or connection.incarnation != self._incarnation:
            self.leave_connection()
        if is_up:
            self._incarnation = connection.incarnation


class BufferFeed:
    """Puts the bytes of a TRCV_C into a ComBuffer. If `holds` is False, bytes without room are dropped."""

    def __init__(
        self,
        connection: Connection,
        data: DataArea | None,
        buffer: ComBuffer,
        *,
        holds: bool,
        follows_en_r: bool,
    ) -> None:
        self.is_held = False
        self._follows_en_r = follows_en_r
        self._was_asked = False
        self._connection = connection
        self._data = data
        self._buffer = buffer
        self._holds = holds
        self._incarnation: int | None = None  # of the connection whose bytes were the last

    @property
    def keeps_awake(self) -> bool:
        """Return whether the next call may have another outcome, although the last outcome is stable."""
        return self.is_held

    def prepare_inputs(self, job: Job) -> bool:
        """Decide whether the TRCV_C is held in this call; return whether the decision changed."""
        before, room = self.is_held, self._data.size if self._data is not None else 0
        is_full = self._holds and self._buffer.count > 0 and self._buffer.free < room
        self.is_held = is_full and (before or not job.have)  # rule 2
        if self.is_held != before:
            self._buffer.note_held(self.is_held)
        return self.is_held != before

    def input_overrides(self) -> dict[str, int]:
        """Return the inputs that replace the program's inputs."""
        return {"en_r": False} if self.is_held else {}

    def handle_outcome(self, outcome: Outcome, asked: bool) -> None:
        """Put the bytes of a DONE into the ComBuffer; end the stream if the connection is gone."""
        connection = self._connection
        if self._follows_en_r and self._was_asked and not asked:
            self._buffer.mark_connection_end("EN_R fell")  # rules.part_follows_en_r
        self._was_asked = asked
        size = outcome.rcvd_len
        if outcome.done and size and self._data is not None:
            if self._incarnation not in (None, connection.incarnation):
                self._end_stream()
            if self._incarnation is None:
                self._buffer.discard_all("of an earlier connection")
            self._incarnation = connection.incarnation
            self._buffer.put(bytes(memoryview(self._data.content)[:size]))
        self.follow_connection()

    def continue_from(self, earlier: BufferFeed) -> None:
        """Rule 1: take over from a deleted TRCV_C of the same name."""
        if earlier._connection is self._connection:
            self._incarnation, self._was_asked = earlier._incarnation, earlier._was_asked
        else:
            earlier.leave_connection()

    def note_deleted(self) -> None:
        """The TRCV_C is deleted: the ComBuffer no longer holds it."""
        if self.is_held:
            self.is_held = False
            self._buffer.note_held(False)

    def follow_connection(self) -> None:
        """End the stream if the connection of the newest bytes has ended."""
        if self._incarnation is not None and not self._is_still_up(self._connection):
            self._end_stream()

    def leave_connection(self) -> None:
        """Leave this connection: end the stream of its bytes."""
        if self._incarnation is not None:
            self._end_stream()

    def stop(self) -> None:
        """PLC STOP: the connection is closed; `SerialLines.stop` drops the bytes in the ComBuffer."""
        self._incarnation, self.is_held = None, False

    def _is_still_up(self, connection: Connection) -> bool:
        return connection.state is State.CONNECTED and connection.incarnation == self._incarnation

    def _end_stream(self) -> None:
        self._incarnation = None
        self._buffer.mark_connection_end("connection closed")
