"""One UDP_CONFIG at work: its socket, opened by the first block that wants it, closed by the first that ends.

Rule 1: `step` makes at most one attempt a scan, whoever asks first; the others read the same answer.
Rule 2: `incarnation` counts the sockets; a block whose socket is gone sees another number.
"""

from __future__ import annotations

from collections.abc import Callable

from trcvtui.net.connection.local_address import wrong_local_address
from trcvtui.net.connection.ownership import Direction
from trcvtui.net.connection.policy import Policy
from trcvtui.net.connection.set_up import Stage, StepFault
from trcvtui.net.connection.udp_config import RemoteAddress, UdpConfig
from trcvtui.net.events import BytesDropped, BytesReceived, BytesSent, ConnectionNote, Note, What
from trcvtui.net.kernel import WOULD_BLOCK, Datagram, Handle, Kernel, WouldBlock
from trcvtui.net.results import Endpoint, Fault


class UdpPort:
    """One local end for datagrams. Blocks talk to this, never to the kernel."""

    def __init__(
        self,
        config: UdpConfig,
        kernel: Kernel,
        policy: Policy,
        resolve: Callable[[str], int | None],
        write: Callable[[Note], None],
    ) -> None:
        self.config = config
        self.handle: Handle | None = None
        self.incarnation = 0
        self.local: Endpoint | None = None
        self.peer: Endpoint | None = None  # of the last datagram, whichever way it went
        self.receiving = Direction()
        self.sending = Direction()
        self.bytes_received = self.recvs = 0
        self.bytes_sent = self.sends = 0
        self.attempts = 0
        self.since_scan = 0  # the scan in which it last opened
        self.failure: Fault | None = None  # of the newest attempt
        self.retry_at: int | None = None
        self._kernel = kernel
        self._policy = policy
        self._resolve = resolve
        self._write = write
        self._kept_port = config.local.port
        self._stepped_in = -1
        self._step_fault: StepFault | None = None

    @property
    def is_open(self) -> bool:
        """Return whether the socket is there and bound."""
        return self.handle is not None

    # -- open and close ---------------------------------------------------------------------------

    def step(self, scan: int, now: int) -> StepFault | None:
        """Try to open, once a scan and after the pause; return what failed in this scan's attempt."""
        if self._stepped_in != scan:
            self._stepped_in, self._step_fault = scan, None
            if self.handle is None and (self.retry_at is None or now >= self.retry_at):
                self._step_fault = self._open()
                self._opened(scan, now)
        return self._step_fault

    def _opened(self, scan: int, now: int) -> None:
        self.attempts += 1
        self.failure = self._step_fault.fault if self._step_fault is not None else None
        if self._step_fault is not None:
            self.retry_at = now + self._policy.retry_ns
            self._note(What.ATTEMPT_FAILED, fault=self._step_fault.fault)
            return
        self.retry_at = None
        self.since_scan = scan
        self.incarnation += 1
        self.bytes_received = self.recvs = self.bytes_sent = self.sends = 0
        self._note(What.LISTENING, detail="UDP")

    def _open(self) -> StepFault | None:
        made = self._kernel.datagram_socket(self.config.name)
        if isinstance(made, Fault):
            return StepFault(Stage.SOCKET, made)
        failed = self._bind(made)
        if failed is not None:
            self._kernel.close(made)
            return failed
        self.handle, self.local = made, self._kernel.local_end(made)
        if self.local is not None:
            self._kept_port = self.local.port
        return None

    def _bind(self, handle: Handle) -> StepFault | None:
        local = Endpoint(self.config.local.address, self._kept_port)
        own = self._kernel.local_addresses()
        wrong = wrong_local_address(local.address, own, self._policy.strict_local_address)
        if wrong:
            return StepFault(Stage.ADDRESS, Fault("address", wrong))
        fault = self._kernel.bind(handle, local)
        if fault is not None:
            return StepFault(Stage.ADDRESS if fault.error == "EADDRNOTAVAIL" else Stage.BIND, fault)
        fault = self._kernel.poll_add(handle)
        return StepFault(Stage.POLL_ADD, fault) if fault is not None else None

    def close(self) -> Fault | None:
        """Free the socket, and with it what waits in it; return the first call that failed."""
        self.retry_at = self.failure = None
        if self.handle is None:
            return None
        removed = self._kernel.poll_del(self.handle)
        freed = self._kernel.close(self.handle)
        self._note(What.RELEASED, fault=removed or freed)
        self.handle = self.local = self.peer = None
        self.receiving.end()
        self.sending.end()
        return removed or freed

    def stop(self) -> None:
        """Free everything without a word to any block (PLC STOP)."""
        self.close()
        self._kept_port = self.config.local.port

    # -- datagrams ----------------------------------------------------------------------------------

    def send(self, data: memoryview, to: RemoteAddress, instance: str) -> int | WouldBlock | Fault:
        """Send one datagram."""
        assert self.handle is not None
        end = to.target(self._resolve)
        got = end if isinstance(end, Fault) else self._kernel.send_to(self.handle, data, end)
        if isinstance(got, int) and isinstance(end, Endpoint):
            self.sends += 1
            offset, self.peer = self.bytes_sent, end
            self.bytes_sent = offset + got
            self._write(BytesSent(self.config.name, self.incarnation, self.sends, offset, got, instance))
        return got

    def where(self, to: RemoteAddress) -> str:
        """Return whom a datagram to this ADDR reaches, or what stands there as long as nobody knows."""
        end = to.target(self._resolve)
        return str(end if isinstance(end, Endpoint) else to)

    def receive(self, into: memoryview, instance: str) -> Datagram | WouldBlock | Fault:
        """Take the next datagram."""
        assert self.handle is not None
        got = self._kernel.recv_from(self.handle, into)
        if isinstance(got, Fault):
            return WOULD_BLOCK if got.error == "EAGAIN" else got
        if isinstance(got, Datagram):
            self.recvs += 1
            offset, self.peer = self.bytes_received, got.source
            self.bytes_received = offset + got.whole
            place = self.incarnation, self.recvs, offset, got.whole
            self._write(BytesReceived(self.config.name, *place, instance))
        return got

    def drop(self, offset: int, size: int, reason: str, incarnation: int) -> None:
        """Note received bytes that never reach DATA."""
        if size:
            self._write(BytesDropped(self.config.name, incarnation, offset, size, reason))

    def _note(self, what: What, fault: Fault | None = None, detail: str = "") -> None:
        local, peer = str(self.local or ""), str(self.peer or "")
        self._write(ConnectionNote(self.config.name, self.incarnation, what, local, peer, fault, detail))
