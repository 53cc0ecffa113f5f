"""One socket sends UDP broadcasts. A second socket receives the broadcasts of its network.

On Linux a socket that is bound to an address gets no broadcast. The second socket is bound to the broadcast
address of its network, never to 0.0.0.0. A datagram to 255.255.255.255 reaches neither socket.
"""

from __future__ import annotations

from typing import Final

from trcvtui.net.kernel import Handle, Kernel
from trcvtui.net.results import ANY_ADDRESS, WOULD_BLOCK, Datagram, Endpoint, Fault, WouldBlock, is_loopback

MOST_OWN_BROADCASTS: Final = 256  # datagrams of our own that one call skips


def enable_broadcasts(
    kernel: Kernel, owner: str, handle: Handle, local: Endpoint, polled: bool = True
) -> tuple[Handle | None, str]:
    """Let a socket send broadcasts. Return a socket that receives broadcasts or None, and what is wrong."""
    refused, here = kernel.set_broadcast(handle), local.address
    if refused is not None or here == ANY_ADDRESS:  # a socket at 0.0.0.0 receives them itself
        return None, str(refused or "")
    own = kernel.local_addresses()  # 127.0.0.0/8 is one network
    near = (a for a in own if a.address == here or (is_loopback(here) and is_loopback(a.address)))
    broadcast = next((each.broadcast for each in near), "")
    made = kernel.datagram_socket(owner) if broadcast else f"the broadcast address of {here} is unknown"
    if isinstance(made, Fault | str):
        return None, str(made)
    end = Endpoint(broadcast, local.port)
    refused = kernel.set_reuse(made) or kernel.bind(made, end) or (kernel.poll_add(made) if polled else None)
    if refused is None:  # set_reuse: several programs may listen at one broadcast address
        return made, ""
    kernel.close(made)
    return None, f"{end}: {refused}"


def receive_datagram(
    kernel: Kernel, handle: Handle, hearing: Handle | None, into: memoryview, own: Endpoint | None
) -> Datagram | WouldBlock | Fault:
    """Take the next datagram from `handle`. If it has none, use `hearing`, the socket for broadcasts."""
    got = kernel.recv_from(handle, into)
    if hearing is None or got is not WOULD_BLOCK:
        return got
    for _ in range(MOST_OWN_BROADCASTS):  # the stack loops our own back; a CPU does not receive its own
        got = kernel.recv_from(hearing, into)
        if not isinstance(got, Datagram) or got.source != own:
            return got
    return WOULD_BLOCK
