"""The partner of a throughput run: a process that sends messages to many ports as fast as they are read.

It is a C program where a compiler is at hand, so that the sender is not what is measured; else this file.
"""

from __future__ import annotations

import selectors
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).parent


@contextmanager
def sending(size: int, ports: Sequence[int], buffer: int = 0) -> Iterator[str]:
    """Send messages of `size` bytes to the ports meanwhile, with this SO_SNDBUF; yield its language."""
    with tempfile.TemporaryDirectory() as folder:
        program = compiled("sender.c", Path(folder))
        command = [str(program)] if program else [sys.executable, str(Path(__file__))]
        process = subprocess.Popen([*command, *map(str, (size, buffer, *ports))], stdin=subprocess.DEVNULL)
        try:
            yield "C" if program else "Python"
        finally:
            process.kill()
            process.wait()


def compiled(source: str, folder: Path) -> Path | None:
    """Return the program made of a C file that stands here; None without Linux and a compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or not sys.platform.startswith("linux"):
        return None
    program = folder / Path(source).stem
    built = subprocess.run([compiler, "-O2", "-o", str(program), str(HERE / source)], capture_output=True)
    return program if built.returncode == 0 else None


def main(size: int, buffer: int, ports: Sequence[int]) -> None:
    """Send until killed, or until a connection breaks."""
    message = b"x" * size
    with selectors.DefaultSelector() as selector:
        for port in ports:
            sock = socket.create_connection(("127.0.0.1", port))
            if buffer:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, buffer)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            sock.setblocking(False)
            selector.register(sock, selectors.EVENT_WRITE, sock)
        while True:
            for key, _ in selector.select():
                try:
                    key.data.send(message)
                except BlockingIOError:
                    continue
                except OSError:
                    return


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), [int(port) for port in sys.argv[3:]])
