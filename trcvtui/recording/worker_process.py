"""A process that writes one answer into a file. The file's first line shows the progress meanwhile."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path

from trcvtui.files import open_private_file
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.writer import WriterProcess


class PendingAnswer:
    def __init__(self, main: tuple[str, str]) -> None:
        self.progress = ""
        self._opened = ExitStack()
        self._file, name = self._opened.enter_context(open_private_file())
        path = Path(name.replace("self", str(os.getpid()), 1) if name.startswith("/proc") else name)  # ours
        self.process = WriterProcess(path, RecordTarget(path), waits=False, main=main)

    def advance(self) -> bytes | None:
        """Send waiting bytes to the process; return the answer when the process is over, None before."""
        self.process.advance()
        if not (self.process.is_over or self.process.trouble):
            line, line_end, _ = os.pread(self._file, 1024, 0).partition(b"\n")
            self.progress = line.decode(errors="replace") if line_end else self.progress
            return None
        content = os.pread(self._file, os.fstat(self._file).st_size, 0)
        self.close()
        return content

    def close(self) -> None:
        self.process.kill()
        self._opened.close()
