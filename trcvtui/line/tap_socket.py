"""The socket of a tap: its path, and the process that serves observers with pcapng and notes.

The process is between the tap and its observers. The forwarding process never waits and builds no packet.
"""

from __future__ import annotations

import json
import os
from hashlib import sha256
from pathlib import Path

from trcvtui import paths
from trcvtui.line.tap_capture import TapEncoder
from trcvtui.net.os.observers import ObserverServer, connect_to_tap
from trcvtui.signals import GROUP_SIGNALS, ignore_signals


def make_socket_path(project: Path) -> Path:
    """Return the socket path of a project's tap, the same for the tap and its observers."""
    whole = project.resolve()
    digest = sha256(os.fsencode(whole)).hexdigest()[:8]
    return paths.runtime_folder() / f"tap-{whole.stem[:40]}-{digest}.sock"


def open_connection(project: Path) -> int:
    """Return the descriptor of a connection to a project's tap; raise UserError if none runs."""
    return connect_to_tap(make_socket_path(project), f"`trcvtui tap --project {project}` beside it")


def serve_observers(events: str, ways: str, path: str, may_order: str, taps: str) -> None:
    """Serve observers until the tap ends.

    `events` and `ways` are descriptors for events and new channels. `path` is the socket, or "" for none.
    `taps` has the routes and the PLC end in JSON.
    """
    ignore_signals(GROUP_SIGNALS)  # they end the tap, and this process ends with it
    place = Path(path) if path else None
    capture = TapEncoder("what passes a tap", json.loads(taps))
    ObserverServer(int(events), int(ways), place, may_order == "1", capture).run()
