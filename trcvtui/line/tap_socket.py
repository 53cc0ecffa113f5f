"""The socket of a tap: where it is, and the process that serves its observers with pcapng and notes.

It stands between the tap and its observers, so that what forwards waits for none of them, and builds no
packet. Where an observer does not read, the tap leaves out whole events, and says how many: a block of
statistics.
"""

from __future__ import annotations

import os
from functools import partial
from hashlib import sha256
from pathlib import Path

from trcvtui import paths
from trcvtui.errors import UserError
from trcvtui.line.tapped import TapCapture
from trcvtui.net.os.forwarder import say_at_once
from trcvtui.net.os.observers import ObserverServer, connected
from trcvtui.signals import OF_A_GROUP, leave


def socket_of(project: Path) -> Path:
    """Return where the tap of a project and its observers find each other."""
    whole = project.resolve()
    digest = sha256(os.fsencode(whole)).hexdigest()[:8]
    return paths.runtime_folder() / f"tap-{whole.stem[:40]}-{digest}.sock"


def connection_to(project: Path) -> int:
    """Return the descriptor of a connection to the tap of a project; raise UserError where none runs."""
    return connected(socket_of(project), f"`trcvtui tap --project {project}` beside it")


def serve_observers(asks: str, path: str, may_order: str) -> None:
    """Serve until stdin, and with it the tap, ends, which hands over ways on `asks`."""
    leave(OF_A_GROUP)  # they end the tap, and its end ends us
    try:
        Path(path).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        capture = partial(TapCapture, "what passes a tap", True)
        server = ObserverServer(Path(path), int(asks), may_order == "1", capture, say_at_once)
    except (UserError, OSError) as refused:
        say_at_once(f"no observers: {refused}")
        return
    server.run_until(0)
