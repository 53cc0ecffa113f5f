"""F1: 1,000 lines of 20 simulated agents, and 10,000 of 200, on one Mosquitto.

The real screen in a pseudo terminal of 200 x 50. The rows of an agent that is offline stand first and stay,
so a key is over when the next one of them has the mark; the other lines tell their figures meanwhile.
"""

from __future__ import annotations

import importlib.util
import json
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

from benchmarks.figures import Effort, Figure, percentile, spread
from benchmarks.terminal import Terminal, used_s

AGENTS: Final = (20, 200)
LINES: Final = 50
AGENT_LINES: Final = 50
WALK: Final = 30  # keys down, and as many up
KEYS_A_ROUND: Final = 2 * WALK
PAUSE_S: Final = (0.06, 0.20)
STARTS, ROUNDS = 3, 3
PUBLISH_S: Final = 12.0
READY_S: Final = 30.0
PROGRAM: Final = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
CONFIG: Final = "listener {} 127.0.0.1\nallow_anonymous true\npersistence false\n"
HELPER: Final = Path(__file__).with_name("fleet_agents.py")


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the first list, key to paint, and what everybody takes."""
    if PROGRAM is None or importlib.util.find_spec("paho") is None:
        yield Figure.missing("lines on one Mosquitto", "needs mosquitto and paho-mqtt")
        return
    with tempfile.TemporaryDirectory() as folder, _mosquitto(PROGRAM, Path(folder)) as (port, _):
        share = _published(port)
        note = f"{AGENT_LINES} STATUS, {AGENT_LINES // 10} figures and an ERROR edge a second, QoS 1"
        yield Figure(
            f"an agent's publishing for {AGENT_LINES} lines, of a core", f"{share:.2%}", 100 * share, note
        )
    for agents in AGENTS:  # a broker each: what it retains is not the next one's
        with (
            tempfile.TemporaryDirectory() as folder,
            _mosquitto(PROGRAM, Path(folder)) as (port, broker),
            _agents(port, agents),
        ):
            yield from _screen(port, broker, agents, effort)


@contextmanager
def _mosquitto(program: str, folder: Path) -> Iterator[tuple[int, int]]:
    """Yield the port and the process of a broker as Debian configures it, but for the listener."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port: int = free.getsockname()[1]
    config = folder / "mosquitto.conf"
    config.write_text(CONFIG.format(port))
    os.chmod(folder, 0o755)
    null = subprocess.DEVNULL
    with subprocess.Popen([program, "-c", str(config)], stdout=null, stderr=null) as process:
        until = time.monotonic() + READY_S
        while socket.socket().connect_ex(("127.0.0.1", port)):
            if process.poll() is not None or time.monotonic() > until:
                raise TimeoutError("mosquitto does not listen")
            time.sleep(0.05)
        try:
            yield port, process.pid
        finally:
            process.kill()


def _published(port: int) -> float:
    words = ["publish", str(port), str(AGENT_LINES), str(PUBLISH_S)]
    done = subprocess.run([sys.executable, HELPER, *words], capture_output=True, text=True, check=True)
    return float(json.loads(done.stdout))


@contextmanager
def _agents(port: int, agents: int) -> Iterator[None]:
    words = ["agents", str(port), str(agents), str(LINES)]
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, HELPER, *words], stdin=pipe, stdout=pipe, text=True) as process:
        _wait_for_ready(process.stdout)
        yield
        process.kill()


def _wait_for_ready(said: IO[str] | None) -> None:
    assert said is not None
    if said.readline() != "ready\n":
        raise TimeoutError("the agents have not published")


def _screen(port: int, broker: int, agents: int, effort: Effort) -> Iterator[Figure]:
    command = [sys.executable, "-m", "trcvtui", "fleet", f"mqtt://127.0.0.1:{port}"]
    firsts = []
    for _ in range(min(STARTS, effort.starts)):
        with Terminal(command) as terminal:
            firsts.append(terminal.wait_for([f"{agents * LINES} lines"]))
            terminal.end("q")
    value = f"{max(firsts):.2f} s"
    note = f"from the start of the program, the slowest of {len(firsts)}; the quickest {min(firsts):.2f} s"
    yield Figure(f"first list of {agents * LINES} lines", value, max(firsts), note)
    with Terminal(command) as terminal:
        terminal.wait_for([f"{agents * LINES} lines"])
        terminal.read_for(8.0)  # past events come after the first list
        before, used = time.perf_counter(), (terminal.used_s(), used_s(broker))
        terminal.read_for(float(effort.window_s * 2))
        passed = time.perf_counter() - before
        many = f"{agents} agents"
        yield _share(f"{many}: the screen, of a core", terminal.used_s() - used[0], passed, terminal.process)
        yield _share(f"{many}: the broker, of a core", used_s(broker) - used[1], passed, broker)
        yield from _figures(
            f"{many}: key to paint",
            [ms for _ in range(min(ROUNDS, effort.rounds)) for ms in _walk(terminal)],
        )
        groups = [_press(terminal, "g", text) for _ in range(10) for text in _GROUPS]
        yield from _figures(f"{many}: groups to paint", groups)
        terminal.end("q")


# What stands there after each press of `g`: the groups by site, by cause, the list.
_GROUPS: Final = ("site9  ", "no error in the last hour", "▸✗ site0/agent000/")


def _walk(terminal: Terminal) -> Iterator[float]:
    """Go down and up in the rows that stay; yield after how many ms each key was obeyed."""
    for key, lines in (("j", range(1, WALK + 1)), ("k", range(WALK - 1, -1, -1))):
        for line in lines:
            yield _press(terminal, key, f"▸✗ site0/agent000/L{line:02}")


def _press(terminal: Terminal, key: str, text: str) -> float:
    terminal.read_for(random.uniform(*PAUSE_S))
    terminal.forget()
    began = time.perf_counter()
    terminal.type(key)
    terminal.wait_for([text])
    return 1000 * (time.perf_counter() - began)


def _figures(what: str, keys: Sequence[float]) -> Iterator[Figure]:
    note = f"{len(keys)} keys, latest {max(keys):.0f} ms; {spread(keys).text(1, ' ms')}"
    for share in (0.50, 0.99):
        ms = percentile(keys, share)
        yield Figure(f"{what} p{100 * share:.0f}", f"{ms:.1f} ms", ms, note)


def _share(case: str, used: float, passed: float, process: int) -> Figure:
    share = used / passed
    return Figure(case, f"{share:.1%}", share, f"{_mb(process):.0f} MB resident")


def _mb(process: int) -> float:
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / (1 << 20)
