"""Names on the real network: the system's own resolver, asked by a process of its own, so that no scan waits.

Rule 1: the system decides where names are known (hosts file, DNS, ...): nothing here speaks DNS.
Rule 2: at most QUESTIONS processes run at a time; one that is no longer asked for is ended.
"""

from __future__ import annotations

import subprocess
import sys
from typing import Final

from trcvtui.net.connection.ipv4 import octets
from trcvtui.net.os.options import error_name
from trcvtui.net.results import WOULD_BLOCK, Fault, WouldBlock

QUESTIONS: Final = 8
LONGEST_ANSWER: Final = 64  # bytes
UNKNOWN: Final = "EAI_NONAME"
# Prints an address or why there is none. Whether nobody knows the name or nobody answers says more of this
# machine than of the partner: both are an unknown name, as on the simulated network. A hosts file knows
# names without their last dot.
PROGRAM: Final = """
import socket, sys
said = "EAI_NONAME"
for name in (sys.argv[1], sys.argv[1].rstrip(".")):
    try:
        said = socket.getaddrinfo(name, None, socket.AF_INET, socket.SOCK_STREAM)[0][4][0]
        break
    except (OSError, UnicodeError):
        pass
print(said)
"""


class Questions:
    """What is being asked, by the handle on whose behalf."""

    def __init__(self) -> None:
        self._asked: dict[int, subprocess.Popen[bytes]] = {}

    def ask(self, handle: int, name: str) -> str | WouldBlock | Fault:
        """Return the address, WOULD_BLOCK while nobody has answered, else the Fault."""
        program = self._asked.get(handle)
        if program is None:
            return self._begin(handle, name)
        if program.poll() is None:
            return WOULD_BLOCK
        assert program.stdout is not None
        said = program.stdout.read(LONGEST_ANSWER).decode("ascii", "replace").strip()
        self.forget(handle)
        if octets(said) is not None:
            return said
        return Fault("resolve", UNKNOWN)

    def _begin(self, handle: int, name: str) -> WouldBlock | Fault:
        if len(self._asked) < QUESTIONS:
            words = [sys.executable, "-I", "-S", "-c", PROGRAM, name]
            null = subprocess.DEVNULL
            try:
                asked = subprocess.Popen(words, stdin=null, stdout=subprocess.PIPE, stderr=null)
            except OSError as problem:
                return Fault("resolve", error_name(problem))
            except ValueError:  # a NUL in the name
                return Fault("resolve", UNKNOWN)
            self._asked[handle] = asked
        return WOULD_BLOCK

    def forget(self, handle: int) -> None:
        """End the question of a handle, if there is one."""
        program = self._asked.pop(handle, None)
        if program is not None:
            program.kill()
            program.wait()
            assert program.stdout is not None
            program.stdout.close()
