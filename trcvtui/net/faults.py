"""Planned faults: which call fails, when, and with which errno. The kernel and port here fail as planned.

A planned fault carries `injected=True`, so that it is not mistaken for a fault of the network.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Final

from msgspec import Struct, structs

from trcvtui.errors import mistake
from trcvtui.net.kernel import KERNEL_CALLS, Handle, Kernel, KernelProxy, NewClient
from trcvtui.net.results import Fault, WouldBlock
from trcvtui.net.serial_line import SERIAL_CALLS, LineErrors, PortOpening, SerialPort

# The errno of a call when the plan names none: what Linux answers.
DEFAULT_ERROR: Final = {
    "socket": "EMFILE",
    "set_reuse": "EPERM",
    "bind": "EADDRINUSE",
    "listen": "EADDRINUSE",
    "poll_add": "ENOSPC",
    "poll_del": "ENOENT",
    "accept": "EMFILE",
    "resolve": "EAI_NONAME",
    "connect": "ECONNREFUSED",
    "recv": "ECONNRESET",
    "send": "ECONNRESET",
    "shutdown": "ENOTCONN",
    "abort": "ENOTCONN",
    "close": "EIO",
    "buffer": "ENOMEM",
    "queue": "EAGAIN",
    "open": "ENOENT",
    "read": "EIO",
    "write": "EIO",
}
# This system's names and those of the connection errors that another system may not have.
KNOWN_ERRORS: Final = frozenset(errno.errorcode.values()) | {
    *DEFAULT_ERROR.values(),
    *("EACCES", "EADDRNOTAVAIL", "EALREADY", "EBADF", "ECONNABORTED", "EEXIST", "EHOSTDOWN", "EHOSTUNREACH"),
    *("EINVAL", "EISCONN", "ENETDOWN", "ENETRESET", "ENETUNREACH", "ENFILE", "ENOBUFS", "ENOPROTOOPT"),
    *("ENOTSOCK", "EPIPE", "ETIMEDOUT"),
    *("EAI_AGAIN", "EAI_FAIL", "EAI_NONAME"),
}


class PlannedFault(Struct, frozen=True):
    """One planned fault: from the `nth` such call on, `times` calls fail; None: all, until cleared."""

    call: str
    error: str
    on: str | None = None
    nth: int = 1
    times: int | None = 1
    seen: int = 0

    def __str__(self) -> str:
        """Return a text like the bench command `fault` that plans this fault."""
        parts = ["fault", self.call, self.error]
        parts += [f"on {self.on}"] if self.on is not None else []
        parts += [f"nth={self.nth}"] if self.nth != 1 else []
        if self.times is None:
            parts.append("times=forever")
        elif self.times != 1:
            parts.append(f"times={self.times}")
        return " ".join(parts)


def ignore_fault(owner: str, fault: Fault) -> None:
    """Do nothing: a plan without a ledger calls this for each fault."""


class FaultPlan:
    """Which calls fail. `active` is False while nothing is planned."""

    def __init__(self) -> None:
        self.active = False
        self.fired: Callable[[str, Fault], None] = ignore_fault  # called with the owner and each fault
        self._entries: list[PlannedFault] = []

    def add(
        self, call: str, error: str | None = None, on: str | None = None, nth: int = 1, times: int | None = 1
    ) -> None:
        """Plan a fault. `nth` counts the calls after `add`. Raise UserError if an argument is invalid."""
        if call not in KERNEL_CALLS and call not in SERIAL_CALLS:
            raise mistake("fault", call, "one of " + ", ".join((*KERNEL_CALLS, *SERIAL_CALLS)))
        name = error if error is not None else DEFAULT_ERROR[call]
        if name not in KNOWN_ERRORS:
            raise mistake(f"fault {call}", name, "an errno name such as " + DEFAULT_ERROR[call])
        if nth < 1:
            raise mistake(f"fault {call} nth", str(nth), "1 or more")
        if times is not None and times < 1:
            raise mistake(f"fault {call} times", str(times), "1 or more")
        self._entries.append(PlannedFault(call, name, on, nth, times))
        self.active = True

    def clear(self) -> None:
        self._entries.clear()
        self.active = False

    def entries(self) -> tuple[PlannedFault, ...]:
        """Return the faults that are still planned, in the order in which they were added."""
        return tuple(self._entries)

    def take_fault(self, call: str, owner: str) -> Fault | None:
        """Count a call of the owner; return the Fault that the call must return, or None."""
        if not self.active:
            return None
        fault: Fault | None = None
        remaining: list[PlannedFault] = []
        for entry in self._entries:
            if entry.call == call and entry.on in (None, owner):
                entry = structs.replace(entry, seen=entry.seen + 1)
                # An entry whose turn another one took fires at the next such call.
                if fault is None and entry.seen >= entry.nth:
                    fault = Fault(call, entry.error, injected=True)
                    entry = structs.replace(entry, times=None if entry.times is None else entry.times - 1)
            if entry.times != 0:
                remaining.append(entry)
        self._entries, self.active = remaining, bool(remaining)
        if fault is not None:
            self.fired(owner, fault)
        return fault


NO_HANDLES: Final[Mapping[Handle, str]] = {}
_SAME_NAME_CALLS: Final = ("set_reuse", "bind", "listen", "poll_add", "poll_del", "resolve", "connect")
# Calls that need no more than a check for a planned fault, with their names in the plan. A name that is
# asked for again (resolve) counts as another call.
FAULTED_CALLS: Final = {
    **{name: name for name in (*_SAME_NAME_CALLS, "recv", "send", "shutdown")},
    "recv_from": "recv",
    "send_to": "send",
    "probe": "shutdown",
}


class FaultyKernel(KernelProxy):
    """A Kernel around any kernel. Its calls fail as planned. All other calls pass through."""

    def __init__(self, inner: Kernel, plan: FaultPlan) -> None:
        super().__init__(inner)
        self.plan = plan
        self._ready: Callable[[], Collection[Handle]] = getattr(inner, "ready", self._list_polled)
        self._owners: dict[Handle, str] = {}
        self._held: dict[Handle, NewClient] = {}  # clients whose accept was made to fail
        for name, call in FAULTED_CALLS.items():
            setattr(self, name, partial(self._call, call, getattr(inner, name)))

    def _call(self, call: str, act: Callable[..., Any], handle: Handle, *more: Any, **named: Any) -> Any:
        return (self.plan.active and self._take_fault(call, handle)) or act(handle, *more, **named)

    def _take_fault(self, call: str, handle: Handle) -> Fault | None:
        return self.plan.take_fault(call, self._owners.get(handle, ""))

    def readable(self, handle: Handle) -> bool:
        """Return whether the last poll saw something, or a client waits after a planned accept fault."""
        return self.inner.readable(handle) or handle in self._held

    def _list_polled(self) -> Collection[Handle]:
        return [handle for handle in self._owners if self.inner.readable(handle)]

    def ready_handles(self) -> Mapping[Handle, str] | None:
        """Return the handles that the last poll saw, with owners, or None if every handle must be tried."""
        if self.plan.active or self._held:  # a fault may hit a handle that the poll did not see
            return None
        ready, owners = self._ready(), self._owners
        if not ready:
            return NO_HANDLES
        try:
            return dict(zip(ready, map(owners.__getitem__, ready), strict=True))
        except KeyError:  # a peer's handle is in the poll set, too
            return {handle: owners[handle] for handle in ready if handle in owners}

    def socket(self, owner: str) -> Handle | Fault:
        return self._make_socket(owner, self.inner.socket)

    def datagram_socket(self, owner: str) -> Handle | Fault:
        return self._make_socket(owner, self.inner.datagram_socket)

    def _make_socket(self, owner: str, make: Callable[[str], Handle | Fault]) -> Handle | Fault:
        made = self.plan.take_fault("socket", owner) or make(owner)
        if not isinstance(made, Fault):
            self._owners[made] = owner
        return made

    def accept(self, handle: Handle) -> NewClient | WouldBlock | Fault:
        """Take one client. Only an accept with a client counts; after a planned fault the client waits."""
        held = self._held.pop(handle, None)
        got = held or self.inner.accept(handle)
        if not isinstance(got, NewClient):
            return got
        fault = self._take_fault("accept", handle)
        if fault is not None:
            self._held[handle] = got
            return replace(fault, peer=str(got.peer))
        self._owners[got.handle] = self._owners.get(handle, "")
        return got

    def abort(self, handle: Handle) -> Fault | None:
        return self._free("abort", handle, self.inner.abort)

    def close(self, handle: Handle) -> Fault | None:
        return self._free("close", handle, self.inner.close)

    def _free(self, call: str, handle: Handle, free: Callable[[Handle], Fault | None]) -> Fault | None:
        fault = self._take_fault(call, handle)  # the handle is freed all the same (see Kernel.abort)
        self._owners.pop(handle, None)
        waiting = self._held.pop(handle, None)
        if waiting is not None:
            self.inner.abort(waiting.handle)
        answer = free(handle)
        return fault or answer


class FaultyPort:
    """A port whose calls fail as planned. A planned Fault of `read` or `write` also closes the port."""

    def __init__(self, port: SerialPort, plan: FaultPlan, owner: str) -> None:
        self._port, self._plan, self._owner = port, plan, owner

    def open(self) -> Fault | PortOpening | None:
        shown = self._port.open()
        if isinstance(shown, PortOpening):  # an attempt that lasts is one call: it counts when it is over
            return shown
        fault = self._plan.take_fault("open", self._owner)
        if fault is not None:
            self._port.close()
        return fault or shown

    def read(self, most: int) -> bytes | Fault:
        return self._take_fault("read") or self._port.read(most)

    def write(self, payload: bytes) -> int | Fault:
        return self._take_fault("write") or self._port.write(payload)

    def close(self) -> None:
        self._port.close()

    def simulate_arrival(self, payload: bytes) -> bool:
        return self._port.simulate_arrival(payload)

    def line_errors(self) -> LineErrors | None:
        return self._port.line_errors()

    def _take_fault(self, call: str) -> Fault | None:
        fault = self._plan.take_fault(call, self._owner)
        if fault is not None:
            self._port.close()
        return fault
