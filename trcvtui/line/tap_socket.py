"""The socket of a tap: where it is, and the process that serves its observers with pcapng and notes.

It is between the tap and its observers, so that what forwards waits for none of them, and builds no packet.
"""

from __future__ import annotations

import json
import os
from hashlib import sha256
from pathlib import Path

from trcvtui import paths
from trcvtui.line.tapped import TapCapture
from trcvtui.net.os.observers import ObserverServer, connect_to_tap
from trcvtui.signals import GROUP_SIGNALS, ignore_signals


def make_socket_path(project: Path) -> Path:
    """Return where the tap of a project and its observers find each other."""
    whole = project.resolve()
    digest = sha256(os.fsencode(whole)).hexdigest()[:8]
    return paths.runtime_folder() / f"tap-{whole.stem[:40]}-{digest}.sock"


def open_connection(project: Path) -> int:
    """Return the descriptor of a connection to the tap of a project; raise UserError where none runs."""
    return connect_to_tap(make_socket_path(project), f"`trcvtui tap --project {project}` beside it")


def serve_observers(events: str, ways: str, path: str, may_order: str, told: str) -> None:
    """Serve until the tap ends, which tells `events` and hands over `ways`; path "": no guests.

    `told`: its taps, and which end is the PLC, in JSON.
    """
    ignore_signals(GROUP_SIGNALS)  # they end the tap, and its end ends us
    place = Path(path) if path else None
    capture = TapCapture("what passes a tap", json.loads(told))
    ObserverServer(int(events), int(ways), place, may_order == "1", capture).run()
