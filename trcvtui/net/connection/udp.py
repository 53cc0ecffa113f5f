"""A UDP endpoint. A UDP socket is up once it is bound. An ADDR has the target or source of a datagram.

Rule 1: no partner can end the socket. If a receive call of a CONNECT fails, the socket is closed and set up
again. With a UDP_CONFIG the block gets the fault, and the socket stays.
Rule 2: `incarnation` counts the sockets of the endpoint. So a block sees that its socket is gone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from trcvtui.net.broadcast import enable_broadcasts, receive_datagram
from trcvtui.net.connection.config import ANY_END, ConnectConfig, ConnectionPolicy, RemoteAddress, UdpConfig
from trcvtui.net.connection.connection import Connection, ConnectionLoss, LossKind, SocketUse, State
from trcvtui.net.connection.description_check import Flaw
from trcvtui.net.connection.resources import Claim, Resources
from trcvtui.net.connection.set_up import SetUp, SetUpStage, StepFault
from trcvtui.net.events import ConnectionEvent, EventKind
from trcvtui.net.kernel import Handle, Kernel, NewClient
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock

NO_ADDR: Final = StepFault(
    SetUpStage.DESCRIPTION,
    Fault("description", Flaw.NEEDS_ADDR),
    "UDP: this block has no ADDR; use TUSEND or TURCV",
)


class UdpSetUp(SetUp):
    """The set-up of UDP: from socket to bound port; there is no partner to wait for."""

    needs_addr = False  # the block that opens it has no ADDR, and would need one
    broadcast_handle: Handle | None = None  # a second socket, for broadcasts

    @property
    def listening_end(self) -> Endpoint | None:
        return self.local

    def check_and_claim(self) -> StepFault | None:
        return super().check_and_claim() or (NO_ADDR if self.needs_addr else None)

    def bind_and_start(self, now: int) -> StepFault | None:
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
            if self._policy.broadcasts:
                name = self.config.name
                self.broadcast_handle, why = enable_broadcasts(self._kernel, name, self.attempt, self.local)
                if why:  # only noted: without broadcasts the port works, too
                    self._note(EventKind.OPTION_REFUSED, None, f"no socket for broadcasts: {why}")
        return None

    def _set_reuse(self, handle: Handle) -> Fault | None:
        return None  # two programs would share the port, and the datagrams

    def poll_attempt(self, now: int) -> NewClient | StepFault | None:
        assert self.attempt is not None
        handle, self.attempt = self.attempt, None
        self._holder.has_been_up = True
        return NewClient(handle, ANY_END)

    def take_over(self, client: NewClient) -> StepFault | None:
        return None  # the socket is in the poll set

    def free(self) -> Fault | None:
        self.local = None
        return super().free()

    def free_attempt(self) -> Fault | None:
        if self.broadcast_handle is not None:
            handle, self.broadcast_handle = self.broadcast_handle, None
            self._kernel.close(handle)
        if self.attempt is None:
            return None
        handle, self.attempt = self.attempt, None
        return self._kernel.close(handle)


class UdpEndpoint(Connection):
    """One CONNECT of UDP, or one UDP_CONFIG, at run time. `peer` is the other end of the last datagram.

    The first block that needs the socket of a UDP_CONFIG opens it, at once and without a job. The first
    block that ends closes this socket. Byte counts of a UDP_CONFIG include bytes that had no room.
    """

    SET_UP = UdpSetUp
    set_up: UdpSetUp

    def __init__(
        self,
        config: ConnectConfig | UdpConfig,
        kernel: Kernel,
        resources: Resources,
        policy: ConnectionPolicy,
        resolve: Callable[[str], int | None],
        write: Callable[[ConnectionEvent], None],
    ) -> None:
        self.is_config = isinstance(config, UdpConfig)
        self.failure: Fault | None = None  # of the newest attempt to open a UDP_CONFIG
        if isinstance(config, UdpConfig):
            config = ConnectConfig(config.name, local=config.local, is_datagram=True, history=config.history)
        super().__init__(config, kernel, resources, policy, resolve, write)
        self._resolve = resolve

    @property
    def is_open(self) -> bool:
        return self.handle is not None

    @property
    def sockets(self) -> Iterator[tuple[Handle, SocketUse]]:
        yield from super().sockets
        if self.set_up.broadcast_handle is not None:
            yield self.set_up.broadcast_handle, SocketUse.DATAGRAMS

    def queue_set_up(self, now: int, has_addr: bool = True) -> Fault | None:
        self.set_up.needs_addr = not has_addr  # the first step reports it
        return super().queue_set_up(now)

    def _take_step(self, now: int) -> StepFault | None:
        if not self.is_config:
            return super()._take_step(now)
        if self.is_open or (self.retry_at is not None and now < self.retry_at):
            return None
        self.retry_at = self.failure = None
        self.attempts += 1
        failed = self.set_up.create_socket() or self.set_up.bind_and_start(now)
        if failed is None:
            return self._adopt(self.set_up.poll_attempt(now), now)
        self.failure = failed.fault
        return self._fail_attempt(failed, now)

    def _become_connected(self, got: NewClient) -> None:
        self._begin_incarnation(got.handle, None)
        self._note(EventKind.LISTENING, detail="UDP")

    def close(self) -> Fault | None:
        """Free the socket of a UDP_CONFIG, and drop the unread datagrams; return the first Fault."""
        self.retry_at = self.failure = None
        if self.handle is None:
            return None
        removed = self._kernel.poll_del(self.handle)
        freed = self._kernel.close(self.handle)
        self._note(EventKind.RELEASED, fault=removed or freed)
        self._end_incarnation(ConnectionLoss(LossKind.OURS, ""), State.CLOSED)
        return removed or freed

    def stop(self) -> None:
        if self.is_config:
            self.close()
            self.set_up.forget_port()
        else:
            super().stop()

    # -- datagrams ----------------------------------------------------------------------------------------

    def receive_from(self, into: memoryview, instance: str) -> Datagram | WouldBlock | Fault:
        """Take one datagram; bytes that do not fit into `into` are lost."""
        assert self.handle is not None
        got = receive_datagram(self._kernel, self.handle, self.set_up.broadcast_handle, into, self._local)
        if isinstance(got, Datagram):
            self.peer = got.source
            self._note_received(into[: got.size], instance, got.whole - got.size if self.is_config else 0)
        elif isinstance(got, Fault) and got.error == "EAGAIN":
            return WOULD_BLOCK
        return got

    def receive_message(self, into: memoryview, instance: str) -> Datagram | WouldBlock | ConnectionLoss:
        """Take one datagram; a Fault ends the socket."""
        got = self.receive_from(into, instance)
        if isinstance(got, Fault):  # Rule 1
            return self._release_lost(ConnectionLoss(LossKind.FAILED, str(self.peer or ""), got))
        return got

    def send_to(self, data: memoryview, to: RemoteAddress, instance: str) -> int | WouldBlock | Fault:
        """Send one datagram; the stack takes it whole or not at all."""
        assert self.handle is not None
        end = to.resolve_target(self._resolve)
        got = end if isinstance(end, Fault) else self._kernel.send_to(self.handle, data, end)
        if isinstance(got, int) and isinstance(end, Endpoint):
            self.peer = end
            self._note_sent(data[:got], instance)
        return got

    def describe_target(self, to: RemoteAddress) -> str:
        """Return where a datagram to this ADDR goes, or the ADDR's text while the target is unknown."""
        end = to.resolve_target(self._resolve)
        return str(end if isinstance(end, Endpoint) else to)

    # -- no partner ends it -----------------------------------------------------------------------------

    def _look_for_loss(self, handle: Handle, asking: Claim | None = None) -> ConnectionLoss | None:
        return None

    def unread(self) -> int:
        return 0  # unknown: the stack counts the bytes of one datagram, not of all

    def unacknowledged(self) -> int | None:
        return None  # UDP has no acknowledgements

    def reset(self) -> Fault | None:
        """Free the socket (T_RESET); the next step makes another socket on the same port."""
        assert self.handle is not None
        fault = self._close_orderly(self.handle)
        self._note(EventKind.RESET, fault=fault)
        self._end_incarnation(ConnectionLoss(LossKind.OURS, str(self.peer or "")), State.ESTABLISHING)
        return fault

    def _close_orderly(self, handle: Handle) -> Fault | None:
        removed = self._kernel.poll_del(handle)
        return self._kernel.close(handle) or removed

    def _end_incarnation(self, loss: ConnectionLoss, state: State) -> None:
        super()._end_incarnation(loss, state)
        self.set_up.free_attempt()
        self.set_up.local = None
