"""What a screen may do with its engine, and how that ends.

Rule: importing this costs next to nothing, because nothing else happens before the engine is started.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

if TYPE_CHECKING:
    from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest


MOST_TABS: Final = 8  # of `serve`
READ_ONLY: Final = "this screen is read-only; `trcvtui serve --write`, or `run` without --read-only, commands"
READ_ONLY_COMMANDS: Final = frozenset(("expect", "find"))  # first words: they compare, and go to an edge


def reads_only(line: str) -> bool:
    """Return whether a read-only screen may give a line: its engine carries out no other one."""
    return line.strip().partition(" ")[0] in READ_ONLY_COMMANDS


class EngineStopped(Exception):
    """The engine process has ended; its last words say why, the last line of them in short.

    `ends_screen`: nothing can be shown any more, not even that. `is_internal`: an error of this program, or
    a signal, has ended it; `folder`: where its recording is, None: there is none.
    """

    ends_screen = is_internal = False
    folder: Path | None = None


class Driver(Protocol):
    """What a screen may do with a bench; `is_shared`: other tabs of `serve` have it, too."""

    is_shared: bool

    def submit(self, line: str) -> int:
        """Send one bench command line; return the number under which its answer comes."""

    def request(self, request: UpdateRequest) -> None:
        """Ask for a picture; at most one request is outstanding."""

    def poll_picture(self) -> BenchUpdate | None:
        """Return the newest picture that has arrived since the last call."""

    def describe_cuts(self) -> str:
        """Return what is cut when the screen quits, in words; "" for nothing."""

    def restart(self) -> None: ...

    def close(self) -> None: ...
