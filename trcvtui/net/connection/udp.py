"""A CONNECT of UDP: a socket that stands as soon as it is bound, and datagrams to and from an ADDR each.

Rule: nothing that a partner does ends it; a call that fails to receive does, and it is built again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.net.connection.config import ANY_END, ConnectConfig, Policy, RemoteAddress, UdpConfig
from trcvtui.net.connection.connection import Connection, ConnectionLoss, LossKind, State
from trcvtui.net.connection.description_check import Flaw
from trcvtui.net.connection.resources import Claim, DirectionClaims, Resources
from trcvtui.net.connection.set_up import SetUp, SetUpStage, StepFault, wrong_local_address
from trcvtui.net.events import (
    BytesDropped,
    BytesReceived,
    BytesSent,
    ConnectionChanged,
    ConnectionEvent,
    What,
)
from trcvtui.net.kernel import Accepted, Handle, Kernel
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock

# Rule 1: `step` makes at most one attempt a scan, whoever asks first; the others read the same answer.
# Rule 2: `incarnation` counts the sockets; a block whose socket is gone sees another number.


class UdpPort:
    """One local end for datagrams. Blocks talk to this, never to the kernel."""

    def __init__(
        self,
        config: UdpConfig,
        kernel: Kernel,
        policy: Policy,
        resolve: Callable[[str], int | None],
        write: Callable[[ConnectionEvent], None],
    ) -> None:
        self.config = config
        self.handle: Handle | None = None
        self.incarnation = 0
        self.local: Endpoint | None = None
        self.peer: Endpoint | None = None  # of the last datagram, whichever way it went
        self.receiving = DirectionClaims()
        self.sending = DirectionClaims()
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
            return StepFault(SetUpStage.SOCKET, made)
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
            return StepFault(SetUpStage.ADDRESS, Fault("address", wrong))
        fault = self._kernel.bind(handle, local)
        if fault is not None:
            return StepFault(SetUpStage.ADDRESS if fault.error == "EADDRNOTAVAIL" else SetUpStage.BIND, fault)
        fault = self._kernel.poll_add(handle)
        return StepFault(SetUpStage.POLL_ADD, fault) if fault is not None else None

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
        self._write(ConnectionChanged(self.config.name, self.incarnation, what, local, peer, fault, detail))


NO_ADDR: Final = StepFault(
    SetUpStage.DESCRIPTION,
    Fault("description", Flaw.NEEDS_ADDR),
    "UDP: this block has no ADDR; TUSEND and TURCV have one",
)


class DatagramSetUp(SetUp):
    """From socket to bound port; nobody has to come."""

    needs_addr = False  # whoever opens it has none, and needs one

    @property
    def listening(self) -> Endpoint | None:
        """Return where datagrams reach this CONNECT, None while there is no socket."""
        return self.local

    def judge(self) -> StepFault | None:
        """Look at the description, and at ADDR."""
        return super().judge() or (NO_ADDR if self.needs_addr else None)

    def create(self) -> StepFault | None:
        """Make the socket."""
        made = self._kernel.datagram_socket(self.config.name)
        if isinstance(made, Fault):
            return StepFault(SetUpStage.SOCKET, made)
        self.attempt = made
        return None

    def prepare(self, now: int) -> StepFault | None:
        """Bind it and put it into the poll set."""
        assert self.attempt is not None
        failed = self._bind(self.attempt)
        if failed is not None:
            return failed
        fault = self._kernel.poll_add(self.attempt)
        if fault is not None:
            return StepFault(SetUpStage.POLL_ADD, fault)
        self.local = self._kernel.local_end(self.attempt)
        if self.local is not None:
            self._kept_port = self.local.port
        return None

    def _reuse(self, handle: Handle) -> Fault | None:
        return None  # two programs would share the port, and the datagrams

    def look(self, now: int) -> Accepted | StepFault | None:
        """Hand the socket over."""
        assert self.attempt is not None
        handle, self.attempt = self.attempt, None
        self._holder.has_been_up = True
        return Accepted(handle, ANY_END)

    def take_over(self, client: Accepted) -> StepFault | None:
        """Do nothing: the socket is in the poll set."""
        return None

    def free(self) -> Fault | None:
        """Withdraw the attempt, and give its ID back."""
        self.local, self.is_withdrawn = None, False
        self._connection_ids.give_back(self._holder)
        return self.free_attempt()

    def free_attempt(self) -> Fault | None:
        """Free the socket of an attempt."""
        if self.attempt is None:
            return None
        handle, self.attempt = self.attempt, None
        return self._kernel.close(handle)


class DatagramConnection(Connection):
    """One CONNECT of UDP at work; `peer` is the other end of the last datagram."""

    def __init__(
        self,
        config: ConnectConfig,
        kernel: Kernel,
        resources: Resources,
        policy: Policy,
        resolve: Callable[[str], int | None],
        write: Callable[[ConnectionEvent], None],
    ) -> None:
        super().__init__(config, kernel, resources, policy, resolve, write)
        self._way = DatagramSetUp(
            config, kernel, policy, resolve, resources.connection_ids, self._note_set_up, resources.work
        )
        self.set_up = self._way
        self._resolve = resolve

    def open(self, has_addr: bool = True) -> Fault | None:
        """Queue the set-up job; who opens it without an ADDR is told so by the first step."""
        self._way.needs_addr = not has_addr
        return super().open()

    def _become_connected(self, got: Accepted) -> None:
        self.handle, self.peer = got.handle, None
        self.state = State.CONNECTED
        self.incarnation += 1
        self.bytes_received = self.recvs = self.bytes_sent = self.sends = 0
        self._local = self._kernel.local_end(got.handle)
        self._note(What.LISTENING, detail="UDP")

    # -- datagrams ----------------------------------------------------------------------------------------

    def receive_message(self, into: memoryview, instance: str) -> Datagram | WouldBlock | ConnectionLoss:
        """Take one datagram; what there is no room for is gone."""
        assert self.handle is not None
        got = self._kernel.recv_from(self.handle, into)
        if isinstance(got, Datagram):
            self.peer = got.source
            self._took(got.size, instance)
            return got
        if isinstance(got, Fault) and got.error != "EAGAIN":
            return self._lose(ConnectionLoss(LossKind.FAILED, str(self.peer or ""), got))
        return WOULD_BLOCK

    def send_to(self, data: memoryview, to: RemoteAddress, instance: str) -> int | WouldBlock | Fault:
        """Send one datagram; the stack takes it whole or not at all."""
        assert self.handle is not None
        end = to.target(self._resolve)
        got = end if isinstance(end, Fault) else self._kernel.send_to(self.handle, data, end)
        if isinstance(got, int) and isinstance(end, Endpoint):
            self.sends += 1
            offset, self.peer = self.bytes_sent, end
            self.bytes_sent = offset + got
            self._write(BytesSent(self._name, self.incarnation, self.sends, offset, got, instance))
        return got

    def where(self, to: RemoteAddress) -> str:
        """Return whom a datagram to this ADDR reaches, or what stands there as long as nobody knows."""
        end = to.target(self._resolve)
        return str(end if isinstance(end, Endpoint) else to)

    # -- nobody ends it ---------------------------------------------------------------------------------

    def _look_for_loss(self, handle: Handle, asking: Claim | None = None) -> ConnectionLoss | None:
        return None

    def unread(self) -> int:
        """Return 0: the stack tells the size of one datagram, not of all."""
        return 0

    def unacknowledged(self) -> int | None:
        """Return None: nobody acknowledges."""
        return None

    def reset(self) -> Fault | None:
        """Free the socket (T_RESET); the next step makes another on the same port."""
        assert self.handle is not None
        fault = self._close_orderly(self.handle)
        self._note(What.RESET, fault=fault)
        self._end_incarnation(ConnectionLoss(LossKind.OURS, str(self.peer or "")), State.ESTABLISHING)
        return fault

    def _close_orderly(self, handle: Handle) -> Fault | None:
        removed = self._kernel.poll_del(handle)
        return self._kernel.close(handle) or removed

    def _end_incarnation(self, loss: ConnectionLoss, state: State) -> None:
        super()._end_incarnation(loss, state)
        self._way.local = None


def connection_of(
    config: ConnectConfig,
    kernel: Kernel,
    resources: Resources,
    policy: Policy,
    resolve: Callable[[str], int | None],
    write: Callable[[ConnectionEvent], None],
) -> Connection:
    """Return what works for this CONNECT."""
    kind = DatagramConnection if config.is_datagram else Connection
    return kind(config, kernel, resources, policy, resolve, write)
