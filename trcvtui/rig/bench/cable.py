"""How `link C1 down` cuts a wire, on each kernel, and the network of its own that `--netns` asks for."""

from __future__ import annotations

from typing import Final

from trcvtui.errors import mistake
from trcvtui.net.kernel import Kernel
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.os.network import LOOPBACK, set_loopback
from trcvtui.net.os.network import enter as enter_namespace
from trcvtui.net.os.network import is_own_network as is_own_network
from trcvtui.project.project import SimDecl

NO_ADDRESSES: Final = SimDecl()


def enter_own_network(kernel: str, sim: SimDecl = NO_ADDRESSES) -> None:
    """Move this process into a fresh network with the addresses of [sim]; raise UserError where it cannot."""
    if kernel != "live":
        raise mistake("--netns", f"--kernel {kernel}", "--kernel live, which has a network to be moved")
    wrong = enter_namespace(sim.addresses, sim.not_ethernet)
    if wrong:
        raise mistake("--netns", wrong, "one that lets a program have a network of its own")


def set_link(kernel: Kernel, connect: str, up: bool) -> tuple[str, str]:
    """Cut the wire of a CONNECT or mend it; return what is wrong, or "", and by what means it was done."""
    if not isinstance(kernel, OsKernel):
        return kernel.set_link(connect, up), "simulated wire"
    if is_own_network():
        how = "up" if up else "down: it carries every CONNECT and peer"
        return set_loopback(up), f"interface {LOOPBACK} {how}"
    return kernel.set_link(connect, up), "packets pass again" if up else "packets dropped at the sockets"
