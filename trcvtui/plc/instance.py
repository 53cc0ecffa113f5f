"""One block instance: its block, its inputs, its outputs, and the results of its jobs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.block import Block, ConnectBinding, StoppedBlock, new_block
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import NOT_CALLED, Cause, CauseKind, Outcome
from trcvtui.blocks.pins import Inputs, PinValue
from trcvtui.blocks.serial.com_buffer import BufferBinding
from trcvtui.blocks.serial.receiving import FrameReceiveJob
from trcvtui.blocks.table import block_row
from trcvtui.blocks.udp.datagram_jobs import UdpBinding
from trcvtui.plc.containment import INTERNAL_ERROR
from trcvtui.plc.ledger import InputEdge, Outputs, StatusEdge
from trcvtui.plc.serial_line_control import BufferDrain, BufferFeed
from trcvtui.plc.snapshot import FramerSnapshot, InstanceSnapshot, framer_snapshot
from trcvtui.project.project import InstanceDecl

MOST_KNOWN_OUTCOMES: Final = 64


class Instance:
    """One instance. `call_block` calls its block once a scan. The program reads `outputs` afterwards."""

    def __init__(
        self,
        decl: InstanceDecl,
        bound: ConnectBinding | UdpBinding | BufferBinding,
        note: Callable[[InputEdge], None],
    ) -> None:
        self.name = decl.name
        self.block_name = decl.block
        self.decl = decl
        self.data = bound.data
        self._row = block_row(decl.block)
        self.inputs: dict[str, PinValue] = {
            pin.name: False if pin.is_bool else 0
            for pin in self._row.inputs
            if pin.name not in bound.env.rules.lacks
        }
        self.inputs.update(decl.inputs)
        self._shown_fields = {pin.shows for pin in self._row.outputs}
        self._bound = bound
        self._env = bound.env
        self._note = note
        self._stream: BufferFeed | BufferDrain | None = None  # of a TRCV_C or TSEND_C on a ComBuffer
        self._known: dict[Outcome, StatusEdge] = {}
        self._pulsed: list[str] = []  # TRUE for the next call
        self._fading: list[str] = []  # TRUE in the last call, FALSE in the next
        self._blinking: list[str] = []
        self._snapshot: InstanceSnapshot | None = None  # the last one
        self.restart_block()

    def set_com_stream(self, stream: BufferFeed | BufferDrain | None) -> None:
        self._stream = stream

    def restart_block(self) -> None:
        """Start the block anew, as after STOP and RUN or a download. Inputs and DATA keep their values."""
        self._block: Block = new_block(self._row, self._bound)
        self._block_would_read: Callable[[Inputs, bool], bool] | None
        self._block_would_read = getattr(self._block, "would_read", None)  # of a block that receives
        if isinstance(self._bound, ConnectBinding) and self._block_would_read is not None:
            self._bound.connection.readers[self.name] = self._would_read
        self._frozen: Inputs | None = None
        self.outcome = NOT_CALLED
        self.edge = self._make_edge(NOT_CALLED)
        self.called = self.has_failed = False
        self.asleep = False  # the next call would change no output
        self.since_scan = self._env.scan
        self.jobs_done = self.errors = 0
        self.last_done: tuple[int, int] | None = None
        self.last_error: tuple[int, int] | None = None
        self.last_is_expected = False  # the cause of this error is expected

    # -- inputs ------------------------------------------------------------------------------------

    def set_input(self, pin: str, value: PinValue) -> None:
        """Write one input; the value holds until it is changed, so a blink or pulse of this input ends."""
        for pins in (self._blinking, self._pulsed, self._fading):
            if pin in pins:
                pins.remove(pin)
        self._write(pin, value)

    def pulse(self, pin: str) -> None:
        if pin in self._fading:  # else it would fall in the call of this pulse
            self._fading.remove(pin)
        if pin not in self._pulsed:
            self._pulsed.append(pin)
        self._write(pin, True)

    def blink(self, pin: str) -> None:
        """Toggle the pin at every call from now on."""
        if pin not in self._blinking:
            self._blinking.append(pin)

    def _write(self, pin: str, value: PinValue) -> None:
        if self.inputs[pin] != value:
            self.inputs[pin] = value
            self._frozen = None
            self._note(InputEdge(self.name, pin, value))

    # -- one call ------------------------------------------------------------------------------------

    def call_block(self) -> bool:
        """Call the block once; return whether any output differs from the scan before."""
        if self.has_failed:  # stopped by an internal error (16#8FFF)
            return False
        if self._fading or self._blinking:
            self._advance_pulses()
        if self._stream is not None and self._stream.prepare_inputs(self._block.job):
            self._frozen = None
        if self._frozen is None:
            self._frozen = self._freeze()
        outcome = self._block.call(self._frozen)
        if self._pulsed:
            self._fading, self._pulsed = self._pulsed, []
        if outcome.clear_com_rst:
            self._write("COM_RST", False)  # switch com_rst_autoclear
        stays_awake = self._frozen is None or bool(  # type: ignore[comparison-overlap]  # _write may reset it
            self._blinking or self._fading
        )
        if self._stream is not None:
            self._stream.handle_outcome(
                outcome, bool(self.inputs["EN_R" if self._row.receives_on_net else "REQ"])
            )
            stays_awake = stays_awake or self._stream.keeps_awake
        self.asleep = outcome.stable and not stays_awake
        first, self.called = not self.called, True
        if outcome is self.outcome and not first:  # the usual scan
            return False
        return self.take_outcome(outcome) or first

    def fail(self, why: str) -> bool:
        """Show ERROR. Until `restart_block` the block is not called. Return whether any output differs."""
        self._block, self._block_would_read = StoppedBlock(), None
        self.has_failed = self.called = self.asleep = True
        return self.take_outcome(
            Outcome(Condition.INTERNAL_FAULT, Cause(CauseKind.INTERNAL, INTERNAL_ERROR, detail=why))
        )

    def _would_read(self, waits: bool) -> bool:
        pins = self.inputs | dict.fromkeys(self._blinking, True)  # a blinking EN_R will be 1 again
        inputs = Inputs(**{pin.lower(): value for pin, value in pins.items()})  # type: ignore[arg-type]
        return self._block_would_read is not None and self._block_would_read(inputs, waits)

    def _freeze(self) -> Inputs:
        values = {pin.lower(): value for pin, value in self.inputs.items()}
        if self._stream is not None:
            values |= self._stream.input_overrides()
        return Inputs(**values)  # type: ignore[arg-type]

    def _advance_pulses(self) -> None:
        for pin in self._fading:
            self._write(pin, False)
        self._fading = []
        for pin in self._blinking:
            if pin not in self._pulsed:
                self._write(pin, not self.inputs[pin])

    def take_outcome(self, outcome: Outcome) -> bool:
        """Show an outcome on the outputs; return whether any output has changed."""
        before, self.outcome = self.outputs, outcome
        self.edge = self.get_edge(outcome)
        now = self.outputs
        if now.done:
            self.jobs_done += 1
            size = outcome.cause.have if now.rcvd_len is None else now.rcvd_len  # have: of a sender
            self.last_done = (self._env.scan, size or 0)
        if now.error and not (before.done and before.error):  # else the DONE scan has counted it
            self.errors += 1
            if self.last_error is None or not outcome.cause.is_expected:  # an expected one hides no other
                self.last_error = (self._env.scan, now.status)
                self.last_is_expected = outcome.cause.is_expected
        if now.status != before.status:
            self.since_scan = self._env.scan
            return True
        # Frames may come scan after scan: each is an edge, though its pins may equal those of the last one.
        is_frame = now.done and isinstance(self._bound, BufferBinding)
        return is_frame or (now is not before and now != before)

    def stop(self) -> bool:
        """Show what a stopped PLC shows: STATUS 0000, outputs FALSE; return whether any output differs."""
        self._block.stop("PLC STOP")
        before = self.outputs
        self.outcome = NOT_CALLED
        self.edge = self._make_edge(NOT_CALLED)
        self.called = False
        self.since_scan = self._env.scan
        return self.outputs != before

    def drop_job(self, reason: str) -> None:
        """Drop the running job. The job's lock on the connection stays if the vendor's rules say so."""
        if isinstance(self._bound, ConnectBinding):
            self._bound.connection.readers.pop(self.name, None)
        self._block.detach(reason)

    @property
    def outputs(self) -> Outputs:
        return self.edge.outputs

    def get_edge(self, outcome: Outcome) -> StatusEdge:
        """Return the edge of an outcome; it is kept for the next time that this outcome occurs."""
        return self._known.get(outcome) or self._make_edge(outcome)

    def _make_edge(self, outcome: Outcome) -> StatusEdge:
        if len(self._known) >= MOST_KNOWN_OUTCOMES:  # outcomes carry lengths: there is no end of them
            self._known.clear()
        outputs = Outputs(
            self._env.rules.status_word(self.block_name, outcome.condition),
            outcome.busy or outcome.condition in self._env.rules.also_busy,
            outcome.done,
            outcome.error,
            outcome.rcvd_len if "rcvd_len" in self._shown_fields else None,
            outcome.rx_timeout if "rx_timeout" in self._shown_fields else None,
            outcome.byte if "byte" in self._shown_fields else None,
        )
        edge = StatusEdge(self.name, self.block_name, outputs, str(outcome.condition), outcome.cause)
        self._known[outcome] = edge
        return edge

    # -- for readers -----------------------------------------------------------------------------------

    def job_bytes(self) -> bytes:
        return self._block.job.received_part()

    def framer(self) -> FramerSnapshot | None:
        job, bound = self._block.job, self._bound
        if not isinstance(job, FrameReceiveJob) or not isinstance(bound, BufferBinding):
            return None
        return framer_snapshot(self.block_name, bound, job, self.inputs)

    def snapshot(self) -> InstanceSnapshot:
        """Return a snapshot of the instance; it is the same object while nothing has changed."""
        job, edge, decl = self._block.job, self.edge, self.decl
        done_scan, rcvd_len = self.last_done or (None, None)
        error_scan, error_status = self.last_error or (None, None)
        fresh = InstanceSnapshot(
            self.name,
            self.block_name,
            decl.connect,
            self.data.name if self.data else None,
            (*self.inputs.items(),),
            edge.outputs,
            edge.condition,
            edge.cause,
            self.since_scan,
            job.have,
            job.need if job.running else 0,
            job.adhoc,
            job.last_bytes_at,
            self.jobs_done,
            self.errors,
            done_scan,
            rcvd_len,
            error_status,
            error_scan,
            decl.task,
            decl.addr,
            self.framer(),
            decl.on_config,
            self.last_is_expected,
        )
        if self._snapshot is None or fresh != self._snapshot:
            self._snapshot = fresh
        return self._snapshot
