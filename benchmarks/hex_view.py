"""M6: a hex view costs what is in view: first paint, a page and memory of 1 GiB beside those of 64 KiB."""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, Pairs, against, alternate, ratios, spread
from benchmarks.terminal import Terminal

HERE: Final = Path(__file__).parent
SMALL, LARGE = 64 << 10, 1 << 30
PAGES: Final = 30
PAGE_DOWN: Final = "\x1b[6~"
PRIVATE: Final = re.compile(r"^Private_(?:Clean|Dirty):\s+(\d+) kB", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Seen:
    """One program start: seconds to the first row of bytes, seconds a page, private memory in MB."""

    first_s: float
    page_s: float
    private_mb: float


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield first paint and page time of 1 GiB against 64 KiB, and how much more memory it takes."""
    with tempfile.TemporaryDirectory() as folder:
        small, large = Path(folder) / "small", Path(folder) / "large"
        for path, size in ((small, SMALL), (large, LARGE)):
            with path.open("wb") as file:
                file.truncate(size)  # a hole: 1 GiB without a disk of that size
        try:
            seen: dict[Path, list[Seen]] = {small: [], large: []}

            def look(path: Path) -> float:
                seen[path].append(_look(path))
                return seen[path][-1].first_s

            look(small), look(large)  # warm
            seen = {small: [], large: []}
            first = alternate(lambda: look(large), lambda: look(small), max(effort.starts, 3))
            pages = [
                (ours.page_s, theirs.page_s) for ours, theirs in zip(seen[large], seen[small], strict=True)
            ]
            memory = [
                big.private_mb - less.private_mb for big, less in zip(seen[large], seen[small], strict=True)
            ]
        except TimeoutError as failed:
            yield Figure.missing("hex view", f"the view did not open: {failed}")
            return
    yield _compared("first paint of 1 GiB / 64 KiB", first)
    yield _compared(f"a page of 1 GiB / 64 KiB, {PAGES} pages", pages)
    if sys.platform == "linux":
        yield Figure.of("private memory of 1 GiB - 64 KiB", spread(memory), 1, " MB")


def _compared(case: str, figures: Pairs) -> Figure:
    return Figure.of(case, ratios(figures), note=against(figures, 1, " ms", 1000))


def _look(path: Path) -> Seen:
    """Open the view, page down, and see how much memory is the program's own."""
    with Terminal([sys.executable, str(HERE / "hex_app.py"), str(path)]) as terminal:
        first = terminal.wait_for(["0000  00"])
        terminal.wait_for(["pid=", "rows="])
        rows, pid = (int(_after(terminal, key + rb"=(\d+)")) for key in (b"rows", b"pid"))
        began = time.perf_counter()
        for page in range(1, PAGES + 1):
            terminal.forget()
            terminal.type(PAGE_DOWN)
            terminal.wait_for([f"{page * rows * 16:x}  00"])
        page_s = (time.perf_counter() - began) / PAGES
        private = _private_mb(pid)
        terminal.end("q")
    return Seen(first, page_s, private)


def _after(terminal: Terminal, pattern: bytes) -> bytes:
    found = re.search(pattern, terminal.written())
    if found is None:
        raise TimeoutError(f"not seen: {pattern!r}")
    return found[1]


def _private_mb(pid: int) -> float:
    if not os.path.exists(f"/proc/{pid}/smaps_rollup"):
        return 0.0
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return sum(map(int, PRIVATE.findall(text))) / 1024
