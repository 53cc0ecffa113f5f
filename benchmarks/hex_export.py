"""M7: the export of bytes says what `hexdump -v -C` says, and is quicker than xxd."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure
from benchmarks.paired import alternate, ratios, spread
from trcvtui.udt.byte_text import hexdump, hexdump_blocks

SIZE: Final = 16 << 20
SLOW_SIZE: Final = 2 << 20  # for hexdump itself
XXD_AIM, HEXDUMP_AIM = 2.0, 20.0
TOOLS: Final = (
    ("xxd", ("xxd",), SIZE, XXD_AIM),
    ("hexdump -v -C", ("hexdump", "-v", "-C"), SLOW_SIZE, HEXDUMP_AIM),
)


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield whether the text is the same, and how many times quicker than each tool it is."""
    yield _same()
    for name, command, size, aim in TOOLS:
        if shutil.which(command[0]) is None:
            yield Figure(f"export / {name}", "not measured", note=f"needs the program {command[0]}")
            continue
        yield _quicker(name, command, size, aim, effort.pairs)


def _same() -> Figure:
    if shutil.which("hexdump") is None:
        return Figure("same text as hexdump -v -C", "not measured", note="needs the program hexdump")
    content = os.urandom(SLOW_SIZE + 5)
    theirs = subprocess.run(["hexdump", "-v", "-C"], input=content, capture_output=True, check=True).stdout
    same = hexdump(content) == theirs
    return Figure("same text as hexdump -v -C, 2 MiB", "yes" if same else "no", "yes", same)


def _quicker(name: str, command: tuple[str, ...], size: int, aim: float, pairs: int) -> Figure:
    content = os.urandom(size)
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "bytes", Path(folder) / "text"
        source.write_bytes(content)

        def ours() -> float:
            return size / _seconds(lambda: _export(content, target))

        def theirs() -> float:
            with target.open("wb") as file:
                return size / _seconds(lambda: subprocess.run([*command, source], stdout=file, check=True))

        figures = alternate(ours, theirs, max(3, pairs // 2))
    share = ratios(figures)
    mine, other = (spread([speed / 1e6 for speed in column]) for column in zip(*figures, strict=True))
    note = f"{mine.text(0, ' MB/s')} against {other.text(0, ' MB/s')}; file to file"
    return Figure(f"export / {name}", share.text(), f">= {aim:.0f}", share.median >= aim, note)


def _export(content: bytes, target: Path) -> None:
    with target.open("wb") as file:
        file.writelines(hexdump_blocks(content))


def _seconds(act: Callable[[], object]) -> float:
    began = time.perf_counter()
    act()
    return time.perf_counter() - began
