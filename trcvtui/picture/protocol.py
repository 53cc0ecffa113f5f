"""What an engine offers a screen, and how an engine ends.

Rule: this module is imported before the engine starts, so its import must take almost no time.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

if TYPE_CHECKING:
    from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest


MOST_TABS: Final = 8  # of `serve`
READ_ONLY: Final = "this screen is read-only; to command: `serve --write`, or `run` without --read-only"
READ_ONLY_COMMANDS: Final = frozenset(("expect", "find"))  # first words: a comparison, and a move to an edge


def reads_only(line: str) -> bool:
    """Return whether a read-only screen may send a line; the engine refuses any other line from it."""
    return line.strip().partition(" ")[0] in READ_ONLY_COMMANDS


class EngineStopped(Exception):
    """The engine process has ended. The text says why. The last line of the text is the short reason.

    If `ends_screen`, the screen cannot continue. If `is_internal`, an error of this program or a signal has
    ended the engine. `folder` is the folder of the engine's recording, if any.
    """

    ends_screen = is_internal = False
    folder: Path | None = None


class BenchDriver(Protocol):
    """What a screen may do with a bench. With `is_shared`, other tabs of `serve` use this bench, too."""

    is_shared: bool

    def submit(self, line: str) -> int:
        """Send one bench command line; return the number that the answer to this line will have."""

    def request(self, request: UpdateRequest) -> None:
        """Ask for a picture; wait for its answer before you ask again."""

    def poll_picture(self) -> BenchUpdate | None:
        """Return the newest picture that has arrived since the last call."""

    def describe_quit_cuts(self) -> str:
        """Return in words which connections are cut when the screen quits, or "" for none."""

    def restart(self) -> None: ...

    def close(self) -> None: ...
