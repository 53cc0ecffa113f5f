"""M7: the export of bytes says what `hexdump -v -C` says, and is quicker than xxd."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import BinaryIO, Final

from benchmarks.figures import Effort, Figure, against, alternate, ratios
from trcvtui.udt.byte_text import hexdump

SIZE: Final = 16 << 20
SLOW_SIZE: Final = 2 << 20  # for hexdump itself
TOOLS: Final = (
    ("xxd", ("xxd",), SIZE),
    ("hexdump -v -C", ("hexdump", "-v", "-C"), SLOW_SIZE),
)


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield whether the text is the same, and how many times quicker than each tool it is."""
    yield _same()
    for name, command, size in TOOLS:
        if shutil.which(command[0]) is None:
            yield Figure.missing(f"export / {name}", f"needs the program {command[0]}")
        else:
            yield _quicker(name, command, size, max(3, effort.pairs // 2))


def _same() -> Figure:
    case = "same text as hexdump -v -C, 2 MiB"
    if shutil.which("hexdump") is None:
        return Figure.missing(case, "needs the program hexdump")
    content = os.urandom(SLOW_SIZE + 5)
    theirs = subprocess.run(["hexdump", "-v", "-C"], input=content, capture_output=True, check=True).stdout
    same = hexdump(content) == theirs
    return Figure(case, "yes" if same else "no", float(same))


def _quicker(name: str, command: tuple[str, ...], size: int, pairs: int) -> Figure:
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "bytes", Path(folder) / "text"
        source.write_bytes(os.urandom(size))

        def speed(write: Callable[[BinaryIO], object]) -> float:
            with target.open("wb") as file:  # what was written before is cut off outside of the time
                return size / _seconds(lambda: write(file)) / 1e6

        def export(file: BinaryIO) -> None:
            with source.open("rb") as read, mmap(read.fileno(), 0, access=ACCESS_READ) as content:
                for start in range(0, size, 1 << 16):
                    file.write(hexdump(content[start : start + (1 << 16)]))

        def tool(file: BinaryIO) -> None:
            subprocess.run([*command, source], stdout=file, check=True)

        figures = alternate(lambda: speed(export), lambda: speed(tool), pairs)
    note = f"{against(figures, 0, ' MB/s')}; file to file"
    return Figure.of(f"export / {name}", ratios(figures), note=note)


def _seconds(act: Callable[[], object]) -> float:
    began = time.perf_counter()
    act()
    return time.perf_counter() - began
