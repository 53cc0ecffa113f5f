"""UDP broadcasts: one socket may send them, and a second one hears those of its network.

A socket that is bound to an address gets no broadcast on Linux. The second one is bound to the broadcast
address of that very network, never to 0.0.0.0; 255.255.255.255 comes to neither.
"""

from __future__ import annotations

from typing import Final

from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.results import WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock, is_loopback

MOST_OWN: Final = 256  # datagrams of our own that one call passes over


def begin_broadcasts(
    kernel: Kernel, owner: str, handle: Handle, local: Endpoint, polled: bool = True
) -> Handle | str:
    """Let a socket send broadcasts; return a second one that hears those of its network, or why not."""
    refused = kernel.set_broadcast(handle)
    if refused is not None:
        return str(refused)
    both_loopback = is_loopback(local.address)  # all of 127.0.0.0/8 is one network
    own = (
        each.broadcast
        for each in kernel.local_addresses()
        if each.address == local.address or (both_loopback and is_loopback(each.address))
    )
    everybody = next(own, "")
    if not everybody:
        return f"this system tells no broadcast address of {local.address}"
    made = kernel.datagram_socket(owner)
    if isinstance(made, Fault):
        return str(made)
    end = Endpoint(everybody, local.port)
    fault = kernel.set_reuse(made) or kernel.bind(made, end) or (kernel.poll_add(made) if polled else None)
    if fault is None:
        return made
    kernel.close(made)
    return f"{end}: {fault}"


def take_of_others(
    kernel: Kernel, handles: tuple[Handle, Handle], into: memoryview, own: Endpoint | None
) -> Datagram | WouldBlock | Fault:
    """Take the next datagram of another end: the stack brings back our own, which a CPU does not hear."""
    for handle in handles:
        for _ in range(MOST_OWN):
            got = kernel.recv_from(handle, into)
            if got is WOULD_BLOCK:
                break
            if not isinstance(got, Datagram) or got.source != own:
                return got
    return WOULD_BLOCK
