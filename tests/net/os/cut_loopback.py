"""Run alone, as its own process: cut loopback in a network of its own, and print how each connection died.

Needs no root: a user namespace with a network namespace is enough. Prints one line a
connection, `idle recv ETIMEDOUT`, or `refused` where the system allows no namespaces. Takes three seconds.
"""

from __future__ import annotations

import os
import select
import socket

from trcvtui.net.kernel import Handle, NewClient, SocketOptions
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.os.network import enter_namespace, set_loopback
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault


def connection(kernel: OsKernel, options: SocketOptions) -> tuple[Handle, Handle]:
    """Return both ends of a new connection; the first has the options and is in the poll set."""
    listener, client = kernel.socket("S"), kernel.socket("C")
    assert not isinstance(listener, Fault)
    assert not isinstance(client, Fault)
    assert kernel.bind(listener, Endpoint("127.0.0.1", 0)) is None
    assert kernel.listen(listener, 1) is None
    end = kernel.local_end(listener)
    assert end is not None
    kernel.set_options(client, options)
    assert kernel.connect(client, end) is None
    while kernel.connect_result(client) is WOULD_BLOCK:
        pass
    assert kernel.poll_add(client) is None
    server = kernel.accept(listener)
    assert isinstance(server, NewClient)
    return client, server.handle


def wait_for_the_end(kernel: OsKernel, ours: dict[str, Handle]) -> None:
    """Print the loss of each connection as it comes; give up after eight seconds."""
    for _ in range(800):
        kernel.poll()
        for name, handle in list(ours.items()):
            seen = kernel.loss(handle)
            if seen is not None:
                print(name, seen.fault, flush=True)
                del ours[name]
        if not ours:
            return
        select.select([quiet], [], [], 0.01)


quiet, _other = socket.socketpair()
if not enter_namespace():
    kernel = OsKernel()
    idle, _ = connection(kernel, SocketOptions(keep_alive_s=1))
    busy, _ = connection(kernel, SocketOptions(keep_alive_s=1, user_timeout_ms=2000))
    set_loopback(up=False)
    kernel.send(busy, memoryview(b"into the dark"))
    wait_for_the_end(kernel, {"idle": idle, "busy": busy})
    os._exit(0)  # the ends of cut connections need no farewell
print("refused")
