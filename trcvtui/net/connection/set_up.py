"""How a connection is set up (TCON), step by step: from creating its socket to the first partner.

Every failure names its SetUpStage: each vendor has a code for each stage. No vendor's codes are here.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto
from typing import Final

from msgspec import Struct

from trcvtui.net.connection.config import ConnectConfig, ConnectionPolicy
from trcvtui.net.connection.resources import (
    ACCEPT_UNITS,
    TURN_AWAY_UNITS,
    BudgetShare,
    ConnectionIds,
    IdHolder,
    ScanBudget,
)
from trcvtui.net.events import EventKind
from trcvtui.net.kernel import Handle, Kernel, LocalAddress, NewClient, SocketOptions
from trcvtui.net.results import ANY_ADDRESS, WOULD_BLOCK, Endpoint, Fault, WouldBlock, is_group, is_loopback


def find_address_error(address: str, own: tuple[LocalAddress, ...], strict: bool) -> str:
    """Return why the address cannot be used, or "" if it can. If `strict` is True, loopback is an error.

    `own` is empty if the system could not list its addresses. Then bind decides.
    """
    if address == ANY_ADDRESS:
        return "0.0.0.0 names no port of the PLC"
    if is_group(address):
        return f"{address} is a multicast or broadcast address"
    mine = next((a for a in own if a.address == address), None)
    network = next((a for a in own if a.broadcast == address), None)
    if network is not None and mine is None:
        return f"{address} is the broadcast address of {network.interface}"
    if is_loopback(address):
        return f"{address} is loopback, no Ethernet port" if strict else ""
    if not own:
        return ""
    if mine is None:
        return f"{address} is no address of this machine"
    return "" if mine.ethernet else f"{address} is on {mine.interface}, which is no Ethernet port"


PORT_TAKEN_ERRORS: Final = frozenset({"EADDRINUSE", "EADDRNOTAVAIL"})


class SetUpStage(Enum):
    DESCRIPTION = auto()
    IDENTITY = auto()
    SOCKET = auto()
    ADDRESS = auto()
    REUSE = auto()
    BIND = auto()
    POLL_ADD = auto()
    ACCEPT = auto()
    CONNECT = auto()


class StepFault(Struct, frozen=True):
    """A set-up step that failed; `detail` is a text for the user."""

    stage: SetUpStage
    fault: Fault
    detail: str = ""
    client: str = ""  # the accepted client that could not be taken over


class SetUp:
    """The listener or the running attempt of one CONNECT."""

    def __init__(
        self,
        config: ConnectConfig,
        kernel: Kernel,
        policy: ConnectionPolicy,
        resolve: Callable[[str], int | None],
        connection_ids: ConnectionIds,
        note: Callable[[EventKind, Endpoint | None, str], None],
        work: ScanBudget,
    ) -> None:
        self.config = config
        self.listener: Handle | None = None
        self.attempt: Handle | None = None
        self.local: Endpoint | None = None
        self.remote: Endpoint | None = None
        self.is_withdrawn = False  # before it was up, a block that may not close it asked to
        self.is_closing = False  # a block is still showing that it closes the endpoint
        self._clients = BudgetShare(work, config.name, EventKind.CLIENTS_WAIT)
        self._holder = IdHolder(config)
        self._connection_ids = connection_ids
        self._kernel, self._policy, self._resolve, self._note = kernel, policy, resolve, note
        self._verdict: Fault | None = None
        self._is_resolving = False  # the resolver, for the address of the partner's name
        self._deadline = 0
        self._has_noted_limit = False
        self._resolved_port: int | None = None
        self._kept_port = config.local.port
        self._successor: NewClient | None = None  # accepted while the connection before it was ending

    @property
    def has_been_up(self) -> bool:
        """Return whether the CONNECT has had a partner since its endpoint was opened."""
        return self._holder.has_been_up

    @property
    def listening_end(self) -> Endpoint | None:
        """Return where a partner can reach this CONNECT, None while it does not listen."""
        return self.local if self.listener is not None else None

    @property
    def deadline(self) -> int | None:
        """Return when (ns) the running attempt is given up, or None without an attempt."""
        return None if self.attempt is None else self._deadline

    def check_and_claim(self) -> StepFault | None:
        """Check what needs no socket, and take the ID. Return why the connection may not be opened."""
        return self.claim_description()

    def claim_description(self) -> StepFault | None:
        """Check the connection description, and take its ID."""
        flaw = self.config.flaw
        if flaw is not None:
            return StepFault(SetUpStage.DESCRIPTION, Fault("description", flaw.flaw), flaw.text)
        taken = self._connection_ids.try_take(self._holder)
        if taken is None:
            return None
        conflict, holder = taken
        text = f"ID {self._holder.identity} is that of {holder}"
        return StepFault(SetUpStage.IDENTITY, Fault("identity", conflict), text)

    def create_socket(self) -> StepFault | None:
        make = self._kernel.datagram_socket if self.config.is_datagram else self._kernel.socket
        made = make(self.config.name)
        if isinstance(made, Fault):
            return StepFault(SetUpStage.SOCKET, made)
        self.attempt = made
        return None

    def bind_and_start(self, now: int) -> StepFault | None:
        """Bind the socket, then listen or start to connect."""
        assert self.attempt is not None
        if self.config.keep_alive_limit_note and not self._has_noted_limit:
            self._has_noted_limit = True
            self._note(EventKind.OPTION_LIMITED, None, self.config.keep_alive_limit_note)
        self._set_options(self.attempt)
        return self._bind(self.attempt) or (
            self._connect(self.attempt, now) if self.config.active else self._listen(self.attempt)
        )

    def _bind(self, handle: Handle) -> StepFault | None:
        local = Endpoint(self.config.local.address, self._kept_port)
        own = self._kernel.local_addresses()
        wrong = find_address_error(local.address, own, self._policy.strict_local_address)
        if wrong and not self.config.any_local:  # any_local: the system's routing chooses
            return StepFault(SetUpStage.ADDRESS, Fault("address", wrong))
        fault = self._set_reuse(handle)
        if fault is not None:
            return StepFault(SetUpStage.REUSE, fault)
        fault = self._kernel.bind(handle, local)
        if fault is not None and self._may_take_another_port(fault):
            self._kept_port, local = 0, self.config.local
            fault = self._kernel.bind(handle, local)
        if fault is None:
            return None
        stage = SetUpStage.ADDRESS if fault.error == "EADDRNOTAVAIL" else SetUpStage.BIND
        return StepFault(stage, fault, self._bind_hint(fault, local))

    def _may_take_another_port(self, fault: Fault) -> bool:
        is_kept = not self.config.local.port and self._kept_port
        # A planned fault must show, and must not be avoided by another port.
        return bool(is_kept) and fault.error == "EADDRINUSE" and not fault.injected

    def _set_reuse(self, handle: Handle) -> Fault | None:
        return self._kernel.set_reuse(handle)

    def _bind_hint(self, fault: Fault, local: Endpoint) -> str:
        if fault.error != "EACCES" or self.config.session is None or not self.config.session.shares_port:
            return ""
        return f"this user may not use {local}: IsoPort sets another port"  # ports below 1024 need a right

    def _listen(self, handle: Handle) -> StepFault | None:
        fault = self._kernel.listen(handle, self._policy.backlog)
        if fault is not None:
            return StepFault(SetUpStage.BIND, fault)  # EADDRINUSE of listen is a taken port too
        fault = self._kernel.poll_add(handle)
        if fault is not None:
            return StepFault(SetUpStage.POLL_ADD, fault)
        self.listener, self.attempt = handle, None
        self.local = self._kernel.local_end(handle)
        if self.local is not None:
            self._kept_port = self.local.port  # LocalPort 0 keeps the port it got until STOP
        self._note(EventKind.LISTENING, None, "")
        return None

    def _connect(self, handle: Handle, now: int) -> StepFault | None:
        fault = self._kernel.poll_add(handle)
        if fault is not None:
            return StepFault(SetUpStage.POLL_ADD, fault)
        self.local = self._kernel.local_end(handle)
        self._deadline = now + self._policy.attempt_limit_ns
        # A refusal by the call itself is kept until the next poll: a first attempt shows 7002 before 80A0.
        self._verdict = self._start_connect(handle)
        self._note(EventKind.CONNECTING, self.remote, "")
        return None

    def _start_connect(self, handle: Handle) -> Fault | None:
        port = self._resolve_port()
        if port is None:
            return Fault("resolve", f"{self.config.remote_port} does not listen")
        address = self._resolve_address(handle)
        self._is_resolving = isinstance(address, WouldBlock)
        if not isinstance(address, str):
            return address if isinstance(address, Fault) else None
        self.remote = Endpoint(address, port)
        # 3.1: 0.0.0.0 would silently mean loopback; and a socket can connect to itself.
        if address == ANY_ADDRESS or self.remote == self.local:
            return Fault("address", f"{self.remote} cannot be connected to")
        return self._kernel.connect(handle, self.remote)

    def _resolve_address(self, handle: Handle) -> str | WouldBlock | Fault:
        name = self.config.remote_name
        return self._kernel.resolve(handle, name) if name else self.config.remote_address

    def _resolve_port(self) -> int | None:
        """Return RemotePort. For `@NAME`, return the port where NAME listens now, or listened last."""
        port = self.config.remote_port
        if isinstance(port, int):
            return port
        self._resolved_port = self._resolve(port) or self._resolved_port
        return self._resolved_port

    def poll_attempt(self, now: int) -> NewClient | StepFault | None:
        """Return the result of the running attempt of an active CONNECT, None while it has no result."""
        assert self.attempt is not None
        if self._is_resolving:
            self._verdict = self._start_connect(self.attempt)
        verdict: Fault | WouldBlock | None = WOULD_BLOCK if self._is_resolving else self._verdict
        if verdict is None:
            verdict = self._kernel.connect_result(self.attempt)
        if verdict is WOULD_BLOCK:
            if now < self._deadline:
                return None
            verdict = Fault("attempt_limit", "ETIMEDOUT")
        if isinstance(verdict, Fault):
            # With a fixed LocalPort these are not about the partner: the port is still in use.
            taken = self.config.local.port and verdict.error in PORT_TAKEN_ERRORS
            return StepFault(SetUpStage.BIND if taken else SetUpStage.CONNECT, verdict)
        assert self.remote is not None
        handle, self.attempt = self.attempt, None
        self._holder.has_been_up = True
        return NewClient(handle, self.remote)

    def accept_partner(self) -> NewClient | StepFault | None:
        """Accept the next client that may be the partner; reset all other clients."""
        if self._successor is not None:
            client, self._successor = self._successor, None
            return client
        got = self._accept_client()
        while isinstance(got, NewClient) and self._is_wrong_partner(got.peer):
            self.turn_away(got, EventKind.WRONG_PARTNER)
            got = self._accept_client()
        return got

    def keep_successor(self, client: NewClient) -> None:
        """Store an accepted client as the next partner: the connection before it has just ended."""
        self._successor = client

    def _accept_client(self) -> NewClient | StepFault | None:
        if self.listener is None or not self._kernel.readable(self.listener):
            return None
        if self._clients.units_left <= 0:  # a flood of clients must not keep the scan here
            self._clients.note_waiting()
            return None
        got = self._kernel.accept(self.listener)
        if isinstance(got, NewClient):
            self._clients.spend(ACCEPT_UNITS)
            return got
        return StepFault(SetUpStage.ACCEPT, got) if isinstance(got, Fault) else None

    def _is_wrong_partner(self, peer: Endpoint) -> bool:
        address, port = self.config.remote_address, self._resolve_port()
        if self._policy.check_remote_ip and address not in (ANY_ADDRESS, peer.address):
            return True
        return bool(self._policy.check_remote_port and port and port != peer.port)

    def turn_away(self, client: NewClient, what: EventKind) -> None:
        """Reset a client at once; its bytes never reach DATA."""
        self._clients.spend(TURN_AWAY_UNITS)
        self._kernel.abort(client.handle)
        self._note(what, client.peer, "")

    def take_over(self, client: NewClient) -> StepFault | None:
        """Put an accepted client into the poll set and give it the CONNECT's options."""
        fault = self._kernel.poll_add(client.handle)
        if fault is not None:
            self._kernel.abort(client.handle)
            return StepFault(SetUpStage.POLL_ADD, fault, client=str(client.peer))
        self._set_options(client.handle)
        self._holder.has_been_up = True
        return None

    def _set_options(self, handle: Handle) -> None:
        options = SocketOptions(
            nodelay=self.config.send_delay_opt,
            keep_alive_s=self.config.keep_alive_s,
            small_buffers=self._policy.small_buffers,
            session=self.config.session,
        )
        refused = self._kernel.set_options(handle, options)
        if refused:  # only noted: the connection works without them
            self._note(EventKind.OPTION_REFUSED, None, ", ".join(refused))

    def free(self) -> Fault | None:
        """Close the listener and give up the attempt."""
        fault = None
        self.is_withdrawn = self._has_noted_limit = False
        self._connection_ids.give_back(self._holder)
        if self._successor is not None:  # no block will see it
            self._kernel.abort(self._successor.handle)
            self._successor = None
        if self.listener is not None:
            fault = self._kernel.close(self.listener)
            self.listener = self.local = None
        return self.free_attempt() or fault

    def free_attempt(self) -> Fault | None:
        """Give up the attempt."""
        if self.attempt is None:
            return None
        fault = self._kernel.abort(self.attempt)  # no TIME_WAIT: so a fixed LocalPort is free at once
        self.attempt, self._verdict, self._is_resolving = None, None, False
        return fault

    def forget_port(self) -> None:
        """At PLC STOP, give up a port that was taken for LocalPort 0."""
        self._kept_port = self.config.local.port
        self.local = self.remote = None
