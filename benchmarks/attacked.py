"""Eight good connections at T#10ms, alone and beside one attack, in turn: DONEs, and who overran (E1).

The good partners send as fast as their blocks take it: one DONE in two scans each is the ceiling.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from benchmarks.attackers import ATTACKS
from benchmarks.figures import Effort, Figure, ratios
from benchmarks.paced import Count, PacedEngine
from benchmarks.scans import Scans, overruns
from benchmarks.sender import sending

GOOD: Final = 8
MESSAGE: Final = 64
INTERVAL_NS: Final = 10_000_000
LEAD_IN_S: Final = 1.0
MOST_PAIRS: Final = 3  # of eight attacks each: two to three minutes
TO_BEGIN_S: Final = 0.3  # for an attacker, and for what it leaves behind
SCRIPT: Final = Path(__file__).parents[1] / "configs" / "tls" / "make_certificates.sh"
TARGETS: Final = {
    "iso": 'type = "TCON_IP_RFC"\nIsoPort = 0\nLocalTSelector = "16#E0FF"',
    "tls": 'type = "TCON_IP_V4_SEC"\nListenPort = 0\nActivateSecureConn = true\nTLSServerCertRef = 1',
    "plain": "LocalPort = 0",
    "udp": 'type = "TCON_IP_v4"\nConnectionType = 19\nListenPort = 0',
}
AT: Final = {"handshakes": "tls", "one-byte records": "tls", "clients": "plain", "datagrams": "udp"}


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield, for each attack, DONEs beside it / DONEs alone, and the overruns of both."""
    if shutil.which("openssl") is None:
        yield Figure.missing("attacks", "the openssl program makes the certificates")
        return
    for attack in ATTACKS:
        yield from _beside(effort, attack)


def _beside(effort: Effort, attack: str) -> Iterator[Figure]:
    target = next((kind for word, kind in AT.items() if attack.startswith(word)), "iso")
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["sh", str(SCRIPT), f"{folder}/certificates"], check=True, capture_output=True)
        with PacedEngine(Path(folder), _project(target), GOOD + 1) as engine:
            *good, victim = engine.ports(GOOD + 1)
            with sending(MESSAGE, good):
                engine.count_after(LEAD_IN_S)
                pairs = []
                begin = engine.count_after(LEAD_IN_S)
                for _ in range(min(effort.rounds + 1, MOST_PAIRS)):
                    alone = _dones(engine, effort.window_s)
                    with attacking(attack, victim):
                        time.sleep(TO_BEGIN_S)
                        pairs.append((_dones(engine, effort.window_s), alone))
                    time.sleep(TO_BEGIN_S)
                end = engine.count_after(0)
        scans = Scans.read(engine.timing, INTERVAL_NS).between(begin.at_ns, end.at_ns)
    yield Figure.of(f"{attack}: DONE beside / alone", ratios(pairs), 3)
    yield overruns(attack, scans)


def _dones(engine: PacedEngine, seconds: float) -> float:
    """Return the DONEs of the good ones for each second of the bench's time."""
    before, after = engine.count_after(0), engine.count_after(seconds)
    return _of_the_good(before, after) / (after.t_ns - before.t_ns)


def _of_the_good(before: Count, after: Count) -> int:
    return sum(after.each[:GOOD]) - sum(before.each[:GOOD])


@contextmanager
def attacking(attack: str, port: int) -> Iterator[None]:
    """Let one attacker go on meanwhile."""
    script = Path(__file__).with_name("attackers.py")
    process = subprocess.Popen([sys.executable, str(script), attack, str(port)], stdin=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def _project(target: str) -> str:
    """Return eight passive CONNECTs with a TRCV_C each, and a ninth of the kind that is attacked."""
    parts = [
        'dialect = "s7-1500"',
        '[[task]]\nname = "MAIN"\ninterval = "T#10ms"',
        '[[certificate]]\nnumber = 1\nfile = "certificates/plc.pem"\nkey = "certificates/plc.key"',
        '[[addr]]\nname = "A"',
    ]
    for number in range(GOOD + 1):
        described = TARGETS[target] if number == GOOD else TARGETS["plain"]
        addr = 'addr = "A"\n' if described == TARGETS["udp"] else ""
        parts.append(
            f'[[data]]\nname = "rx{number}"\ntype = "ARRAY[1..{MESSAGE}] OF BYTE"\n'
            f'[[connect]]\nname = "C{number}"\n{described}\n'
            f'[[instance]]\nname = "R{number}"\nblock = "TRCV_C"\nconnect = "C{number}"\n'
            f'data = "rx{number}"\n{addr}CONT = true\nEN_R = true'
        )
    return "\n\n".join(parts) + "\n"
