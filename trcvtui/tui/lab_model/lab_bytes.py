"""The bytes that the lab looks at: DATA, a job, a message of the stream, or hex that was typed in.

Rule: only what a message brought says how long the sender's telegram is; DATA and jobs are as long as ours.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from trcvtui.rig.history.window import END, MOST_WINDOW, HistoryRequest, HistoryWindow, JobSpan
from trcvtui.tui.formatting import count, plain
from trcvtui.tui.view_model.view_model import Scene

DATA, JOB, LAST, MESSAGE, HEX = "data", "job", "last", "message", "hex"
SOURCES: Final = (DATA, JOB, LAST, MESSAGE, HEX)
MOST_MESSAGES: Final = 8  # that a judgement of profiles is made from
ABOUT: Final = {
    DATA: "DATA of the selected instance",
    JOB: "what its running job has collected so far",
    LAST: "its last job that ended with DONE",
    MESSAGE: "a message of the peer, as it was sent",
    HEX: "hex that you type or paste",
}


class Piece(NamedTuple):
    """Bytes of the stream, and what the screen calls them."""

    name: str
    content: bytes


class LabBytes:
    """Which bytes are looked at; `back` counts the messages from the newest one."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.source = DATA
        self.is_chosen = False  # by the user
        self.back = 0
        self.typed = b""
        self._last: JobSpan | None = None

    def begin(self) -> str:
        """Take the running job's bytes where nobody chose and no job has written DATA; return what to say."""
        if self.is_chosen or self.source not in (DATA, JOB):
            return ""
        declared, is_empty = self._scene.declaration, not any(self._scene.data)
        self.source = JOB if is_empty and self._scene.partial and not self._is_written() else DATA
        if self.source == DATA or declared is None:
            return ""
        return f"DATA {plain(declared.name)} has never been written: these are the bytes of the running job"

    def _is_written(self) -> bool:
        """Return whether a job has ended that received into DATA of the selected instance."""
        snapshot, instance = self._scene.snapshot, self._scene.instance
        if snapshot is None or instance is None:
            return False
        return any(one.jobs_done for one in snapshot.instances if one.data == instance.data and not one.sends)

    def request(self) -> HistoryRequest | None:
        """Return what of the stream to ask for: also under DATA, profiles are judged by what was sent."""
        instance = self._scene.instance
        if instance is None:
            return None
        window, job = self._window(), None
        if window is not None and self.source == LAST:
            mine = [span for span in window.jobs if span.instance == instance.name and span.done]
            self._last = mine[-1] if mine else self._last
            job = self._last.position if self._last is not None else None
        return HistoryRequest(instance.connect, END, MOST_WINDOW, job_at=job)

    def _window(self) -> HistoryWindow | None:
        window, instance = self._scene.past, self._scene.instance
        return window if window is not None and instance and window.connect == instance.connect else None

    # -- what is there ------------------------------------------------------------------------------

    @property
    def content(self) -> bytes:
        """Return the bytes."""
        match self.source:
            case "data":
                return self._scene.data
            case "job":
                return self._scene.partial
            case "last":
                window = self._window()
                return window.job[1] if window is not None and window.job is not None else b""
            case "message":
                return self._message().content
            case _:
                return self.typed

    @property
    def name(self) -> str:
        """Return what the screen calls them."""
        size = f"{len(self.content)} B"
        match self.source:
            case "data":
                declared = self._scene.declaration
                return f"DATA {plain(declared.name)}, {size}" if declared else "no DATA"
            case "job":
                return f"job of {plain(self._scene.selected)}, {size} so far"
            case "last":
                number = f" {self._last.number}" if self._last is not None else ""
                return f"last job{number}, {size}" if self.content else "no job has ended yet"
            case "message":
                return f"{self._message().name}, {size}" if self.messages() else "no message yet"
            case _:
                return f"typed hex, {size}"

    def _has_messages(self) -> bool:
        return self.source not in (LAST, HEX) and bool(self.messages())

    def _message(self) -> Piece:
        messages = self.messages()
        self.back = max(0, min(self.back, len(messages) - 1))
        return messages[-1 - self.back] if messages else Piece("", b"")

    def messages(self) -> list[Piece]:
        """Return the whole messages of the stream, oldest first; of a stranger what each recv brought."""
        window = self._window()
        if window is None:
            return []
        found = [
            Piece(f"{plain(span.peer)} message {span.number}", _cut(window, span.position, span.stop))
            for span in window.messages
            if span.begins and span.ends and span.position >= window.start and span.stop <= window.stop
        ]
        return found or [
            Piece(f"recv {span.number}", _cut(window, span.position, span.stop))
            for span in window.recvs
            if span.position >= window.start and span.stop <= window.stop
        ]

    def evidence(self) -> tuple[list[bytes], bool]:
        """Return what profiles are judged by, and whether its lengths are the sender's.

        Where DATA or a job is shown the messages that they were made from say more.
        """
        if self._has_messages():
            return [piece.content for piece in self.messages()[-MOST_MESSAGES:]], True
        instance = self._scene.instance
        is_sent = self.source == HEX or (self.source == LAST and instance is not None and instance.adhoc)
        content = self.content
        return [content] if content else [], is_sent

    @property
    def evidence_name(self) -> str:
        """Return what they are called."""
        if not self._has_messages():
            return self.name
        return count(min(MOST_MESSAGES, len(self.messages())), "message")

    # -- choosing -----------------------------------------------------------------------------------

    def step(self, messages: int) -> None:
        """Go to an older or newer message."""
        self.source, self.is_chosen = MESSAGE, True
        self.back = max(0, min(self.back - messages, max(0, len(self.messages()) - 1)))


def _cut(window: HistoryWindow, start: int, stop: int) -> bytes:
    return window.content[start - window.start : stop - window.start]
